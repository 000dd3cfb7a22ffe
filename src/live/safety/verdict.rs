//! What the supervisor is shown, what it says, and what it goes by.

use super::kind::FaultKind;
use crate::base::JointState;
use crate::bus::{CycleReport, ServoHealth};
use crate::config::file::{OnOverrun, OnServoFault, Rearm};
use crate::config::safety::{StopGesture, Supervision};

/// What the supervisor goes by.
#[derive(Clone, Debug, PartialEq)]
pub struct Policy {
    /// What is watched.
    pub supervision: Supervision,
    /// What a fault of a servo leads to.
    pub on_servo_fault: OnServoFault,
    /// Who takes servos back.
    pub rearm: Rearm,
    /// What late cycles lead to.
    pub on_overrun: OnOverrun,
    /// The gesture that stops a run.
    pub stop_gesture: Option<StopGesture>,
}

/// What follows from a cycle, from the mildest to the gravest.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reaction {
    /// Go on.
    #[default]
    GoOn,
    /// Stand still until told otherwise.
    Hold,
    /// The operator asked for the end by gesture: as by key.
    OperatorStop,
    /// Come to rest, into the end pose.
    Ease,
    /// Send nothing more.
    AtOnce,
}

/// Something the bus is to do for a servo, outside the exchange.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Restart the servo of this joint, which clears its latched error.
    Reboot(usize),
    /// Torque on where it is.
    Rearm(usize),
}

/// What the control loop is to do.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Verdict {
    /// With the motion.
    pub reaction: Reaction,
    /// How much of it, 0..1; changes smoothly.
    pub vigour: f64,
    /// With the bus.
    pub request: Option<Request>,
}

/// What ended a run, or would have.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Cause {
    /// What.
    pub kind: FaultKind,
    /// Of which joint; `None` for the robot as a whole.
    pub joint: Option<usize>,
    /// When, seconds since the start of the run.
    pub t_s: f64,
    /// What was measured.
    pub value: f64,
    /// Its limit.
    pub limit: f64,
}

/// Something began or ended in this cycle.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Change {
    /// What.
    pub kind: FaultKind,
    /// Of which joint; `None` for the robot as a whole.
    pub joint: Option<usize>,
    /// It began (or its value was learnt) or it ended.
    pub begins: bool,
    /// What was measured.
    pub value: f64,
    /// Its limit.
    pub limit: f64,
}

/// One cycle, as the supervisor is shown it.
#[derive(Copy, Clone, Debug)]
pub struct Seen<'a> {
    /// Time since the start of the run, seconds.
    pub t_s: f64,
    /// What was sent, rad.
    pub targets: &'a [f64],
    /// What was read.
    pub states: &'a [JointState],
    /// What the bus saw.
    pub report: &'a CycleReport,
    /// How servos are; may be empty.
    pub health: &'a [ServoHealth],
    /// The cycle began a period or more after its deadline.
    pub late: bool,
    /// Joints whose pose was no number.
    pub not_finite: usize,
    /// An operator asks for a re-arm.
    pub rearm: bool,
    /// Amplitude of the stop gesture, 0 when there is none.
    pub stop_gesture: f64,
}
