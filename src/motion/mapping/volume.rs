//! The latent volume: an oriented box of admissible poses, learned from unlabelled target motion.
//!
//! Rhodin 2016, section 8.2.1: principal axes of all target frames U_y, and per axis c the least
//! interval I_c that holds them. A robot has a second box, its joints' limits. Both are convex and
//! both hold the mean pose, so a pose inside both always exists: [`LatentVolume::confine`] finds one
//! near the wish.

use super::error::{MappingError, numbers};
use nalgebra::{DMatrix, SymmetricEigen};

/// Most principal axes kept (section 8.2.1: 50).
pub const MOST_AXES: usize = 50;
/// Axes with less than this part of the variance are rounding, not motion.
const LEAST_SHARE: f64 = 1e-9;
/// Alternating projections between the two boxes before the rest is made good by shrinking.
const PROJECTIONS: usize = 12;

/// An oriented box in pose space, and the joints' limits as a second one.
#[derive(Clone, Debug, PartialEq)]
pub struct LatentVolume {
    /// Mean target pose, one number per joint.
    pub mean: Vec<f64>,
    /// Axes x joints, orthonormal rows, the strongest first.
    pub axes: Vec<f64>,
    /// Lower end of each axis's interval.
    pub low: Vec<f64>,
    /// Upper end of each axis's interval.
    pub high: Vec<f64>,
    /// Share of the frames' variance that the axes hold, 0..1.
    pub kept: f64,
    /// Lowest position of each joint; minus infinity for none.
    pub lower: Vec<f64>,
    /// Highest position of each joint; infinity for none.
    pub upper: Vec<f64>,
}

impl LatentVolume {
    /// Learns the volume from `frames` (one pose each), keeping at most `most_axes` (and never more
    /// than [`MOST_AXES`], or than the frames have directions). Joint limits are open.
    ///
    /// # Errors
    /// Fewer than two frames, frames of different length, numbers that are not finite, frames that
    /// are all alike.
    pub fn learn(frames: &[Vec<f64>], most_axes: usize) -> Result<Self, MappingError> {
        if frames.len() < 2 {
            return Err(MappingError::TooFewFrames {
                found: frames.len(),
            });
        }
        let joints = frames[0].len();
        for (k, frame) in frames.iter().enumerate() {
            numbers(&format!("target frame {k}"), frame, joints)?;
        }
        let count = frames.len();
        let mut mean = vec![0.0; joints];
        for frame in frames {
            for (mean, q) in mean.iter_mut().zip(frame) {
                *mean += q / count as f64;
            }
        }
        let centred = DMatrix::from_fn(count, joints, |k, j| frames[k][j] - mean[j]);
        let total = centred.norm_squared();
        let size = frames.iter().flatten().map(|q| q * q).sum::<f64>();
        if !(total > 1e-18 * size.max(1e-6)) {
            return Err(MappingError::ConstantTarget);
        }
        let found = principal_axes(&centred);
        let mut volume = Self {
            mean,
            axes: Vec::new(),
            low: Vec::new(),
            high: Vec::new(),
            kept: 0.0,
            lower: vec![f64::NEG_INFINITY; joints],
            upper: vec![f64::INFINITY; joints],
        };
        for (variance, axis) in found {
            if variance < LEAST_SHARE * total || volume.low.len() >= most_axes.min(MOST_AXES) {
                break;
            }
            let along = &centred * nalgebra::DVector::from_column_slice(&axis);
            volume.low.push(along.min());
            volume.high.push(along.max());
            volume.kept += variance / total;
            volume.axes.extend(axis);
        }
        volume.kept = volume.kept.min(1.0);
        Ok(volume)
    }

    /// The volume with joint limits as a second box.
    ///
    /// # Errors
    /// Another number of joints, a mean pose outside of the limits.
    pub fn within(mut self, lower: &[f64], upper: &[f64]) -> Result<Self, MappingError> {
        for bound in [lower, upper] {
            if bound.len() != self.joints() {
                return Err(MappingError::Dimension {
                    what: "joint limits".into(),
                    found: bound.len(),
                    expected: self.joints(),
                });
            }
        }
        check_limits("the mean of the target frames", &self.mean, lower, upper)?;
        self.lower = lower.to_vec();
        self.upper = upper.to_vec();
        Ok(self)
    }

    /// Numbers in a pose.
    pub fn joints(&self) -> usize {
        self.mean.len()
    }

    /// Principal axes.
    pub fn dimensions(&self) -> usize {
        self.low.len()
    }

