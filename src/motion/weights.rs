//! Blend weights from parameters: smooth radial basis functions over the example clips of a class.
//!
//! After Rose, Cohen and Bodenheimer, "Verbs and Adverbs" (1998), as used in Rhodin 2016, section
//! 9.5.2: per example a linear fit of its indicator over the parameter space plus a radial basis
//! that makes it exact at every example. Negative weights are cut off and the rest is scaled to one.

use nalgebra::{DMatrix, Vector2};

/// Parameters of a clip or of a wish: amplitude (0..1) and frequency (Hz).
pub type Parameters = [f64; 2];

/// Why examples span no parameter space.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum WeightsError {
    /// Nothing to weigh.
    #[error("a class needs at least one clip")]
    Empty,
    /// Two clips with the same parameters.
    #[error(
        "clips {first} and {second} have the same parameters (amplitude {amplitude}, frequency {frequency_hz} Hz); give each clip its own"
    )]
    Duplicate {
        /// Index of the first clip.
        first: usize,
        /// Index of the second clip.
        second: usize,
        /// Their amplitude.
        amplitude: f64,
        /// Their frequency, Hz.
        frequency_hz: f64,
    },
    /// A parameter that is not finite.
    #[error("clip {clip}: parameters must be finite numbers")]
    NotFinite {
        /// Index of the clip.
        clip: usize,
    },
}

/// Maps parameters to one weight per example.
#[derive(Clone, Debug)]
pub struct Weights {
    /// Examples, scaled to 0..1 per dimension.
    centres: Vec<Parameters>,
    low: Parameters,
    span: Parameters,
    /// Radius of each centre's basis.
    radii: Vec<f64>,
    /// Rows: examples (of which the weight is). Columns: constant, two linear terms, then the bases.
    coefficients: DMatrix<f64>,
}

impl Weights {
    /// Prepares the map for `examples`, one per clip.
    pub fn new(examples: &[Parameters]) -> Result<Self, WeightsError> {
        if examples.is_empty() {
            return Err(WeightsError::Empty);
        }
        if let Some(clip) = examples
            .iter()
            .position(|p| p.iter().any(|v| !v.is_finite()))
        {
            return Err(WeightsError::NotFinite { clip });
        }
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for p in examples {
            for d in 0..2 {
                low[d] = low[d].min(p[d]);
                high[d] = high[d].max(p[d]);
            }
        }
        let span = [0, 1].map(|d| {
            let s: f64 = high[d] - low[d];
            if s > 0.0 { s } else { 1.0 }
        });
        let centres: Vec<Parameters> = examples
            .iter()
            .map(|p| [0, 1].map(|d| (p[d] - low[d]) / span[d]))
            .collect();
        let n = centres.len();
        let mut radii = vec![if n == 1 { 1.0 } else { f64::INFINITY }; n];
        for i in 0..n {
            for j in 0..n {
                if i != j {
                    let distance = distance(&centres[i], &centres[j]);
                    if distance < 1e-9 {
                        return Err(WeightsError::Duplicate {
                            first: i.min(j),
                            second: i.max(j),
                            amplitude: examples[i][0],
                            frequency_hz: examples[i][1],
                        });
                    }
                    // Twice the nearest neighbour: neighbours overlap, distant clips stay out.
                    radii[i] = radii[i].min(2.0 * distance);
                }
            }
        }
        // Linear part: least squares with a whisper of ridge, since examples may lie on a line.
        let design = DMatrix::from_fn(n, 3, |i, c| if c == 0 { 1.0 } else { centres[i][c - 1] });
        let normal = design.transpose() * &design + DMatrix::identity(3, 3) * 1e-9;
        let linear = normal
            .cholesky()
            .map(|c| c.solve(&design.transpose()))
            .unwrap_or_else(|| DMatrix::zeros(3, n));
        let residual = DMatrix::identity(n, n) - &design * &linear;
        let bases = DMatrix::from_fn(n, n, |i, j| {
            basis(distance(&centres[i], &centres[j]), radii[j])
        });
        let radial = bases.lu().solve(&residual).unwrap_or(residual);
        let coefficients = DMatrix::from_fn(n, 3 + n, |example, c| {
            if c < 3 {
                linear[(c, example)]
            } else {
                radial[(c - 3, example)]
            }
        });
        Ok(Self {
            centres,
            low,
            span,
            radii,
            coefficients,
        })
    }

