//! Points that are not seen: filled in from the ones that are, as they move together in the gestures.
//!
//! The reference frames of all gestures are taken as samples of a Gaussian over poses, reduced to
//! its principal components (probabilistic principal component analysis). The expectation of what
//! is not seen given what is (the conditional mean of that Gaussian) is then one system of eight
//! equations, whatever the number of points.

use crate::gesture::References;
use nalgebra::{DMatrix, DVector, SMatrix, SVector, SymmetricEigen};

/// Principal components kept at most.
const COMPONENTS: usize = 8;
/// Components with less than this share of the variance are noise.
const LEAST_SHARE: f64 = 1e-5;
/// How far a pose may be from what the components span, as a share of the gestures' size.
const MISFIT_SHARE: f64 = 0.01;
/// A point that was elsewhere than expected when it was last seen comes over within this time, seconds.
const CARRY_S: f64 = 0.5;

type Square = SMatrix<f64, COMPONENTS, COMPONENTS>;
type Latent = SVector<f64, COMPONENTS>;

/// Expected places of points from the places of others.
#[derive(Clone, Debug)]
pub(in crate::gesture) struct Completion {
    mean: DVector<f64>,
    /// One row per coordinate: how it moves with each component.
    basis: DMatrix<f64>,
    misfit: f64,
    /// Expected now and for the pose before, from the points seen now.
    expected: [Vec<[f64; 3]>; 2],
}

impl Completion {
    /// Learns how the points of `references` move together; every gesture weighs alike.
    pub fn new(references: &References) -> Self {
        let coordinates = references.mean.first().map_or(0, DVector::len);
        let gestures = references.mean.len().max(1) as f64;
        let mut mean = DVector::zeros(coordinates);
        for own in &references.mean {
            mean += own / gestures;
        }
        let mut covariance = DMatrix::zeros(coordinates, coordinates);
        for rows in &references.local {
            let weight = 1.0 / (gestures * rows.len().max(1) as f64);
            for row in rows {
                let relative = row - &mean;
                covariance.ger(weight, &relative, &relative, 1.0);
            }
        }
        let total = covariance.trace();
        let eigen = SymmetricEigen::new(covariance);
        let mut order: Vec<usize> = (0..coordinates).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let mut basis = DMatrix::zeros(coordinates, COMPONENTS);
        for (column, component) in order.into_iter().take(COMPONENTS).enumerate() {
            let variance = eigen.eigenvalues[component];
            if variance > LEAST_SHARE * total {
                let scaled = eigen.eigenvectors.column(component) * variance.sqrt();
                basis.set_column(column, &scaled);
            }
        }
        let points = coordinates / 3;
        Self {
            mean,
            basis,
            misfit: (MISFIT_SHARE * references.scale_m).powi(2).max(1e-18),
            expected: [vec![[0.0; 3]; points], vec![[0.0; 3]; points]],
        }
    }

    /// Goes from the pose `local` to `fresh`, `step_s` later, both without global motion.
    ///
    /// `weights` says per point how far it is trusted: 1 is taken as it is, 0 was not seen and is
    /// expected from the others, between is between. What a point was off its expectation when it
    /// was last seen is carried on and dies away, so that nothing jumps when a point vanishes and a
    /// point that moves on its own first stays where it was. Allocates nothing.
    pub fn fill(
        &mut self,
        step_s: f64,
        weights: &[f64],
        fresh: &[[f64; 3]],
        local: &mut [[f64; 3]],
    ) {
        let mut normal = Square::identity() * self.misfit;
        let (mut now, mut before) = (Latent::zeros(), Latent::zeros());
        for (point, weight) in weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
            for axis in 0..3 {
                let coordinate = 3 * point + axis;
                let row: Latent = self
                    .basis
                    .fixed_view::<1, COMPONENTS>(coordinate, 0)
                    .transpose();
                normal.ger(*weight, &row, &row, 1.0);
                now += row * (weight * (fresh[point][axis] - self.mean[coordinate]));
                before += row * (weight * (local[point][axis] - self.mean[coordinate]));
            }
        }
        // Positive definite: a sum of squares on top of a positive diagonal.
        let (now, before) = match normal.cholesky() {
            Some(factor) => (factor.solve(&now), factor.solve(&before)),
            None => (Latent::zeros(), Latent::zeros()),
        };
        let carried = (-step_s / CARRY_S).exp();
        for (latent, expected) in [now, before].iter().zip(&mut self.expected) {
            for (coordinate, value) in expected.as_flattened_mut().iter_mut().enumerate() {
                let row = self.basis.fixed_view::<1, COMPONENTS>(coordinate, 0);
                *value = self.mean[coordinate] + (row * latent)[0];
            }
        }
        for (point, weight) in weights.iter().enumerate() {
            for axis in 0..3 {
                let off = local[point][axis] - self.expected[1][point][axis];
                let filled = self.expected[0][point][axis] + carried * off;
                local[point][axis] = if *weight >= 1.0 {
                    fresh[point][axis]
                } else if *weight > 0.0 {
                    filled + weight * (fresh[point][axis] - filled)
                } else {
                    filled
                };
            }
        }
    }
}
