//! Pose spaces: all that the animator needs to know of a body.
//!
//! A pose is a flat slice of coordinates; what they mean is the body's business. [`JointSpace`] is a
//! robot, [`SkeletonSpace`] an avatar. Poses are free of the root's place and heading on the ground
//! ([`RootPose`]), which are kept beside them: what is compared and blended does not depend on where
//! the body went.

pub mod blend;
mod feet;
mod joint_space;
mod robot_ends;
mod robot_feet;
mod root;
mod side;
mod skeleton;
mod skeleton_ends;
mod skeleton_feet;
mod skeleton_space;
mod skin;

pub use blend::Blending;
pub use feet::Feet;
pub use joint_space::{BODY, JointSpace};
pub use robot_ends::RobotEnds;
pub use robot_feet::RobotFeet;
pub use root::{RootAdvance, RootPose};
pub use side::{Side, mirrored, other_side};
pub use skeleton::{Skeleton, SkeletonError, SkeletonJoint};
pub use skeleton_ends::SkeletonEnds;
pub use skeleton_feet::{SkeletonFeet, SkeletonFeetError, SkeletonLeg};
pub use skeleton_space::SkeletonSpace;
pub use skin::{Influence, SkinBone, SkinError, SkinnedMesh};

use std::ops::Range;

/// A named part of a pose: a joint, or the body's own place over the ground.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Joint name as in the robot's or skeleton's file.
    pub name: String,
    /// Its coordinates in a pose.
    pub coordinates: Range<usize>,
    /// Its coordinates in a difference.
    pub tangent: Range<usize>,
}

/// How poses of a body are blended, compared and added.
///
/// Poses have [`PoseSpace::len`] coordinates, differences [`PoseSpace::tangent_len`], embeddings
/// [`PoseSpace::features`]; slices of other lengths are a caller's error. No method but
/// [`PoseSpace::distance`] allocates. Casas 2013 and section 3 of the parametric motion graph: `blend`
/// is exact at the corners and independent of order; `add(a, diff(a, b), 1) = b`; the distance of
/// poses is that of their embeddings, in metres.
pub trait PoseSpace: Send + Sync {
    /// Coordinates of a pose.
    fn len(&self) -> usize;

    /// True for a body without coordinates.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Coordinates of a difference of two poses.
    fn tangent_len(&self) -> usize;

    /// Numbers of an embedding.
    fn features(&self) -> usize;

    /// The parts of a pose, in the order of their coordinates.
    fn parts(&self) -> &[Part];

    /// The pose at rest: all joints as the body's file has them.
    fn rest(&self, out: &mut [f64]);

    /// Weighted mean of poses into `out`. `poses` holds one pose after the other, one per weight;
    /// weights are not negative and sum to one; a pose of weight zero is not looked at.
    fn blend(&self, poses: &[f64], weights: &[f64], out: &mut [f64]);

    /// The difference that leads from pose `a` to pose `b`.
    fn diff(&self, a: &[f64], b: &[f64], out: &mut [f64]);

    /// Adds `scale` times a difference to `pose`.
    fn add(&self, pose: &mut [f64], difference: &[f64], scale: f64);

    /// Adds `scale` times the way from pose `from` to pose `to` to `pose`: [`PoseSpace::diff`] and
    /// [`PoseSpace::add`] in one. `difference` is room for a difference.
    fn add_way(
        &self,
        pose: &mut [f64],
        from: &[f64],
        to: &[f64],
        scale: f64,
        difference: &mut [f64],
    ) {
        self.diff(from, to, difference);
        self.add(pose, difference, scale);
    }

    /// Euclidean features of a pose in the travelling frame, metres.
    fn embed(&self, pose: &[f64], out: &mut [f64]);

    /// Points, joints or lever arms that a distance of embeddings is the mean over.
    fn points(&self) -> usize {
        self.features()
    }

    /// A length of the body that makes a turn of its root a length, metres.
    fn size_m(&self) -> f64;

    /// Root mean square distance of two poses' embeddings, metres. Allocates: for offline use.
    fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let mut embedded = vec![0.0; 2 * self.features()];
        let (x, y) = embedded.split_at_mut(self.features());
        self.embed(a, x);
        self.embed(b, y);
        let sum: f64 = x.iter().zip(y).map(|(a, b)| (a - *b).powi(2)).sum();
        (sum / self.features().max(1) as f64).sqrt()
    }
}

#[cfg(test)]
mod conformance;