    /// Weights of all examples at `wish`, into `out`: not negative, sum 1, exact at the examples.
    ///
    /// A wish outside the examples' box is brought to its edge. Continuous, no allocation.
    pub fn at(&self, wish: Parameters, out: &mut [f64]) {
        let p = [0, 1].map(|d| ((wish[d] - self.low[d]) / self.span[d]).clamp(0.0, 1.0));
        let mut sum = 0.0;
        for (example, out) in out.iter_mut().enumerate() {
            let row = self.coefficients.row(example);
            let mut w = row[0] + row[1] * p[0] + row[2] * p[1];
            for (j, centre) in self.centres.iter().enumerate() {
                w += row[3 + j] * basis(distance(&p, centre), self.radii[j]);
            }
            *out = w.max(0.0);
            sum += *out;
        }
        if sum > 0.0 {
            out.iter_mut().for_each(|w| *w /= sum);
        } else {
            // The raw weights sum to one, so at least one was positive; kept for a zero matrix.
            out.fill(1.0 / self.centres.len() as f64);
        }
    }

    /// Lowest and highest frequency of the examples, Hz.
    pub fn frequencies(&self) -> (f64, f64) {
        let highest = self.centres.iter().map(|c| c[1]).fold(0.0, f64::max);
        (self.low[1], self.low[1] + highest * self.span[1])
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

fn distance(a: &Parameters, b: &Parameters) -> f64 {
    Vector2::new(a[0] - b[0], a[1] - b[1]).norm()
}

/// A smooth bump: 1 at the centre, 0 from `radius` on (Wendland's C2 function).
fn basis(distance: f64, radius: f64) -> f64 {
    let r = distance / radius;
    if r >= 1.0 {
        return 0.0;
    }
    (1.0 - r).powi(4) * (4.0 * r + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const EXAMPLES: [Parameters; 6] = [
        [0.0, 0.7],
        [0.0, 1.7],
        [0.5, 0.7],
        [1.0, 0.7],
        [0.5, 1.7],
        [1.0, 1.7],
    ];

    #[test]
    fn duplicates_and_nothing_are_refused() {
        assert_eq!(Weights::new(&[]).map(|_| ()), Err(WeightsError::Empty));
        let twice = Weights::new(&[[0.0, 1.0], [1.0, 1.0], [0.0, 1.0]]).map(|_| ());
        assert!(
            matches!(
                twice,
                Err(WeightsError::Duplicate {
                    first: 0,
                    second: 2,
                    ..
                })
            ),
            "{twice:?}"
        );
    }

    #[test]
    fn every_example_has_its_own_corner() {
        let weights = Weights::new(&EXAMPLES).expect("distinct");
        let mut out = [0.0; 6];
        for (i, p) in EXAMPLES.iter().enumerate() {
            weights.at(*p, &mut out);
            assert!((out[i] - 1.0).abs() < 1e-6, "example {i}: {out:?}");
        }
    }

    #[test]
    fn a_single_clip_always_has_weight_one() {
        let weights = Weights::new(&[[0.4, 1.0]]).expect("one clip");
        let mut out = [0.0];
        weights.at([f64::MAX, -3.0], &mut out);
        assert_eq!(out, [1.0]);
    }

    proptest! {
        #[test]
        fn weights_are_a_partition_and_continuous(a in -0.5..1.5f64, f in 0.0..4.0f64) {
            let weights = Weights::new(&EXAMPLES).expect("distinct");
            let (mut here, mut there) = ([0.0; 6], [0.0; 6]);
            weights.at([a, f], &mut here);
            weights.at([a + 1e-6, f + 1e-6], &mut there);
            let sum: f64 = here.iter().sum();
            prop_assert!((sum - 1.0).abs() < 1e-9, "sum {}", sum);
            prop_assert!(here.iter().all(|w| (0.0..=1.0 + 1e-12).contains(w)));
            for (x, y) in here.iter().zip(there) {
                prop_assert!((x - y).abs() < 1e-4, "jump {} at a {} f {}", x - y, a, f);
            }
        }
    }
}
