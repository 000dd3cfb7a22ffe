//! What a host asks of servos by Protocol 1.0, typed: every instruction, for both ends of the line.

use super::frame::{Frame, FrameWriter};
use super::status::Errors;
use crate::frame::BufferTooSmall;
use core::fmt;

/// Instruction bytes.
pub mod code {
    /// Ping.
    pub const PING: u8 = 0x01;
    /// Read.
    pub const READ: u8 = 0x02;
    /// Write.
    pub const WRITE: u8 = 0x03;
    /// Reg Write.
    pub const REG_WRITE: u8 = 0x04;
    /// Action.
    pub const ACTION: u8 = 0x05;
    /// Factory Reset.
    pub const FACTORY_RESET: u8 = 0x06;
    /// Reboot.
    pub const REBOOT: u8 = 0x08;
    /// Sync Write.
    pub const SYNC_WRITE: u8 = 0x83;
    /// Bulk Read.
    pub const BULK_READ: u8 = 0x92;
}

/// One instruction.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Instruction<'a> {
    /// Answered with a status without parameters; the model number is read from register 0.
    Ping,
    /// Reads `length` bytes from `address`.
    Read {
        /// First register.
        address: u8,
        /// Bytes.
        length: u8,
    },
    /// Writes `data` to `address`.
    Write {
        /// First register.
        address: u8,
        /// Bytes to write.
        data: &'a [u8],
    },
    /// Holds a write until [`Instruction::Action`].
    RegWrite {
        /// First register.
        address: u8,
        /// Bytes to write.
        data: &'a [u8],
    },
    /// Carries out the held write.
    Action,
    /// Back to factory settings, id 1 among them.
    FactoryReset,
    /// Restarts the servo. The MX class knows it, the AX class does not.
    Reboot,
    /// Writes to the same registers of several servos; not answered.
    SyncWrite(SyncWrite<'a>),
    /// One status from each servo asked, in order. The MX class knows it, the AX class does not.
    BulkRead(BulkRead<'a>),
}

/// Parameters of a sync write: what is written where, for each servo.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct SyncWrite<'a> {
    /// First register.
    pub address: u8,
    /// Bytes for each servo, at least 1.
    pub length: u8,
    /// Whole entries of 1 + `length` bytes: id and data.
    entries: &'a [u8],
}

impl<'a> SyncWrite<'a> {
    /// Servo ids and their data.
    pub fn iter(&self) -> impl Iterator<Item = (u8, &'a [u8])> + use<'a> {
        self.entries
            .chunks_exact(1 + usize::from(self.length))
            .filter_map(|entry| entry.split_first())
            .map(|(&id, data)| (id, data))
    }
}

/// One entry of a bulk read.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct BulkReadEntry {
    /// Servo id.
    pub id: u8,
    /// First register.
    pub address: u8,
    /// Bytes.
    pub length: u8,
}

/// Parameters of a bulk read.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct BulkRead<'a> {
    /// Whole entries of three bytes: length, id, address.
    entries: &'a [u8],
}

impl<'a> BulkRead<'a> {
    /// What is asked of whom, in the order of answering.
    pub fn iter(&self) -> impl Iterator<Item = BulkReadEntry> + use<'a> {
        self.entries.chunks_exact(3).map(|entry| BulkReadEntry {
            length: entry[0],
            id: entry[1],
            address: entry[2],
        })
    }
}

/// Why a frame is not an instruction that makes sense.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum InstructionError {
    /// No instruction has this code.
    Unknown {
        /// The instruction byte.
        code: u8,
    },
    /// The parameters have a length that the instruction cannot have.
    Length {
        /// The instruction byte.
        code: u8,
        /// Length of the parameters.
        found: usize,
    },
    /// A bulk read that does not begin with 0.
    Lead {
        /// What it begins with.
        found: u8,
    },
}

impl InstructionError {
    /// The error bits that a servo answers with.
    pub const fn errors(self) -> Errors {
        match self {
            InstructionError::Unknown { .. } => Errors(Errors::INSTRUCTION),
            InstructionError::Length { .. } | InstructionError::Lead { .. } => {
                Errors(Errors::RANGE)
            }
        }
    }
}

