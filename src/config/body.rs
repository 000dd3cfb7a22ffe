//! The body of a character: its pose space, its feet, and clips made for it.

use super::avatar::Avatar;
use super::error::{ConfigError, Pointer};
use super::file::RobotEntry;
use super::files::Files;
use crate::body::{Feet, JointSpace, PoseSpace, RobotFeet, SkeletonSpace};
use crate::motion::clip::{Clip, ClipError, ClipFile, ClipKind};
use crate::robot::{Leg, RobotModel};
use std::sync::Arc;

/// A robot or an avatar as a pose space; with legs it has feet to be pinned.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its poses.
    pub space: BodySpace,
    /// Feet of a robot.
    pub feet: Option<RobotFeet>,
    /// The avatar, if it is one.
    pub avatar: Option<Avatar>,
}

/// Poses of a robot, which with legs has a body over the ground, or of a skeleton.
#[derive(Clone, Debug)]
pub enum BodySpace {
    /// Joint positions.
    Joints(JointSpace),
    /// Rotations.
    Skeleton(SkeletonSpace),
}

impl BodySpace {
    /// Whichever it is.
    pub fn get(&self) -> &dyn PoseSpace {
        match self {
            BodySpace::Joints(space) => space,
            BodySpace::Skeleton(space) => space,
        }
    }

    /// One to be shared.
    pub fn shared(&self) -> Arc<dyn PoseSpace> {
        match self {
            BodySpace::Joints(space) => Arc::new(space.clone()),
            BodySpace::Skeleton(space) => Arc::new(space.clone()),
        }
    }

    /// One of its own, for an animator.
    pub(super) fn boxed(&self) -> Box<dyn PoseSpace> {
        match self {
            BodySpace::Joints(space) => Box::new(space.clone()),
            BodySpace::Skeleton(space) => Box::new(space.clone()),
        }
    }
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
            space: BodySpace::Joints(JointSpace::of_robot(model, feet.is_some())),
            feet,
            avatar: None,
        })
    }

    /// The body of an avatar.
    pub(super) fn of_avatar(avatar: Avatar) -> Self {
        Self {
            space: BodySpace::Skeleton(SkeletonSpace::new(avatar.skeleton.clone())),
            feet: None,
            avatar: Some(avatar),
        }
    }

    /// Feet that are pinned while they stand.
    pub(super) fn pinned(&self) -> Option<Box<dyn Feet>> {
        if let Some(feet) = &self.feet {
            return Some(Box::new(feet.clone()));
        }
        let avatar = self.avatar.as_ref().filter(|a| a.pin_feet)?;
        Some(Box::new(avatar.feet.clone()))
    }

    /// The clip that `name` names in `files`. An avatar reads other programs' motions as well: `kind` is
    /// what it has to become.
    pub(super) fn named_clip(
        &self,
        files: &Files,
        name: &str,
        kind: Option<ClipKind>,
    ) -> Result<Clip, String> {
        let told = |e: &dyn std::fmt::Display| format!("{}: {e}", files.name(name));
        let file = match &self.avatar {
            Some(avatar) if !name.ends_with(".json") => avatar.clip_file(files, name, kind)?,
            _ => {
                let text = files.read(name).map_err(|e| e.to_string())?;
                ClipFile::from_json(&text).map_err(|e| told(&e))?
            }
        };
        self.clip(&file).map_err(|e| told(&e))
    }

    /// `file` for this body. Where it does not tell how the body stands over the ground, the body is put so
    /// high that the lowest foot touches it.
    pub fn clip(&self, file: &ClipFile) -> Result<Clip, ClipError> {
        let clip = file.for_space(self.space.get())?;
        let Some(feet) = &self.feet else {
            return Ok(clip);
        };
        if !file.body.is_empty() {
            return Ok(clip);
        }
        let frames = file.frames.len();
        let mut pose = vec![0.0; self.space.get().len()];
        let mut lowest = f64::INFINITY;
        for k in 0..frames {
            clip.pose(k as f64 / frames as f64, &mut pose);
            for foot in 0..feet.count() {
                lowest = lowest.min(feet.position(&pose, foot).z);
            }
        }
        let mut grounded = file.clone();
        grounded.body = vec![[0.0, 0.0, -lowest, 0.0, 0.0, 0.0]; frames];
        grounded.for_space(self.space.get())
    }
}
