//! Non-linear blending: the mean of rotations is a rotation in their middle, and ends of limbs are where
//! the mean of their places is.

use crate::body::{Feet, PoseSpace};
use nalgebra::{Point3, Quaternion, UnitQuaternion, Vector3};
use std::sync::Arc;

/// Rounds of the mean at most, and the step that ends it, rad.
const ROUNDS: usize = 10;
const TOLERANCE_RAD: f64 = 1e-9;
/// Cosine of half of 175 degrees: rotations farther apart than that have no clear way between them.
const OPPOSITE: f64 = 0.0436;

/// The mean of poses on the rotations themselves (Karcher mean; eq. 3.3 and 3.4 for two poses).
///
/// Parts of four coordinates are unit quaternions (x, y, z, w), all others are blended linearly. The mean of
/// rotations minimises the weighted sum of squared angles; it does not depend on the order of the poses and for
/// two poses is `slerp`. At most ten rounds to 1e-9 rad. They start from the normalised sum in the
/// hemisphere of the medoid (the rotation nearest to all others), which is nearer to the goal than the medoid.
#[derive(Clone, Default)]
pub struct NonLinear {
    ends: Option<Arc<dyn Feet>>,
    ambiguous: usize,
    end_error_m: f64,
}

impl std::fmt::Debug for NonLinear {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let ends = self.ends.as_ref().map_or(0, |e| e.count());
        f.debug_struct("NonLinear")
            .field("ends", &ends)
            .finish_non_exhaustive()
    }
}

impl NonLinear {
    /// Means of rotations alone.
    pub fn new() -> Self {
        Self::default()
    }

    /// Also puts every end of `ends` where the weighted mean of its places in the poses is.
    ///
    /// For a robot, whose angles are blended exactly already, this is all that non-linear blending does.
    #[must_use]
    pub fn with_ends(mut self, ends: Arc<dyn Feet>) -> Self {
        self.ends = Some(ends);
        self
    }

    /// The ends that are put to their places.
    pub fn ends(&self) -> Option<&Arc<dyn Feet>> {
        self.ends.as_ref()
    }

    /// Joints of the last blend with two poses more than 175 degrees apart: which way round they turn was
    /// a matter of rounding.
    pub fn ambiguous(&self) -> usize {
        self.ambiguous
    }

    /// How far the worst end stayed from its place in the last blend, metres.
    pub fn end_error_m(&self) -> f64 {
        self.end_error_m
    }

    /// Weighted mean of `poses` into `out`: see [`PoseSpace::blend`]. Allocates nothing.
    pub fn blend(
        &mut self,
        space: &dyn PoseSpace,
        poses: &[f64],
        weights: &[f64],
        out: &mut [f64],
    ) {
        self.ambiguous = 0;
        self.end_error_m = 0.0;
        let len = space.len();
        if let Some(corner) = weights.iter().position(|w| *w == 1.0) {
            out.copy_from_slice(&poses[corner * len..(corner + 1) * len]);
            return;
        }
        space.blend(poses, weights, out);
        for part in space.parts() {
            let at = part.coordinates.start;
            if part.coordinates.len() == 4 {
                let rotation = |i: usize| read(&poses[i * len + at..]);
                let (mean, ambiguous) = mean(rotation, weights);
                self.ambiguous += usize::from(ambiguous);
                out[at..at + 4].copy_from_slice(mean.coords.as_slice());
            }
        }
        if let Some(ends) = &self.ends {
            for end in 0..ends.count() {
                let mut goal = Point3::origin();
                for (pose, weight) in poses.chunks_exact(len).zip(weights) {
                    if *weight > 0.0 {
                        goal += ends.position(pose, end).coords * *weight;
                    }
                }
                self.end_error_m = self.end_error_m.max(ends.place(out, end, goal));
            }
        }
    }
}

/// Two poses that a joint has no clear way between.
#[derive(Clone, Debug, PartialEq)]
pub struct Antipodal {
    /// Joint name.
    pub joint: String,
    /// Index of one pose.
    pub first: usize,
    /// Index of the other.
    pub second: usize,
    /// How far apart they are, rad, up to pi.
    pub angle_rad: f64,
}

/// Joints whose rotations in two of `poses` (one after the other) are more than 175 degrees apart. A class
/// of such poses blends through an arbitrary side: to be told when it is built. Allocates.
pub fn antipodal(space: &dyn PoseSpace, poses: &[f64]) -> Vec<Antipodal> {
    let len = space.len().max(1);
    let mut found = Vec::new();
    for part in space.parts().iter().filter(|p| p.coordinates.len() == 4) {
        let rotation = |i: usize| read(&poses[i * len + part.coordinates.start..]);
        for second in 0..poses.len() / len {
            for first in 0..second {
                let dot = rotation(first).coords.dot(&rotation(second).coords).abs();
                if dot < OPPOSITE {
                    found.push(Antipodal {
                        joint: part.name.clone(),
                        first,
                        second,
                        angle_rad: 2.0 * dot.min(1.0).acos(),
                    });
                }
            }
        }
    }
    found
}

fn read(q: &[f64]) -> Quaternion<f64> {
    Quaternion::new(q[3], q[0], q[1], q[2])
}

/// Mean of unit quaternions, and whether two of them are opposite.
fn mean(rotation: impl Fn(usize) -> Quaternion<f64>, weights: &[f64]) -> (Quaternion<f64>, bool) {
    let used = || weights.iter().enumerate().filter(|(_, w)| **w > 0.0);
    let mut ambiguous = false;
    let mut medoid = (f64::INFINITY, 0);
    for (i, _) in used() {
        let q = rotation(i);
        let mut spread = 0.0;
        for (j, weight) in used() {
            let dot = q.coords.dot(&rotation(j).coords).abs();
            ambiguous |= dot < OPPOSITE;
            // Squared sine of half the angle: as good as the angle to find the nearest.
            spread += weight * (1.0 - dot * dot);
        }
        if spread < medoid.0 {
            medoid = (spread, i);
        }
    }
    let centre = rotation(medoid.1);
    let mut sum = Quaternion::new(0.0, 0.0, 0.0, 0.0);
    for (i, weight) in used() {
        let q = rotation(i);
        let sign = if q.coords.dot(&centre.coords) < 0.0 {
            -1.0
        } else {
            1.0
        };
        sum.coords += q.coords * (sign * weight);
    }
    let norm = sum.norm();
    let mut mean = if norm > 1e-6 { sum / norm } else { centre };
    for _ in 0..ROUNDS {
        let mut step = Vector3::zeros();
        let back = mean.conjugate();
        for (i, weight) in used() {
            step += log(back * rotation(i)) * *weight;
        }
        if step.norm() < TOLERANCE_RAD {
            break;
        }
        let turned = mean * UnitQuaternion::from_scaled_axis(step).into_inner();
        mean = turned / turned.norm();
    }
    (mean, ambiguous)
}

/// Rotation vector of a unit quaternion or its negative, the short way round.
fn log(q: Quaternion<f64>) -> Vector3<f64> {
    let (v, w) = if q.w < 0.0 {
        (-q.imag(), -q.w)
    } else {
        (q.imag(), q.w)
    };
    let sine = v.norm();
    if sine < 1e-8 {
        return v * 2.0;
    }
    v * (2.0 * sine.atan2(w) / sine)
}
