//! While the bus is away: it is looked for at a low rate, looked at again when it is back, and armed when the
//! operator wants it. Nothing moves meanwhile.

use super::cycles::Run;
use crate::base::Time;
use crate::bus::{BusError, CycleReport};
use crate::config::file::OnBusLost;
use crate::live::stop::StopRequest;
use std::time::Duration;

/// How the loop stands to the bus.
#[derive(Debug)]
pub(super) enum Wire {
    /// Goals are sent.
    Driven,
    /// It is lost, for this reason.
    Lost {
        /// Why.
        error: BusError,
        /// When it is looked for next.
        try_at: Time,
    },
    /// It is back, torque off: states are read, nothing is sent.
    Waiting {
        /// Why it was lost.
        error: BusError,
    },
}

/// The time from one look for a lost bus to the next.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// A servo said no or is missing: the line itself is not lost.
fn is_refusal(error: &BusError) -> bool {
    matches!(error, BusError::Servo { .. } | BusError::Absent { .. })
}

impl Run<'_, '_> {
    /// Takes note of a lost bus, or gives the error back when the policy is to end.
    pub(super) fn lose(&mut self, error: BusError) -> Result<(), BusError> {
        if is_refusal(&error) || self.options.on_bus_lost == OnBusLost::Exit {
            self.supervisor.lost();
            self.note_changes();
            return Err(error);
        }
        self.supervisor.lost();
        self.note_changes();
        let _ = self.parts.stop.take_rearm();
        self.wire = Wire::Lost {
            error,
            try_at: self.parts.clock.now() + LOOK_EVERY,
        };
        Ok(())
    }

    /// One cycle with the bus away or back and not armed.
    pub(super) fn wait_for_bus(&mut self, now: Time) -> CycleReport {
        match std::mem::replace(&mut self.wire, Wire::Driven) {
            Wire::Driven => CycleReport::default(),
            Wire::Lost { error, try_at } => {
                self.wire = if self.parts.clock.now() < try_at {
                    Wire::Lost { error, try_at }
                } else {
                    self.look_for_bus(error)
                };
                CycleReport::default()
            }
            Wire::Waiting { error } => self.wait_for_operator(error, now),
        }
    }

    fn look_for_bus(&mut self, error: BusError) -> Wire {
        let found = self
            .parts
            .bus
            .reopen()
            .and_then(|()| self.parts.bus.prepare(&mut self.states))
            // It may have lost its power or not: in any case nothing holds torque that we do not drive.
            .and_then(|()| self.parts.bus.torque_off());
        match found {
            Ok(_) => {
                self.supervisor.found(self.parts.bus.facts());
                let _ = self.parts.stop.take_rearm();
                Wire::Waiting { error }
            }
            Err(newer) => Wire::Lost {
                // That a servo refuses is what somebody can mend; that nothing is there is known.
                error: if is_refusal(&newer) { newer } else { error },
                try_at: self.parts.clock.now() + LOOK_EVERY,
            },
        }
    }

    fn wait_for_operator(&mut self, error: BusError, now: Time) -> CycleReport {
        let asked = self.parts.stop.take_rearm();
        if self.supervisor.arms(asked) && self.parts.bus.arm().is_ok() {
            self.parts.bus.goals(&mut self.goals);
            self.parts.puppet.begin_again(now, &self.goals);
            self.supervisor.armed();
            self.note_changes();
            self.wire = Wire::Driven;
            return CycleReport::default();
        }
        let goals = &self.parts.puppet.targets().positions;
        match self.parts.bus.exchange(goals, &mut self.states) {
            Ok(report) => {
                self.wire = Wire::Waiting { error };
                report
            }
            Err(_) => {
                self.supervisor.lost();
                self.wire = Wire::Lost {
                    error,
                    try_at: self.parts.clock.now() + LOOK_EVERY,
                };
                CycleReport::default()
            }
        }
    }

    /// Why the bus is away, if it is.
    pub(super) fn outage_error(&mut self) -> Option<BusError> {
        match std::mem::replace(&mut self.wire, Wire::Driven) {
            Wire::Driven => None,
            Wire::Lost { error, .. } | Wire::Waiting { error } => Some(error),
        }
    }

    /// The operator wants the end, and there is nothing to lead into an end pose.
    pub(super) fn stops_while_lost(&self) -> bool {
        !matches!(self.wire, Wire::Driven) && self.parts.stop.request() != StopRequest::None
    }

    /// Whether somebody has to ask for a re-arm.
    pub(super) fn waits(&self) -> bool {
        matches!(self.wire, Wire::Waiting { .. }) || self.supervisor.waits()
    }

    /// Keeps all joints where they were read: what is lost is not led anywhere.
    pub(super) fn stay_where_found(&mut self) {
        for (joint, state) in self.states.iter().enumerate() {
            self.parts.puppet.leave_out(joint, state.position);
        }
    }
}
