//! The moving joints above a foot, compact: foot position and Jacobian without a walk through the tree.

use crate::robot::model::{JointKind, RobotModel};
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

/// One moving joint of a leg.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Step {
    /// Pose of the joint frame in the frame of the joint above it (the root link for the first).
    pub before: Isometry3<f64>,
    /// Axis in the joint frame.
    pub axis: Unit<Vector3<f64>>,
    /// Slides instead of turning.
    pub slides: bool,
    /// Which of the leg's joints drives it.
    pub driver: usize,
    /// Its position is `scale` times the driver's plus `offset` (1 and 0 unless it mimics).
    pub scale: f64,
    /// See `scale`.
    pub offset: f64,
}

impl Step {
    fn motion(&self, positions: &[f64; 3]) -> Isometry3<f64> {
        let q = self.scale * positions[self.driver] + self.offset;
        if self.slides {
            Isometry3::from_parts(
                Translation3::from(self.axis.into_inner() * q),
                UnitQuaternion::identity(),
            )
        } else {
            Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_axis_angle(&self.axis, q),
            )
        }
    }
}

/// All joints from the root link to the foot.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chain {
    /// From the body outwards.
    pub steps: Vec<Step>,
    /// The foot in the frame of the last joint.
    pub tail: Point3<f64>,
    /// Limits of the three joints.
    pub limits: [(f64, f64); 3],
}

impl Chain {
    /// The chain that ends in `tip` of link `foot`, driven by the joints `joints` of the joint vector.
    pub fn new(model: &RobotModel, foot: usize, tip: Point3<f64>, joints: [usize; 3]) -> Self {
        let mut above = Vec::new();
        let mut at = foot;
        while let Some(j) = model.parent_joint[at] {
            above.push(j);
            at = model.joints[j].parent;
        }
        let mut before = Isometry3::identity();
        let mut steps = Vec::new();
        for j in above.into_iter().rev() {
            let joint = &model.joints[j];
            before *= joint.origin;
            if joint.kind == JointKind::Fixed {
                continue;
            }
            let (of, scale, offset) = model.driver(j);
            let driver = model
                .actuated_index(of)
                .and_then(|i| joints.iter().position(|k| *k == i));
            steps.push(Step {
                before,
                axis: joint.axis,
                slides: joint.kind == JointKind::Prismatic,
                // A joint driven from outside the leg stays where it rests.
                driver: driver.unwrap_or(0),
                scale: if driver.is_some() { scale } else { 0.0 },
                offset,
            });
            before = Isometry3::identity();
        }
        Self {
            steps,
            tail: before * tip,
            limits: joints.map(|j| {
                model.joints[model.actuated[j]]
                    .limits
                    .map_or((f64::NEG_INFINITY, f64::INFINITY), |l| (l.lower, l.upper))
            }),
        }
    }

    /// The foot in the root link's frame.
    pub fn foot(&self, positions: &[f64; 3]) -> Point3<f64> {
        self.steps.iter().rev().fold(self.tail, |foot, step| {
            step.before * (step.motion(positions) * foot)
        })
    }

    /// The foot, and the velocity of the foot per unit speed of each joint, in the root link's frame.
    pub fn jacobian(&self, positions: &[f64; 3]) -> (Point3<f64>, Matrix3<f64>) {
        let foot = self.foot(positions);
        let mut jacobian = Matrix3::zeros();
        let mut frame = Isometry3::identity();
        for step in &self.steps {
            frame *= step.before;
            let axis = frame.rotation * step.axis.into_inner();
            let column = if step.slides {
                axis
            } else {
                axis.cross(&(foot - Point3::from(frame.translation.vector)))
            };
            let mut total = jacobian.column_mut(step.driver);
            total += column * step.scale;
            frame *= step.motion(positions);
        }
        (foot, jacobian)
    }

    /// Pose of the frame of joint `i` in the root link's frame, before it moves.
    pub fn joint_frame(&self, i: usize, positions: &[f64; 3]) -> Isometry3<f64> {
        let mut frame = Isometry3::identity();
        for step in &self.steps {
            frame *= step.before;
            if step.driver == i {
                break;
            }
            frame *= step.motion(positions);
        }
        frame
    }

    /// Joint positions nearest to zero that the limits allow.
    pub fn rest(&self) -> [f64; 3] {
        self.limits
            .map(|(lower, upper)| 0.0_f64.clamp(lower, upper))
    }
}
