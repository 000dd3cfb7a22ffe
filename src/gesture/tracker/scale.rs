//! One scale per performer: a child's hand and an adult's work with one gesture file.

use crate::gesture::References;
use crate::pose::global::size_of;
use nalgebra::DVector;

/// The pose must be still for this long to be measured, seconds.
const STILL_S: f64 = 1.0;
/// Still: no point moves by more than this share of the pose's size.
const STILL_SHARE: f64 = 0.05;
/// Scales that a performer may have.
const SCALES: std::ops::RangeInclusive<f64> = 0.1..=10.0;

/// By how much a performer's poses are enlarged to the size of the gesture file's.
///
/// Fixed for a whole stream: what was removed as global motion and channels stay in metres.
#[derive(Copy, Clone, Debug, PartialEq)]
pub enum PerformerScale {
    /// Live poses times this have the size of the reference: 1 changes nothing, 1.4 is a child.
    Declared(f64),
    /// Measured over the first second in which the pose is still, then fixed; 1 until then.
    Rest,
}

impl Default for PerformerScale {
    fn default() -> Self {
        Self::Declared(1.0)
    }
}

impl PerformerScale {
    /// What may be declared, for messages.
    pub const ALLOWED: &str = "a number from 0.1 to 10 (reference size / performer's size), or rest (measured over the first still second)";

    /// Whether a declared scale is one that performers have.
    pub fn is_allowed(self) -> bool {
        match self {
            Self::Declared(scale) => SCALES.contains(&scale),
            Self::Rest => true,
        }
    }
}

impl std::str::FromStr for PerformerScale {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("scale {text:?}; allowed: {}", Self::ALLOWED);
        let scale = match text {
            "rest" => Self::Rest,
            number => Self::Declared(number.parse().map_err(|_| wrong())?),
        };
        if scale.is_allowed() {
            Ok(scale)
        } else {
            Err(wrong())
        }
    }
}

/// Reference poses that a still pose is compared with at most.
const POSTURES: usize = 64;
/// Pairs of points that are compared at most.
const PAIRS: usize = 512;

/// Waits for a still pose and compares its size with the gesture file's.
///
/// Performers rest in one of the postures they were recorded in: the still pose is compared with
/// the reference frame, the mean poses and frames of all gestures, and the one whose proportions
/// (distances between points) fit best is the one that counts. The scale is the median over the pairs
/// of points of their distance there by their distance in the still pose.
#[derive(Clone, Debug)]
pub(in crate::gesture) struct RestMeasure {
    pairs: Vec<(usize, usize)>,
    /// Per posture the distance of every pair, metres.
    postures: Vec<Vec<f64>>,
    /// Where the points were when they came to rest, since when, and sum and count of places since.
    at: Vec<[f64; 3]>,
    since: Option<f64>,
    sums: Vec<[f64; 3]>,
    counts: Vec<f64>,
    live: Vec<f64>,
    ratios: Vec<f64>,
}

impl RestMeasure {
    /// Compares with `home` (the reference frame, one place per point) and the gestures' frames.
    pub fn new(home: &[[f64; 3]], references: &References) -> Self {
        let points = home.len();
        let all: Vec<(usize, usize)> = (0..points)
            .flat_map(|a| (0..a).map(move |b| (a, b)))
            .collect();
        let pairs: Vec<(usize, usize)> = thinned(&all, PAIRS).copied().collect();
        let frames: Vec<&DVector<f64>> = references.local.iter().flatten().collect();
        let poses = thinned(&frames, POSTURES).copied().chain(&references.mean);
        let flat = std::iter::once(home.as_flattened()).chain(poses.map(DVector::as_slice));
        let postures = flat.map(|pose| {
            let place = |point: usize| [0, 1, 2].map(|axis| pose[3 * point + axis]);
            pairs
                .iter()
                .map(|(a, b)| distance(place(*a), place(*b)))
                .collect()
        });
        Self {
            postures: postures.collect(),
            at: vec![[0.0; 3]; points],
            since: None,
            sums: vec![[0.0; 3]; points],
            counts: vec![0.0; points],
            live: vec![0.0; pairs.len()],
            ratios: Vec::with_capacity(pairs.len()),
            pairs,
        }
    }

    /// Looks at the next sample; the scale once the pose has been still for long enough.
    pub fn push(&mut self, t: f64, places: &[[f64; 3]], seen: &[bool]) -> Option<f64> {
        let bound = STILL_SHARE * size_of(&self.at);
        let moved = |(index, place): (usize, &[f64; 3])| {
            seen[index] && !(distance(*place, self.at[index]) <= bound)
        };
        if self.since.is_none() || places.iter().enumerate().any(moved) {
            self.since = None;
            if seen.iter().all(|seen| *seen) {
                self.at.copy_from_slice(places);
                self.since = Some(t);
                self.sums.fill([0.0; 3]);
                self.counts.fill(0.0);
            }
        }
        let since = self.since?;
        for (index, place) in places.iter().enumerate().filter(|(index, _)| seen[*index]) {
            for (sum, value) in self.sums[index].iter_mut().zip(place) {
                *sum += value;
            }
            self.counts[index] += 1.0;
        }
        if t - since < STILL_S {
            return None;
        }
        for (live, (a, b)) in self.live.iter_mut().zip(&self.pairs) {
            let place = |point: usize| self.sums[point].map(|sum| sum / self.counts[point]);
            *live = distance(place(*a), place(*b));
        }
        let posture = (self.postures.iter())
            .min_by(|a, b| misfit(a, &self.live).total_cmp(&misfit(b, &self.live)))?;
        self.ratios.clear();
        let known = posture.iter().zip(&self.live);
        let ratios = known.map(|(reference, live)| reference / live);
        (self.ratios).extend(ratios.filter(|ratio| ratio.is_finite() && *ratio > 0.0));
        self.ratios.sort_unstable_by(f64::total_cmp);
        let middle = self.ratios.len() / 2;
        let median = match self.ratios.len() {
            0 => return None,
            n if n % 2 == 0 => 0.5 * (self.ratios[middle - 1] + self.ratios[middle]),
            _ => self.ratios[middle],
        };
        // No performer is that large or small: that was no rest pose. The next still second may be one.
        if !SCALES.contains(&median) {
            self.since = None;
            return None;
        }
        Some(median)
    }

    /// Forgets all samples.
    pub fn reset(&mut self) {
        self.since = None;
    }
}

/// At most `most` of `all`, evenly spread.
fn thinned<T>(all: &[T], most: usize) -> impl Iterator<Item = &T> {
    all.iter().step_by(all.len().div_ceil(most).max(1))
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3)
        .map(|axis| (a[axis] - b[axis]).powi(2))
        .sum::<f64>()
        .sqrt()
}

/// How badly distances fit the live ones after the best enlargement: 0 for the same proportions.
fn misfit(posture: &[f64], live: &[f64]) -> f64 {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let fit = product(posture, live);
    1.0 - fit * fit / (product(posture, posture) * product(live, live)).max(1e-300)
}
