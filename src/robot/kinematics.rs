//! Forward kinematics: where a link is for given joint positions.

use super::model::{Joint, JointKind, RobotModel};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};

/// A joint in the order of kinematics.
#[derive(Copy, Clone, Debug)]
pub(super) struct OrderedJoint {
    /// Index of the joint.
    joint: usize,
    /// Its place among those that move; beyond them for a fixed one.
    position: usize,
}

/// All joints, those nearer the root first. The joints form one tree.
pub(super) fn outwards(
    joints: &[Joint],
    parent_joint: &[Option<usize>],
    actuated: &[usize],
) -> Vec<OrderedJoint> {
    let depth = |joint: usize| {
        let mut above = 0;
        let mut at = joints[joint].parent;
        while let Some(j) = parent_joint[at] {
            above += 1;
            at = joints[j].parent;
        }
        above
    };
    let position = |joint: usize| actuated.iter().position(|j| *j == joint);
    let mut order: Vec<OrderedJoint> = (0..joints.len())
        .map(|joint| OrderedJoint {
            joint,
            position: position(joint).unwrap_or(usize::MAX),
        })
        .collect();
    order.sort_by_key(|o| (depth(o.joint), o.joint));
    order
}

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

    /// Poses of all links in the root link's frame, into `out` (one per link), in one pass.
    ///
    /// `positions`: one entry per moving joint, in model order. No allocation.
    pub fn link_poses(&self, positions: &[f64], out: &mut [Isometry3<f64>]) {
        out[self.root] = Isometry3::identity();
        // Joints in this order: every parent link is placed before what hangs on it.
        for step in &self.order {
            let joint = &self.joints[step.joint];
            let above = out[joint.parent] * joint.origin;
            let position = || positions.get(step.position).copied().unwrap_or(0.0);
            out[joint.child] = match joint.kind {
                JointKind::Fixed => above,
                JointKind::Revolute => {
                    let turn = UnitQuaternion::from_axis_angle(&joint.axis, position());
                    Isometry3::from_parts(above.translation, above.rotation * turn)
                }
                JointKind::Prismatic => {
                    let way = above.rotation * (joint.axis.into_inner() * position());
                    Isometry3::from_parts((above.translation.vector + way).into(), above.rotation)
                }
            };
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::SplitMix;

    #[test]
    fn all_links_in_one_pass_are_where_each_is_by_itself() {
        for urdf in [
            include_str!("../../configs/robots/pup.urdf"),
            include_str!("../../configs/robots/open_manipulator_x.urdf"),
        ] {
            let model = RobotModel::from_urdf(urdf).expect("shipped URDF");
            let mut random = SplitMix::new(2);
            let mut poses = vec![Isometry3::identity(); model.links.len()];
            for _ in 0..20 {
                let q: Vec<f64> = model
                    .actuated
                    .iter()
                    .map(|_| 2.0 * random.unit() - 1.0)
                    .collect();
                model.link_poses(&q, &mut poses);
                for (link, pose) in poses.iter().enumerate() {
                    let alone = model.link_pose(link, &q);
                    let off = (pose.translation.vector - alone.translation.vector).norm()
                        + pose.rotation.angle_to(&alone.rotation);
                    assert!(
                        off < 1e-7,
                        "{} {}: {off} off",
                        model.name,
                        model.links[link]
                    );
                }
            }
        }
    }
}
