//! Gait descriptions: from a few numbers and a URDF with legs to joint-space clips.
//!
//! A description is TOML, either a gait or a way through poses:
//!
//! ```toml
//! version = 1
//! name = "trot_long"
//! gait = "trot"            # four legs: walk, trot, pace, bound, gallop, rotary_gallop, pronk;
//!                          # six: tripod, ripple, wave; any: stand
//! frequency_hz = 1.6       # cycles per second that it must be able to play
//! stride_m = 0.12          # how far the body travels in one cycle, along its way
//! left_m = 0.0             # and to its left
//! turn_rad = 0.0           # how far the body turns in one cycle, counter-clockwise: with stride_m a
//!                          # curve of radius stride / turn, with stride_m = 0.0 in place
//! duty_factor = 0.5        # fraction of the cycle a foot is on the ground
//! step_height_m = 0.025
//! body_height_m = 0.15     # of the root link above the feet
//! stance_width_m = 0.0     # feet this much further out than below the hips,
//! stance_length_m = 0.0    # and this much further to the front and the rear
//! sway_m = 0.0             # the body swings to the side that carries, once per cycle,
//! sway_roll_rad = 0.0      # rolls with it (right side down while it is right),
//! bob_m = 0.0              # and goes up and down twice
//! # [phase]                # own touch-down phases, fraction of the cycle, instead of the preset's
//! # front_left = 0.5
//! ```
//!
//! ```toml
//! version = 1
//! name = "bow"
//! # duration_s = 2.0       # how long it takes where the clock plays it (play = "once")
//! [[pose]]
//! body_height_m = 0.15
//! [[pose]]
//! at = 0.4                 # progression at which it is reached; evenly spread when not given
//! body_height_m = 0.12
//! pitch_rad = 0.3          # nose down
//! forward_m = -0.02
//! [[pose]]                 # the last pose is progression 1
//! feet = { front_left = [0.03, 0.0, 0.06] }  # from where the foot stands: forwards, left, up, m
//! ```

pub use super::gait_presets::GaitName;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One pose of the body over its feet, which stay on the ground unless named.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyPose {
    /// Height of the root link above the feet; that of the description when not given.
    pub body_height_m: Option<f64>,
    /// Nose down is positive, rad.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub pitch_rad: f64,
    /// Right side down is positive, rad.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub roll_rad: f64,
    /// Counter-clockwise seen from above, rad.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub yaw_rad: f64,
    /// Body displacement forwards, m.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub forward_m: f64,
    /// Body displacement to the left, m.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub left_m: f64,
    /// Progression at which the pose is reached, 0..1.
    pub at: Option<f64>,
    /// Feet that are elsewhere: by leg, from where the foot stands, forwards, left and up, m.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub feet: BTreeMap<String, [f64; 3]>,
}

/// A gait or a way through poses, as an author writes it. Lengths not given follow from the legs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GaitDescription {
    /// Format version, 1.
    pub version: u32,
    /// Name of the clip.
    pub name: String,
    /// Where it comes from.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub origin: String,
    /// Preset of touch-down phases; a gait has this or `phase`.
    pub gait: Option<GaitName>,
    /// Cycles per second that the gait must be able to play.
    pub frequency_hz: Option<f64>,
    /// Body travel per cycle along its way, m; negative is backwards.
    pub stride_m: Option<f64>,
    /// Body travel per cycle to its left, m.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub left_m: f64,
    /// Fraction of the cycle a foot is on the ground, 0.1..1.
    pub duty_factor: Option<f64>,
    /// Highest foot clearance in swing, m.
    pub step_height_m: Option<f64>,
    /// Height of the root link above the feet, m.
    pub body_height_m: Option<f64>,
    /// Turn per cycle, rad, counter-clockwise.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub turn_rad: f64,
    /// Feet further out than they stand by themselves, m on each side.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub stance_width_m: f64,
    /// Feet further from the middle, to the front and the rear, m.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub stance_length_m: f64,
    /// The body swings to the side that carries, m, once per cycle.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub sway_m: f64,
    /// It rolls with the sway, rad (right side down while it is right).
    #[serde(default, skip_serializing_if = "is_zero")]
    pub sway_roll_rad: f64,
    /// It goes up and down, m, twice per cycle.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub bob_m: f64,
    /// How long a path takes when the clock plays it, s.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub duration_s: f64,
    /// Touch-down phase per leg, fraction of the cycle.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub phase: BTreeMap<String, f64>,
    /// A way through poses instead of a gait; two or more.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pose: Vec<BodyPose>,
}

