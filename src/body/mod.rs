//! Pose spaces: all that the animator needs to know of a body.
//!
//! A pose is a flat slice of coordinates; what they mean is the body's business. [`JointSpace`] is a
//! robot; skeletons and meshes implement the same trait.

mod joint_space;

pub use joint_space::JointSpace;

/// How poses of a body are blended, compared and added. Slices have [`PoseSpace::len`] coordinates.
pub trait PoseSpace: Send {
    /// Coordinates of a pose.
    fn len(&self) -> usize;

    /// True for a body without coordinates.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Weighted mean of poses into `out`. `poses` holds one pose after the other, one per weight;
    /// weights are not negative and sum to one. Exact at the corners.
    fn blend(&self, poses: &[f64], weights: &[f64], out: &mut [f64]);

    /// The difference that leads from pose `a` to pose `b`, so that `add(a, diff(a, b), 1) = b`.
    fn diff(&self, a: &[f64], b: &[f64], out: &mut [f64]);

    /// Adds `scale` times a difference to `pose`.
    fn add(&self, pose: &mut [f64], difference: &[f64], scale: f64);

    /// Distance of two poses: root mean square over coordinates.
    fn distance(&self, a: &[f64], b: &[f64]) -> f64;
}
