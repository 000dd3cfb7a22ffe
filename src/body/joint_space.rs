//! The pose space of a robot: joint positions, and for a robot that walks its body over the ground.

use super::{Part, PoseSpace};
use crate::robot::RobotModel;
use crate::robot::model::JointKind;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};

/// Name of the part that holds the body's place over the ground.
pub const BODY: &str = "body";
/// Coordinates of that part: forward, left, height (m), roll, pitch, yaw (rad).
const BODY_COORDINATES: usize = 6;
/// A joint that moves next to nothing still counts, metres.
const LEAST_LEVER_M: f64 = 0.02;

/// Joint positions in radians (metres for prismatic joints); of a floating robot followed by the pose
/// of its root link in the travelling frame: forward, left, height (m), roll, pitch, yaw (rad).
///
/// Joints have limits and do not wrap, so the weighted mean of angles is the exact geodesic mean. The
/// body's angles are small and are blended the same way. The embedding is each coordinate times its
/// lever arm, so that distances are in metres and linear in the pose.
#[derive(Clone, Debug)]
pub struct JointSpace {
    parts: Vec<Part>,
    levers: Vec<f64>,
}

impl JointSpace {
    /// Joints of a body that is bolted down, all with a lever arm of one metre.
    pub fn fixed(joints: &[String]) -> Self {
        Self::with_levers(joints, vec![1.0; joints.len()], false)
    }

    /// Joints that carry a body over the ground, all with a lever arm of one metre.
    pub fn floating(joints: &[String]) -> Self {
        Self::with_levers(joints, vec![1.0; joints.len() + BODY_COORDINATES], true)
    }

    /// The joints of `model` with their lever arms: the farthest that anything hung on the joint is
    /// from its axis at joint position zero. `floating` adds the body.
    pub fn of_robot(model: &RobotModel, floating: bool) -> Self {
        let zero = vec![0.0; model.actuated.len()];
        let places: Vec<Point3<f64>> = (0..model.links.len())
            .map(|link| Point3::from(model.link_pose(link, &zero).translation.vector))
            .collect();
        let mut levers: Vec<f64> = (model.actuated.iter())
            .map(|j| {
                let joint = &model.joints[*j];
                if joint.kind == JointKind::Prismatic {
                    return 1.0;
                }
                let frame = model.link_pose(joint.child, &zero);
                let axis = frame.rotation * joint.axis.into_inner();
                let origin = Point3::from(frame.translation.vector);
                (0..model.links.len())
                    .filter(|link| hangs_on(model, *link, *j))
                    .map(|link| (places[link] - origin).cross(&axis).norm())
                    .fold(LEAST_LEVER_M, f64::max)
            })
            .collect();
        if floating {
            let size = places
                .iter()
                .map(|p| p.coords.norm())
                .fold(LEAST_LEVER_M, f64::max);
            levers.extend([1.0, 1.0, 1.0, size, size, size]);
        }
        Self::with_levers(&model.joint_names(), levers, floating)
    }

    fn with_levers(joints: &[String], levers: Vec<f64>, floating: bool) -> Self {
        let part = |name: &str, range: std::ops::Range<usize>| Part {
            name: name.into(),
            coordinates: range.clone(),
            tangent: range,
        };
        let n = joints.len();
        let mut parts: Vec<Part> = joints
            .iter()
            .enumerate()
            .map(|(i, name)| part(name, i..i + 1))
            .collect();
        if floating {
            parts.push(part(BODY, n..n + BODY_COORDINATES));
        }
        Self { parts, levers }
    }
}

fn hangs_on(model: &RobotModel, link: usize, joint: usize) -> bool {
    let mut at = link;
    while let Some(j) = model.parent_joint[at] {
        if j == joint {
            return true;
        }
        at = model.joints[j].parent;
    }
    false
}

/// The root link in the travelling frame, from the six coordinates of a floating body.
pub(super) fn body_pose(body: &[f64]) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::new(body[0], body[1], body[2]),
        UnitQuaternion::from_euler_angles(body[3], body[4], body[5]),
    )
}

impl PoseSpace for JointSpace {
    fn len(&self) -> usize {
        self.levers.len()
    }

    fn tangent_len(&self) -> usize {
        self.levers.len()
    }

    fn features(&self) -> usize {
        self.levers.len()
    }

    fn parts(&self) -> &[Part] {
        &self.parts
    }

    fn rest(&self, out: &mut [f64]) {
        out.fill(0.0);
    }

    fn blend(&self, poses: &[f64], weights: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (pose, weight) in poses.chunks_exact(self.len().max(1)).zip(weights) {
            if *weight == 0.0 {
                continue;
            }
            for (out, q) in out.iter_mut().zip(pose) {
                *out += weight * q;
            }
        }
    }

    fn diff(&self, a: &[f64], b: &[f64], out: &mut [f64]) {
        for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
            *out = b - a;
        }
    }

    fn add(&self, pose: &mut [f64], difference: &[f64], scale: f64) {
        for (q, d) in pose.iter_mut().zip(difference) {
            *q += scale * d;
        }
    }

    fn embed(&self, pose: &[f64], out: &mut [f64]) {
        for ((out, q), lever) in out.iter_mut().zip(pose).zip(&self.levers) {
            *out = lever * q;
        }
    }

    /// The longest lever arm of a joint.
    fn size_m(&self) -> f64 {
        let joints = self.parts.iter().filter(|p| p.coordinates.len() == 1);
        joints
            .map(|p| self.levers[p.coordinates.start])
            .fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lever_arms_are_in_metres_and_fall_towards_the_foot() {
        let urdf = include_str!("../../configs/robots/pup.urdf");
        let model = RobotModel::from_urdf(urdf).expect("shipped URDF");
        let space = JointSpace::of_robot(&model, true);
        assert_eq!(space.len(), 18);
        let [hip, thigh, knee] = [0, 1, 2].map(|j| space.levers[j]);
        assert!(
            thigh > knee && knee > 0.05 && hip > 0.1 && thigh < 0.3,
            "levers {hip:.3}, {thigh:.3}, {knee:.3} m"
        );
    }
}
