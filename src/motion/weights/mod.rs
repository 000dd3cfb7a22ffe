//! Blend weights from parameters: which share each example clip of a class has at a wish.
//!
//! The space has one to four dimensions, amplitude and frequency first ([`Parameters`]). Two kinds
//! ([`WeightKind`]): smooth radial basis functions after Rose, Cohen and Bodenheimer, "Verbs and
//! Adverbs" (1998), and weights inverse to the distance to the nearest examples. Rhodin 2016, section
//! 9.5.2, names both. Per dimension the examples' range is scaled to 0..1 before distances are taken.

mod inverse_distance;
mod parameters;
mod radial;

pub use parameters::{DIMENSION_NAMES, MOST_DIMENSIONS, Parameters};

use radial::Radial;

pub(super) use radial::distance_sq;

/// How weights follow from the place in parameter space.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub enum WeightKind {
    /// Per example a linear fit of its indicator plus a radial basis that makes it exact at every
    /// example; negative weights are cut off. Twice differentiable but for that cut.
    #[default]
    Rose,
    /// Inverse to the distance, over the nearest examples only (one more than dimensions). Weights
    /// come only from examples that are near, also where examples are unevenly spread.
    InverseDistance,
}

impl WeightKind {
    /// Names in a configuration.
    pub const NAMES: [&'static str; 2] = ["rose", "inverse_distance"];

    /// The kind called `name`.
    pub fn by_name(name: &str) -> Option<Self> {
        match name {
            "rose" => Some(Self::Rose),
            "inverse_distance" => Some(Self::InverseDistance),
            _ => None,
        }
    }
}

/// Why examples span no parameter space.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum WeightsError {
    /// Nothing to weigh.
    #[error("a class needs at least one clip")]
    Empty,
    /// Two clips with the same parameters.
    #[error(
        "clips {first} and {second} have the same parameters ({parameters}); give each clip its own"
    )]
    Duplicate {
        /// Index of the first clip.
        first: usize,
        /// Index of the second clip.
        second: usize,
        /// Name and value of every dimension.
        parameters: String,
    },
    /// A parameter that is not finite.
    #[error("clip {clip}: {dimension} is {found}; parameters must be finite numbers")]
    NotFinite {
        /// Index of the clip.
        clip: usize,
        /// Name of the dimension.
        dimension: String,
        /// What was found.
        found: f64,
    },
    /// Clips with different numbers of parameters.
    #[error(
        "clip {clip} has {found} parameters, clip 0 has {expected}; give every clip a value in each dimension"
    )]
    Dimensions {
        /// Index of the clip.
        clip: usize,
        /// Its number of dimensions.
        found: usize,
        /// That of the first clip.
        expected: usize,
    },
}

/// Maps parameters to one weight per example.
#[derive(Clone, Debug)]
pub struct Weights {
    /// Examples, scaled to 0..1 per dimension; unused dimensions 0.
    centres: Vec<[f64; MOST_DIMENSIONS]>,
    low: [f64; MOST_DIMENSIONS],
    high: [f64; MOST_DIMENSIONS],
    /// 1 / (high - low), 0 for a dimension in which nothing differs.
    inverse_span: [f64; MOST_DIMENSIONS],
    dimensions: usize,
    map: Map,
}

#[derive(Clone, Debug)]
enum Map {
    Rose(Radial),
    InverseDistance { nearest: usize },
}

impl Weights {
    /// Prepares the map of [`WeightKind::Rose`] for `examples`, one per clip, all with the same
    /// number of dimensions; these have their usual names in errors.
    pub fn new<P: Into<Parameters> + Copy>(examples: &[P]) -> Result<Self, WeightsError> {
        Self::named(examples, WeightKind::default(), &DIMENSION_NAMES)
    }

