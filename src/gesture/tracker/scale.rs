//! One scale per performer: a child's hand and an adult's work with one gesture file.

use crate::pose::global::size_of;

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

/// Waits for a still pose and compares its size with the reference's.
///
/// The scale is the median, over all pairs of points, of their distance in the reference by their
/// distance in the still pose: a finger held otherwise does not count.
#[derive(Clone, Debug)]
pub(in crate::gesture) struct RestMeasure {
    reference: Vec<[f64; 3]>,
    /// Where the points were when they came to rest, since when, and sum and count of places since.
    at: Vec<[f64; 3]>,
    since: Option<f64>,
    sums: Vec<[f64; 3]>,
    counts: Vec<f64>,
    ratios: Vec<f64>,
}

impl RestMeasure {
    /// Compares with `reference`, one place per point, metres.
    pub fn new(reference: &[[f64; 3]]) -> Self {
        let points = reference.len();
        Self {
            reference: reference.to_vec(),
            at: vec![[0.0; 3]; points],
            since: None,
            sums: vec![[0.0; 3]; points],
            counts: vec![0.0; points],
            ratios: Vec::with_capacity(points * points.saturating_sub(1) / 2),
        }
    }

    /// Looks at the next sample; the scale once the pose has been still for long enough.
    pub fn push(&mut self, t: f64, places: &[[f64; 3]], seen: &[bool]) -> Option<f64> {
        let bound = STILL_SHARE * size_of(&self.at);
        let moved = |(index, place): (usize, &[f64; 3])| {
            let squared: f64 = (0..3).map(|a| (place[a] - self.at[index][a]).powi(2)).sum();
            seen[index] && !(squared.sqrt() <= bound)
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
            for axis in 0..3 {
                self.sums[index][axis] += place[axis];
            }
            self.counts[index] += 1.0;
        }
        if t - since < STILL_S {
            return None;
        }
        self.ratios.clear();
        for a in 0..self.at.len() {
            for b in 0..a {
                let distance = |place: &dyn Fn(usize, usize) -> f64| {
                    let squared: f64 = (0..3).map(|k| (place(a, k) - place(b, k)).powi(2)).sum();
                    squared.sqrt()
                };
                let live = distance(&|point, k| self.sums[point][k] / self.counts[point]);
                let reference = distance(&|point, k| self.reference[point][k]);
                if live > 0.0 && reference > 0.0 {
                    self.ratios.push(reference / live);
                }
            }
        }
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
