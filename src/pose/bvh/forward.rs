//! Forward kinematics of a BVH skeleton: from the numbers of a frame to the place of every joint.

use super::{BvhFile, BvhJoint, Channel};
use nalgebra::{UnitQuaternion, Vector3};

/// Frames in which it is looked whether a joint travels.
const FRAMES_LOOKED_AT: usize = 64;

/// Where a joint is and how it is turned, in the parent's frame or in the world's.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct JointPlace {
    /// Position in the file's unit.
    pub position: Vector3<f64>,
    /// Orientation.
    pub rotation: UnitQuaternion<f64>,
}

impl BvhJoint {
    /// The joint in its parent's frame, from the numbers of one frame of the file.
    ///
    /// Position channels replace the offset; rotations are multiplied in the order of the
    /// channels. Numbers that a too short frame lacks count as not given.
    pub fn local(&self, frame: &[f64]) -> JointPlace {
        let mut place = JointPlace {
            position: self.offset.into(),
            rotation: UnitQuaternion::identity(),
        };
        let values = frame.get(self.first_channel..).unwrap_or(&[]);
        for (channel, value) in self.channels.iter().zip(values) {
            match channel {
                Channel::Position(axis) => place.position[*axis] = *value,
                Channel::Rotation(axis) => {
                    let mut turn = Vector3::zeros();
                    turn[*axis] = value.to_radians();
                    place.rotation *= UnitQuaternion::from_scaled_axis(turn);
                }
            }
        }
        place
    }
}

impl BvhFile {
    /// Writes the place of every joint in the world at frame `index` to `places`, in the order of
    /// the joints; allocates nothing once `places` has room.
    pub fn places(&self, index: usize, places: &mut Vec<JointPlace>) {
        let frame = self.frame(index);
        places.clear();
        for joint in &self.joints {
            let local = joint.local(frame);
            // Parents come before their children, so the parent's place is there.
            let place = match joint.parent.and_then(|parent| places.get(parent)) {
                None => local,
                Some(parent) => JointPlace {
                    position: parent.position + parent.rotation * local.position,
                    rotation: parent.rotation * local.rotation,
                },
            };
            places.push(place);
        }
    }

    /// Longest way through the skeleton from tip to tip along its bones, in the file's unit.
    ///
    /// For a human it leads from a toe to a fingertip. Unlike the height of a pose it does not
    /// depend on what the performer does.
    pub fn longest_path(&self) -> f64 {
        let mut longest: f64 = 0.0;
        // Longest way down from each joint, as far as its children were seen.
        let mut reach = vec![0.0; self.joints.len()];
        for (index, joint) in self.joints.iter().enumerate().rev() {
            // Where a root stands is no bone.
            if let Some(parent) = joint.parent {
                let way: f64 = reach[index] + self.bone(joint);
                longest = longest.max(reach[parent] + way);
                reach[parent] = reach[parent].max(way);
            }
        }
        longest
    }

    /// Length of the bone from the parent to `joint`, in the file's unit; 0 where the joint travels.
    fn bone(&self, joint: &BvhJoint) -> f64 {
        if self.travels(joint) {
            return 0.0;
        }
        joint.local(self.frame(0)).position.norm()
    }

    /// Whether `joint` moves in its parent's frame, by over a hundredth of its distance from it.
    fn travels(&self, joint: &BvhJoint) -> bool {
        let first = joint.local(self.frame(0)).position;
        let step = self.frames().div_ceil(FRAMES_LOOKED_AT).max(1);
        (0..self.frames()).step_by(step).any(|index| {
            let there = joint.local(self.frame(index)).position;
            (there - first).norm() > 0.01 * first.norm()
        })
    }

    /// Whether joint `index` is the origin of the world and no part of the body: a root that stays
    /// where it is while a child, the hips, travels.
    pub fn is_origin(&self, index: usize) -> bool {
        let is_root = |joint: &BvhJoint| joint.parent.is_none() && !self.travels(joint);
        self.joints.get(index).is_some_and(is_root)
            && (self.joints.iter()).any(|child| child.parent == Some(index) && self.travels(child))
    }
}