    /// Prepares a map of `kind`; `names` are the dimensions' names in errors (missing ones have
    /// their usual name).
    pub fn named<P: Into<Parameters> + Copy>(
        examples: &[P],
        kind: WeightKind,
        names: &[&str],
    ) -> Result<Self, WeightsError> {
        let examples: Vec<Parameters> = examples.iter().map(|p| (*p).into()).collect();
        let name = |d: usize| names.get(d).copied().unwrap_or(DIMENSION_NAMES[d]);
        let dimensions = examples.first().ok_or(WeightsError::Empty)?.dimensions();
        for (clip, p) in examples.iter().enumerate() {
            if p.dimensions() != dimensions {
                return Err(WeightsError::Dimensions {
                    clip,
                    found: p.dimensions(),
                    expected: dimensions,
                });
            }
            if let Some(d) = p.as_slice().iter().position(|v| !v.is_finite()) {
                return Err(WeightsError::NotFinite {
                    clip,
                    dimension: name(d).to_owned(),
                    found: p[d],
                });
            }
        }
        let (mut low, mut high) = (*examples[0].padded(), *examples[0].padded());
        for p in &examples {
            for d in 0..MOST_DIMENSIONS {
                low[d] = low[d].min(p[d]);
                high[d] = high[d].max(p[d]);
            }
        }
        let inverse_span = std::array::from_fn(|d| {
            let inverse = 1.0 / (high[d] - low[d]);
            if inverse.is_finite() { inverse } else { 0.0 }
        });
        let centres: Vec<[f64; MOST_DIMENSIONS]> = examples
            .iter()
            .map(|p| std::array::from_fn(|d| (p[d] - low[d]) * inverse_span[d]))
            .collect();
        for second in 1..centres.len() {
            for first in 0..second {
                if !(distance_sq(&centres[first], &centres[second]) > 1e-18) {
                    let parameters: Vec<String> = (0..dimensions)
                        .map(|d| format!("{} {}", name(d), examples[first][d]))
                        .collect();
                    return Err(WeightsError::Duplicate {
                        first,
                        second,
                        parameters: parameters.join(", "),
                    });
                }
            }
        }
        let map = match kind {
            WeightKind::Rose => Map::Rose(Radial::new(&centres, dimensions)),
            WeightKind::InverseDistance => Map::InverseDistance {
                nearest: dimensions + 1,
            },
        };
        Ok(Self {
            centres,
            low,
            high,
            inverse_span,
            dimensions,
            map,
        })
    }

    /// Weights of all examples at `wish`, into `out` (one per example): not negative, sum 1, exact
    /// at the examples.
    ///
    /// A wish outside the examples' box is brought to its edge, a dimension that it lacks or that
    /// is not a number to the low edge. Continuous, no allocation.
    #[inline]
    pub fn at(&self, wish: impl Into<Parameters>, out: &mut [f64]) {
        let wish: Parameters = wish.into();
        let wish = wish.padded();
        // Written so that not-a-number becomes the low edge.
        let p: [f64; MOST_DIMENSIONS] = std::array::from_fn(|d| {
            let x = (wish[d] - self.low[d]) * self.inverse_span[d];
            if x > 0.0 { x.min(1.0) } else { 0.0 }
        });
        let out = &mut out[..self.centres.len()];
        match &self.map {
            Map::Rose(radial) => radial.at(&self.centres, &p, out),
            Map::InverseDistance { nearest } => {
                inverse_distance::at(&self.centres, *nearest, &p, out);
            }
        }
        let sum: f64 = out.iter().sum();
        if sum > 0.0 {
            let scale = 1.0 / sum;
            out.iter_mut().for_each(|w| *w *= scale);
        } else {
            // The raw weights sum to one, so at least one was positive; kept for a zero matrix.
            out.fill(1.0 / self.centres.len() as f64);
        }
    }

    /// Lowest and highest value of the examples in dimension `d`; (0, 0) for one that is not there.
    pub fn range(&self, d: usize) -> (f64, f64) {
        if d < self.dimensions {
            (self.low[d], self.high[d])
        } else {
            (0.0, 0.0)
        }
    }

    /// Lowest and highest frequency of the examples, Hz.
    pub fn frequencies(&self) -> (f64, f64) {
        self.range(1)
    }

    /// Number of dimensions, 1..=4.
    pub fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// Number of examples.
    pub fn len(&self) -> usize {
        self.centres.len()
    }

