//! Frames at uneven times brought to even ones.

use super::raw::RawFrame;

/// Times this far from even, as a share of the step, are even but for rounding in the file.
const ROUNDING: f64 = 0.02;

/// Even times that cover what a file has.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    pub dt_s: f64,
    pub frames: usize,
    /// Whether frames must be made anew.
    pub uneven: bool,
}

impl Grid {
    /// The grid for frames at `times` (growing): their own where they are even, else the median step, or
    /// `rate_hz` where it is given and differs.
    pub fn of(times: &[f64], rate_hz: Option<f64>) -> Self {
        let count = times.len();
        let (Some(first), Some(last)) = (times.first(), times.last()) else {
            return Self {
                dt_s: 1.0,
                frames: 0,
                uneven: false,
            };
        };
        if count < 2 {
            return Self {
                dt_s: 1.0 / rate_hz.unwrap_or(60.0),
                frames: count,
                uneven: false,
            };
        }
        let span = last - first;
        let mean = span / (count - 1) as f64;
        let off = |(k, t): (usize, &f64)| (t - first - mean * k as f64).abs();
        let even = times.iter().enumerate().map(off).fold(0.0, f64::max) <= ROUNDING * mean;
        let same_rate = rate_hz.is_none_or(|r| (r * mean - 1.0).abs() < ROUNDING);
        if even && same_rate {
            return Self {
                dt_s: mean,
                frames: count,
                uneven: false,
            };
        }
        let mut steps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
        steps.sort_by(f64::total_cmp);
        let step = rate_hz.map_or(steps[steps.len() / 2], |r| 1.0 / r);
        // Saturating: a step of next to nothing gives more frames than are allowed, and is refused.
        let intervals = (span / step).round().max(1.0) as usize;
        Self {
            dt_s: span / intervals as f64,
            frames: intervals.saturating_add(1),
            uneven: true,
        }
    }

    /// For frame `k` of the grid: the frame before it in `times`, and how far it is to the next, 0..1.
    pub fn between(&self, times: &[f64], k: usize) -> (usize, f64) {
        let last = times.len().saturating_sub(1);
        let t = times.first().copied().unwrap_or_default() + self.dt_s * k as f64;
        let before = times.partition_point(|x| *x <= t).clamp(1, last.max(1)) - 1;
        match (times.get(before), times.get(before + 1)) {
            (Some(a), Some(b)) => (before, ((t - a) / (b - a)).clamp(0.0, 1.0)),
            _ => (before, 0.0),
        }
    }
}

/// The frames on the grid: places linear, rotations at constant speed between frames.
pub(super) fn frames(times: &[f64], frames: &[RawFrame], grid: &Grid) -> Vec<RawFrame> {
    if !grid.uneven {
        return frames.to_vec();
    }
    (0..grid.frames)
        .map(|k| {
            let (before, u) = grid.between(times, k);
            let a = &frames[before];
            let Some(b) = frames.get(before + 1) else {
                return a.clone();
            };
            let turns = a.rotations.iter().zip(&b.rotations);
            RawFrame {
                place: a.place + u * (b.place - a.place),
                rotations: turns
                    .map(|(a, b)| a.try_slerp(b, u, 1e-9).unwrap_or(*a))
                    .collect(),
            }
        })
        .collect()
}

/// Rows of numbers on the grid, linear between frames.
pub(super) fn rows(times: &[f64], rows: &[Vec<f64>], grid: &Grid) -> Vec<Vec<f64>> {
    if !grid.uneven {
        return rows.to_vec();
    }
    (0..grid.frames)
        .map(|k| {
            let (before, u) = grid.between(times, k);
            let a = &rows[before];
            let b = rows.get(before + 1).unwrap_or(a);
            a.iter().zip(b).map(|(a, b)| a + u * (b - a)).collect()
        })
        .collect()
}