/// For serde, which hands over a reference.
#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the signature serde asks for"
)]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// Why a description cannot become a clip.
#[derive(Debug, thiserror::Error)]
pub enum GaitError {
    /// Not a description.
    #[error("not a gait description: {0}")]
    Toml(#[from] toml::de::Error),
    /// A value is missing or out of range.
    #[error("{key}: {problem}")]
    Value {
        /// Key of the description.
        key: &'static str,
        /// What was found and what is allowed.
        problem: String,
    },
    /// The legs cannot do it.
    #[error(
        "{name}: {source}. Try a smaller stride_m or step_height_m, or another body_height_m ({body_height_m:.3} m now, legs are {leg_length_m:.3} m long)"
    )]
    Leg {
        /// Clip name.
        name: String,
        /// Which foot, and where.
        source: crate::robot::leg::LegError,
        /// Body height tried, m.
        body_height_m: f64,
        /// Length of the leg, m.
        leg_length_m: f64,
    },
    /// The joints are too slow even for a much shorter stride.
    #[error(
        "{name}: joint {joint} allows at most {max_hz:.2} Hz, {frequency_hz:.2} Hz is asked for, and shortening the stride to {least_percent:.0} % does not help. Lower frequency_hz or step_height_m"
    )]
    TooFast {
        /// Clip name.
        name: String,
        /// The joint that is in the way.
        joint: String,
        /// Highest frequency at the shortest stride, Hz.
        max_hz: f64,
        /// Asked for, Hz.
        frequency_hz: f64,
        /// Shortest stride tried, percent.
        least_percent: f64,
    },
}

impl GaitDescription {
    /// Parses and checks the TOML text of a description.
    pub fn from_toml(text: &str) -> Result<Self, GaitError> {
        let description: GaitDescription = toml::from_str(text)?;
        description.check()?;
        Ok(description)
    }

    /// A preset with everything else left to the legs.
    pub fn preset(name: &str, gait: GaitName) -> Self {
        Self {
            version: 1,
            name: name.into(),
            origin: String::new(),
            gait: Some(gait),
            frequency_hz: None,
            stride_m: None,
            duty_factor: None,
            step_height_m: None,
            body_height_m: None,
            left_m: 0.0,
            turn_rad: 0.0,
            duration_s: 0.0,
            stance_width_m: 0.0,
            stance_length_m: 0.0,
            sway_m: 0.0,
            sway_roll_rad: 0.0,
            bob_m: 0.0,
            phase: BTreeMap::new(),
            pose: Vec::new(),
        }
    }

    /// Checks ranges; called again after values were overridden.
    pub fn check(&self) -> Result<(), GaitError> {
        let bad = |key, problem: String| Err(GaitError::Value { key, problem });
        if self.version != 1 {
            return bad(
                "version",
                format!("{} is not known; this build reads 1", self.version),
            );
        }
        let is_gait = self.gait.is_some() || !self.phase.is_empty();
        if is_gait != self.pose.is_empty() {
            return bad(
                "gait",
                "give either gait (or [phase]) for a cycle, or two or more [[pose]] for a path"
                    .into(),
            );
        }
        if !self.pose.is_empty() && self.pose.len() < 2 {
            return bad("pose", "a path needs two or more [[pose]] tables".into());
        }
        let positive = [
            ("frequency_hz", self.frequency_hz, 20.0),
            ("body_height_m", self.body_height_m, 5.0),
            ("duty_factor", self.duty_factor, 1.0),
        ];
        for (key, value, highest) in positive {
            if let Some(v) = value
                && !(v > 0.0 && v <= highest)
            {
                return bad(key, format!("{v} is not in 0..{highest} (above 0)"));
            }
        }
        if let Some(d) = self.duty_factor
            && d < 0.1
        {
            return bad(
                "duty_factor",
                format!("{d} is below 0.1: the foot would hardly touch the ground"),
            );
        }
        if let Some(h) = self.step_height_m
            && !(0.0..=1.0).contains(&h)
        {
            return bad("step_height_m", format!("{h} is not in 0..1 m"));
        }
        if let Some(s) = self.stride_m
            && !(-5.0..=5.0).contains(&s)
        {
            return bad("stride_m", format!("{s} is not in -5..5 m"));
        }
        if !(0.0..=3600.0).contains(&self.duration_s) {
            return bad(
                "duration_s",
                format!("{} is not in 0..3600", self.duration_s),
            );
        }
        if !(-3.2..=3.2).contains(&self.turn_rad) {
            return bad("turn_rad", format!("{} is not in -3.2..3.2", self.turn_rad));
        }
        for (leg, phase) in &self.phase {
            if !(0.0..1.0).contains(phase) {
                return bad("phase", format!("{leg} = {phase} is not in 0..1"));
            }
        }
        let lengths = [
            ("left_m", self.left_m, 5.0),
            ("stance_width_m", self.stance_width_m, 1.0),
            ("stance_length_m", self.stance_length_m, 1.0),
            ("sway_m", self.sway_m, 0.5),
            ("sway_roll_rad", self.sway_roll_rad, 0.5),
            ("bob_m", self.bob_m, 0.5),
        ];
        for (key, value, most) in lengths {
            if !(value.abs() <= most) {
                return bad(key, format!("{value} is not in -{most}..{most}"));
            }
        }
        if self.gait == Some(GaitName::Stand)
            && (self.turn_rad != 0.0 || self.left_m != 0.0 || self.stride_m.unwrap_or(0.0) != 0.0)
        {
            return bad(
                "gait",
                "stand goes nowhere; leave out stride_m, left_m and turn_rad".into(),
            );
        }
        for pose in &self.pose {
            pose.check()?;
        }
        self.pose_times().map(|_| ())
    }

