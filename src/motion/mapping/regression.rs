//! Bayesian linear regression from few pairs: mean and uncertainty of the target pose.
//!
//! Rhodin 2016, section 8.4, eq. 8.3: with a unit Gaussian prior on the rows of M, noise variance
//! sigma^2 and a bias 1 appended to every input,
//!
//! ```text
//! A = sigma^-2 X X^T + I,   y* = sigma^-2 Y X^T A^-1 x*,   q(x*) = x*^T A^-1 x*
//! ```
//!
//! A has one row per input, thousands of them against 4 to 8 pairs; by the matrix inversion lemma
//! the same numbers come from the n x n matrix K = X^T X + sigma^2 I:
//!
//! ```text
//! M = Y K^-1 X^T,           q(x*) = x*^T x* - (X^T x*)^T K^-1 (X^T x*)
//! ```
//!
//! Whichever matrix is smaller is factored.

use super::error::{MappingError, numbers};
use nalgebra::{Cholesky, DMatrix, Dyn};

/// Noise variance sigma^2 of the thesis (section 8.4).
pub const NOISE_VARIANCE: f64 = 0.05;

/// How uncertain the map is at an input, given the inputs that are taught: q of eq. 8.3.
#[derive(Clone, Debug)]
pub struct Uncertainty {
    inputs: usize,
    form: Form,
}

#[derive(Clone, Debug)]
enum Form {
    /// Nothing taught: the prior.
    Prior,
    /// Inputs (one column a pair) and the factor of K.
    Dual(DMatrix<f64>, Cholesky<f64, Dyn>),
    /// The factor of A.
    Primal(Cholesky<f64, Dyn>),
}

/// Input with the bias appended.
fn with_bias(x: &[f64]) -> impl Iterator<Item = f64> + '_ {
    x.iter().copied().chain(std::iter::once(1.0))
}

fn design(xs: &[Vec<f64>], inputs: usize) -> DMatrix<f64> {
    DMatrix::from_fn(inputs + 1, xs.len(), |r, c| {
        xs[c].get(r).copied().unwrap_or(1.0)
    })
}

impl Uncertainty {
    /// Of inputs of length `inputs`, given those in `taught` (each as long), in any number.
    pub fn new(inputs: usize, taught: &[Vec<f64>], noise_variance: f64) -> Self {
        let form = if taught.is_empty() {
            Form::Prior
        } else {
            let x = design(taught, inputs);
            let dual = x.ncols() <= x.nrows();
            let matrix = if dual {
                x.transpose() * &x + DMatrix::identity(x.ncols(), x.ncols()) * noise_variance
            } else {
                &x * x.transpose() / noise_variance + DMatrix::identity(x.nrows(), x.nrows())
            };
            match Cholesky::new(matrix) {
                Some(factor) if dual => Form::Dual(x, factor),
                Some(factor) => Form::Primal(factor),
                // A positive multiple of the identity was added: only numbers that are not finite get here.
                None => Form::Prior,
            }
        };
        Self { inputs, form }
    }

    /// Numbers of work space that [`Uncertainty::q`] needs.
    pub fn scratch_len(&self) -> usize {
        match &self.form {
            Form::Prior => 0,
            Form::Dual(x, _) => x.ncols(),
            Form::Primal(_) => self.inputs + 1,
        }
    }

    /// q at `x`: from its prior value x^T x (with the bias) down to about sigma^2 at a taught pose.
    /// `scratch` is at least [`Uncertainty::scratch_len`] long; allocates nothing.
    pub fn q(&self, x: &[f64], scratch: &mut [f64]) -> f64 {
        let prior = self.prior(x);
        match &self.form {
            Form::Prior => prior,
            Form::Dual(design, factor) => {
                let n = design.ncols();
                for (pair, out) in scratch[..n].iter_mut().enumerate() {
                    *out = design
                        .column(pair)
                        .iter()
                        .zip(with_bias(x))
                        .map(|(a, b)| a * b)
                        .sum();
                }
                bounded(
                    prior - solved_square(factor.l_dirty(), &mut scratch[..n]),
                    prior,
                )
            }
            Form::Primal(factor) => {
                let n = self.inputs + 1;
                for (out, value) in scratch[..n].iter_mut().zip(with_bias(x)) {
                    *out = value;
                }
                bounded(solved_square(factor.l_dirty(), &mut scratch[..n]), prior)
            }
        }
    }

    /// q at `x` before anything was taught.
    pub fn prior(&self, x: &[f64]) -> f64 {
        with_bias(x).map(|v| v * v).sum()
    }
}

