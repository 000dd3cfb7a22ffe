//! A least-squares cubic in up to four variables, with its derivatives.

use crate::motion::weights::MOST_DIMENSIONS;
use nalgebra::{DMatrix, SMatrix, SVector};

type Point = [f64; MOST_DIMENSIONS];
pub(super) type Jacobian = SMatrix<f64, MOST_DIMENSIONS, MOST_DIMENSIONS>;
pub(super) type Vector = SVector<f64, MOST_DIMENSIONS>;

/// `values(v) = sum of coefficient * v^exponents`, several values at once.
#[derive(Clone, Debug)]
pub(super) struct Cubic {
    exponents: Vec<[u8; MOST_DIMENSIONS]>,
    coefficients: Vec<Point>,
}

impl Cubic {
    /// Fit over `variables` variables to points and their values.
    pub(super) fn fit(variables: usize, points: &[Point], values: &[Point]) -> Self {
        let mut exponents = Vec::new();
        for code in 0..4usize.pow(variables as u32) {
            let e: [u8; MOST_DIMENSIONS] = std::array::from_fn(|d| {
                if d < variables {
                    (code >> (2 * d) & 3) as u8
                } else {
                    0
                }
            });
            if e.iter().sum::<u8>() <= 3 {
                exponents.push(e);
            }
        }
        let design = DMatrix::from_fn(points.len(), exponents.len(), |i, t| {
            (0..variables)
                .map(|d| points[i][d].powi(i32::from(exponents[t][d])))
                .product::<f64>()
        });
        let right = DMatrix::from_fn(points.len(), MOST_DIMENSIONS, |i, d| values[i][d]);
        // Singular values below rounding are left out: a straight function needs no more terms.
        let solved = design
            .svd(true, true)
            .solve(&right, 1e-12)
            .unwrap_or_else(|_| DMatrix::zeros(exponents.len(), MOST_DIMENSIONS));
        Self {
            coefficients: (0..exponents.len())
                .map(|t| std::array::from_fn(|d| solved[(t, d)]))
                .collect(),
            exponents,
        }
    }

    /// Values and derivatives (rows: values, columns: variables) at `v`. No allocation.
    pub(super) fn at(&self, v: &Point) -> (Vector, Jacobian) {
        // Powers 0..=3 of each variable.
        let powers = v.map(|x| [1.0, x, x * x, x * x * x]);
        let mut value = Vector::zeros();
        let mut slope = Jacobian::zeros();
        for (e, c) in self.exponents.iter().zip(&self.coefficients) {
            let c = Vector::from(*c);
            let power = |d: usize| powers[d][usize::from(e[d])];
            value += c * (power(0) * power(1) * power(2) * power(3));
            for d in 0..MOST_DIMENSIONS {
                if e[d] > 0 {
                    let mut term = f64::from(e[d]) * powers[d][usize::from(e[d]) - 1];
                    for other in (0..MOST_DIMENSIONS).filter(|o| *o != d) {
                        term *= power(other);
                    }
                    let mut column = slope.column_mut(d);
                    column += c * term;
                }
            }
        }
        (value, slope)
    }
}
