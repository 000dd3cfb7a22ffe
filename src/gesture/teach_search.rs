//! Where in a stretch of motion the gesture is: its period and best start, or its rest and extreme.

use super::PeriodEstimate;
use super::frames::{distance, resampled, spread};
use super::period::find_period;
use crate::pose::Recording;

/// A pose has moved when its points left their mean by this share of the body's size.
pub(super) const MOVED: f64 = 0.02;
/// Autocorrelation that a gesture needs at the end of a recording.
pub(super) const PERIODIC: f64 = 0.5;
/// Periods after which a very regular motion is certain, and after which any is.
pub(super) const EARLY: f64 = 2.2;
const LATE: f64 = 3.3;
/// Periods that must at least be there when the recording ends.
pub(super) const LEAST: f64 = 1.4;
/// Autocorrelation of a very regular motion, and of one that is regular enough after [`LATE`] periods.
const VERY_REGULAR: f64 = 0.85;
const REGULAR: f64 = 0.6;
/// Two looks in a row must agree on the period to this share.
const AGREE: f64 = 0.06;
/// Only the newest part of a long recording is looked at, seconds.
const LOOK_BACK_S: f64 = 16.0;
/// A pose that stays still this long rests, seconds.
pub(super) const SETTLED_S: f64 = 0.5;
/// A resting pose moves by less than this share of the way it has gone.
const STILL: f64 = 0.12;
/// The movement begins and ends where the pose has left rest, or come to the extreme, up to this share.
const NEAR: f64 = 0.08;
/// Half width of the stretch that is compared when looking for a start, in periods.
const COMPARED: f64 = 0.15;

/// Rest and extreme of a movement, seconds on the recording's clock.
#[derive(Copy, Clone, Debug, PartialEq)]
pub(super) struct Found {
    pub rest_s: f64,
    pub extreme_s: f64,
}

/// A recorded stretch, its poses without global motion, and where the performance may begin.
pub(super) struct Motion {
    pub recording: Recording,
    pub local: Vec<Vec<f64>>,
    pub start: usize,
    pub points: usize,
    pub needed_m: f64,
}

impl Motion {
    fn t(&self, index: usize) -> f64 {
        self.recording.samples[index].t
    }

    /// First sample that is looked at.
    fn from(&self) -> usize {
        let end = self.recording.span_s().1;
        let from = (self.recording.samples).partition_point(|s| s.t < end - LOOK_BACK_S);
        from.max(self.start)
    }

    fn span_s(&self) -> f64 {
        self.recording.span_s().1 - self.t(self.from())
    }

    fn per_point(&self, square: f64) -> f64 {
        (square / self.points.max(1) as f64).sqrt()
    }

    /// How far the pose moved, root mean square over points and time, metres.
    pub fn moved_m(&self) -> f64 {
        self.per_point(spread(&self.local[self.start..]).powi(2))
    }

    /// The period of the newest part.
    pub fn period(&self) -> Option<PeriodEstimate> {
        let from = self.from();
        let samples = self.local.len().saturating_sub(from);
        if samples < 8 {
            return None;
        }
        let step = (self.span_s() / (samples - 1) as f64).max(1e-3);
        find_period(&resampled(&self.recording, &self.local, from, step), step)
    }

    /// Whether the stretch holds `count` periods.
    pub fn spans(&self, period: &PeriodEstimate, count: f64) -> bool {
        self.span_s() >= count * period.period_s
    }

    /// Whether the period is known well enough to stop.
    pub fn is_certain(&self, before: Option<PeriodEstimate>, now: Option<PeriodEstimate>) -> bool {
        let (Some(before), Some(now)) = (before, now) else {
            return false;
        };
        let agree = (before.period_s - now.period_s).abs() <= AGREE * now.period_s;
        agree
            && ((now.periodicity >= VERY_REGULAR && self.spans(&now, EARLY))
                || (now.periodicity >= REGULAR && self.spans(&now, LATE)))
    }

    /// The start whose surroundings come back best one period later: past what led into the movement.
    pub fn best_start(&self, period_s: f64) -> f64 {
        let from = self.from();
        let samples = self.local.len().saturating_sub(from).max(2);
        let step = (self.span_s() / (samples - 1) as f64).max(1e-3);
        let rows = resampled(&self.recording, &self.local, from, step);
        let lag = (period_s / step).round() as usize;
        let half = (COMPARED * period_s / step) as usize;
        let last = rows.len().saturating_sub(lag + half + 1);
        let error = |k: usize| -> f64 {
            let low = k.saturating_sub(half);
            let pairs = low..=(k + half).min(rows.len() - 1 - lag);
            let count = pairs.clone().count().max(1) as f64;
            pairs
                .map(|i| distance(&rows[i], &rows[i + lag]))
                .sum::<f64>()
                / count
        };
        let best = (0..last).min_by(|a, b| error(*a).total_cmp(&error(*b)));
        self.t(from) + best.unwrap_or(0) as f64 * step
    }

    /// Rest and extreme, once the pose stays at an extreme or has turned back half of the way.
    pub fn extreme(&self) -> Option<Found> {
        let rest = self.local.get(self.start)?;
        let away = |row: &Vec<f64>| self.per_point(distance(row, rest));
        let rows = &self.local[self.start..];
        let ways: Vec<f64> = rows.iter().map(away).collect();
        let far = (0..ways.len()).max_by(|a, b| ways[*a].total_cmp(&ways[*b]))?;
        let (way, last) = (ways[far], ways.len() - 1);
        if way <= 2.0 * self.needed_m {
            return None;
        }
        let t = |k: usize| self.t(self.start + k);
        let settled_from = (0..=last).find(|k| t(*k) >= t(last) - SETTLED_S)?;
        let rests = settled_from > 0
            && ways[last] > 0.5 * way
            && self.per_point(spread(&rows[settled_from..]).powi(2)) < STILL * way;
        let extreme = if rests {
            // Where it arrived: near where it now rests.
            (0..=last).find(|k| self.per_point(distance(&rows[*k], &rows[last])) < NEAR * way)?
        } else if ways[last] < 0.5 * way {
            far
        } else {
            return None;
        };
        let rest = (0..extreme).rev().find(|k| ways[*k] < NEAR * way)?;
        Some(Found {
            rest_s: t(rest),
            extreme_s: t(extreme),
        })
    }
}
