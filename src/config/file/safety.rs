//! `[safety]` as a user writes it: ramps, safe states, supervision, what to do when something is lost.

use serde::Deserialize;
use toml::Spanned;

/// Ramps, safe states and supervision.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SafetyEntry {
    /// Least time from the present pose to the first pose, seconds; also back into motion after a re-arm.
    pub ramp_s: f64,
    /// Path of a clip whose end is the end pose; the rest pose when not given.
    pub end_clip: Option<Spanned<String>>,
    /// Least time into the end pose, seconds.
    pub end_ramp_s: f64,
    /// From computing a target to the servo acting on it, seconds.
    pub actuation_delay_s: f64,
    /// Poses may be missing this long before gestures fade, seconds.
    pub coast_s: f64,
    /// Poses count as lost after this long, seconds.
    pub lost_s: f64,
    /// `idle`, `hold` or `stop`.
    pub on_lost: OnLost,
    /// A servo latches a hardware error, loses its torque, stalls, or is too far from its targets, too hot or
    /// overloaded: `stop` or `continue`.
    pub on_servo_fault: OnServoFault,
    /// Torque at the end of a run: `torque_off` or `hold`.
    pub on_exit: OnExit,
    /// The bus is lost: `exit` (exit code 3) or `wait` until it is back and re-armed. When not given, `wait` with
    /// the terminal view and `exit` without.
    pub on_bus_lost: Option<OnBusLost>,
    /// Who takes servos back after a latched error, a restart or a lost bus: `operator` (key r, SIGUSR1) or `auto`.
    pub rearm: Rearm,
    /// Half of all cycles begin late: `hold` until they do not, `stop`, or `continue`.
    pub on_overrun: OnOverrun,
    /// A gesture that stops the run when it is performed.
    pub stop_gesture: Option<Spanned<String>>,
    /// Its amplitude from which it counts, and for how long, seconds.
    pub stop_gesture_level: f64,
    /// For how long it is performed at least, seconds.
    pub stop_gesture_s: f64,
    /// Distance of a joint from its target beyond the servo's lag, rad; 0: not watched.
    pub following_error_rad: f64,
    /// For how long at least, seconds.
    pub following_error_s: f64,
    /// Time constant of the slowest servo that is well, seconds.
    pub servo_lag_s: f64,
    /// Share of its effort from which a servo that does not move is stalled.
    pub stall_effort: f64,
    /// For how long at least, seconds; 0: not watched.
    pub stall_s: f64,
    /// Highest temperature, degrees Celsius; the servo's own limit when not given.
    pub temperature_limit_c: Option<f64>,
    /// So far below it motion begins to be made smaller, degrees.
    pub temperature_margin_c: f64,
    /// Lowest and highest supply, volts; the servo's own limits when not given.
    pub voltage_range_v: Option<[f64; 2]>,
    /// So far above the lowest supply motion begins to be made smaller, volts.
    pub voltage_margin_v: f64,
    /// Root mean square of the effort that may be given for long, as a share of the greatest; 0: not watched.
    pub effort_limit: f64,
    /// The time constant of that mean, seconds.
    pub effort_window_s: f64,
    /// What is left of amplitude and speed when motion is made smallest.
    pub derate_least: f64,
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

/// What happens when the bus is lost.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnBusLost {
    /// End, exit code 3.
    #[default]
    Exit,
    /// Look for it until it is back, then wait for a re-arm.
    Wait,
}

/// Who takes servos back into control.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rearm {
    /// A person.
    #[default]
    Operator,
    /// The program, a few times.
    Auto,
}

/// What happens when cycles keep beginning late.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnOverrun {
    /// Stand still until they do not.
    #[default]
    Hold,
    /// Lie down, torque off, exit code 4.
    Stop,
    /// Only count them.
    Continue,
}

impl Default for SafetyEntry {
    fn default() -> Self {
        Self {
            ramp_s: 2.0,
            end_clip: None,
            end_ramp_s: 2.0,
            actuation_delay_s: 0.02,
            coast_s: 0.3,
            lost_s: 1.0,
            on_lost: OnLost::default(),
            on_servo_fault: OnServoFault::default(),
            on_exit: OnExit::default(),
            on_bus_lost: None,
            rearm: Rearm::default(),
            on_overrun: OnOverrun::default(),
            stop_gesture: None,
            stop_gesture_level: 0.6,
            stop_gesture_s: 0.5,
            following_error_rad: 0.4,
            following_error_s: 0.3,
            servo_lag_s: 0.1,
            stall_effort: 0.7,
            stall_s: 0.6,
            temperature_limit_c: None,
            temperature_margin_c: 12.0,
            voltage_range_v: None,
            voltage_margin_v: 0.5,
            effort_limit: 0.8,
            effort_window_s: 5.0,
            derate_least: 0.35,
        }
    }
}
