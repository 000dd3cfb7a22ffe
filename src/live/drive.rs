//! Moves servos without a puppet: from where they stand, through the envelope, torque off on every way out.

use crate::base::{Clock, JointState, Time};
use crate::bus::{BusError, CycleReport, ServoBus, TorqueReport};
use crate::robot::{Envelope, JointEnvelope};
use std::sync::Arc;
use std::time::Duration;

/// A servo that stays silent for longer than this ends a drive.
const SILENT_FOR: Duration = Duration::from_millis(500);

/// Why a drive stopped. Torque is off by then, as far as servos answer.
#[derive(Debug, thiserror::Error)]
pub enum DriveError {
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// A servo latched a hardware error.
    #[error(
        "{joint} reports a hardware error: stopped. `handwave bus monitor BUS` names it; \
         remove the cause, then `handwave bus reboot BUS ID`"
    )]
    Alert {
        /// Joint.
        joint: String,
    },
    /// A servo lost its torque.
    #[error(
        "{joint} has no torque any more (it rebooted, or was unplugged): stopped. Check its supply and cable"
    )]
    Torqueless {
        /// Joint.
        joint: String,
    },
    /// A servo is silent.
    #[error("{joint} has not answered for half a second: stopped. Check its cable")]
    Silent {
        /// Joint.
        joint: String,
    },
}

impl DriveError {
    /// Whether the servos stopped it, rather than the bus.
    pub fn is_safety_stop(&self) -> bool {
        matches!(self, Self::Alert { .. } | Self::Torqueless { .. })
    }
}

/// Servos under way, or read only. Dropped in any way, a panic included, it turns torque off that it turned on.
pub struct Drive {
    bus: Box<dyn ServoBus>,
    clock: Arc<dyn Clock>,
    envelope: Envelope,
    states: Vec<JointState>,
    goals: Vec<f64>,
    period: Duration,
    next: Time,
    armed: bool,
    /// Readings that were missed, all joints and cycles.
    pub missed: u64,
}

impl Drive {
    /// Reads where all servos stand; changes no torque. `limits` and the positions of all calls below are in the joint
    /// order of `bus`, rad; `rate_hz` cycles a second.
    ///
    /// # Errors
    /// As [`ServoBus::prepare`].
    pub fn begin(
        mut bus: Box<dyn ServoBus>,
        clock: Arc<dyn Clock>,
        limits: Vec<JointEnvelope>,
        rate_hz: f64,
    ) -> Result<Self, DriveError> {
        let count = bus.joints().len();
        let mut states = vec![JointState::default(); count];
        bus.prepare(&mut states)?;
        let goals: Vec<f64> = states.iter().map(|state| state.position).collect();
        let mut envelope = Envelope::new(limits, 1.0 / rate_hz);
        envelope.start(&goals);
        Ok(Self {
            next: clock.now(),
            bus,
            clock,
            envelope,
            states,
            goals,
            period: Duration::from_secs_f64(1.0 / rate_hz),
            armed: false,
            missed: 0,
        })
    }

    /// Joint names.
    pub fn joints(&self) -> &[String] {
        self.bus.joints()
    }

    /// Notes of the bus that are worth telling.
    pub fn notes(&self) -> &[String] {
        self.bus.notes()
    }

    /// Turns torque on, every goal at the present position.
    ///
    /// # Errors
    /// As [`ServoBus::arm`]; torque is off again then.
    pub fn arm(&mut self) -> Result<(), DriveError> {
        self.armed = true;
        self.bus.arm()?;
        self.bus.goals(&mut self.goals);
        self.envelope.start(&self.goals);
        self.next = self.clock.now();
        Ok(())
    }

    /// Measured positions, rad.
    pub fn positions(&self) -> impl Iterator<Item = f64> + '_ {
        self.states.iter().map(|state| state.position)
    }

    /// The goals last sent, after the envelope, rad.
    pub fn goals(&self) -> &[f64] {
        &self.goals
    }

    /// When the present cycle began.
    pub fn now(&self) -> Time {
        self.next
    }

    /// One cycle at its time: `wanted` passes the envelope and goes out where torque was turned on, states come back.
    ///
    /// # Errors
    /// A lost bus, a servo with a latched error, without torque, or silent for half a second.
    pub fn step(&mut self, wanted: &[f64]) -> Result<CycleReport, DriveError> {
        self.next = (self.next + self.period).max(self.clock.now() - self.period);
        self.clock.sleep_until(self.next);
        if self.armed {
            self.envelope.pass(wanted, &mut self.goals);
        }
        let report = self.bus.exchange(&self.goals, &mut self.states)?;
        self.missed += u64::from(report.silent);
        let named = |mask: u64| -> Option<String> {
            let index = mask.trailing_zeros() as usize;
            self.bus.joints().get(index).cloned()
        };
        if self.armed {
            if let Some(joint) = named(report.alert_mask) {
                return Err(DriveError::Alert { joint });
            }
            if let Some(joint) = named(report.torqueless_mask) {
                return Err(DriveError::Torqueless { joint });
            }
        }
        let now = self.clock.now();
        let late = |state: &JointState| {
            (state.measured_at).is_none_or(|at| now.saturating_since(at) > SILENT_FOR)
        };
        if let Some(index) = self.states.iter().position(late) {
            let joint = self.bus.joints()[index].clone();
            return Err(DriveError::Silent { joint });
        }
        Ok(report)
    }

    /// Whether every goal stands at `wanted`, within a hundredth of a degree.
    pub fn arrived(&self, wanted: &[f64]) -> bool {
        let near = |(goal, wanted): (&f64, &f64)| (goal - wanted).abs() < 2e-4;
        self.goals.iter().zip(wanted).all(near)
    }

    /// Turns torque off and reads it back.
    ///
    /// # Errors
    /// The bus is lost.
    pub fn finish(mut self) -> Result<TorqueReport, DriveError> {
        self.armed = false;
        Ok(self.bus.torque_off()?)
    }

    /// Ends with torque on where it is on.
    pub fn leave_holding(mut self) {
        self.armed = false;
    }
}

impl Drop for Drive {
    fn drop(&mut self) {
        if self.armed {
            // Whatever went wrong is being told already.
            let _ = self.bus.torque_off();
        }
    }
}
