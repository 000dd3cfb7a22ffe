//! The control loop: fixed rate, absolute deadlines, one exchange with the bus per cycle.
//!
//! [`start`](self) looks at the servos and arms them, `cycles` is the loop, `send` its exchange with the bus, `outage`
//! what happens while the bus is away, `ending` how a run ends.

mod cycles;
mod ending;
mod outage;
mod send;
mod start;

use super::feed::Feed;
use super::record::Recorder;
use super::reload::Handover;
use super::safety::Policy;
use super::stats::Stats;
use super::stop::StopSwitch;
use crate::base::{Clock, Time};
use crate::bus::{BusError, ServoBus, TorqueReport};
use crate::config::file::OnBusLost;
use crate::puppet::Puppet;

pub use ending::run;

/// How a run is driven.
#[derive(Clone, Debug, PartialEq)]
pub struct ControlOptions {
    /// Control cycles per second.
    pub rate_hz: f64,
    /// The run is brought to its end after this long, seconds.
    pub duration_s: Option<f64>,
    /// Torque is switched off at the end of an orderly run.
    pub torque_off_at_end: bool,
    /// What a lost bus leads to.
    pub on_bus_lost: OnBusLost,
    /// What the supervisor goes by.
    pub policy: Policy,
    /// Index of the stop gesture among the puppet's gestures.
    pub stop_gesture: Option<usize>,
    /// Servo id of each joint, for messages; empty for a body without servos.
    pub ids: Vec<u8>,
}

/// How a run ended.
#[derive(Debug)]
pub enum Ending {
    /// The performance or the set duration is over.
    Complete,
    /// The operator stopped it.
    Interrupted,
    /// The robot was stopped for safety, with the reason.
    SafetyStop(String),
    /// The bus failed.
    Bus(BusError),
}

/// What a run leaves behind.
#[derive(Debug)]
pub struct Outcome {
    /// How it ended.
    pub ending: Ending,
    /// What it measured.
    pub stats: Stats,
    /// Torque read back at the end; `None` when torque stays on as declared.
    pub torque: Option<Result<TorqueReport, BusError>>,
    /// What supervision found worth telling before the run, such as servos without a watchdog.
    pub notes: Vec<String>,
}

/// The parts a control loop works with.
pub struct Parts<'a> {
    /// The pure step.
    pub puppet: &'a mut Puppet,
    /// The servos.
    pub bus: &'a mut dyn ServoBus,
    /// The poses.
    pub feed: &'a mut dyn Feed,
    /// The time, shared with the bus.
    pub clock: &'a dyn Clock,
    /// Signals and keys.
    pub stop: &'a StopSwitch,
    /// New gestures while the run goes on.
    pub handover: Option<&'a mut Handover>,
    /// Who looks on.
    pub recorder: &'a mut dyn Recorder,
    /// Called once with the time of cycle 0 on `clock`.
    pub on_start: &'a mut dyn FnMut(Time),
}
