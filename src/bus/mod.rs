//! Servo buses: what carries targets to servos and states back.
//!
//! [`port`] is the seam to the wire (serial port, simulated line), [`dynamixel`] speaks the
//! protocol over it, [`ServoBus`] is all that the live loop knows.

pub mod address;
pub mod dynamixel;
mod no_servos;
pub mod port;
pub mod serial;
pub mod tap;

use crate::base::{JointState, Time};
pub use address::{AddressError, BusAddress, DynamixelBackend};
pub use no_servos::NoServos;
pub use port::{Port, PortError};
pub use serial::SerialPort;

/// A chain of servos that takes one target and gives one state per joint and cycle.
///
/// Joint order is fixed when the bus is built (that of the configuration's joint map); slices in
/// the calls below have one entry per joint in that order. Positions are joint coordinates:
/// zero, direction and scale of each servo are applied inside.
pub trait ServoBus: Send {
    /// Joint names, in the order of the slices below.
    fn joints(&self) -> &[String];

    /// Finds every servo, checks model, mode and settings, and reads all present positions.
    ///
    /// Changes no torque. Fails when a servo is absent, of another model, latched in an error or
    /// outside its declared range, and names it and what to do.
    fn prepare(&mut self, states: &mut [JointState]) -> Result<(), BusError>;

    /// Makes the present position the goal of every servo, then turns torque on and reads it back.
    fn arm(&mut self) -> Result<(), BusError>;

    /// Where the goal of every servo stands, rad: after [`ServoBus::arm`] the position it was armed at,
    /// from which a ramp has to begin.
    fn goals(&self, out_rad: &mut [f64]);

    /// One control cycle: sends `targets_rad`, reads effort, velocity and position back.
    ///
    /// A servo that did not answer keeps its old state (its `measured_at` tells) and is counted in
    /// the report; only a lost bus is an error. Allocates nothing after the first call.
    fn exchange(
        &mut self,
        targets_rad: &[f64],
        states: &mut [JointState],
    ) -> Result<CycleReport, BusError>;

    /// Turns torque off on every servo and reads it back, as far as servos answer.
    ///
    /// Safe to call in any state and more than once.
    fn torque_off(&mut self) -> Result<TorqueReport, BusError>;

    /// Takes one servo that lost its torque back into control: goal at its present position,
    /// torque on, from there ramped to its target by the following [`exchange`](Self::exchange) calls.
    ///
    /// Takes a few milliseconds of bus time. Fails while a hardware error is latched: reboot it first.
    fn rearm(&mut self, joint: usize) -> Result<(), BusError>;

    /// Restarts one servo, which clears a latched hardware error. Its torque is off afterwards.
    ///
    /// Returns at once; the servo is silent for about half a second, then shows up in
    /// [`CycleReport::torqueless_mask`] and can be rearmed.
    fn reboot(&mut self, joint: usize) -> Result<(), BusError>;

    /// What is known of each servo itself, in joint order, after [`prepare`](Self::prepare). Empty for a bus without servos.
    fn facts(&self) -> &[ServoFacts] {
        &[]
    }

    /// How each servo is, in joint order: read in turn, one servo in some cycles, where the cycle has room.
    /// Empty for a bus without servos.
    fn health(&self) -> &[ServoHealth] {
        &[]
    }

    /// Looks for a lost bus once more, also under another name of its port (by serial number, or by the
    /// ids that answer), and opens it. Changes no torque: [`prepare`](Self::prepare) and
    /// [`arm`](Self::arm) follow when the operator wants it.
    ///
    /// Fails, at once or after some tenths of a second, while it is not there.
    fn reopen(&mut self) -> Result<(), BusError> {
        Ok(())
    }

    /// What [`prepare`](Self::prepare) found worth telling the user though it stops nothing, such
    /// as a setting that costs bus time, with what to do.
    fn notes(&self) -> &[String] {
        &[]
    }
}

