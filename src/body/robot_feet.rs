//! Feet of a legged robot whose pose has a floating body.

use super::Feet;
use super::joint_space::body_pose;
use crate::robot::{Leg, RobotModel};
use nalgebra::{Point3, Vector3};

/// Legs of a robot as [`Feet`]. Poses are those of a floating [`super::JointSpace`]: joints, then the
/// body's place over the ground: the root link's own pose, whichever way its axes look.
#[derive(Clone, Debug)]
pub struct RobotFeet {
    model: RobotModel,
    legs: Vec<Leg>,
    joints: usize,
    reach_m: Vec<f64>,
}

impl RobotFeet {
    /// The feet of `legs`.
    pub fn new(model: RobotModel, legs: Vec<Leg>) -> Self {
        Self {
            joints: model.actuated.len(),
            reach_m: legs.iter().map(|l| l.length(&model)).collect(),
            model,
            legs,
        }
    }

    /// The legs, in foot order.
    pub fn legs(&self) -> &[Leg] {
        &self.legs
    }
}

impl Feet for RobotFeet {
    fn count(&self) -> usize {
        self.legs.len()
    }

    fn name(&self, foot: usize) -> &str {
        &self.legs[foot].name
    }

    fn position(&self, pose: &[f64], foot: usize) -> Point3<f64> {
        let (joints, body) = pose.split_at(self.joints);
        body_pose(body) * self.legs[foot].foot_position(&self.model, joints)
    }

    fn place(&self, pose: &mut [f64], foot: usize, goal: Point3<f64>) -> f64 {
        let (joints, body) = pose.split_at_mut(self.joints);
        let goal = body_pose(body).inverse_transform_point(&goal);
        self.legs[foot].reach(goal, joints)
    }

    fn shift(&self, pose: &mut [f64], way: Vector3<f64>) {
        for (coordinate, way) in pose[self.joints..].iter_mut().zip(way.iter()) {
            *coordinate += way;
        }
    }

    fn reach_m(&self, foot: usize) -> f64 {
        self.reach_m[foot]
    }
}
