//! Inverse kinematics of any chain: joints from the root to a link, moved until the link is at a goal.

use super::model::{JointKind, RobotModel};
use crate::base::suggest::nearest;
use nalgebra::{Isometry3, Matrix6, Point3, UnitQuaternion, Vector3, Vector6};

/// Most joints of a chain: the solver keeps their columns on the stack.
pub const MOST_JOINTS: usize = 32;

/// Where the end of a chain is wanted, in the root link's frame.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Goal {
    /// Place of the end link's origin, metres.
    pub position: Point3<f64>,
    /// Its rotation, where that matters, and the length in metres at which a radian of it counts.
    pub rotation: Option<(UnitQuaternion<f64>, f64)>,
}

impl Goal {
    /// A place, whatever the rotation.
    pub fn at(position: Point3<f64>) -> Self {
        Self {
            position,
            rotation: None,
        }
    }
}

/// Why a chain cannot be solved.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum IkError {
    /// The robot has no such link.
    #[error("link {link} is not in robot {robot}{hint}")]
    UnknownLink {
        /// As asked for.
        link: String,
        /// Robot name.
        robot: String,
        /// A near name, if there is one.
        hint: String,
    },
    /// Nothing moves the link, or too much.
    #[error("link {link} hangs on {found} moving joints; 1 to {MOST_JOINTS} are allowed")]
    Joints {
        /// Link name.
        link: String,
        /// Moving joints above it.
        found: usize,
    },
}

/// The moving joints that carry an end link.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChainIk {
    end: usize,
    /// From the end to the root: joint of the model, index in the joint vector.
    joints: Vec<(usize, usize)>,
}

/// Largest step of a joint in one round, rad or m.
const LARGEST_STEP: f64 = 0.5;
/// Closer than this counts as there, metres.
const TOLERANCE_M: f64 = 1e-9;
/// Rounds at most.
const ROUNDS: usize = 100;

impl ChainIk {
    /// The chain from the root of `model` to the link called `link`.
    pub fn to_link(model: &RobotModel, link: &str) -> Result<Self, IkError> {
        let end = model.link(link).ok_or_else(|| IkError::UnknownLink {
            link: link.into(),
            robot: model.name.clone(),
            hint: nearest(link, model.links.iter().map(String::as_str))
                .map(|n| format!("; did you mean {n}?"))
                .unwrap_or_default(),
        })?;
        let mut joints = Vec::new();
        let mut at = end;
        while let Some(j) = model.parent_joint[at] {
            if let Some(index) = model.actuated_index(j) {
                joints.push((j, index));
            }
            at = model.joints[j].parent;
        }
        if joints.is_empty() || joints.len() > MOST_JOINTS {
            return Err(IkError::Joints {
                link: link.into(),
                found: joints.len(),
            });
        }
        Ok(Self { end, joints })
    }

    /// The end link.
    pub fn end(&self) -> usize {
        self.end
    }

    /// Indices in the joint vector, from the end to the root.
    pub fn joints(&self) -> impl Iterator<Item = usize> {
        self.joints.iter().map(|(_, index)| *index)
    }

    /// Pose of the end link in the root link's frame.
    pub fn end_pose(&self, model: &RobotModel, positions: &[f64]) -> Isometry3<f64> {
        model.link_pose(self.end, positions)
    }

    /// Moves the chain's joints in `positions` towards `goal`; returns the distance left, metres
    /// (a rotation counts by its length).
    ///
    /// Damped least squares from the given positions: of all ways there it takes the shortest in joint
    /// space, so a small correction stays small. Joints at a limit are left out while they push against it.
    /// The same input gives the same output; at most 100 rounds; allocates nothing.
    pub fn solve(&self, model: &RobotModel, goal: &Goal, positions: &mut [f64]) -> f64 {
        let mut damping = 1e-8;
        let mut left = error(goal, &self.end_pose(model, positions));
        for _ in 0..ROUNDS {
            if left.norm() < TOLERANCE_M {
                break;
            }
            let mut before = [0.0; MOST_JOINTS];
            for (before, (_, index)) in before.iter_mut().zip(&self.joints) {
                *before = positions[*index];
            }
            self.step(model, goal, &left, damping, positions);
            let now = error(goal, &self.end_pose(model, positions));
            if now.norm() < left.norm() {
                damping = (damping * 0.2).max(1e-10);
                left = now;
            } else {
                for (before, (_, index)) in before.iter().zip(&self.joints) {
                    positions[*index] = *before;
                }
                damping *= 10.0;
                if damping > 1e3 {
                    break;
                }
            }
        }
        left.norm()
    }