/// What is known of one servo after [`ServoBus::prepare`]: what it is, and what it bears.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ServoFacts {
    /// Its id on its bus.
    pub id: u8,
    /// Its model, such as `xl430-w250`.
    pub model: String,
    /// The bus it hangs on, as written on the command line.
    pub bus: String,
    /// Above this it switches itself off, degrees Celsius.
    pub temperature_limit_c: Option<f64>,
    /// Least and greatest supply voltage that it bears, volts.
    pub voltage_range_v: Option<(f64, f64)>,
    /// The effort that it can give for long, in the unit of [`JointState::effort`].
    pub effort_limit: Option<f64>,
    /// After how long without an instruction it stops by itself, seconds; `None` when it does not.
    pub watchdog_s: Option<f64>,
}

/// How a servo is, beside its motion: read now and then.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct ServoHealth {
    /// Temperature, degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Supply voltage, volts.
    pub voltage_v: Option<f64>,
    /// Hardware error status (register 70) or the drive's error code; 0 is none.
    pub hardware_error: u32,
    /// When this was read, on the clock of the bus; `None` before the first time.
    pub measured_at: Option<Time>,
}

/// What one [`ServoBus::exchange`] saw.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub struct CycleReport {
    /// Servos whose state is new in this cycle.
    pub fresh: u16,
    /// Servos that were asked and did not answer validly.
    pub silent: u16,
    /// Bit per joint index (first 64): asked or due this cycle, and no valid answer came.
    pub silent_mask: u64,
    /// Bit per joint index (first 64): the servo's answer carried the alert flag (hardware error latched).
    pub alert_mask: u64,
    /// Bit per joint index (first 64): the servo came back without torque (reboot, unplugged). It is
    /// read and not driven until it is rearmed.
    pub torqueless_mask: u64,
    /// Bit per joint index (first 64): the servo was silent and is back; its goal is on the way from where
    /// it was found to its target, at a bounded rate.
    pub ramping_mask: u64,
    /// Damaged frames, wrong checksums and stray bytes seen.
    pub damaged: u16,
    /// Bytes sent and received, for the wire budget.
    pub bytes: u32,
    /// Time from the first byte handed out to the last reply (or given up), in microseconds.
    pub cycle_us: u32,
    /// Time from the call to the last goal byte handed to the port, in microseconds.
    pub goal_sent_us: u32,
}

/// Torque state read back after switching it off.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TorqueReport {
    /// Joints whose servo confirmed that torque is off.
    pub confirmed_off: Vec<String>,
    /// Joints whose servo did not confirm, with the reason.
    pub unconfirmed: Vec<(String, String)>,
}

/// Why a bus could not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The port failed: the bus is lost until it is opened again.
    #[error(transparent)]
    Port(#[from] PortError),
    /// A servo that the configuration names does not answer.
    #[error(
        "servo {id} (joint {joint}) does not answer on {port} at {baud} baud. \
         Check its power, cable and id; `handwave bus scan {bus}` lists the servos that answer"
    )]
    Absent {
        /// Servo id.
        id: u8,
        /// Joint name.
        joint: String,
        /// Port name.
        port: String,
        /// Baud rate.
        baud: u32,
        /// The bus as written on the command line.
        bus: String,
    },
    /// A servo answered with an error, or is not what the configuration says.
    #[error("servo {id} (joint {joint}): {problem}. {advice}")]
    Servo {
        /// Servo id.
        id: u8,
        /// Joint name, empty when no configuration is loaded.
        joint: String,
        /// What was found and what was expected.
        problem: String,
        /// What to do.
        advice: String,
    },
    /// No servo answered for so long that the bus counts as lost.
    #[error(
        "no servo on {port} has answered for {silence_ms} ms. \
         Check power and cable of the chain, then start again"
    )]
    Lost {
        /// Port name.
        port: String,
        /// How long nobody answered.
        silence_ms: u32,
    },
}
