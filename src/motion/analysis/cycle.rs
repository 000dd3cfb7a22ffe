//! The cycle of a motion: at which lag its poses and speeds resemble themselves.
//!
//! Frames are embedded ([`PoseSpace::embed`]), centred, and joined with their rates, scaled to the same
//! energy, so that a pose passed in two directions is two different things. The root's place and heading
//! are not looked at.

use super::AnalysisError;
use crate::body::{PoseSpace, mirrored};
use crate::motion::take::{Take, TakeBody};

/// A cycle of a take.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Cycle {
    /// Frame at which it begins, where its ends meet best.
    pub start: usize,
    /// Its length in frames, with fractions.
    pub frames: f64,
    /// Cycles per second.
    pub frequency_hz: f64,
    /// How much the motion resembles itself a cycle later: 1 is the same, 0 not more than by chance.
    pub likeness: f64,
    /// The take is a whole number of cycles, and its last frame is its first one.
    pub closed: bool,
}

/// A motion repeats if it resembles itself this much.
pub const LEAST_LIKENESS: f64 = 0.7;
/// Shortest and longest cycle, seconds.
const CYCLES_S: (f64, f64) = (0.15, 10.0);
/// Of a take, a cycle must leave this share to be compared with.
const OVERLAP: f64 = 0.3;
/// The shortest lag this near the best likeness counts: multiples of a cycle repeat as well.
const AS_GOOD: f64 = 0.9;
/// What is compared must move at least this share as fast as the whole: standing resembles standing.
const MOVING: f64 = 0.6;
/// Ends of a loop are this near each other, as a share of the motion's energy.
const CLOSED: f64 = 0.04;
/// Ends of a loop that was cut badly are this near each other.
const NEARLY_CLOSED: f64 = 0.3;
/// A loop that shows one round only and takes longer is a performance that comes back to its start.
const LONGEST_ROUND_S: f64 = 2.5;
/// Frames looked at in the first, coarse search.
const COARSE: usize = 1200;

/// Frames of a take as vectors that can be compared: place and rate.
#[derive(Clone, Debug)]
pub struct Features {
    rows: Vec<Vec<f64>>,
    energy: Vec<f64>,
    moving: Vec<f64>,
    extent_m: f64,
}

impl Features {
    /// Features of every frame of `take`.
    pub fn of(take: &Take, space: &dyn PoseSpace) -> Self {
        let (n, width) = (take.len(), space.features());
        let mut rows: Vec<Vec<f64>> = (take.poses.iter())
            .map(|pose| {
                let mut row = vec![0.0; 2 * width];
                space.embed(pose, &mut row[..width]);
                row
            })
            .collect();
        for c in 0..width {
            let mean = rows.iter().map(|r| r[c]).sum::<f64>() / n.max(1) as f64;
            rows.iter_mut().for_each(|r| r[c] -= mean);
        }
        let seam = take.wraps && n > 2 && {
            let gap = squared(&rows[0][..width], &rows[n - 1][..width]);
            let step = (0..n - 1).map(|k| squared(&rows[k][..width], &rows[k + 1][..width]));
            // Not farther than the largest steps between neighbours.
            gap <= step.fold(0.0, f64::max)
        };
        for k in 0..n {
            let (a, b) = match (k.checked_sub(1), k + 1 < n) {
                (Some(a), true) => (a, k + 1),
                (None, true) if seam => (n - 2, k + 1),
                (Some(a), false) if seam => (a, 1),
                (a, more) => (a.unwrap_or(k), if more { k + 1 } else { k }),
            };
            let steps = if a + 1 == k && k + 1 == b || seam {
                2.0
            } else {
                1.0
            };
            for c in 0..width {
                rows[k][width + c] = (rows[b][c] - rows[a][c]) / steps;
            }
        }
        let power = |rows: &[Vec<f64>], range: std::ops::Range<usize>| -> f64 {
            (rows.iter())
                .map(|r| r[range.clone()].iter().map(|v| v * v).sum::<f64>())
                .sum()
        };
        let (places, speeds) = (power(&rows, 0..width), power(&rows, width..2 * width));
        let scale = if speeds > 1e-18 {
            (places / speeds).sqrt()
        } else {
            0.0
        };
        rows.iter_mut()
            .for_each(|r| r[width..].iter_mut().for_each(|v| *v *= scale));
        let sum = |r: &[f64]| r.iter().map(|v| v * v).sum::<f64>();
        Self {
            energy: rows.iter().map(|r| sum(r)).collect(),
            moving: rows.iter().map(|r| sum(&r[width..])).collect(),
            extent_m: (places / (n * width).max(1) as f64).sqrt(),
            rows,
        }
    }