    /// Progression at which each pose is reached: 0 to 1, rising.
    pub fn pose_times(&self) -> Result<Vec<f64>, GaitError> {
        let last = self.pose.len().saturating_sub(1).max(1);
        let inner = self.pose.get(1..last).unwrap_or_default();
        let given = inner.iter().filter(|p| p.at.is_some()).count();
        let bad = |problem: String| {
            Err(GaitError::Value {
                key: "pose.at",
                problem,
            })
        };
        if given != 0 && given != inner.len() {
            return bad(format!(
                "{given} of the {} poses between the first and the last have it; give it to all of them or to none",
                inner.len()
            ));
        }
        let times: Vec<f64> = self
            .pose
            .iter()
            .enumerate()
            .map(|(k, pose)| pose.at.unwrap_or(k as f64 / last as f64))
            .collect();
        let ends = (times.first().copied(), times.last().copied());
        if !times.is_empty() && ends != (Some(0.0), Some(1.0)) {
            return bad("the first pose is at 0 and the last at 1".into());
        }
        if times.windows(2).any(|w| !(w[1] - w[0] >= 0.01)) {
            return bad(format!("{times:?} must rise by 0.01 or more"));
        }
        Ok(times)
    }
}

impl BodyPose {
    fn check(&self) -> Result<(), GaitError> {
        let bad = |problem: String| {
            Err(GaitError::Value {
                key: "pose",
                problem,
            })
        };
        let angles = [self.pitch_rad, self.roll_rad, self.yaw_rad];
        if !angles.iter().all(|a| (-1.2..=1.2).contains(a)) {
            return bad(format!("angles {angles:?} must lie in -1.2..1.2 rad"));
        }
        if let Some(h) = self.body_height_m
            && !(h > 0.0 && h <= 5.0)
        {
            return bad(format!("body_height_m = {h} is not in 0..5 (above 0)"));
        }
        if !(self.forward_m.abs() <= 2.0 && self.left_m.abs() <= 2.0) {
            return bad("forward_m and left_m must lie in -2..2".into());
        }
        for (leg, way) in &self.feet {
            if !way.iter().all(|v| v.abs() <= 2.0) {
                return bad(format!("feet.{leg} = {way:?} must lie in -2..2 m"));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_descriptions_name_the_key() {
        for (text, expected) in [
            ("version = 1\nname='x'\ngait='trot'\nstride=1", "stride"),
            ("version = 1\nname='x'\ngait='gallopp'", "gallopp"),
            ("version = 2\nname='x'\ngait='trot'", "version"),
            ("version = 1\nname='x'", "gait"),
            (
                "version = 1\nname='x'\ngait='trot'\nduty_factor=1.5",
                "duty_factor",
            ),
            (
                "version = 1\nname='x'\ngait='trot'\nfrequency_hz=nan",
                "frequency_hz",
            ),
            (
                "version = 1\nname='x'\n[[pose]]\npitch_rad=0.1",
                "two or more",
            ),
            (
                "version = 1\nname='x'\n[[pose]]\n[[pose]]\nat=0.6\n[[pose]]\nat=0.4\n[[pose]]",
                "must rise",
            ),
            (
                "version = 1\nname='x'\n[[pose]]\n[[pose]]\nfeet={front_left=[0,0,nan]}",
                "front_left",
            ),
            ("version = 1\nname='x'\ngait='stand'\nturn_rad=0.2", "stand"),
        ] {
            let message = GaitDescription::from_toml(text)
                .expect_err("wrong on purpose")
                .to_string();
            assert!(message.contains(expected), "{text:?}: {message}");
        }
    }
}