    /// Coordinates of `pose` along the axes, not clipped.
    pub fn project(&self, pose: &[f64], out: &mut [f64]) {
        for (out, axis) in out.iter_mut().zip(self.axes.chunks_exact(self.joints())) {
            *out = (axis.iter().zip(pose).zip(&self.mean))
                .map(|((a, q), mean)| a * (q - mean))
                .sum();
        }
    }

    /// The pose at `coefficients`.
    pub fn back(&self, coefficients: &[f64], out: &mut [f64]) {
        out.copy_from_slice(&self.mean);
        for (c, axis) in coefficients
            .iter()
            .zip(self.axes.chunks_exact(self.joints()))
        {
            for (out, a) in out.iter_mut().zip(axis) {
                *out += c * a;
            }
        }
    }

    /// Clips every coefficient to its interval; what is not a number goes to the mean.
    pub fn clip(&self, coefficients: &mut [f64]) {
        for ((c, low), high) in coefficients.iter_mut().zip(&self.low).zip(&self.high) {
            *c = if c.is_nan() { 0.0 } else { *c }.clamp(*low, *high);
        }
    }

    /// Turns `coefficients` into a pose inside the volume *and* inside the joint limits; both slices
    /// hold that pose after it. Any input is allowed; allocates nothing.
    ///
    /// Clipping to the axes' intervals alone may leave the joint limits in a corner of the box, and
    /// clamping joints may leave the box. So the two projections alternate, and what little is left
    /// is made good by moving straight towards the mean pose, which is inside both.
    pub fn confine(&self, coefficients: &mut [f64], pose: &mut [f64]) {
        for _ in 0..PROJECTIONS {
            self.clip(coefficients);
            self.back(coefficients, pose);
            let mut outside = false;
            for ((q, lower), upper) in pose.iter_mut().zip(&self.lower).zip(&self.upper) {
                let inside = q.clamp(*lower, *upper);
                outside |= inside != *q;
                *q = inside;
            }
            if !outside {
                return;
            }
            self.project(pose, coefficients);
        }
        self.clip(coefficients);
        self.back(coefficients, pose);
        let mut share: f64 = 1.0;
        for (joint, q) in pose.iter().enumerate() {
            let way = q - self.mean[joint];
            let room = if way > 0.0 {
                self.upper[joint] - self.mean[joint]
            } else {
                self.lower[joint] - self.mean[joint]
            };
            if way.abs() > room.abs() {
                share = share.min(room / way);
            }
        }
        for c in coefficients.iter_mut() {
            *c *= share;
        }
        self.back(coefficients, pose);
        for ((q, lower), upper) in pose.iter_mut().zip(&self.lower).zip(&self.upper) {
            *q = q.clamp(*lower, *upper);
        }
    }
}

/// Fails on the first joint of `pose` outside of its limits.
pub(super) fn check_limits(
    what: &str,
    pose: &[f64],
    lower: &[f64],
    upper: &[f64],
) -> Result<(), MappingError> {
    for (joint, ((q, lower), upper)) in pose.iter().zip(lower).zip(upper).enumerate() {
        if !(*q >= lower - 1e-6 && *q <= upper + 1e-6) {
            return Err(MappingError::OutsideLimits {
                what: what.into(),
                joint,
                value: *q,
                lower: *lower,
                upper: *upper,
            });
        }
    }
    Ok(())
}

/// Variance (times the number of frames) and direction of every principal axis, strongest first.
///
/// From the smaller of the two Gram matrices: a mesh has far more coordinates than frames.
fn principal_axes(centred: &DMatrix<f64>) -> Vec<(f64, Vec<f64>)> {
    let wide = centred.ncols() > centred.nrows();
    let gram = if wide {
        centred * centred.transpose()
    } else {
        centred.transpose() * centred
    };
    let eigen = SymmetricEigen::new(gram);
    let mut axes: Vec<(f64, Vec<f64>)> = eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.column_iter())
        .filter(|(value, _)| **value > 0.0)
        .map(|(value, vector)| {
            let mut axis = if wide {
                (centred.transpose() * vector).normalize()
            } else {
                vector.into_owned()
            };
            // The sign of an axis is arbitrary; its largest part is made positive.
            let largest =
                axis.iter().copied().fold(
                    0.0,
                    |m: f64, v| {
                        if v.abs() > m.abs() + 1e-12 { v } else { m }
                    },
                );
            if largest < 0.0 {
                axis.neg_mut();
            }
            (*value, axis.as_slice().to_vec())
        })
        .collect();
    axes.sort_by(|a, b| b.0.total_cmp(&a.0));
    axes
}