    /// Root mean square way of a feature from its mean, metres: the scale of the motion.
    pub fn extent_m(&self) -> f64 {
        self.extent_m
    }

    fn len(&self) -> usize {
        self.rows.len()
    }

    /// Likeness of the motion and itself `lag` frames later, over every `stride`th frame: one minus the
    /// squared distance over the squared distance of unrelated frames. `None` where what overlaps hardly
    /// moves.
    fn likeness(&self, lag: usize, stride: usize) -> Option<f64> {
        let n = self.len();
        let (mut apart, mut energy, mut moving, mut count) = (0.0, 0.0, 0.0, 0.0);
        for k in (0..n.saturating_sub(lag)).step_by(stride) {
            apart += squared(&self.rows[k], &self.rows[k + lag]);
            energy += self.energy[k] + self.energy[k + lag];
            moving += self.moving[k] + self.moving[k + lag];
            count += 2.0;
        }
        let usual = self.moving.iter().sum::<f64>() / n as f64;
        (energy > 1e-12 && moving >= MOVING * usual * count).then(|| 1.0 - apart / energy)
    }

    /// How far the ends of the whole take are apart, as a share of its energy.
    fn gap(&self) -> f64 {
        let n = self.len();
        let mean = self.energy.iter().sum::<f64>() / n as f64;
        squared(&self.rows[0], &self.rows[n - 1]) / (2.0 * mean).max(1e-18)
    }
}

