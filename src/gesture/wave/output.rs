//! Steadies the locked fit's readings: lightly while its window is short, as the window allows otherwise.

use super::WaveEstimate;
use crate::base::angle::{wrap_pi, wrap_tau};
use std::f64::consts::TAU;

/// Time constant of amplitude and frequency with a short window and with a full one, seconds.
const SMOOTH_S: (f64, f64) = (0.04, 0.2);
/// Time constant with which the phase is drawn to its reading, seconds.
const PHASE_S: f64 = 0.08;
/// Fastest correction of the phase, rad/s: a sixth of a radian in a frame of 30 Hz.
const FASTEST_CORRECTION: f64 = 5.0;
/// Below this amplitude a gesture is silent: its phase means nothing.
const SILENT: f64 = 0.02;

/// Smoothed amplitude, frequency and phase of one gesture.
///
/// The phase runs on at the smoothed frequency and is drawn to its reading, never backwards while the
/// gesture is performed steadily.
#[derive(Copy, Clone, Debug, Default)]
pub(super) struct Output {
    estimate: WaveEstimate,
}

impl Output {
    /// Takes a reading `dt` seconds after the last; `full`: how full its window is, 0..1.
    pub fn push(&mut self, dt: f64, raw: WaveEstimate, full: f64) {
        let out = &mut self.estimate;
        let was_silent = out.amplitude < SILENT;
        let follow = |seconds: f64| 1.0 - (-dt / seconds).exp();
        let gain = follow(SMOOTH_S.0 + full * full * (SMOOTH_S.1 - SMOOTH_S.0));
        out.amplitude += gain * (raw.amplitude - out.amplitude);
        out.quality = raw.quality;
        if raw.amplitude > 0.0 {
            let flipped = raw.frequency_hz * out.frequency_hz <= 0.0;
            if was_silent || flipped {
                out.frequency_hz = raw.frequency_hz;
            } else {
                out.frequency_hz += gain * (raw.frequency_hz - out.frequency_hz);
            }
        }
        let advance = TAU * out.frequency_hz * dt;
        let predicted = out.phase_rad + advance;
        out.phase_rad = if was_silent {
            raw.phase_rad
        } else if raw.amplitude <= 0.0 {
            wrap_tau(predicted)
        } else {
            let limit = FASTEST_CORRECTION * dt;
            let way = follow(PHASE_S) * wrap_pi(raw.phase_rad - predicted);
            let mut correction = way.clamp(-limit, limit);
            if correction * advance < 0.0 {
                let most = 0.9 * advance.abs();
                correction = correction.clamp(-most, most);
            }
            wrap_tau(predicted + correction)
        };
    }

    /// What it has come to.
    pub fn estimate(&self) -> WaveEstimate {
        self.estimate
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        self.estimate = WaveEstimate::default();
    }
}
