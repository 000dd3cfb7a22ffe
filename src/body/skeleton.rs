//! A skeleton: a tree of ball joints with bones of constant length, and its forward kinematics.
//!
//! Lengths in metres, x forward, y left, z up, whatever the file had; [`Skeleton::axes`] leads back.

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// One joint and the bone that leads to it from its parent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkeletonJoint {
    /// Name as in the file it comes from.
    pub name: String,
    /// Index of the parent, which comes before; `None` for the root.
    pub parent: Option<usize>,
    /// From the parent's joint, in the parent's frame, metres; zero for the root.
    pub offset_m: [f64; 3],
    /// Rotation at rest in the parent's frame: x, y, z, w.
    pub rest: [f64; 4],
}

/// Why joints form no skeleton.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum SkeletonError {
    /// No joint, or more joints than an index holds.
    #[error("a skeleton of {0} joints cannot be used; 1 to 1000 are allowed")]
    Count(usize),
    /// The order or the tree is wrong.
    #[error("joint {joint}: {problem}")]
    Joint {
        /// Joint name.
        joint: String,
        /// What was found and what is allowed.
        problem: String,
    },
}

/// A tree of joints, parents first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Skeleton {
    /// Joints; the first is the root.
    pub joints: Vec<SkeletonJoint>,
    /// Rotation that turned the file's axes into ours: x, y, z, w.
    pub axes: [f64; 4],
    /// Metres per unit of length of the file.
    pub unit_m: f64,
}

impl Skeleton {
    /// A checked skeleton: parents first, one root, finite numbers, unit quaternions, distinct names.
    pub fn new(
        joints: Vec<SkeletonJoint>,
        axes: UnitQuaternion<f64>,
        unit_m: f64,
    ) -> Result<Self, SkeletonError> {
        let skeleton = Self {
            joints,
            axes: axes.into_inner().coords.into(),
            unit_m,
        };
        skeleton.check()?;
        Ok(skeleton)
    }

    /// Checks what [`Skeleton::new`] promises, for one read from a file.
    pub fn check(&self) -> Result<(), SkeletonError> {
        if !(1..=1000).contains(&self.joints.len()) {
            return Err(SkeletonError::Count(self.joints.len()));
        }
        for (i, joint) in self.joints.iter().enumerate() {
            let bad = |problem: String| {
                Err(SkeletonError::Joint {
                    joint: joint.name.clone(),
                    problem,
                })
            };
            match joint.parent {
                None if i > 0 => {
                    return bad("has no parent; only the first joint may be the root".into());
                }
                Some(p) if p >= i => {
                    return bad(format!("its parent {p} must come before it ({i})"));
                }
                _ => {}
            }
            if joint.offset_m.iter().any(|v| !v.is_finite()) {
                return bad(format!("offset {:?} must be finite", joint.offset_m));
            }
            let norm = Quaternion::from(joint.rest).norm();
            if !((norm - 1.0).abs() < 1e-3) {
                return bad(format!("rest {:?} must be a unit quaternion", joint.rest));
            }
            if self.joints[..i].iter().any(|j| j.name == joint.name) {
                return bad("its name is used twice".into());
            }
        }
        Ok(())
    }

    /// Number of joints.
    pub fn len(&self) -> usize {
        self.joints.len()
    }

    /// Never true for a checked skeleton.
    pub fn is_empty(&self) -> bool {
        self.joints.is_empty()
    }

    /// Index of a joint by name.
    pub fn joint(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|j| j.name == name)
    }

    /// Coordinates of a pose: the root's place (3) and one quaternion (x, y, z, w) per joint.
    pub fn coordinates(&self) -> usize {
        3 + 4 * self.joints.len()
    }

    /// Rotation of joint `joint` in its parent's frame, of a pose.
    pub fn rotation(pose: &[f64], joint: usize) -> UnitQuaternion<f64> {
        let q = &pose[3 + 4 * joint..7 + 4 * joint];
        UnitQuaternion::new_unchecked(Quaternion::new(q[3], q[0], q[1], q[2]))
    }

    /// Sets the rotation of joint `joint` in a pose.
    pub fn set_rotation(pose: &mut [f64], joint: usize, rotation: &UnitQuaternion<f64>) {
        pose[3 + 4 * joint..7 + 4 * joint].copy_from_slice(rotation.as_ref().coords.as_slice());
    }

    /// Every joint's frame in the travelling frame, into `out` (one per joint). One pass, no allocation.
    pub fn frames(&self, pose: &[f64], out: &mut [Isometry3<f64>]) {
        for (i, joint) in self.joints.iter().enumerate() {
            let rotation = Self::rotation(pose, i);
            out[i] = match joint.parent {
                None => {
                    Isometry3::from_parts(Translation3::new(pose[0], pose[1], pose[2]), rotation)
                }
                Some(p) => {
                    let above = &out[p];
                    Isometry3::from_parts(
                        Translation3::from(
                            above.translation.vector
                                + above.rotation * Vector3::from(joint.offset_m),
                        ),
                        above.rotation * rotation,
                    )
                }
            };
        }
    }

    /// Frame of one joint in the travelling frame: walks to the root, no allocation.
    pub fn frame(&self, pose: &[f64], joint: usize) -> Isometry3<f64> {
        let mut at = joint;
        let mut frame = Isometry3::identity();
        loop {
            let j = &self.joints[at];
            let local = |t: Vector3<f64>| {
                Isometry3::from_parts(Translation3::from(t), Self::rotation(pose, at))
            };
            match j.parent {
                Some(p) => {
                    frame = local(Vector3::from(j.offset_m)) * frame;
                    at = p;
                }
                None => return local(Vector3::new(pose[0], pose[1], pose[2])) * frame,
            }
        }
    }

    /// The place of one joint in the travelling frame, metres.
    pub fn position(&self, pose: &[f64], joint: usize) -> Point3<f64> {
        Point3::from(self.frame(pose, joint).translation.vector)
    }

    /// The pose at rest, with the root at `root_m`.
    pub fn rest_pose(&self, root_m: [f64; 3]) -> Vec<f64> {
        let mut pose = root_m.to_vec();
        for joint in &self.joints {
            pose.extend(joint.rest);
        }
        pose
    }
}
