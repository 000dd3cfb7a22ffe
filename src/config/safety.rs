//! `[safety]`, checked: ramps, ages of poses, what happens when something is lost.

use super::file::{OnExit, OnLost, OnServoFault, SafetyEntry};

/// Ramps and policies, checked.
#[derive(Copy, Clone, Debug, PartialEq)]
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
}

impl Safety {
    /// As written; the numbers were checked.
    pub(super) fn of(entry: &SafetyEntry) -> Self {
        Self {
            ramp_s: entry.ramp_s,
            end_ramp_s: entry.end_ramp_s,
            actuation_delay_s: entry.actuation_delay_s,
            coast_s: entry.coast_s,
            lost_s: entry.lost_s,
            on_lost: entry.on_lost,
            on_servo_fault: entry.on_servo_fault,
            on_exit: entry.on_exit,
        }
    }
}
