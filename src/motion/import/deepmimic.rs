//! Skeletons of DeepMimic's motions, which the motion files do not hold.
//!
//! Offsets (m, y up, x forward) and joint types from `data/characters/humanoid3d.txt` and `dog3d.txt` of
//! `xbpeng/DeepMimic` (MIT licence): `AttachX`, `AttachY`, `AttachZ` of each joint.

use super::raw::RawJoint;
use nalgebra::{UnitQuaternion, Vector3};

/// How many numbers of a frame turn a joint: a quaternion (w, x, y, z), an angle about z, or nothing.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    Ball,
    Hinge,
    Fixed,
}

impl Turn {
    /// Numbers in a frame.
    pub fn numbers(self) -> usize {
        match self {
            Self::Ball => 4,
            Self::Hinge => 1,
            Self::Fixed => 0,
        }
    }
}

use Turn::{Ball, Fixed, Hinge};

/// Name, parent, offset in the parent's frame, type.
pub(super) type Row = (&'static str, usize, [f64; 3], Turn);

/// A human of 45 kg and 1.6 m.
pub(super) const HUMANOID: [Row; 15] = [
    ("root", 0, [0.0, 0.0, 0.0], Ball),
    ("chest", 0, [0.0, 0.236151, 0.0], Ball),
    ("neck", 1, [0.0, 0.223894, 0.0], Ball),
    ("right_hip", 0, [0.0, 0.0, 0.084887], Ball),
    ("right_knee", 3, [0.0, -0.421546, 0.0], Hinge),
    ("right_ankle", 4, [0.0, -0.40987, 0.0], Ball),
    ("right_shoulder", 1, [-0.02405, 0.2435, 0.18311], Ball),
    ("right_elbow", 6, [0.0, -0.274788, 0.0], Hinge),
    ("right_wrist", 7, [0.0, -0.258947, 0.0], Fixed),
    ("left_hip", 0, [0.0, 0.0, -0.084887], Ball),
    ("left_knee", 9, [0.0, -0.421546, 0.0], Hinge),
    ("left_ankle", 10, [0.0, -0.40987, 0.0], Ball),
    ("left_shoulder", 1, [-0.02405, 0.2435, -0.18311], Ball),
    ("left_elbow", 12, [0.0, -0.274788, 0.0], Hinge),
    ("left_wrist", 13, [0.0, -0.258947, 0.0], Fixed),
];

/// A large dog.
pub(super) const DOG: [Row; 23] = [
    ("root", 0, [0.0, 0.0, 0.0], Ball),
    ("spine0", 0, [0.0, 0.0, 0.0], Ball),
    ("spine1", 1, [0.2375, 0.0, 0.0], Ball),
    ("neck", 2, [0.28135, 0.0, 0.0], Ball),
    ("head", 3, [0.175, 0.0, 0.0], Ball),
    ("left_shoulder", 2, [0.304074, -0.109983, -0.106071], Ball),
    ("left_forearm", 5, [0.0, -0.19, 0.0], Hinge),
    ("left_hand", 6, [0.0, -0.2225, 0.0], Ball),
    ("left_finger", 7, [0.0, -0.09, 0.0], Ball),
    ("right_shoulder", 2, [0.304074, -0.109983, 0.106071], Ball),
    ("right_forearm", 9, [0.0, -0.19, 0.0], Hinge),
    ("right_hand", 10, [0.0, -0.2225, 0.0], Ball),
    ("right_finger", 11, [0.0, -0.09, 0.0], Ball),
    ("left_upper_leg", 0, [-0.074803, -0.095825, -0.05986], Ball),
    ("left_leg", 13, [0.0, -0.2, 0.0], Hinge),
    ("left_foot", 14, [0.0, -0.225, 0.0], Ball),
    ("left_toe", 15, [0.0, -0.135, 0.0], Ball),
    ("right_upper_leg", 0, [-0.074803, -0.095825, 0.05986], Ball),
    ("right_leg", 17, [0.0, -0.2, 0.0], Hinge),
    ("right_foot", 18, [0.0, -0.225, 0.0], Ball),
    ("right_toe", 19, [0.0, -0.135, 0.0], Ball),
    ("tail0", 0, [-0.086, 0.0, 0.0], Ball),
    ("tail1", 21, [-0.2, 0.0, 0.0], Ball),
];

/// Numbers of a frame: its duration, the root's place, then the rotations.
pub(super) fn width(rows: &[Row]) -> usize {
    1 + 3 + rows.iter().map(|r| r.3.numbers()).sum::<usize>()
}

/// The joints of a table.
pub(super) fn joints(rows: &[Row]) -> Vec<RawJoint> {
    let joint = |(i, (name, parent, offset, _)): (usize, &Row)| RawJoint {
        name: (*name).to_owned(),
        parent: (i > 0).then_some(*parent),
        offset: Vector3::from(*offset),
        rest: UnitQuaternion::identity(),
    };
    rows.iter().enumerate().map(joint).collect()
}