fn squared(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

/// The cycle of a take.
///
/// The shortest lag at which the likeness has a peak nearly as high as its highest one, refined between
/// frames by a parabola. A take that says it wraps, and whose ends meet in place and speed, is one
/// cycle, or as many as fit: then the length is exact.
///
/// # Errors
/// [`AnalysisError::NotCyclic`] with the best likeness found.
pub fn find(features: &Features, take: &Take) -> Result<Cycle, AnalysisError> {
    let n = features.len();
    let not = |likeness: f64| AnalysisError::NotCyclic {
        take: take.name.clone(),
        likeness,
        least: LEAST_LIKENESS,
    };
    if n < 8 || features.extent_m < 1e-6 {
        return Err(not(0.0));
    }
    let whole = n - 1;
    let closed = take.wraps && features.gap() < CLOSED;
    // A single round has nothing to be compared with: short ones are taken for a cycle if their ends
    // meet, or nearly meet and left and right move in turn.
    let in_turn = || features.gap() < NEARLY_CLOSED && in_turn(features, take) > LEAST_LIKENESS;
    let one_round = take.wraps && take.duration_s() < LONGEST_ROUND_S && (closed || in_turn());
    let cycle = |start: usize, frames: f64, likeness: f64, closed: bool| Cycle {
        start,
        frames,
        frequency_hz: 1.0 / (frames * take.dt_s),
        likeness,
        closed,
    };
    match lag(features, take.dt_s) {
        Ok((frames, likeness)) => {
            let times = (whole as f64 / frames).round();
            let exact = whole as f64 / times;
            if closed && (exact / frames - 1.0).abs() < 0.03 {
                return Ok(cycle(0, exact, likeness, true));
            }
            Ok(cycle(best_start(features, frames), frames, likeness, false))
        }
        Err(_) if one_round => Ok(cycle(0, whole as f64, 1.0 - features.gap(), true)),
        Err(likeness) => Err(not(likeness)),
    }
}

/// Lag in frames and its likeness, or the best likeness that is not enough.
fn lag(features: &Features, dt_s: f64) -> Result<(f64, f64), f64> {
    let n = features.len();
    let shortest = ((CYCLES_S.0 / dt_s) as usize).max(3);
    let longest = ((CYCLES_S.1 / dt_s) as usize).min(((1.0 - OVERLAP) * n as f64) as usize);
    if longest <= shortest + 2 {
        return Err(0.0);
    }
    let stride = n.div_ceil(COARSE);
    let lags: Vec<usize> = (shortest - 1..=longest + 1).step_by(stride).collect();
    let coarse: Vec<Option<f64>> = (lags.iter())
        .map(|lag| features.likeness(*lag, stride))
        .collect();
    let peaks: Vec<(usize, f64)> = (1..lags.len().saturating_sub(1))
        .filter_map(|i| {
            let (a, b, c) = (coarse[i - 1]?, coarse[i]?, coarse[i + 1]?);
            (b >= a && b > c).then_some((lags[i], b))
        })
        .collect();
    let best = peaks.iter().map(|p| p.1).fold(0.0, f64::max);
    let Some((rough, _)) = peaks.iter().find(|p| p.1 >= AS_GOOD * best) else {
        return Err(best);
    };
    let near = rough.saturating_sub(stride).max(2)..=(rough + stride);
    let fine = near.max_by(|a, b| {
        let of = |lag: usize| features.likeness(lag, 1).unwrap_or(f64::NEG_INFINITY);
        of(*a).total_cmp(&of(*b))
    });
    let lag = fine.unwrap_or(*rough);
    let at = |lag| features.likeness(lag, 1).unwrap_or(0.0);
    let (a, b, c) = (at(lag - 1), at(lag), at(lag + 1));
    if b < LEAST_LIKENESS {
        return Err(b);
    }
    let bend = a - 2.0 * b + c;
    let offset = if bend < 0.0 {
        (0.5 * (a - c) / bend).clamp(-0.5, 0.5)
    } else {
        0.0
    };
    Ok((lag as f64 + offset, b))
}

/// How much the left is the mirrored right half a cycle later, over the whole take as one cycle: 1 is the
/// same. Of skeletons by the places of joints, of robots by joint positions, whose sense on the two
/// sides their means tell.
fn in_turn(features: &Features, take: &Take) -> f64 {
    let names: Vec<&str> = match &take.body {
        TakeBody::Joints(names) | TakeBody::Floating(names) => {
            names.iter().map(String::as_str).collect()
        }
        TakeBody::Skeleton(skeleton) => skeleton.joints.iter().map(|j| j.name.as_str()).collect(),
    };
    let n = features.len() - 1;
    let (mut apart, mut energy) = (0.0, 0.0);
    let mut compare = |a: usize, b: usize, sense: f64| {
        for (k, row) in features.rows[..n].iter().enumerate() {
            let other = sense * features.rows[(k + n / 2) % n][b];
            apart += (row[a] - other).powi(2);
            energy += row[a].powi(2) + other.powi(2);
        }
    };
    for (i, j) in mirrored(&names)
        .into_iter()
        .enumerate()
        .filter(|(i, j)| i < j)
    {
        match &take.body {
            TakeBody::Skeleton(_) => {
                for (axis, sense) in [1.0, -1.0, 1.0].into_iter().enumerate() {
                    compare(3 * i + axis, 3 * j + axis, sense);
                }
            }
            TakeBody::Joints(_) | TakeBody::Floating(_) => {
                let mean = |c: usize| take.poses.iter().map(|p| p[c]).sum::<f64>();
                compare(i, j, if mean(i) * mean(j) < 0.0 { -1.0 } else { 1.0 });
            }
        }
    }
    1.0 - apart / energy.max(1e-12)
}

/// The frame from which a cycle of `frames` ends nearest to where it began, in place and speed, judged
/// over a few frames around.
fn best_start(features: &Features, frames: f64) -> usize {
    let n = features.len();
    let lag = frames.round() as usize;
    let gap = |k: usize| squared(&features.rows[k], &features.rows[k + lag]);
    let last = n.saturating_sub(lag + 1);
    // The speeds of the first and last frame are one-sided.
    let inside = 2.min(last / 2);
    (inside..=last - inside)
        .min_by(|a, b| {
            let around = |k: usize| {
                let (from, to) = (k.saturating_sub(2), (k + 2).min(last));
                (from..=to).map(gap).sum::<f64>() / (to - from + 1) as f64
            };
            around(*a).total_cmp(&around(*b))
        })
        .unwrap_or(0)
}
