//! Inverse map: from what a user asks of a class (hand height, speed, jump length) to its blend
//! weights (Casas 2013, 3.2.3).
//!
//! The forward function `p = f(w)` is evaluated on samples of the weight space when the map is
//! made, never while it is used. One parameter: a table along the chain of clips, ordered by their
//! own values (`chain`). Several: a grid over simplices of the clips, a cubic fit on each, and a few
//! damped Gauss-Newton steps from the nearest sample (`faces`). Weights are the sparsest that can
//! do it: at most one clip more than parameters.

mod chain;
mod cubic;
mod faces;

pub use chain::Monotone;

use super::weights::{MOST_DIMENSIONS, Parameters};
use crate::base::random::SplitMix;
use chain::Chain;
use faces::Faces;

/// What to do where one parameter goes up and down again along the clips.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub enum NotMonotone {
    /// Use the longest monotone stretch only; the reachable range becomes smaller.
    #[default]
    Restrict,
    /// Use the nearest monotone function; the whole range is reachable, with an error that the
    /// round trip shows.
    Isotonic,
}

/// How the map is made.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct InverseOptions {
    /// Samples between two clips, one parameter.
    pub samples: usize,
    /// Steps along each edge of a simplex, several parameters.
    pub grid: usize,
    /// What to do where it is not monotone.
    pub not_monotone: NotMonotone,
    /// Random wishes for the round trip.
    pub trials: usize,
}

impl Default for InverseOptions {
    fn default() -> Self {
        Self {
            samples: 64,
            grid: 10,
            not_monotone: NotMonotone::Restrict,
            trials: 500,
        }
    }
}

/// Why there is no inverse.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum InverseError {
    /// No clip at all.
    #[error("a class needs at least one clip")]
    Empty,
    /// Number of parameters.
    #[error("{found} parameters; 1 to {MOST_DIMENSIONS} can be asked for")]
    Dimensions {
        /// What was asked for.
        found: usize,
    },
    /// More combinations of clips than a wish can be compared with.
    #[error(
        "{examples} clips and {dimensions} parameters are too many combinations; split the class, or ask for fewer parameters"
    )]
    TooMany {
        /// Number of clips.
        examples: usize,
        /// Number of parameters.
        dimensions: usize,
    },
    /// The forward function gave something that is no number.
    #[error(
        "parameter {dimension} is {found} at weights {weights:?}; it must be a finite number at every blend"
    )]
    NotFinite {
        /// Index of the parameter.
        dimension: usize,
        /// What was found.
        found: f64,
        /// Where.
        weights: Vec<f64>,
    },
    /// A parameter that no blend changes.
    #[error(
        "parameter {dimension} is {value} at every blend; give a clip that differs in it, or leave the parameter out"
    )]
    Flat {
        /// Index of the parameter.
        dimension: usize,
        /// Its only value.
        value: f64,
    },
}

/// How well `f(weights(p))` meets p, at random wishes.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct RoundTrip {
    /// Wishes tried.
    pub trials: usize,
    /// Mean absolute error of the worst parameter, as a share of its range.
    pub mean: f64,
    /// Largest error of any parameter, as a share of its range.
    pub max: f64,
}

/// Parameters to weights.
#[derive(Clone, Debug)]
pub struct InverseMap {
    examples: usize,
    dimensions: usize,
    low: [f64; MOST_DIMENSIONS],
    high: [f64; MOST_DIMENSIONS],
    kind: Kind,
    round_trip: RoundTrip,
}

#[derive(Clone, Debug)]
enum Kind {
    /// One clip: nothing to choose.
    One,
    Chain(Chain),
    Faces(Faces),
}

