//! The recent past of one gesture's plane, and averages of it for slow waves.
//!
//! A slow wave needs no fine samples: [`History::blocks`] gives averages of 1, 2, 4, ... 64
//! neighbouring samples, so that reading a wave takes some 80 to 160 blocks whatever the rate.

use super::PlanePoint;
use super::window::Window;

/// History in seconds.
pub(super) const HISTORY_S: f64 = 5.0;
/// Samples of history: 5 s at up to 400 Hz; at higher rates the history shortens.
const CAPACITY: usize = 2048;
/// Levels of averaging: blocks of 1, 2, ... 64 samples.
const LEVELS: usize = 7;
/// A block spans at most this share of a period: its average errs by less than 0.11 %.
const BLOCK_PERIODS: f64 = 1.0 / 40.0;
/// Longest time one sample stands for, in seconds.
pub(super) const LONGEST_STEP_S: f64 = 0.1;

#[derive(Copy, Clone, Debug)]
struct Sample {
    t: f64,
    point: PlanePoint,
    modulus: f64,
}

/// Average of neighbouring samples.
#[derive(Copy, Clone, Debug, Default)]
pub(super) struct Block {
    /// Time before now, seconds.
    pub lag_s: f64,
    /// Time it stands for, seconds (trapezoidal rule, each step at most 0.1 s).
    pub weight: f64,
    /// Samples in it.
    pub count: f64,
    /// Mean place on the plane.
    pub z: [f64; 2],
    /// Mean modulus.
    pub modulus: f64,
    /// Mean variance per component.
    pub variance: [f64; 2],
}

impl Block {
    fn join(a: Block, b: Block) -> Block {
        let weight = a.weight + b.weight;
        let (u, v) = (a.weight / weight, b.weight / weight);
        Block {
            lag_s: u * a.lag_s + v * b.lag_s,
            weight,
            count: a.count + b.count,
            z: [u * a.z[0] + v * b.z[0], u * a.z[1] + v * b.z[1]],
            modulus: u * a.modulus + v * b.modulus,
            variance: [
                u * a.variance[0] + v * b.variance[0],
                u * a.variance[1] + v * b.variance[1],
            ],
        }
    }
}

/// The last five seconds of points, newest first, at several levels of averaging.
#[derive(Clone, Debug)]
pub(super) struct History {
    samples: Window<Sample>,
    since: f64,
    now: f64,
    levels: Vec<Vec<Block>>,
}

impl History {
    /// An empty history. Allocates all it will ever need.
    pub fn new() -> Self {
        Self {
            samples: Window::new(CAPACITY),
            since: 0.0,
            now: 0.0,
            levels: (0..LEVELS)
                .map(|level| Vec::with_capacity((CAPACITY >> level) + 2))
                .collect(),
        }
    }

    /// Takes the next point; true when it is a first one: nothing before it, or a gap of more than
    /// `longest_gap_s`.
    pub fn push(&mut self, t: f64, point: PlanePoint, longest_gap_s: f64) -> bool {
        let first = !(self.samples.values().last()).is_some_and(|last| t - last.t <= longest_gap_s);
        if first {
            self.samples.clear();
            self.since = t;
        }
        self.samples.push(Sample {
            t,
            point,
            modulus: point.z[0].hypot(point.z[1]),
        });
        self.samples.forget(|old| t - old.t > HISTORY_S);
        self.now = t;
        self.build_levels();
        first
    }

    /// Averages the samples into levels, newest first.
    fn build_levels(&mut self) {
        let samples = self.samples.values();
        let step = |later: usize, earlier: usize| {
            (samples[later].t - samples[earlier].t).min(LONGEST_STEP_S)
        };
        let base = &mut self.levels[0];
        base.clear();
        for k in (0..samples.len()).rev() {
            let after = if k + 1 < samples.len() {
                step(k + 1, k)
            } else {
                0.0
            };
            let before = if k > 0 { step(k, k - 1) } else { 0.0 };
            let sample = &samples[k];
            base.push(Block {
                lag_s: self.now - sample.t,
                weight: (0.5 * (after + before)).max(1e-6),
                count: 1.0,
                z: sample.point.z,
                modulus: sample.modulus,
                variance: sample.point.variance,
            });
        }
        for level in 1..LEVELS {
            let (below, above) = self.levels.split_at_mut(level);
            let (below, above) = (&below[level - 1], &mut above[0]);
            above.clear();
            for pair in below.chunks(2) {
                above.push(match pair {
                    [a, b] => Block::join(*a, *b),
                    [a] => *a,
                    _ => continue,
                });
            }
        }
    }

    /// Mean step between samples, seconds; 0 with fewer than two.
    pub fn step_s(&self) -> f64 {
        let base = &self.levels[0];
        base.last().map_or(0.0, |oldest| oldest.lag_s) / base.len().saturating_sub(1).max(1) as f64
    }

    /// Blocks short enough for waves of `frequency_hz`, newest first.
    pub fn blocks(&self, frequency_hz: f64) -> &[Block] {
        let step = self.step_s();
        let mut level = 0;
        while level + 1 < LEVELS && step * (2 << level) as f64 * frequency_hz <= BLOCK_PERIODS {
            level += 1;
        }
        &self.levels[level]
    }

    /// Single samples, newest first.
    pub fn samples(&self) -> &[Block] {
        &self.levels[0]
    }

    /// Time since the first sample after the last long gap, seconds.
    pub fn covered_s(&self) -> f64 {
        self.now - self.since
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.samples.clear();
        for level in &mut self.levels {
            level.clear();
        }
    }
}