impl fmt::Display for InstructionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            InstructionError::Unknown { code } => write!(f, "unknown instruction {code:#04X}"),
            InstructionError::Length { code, found } => write!(
                f,
                "instruction {code:#04X} cannot have {found} parameter bytes"
            ),
            InstructionError::Lead { found } => {
                write!(f, "a bulk read begins with {found:#04X}, expected 0x00")
            }
        }
    }
}

impl core::error::Error for InstructionError {}

impl<'a> Instruction<'a> {
    /// Reads a frame as an instruction. Its addressee is the frame's id.
    pub fn parse(frame: &Frame<'a>) -> Result<Self, InstructionError> {
        let (code, params) = (frame.code, frame.params);
        let length = InstructionError::Length {
            code,
            found: params.len(),
        };
        match (code, params) {
            (code::PING, []) => Ok(Instruction::Ping),
            (code::ACTION, []) => Ok(Instruction::Action),
            (code::FACTORY_RESET, []) => Ok(Instruction::FactoryReset),
            (code::REBOOT, []) => Ok(Instruction::Reboot),
            (code::READ, &[address, length]) => Ok(Instruction::Read { address, length }),
            (code::WRITE, &[address, ref data @ ..]) => Ok(Instruction::Write { address, data }),
            (code::REG_WRITE, &[address, ref data @ ..]) => {
                Ok(Instruction::RegWrite { address, data })
            }
            (code::SYNC_WRITE, &[address, data_len, ref entries @ ..])
                if data_len > 0 && entries.len().is_multiple_of(1 + usize::from(data_len)) =>
            {
                Ok(Instruction::SyncWrite(SyncWrite {
                    address,
                    length: data_len,
                    entries,
                }))
            }
            (code::BULK_READ, [0, entries @ ..]) if entries.len().is_multiple_of(3) => {
                Ok(Instruction::BulkRead(BulkRead { entries }))
            }
            (code::BULK_READ, &[found, ..]) if found != 0 => Err(InstructionError::Lead { found }),
            (
                code::PING..=code::FACTORY_RESET
                | code::REBOOT
                | code::SYNC_WRITE
                | code::BULK_READ,
                _,
            ) => Err(length),
            _ => Err(InstructionError::Unknown { code }),
        }
    }

    /// The instruction byte.
    pub const fn code(&self) -> u8 {
        match self {
            Instruction::Ping => code::PING,
            Instruction::Read { .. } => code::READ,
            Instruction::Write { .. } => code::WRITE,
            Instruction::RegWrite { .. } => code::REG_WRITE,
            Instruction::Action => code::ACTION,
            Instruction::FactoryReset => code::FACTORY_RESET,
            Instruction::Reboot => code::REBOOT,
            Instruction::SyncWrite(_) => code::SYNC_WRITE,
            Instruction::BulkRead(_) => code::BULK_READ,
        }
    }

    /// Writes the instruction to `id` into `buf` and returns the frame's bytes.
    ///
    /// Sync write and bulk read go to [`super::BROADCAST_ID`].
    pub fn encode<'b>(&self, id: u8, buf: &'b mut [u8]) -> Result<&'b [u8], BufferTooSmall> {
        let mut writer = FrameWriter::new(buf, id, self.code());
        match *self {
            Instruction::Ping
            | Instruction::Action
            | Instruction::FactoryReset
            | Instruction::Reboot => {}
            Instruction::Read { address, length } => writer.extend(&[address, length]),
            Instruction::Write { address, data } | Instruction::RegWrite { address, data } => {
                writer.push(address);
                writer.extend(data);
            }
            Instruction::SyncWrite(SyncWrite {
                address,
                length,
                entries,
            }) => {
                writer.extend(&[address, length]);
                writer.extend(entries);
            }
            Instruction::BulkRead(BulkRead { entries }) => {
                writer.push(0);
                writer.extend(entries);
            }
        }
        writer.finish()
    }
}
