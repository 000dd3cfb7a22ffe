//! Where the feet stand, how the body moves over them, and the legs' answer.

use super::clip::{ClipFile, ClipKind, RootAdvance};
use super::gait::{GaitDescription, GaitError};
use super::range::JointRange;
use crate::robot::leg::LegError;
use crate::robot::{Facing, Leg, RobotModel};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};

/// A robot that motion is authored for.
#[derive(Copy, Clone, Debug)]
pub struct Walker<'a> {
    /// The robot.
    pub model: &'a RobotModel,
    /// Its legs.
    pub legs: &'a [Leg],
    /// Which way it faces.
    pub facing: Facing,
    /// Speed and acceleration each joint may use, in joint order.
    pub ranges: &'a [JointRange],
}

/// Ground contact of every foot when the body stands still, and joint positions that are kept.
pub(super) struct Stance<'a> {
    walker: Walker<'a>,
    name: &'a str,
    /// Feet on the ground, body's frame over the ground (z = 0).
    pub neutral: Vec<Point3<f64>>,
    pub body_height_m: f64,
    pub leg_length_m: f64,
}

impl<'a> Stance<'a> {
    pub fn new(description: &'a GaitDescription, walker: Walker<'a>) -> Self {
        let least = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::INFINITY, f64::min);
        let standing: Vec<_> = walker
            .legs
            .iter()
            .map(|l| l.standing(walker.facing))
            .collect();
        let count = standing.len().max(1) as f64;
        let middle = |axis: usize| standing.iter().map(|s| s.foot[axis]).sum::<f64>() / count;
        let (x, y) = (middle(0), middle(1));
        // The middle legs of six stand level with the middle and stay there.
        let away = |from: f64, by: f64| {
            if from.abs() < 1e-3 {
                0.0
            } else {
                by * from.signum()
            }
        };
        Self {
            neutral: standing
                .iter()
                .map(|s| {
                    Point3::new(
                        s.foot.x + away(s.foot.x - x, description.stance_length_m),
                        s.foot.y + away(s.foot.y - y, description.stance_width_m),
                        0.0,
                    )
                })
                .collect(),
            body_height_m: description
                .body_height_m
                .unwrap_or_else(|| least(&mut standing.iter().map(|s| s.body_height_m))),
            leg_length_m: least(&mut walker.legs.iter().map(|l| l.length(walker.model))),
            name: &description.name,
            walker,
        }
    }

    /// Pose of the root link over the ground: the body's own place, then the axes of the root link.
    pub fn root_pose(&self, body: &[f64; 6]) -> Isometry3<f64> {
        let [forward, left, height, roll, pitch, yaw] = *body;
        Isometry3::from_parts(
            Translation3::new(forward, left, height),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw) * self.walker.facing.rotation(),
        )
    }

    /// The row of [`ClipFile::body`] for such a pose.
    pub fn body_row(root: &Isometry3<f64>) -> [f64; 6] {
        let t = root.translation.vector;
        let (roll, pitch, yaw) = root.rotation.euler_angles();
        [t.x, t.y, t.z, roll, pitch, yaw]
    }

    /// The body's place when nothing sways.
    pub fn level(&self) -> [f64; 6] {
        [0.0, 0.0, self.body_height_m, 0.0, 0.0, 0.0]
    }

    /// Joint positions with all feet where they stand; the knees' sides are chosen here, so that every
    /// clip of the robot agrees.
    pub fn stand(&self) -> Result<Vec<f64>, GaitError> {
        let mut positions = self.walker.model.rest();
        let root = self.root_pose(&self.level());
        for (leg, neutral) in self.walker.legs.iter().zip(&self.neutral) {
            let goal = root.inverse_transform_point(neutral);
            leg.place_foot_from_scratch(
                self.walker.model,
                goal,
                self.walker.facing,
                &mut positions,
            )
            .map_err(|e| self.cannot(e))?;
        }
        Ok(positions)
    }

    /// Puts foot `leg` on `ground` (over-ground frame), from the neighbouring pose in `positions`.
    pub fn place(
        &self,
        leg: usize,
        root: &Isometry3<f64>,
        ground: Point3<f64>,
        positions: &mut [f64],
    ) -> Result<(), GaitError> {
        let goal = root.inverse_transform_point(&ground);
        self.walker.legs[leg]
            .place_foot(self.walker.model, goal, positions)
            .map_err(|e| self.cannot(e))
    }

    fn cannot(&self, source: LegError) -> GaitError {
        GaitError::Leg {
            name: self.name.into(),
            source,
            body_height_m: self.body_height_m,
            leg_length_m: self.leg_length_m,
        }
    }

    /// A clip without frames.
    pub fn empty_file(&self, description: &GaitDescription, kind: ClipKind) -> ClipFile {
        let origin = if description.origin.is_empty() {
            format!(
                "authored by handwave clip gait for robot {}",
                self.walker.model.name
            )
        } else {
            description.origin.clone()
        };
        ClipFile {
            handwave: "clip".into(),
            version: 1,
            name: description.name.clone(),
            origin,
            kind,
            joints: self.walker.model.joint_names(),
            frequency_hz: description.frequency_hz.unwrap_or(0.0),
            root: RootAdvance::default(),
            segments: Vec::new(),
            frames: Vec::new(),
            duration_s: description.duration_s,
            skeleton: None,
            body: Vec::new(),
            way: Vec::new(),
        }
    }
}
