//! The one-sided Gabor function as a table: all filters of a bank are one function, stretched.
//!
//! With the Gaussian's deviation proportional to the period (lambda / f), a filter depends on
//! u = f * lag alone, so one table in units of cycles serves every frequency.

use std::f64::consts::TAU;

/// Entries per cycle; linear interpolation then errs by less than 2e-5.
const PER_CYCLE: f64 = 512.0;

/// The Gaussian is cut at this many deviations, where it has fallen to 1.1 %.
pub(super) const CUT: f64 = 3.0;

/// Values of the function at one lag.
#[derive(Copy, Clone, Debug, Default)]
pub(super) struct Tap {
    /// The Gaussian alone.
    pub gauss: f64,
    /// Gaussian times cosine of the angle travelled since.
    pub cos: f64,
    /// Gaussian times its sine.
    pub sin: f64,
}

/// Table of [`Tap`]s over lags of 0 to 3 lambda cycles.
#[derive(Clone, Debug)]
pub(super) struct Kernel {
    taps: Vec<Tap>,
    /// Longest lag in cycles.
    pub cut_cycles: f64,
    lambda: f64,
}

impl Kernel {
    /// A table for windows of `lambda` periods (standard deviation).
    pub fn new(lambda: f64) -> Self {
        let cut_cycles = CUT * lambda;
        let entries = (cut_cycles * PER_CYCLE).ceil() as usize + 2;
        let taps = (0..entries)
            .map(|index| {
                let u = index as f64 / PER_CYCLE;
                let gauss = (-0.5 * (u / lambda).powi(2)).exp();
                let (sin, cos) = (TAU * u).sin_cos();
                Tap {
                    gauss,
                    cos: gauss * cos,
                    sin: gauss * sin,
                }
            })
            .collect();
        Self {
            taps,
            cut_cycles,
            lambda,
        }
    }

    /// The taps at a lag of `u` cycles; zero beyond the cut.
    #[inline]
    pub fn at(&self, u: f64) -> Tap {
        let place = u * PER_CYCLE;
        let index = place as usize;
        let fraction = place - index as f64;
        match self.taps.get(index..index + 2) {
            Some([a, b]) => Tap {
                gauss: a.gauss + fraction * (b.gauss - a.gauss),
                cos: a.cos + fraction * (b.cos - a.cos),
                sin: a.sin + fraction * (b.sin - a.sin),
            },
            _ => Tap::default(),
        }
    }

    /// Share of the full window that lies within `cycles` of now, 0..1.
    pub fn coverage(&self, cycles: f64) -> f64 {
        let full = error_function(CUT / std::f64::consts::SQRT_2);
        (error_function(cycles.max(0.0) / self.lambda / std::f64::consts::SQRT_2) / full).min(1.0)
    }
}

/// The error function, to 1.5e-7 (Abramowitz and Stegun 7.1.26), for arguments >= 0.
fn error_function(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.3275911 * x);
    let poly = t
        * (0.254829592
            + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))));
    1.0 - poly * (-x * x).exp()
}
