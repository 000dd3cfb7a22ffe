//! Steadies raw estimates: causal Gaussian on amplitude and frequency, fusion of the phase.

use super::WaveEstimate;
use super::window::Window;
use crate::base::angle::{wrap_pi, wrap_tau};
use std::f64::consts::TAU;

/// Values kept: 0.6 s (three deviations) at up to 1700 Hz; at higher rates the window shortens.
const CAPACITY: usize = 1024;

/// A hole in the data counts as at most this long, in seconds.
const LONGEST_STEP_S: f64 = 0.1;

#[derive(Copy, Clone, Debug)]
struct Raw {
    t: f64,
    step_s: f64,
    amplitude: f64,
    frequency_hz: f64,
}

/// Smoothing of one gesture's raw estimates (Rhodin 2016, "Discontinuity compensation", eq. 9.6).
///
/// - Amplitude: weighted mean over the past, Gaussian with deviation `sigma_s` centred on now.
/// - Frequency: the same, each value weighing as its amplitude, since the frequency of silence is
///   noise; when all is silent the last frequency stays.
/// - Phase: predicted from the last one by the smoothed frequency and drawn to the raw phase with
///   time constant `fusion_s` (the thesis's gamma = 10 frames at 30 Hz is 0.35 s). The correction
///   never turns the phase back: at most nine tenths of the predicted advance are taken away.
///   While silent the phase follows the raw one at once, so a gesture starts in step.
#[derive(Clone, Debug)]
pub(super) struct Smoother {
    raw: Window<Raw>,
    sigma_s: f64,
    fusion_s: f64,
    estimate: WaveEstimate,
}

/// Below this amplitude a gesture is silent: its phase means nothing.
const SILENT: f64 = 0.02;

impl Smoother {
    pub fn new(sigma_s: f64, fusion_s: f64) -> Self {
        Self {
            raw: Window::new(CAPACITY),
            sigma_s,
            fusion_s,
            estimate: WaveEstimate::default(),
        }
    }

    pub fn push(&mut self, t: f64, raw: WaveEstimate) {
        let step_s = self.raw.values().last().map_or(0.0, |last| t - last.t);
        self.raw.push(Raw {
            t,
            step_s: step_s.clamp(1e-6, LONGEST_STEP_S),
            amplitude: raw.amplitude,
            frequency_hz: raw.frequency_hz,
        });
        let reach = 3.0 * self.sigma_s;
        self.raw.forget(|old| t - old.t > reach);
        let (mut weight, mut amplitude, mut frequency) = (0.0, 0.0, 0.0);
        for value in self.raw.values() {
            let u = (t - value.t) / self.sigma_s.max(1e-9);
            let w = value.step_s * (-0.5 * u * u).exp();
            weight += w;
            amplitude += w * value.amplitude;
            frequency += w * value.amplitude * value.frequency_hz;
        }
        let was_silent = self.estimate.amplitude < SILENT;
        if amplitude > 1e-9 * weight {
            self.estimate.frequency_hz = frequency / amplitude;
        }
        self.estimate.amplitude = if weight > 0.0 {
            amplitude / weight
        } else {
            raw.amplitude
        };
        self.estimate.quality = raw.quality;
        let advance = TAU * self.estimate.frequency_hz * step_s;
        let predicted = self.estimate.phase_rad + advance;
        self.estimate.phase_rad = if was_silent {
            raw.phase_rad
        } else if raw.amplitude <= 0.0 {
            // Nothing to hold on to: the phase runs on, the amplitude is falling anyway.
            wrap_tau(predicted)
        } else {
            let gain = 1.0 - (-step_s / self.fusion_s.max(1e-9)).exp();
            let mut correction = gain * wrap_pi(raw.phase_rad - predicted);
            let limit = 0.9 * advance.abs();
            if correction * advance < 0.0 {
                correction = correction.clamp(-limit, limit);
            }
            wrap_tau(predicted + correction)
        };
    }

    pub fn estimate(&self) -> WaveEstimate {
        self.estimate
    }

    pub fn reset(&mut self) {
        self.raw.clear();
        self.estimate = WaveEstimate::default();
    }
}

/// Causal Gaussian smoothing of a progression; without allocation after construction.
#[derive(Clone, Debug)]
pub(in crate::gesture) struct ProgressionSmoother {
    /// Time and value.
    raw: Window<(f64, f64)>,
    sigma_s: f64,
}

impl ProgressionSmoother {
    pub fn new(sigma_s: f64) -> Self {
        Self {
            raw: Window::new(CAPACITY),
            sigma_s,
        }
    }

    /// Takes the next value and returns the smoothed one.
    pub fn push(&mut self, t: f64, value: f64) -> f64 {
        self.raw.push((t, value));
        let reach = 3.0 * self.sigma_s;
        self.raw.forget(|(then, _)| t - then > reach);
        let (mut sum, mut weight) = (0.0, 0.0);
        for (then, value) in self.raw.values() {
            let u = (t - then) / self.sigma_s.max(1e-9);
            let w = (-0.5 * u * u).exp();
            weight += w;
            sum += w * value;
        }
        if weight > 0.0 { sum / weight } else { value }
    }

    pub fn reset(&mut self) {
        self.raw.clear();
    }
}
