//! Several parameters: samples over simplices of clips, a cubic on each, damped Gauss-Newton steps.

use super::InverseError;
use super::cubic::{Cubic, Jacobian, Vector};
use crate::motion::weights::{MOST_DIMENSIONS, distance_sq};

type Point = [f64; MOST_DIMENSIONS];
/// Clips of one simplex at most: one more than parameters.
const CORNERS: usize = MOST_DIMENSIONS + 1;
/// Samples at most: a wish looks at each of them.
const MOST_SAMPLES: usize = 12_000;
/// Simplices that are tried for one wish, nearest first, until one meets it.
const TRIES: usize = 4;
/// A wish is met when this near, as a share of the range.
const MET: f64 = 2e-3;
/// Gauss-Newton steps.
const STEPS: usize = 5;

#[derive(Clone, Debug)]
pub(super) struct Faces {
    /// Clips of each simplex, `corners` of them.
    faces: Vec<([usize; CORNERS], Cubic)>,
    corners: usize,
    samples: Vec<Sample>,
    low: Point,
    high: Point,
    /// 1 / (high - low); 0 for parameters that are not there.
    inverse_span: Point,
}

#[derive(Clone, Debug)]
struct Sample {
    face: usize,
    /// Weights of the simplex's clips.
    weights: [f64; CORNERS],
    /// Parameters, scaled to 0..1.
    scaled: Point,
}

impl Faces {
    pub(super) fn new(
        examples: usize,
        dimensions: usize,
        grid: usize,
        evaluate: &mut impl FnMut(&[f64]) -> Result<Point, InverseError>,
    ) -> Result<Self, InverseError> {
        let corners = examples.min(dimensions + 1);
        let count = |grid: usize| {
            choose(examples, corners).saturating_mul(choose(grid + corners - 1, corners - 1))
        };
        // Coarser before there are too many; a cubic needs three steps.
        let grid =
            (3..=grid)
                .rev()
                .find(|g| count(*g) <= MOST_SAMPLES)
                .ok_or(InverseError::TooMany {
                    examples,
                    dimensions,
                })?;
        let mut low = [f64::INFINITY; MOST_DIMENSIONS];
        let mut high = [f64::NEG_INFINITY; MOST_DIMENSIONS];
        let mut samples = Vec::new();
        let mut all = vec![0.0; examples];
        let subsets = subsets(examples, corners);
        for (face, clips) in subsets.iter().enumerate() {
            for shares in compositions(grid, corners) {
                let weights = shares.map(|s| s as f64 / grid as f64);
                all.fill(0.0);
                for (clip, w) in clips.iter().zip(&weights).take(corners) {
                    all[*clip] = *w;
                }
                let p = evaluate(&all)?;
                for d in 0..MOST_DIMENSIONS {
                    low[d] = low[d].min(p[d]);
                    high[d] = high[d].max(p[d]);
                }
                samples.push(Sample {
                    face,
                    weights,
                    scaled: p,
                });
            }
        }
        for d in 0..dimensions {
            if !(high[d] - low[d] > 1e-12 * low[d].abs().max(1e-6)) {
                return Err(InverseError::Flat {
                    dimension: d,
                    value: low[d],
                });
            }
        }
        let inverse_span: Point = std::array::from_fn(|d| {
            if d < dimensions {
                1.0 / (high[d] - low[d])
            } else {
                0.0
            }
        });
        for sample in &mut samples {
            sample.scaled = std::array::from_fn(|d| (sample.scaled[d] - low[d]) * inverse_span[d]);
        }
        let faces = subsets
            .into_iter()
            .enumerate()
            .map(|(face, clips)| {
                let own = || samples.iter().filter(|s| s.face == face);
                let points: Vec<Point> = own().map(|s| free(&s.weights)).collect();
                let values: Vec<Point> = own().map(|s| s.scaled).collect();
                (clips, Cubic::fit(corners - 1, &points, &values))
            })
            .collect();
        // Sparse first: of equally near samples the one with fewer clips is taken.
        samples.sort_by_key(|s| s.weights.iter().filter(|w| **w > 0.0).count());
        Ok(Self {
            faces,
            corners,
            samples,
            low,
            high,
            inverse_span,
        })
    }

    pub(super) fn range(&self) -> (Point, Point) {
        (self.low, self.high)
    }

