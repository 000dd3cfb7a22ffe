//! Baseline: amplitude and phase straight from the present point, `|z|` and `atan2`.
//!
//! What the thesis compares its filter with. The frequency is the turn from sample to sample, steadied
//! like the amplitude by the thesis's smoothing. A held pose away from the centre reads as a wave of
//! frequency zero, noise as a wave of its own size: that is what the other estimators are for.

use super::smooth::Smoother;
use super::{Estimator, LONGEST_GAP_S, PlanePoint, WaveEstimate};
use crate::base::angle::{wrap_pi, wrap_tau};
use crate::gesture::GestureOptions;
use std::f64::consts::TAU;

/// Modulus and argument of the present point.
#[derive(Clone, Debug)]
pub struct DirectEstimator {
    last: Option<(f64, f64)>,
    smoother: Smoother,
}

impl DirectEstimator {
    /// An estimator without history.
    pub fn new(options: &GestureOptions) -> Self {
        Self {
            last: None,
            smoother: Smoother::new(options.smoothing_s, options.fusion_s),
        }
    }
}

impl Estimator for DirectEstimator {
    fn push(&mut self, t: f64, point: PlanePoint) {
        if self.last.is_some_and(|(then, _)| t - then > LONGEST_GAP_S) {
            self.reset();
        }
        let [x, y] = point.z;
        let phase = y.atan2(x);
        let frequency_hz = self.last.map_or(0.0, |(then, before)| {
            wrap_pi(phase - before) / TAU / (t - then).max(1e-6)
        });
        self.last = Some((t, phase));
        self.smoother.push(
            t,
            WaveEstimate {
                amplitude: x.hypot(y),
                frequency_hz,
                phase_rad: wrap_tau(phase),
                quality: 1.0,
            },
        );
    }

    fn estimate(&self) -> WaveEstimate {
        self.smoother.estimate()
    }

    fn reset(&mut self) {
        self.last = None;
        self.smoother.reset();
    }
}