/// `q` within 0 and its prior, rounding or not; 0 where numbers overflow.
fn bounded(q: f64, prior: f64) -> f64 {
    if prior.is_finite() {
        q.max(0.0).min(prior)
    } else {
        0.0
    }
}

/// b^T (L L^T)^-1 b by forward substitution in place.
fn solved_square(lower: &DMatrix<f64>, b: &mut [f64]) -> f64 {
    let mut sum = 0.0;
    for row in 0..b.len() {
        let mut value = b[row];
        for column in 0..row {
            value -= lower[(row, column)] * b[column];
        }
        b[row] = value / lower[(row, row)];
        sum += b[row] * b[row];
    }
    sum
}

/// A linear map learned from pairs, with its uncertainty.
#[derive(Clone, Debug)]
pub struct Regression {
    /// Outputs x (inputs + 1), rows one after the other.
    map: Vec<f64>,
    inputs: usize,
    uncertainty: Uncertainty,
}

impl Regression {
    /// Learns from inputs `xs` and outputs `ys`, one of each per pair; `labels` name the pairs in
    /// errors.
    ///
    /// # Errors
    /// Fewer than two pairs, lengths that differ, numbers that are not finite, pairs with the same
    /// input, noise that is not positive. All name the pair.
    pub fn fit(
        xs: &[Vec<f64>],
        ys: &[Vec<f64>],
        labels: &[String],
        noise_variance: f64,
    ) -> Result<Self, MappingError> {
        if !(noise_variance >= 1e-9 && noise_variance.is_finite()) {
            return Err(MappingError::Option {
                key: "noise_variance",
                found: noise_variance,
                allowed: "finite, 1e-9 or more",
            });
        }
        let pairs = xs.len().min(ys.len());
        if pairs < 2 {
            return Err(MappingError::TooFewPairs { found: pairs });
        }
        let label = |k: usize| {
            labels
                .get(k)
                .cloned()
                .unwrap_or_else(|| format!("pair {}", k + 1))
        };
        let (inputs, outputs) = (xs[0].len(), ys[0].len());
        for (k, (x, y)) in xs.iter().zip(ys).enumerate() {
            numbers(&format!("{}: source pose", label(k)), x, inputs)?;
            numbers(&format!("{}: target pose", label(k)), y, outputs)?;
        }
        let apart = |a: &[f64], b: &[f64]| -> f64 {
            a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>()
        };
        let size = |a: &[f64]| a.iter().map(|v| v * v).sum::<f64>();
        let same = |a: &Vec<f64>, b: &Vec<f64>| apart(a, b) <= 1e-12 * size(a).max(size(b));
        if xs.iter().all(|x| same(x, &xs[0])) {
            return Err(MappingError::ConstantSource {
                where_: format!("{} to {}", label(0), label(pairs - 1)),
                spread_m: 0.0,
            });
        }
        for second in 1..pairs {
            if let Some(first) = (0..second).find(|f| same(&xs[*f], &xs[second])) {
                return Err(MappingError::DuplicatePairs {
                    first: label(first),
                    second: label(second),
                });
            }
        }
        let uncertainty = Uncertainty::new(inputs, &xs[..pairs], noise_variance);
        let x = design(&xs[..pairs], inputs);
        let y = DMatrix::from_fn(outputs, pairs, |r, c| ys[c][r]);
        let map = match &uncertainty.form {
            // M^T = X K^-1 Y^T
            Form::Dual(_, factor) => &x * factor.solve(&y.transpose()),
            // M^T = sigma^-2 A^-1 X Y^T
            Form::Primal(factor) => factor.solve(&(&x * y.transpose() / noise_variance)),
            Form::Prior => {
                return Err(MappingError::NotFinite {
                    what: "the pairs' source poses are too large to multiply; largest".into(),
                    index: 0,
                    value: x.amax(),
                });
            }
        };
        Ok(Self {
            // Column-major M^T is row-major M.
            map: map.as_slice().to_vec(),
            inputs,
            uncertainty,
        })
    }

    /// Numbers of an input.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// The mean of the output at `x`, into `out`; allocates nothing.
    pub fn predict(&self, x: &[f64], out: &mut [f64]) {
        for (out, row) in out.iter_mut().zip(self.map.chunks_exact(self.inputs + 1)) {
            *out = row.iter().zip(with_bias(x)).map(|(m, v)| m * v).sum();
        }
    }

    /// How uncertain the map is where.
    pub fn uncertainty(&self) -> &Uncertainty {
        &self.uncertainty
    }
}
