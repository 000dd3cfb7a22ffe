//! The seam to the wire: a half-duplex byte port with deadlines.

use crate::base::Time;
use std::time::Duration;

/// Why a port failed. Any of these means that the bus is lost until the port is opened again.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// The port could not be opened.
    #[error("cannot open {port}: {reason}. {advice}")]
    Open {
        /// Path or name of the port.
        port: String,
        /// What the system said.
        reason: String,
        /// What to check next.
        advice: String,
    },
    /// The other end is gone: adapter unplugged, simulator ended.
    #[error(
        "{port} is gone: {reason}. Check that the adapter is plugged in (or the simulator runs) and start again"
    )]
    Gone {
        /// Path or name of the port.
        port: String,
        /// What the system said.
        reason: String,
    },
    /// The port refuses a baud rate.
    #[error("{port} cannot be set to {baud} baud: {reason}")]
    Baud {
        /// Path or name of the port.
        port: String,
        /// The rate that was asked for.
        baud: u32,
        /// What the system said.
        reason: String,
    },
}

/// A half-duplex byte port that knows the time.
///
/// Time comes from the port so that one driver runs on a real serial port in real time and on a
/// simulated line in virtual time: on the latter, waiting for a deadline moves the clock.
pub trait Port: Send {
    /// Name for messages, such as `/dev/ttyUSB0` or `sim`.
    fn name(&self) -> &str;
    /// Bits per second; a byte takes ten bit times.
    fn baud(&self) -> u32;
    /// Sets the rate of this end of the line.
    fn set_baud(&mut self, baud: u32) -> Result<(), PortError>;
    /// The time now, on the clock that the deadlines below refer to.
    fn now(&self) -> Time;
    /// Hands all bytes to the wire. May return before the last one has left.
    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError>;
    /// Waits until at least `want` bytes are in `buf` (at most `buf.len()`) or the deadline has passed.
    ///
    /// Returns how many bytes were put into `buf`, 0 when none came before the deadline; silence
    /// is not an error.
    fn read(&mut self, buf: &mut [u8], want: usize, deadline: Time) -> Result<usize, PortError>;
    /// Throws away what was received and not yet read.
    fn discard_input(&mut self) -> Result<(), PortError>;
    /// How long an adapter keeps received bytes back before it sends them on, where it has such a timer.
    fn latency_timer(&self) -> Option<Duration> {
        None
    }
}

/// Puts something around each port as it is opened, such as a tap that records its bytes: takes the
/// bus as written and its port, returns the port that is used.
pub type WrapPort<'a> = &'a mut dyn FnMut(&str, Box<dyn Port>) -> Box<dyn Port>;

/// Leaves ports as they are.
pub fn bare(_bus: &str, port: Box<dyn Port>) -> Box<dyn Port> {
    port
}
