//! The root motion map: how fast a body travels, from how fast its pose changes.
//!
//! Rhodin 2016, eq. 8.1: W = argmin sum_t || W |dy/dt| - d trans/dt ||^2 + || sigma_trans W ||^2 with
//! |.| per coefficient; a quicker change of pose is a quicker walk.

use super::error::{MappingError, numbers};
use nalgebra::{Cholesky, DMatrix};

/// sigma_trans of the thesis.
pub const ROOT_RIDGE: f64 = 0.001;

/// W: two rows (forwards, left, m/s) over the volume's coefficients.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RootMap {
    /// Two rows of one weight per axis; empty for a body that does not travel.
    pub weights: Vec<f64>,
}

impl RootMap {
    /// Learns W from the speed of every coefficient (one row a frame, per second) and the root's
    /// velocity (forwards, left; m/s) at the same frames, with `ridge` for sigma_trans
    /// ([`ROOT_RIDGE`] at least). All velocities zero: a body that stays.
    ///
    /// # Errors
    /// Rows of different length, numbers that are not finite.
    pub fn learn(
        speeds: &[Vec<f64>],
        velocities: &[[f64; 2]],
        ridge: f64,
    ) -> Result<Self, MappingError> {
        if velocities.iter().flatten().all(|v| *v == 0.0) {
            return Ok(Self::default());
        }
        let axes = speeds.first().map_or(0, Vec::len);
        for (k, (speed, velocity)) in speeds.iter().zip(velocities).enumerate() {
            numbers(&format!("pose velocity of target frame {k}"), speed, axes)?;
            numbers(&format!("root velocity of target frame {k}"), velocity, 2)?;
        }
        let count = speeds.len().min(velocities.len());
        let a = DMatrix::from_fn(count, axes, |r, c| speeds[r][c].abs());
        let b = DMatrix::from_fn(count, 2, |r, c| velocities[r][c]);
        let gram =
            a.transpose() * &a + DMatrix::identity(axes, axes) * ridge.max(ROOT_RIDGE).powi(2);
        // Positive definite by the ridge; numbers too large to multiply leave the body where it is.
        let Some(factor) = Cholesky::new(gram) else {
            return Ok(Self::default());
        };
        let w = factor.solve(&(a.transpose() * b));
        // Column-major W^T is row-major W.
        Ok(Self {
            weights: w.as_slice().to_vec(),
        })
    }

    /// The map with each row scaled so that it travels as fast as `velocities` on the whole.
    pub fn scaled_to(mut self, speeds: &[Vec<f64>], velocities: &[[f64; 2]]) -> Self {
        let mut sums = [[0.0; 2]; 2];
        for (speed, velocity) in speeds.iter().zip(velocities) {
            let found = self.velocity(speed);
            for row in 0..2 {
                sums[row][0] += found[row] * velocity[row];
                sums[row][1] += found[row] * found[row];
            }
        }
        let axes = self.weights.len() / 2;
        for (row, weights) in self.weights.chunks_exact_mut(axes.max(1)).enumerate() {
            let [with, own] = sums[row];
            if own > 0.0 {
                weights.iter_mut().for_each(|w| *w *= with / own);
            }
        }
        self
    }

    /// Root velocity (forwards, left; m/s) while the coefficients change by `change` per second.
    pub fn velocity(&self, change: &[f64]) -> [f64; 2] {
        let mut out = [0.0; 2];
        for (out, row) in out
            .iter_mut()
            .zip(self.weights.chunks_exact(change.len().max(1)))
        {
            *out = row.iter().zip(change).map(|(w, v)| w * v.abs()).sum();
        }
        out
    }
}