impl InverseMap {
    /// Makes the map for a class of `examples` clips and `dimensions` parameters.
    ///
    /// `forward(w, p)`: the parameters of the pose or clip that is blended with weights `w` (not
    /// negative, sum 1), into `p`. It is called some hundred to some thousand times.
    pub fn new(
        examples: usize,
        dimensions: usize,
        options: InverseOptions,
        mut forward: impl FnMut(&[f64], &mut [f64]),
    ) -> Result<Self, InverseError> {
        if examples == 0 {
            return Err(InverseError::Empty);
        }
        if !(1..=MOST_DIMENSIONS).contains(&dimensions) {
            return Err(InverseError::Dimensions { found: dimensions });
        }
        let mut evaluate = |w: &[f64]| -> Result<[f64; MOST_DIMENSIONS], InverseError> {
            let mut p = [0.0; MOST_DIMENSIONS];
            forward(w, &mut p[..dimensions]);
            match p.iter().position(|v| !v.is_finite()) {
                None => Ok(p),
                Some(dimension) => Err(InverseError::NotFinite {
                    dimension,
                    found: p[dimension],
                    weights: w.to_vec(),
                }),
            }
        };
        let mut map = Self {
            examples,
            dimensions,
            low: [0.0; MOST_DIMENSIONS],
            high: [0.0; MOST_DIMENSIONS],
            kind: Kind::One,
            round_trip: RoundTrip::default(),
        };
        if examples == 1 {
            map.low = evaluate(&[1.0])?;
            map.high = map.low;
            return Ok(map);
        }
        if dimensions == 1 {
            let chain = Chain::new(examples, &options, |w| Ok(evaluate(w)?[0]))?;
            (map.low[0], map.high[0]) = chain.range();
            map.kind = Kind::Chain(chain);
        } else {
            let faces = Faces::new(examples, dimensions, options.grid.max(3), &mut evaluate)?;
            (map.low, map.high) = faces.range();
            map.kind = Kind::Faces(faces);
        }
        map.round_trip = map.tried(options.trials, &mut evaluate)?;
        Ok(map)
    }

    /// Weights of all clips for `wish`, into `out` (one per clip): not negative, sum 1.
    ///
    /// The wish is clamped to the reached range; what is not a number is taken for its low end. No
    /// allocation. One parameter: continuous. Several: continuous if there is at most one clip more than
    /// parameters, else neighbouring wishes may be met by other clips.
    pub fn weights(&self, wish: impl Into<Parameters>, out: &mut [f64]) {
        let wish: Parameters = wish.into();
        let out = &mut out[..self.examples];
        // `max` before `min`, so that not-a-number becomes the low end.
        let p: [f64; MOST_DIMENSIONS] =
            std::array::from_fn(|d| wish[d].max(self.low[d]).min(self.high[d]));
        match &self.kind {
            Kind::One => out.fill(1.0),
            Kind::Chain(chain) => chain.weights(p[0], out),
            Kind::Faces(faces) => faces.weights(&p, out),
        }
    }

    /// Lowest and highest reached value of parameter `d`; (0, 0) for one that is not there.
    pub fn range(&self, d: usize) -> (f64, f64) {
        if d < self.dimensions {
            (self.low[d], self.high[d])
        } else {
            (0.0, 0.0)
        }
    }

    /// Whether one parameter is monotone along the clips, and what was done if not; `None` for
    /// several parameters.
    pub fn monotone(&self) -> Option<Monotone> {
        match &self.kind {
            Kind::Chain(chain) => Some(chain.monotone()),
            _ => None,
        }
    }

    /// How well wishes are met, measured when the map was made.
    pub fn round_trip(&self) -> RoundTrip {
        self.round_trip
    }

    /// Round trip at random wishes: even in the range for one parameter, else of random blends.
    fn tried(
        &self,
        trials: usize,
        evaluate: &mut impl FnMut(&[f64]) -> Result<[f64; MOST_DIMENSIONS], InverseError>,
    ) -> Result<RoundTrip, InverseError> {
        let mut random = SplitMix::new(0x5eed);
        let mut w = vec![0.0; self.examples];
        let mut sums = [0.0; MOST_DIMENSIONS];
        let mut max: f64 = 0.0;
        for _ in 0..trials {
            let wish = if self.dimensions == 1 {
                let mut p = [0.0; MOST_DIMENSIONS];
                p[0] = self.low[0] + random.unit() * (self.high[0] - self.low[0]);
                p
            } else {
                // Even over the simplex: exponential shares.
                w.iter_mut().for_each(|w| *w = -(1.0 - random.unit()).ln());
                let sum: f64 = w.iter().sum();
                w.iter_mut().for_each(|w| *w /= sum);
                evaluate(&w)?
            };
            let known = Parameters::from_slice(&wish[..self.dimensions]).unwrap_or_default();
            self.weights(known, &mut w);
            let met = evaluate(&w)?;
            for d in 0..self.dimensions {
                let error = (met[d] - wish[d]).abs() / (self.high[d] - self.low[d]).max(1e-12);
                sums[d] += error;
                max = max.max(error);
            }
        }
        Ok(RoundTrip {
            trials,
            mean: sums.iter().fold(0.0, |a: f64, b| a.max(*b)) / trials.max(1) as f64,
            max,
        })
    }
}

#[cfg(test)]
mod tests;
