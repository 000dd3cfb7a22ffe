//! A motion in the axes and unit of its file, and how it becomes a take.

use super::axes::Axes;
use super::error::ImportFault;
use crate::body::{RootPose, Skeleton, SkeletonJoint};
use crate::motion::take::{Take, TakeBody};
use nalgebra::{UnitQuaternion, Vector3};
use std::sync::Arc;

/// A joint as the file has it.
#[derive(Clone, Debug)]
pub(super) struct RawJoint {
    pub name: String,
    /// Comes before; `None` for the root alone.
    pub parent: Option<usize>,
    /// In the parent's frame, file units.
    pub offset: Vector3<f64>,
    /// Rotation at rest in the parent's frame; of the root in the world.
    pub rest: UnitQuaternion<f64>,
}

/// One frame: the root's place in the world (file axes and units), each joint's rotation in its
/// parent's frame, the root's in the world.
#[derive(Clone, Debug)]
pub(super) struct RawFrame {
    pub place: Vector3<f64>,
    pub rotations: Vec<UnitQuaternion<f64>>,
}

/// A motion as the file has it.
#[derive(Clone, Debug)]
pub(super) struct Raw {
    pub name: String,
    pub joints: Vec<RawJoint>,
    pub dt_s: f64,
    pub frames: Vec<RawFrame>,
    pub wraps: bool,
}

impl Raw {
    /// Places of the joints at rest, from the root, file axes and units.
    pub fn rest_places(&self) -> Vec<Vector3<f64>> {
        let mut places: Vec<(Vector3<f64>, UnitQuaternion<f64>)> = Vec::new();
        for joint in &self.joints {
            let place = match joint.parent.and_then(|p| places.get(p)) {
                None => (Vector3::zeros(), joint.rest),
                Some((place, rotation)) => (place + rotation * joint.offset, rotation * joint.rest),
            };
            places.push(place);
        }
        places.into_iter().map(|(place, _)| place).collect()
    }

    /// The skeleton in our axes. Only the root's frame turns: the others keep their own axes.
    pub fn skeleton(&self, axes: Axes, unit_m: f64) -> Result<Skeleton, ImportFault> {
        let turn = axes.rotation();
        let joints = self.joints.iter().enumerate();
        let joints = joints.map(|(i, joint)| {
            let (offset, rest) = if i == 0 {
                (Vector3::zeros(), turn * joint.rest)
            } else {
                (joint.offset * unit_m, joint.rest)
            };
            SkeletonJoint {
                name: joint.name.clone(),
                parent: joint.parent,
                offset_m: offset.into(),
                rest: rest.into_inner().coords.into(),
            }
        });
        Ok(Skeleton::new(joints.collect(), turn, unit_m)?)
    }

    /// The take on `skeleton`, which [`Raw::skeleton`] made.
    ///
    /// The heading is how far the root is turned about the vertical from rest, with the least of other
    /// turning (the twist of swing and twist); places keep the origin of the file.
    pub fn take(&self, skeleton: &Arc<Skeleton>, axes: Axes, origin: &str) -> Take {
        self.scaled_take(skeleton, axes, skeleton.unit_m, origin)
    }

    /// [`Raw::take`] of what is in metres already, whatever unit the skeleton's own file had.
    pub fn take_in_metres(&self, skeleton: &Arc<Skeleton>, axes: Axes, origin: &str) -> Take {
        self.scaled_take(skeleton, axes, 1.0, origin)
    }

    fn scaled_take(&self, skeleton: &Arc<Skeleton>, axes: Axes, unit_m: f64, origin: &str) -> Take {
        let turn = axes.rotation();
        let from_rest = Skeleton::rotation(&skeleton.rest_pose([0.0; 3]), 0).inverse();
        let mut poses: Vec<Vec<f64>> = Vec::with_capacity(self.frames.len());
        let mut roots: Vec<RootPose> = Vec::with_capacity(self.frames.len());
        for frame in &self.frames {
            let place = turn * frame.place * unit_m;
            let root = frame.rotations.first().copied().unwrap_or_default();
            let root = turn * root;
            let yaw_rad = unwrapped(twist_z(&(root * from_rest)), roots.last());
            roots.push(RootPose {
                x_m: place.x,
                y_m: place.y,
                yaw_rad,
            });
            let mut pose = vec![0.0, 0.0, place.z];
            for (i, rotation) in frame.rotations.iter().enumerate() {
                let rotation = if i == 0 {
                    UnitQuaternion::from_scaled_axis(Vector3::z() * -yaw_rad) * root
                } else {
                    *rotation
                };
                pose.extend(rotation.as_ref().coords.iter());
            }
            if let Some(last) = poses.last() {
                same_hemisphere(last, &mut pose);
            }
            poses.push(pose);
        }
        Take {
            name: self.name.clone(),
            origin: origin.into(),
            dt_s: self.dt_s,
            body: TakeBody::Skeleton(Arc::clone(skeleton)),
            poses,
            roots,
            wraps: self.wraps,
        }
    }

    /// Whether the last frame is the first one again: every rotation within 0.5 degrees.
    pub fn ends_where_it_began(&self) -> bool {
        let (Some(first), Some(last)) = (self.frames.first(), self.frames.last()) else {
            return false;
        };
        let pairs = first.rotations.iter().zip(&last.rotations);
        self.frames.len() > 2
            && pairs
                .map(|(a, b)| a.angle_to(b))
                .all(|a| a < 0.5_f64.to_radians())
    }
}

/// Turn about the vertical, rad, that leaves the least to be turned about a level axis.
pub(super) fn twist_z(q: &UnitQuaternion<f64>) -> f64 {
    let angle = 2.0 * q.k.atan2(q.w);
    if angle.is_finite() { angle } else { 0.0 }
}

/// `angle` plus the full turns that bring it next to the heading of `last`.
pub(super) fn unwrapped(angle: f64, last: Option<&RootPose>) -> f64 {
    let turn = std::f64::consts::TAU;
    let near = last.map_or(0.0, |r| r.yaw_rad);
    angle + turn * ((near - angle) / turn).round()
}

/// Chooses the signs of quaternions so that they lie next to those of `last`.
pub(super) fn same_hemisphere(last: &[f64], pose: &mut [f64]) {
    let joints = pose[3..].chunks_exact_mut(4);
    for (q, before) in joints.zip(last[3..].chunks_exact(4)) {
        let dot: f64 = q.iter().zip(before).map(|(a, b)| a * b).sum();
        if dot < 0.0 {
            q.iter_mut().for_each(|v| *v = -*v);
        }
    }
}
