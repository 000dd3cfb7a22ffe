//! Feet of a legged robot whose pose has a floating body.

use super::Feet;
use super::joint_space::body_pose;
use crate::robot::{Facing, Leg, RobotModel};
use nalgebra::{Point3, UnitQuaternion, Vector3};

/// Legs of a robot as [`Feet`]. Poses are those of a floating [`super::JointSpace`]: joints, then the
/// body's place over the ground.
#[derive(Clone, Debug)]
pub struct RobotFeet {
    model: RobotModel,
    legs: Vec<Leg>,
    joints: usize,
    reach_m: Vec<f64>,
    /// From the root link to x forward, y left, z up.
    facing: UnitQuaternion<f64>,
}

impl RobotFeet {
    /// The feet of `legs`, of a robot whose root link looks where `facing` says.
    pub fn new(model: RobotModel, legs: Vec<Leg>, facing: Facing) -> Self {
        Self {
            facing: facing.rotation(),
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
        let foot = self.legs[foot].foot_position(&self.model, joints);
        body_pose(body) * (self.facing * foot)
    }

    fn place(&self, pose: &mut [f64], foot: usize, goal: Point3<f64>) -> f64 {
        let (joints, body) = pose.split_at_mut(self.joints);
        let goal = body_pose(body).inverse_transform_point(&goal);
        let goal = self.facing.inverse_transform_point(&goal);
        let leg = &self.legs[foot];
        match leg.place_foot(&self.model, goal, joints) {
            Ok(()) => 0.0,
            Err(_) => (leg.foot_position(&self.model, joints) - goal).norm(),
        }
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
