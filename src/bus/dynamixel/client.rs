//! The seam between a chain of servos and whoever speaks the protocol: registers and bytes, no angles.

use crate::base::Time;
use crate::bus::port::PortError;
use handwave_dynamixel::ErrorCode;
use std::time::Duration;

/// A servo's answer to a ping.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Ping {
    /// Servo id.
    pub id: u8,
    /// Model number (register 0).
    pub model: u16,
    /// Firmware version (register 6).
    pub firmware: u8,
    /// A hardware error is latched.
    pub alert: bool,
}

/// What comes beside the data of a valid answer.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub struct Reply {
    /// A hardware error is latched (register 70 says which); the instruction was carried out all the same.
    pub alert: bool,
}

/// What became of one servo in a read of several.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub enum Outcome {
    /// Its data is new.
    Fresh(Reply),
    /// It answered with an error and no data.
    Refused(ErrorCode),
    /// Something came in its place that cannot be used.
    Damaged,
    /// It was its turn and nothing came.
    Silent,
    /// The exchange ended before its turn.
    #[default]
    NotReached,
}

/// Why a servo could not be asked.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The port failed.
    #[error(transparent)]
    Port(#[from] PortError),
    /// No answer in time.
    #[error("servo {id} did not answer within {waited_us} us")]
    Timeout {
        /// Who was asked.
        id: u8,
        /// How long it was waited for.
        waited_us: u64,
    },
    /// The servo answered that it did not do it.
    #[error("servo {id} refused: {error}")]
    Refused {
        /// Who answered.
        id: u8,
        /// The code in its answer.
        error: ErrorCode,
    },
    /// The answer has another length than the data asked for.
    #[error("servo {id} answered with {found} bytes, expected {expected}")]
    AnswerLength {
        /// Who answered.
        id: u8,
        /// Bytes asked for.
        expected: usize,
        /// Bytes received.
        found: usize,
    },
    /// The request is longer than the driver's buffer.
    #[error("a request of {bytes} bytes or more is too long, at most {limit} are possible")]
    TooLong {
        /// Bytes of the request, at least.
        bytes: usize,
        /// Most bytes possible.
        limit: usize,
    },
    /// This driver cannot do it.
    #[error("the {backend} backend cannot {what}")]
    Unsupported {
        /// Name of the driver.
        backend: &'static str,
        /// What was asked.
        what: &'static str,
    },
}

/// Counters since the client was made.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Bytes sent.
    pub sent: u64,
    /// Bytes received.
    pub received: u64,
    /// Received bytes and frames that were of no use: noise, wrong checksums, unexpected senders.
    pub damaged: u64,
}

/// Somebody who speaks Protocol 2.0 to the servos of one line.
///
/// Reads of several servos take one buffer for all data, `length` bytes per id in the order of
/// `ids`, and one [`Outcome`] per id; data of a servo that is not fresh is left as it was.
pub trait Client: Send {
    /// Name of the port, for messages.
    fn port_name(&self) -> &str;
    /// Bits per second of this end of the line.
    fn baud(&self) -> u32;
    /// Sets the rate of this end of the line.
    fn set_baud(&mut self, baud: u32) -> Result<(), ClientError>;
    /// The time now.
    fn now(&self) -> Time;
    /// Counters since the client was made.
    fn traffic(&self) -> Traffic;
    /// Tells the largest return delay (register 9) of the servos, which every wait has to allow for.
    fn set_return_delay(&mut self, delay: Duration);
    /// How long beyond its wire time an answer is waited for at present.
    fn patience(&self) -> Duration;
    /// Tells when the control cycle ends, or that none is on. Within a cycle a late answer is waited
    /// for as long as the servos behind it could still be asked again: that time has no other use.
    fn set_cycle_end(&mut self, end: Option<Time>) {
        let _ = end;
    }

    /// Throws away what comes in until nothing came for `quiet`, at most ten times that long: an answer
    /// that was given up must not be taken for that to the next request.
    fn settle(&mut self, quiet: Duration) -> Result<(), ClientError> {
        let _ = quiet;
        Ok(())
    }

    /// Asks one servo who it is.
    fn ping(&mut self, id: u8) -> Result<Ping, ClientError>;
    /// Asks all servos who they are, about a second at 1 Mbaud, and hands over who answered.
    fn ping_all(&mut self, found: &mut dyn FnMut(Ping)) -> Result<(), ClientError>;
    /// Reads `data.len()` bytes from `address`.
    fn read(&mut self, id: u8, address: u16, data: &mut [u8]) -> Result<Reply, ClientError>;
    /// Writes `data` to `address`. To the broadcast id nobody answers, and the call returns at once.
    fn write(&mut self, id: u8, address: u16, data: &[u8]) -> Result<Reply, ClientError>;
    /// Restarts a servo.
    fn reboot(&mut self, id: u8) -> Result<Reply, ClientError>;
    /// Writes `length` bytes to `address` of each servo; nobody answers. `data` holds those of all.
    fn sync_write(
        &mut self,
        address: u16,
        length: u16,
        ids: &[u8],
        data: &[u8],
    ) -> Result<(), ClientError>;
    /// Reads `length` bytes from `address` of each servo, one answer each.
    fn sync_read(
        &mut self,
        address: u16,
        length: u16,
        ids: &[u8],
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError>;
    /// Reads `length` bytes from `address` of each servo, one combined answer.
    ///
    /// A driver that has no fast reads uses an ordinary sync read.
    fn fast_sync_read(
        &mut self,
        address: u16,
        length: u16,
        ids: &[u8],
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError>;
}
