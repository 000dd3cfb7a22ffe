//! Smooth radial basis functions over scattered examples, after Rose et al. 1998.

use super::parameters::MOST_DIMENSIONS;
use nalgebra::DMatrix;

type Point = [f64; MOST_DIMENSIONS];

/// How far a basis reaches, in distances to the nearest other example. The first that gives a
/// well-posed system is taken; at 1 the bases do not touch and the system is the identity.
const REACHES: [f64; 5] = [2.0, 1.75, 1.5, 1.25, 1.0];

/// The coefficients of `raw weight = linear part + sum of bumps`, one per example.
#[derive(Clone, Debug)]
pub(super) struct Radial {
    /// Columns: constant, then one per dimension; each has one number per example.
    linear: Vec<f64>,
    /// One column per basis; each has one number per example.
    radial: Vec<f64>,
    /// 1 / radius^2 of each basis.
    inverse_radius_sq: Vec<f64>,
    dimensions: usize,
}

impl Radial {
    /// Fits the map to `centres` (scaled to 0..1), no two of which are the same.
    pub(super) fn new(centres: &[Point], dimensions: usize) -> Self {
        let n = centres.len();
        let terms = dimensions + 1;
        // Least squares with a whisper of ridge, since examples may lie on a line.
        let design = DMatrix::from_fn(
            n,
            terms,
            |i, c| if c == 0 { 1.0 } else { centres[i][c - 1] },
        );
        let normal = design.transpose() * &design + DMatrix::identity(terms, terms) * 1e-9;
        let linear = normal
            .cholesky()
            .map(|c| c.solve(&design.transpose()))
            .unwrap_or_else(|| DMatrix::zeros(terms, n));
        let residual = DMatrix::identity(n, n) - &design * &linear;
        let nearest: Vec<f64> = (0..n)
            .map(|i| {
                (0..n)
                    .filter(|j| *j != i)
                    .map(|j| distance_sq(&centres[i], &centres[j]).sqrt())
                    .fold(f64::INFINITY, f64::min)
            })
            .map(|d| if d.is_finite() { d } else { 1.0 })
            .collect();
        let mut radial = residual.clone();
        let mut reach = 1.0;
        for candidate in REACHES {
            let bases = DMatrix::from_fn(n, n, |i, j| {
                let radius = candidate * nearest[j];
                bump(distance_sq(&centres[i], &centres[j]) / (radius * radius))
            });
            if let Some(solved) = bases.clone().lu().solve(&residual)
                && (&bases * &solved - &residual).amax() < 1e-9
                && solved.amax() < 10.0
            {
                (radial, reach) = (solved, candidate);
                break;
            }
        }
        Self {
            linear: (0..terms)
                .flat_map(|c| (0..n).map(move |i| (c, i)))
                .map(|(c, i)| linear[(c, i)])
                .collect(),
            radial: (0..n)
                .flat_map(|j| (0..n).map(move |i| (j, i)))
                .map(|(j, i)| radial[(j, i)])
                .collect(),
            inverse_radius_sq: nearest.iter().map(|d| (reach * d).powi(-2)).collect(),
            dimensions,
        }
    }

    /// Raw weights at `p`, cut off below zero; their sum is at least 1 up to rounding.
    #[inline]
    pub(super) fn at(&self, centres: &[Point], p: &Point, out: &mut [f64]) {
        let n = centres.len();
        out.copy_from_slice(&self.linear[..n]);
        for (d, column) in self.linear[n..].chunks_exact(n).enumerate() {
            add_scaled(out, column, p[d.min(self.dimensions - 1)]);
        }
        for ((centre, inverse), column) in centres
            .iter()
            .zip(&self.inverse_radius_sq)
            .zip(self.radial.chunks_exact(n))
        {
            let r_sq = distance_sq(p, centre) * inverse;
            if r_sq < 1.0 {
                add_scaled(out, column, bump(r_sq));
            }
        }
        for w in out {
            *w = w.max(0.0);
        }
    }
}

#[inline]
fn add_scaled(out: &mut [f64], column: &[f64], by: f64) {
    for (o, c) in out.iter_mut().zip(column) {
        *o += by * c;
    }
}

/// Squared distance of two points with unused dimensions zero.
#[inline]
pub(in crate::motion) fn distance_sq(a: &Point, b: &Point) -> f64 {
    let mut sum = 0.0;
    for d in 0..MOST_DIMENSIONS {
        sum += (a[d] - b[d]) * (a[d] - b[d]);
    }
    sum
}

/// A smooth bump of the squared distance over the squared radius: 1 at 0, 0 from 1 on (Wendland's
/// C2 function).
#[inline]
fn bump(r_sq: f64) -> f64 {
    if r_sq >= 1.0 {
        return 0.0;
    }
    let r = r_sq.sqrt();
    let s = (1.0 - r) * (1.0 - r);
    s * s * (4.0 * r + 1.0)
}