    pub(super) fn weights(&self, p: &Point, out: &mut [f64]) {
        let goal: Point = std::array::from_fn(|d| (p[d] - self.low[d]) * self.inverse_span[d]);
        let mut tried = [usize::MAX; TRIES];
        let mut best = (f64::INFINITY, [0.0; CORNERS], 0);
        for attempt in 0..TRIES {
            let mut nearest: (f64, Option<&Sample>) = (f64::INFINITY, None);
            for sample in &self.samples {
                let sum = distance_sq(&sample.scaled, &goal);
                if sum < nearest.0 && !tried.contains(&sample.face) {
                    nearest = (sum, Some(sample));
                }
            }
            let Some(start) = nearest.1 else { break };
            tried[attempt] = start.face;
            let cubic = &self.faces[start.face].1;
            let (gap, weights) = self.approach(cubic, start.weights, &Vector::from(goal));
            if gap < best.0 {
                best = (gap, weights, start.face);
            }
            if best.0 < MET {
                break;
            }
        }
        out.fill(0.0);
        for (clip, w) in self.faces[best.2].0.iter().zip(best.1).take(self.corners) {
            out[*clip] += w;
        }
    }

    /// Damped Gauss-Newton steps on the cubic, each projected on the simplex and taken only if it
    /// comes nearer. The distance that is left, and the weights.
    fn approach(
        &self,
        cubic: &Cubic,
        start: [f64; CORNERS],
        goal: &Vector,
    ) -> (f64, [f64; CORNERS]) {
        let variables = self.corners - 1;
        let mut weights = start;
        let mut damping = 1e-6;
        let (value, mut slope) = cubic.at(&free(&weights));
        let mut gap = goal - value;
        for _ in 0..STEPS {
            let mut normal: Jacobian = slope.transpose() * slope;
            for d in 0..MOST_DIMENSIONS {
                // Variables that are not there get a one, so that the system has a solution.
                normal[(d, d)] += if d < variables { damping } else { 1.0 };
            }
            let Some(step) = normal
                .cholesky()
                .map(|c| c.solve(&(slope.transpose() * gap)))
            else {
                break;
            };
            let mut next = weights;
            for d in 0..variables {
                next[d + 1] += step[d];
                next[0] -= step[d];
            }
            project(&mut next[..self.corners]);
            let (value, next_slope) = cubic.at(&free(&next));
            let next_gap = goal - value;
            if next_gap.norm_squared() < gap.norm_squared() {
                (weights, slope, gap) = (next, next_slope, next_gap);
                damping *= 0.1;
            } else {
                damping = (damping * 100.0).max(1e-3);
            }
        }
        (gap.norm(), weights)
    }
}

/// Ways to choose `k` of `n`.
fn choose(n: usize, k: usize) -> usize {
    (0..k.min(n)).fold(1, |ways: usize, i| ways.saturating_mul(n - i) / (i + 1))
}

/// The free variables of a simplex: all weights but the first.
fn free(weights: &[f64; CORNERS]) -> Point {
    std::array::from_fn(|d| weights[d + 1])
}

/// The nearest point of the simplex: not negative, sum 1.
fn project(w: &mut [f64]) {
    let mut sorted = [0.0; CORNERS];
    sorted[..w.len()].copy_from_slice(w);
    let sorted = &mut sorted[..w.len()];
    sorted.sort_unstable_by(|a, b| b.total_cmp(a));
    let mut sum = 0.0;
    let mut shift = 0.0;
    for (k, v) in sorted.iter().enumerate() {
        sum += v;
        let t = (sum - 1.0) / (k + 1) as f64;
        if *v > t {
            shift = t;
        }
    }
    let mut total = 0.0;
    for v in w.iter_mut() {
        *v = (*v - shift).max(0.0);
        total += *v;
    }
    w.iter_mut().for_each(|v| *v /= total);
}

/// All choices of `k` of `n` clips.
fn subsets(n: usize, k: usize) -> Vec<[usize; CORNERS]> {
    let mut found = Vec::new();
    let mut at: [usize; CORNERS] = std::array::from_fn(|i| i);
    loop {
        found.push(at);
        let Some(i) = (0..k).rev().find(|i| at[*i] < n - k + i) else {
            return found;
        };
        at[i] += 1;
        for j in i + 1..k {
            at[j] = at[j - 1] + 1;
        }
    }
}

/// All ways to give `total` to `parts`, in order.
fn compositions(total: usize, parts: usize) -> Vec<[usize; CORNERS]> {
    let mut found = Vec::new();
    let mut at = [0; CORNERS];
    fill(total, 0, parts, &mut at, &mut found);
    found
}

fn fill(
    left: usize,
    part: usize,
    parts: usize,
    at: &mut [usize; CORNERS],
    found: &mut Vec<[usize; CORNERS]>,
) {
    if part + 1 == parts {
        at[part] = left;
        found.push(*at);
        return;
    }
    for share in 0..=left {
        at[part] = share;
        fill(left - share, part + 1, parts, at, found);
    }
}
