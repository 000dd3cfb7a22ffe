//! The weighted least-squares wave fit in the thesis's place of the Gabor bank.
//!
//! Same bank, same window, same smoothing as [`super::GaborEstimator`]; only the reading differs: both
//! senses of rotation and a constant are fitted together ([`super::fit`]), so a held pose reads exactly
//! zero and a movement along a line reads as well as a loop. The share of explained energy takes the
//! place of the thesis's noise test.

use super::bank::Bank;
use super::fit::{Prior, Task};
use super::history::History;
use super::shape::{C, Shape};
use super::smooth::Smoother;
use super::{Estimator, LONGEST_GAP_S, PlanePoint, WaveEstimate};
use crate::base::angle::wrap_tau;
use crate::gesture::GestureOptions;
use std::f64::consts::TAU;

/// Lines of the bank.
const LINES: usize = 50;
/// Lowest and highest frequency of the bank, Hz: a little beyond 0.2 to 6.
pub(super) const BANK_HZ: (f64, f64) = (0.19, 6.3);
/// Frequencies the fit may end at, Hz.
pub(super) const RANGE_HZ: (f64, f64) = (0.15, 8.0);

/// A window's deviation spans at least this many samples, or seven unknowns explain everything.
pub(super) const LEAST_SAMPLES: f64 = 6.0;

/// Bank and fit, with the thesis's smoothing and phase fusion.
#[derive(Clone, Debug)]
pub struct LeastSquaresEstimator {
    history: History,
    bank: Bank,
    shape: Shape,
    lambda: f64,
    smoother: Smoother,
}

impl LeastSquaresEstimator {
    /// An estimator without history for a gesture of this shape. Allocates all it will ever need.
    pub fn new(options: &GestureOptions, shape: Shape) -> Self {
        let (low, high) = BANK_HZ;
        Self {
            history: History::new(),
            bank: Bank::new(LINES, low, high, options.lambda, shape),
            shape,
            lambda: options.lambda,
            smoother: Smoother::new(options.smoothing_s, options.fusion_s),
        }
    }

    fn read(&self) -> WaveEstimate {
        let silent = WaveEstimate::default();
        // Before a line has seen half a period it cannot tell a wave from a drift.
        let Some(seed) = self.bank.best(|c| c.periods > 0.3) else {
            return silent;
        };
        let task = Task {
            blocks: self.history.blocks(seed.frequency_hz.abs()),
            shape: &self.shape,
            lambda: self.lambda,
            least_s: LEAST_SAMPLES * self.history.step_s(),
            since_s: f64::INFINITY,
            variance: 0.01,
            prior: Prior {
                a: 2.0,
                b: 1.0,
                c: None,
                omega: 0.3,
            },
        };
        let Some(fit) = task.from_frequency(TAU * seed.frequency_hz, C::default(), 3) else {
            return silent;
        };
        let hz = fit.wave.omega / TAU;
        if !(RANGE_HZ.0..=RANGE_HZ.1).contains(&hz.abs()) {
            return silent;
        }
        let explained = fit.explained();
        let share = gate(explained, fit.evidence());
        WaveEstimate {
            amplitude: share * fit.wave.a.norm(),
            frequency_hz: hz,
            phase_rad: wrap_tau(fit.wave.a.arg()),
            quality: explained,
        }
    }
}

/// Share of an amplitude that is believed: none below a third of explained energy, all above 0.6, and
/// only what chance does not make: the best of a bank of noise reaches an evidence of about ten.
pub(super) fn gate(explained: f64, evidence: f64) -> f64 {
    let shape = ((explained - 1.0 / 3.0) / (0.6 - 1.0 / 3.0)).clamp(0.0, 1.0);
    let chance = ((evidence - 8.0) / 6.0).clamp(0.0, 1.0);
    shape * chance
}

impl Estimator for LeastSquaresEstimator {
    fn push(&mut self, t: f64, point: PlanePoint) {
        if self.history.push(t, point, LONGEST_GAP_S) {
            self.bank.clear();
            self.smoother.reset();
        }
        self.bank.push(t, C::new(point.z[0], point.z[1]));
        let raw = self.read();
        self.smoother.push(t, raw);
    }

    fn estimate(&self) -> WaveEstimate {
        self.smoother.estimate()
    }

    fn reset(&mut self) {
        self.history.clear();
        self.bank.clear();
        self.smoother.reset();
    }
}