    /// One step: `q += J^T (J J^T + damping)^-1 left`, joints that would leave their limits taken out.
    fn step(
        &self,
        model: &RobotModel,
        goal: &Goal,
        left: &Vector6<f64>,
        damping: f64,
        positions: &mut [f64],
    ) {
        let mut columns = [Vector6::zeros(); MOST_JOINTS];
        self.columns(model, goal, positions, &mut columns);
        let mut locked = 0_u32;
        // Each round locks at least one joint more, so it ends.
        for _ in 0..=self.joints.len() {
            let free = |k: usize| locked >> k & 1 == 0;
            let mut normal = Matrix6::identity() * damping;
            for (k, column) in columns[..self.joints.len()].iter().enumerate() {
                if free(k) {
                    normal += column * column.transpose();
                }
            }
            let Some(factor) = normal.cholesky() else {
                return;
            };
            let y = factor.solve(left);
            let mut more = 0_u32;
            for (k, (joint, index)) in self.joints.iter().enumerate() {
                let (lower, upper) = limits(model, *joint);
                let step = columns[k].dot(&y);
                let at = positions[*index];
                if free(k) && ((step > 0.0 && at >= upper) || (step < 0.0 && at <= lower)) {
                    more |= 1 << k;
                }
            }
            if more == 0 {
                for (k, (joint, index)) in self.joints.iter().enumerate() {
                    if free(k) {
                        let (lower, upper) = limits(model, *joint);
                        let step = columns[k].dot(&y).clamp(-LARGEST_STEP, LARGEST_STEP);
                        positions[*index] = (positions[*index] + step).clamp(lower, upper);
                    }
                }
                return;
            }
            locked |= more;
        }
    }

    /// How the end moves per unit of each joint: metres, and metres of rotation.
    fn columns(
        &self,
        model: &RobotModel,
        goal: &Goal,
        positions: &[f64],
        out: &mut [Vector6<f64>; MOST_JOINTS],
    ) {
        let end = self.end_pose(model, positions);
        let length = goal.rotation.map_or(0.0, |(_, length)| length);
        // From the end towards the root: the end's pose in the frame of each link on the way.
        let mut within = Isometry3::identity();
        let mut at = self.end;
        let mut k = 0;
        while let Some(j) = model.parent_joint[at] {
            let joint = &model.joints[j];
            if joint.kind != JointKind::Fixed {
                let axis: Vector3<f64> = joint.axis.into_inner();
                let (moves, turns) = match joint.kind {
                    JointKind::Prismatic => (axis, Vector3::zeros()),
                    _ => (axis.cross(&within.translation.vector), axis),
                };
                // The child's rotation in the root frame, by way of the end's.
                let out_of =
                    |v: Vector3<f64>| end.rotation * within.rotation.inverse_transform_vector(&v);
                let (moves, turns) = (out_of(moves), out_of(turns) * length);
                out[k] = Vector6::new(moves.x, moves.y, moves.z, turns.x, turns.y, turns.z);
                k += 1;
            }
            within = model.joint_transform(j, positions) * within;
            at = joint.parent;
        }
    }
}

fn limits(model: &RobotModel, joint: usize) -> (f64, f64) {
    let limits = model.joints[joint].limits;
    limits.map_or((f64::NEG_INFINITY, f64::INFINITY), |l| (l.lower, l.upper))
}

