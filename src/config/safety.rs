//! `[safety]`, checked: ramps, ages of poses, supervision, what happens when something is lost.

use super::error::{ConfigError, Pointer};
use super::file::{OnBusLost, OnExit, OnLost, OnOverrun, OnServoFault, Rearm, SafetyEntry};
use crate::base::suggest::hint;
use crate::gesture::GestureSet;

/// Ramps and policies, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Safety {
    /// Least time to the first pose, seconds.
    pub ramp_s: f64,
    /// Least time into the end pose, seconds.
    pub end_ramp_s: f64,
    /// Prediction to the instant the servo acts, seconds.
    pub actuation_delay_s: f64,
    /// Age of poses up to which gestures go on, seconds.
    pub coast_s: f64,
    /// Age of poses from which they are lost, seconds.
    pub lost_s: f64,
    /// What then happens.
    pub on_lost: OnLost,
    /// What happens when a servo falls out.
    pub on_servo_fault: OnServoFault,
    /// Torque at the end.
    pub on_exit: OnExit,
    /// What happens when the bus is lost; `None`: wait where somebody looks on, else exit.
    pub on_bus_lost: Option<OnBusLost>,
    /// Who takes servos back into control.
    pub rearm: Rearm,
    /// What happens when cycles keep beginning late.
    pub on_overrun: OnOverrun,
    /// The gesture that stops a run.
    pub stop_gesture: Option<StopGesture>,
    /// What is watched of the servos.
    pub supervision: Supervision,
}

/// A gesture that stops a run in order when it is performed.
#[derive(Clone, Debug, PartialEq)]
pub struct StopGesture {
    /// Its name in the gesture files.
    pub name: String,
    /// Amplitude from which it counts.
    pub level: f64,
    /// For how long at least, seconds.
    pub hold_s: f64,
}

/// Limits of what is watched of every servo. 0 switches a watch off where its text says so.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Supervision {
    /// Distance from the target beyond the servo's lag, rad; 0: not watched.
    pub following_error_rad: f64,
    /// For how long, seconds.
    pub following_error_s: f64,
    /// Time constant of the slowest servo that is well, seconds.
    pub servo_lag_s: f64,
    /// Share of its effort with which a servo that stands still is stalled.
    pub stall_effort: f64,
    /// For how long, seconds; 0: not watched.
    pub stall_s: f64,
    /// Highest temperature, degrees Celsius; `None`: the servo's own limit.
    pub temperature_limit_c: Option<f64>,
    /// So far below it motion begins to be made smaller, degrees.
    pub temperature_margin_c: f64,
    /// Lowest and highest supply, volts; `None`: the servo's own limits.
    pub voltage_range_v: Option<(f64, f64)>,
    /// So far above the lowest supply motion begins to be made smaller, volts.
    pub voltage_margin_v: f64,
    /// Root mean square of the effort that may be given for long, as a share of the greatest; 0: not watched.
    pub effort_limit: f64,
    /// The time constant of that mean, seconds.
    pub effort_window_s: f64,
    /// What is left of motion when it is made smallest.
    pub derate_least: f64,
}

impl Safety {
    /// As written; the numbers were checked. Fails when the stop gesture is none of `gestures`.
    pub(super) fn of(
        entry: &SafetyEntry,
        gestures: &GestureSet,
        at: &Pointer<'_>,
    ) -> Result<Self, ConfigError> {
        let stop_gesture = match &entry.stop_gesture {
            None => None,
            Some(name) if gestures.index_of(name.get_ref()).is_some() => Some(StopGesture {
                name: name.get_ref().clone(),
                level: entry.stop_gesture_level,
                hold_s: entry.stop_gesture_s,
            }),
            Some(name) => {
                let known = gestures.gestures.iter().map(|g| g.name.as_str());
                let name_hint = hint(name.get_ref(), known);
                let problem = format!("no gesture {:?}{name_hint}", name.get_ref());
                return Err(at.at(name.span(), "safety.stop_gesture", problem));
            }
        };
        Ok(Self {
            ramp_s: entry.ramp_s,
            end_ramp_s: entry.end_ramp_s,
            actuation_delay_s: entry.actuation_delay_s,
            coast_s: entry.coast_s,
            lost_s: entry.lost_s,
            on_lost: entry.on_lost,
            on_servo_fault: entry.on_servo_fault,
            on_exit: entry.on_exit,
            on_bus_lost: entry.on_bus_lost,
            rearm: entry.rearm,
            on_overrun: entry.on_overrun,
            stop_gesture,
            supervision: Supervision {
                following_error_rad: entry.following_error_rad,
                following_error_s: entry.following_error_s,
                servo_lag_s: entry.servo_lag_s,
                stall_effort: entry.stall_effort,
                stall_s: entry.stall_s,
                temperature_limit_c: entry.temperature_limit_c,
                temperature_margin_c: entry.temperature_margin_c,
                voltage_range_v: entry.voltage_range_v.map(|[low, high]| (low, high)),
                voltage_margin_v: entry.voltage_margin_v,
                effort_limit: entry.effort_limit,
                effort_window_s: entry.effort_window_s,
                derate_least: entry.derate_least,
            },
        })
    }
}