    /// Never true: a map without examples cannot be made.
    pub fn is_empty(&self) -> bool {
        self.centres.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const KINDS: [WeightKind; 2] = [WeightKind::Rose, WeightKind::InverseDistance];

    const EXAMPLES: [[f64; 2]; 6] = [
        [0.0, 0.7],
        [0.0, 1.7],
        [0.5, 0.7],
        [1.0, 0.7],
        [0.5, 1.7],
        [1.0, 1.7],
    ];

    /// Walks and runs, straight and turning both ways, one of them sad.
    const TURNING: [[f64; 3]; 5] = [
        [0.5, 0.8, 0.0],
        [1.0, 1.6, 0.0],
        [0.8, 1.0, -0.6],
        [0.8, 1.0, 0.6],
        [1.0, 1.5, 0.4],
    ];

    /// Seven examples in four dimensions: amplitude, frequency, turn rate, emotion.
    const SEVEN: [[f64; 4]; 7] = [
        [0.4, 0.8, 0.0, 0.0],
        [1.0, 0.9, 0.0, 0.0],
        [1.0, 2.0, 0.0, 0.0],
        [0.7, 0.9, -0.5, 0.0],
        [0.7, 0.9, 0.5, 0.0],
        [0.6, 0.7, 0.0, -1.0],
        [0.8, 1.1, 0.0, 1.0],
    ];

    fn all() -> Vec<(WeightKind, Weights, Vec<Parameters>)> {
        let sets: [Vec<Parameters>; 3] = [
            EXAMPLES.map(Parameters::from).to_vec(),
            TURNING.map(Parameters::from).to_vec(),
            SEVEN.map(Parameters::from).to_vec(),
        ];
        let mut all = Vec::new();
        for kind in KINDS {
            for set in &sets {
                let weights = Weights::named(set, kind, &[]).expect("distinct examples");
                all.push((kind, weights, set.clone()));
            }
        }
        all
    }

    #[test]
    fn duplicates_and_nothing_are_refused() {
        assert_eq!(
            Weights::new::<[f64; 2]>(&[]).map(|_| ()),
            Err(WeightsError::Empty)
        );
        let twice = Weights::named(
            &[[0.0, 1.0, 0.2], [1.0, 1.0, 0.2], [0.0, 1.0, 0.2]],
            WeightKind::Rose,
            &["amplitude", "frequency_hz", "turn_rate"],
        )
        .map(|_| ())
        .expect_err("0 and 2 are the same");
        assert_eq!(
            twice.to_string(),
            "clips 0 and 2 have the same parameters (amplitude 0, frequency_hz 1, turn_rate 0.2); give each clip its own"
        );
    }

    #[test]
    fn what_is_no_number_and_what_lacks_a_dimension_is_named() {
        let wrong = Weights::named(
            &[[0.0, 1.0, f64::NAN]],
            WeightKind::Rose,
            &["a", "f", "turn"],
        )
        .map(|_| ())
        .expect_err("not a number")
        .to_string();
        assert_eq!(
            wrong,
            "clip 0: turn is NaN; parameters must be finite numbers"
        );
        let mixed = Weights::new(&[Parameters::from([0.0, 1.0]), [1.0, 1.0, 0.0].into()])
            .map(|_| ())
            .expect_err("two and three dimensions");
        assert_eq!(
            mixed,
            WeightsError::Dimensions {
                clip: 1,
                found: 3,
                expected: 2
            }
        );
        assert_eq!(Parameters::from_slice(&[0.0; 5]), None);
        assert_eq!(Parameters::from_slice(&[]), None);
    }

    #[test]
    fn every_example_has_its_own_corner() {
        for (kind, weights, set) in all() {
            let mut out = vec![0.0; set.len()];
            for (i, p) in set.iter().enumerate() {
                weights.at(*p, &mut out);
                assert!(
                    (out[i] - 1.0).abs() < 1e-6,
                    "{kind:?} {} D, example {i}: {out:?}",
                    weights.dimensions()
                );
            }
        }
    }

    #[test]
    fn a_single_clip_always_has_weight_one() {
        for kind in KINDS {
            let weights = Weights::named(&[[0.4, 1.0]], kind, &[]).expect("one clip");
            for wish in [[f64::MAX, -3.0], [0.4, 1.0], [f64::NAN, f64::INFINITY]] {
                let mut out = [0.0];
                weights.at(wish, &mut out);
                assert_eq!(out, [1.0], "{kind:?} at {wish:?}");
            }
        }
    }

    #[test]
    fn half_way_between_two_clips_each_has_its_share() {
        for kind in KINDS {
            let weights =
                Weights::named(&[[0.5, 1.0, 0.0], [1.0, 2.0, 0.4]], kind, &[]).expect("two clips");
            for k in 0..=10 {
                let u = f64::from(k) / 10.0;
                let mut out = [0.0; 2];
                weights.at([0.5 + 0.5 * u, 1.0 + u, 0.4 * u], &mut out);
                assert!((out[1] - u).abs() < 1e-6, "{kind:?} at {u}: {out:?}");
            }
        }
    }

    #[test]
    fn a_distant_clip_has_no_weight_among_many() {
        // A row of clips along frequency: at 1.2 Hz those of 3 Hz and more do not count.
        let row: Vec<[f64; 2]> = (0..8).map(|k| [0.5, 0.5 + 0.5 * f64::from(k)]).collect();
        let weights = Weights::named(&row, WeightKind::InverseDistance, &[]).expect("distinct");
        let mut out = [0.0; 8];
        weights.at([0.5, 1.2], &mut out);
        assert!(out[5..].iter().all(|w| *w == 0.0), "{out:?}");
        assert!(out[1] > 0.5, "{out:?}");
    }

    proptest! {
        #[test]
        fn weights_are_a_partition_and_continuous(
            a in -0.5..1.5f64, f in 0.0..4.0f64, turn in -1.0..1.0f64, mood in -1.5..1.5f64,
            da in -1.0..1.0f64, df in -1.0..1.0f64, dt in -1.0..1.0f64, dm in -1.0..1.0f64,
        ) {
            let step = 1e-6;
            for (kind, weights, set) in all() {
                let (mut here, mut there) = (vec![0.0; set.len()], vec![0.0; set.len()]);
                let d = weights.dimensions();
                let p = Parameters::from_slice(&[a, f, turn, mood][..d]).expect("1 to 4");
                let q = Parameters::from_slice(
                    &[a + step * da, f + step * df, turn + step * dt, mood + step * dm][..d],
                ).expect("1 to 4");
                weights.at(p, &mut here);
                weights.at(q, &mut there);
                let sum: f64 = here.iter().sum();
                prop_assert!((sum - 1.0).abs() < 1e-9, "{:?} {} D: sum {}", kind, d, sum);
                prop_assert!(here.iter().all(|w| (0.0..=1.0 + 1e-12).contains(w)));
                for (x, y) in here.iter().zip(&there) {
                    prop_assert!((x - y).abs() < 1e-4, "{:?} {} D: jump {}", kind, d, x - y);
                }
            }
        }

        #[test]
        fn random_examples_are_met_and_the_middle_of_all_is_continuous(
            points in prop::collection::vec(prop::array::uniform4(0.0..1.0f64), 2..9),
        ) {
            for kind in KINDS {
                let Ok(weights) = Weights::named(&points, kind, &[]) else {
                    return Ok(());
                };
                let mut out = vec![0.0; points.len()];
                for (i, p) in points.iter().enumerate() {
                    weights.at(*p, &mut out);
                    prop_assert!((out[i] - 1.0).abs() < 1e-6, "{:?} example {}: {:?}", kind, i, out);
                }
                let mean: [f64; 4] = std::array::from_fn(|d| {
                    points.iter().map(|p| p[d]).sum::<f64>() / points.len() as f64
                });
                let mut there = out.clone();
                weights.at(mean, &mut out);
                weights.at(mean.map(|v| v + 1e-9), &mut there);
                for (x, y) in out.iter().zip(&there) {
                    prop_assert!((x - y).abs() < 1e-5, "{:?}: jump {}", kind, x - y);
                }
            }
        }
    }
}
