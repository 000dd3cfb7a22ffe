//! What analysis needs of the body of a take: its pose space, its feet, and the joints of each limb.

use super::AnalysisError;
use crate::body::{Feet, JointSpace, PoseSpace, RobotFeet, SkeletonFeet, SkeletonSpace};
use crate::motion::take::{Take, TakeBody};
use crate::robot::{Leg, RobotModel};
use std::sync::Arc;

/// A body: pose space, feet where they are known, joint names of each foot's limb.
pub struct BodyModel {
    space: Box<dyn PoseSpace>,
    feet: Option<Box<dyn Feet>>,
    limbs: Vec<Vec<String>>,
    model: Option<RobotModel>,
    /// Why there are no feet, for the reader.
    pub note: Option<String>,
}

/// Poses that are shown to the search for legs: enough to see every foot come down.
const SHOWN: usize = 60;

impl BodyModel {
    /// The body of `take`. A skeleton's legs are found; those of a robot need its `model`.
    ///
    /// # Errors
    /// A model whose joints are not those of the take.
    pub fn of(take: &Take, model: Option<&RobotModel>) -> Result<Self, AnalysisError> {
        match &take.body {
            TakeBody::Skeleton(skeleton) => {
                let stride = take.len().div_ceil(SHOWN).max(1);
                let shown: Vec<&[f64]> = (take.poses.iter().step_by(stride))
                    .map(Vec::as_slice)
                    .collect();
                let space = SkeletonSpace::new(Arc::clone(skeleton));
                let (feet, limbs, note) = match SkeletonFeet::find(Arc::clone(skeleton), &shown) {
                    Ok(feet) => {
                        let limbs = (0..feet.count())
                            .map(|f| {
                                let joints = feet.joints_of(f).into_iter();
                                joints.map(|j| skeleton.joints[j].name.clone()).collect()
                            })
                            .collect();
                        (Some(Box::new(feet) as Box<dyn Feet>), limbs, None)
                    }
                    Err(e) => (None, Vec::new(), Some(e.to_string())),
                };
                Ok(Self {
                    space: Box::new(space),
                    feet,
                    limbs,
                    model: None,
                    note,
                })
            }
            TakeBody::Joints(names) => Self::robot(take, names, model, false),
            TakeBody::Floating(names) => Self::robot(take, names, model, true),
        }
    }

    fn robot(
        take: &Take,
        names: &[String],
        model: Option<&RobotModel>,
        floating: bool,
    ) -> Result<Self, AnalysisError> {
        let Some(model) = model else {
            let space = if floating {
                JointSpace::floating(names)
            } else {
                JointSpace::fixed(names)
            };
            return Ok(Self {
                space: Box::new(space),
                feet: None,
                limbs: Vec::new(),
                model: None,
                note: Some("feet are known with the robot's URDF only (--urdf)".into()),
            });
        };
        let known = model.joint_names();
        if known != names {
            return Err(AnalysisError::Take {
                take: take.name.clone(),
                problem: format!(
                    "its joints are {}; those of {} are {}",
                    names.join(" "),
                    model.name,
                    known.join(" ")
                ),
            });
        }
        let space = Box::new(JointSpace::of_robot(model, floating));
        let legs = Leg::find_all(model);
        let note = match &legs {
            Err(e) => Some(e.to_string()),
            Ok(_) if !floating => {
                Some("the clip does not tell where the body is over the ground".into())
            }
            Ok(_) => None,
        };
        let legs = legs.unwrap_or_default();
        let limbs = (legs.iter())
            .map(|l| l.joints.iter().map(|j| known[*j].clone()).collect())
            .collect();
        let feet: Option<Box<dyn Feet>> = (floating && !legs.is_empty())
            .then(|| Box::new(RobotFeet::new(model.clone(), legs)) as Box<dyn Feet>);
        Ok(Self {
            space,
            feet,
            limbs,
            model: Some(model.clone()),
            note,
        })
    }

    /// The pose space.
    pub fn space(&self) -> &dyn PoseSpace {
        &*self.space
    }

    /// The feet, where they are known.
    pub fn feet(&self) -> Option<&dyn Feet> {
        self.feet.as_deref()
    }

    /// Joint names of each foot's limb, in foot order.
    pub fn limbs(&self) -> &[Vec<String>] {
        &self.limbs
    }

    /// The robot, where it is known.
    pub fn model(&self) -> Option<&RobotModel> {
        self.model.as_ref()
    }
}
