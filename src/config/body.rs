//! The body of a character: its pose space, its feet, and clips made for it.

use super::error::{ConfigError, Pointer};
use super::file::RobotEntry;
use crate::body::{Feet, JointSpace, PoseSpace, RobotFeet};
use crate::motion::clip::{Clip, ClipError, ClipFile};
use crate::robot::{Leg, RobotModel};

/// The robot as a pose space; with legs it has a body over the ground and feet to be pinned.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its poses.
    pub space: JointSpace,
    /// Its feet.
    pub feet: Option<RobotFeet>,
}

impl Body {
    /// The body of `model`: on the legs that `robot` names, or that the tree shows; bolted down when there
    /// are none.
    pub(super) fn new(
        model: &RobotModel,
        robot: &RobotEntry,
        at: &Pointer<'_>,
    ) -> Result<Self, ConfigError> {
        let legs = if robot.legs.is_empty() {
            // A robot without legs is no mistake.
            Leg::find_all(model).unwrap_or_default()
        } else {
            let to_foot = |(name, foot): (&String, &String)| Leg::to_foot(model, name, foot);
            (robot.legs.iter().map(to_foot))
                .collect::<Result<Vec<_>, _>>()
                .map_err(|e| at.key("robot.legs", e))?
        };
        let feet =
            (robot.pin_feet && !legs.is_empty()).then(|| RobotFeet::new(model.clone(), legs));
        Ok(Self {
            space: JointSpace::of_robot(model, feet.is_some()),
            feet,
        })
    }

    /// `file` for this body. Where it does not tell how the body stands over the ground, the body is put so
    /// high that the lowest foot touches it.
    pub fn clip(&self, file: &ClipFile) -> Result<Clip, ClipError> {
        let clip = file.for_space(&self.space)?;
        let Some(feet) = &self.feet else {
            return Ok(clip);
        };
        if !file.body.is_empty() {
            return Ok(clip);
        }
        let frames = file.frames.len();
        let mut pose = vec![0.0; self.space.len()];
        let mut lowest = f64::INFINITY;
        for k in 0..frames {
            clip.pose(k as f64 / frames as f64, &mut pose);
            for foot in 0..feet.count() {
                lowest = lowest.min(feet.position(&pose, foot).z);
            }
        }
        let mut grounded = file.clone();
        grounded.body = vec![[0.0, 0.0, -lowest, 0.0, 0.0, 0.0]; frames];
        grounded.for_space(&self.space)
    }
}
