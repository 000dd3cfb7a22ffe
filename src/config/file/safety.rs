//! `[safety]` as a user writes it: ramps, safe states, what to do when something is lost.

use super::one;
use serde::Deserialize;
use toml::Spanned;

/// Ramps and safe states.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SafetyEntry {
    /// Least time from the present pose to the first pose, seconds.
    #[serde(default = "two")]
    pub ramp_s: f64,
    /// Path of a clip whose end is the end pose; the rest pose when not given.
    pub end_clip: Option<Spanned<String>>,
    /// Least time into the end pose, seconds.
    #[serde(default = "two")]
    pub end_ramp_s: f64,
    /// From computing a target to the servo acting on it, seconds.
    #[serde(default = "actuation_delay")]
    pub actuation_delay_s: f64,
    /// Poses may be missing this long before gestures fade, seconds.
    #[serde(default = "coast")]
    pub coast_s: f64,
    /// Poses count as lost after this long, seconds.
    #[serde(default = "one")]
    pub lost_s: f64,
    /// `idle`, `hold` or `stop`.
    #[serde(default)]
    pub on_lost: OnLost,
    /// A servo latches a hardware error or comes back without torque: `stop` or `continue`.
    #[serde(default)]
    pub on_servo_fault: OnServoFault,
    /// Torque at the end of a run: `torque_off` or `hold`.
    #[serde(default)]
    pub on_exit: OnExit,
}

/// What happens when poses are lost.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnLost {
    /// Come to rest and wait.
    #[default]
    Idle,
    /// Hold the pose and wait.
    Hold,
    /// Lie down, torque off, exit code 4.
    Stop,
}

/// What happens when a servo falls out.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnServoFault {
    /// Lie down, torque off, exit code 4.
    #[default]
    Stop,
    /// Report it and play on with the others.
    Continue,
}

/// Servo state at the end of a run.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnExit {
    /// End pose, then torque off, read back.
    #[default]
    TorqueOff,
    /// End pose, torque stays on.
    Hold,
}

impl Default for SafetyEntry {
    fn default() -> Self {
        Self {
            ramp_s: two(),
            end_clip: None,
            end_ramp_s: two(),
            actuation_delay_s: actuation_delay(),
            coast_s: coast(),
            lost_s: one(),
            on_lost: OnLost::default(),
            on_servo_fault: OnServoFault::default(),
            on_exit: OnExit::default(),
        }
    }
}

fn two() -> f64 {
    2.0
}

fn coast() -> f64 {
    0.3
}

fn actuation_delay() -> f64 {
    0.02
}
