//! Baseline: frequency by autocorrelation, phase by cross-correlation with the reference.
//!
//! After Shiratori and Hodgins, *Accelerometer-based user interfaces for the control of a physically
//! simulated character* (2008), as the thesis compares its filter with it: the last five seconds at even
//! steps; the period is the lag of the highest peak of the normalised autocorrelation; over the last
//! period, phase and size follow from the correlation with the gesture's own figure.

use super::history::{HISTORY_S, History};
use super::shape::{C, Shape};
use super::smooth::Smoother;
use super::{Estimator, LONGEST_GAP_S, PlanePoint, WaveEstimate};
use crate::base::angle::wrap_tau;
use crate::gesture::GestureOptions;
use std::f64::consts::TAU;

/// Even steps over the history: 33 ms, the thesis's frames.
const STEPS: usize = 150;
/// Shortest and longest lag, steps: 6 Hz, and half of the history.
const LAGS: (usize, usize) = (5, STEPS / 2);
/// Autocorrelation below which nothing is periodic.
const PERIODIC: f64 = 0.3;
/// A peak this close to the highest one is as good; of those the shortest lag counts.
const AS_GOOD: f64 = 0.9;

/// Correlations of the recent past with itself and with the reference.
#[derive(Clone, Debug)]
pub struct CorrelationEstimator {
    history: History,
    shape: Shape,
    /// Newest first.
    even: [C; STEPS],
    smoother: Smoother,
}

impl CorrelationEstimator {
    /// An estimator without history for a gesture of this shape. Allocates all it will ever need.
    pub fn new(options: &GestureOptions, shape: Shape) -> Self {
        Self {
            history: History::new(),
            shape,
            even: [C::default(); STEPS],
            smoother: Smoother::new(options.smoothing_s, options.fusion_s),
        }
    }

    /// The history at even steps by linear interpolation; returns how many there are.
    fn resample(&mut self) -> usize {
        let step = HISTORY_S / STEPS as f64;
        let samples = self.history.samples();
        let mut at = 0;
        for (k, even) in self.even.iter_mut().enumerate() {
            let lag = k as f64 * step;
            while samples.get(at + 1).is_some_and(|older| older.lag_s < lag) {
                at += 1;
            }
            let (Some(newer), Some(older)) = (samples.get(at), samples.get(at + 1)) else {
                return k;
            };
            let u = (lag - newer.lag_s) / (older.lag_s - newer.lag_s).max(1e-9);
            let mix = |axis: usize| newer.z[axis] + u * (older.z[axis] - newer.z[axis]);
            *even = C::new(mix(0), mix(1));
        }
        STEPS
    }

    fn read(&mut self) -> WaveEstimate {
        let silent = WaveEstimate::default();
        let count = self.resample();
        if count < 2 * LAGS.0 {
            return silent;
        }
        let mean: C = self.even[..count].iter().sum::<C>() / count as f64;
        let correlation = |lag: usize| {
            let (mut product, mut squares) = (0.0, 0.0);
            for (newer, older) in self.even[..count].iter().zip(&self.even[lag..count]) {
                let (newer, older) = (newer - mean, older - mean);
                product += (newer * older.conj()).re;
                squares += newer.norm_sqr() + older.norm_sqr();
            }
            2.0 * product / f64::max(squares, 1e-12)
        };
        let longest = LAGS.1.min(count / 2);
        let mut values = [0.0; LAGS.1 + 2];
        for (lag, value) in values.iter_mut().enumerate().take(longest + 2).skip(1) {
            *value = correlation(lag);
        }
        let is_peak = |lag: usize| values[lag] >= values[lag - 1] && values[lag] > values[lag + 1];
        let peaks = || (LAGS.0..=longest).filter(|lag| is_peak(*lag));
        let highest = peaks().map(|lag| values[lag]).fold(0.0, f64::max);
        let found = peaks().find(|lag| values[*lag] >= AS_GOOD * highest);
        let Some(lag) = found.filter(|lag| values[*lag] >= PERIODIC) else {
            return silent;
        };
        let (a, b, c) = (values[lag - 1], values[lag], values[lag + 1]);
        let bend = a - 2.0 * b + c;
        let offset = if bend < 0.0 {
            (0.5 * (a - c) / bend).clamp(-0.5, 0.5)
        } else {
            0.0
        };
        let step = HISTORY_S / STEPS as f64;
        let period_steps = lag as f64 + offset;
        // The last period against the figure, performed either way round.
        let last = &self.even[..lag.min(count)];
        let centre: C = last.iter().sum::<C>() / last.len() as f64;
        let match_of = |sense: f64| {
            let mut sum = C::default();
            for (k, z) in last.iter().enumerate() {
                let turn = C::from_polar(1.0, -sense * TAU * k as f64 / period_steps);
                let z = z - centre;
                sum += self.shape.forward.conj() * z * turn.conj()
                    + (self.shape.backward.conj() * z * turn).conj();
            }
            sum / (self.shape.power() * last.len() as f64)
        };
        let (forward, backward) = (match_of(1.0), match_of(-1.0));
        let (wave, sense) = if backward.norm() > 1.1 * forward.norm() {
            (backward, -1.0)
        } else {
            (forward, 1.0)
        };
        WaveEstimate {
            amplitude: wave.norm(),
            frequency_hz: sense / (period_steps * step),
            phase_rad: wrap_tau(wave.arg()),
            quality: values[lag].clamp(0.0, 1.0),
        }
    }
}

impl Estimator for CorrelationEstimator {
    fn push(&mut self, t: f64, point: PlanePoint) {
        if self.history.push(t, point, LONGEST_GAP_S) {
            self.smoother.reset();
        }
        let raw = self.read();
        self.smoother.push(t, raw);
    }

    fn estimate(&self) -> WaveEstimate {
        self.smoother.estimate()
    }

    fn reset(&mut self) {
        self.history.clear();
        self.smoother.reset();
    }
}
