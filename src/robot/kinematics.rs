//! Forward kinematics: where a link is for given joint positions.

use super::model::{JointKind, RobotModel};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};

impl RobotModel {
    /// Pose of `link` in the root link's frame.
    ///
    /// `positions`: one entry per moving joint, in model order. Walks from the link to the root:
    /// cost proportional to the depth, no allocation.
    pub fn link_pose(&self, link: usize, positions: &[f64]) -> Isometry3<f64> {
        let mut pose = Isometry3::identity();
        let mut at = link;
        while let Some(j) = self.parent_joint[at] {
            pose = self.joint_transform(j, positions) * pose;
            at = self.joints[j].parent;
        }
        pose
    }

    /// Pose of the child link of joint `j` in its parent link's frame.
    pub fn joint_transform(&self, j: usize, positions: &[f64]) -> Isometry3<f64> {
        let joint = &self.joints[j];
        let (driver, multiplier, offset) = self.driver(j);
        let position = self
            .actuated_index(driver)
            .and_then(|i| positions.get(i))
            .map_or(0.0, |q| multiplier * q + offset);
        let motion = match joint.kind {
            JointKind::Fixed => Isometry3::identity(),
            JointKind::Revolute => Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_axis_angle(&joint.axis, position),
            ),
            JointKind::Prismatic => Isometry3::from_parts(
                Translation3::from(joint.axis.into_inner() * position),
                UnitQuaternion::identity(),
            ),
        };
        joint.origin * motion
    }
}
