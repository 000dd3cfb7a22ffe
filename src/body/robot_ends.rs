//! End links of a robot that is bolted down: hands, grippers, tools, moved by the chain above them.

use super::Feet;
use crate::robot::RobotModel;
use crate::robot::ik::{ChainIk, Goal, IkError};
use nalgebra::{Point3, Vector3};

/// Ends of a robot's chains as [`Feet`], so that blending can keep them where they belong. Poses start
/// with the joint positions in model order; places are in the root link's frame.
#[derive(Clone, Debug)]
pub struct RobotEnds {
    model: RobotModel,
    chains: Vec<ChainIk>,
}

impl RobotEnds {
    /// The ends called `links`.
    pub fn new(model: RobotModel, links: &[&str]) -> Result<Self, IkError> {
        let chains = links
            .iter()
            .map(|link| ChainIk::to_link(&model, link))
            .collect::<Result<_, _>>()?;
        Ok(Self { model, chains })
    }
}

impl Feet for RobotEnds {
    fn count(&self) -> usize {
        self.chains.len()
    }

    fn name(&self, foot: usize) -> &str {
        &self.model.links[self.chains[foot].end()]
    }

    fn position(&self, pose: &[f64], foot: usize) -> Point3<f64> {
        Point3::from(
            self.chains[foot]
                .end_pose(&self.model, pose)
                .translation
                .vector,
        )
    }

    fn place(&self, pose: &mut [f64], foot: usize, goal: Point3<f64>) -> f64 {
        self.chains[foot].solve(&self.model, &Goal::at(goal), pose)
    }

    /// It is bolted down: nothing moves.
    fn shift(&self, _: &mut [f64], _: Vector3<f64>) {}

    fn reach_m(&self, foot: usize) -> f64 {
        // Along the links: no joint can make it longer but a prismatic one.
        let mut reach = 0.0;
        let mut at = self.chains[foot].end();
        while let Some(j) = self.model.parent_joint[at] {
            reach += self.model.joints[j].origin.translation.vector.norm();
            at = self.model.joints[j].parent;
        }
        reach
    }
}
