//! The seam between a chain of servos and whoever speaks the protocol: registers and bytes, no angles.

use crate::base::Time;
use crate::bus::port::PortError;
use handwave_dynamixel::ErrorCode;
use handwave_dynamixel::instruction::{Backup, BulkReadEntry, BulkWriteEntry, FactoryReset};
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
    #[error("servo {id} refused: {error} ({})", meaning(*error))]
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
    /// A bulk instruction names a servo twice.
    #[error("servo {id} stands twice in one bulk instruction; a servo takes part once")]
    TwiceInList {
        /// The servo.
        id: u8,
    },
    /// Protocol 1.0 has no such thing.
    #[error("servo {id} speaks Protocol 1.0, in which one cannot {what}")]
    NotInProtocolOne {
        /// Who was asked.
        id: u8,
        /// What was asked, and what to do instead.
        what: &'static str,
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

/// What an error code of a servo says about the request, for the reader.
pub const fn meaning(error: ErrorCode) -> &'static str {
    match error {
        ErrorCode::None => "done",
        ErrorCode::ResultFail => {
            "it cannot do that now: moving, torque on, or not allowed to all at once"
        }
        ErrorCode::Instruction => {
            "its firmware does not know the instruction, or an action came without a held write"
        }
        ErrorCode::Crc => "the request reached it damaged",
        ErrorCode::DataRange => {
            "a value is out of the register's range, or its bus watchdog has tripped (bus_watchdog reads -1)"
        }
        ErrorCode::DataLength => "too few bytes for the register",
        ErrorCode::DataLimit => "a value is beyond a limit that another register sets",
        ErrorCode::Access => {
            "the register is read-only or does not exist, or keeps its value without power and torque is on"
        }
        ErrorCode::Other(_) => "the manual does not list this code",
    }
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

/// Somebody who speaks to the servos of one line, by Protocol 2.0 or 1.0.
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
    /// How late beyond its wire time an answer comes as a rule: return delay, and a turn of adapter and
    /// system as measured.
    fn lateness(&self) -> Duration {
        self.patience()
    }
    /// What is worth telling of the port, such as a setting of its adapter that costs time.
    fn notes(&self) -> &[String] {
        &[]
    }
    /// Names under which a lost port may be found; see [`Port::candidates`](crate::bus::Port::candidates).
    fn port_candidates(&self) -> Vec<String> {
        Vec::new()
    }
    /// What a lost port is recognised by, for messages.
    fn port_sought(&self) -> String {
        self.port_name().to_owned()
    }
    /// Opens the port `name` in place of the one it has.
    fn reopen_port(&mut self, name: &str) -> Result<(), ClientError> {
        let _ = name;
        Err(self.unsupported("open a lost port again"))
    }
    /// Lets go of the port until it is reopened.
    fn close_port(&mut self) {}
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
    /// The same, given up at `latest` at the latest.
    fn read_by(
        &mut self,
        id: u8,
        address: u16,
        data: &mut [u8],
        latest: Time,
    ) -> Result<Reply, ClientError> {
        let _ = latest;
        self.read(id, address, data)
    }
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

    /// Name of this driver, for messages.
    fn backend(&self) -> &'static str {
        "handwave"
    }
    /// Hands a servo a write that it holds until [`action`](Self::action).
    fn reg_write(&mut self, id: u8, address: u16, data: &[u8]) -> Result<Reply, ClientError> {
        let _ = (id, address, data);
        Err(self.unsupported("hold a write until an action"))
    }
    /// Lets a servo carry out the write that it holds; by the broadcast id all at the same instant.
    fn action(&mut self, id: u8) -> Result<Reply, ClientError> {
        let _ = id;
        Err(self.unsupported("start held writes"))
    }
    /// Sets the whole turns of the present position to zero. Refused while the servo moves.
    fn clear_multi_turn(&mut self, id: u8) -> Result<Reply, ClientError> {
        let _ = id;
        Err(self.unsupported("clear turns"))
    }
    /// Stores the control table in the servo, or restores it, whereupon it restarts. Needs torque off and a
    /// firmware that has it.
    fn back_up(&mut self, id: u8, what: Backup) -> Result<Reply, ClientError> {
        let _ = (id, what);
        Err(self.unsupported("back control tables up"))
    }
    /// Back to the settings of the factory; the servo restarts.
    fn factory_reset(&mut self, id: u8, what: FactoryReset) -> Result<Reply, ClientError> {
        let _ = (id, what);
        Err(self.unsupported("reset servos to factory settings"))
    }
    /// Writes to registers of its own of each servo, an id at most once; nobody answers.
    fn bulk_write(&mut self, entries: &[BulkWriteEntry<'_>]) -> Result<(), ClientError> {
        let _ = entries;
        Err(self.unsupported("write in bulk"))
    }
    /// Reads registers of its own from each servo, an id at most once, one answer each.
    ///
    /// `data` takes their bytes one after the other, in the order of `entries`.
    fn bulk_read(
        &mut self,
        entries: &[BulkReadEntry],
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError> {
        let _ = (entries, data, outcomes);
        Err(self.unsupported("read in bulk"))
    }
    /// Like [`bulk_read`](Self::bulk_read), one combined answer. A driver without fast reads uses an
    /// ordinary one.
    fn fast_bulk_read(
        &mut self,
        entries: &[BulkReadEntry],
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError> {
        self.bulk_read(entries, data, outcomes)
    }
    /// The error of a driver that cannot do `what`.
    fn unsupported(&self, what: &'static str) -> ClientError {
        ClientError::Unsupported {
            backend: self.backend(),
            what,
        }
    }
}