fn error(goal: &Goal, end: &Isometry3<f64>) -> Vector6<f64> {
    let way = goal.position.coords - end.translation.vector;
    let turn = goal.rotation.map_or(Vector3::zeros(), |(wanted, length)| {
        (wanted * end.rotation.inverse()).scaled_axis() * length
    });
    Vector6::new(way.x, way.y, way.z, turn.x, turn.y, turn.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::SplitMix;

    fn arm() -> RobotModel {
        let urdf = include_str!("../../configs/robots/open_manipulator_x.urdf");
        RobotModel::from_urdf(urdf).expect("shipped URDF")
    }

    #[test]
    fn strange_links_are_named() {
        let message = ChainIk::to_link(&arm(), "link55")
            .expect_err("no such link")
            .to_string();
        assert!(
            message.contains("link55") && message.contains("did you mean"),
            "{message}"
        );
        let root = arm().links[arm().root].clone();
        assert!(matches!(
            ChainIk::to_link(&arm(), &root),
            Err(IkError::Joints { found: 0, .. })
        ));
    }

    #[test]
    fn the_gripper_of_an_arm_reaches_what_it_can_and_stays_inside_its_limits() {
        let model = arm();
        let chain = ChainIk::to_link(&model, "end_effector_link").expect("an arm");
        let limits = model.limits();
        let mut random = SplitMix::new(5);
        let middle: Vec<f64> = limits
            .iter()
            .map(|l| 0.5 * (l.lower.max(-1.5) + l.upper.min(1.5)))
            .collect();
        let mut worst = 0.0_f64;
        for trial in 0..300 {
            let mut there = middle.clone();
            for ((q, l), m) in there.iter_mut().zip(&limits).zip(&middle) {
                *q = (m + 0.6 * (2.0 * random.unit() - 1.0)).clamp(l.lower, l.upper);
            }
            let goal = Goal::at(Point3::from(
                chain.end_pose(&model, &there).translation.vector,
            ));
            let mut q = middle.clone();
            let left = chain.solve(&model, &goal, &mut q);
            worst = worst.max(left);
            let mut again = middle.clone();
            chain.solve(&model, &goal, &mut again);
            assert_eq!(q, again, "trial {trial}: not deterministic");
            for (q, l) in q.iter().zip(&limits) {
                assert!(
                    (l.lower..=l.upper).contains(q),
                    "trial {trial}: {q} outside {l:?}"
                );
            }
        }
        assert!(worst < 1e-6, "{worst} m left at a goal that can be reached");
    }

    #[test]
    fn out_of_reach_ends_as_near_as_it_gets() {
        let model = arm();
        let chain = ChainIk::to_link(&model, "end_effector_link").expect("an arm");
        let mut q = vec![0.0; model.actuated.len()];
        let left = chain.solve(&model, &Goal::at(Point3::new(2.0, 0.0, 0.2)), &mut q);
        let end = chain.end_pose(&model, &q).translation.vector;
        let distance = (end - Vector3::new(2.0, 0.0, 0.2)).norm();
        assert!(
            (distance - left).abs() < 1e-9 && end.x > 0.3,
            "{end:?}, {left} m left"
        );
    }

    #[test]
    fn a_rotation_that_is_asked_for_is_met() {
        let model = arm();
        let chain = ChainIk::to_link(&model, "end_effector_link").expect("an arm");
        let there = [0.3, 0.2, -0.1, 0.4, 0.0];
        let wanted = chain.end_pose(&model, &there[..model.actuated.len()]);
        let goal = Goal {
            position: Point3::from(wanted.translation.vector),
            rotation: Some((wanted.rotation, 0.1)),
        };
        let mut q = vec![0.05; model.actuated.len()];
        let left = chain.solve(&model, &goal, &mut q);
        let turned = chain
            .end_pose(&model, &q)
            .rotation
            .angle_to(&wanted.rotation);
        assert!(left < 1e-6 && turned < 1e-5, "{left} m, {turned} rad left");
    }
}
