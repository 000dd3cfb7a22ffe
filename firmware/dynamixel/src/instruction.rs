//! What a host asks of servos, typed: every instruction, for both ends of the line.

use crate::frame::{BufferTooSmall, Frame, FrameWriter};
use crate::status::ErrorCode;
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
    /// Clear.
    pub const CLEAR: u8 = 0x10;
    /// Control Table Backup.
    pub const BACKUP: u8 = 0x20;
    /// Sync Read.
    pub const SYNC_READ: u8 = 0x82;
    /// Sync Write.
    pub const SYNC_WRITE: u8 = 0x83;
    /// Fast Sync Read.
    pub const FAST_SYNC_READ: u8 = 0x8A;
    /// Bulk Read.
    pub const BULK_READ: u8 = 0x92;
    /// Bulk Write.
    pub const BULK_WRITE: u8 = 0x93;
    /// Fast Bulk Read.
    pub const FAST_BULK_READ: u8 = 0x9A;
}

/// The five bytes that make Clear reset the multi-turn position.
const CLEAR_MULTI_TURN: [u8; 5] = [0x01, 0x44, 0x58, 0x4C, 0x22];
/// The four bytes that follow the backup command.
const BACKUP_KEY: [u8; 4] = [0x43, 0x54, 0x52, 0x4C];

/// What a factory reset keeps.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum FactoryReset {
    /// FF: nothing.
    All,
    /// 01: the id.
    KeepId,
    /// 02: the id and the baud rate.
    KeepIdAndBaud,
}

/// What to do with the backup of the control table.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Backup {
    /// 01: store the table.
    Store,
    /// 02: restore it and reboot.
    Restore,
}

/// One instruction.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Instruction<'a> {
    /// Answered with model number (u16) and firmware version (u8).
    Ping,
    /// Reads `length` bytes from `address`.
    Read {
        /// First register.
        address: u16,
        /// Bytes.
        length: u16,
    },
    /// Writes `data` to `address`.
    Write {
        /// First register.
        address: u16,
        /// Bytes to write.
        data: &'a [u8],
    },
    /// Holds a write until [`Instruction::Action`].
    RegWrite {
        /// First register.
        address: u16,
        /// Bytes to write.
        data: &'a [u8],
    },
    /// Carries out the held write.
    Action,
    /// Back to factory settings.
    FactoryReset(FactoryReset),
    /// Restarts the servo; clears a latched hardware error.
    Reboot,
    /// Sets the multi-turn revolutions to zero.
    ClearMultiTurn,
    /// Stores or restores the control table.
    Backup(Backup),
    /// One status from each id, in the order of the list.
    SyncRead(SyncRead<'a>),
    /// One combined status from all ids, in the order of the list.
    FastSyncRead(SyncRead<'a>),
    /// Writes to the same registers of several servos; not answered.
    SyncWrite(SyncWrite<'a>),
    /// One status from each servo asked, in order.
    BulkRead(BulkRead<'a>),
    /// One combined status from all servos asked, in order.
    FastBulkRead(BulkRead<'a>),
    /// Writes to different registers of several servos; not answered.
    BulkWrite(BulkWrite<'a>),
}

/// Parameters of a sync read: what is asked of all.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct SyncRead<'a> {
    /// First register.
    pub address: u16,
    /// Bytes from each servo.
    pub length: u16,
    /// Servo ids, one byte each, in the order of answering.
    pub ids: &'a [u8],
}

/// Parameters of a sync write: what is written where, for each servo.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct SyncWrite<'a> {
    /// First register.
    pub address: u16,
    /// Bytes for each servo, at least 1.
    pub length: u16,
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
    pub address: u16,
    /// Bytes.
    pub length: u16,
}

/// Parameters of a bulk read.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct BulkRead<'a> {
    /// Whole entries of five bytes.
    entries: &'a [u8],
}

impl<'a> BulkRead<'a> {
    /// What is asked of whom, in the order of answering.
    pub fn iter(&self) -> impl Iterator<Item = BulkReadEntry> + use<'a> {
        self.entries.chunks_exact(5).map(|entry| BulkReadEntry {
            id: entry[0],
            address: u16::from_le_bytes([entry[1], entry[2]]),
            length: u16::from_le_bytes([entry[3], entry[4]]),
        })
    }
}

/// One entry of a bulk write.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct BulkWriteEntry<'a> {
    /// Servo id.
    pub id: u8,
    /// First register.
    pub address: u16,
    /// Bytes to write.
    pub data: &'a [u8],
}

/// Parameters of a bulk write.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct BulkWrite<'a> {
    /// Whole entries: id, address, length, data.
    entries: &'a [u8],
}

/// Splits the first entry off the parameters of a bulk write.
fn split_bulk_write(entries: &[u8]) -> Option<(BulkWriteEntry<'_>, &[u8])> {
    let (head, rest) = entries.split_at_checked(5)?;
    let length = usize::from(u16::from_le_bytes([head[3], head[4]]));
    let (data, rest) = rest.split_at_checked(length)?;
    let entry = BulkWriteEntry {
        id: head[0],
        address: u16::from_le_bytes([head[1], head[2]]),
        data,
    };
    Some((entry, rest))
}

impl<'a> BulkWrite<'a> {
    /// What is written where.
    pub fn iter(&self) -> impl Iterator<Item = BulkWriteEntry<'a>> + use<'a> {
        let mut rest = self.entries;
        core::iter::from_fn(move || {
            let (entry, tail) = split_bulk_write(rest)?;
            rest = tail;
            Some(entry)
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
    /// Factory reset, clear or backup without its key bytes.
    Key {
        /// The instruction byte.
        code: u8,
    },
}

impl InstructionError {
    /// The error code that a servo answers with.
    pub const fn error_code(self) -> ErrorCode {
        match self {
            InstructionError::Unknown { .. } => ErrorCode::Instruction,
            InstructionError::Length { .. } => ErrorCode::DataLength,
            InstructionError::Key { .. } => ErrorCode::DataRange,
        }
    }
}

impl fmt::Display for InstructionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            InstructionError::Unknown { code } => write!(f, "unknown instruction {code:#04X}"),
            InstructionError::Length { code, found } => {
                write!(
                    f,
                    "instruction {code:#04X} cannot have {found} parameter bytes"
                )
            }
            InstructionError::Key { code } => {
                write!(f, "instruction {code:#04X} without its key bytes")
            }
        }
    }
}

impl core::error::Error for InstructionError {}

impl<'a> Instruction<'a> {
    /// Reads a frame as an instruction. Its addressee is the frame's id.
    pub fn parse(frame: &Frame<'a>) -> Result<Self, InstructionError> {
        let (code, params) = (frame.instruction, frame.params);
        let length = InstructionError::Length {
            code,
            found: params.len(),
        };
        let key = InstructionError::Key { code };
        let bare = |instruction| {
            if params.is_empty() {
                Ok(instruction)
            } else {
                Err(length)
            }
        };
        match code {
            code::PING => bare(Instruction::Ping),
            code::ACTION => bare(Instruction::Action),
            code::REBOOT => bare(Instruction::Reboot),
            code::READ => match *params {
                [a, b, c, d] => Ok(Instruction::Read {
                    address: u16::from_le_bytes([a, b]),
                    length: u16::from_le_bytes([c, d]),
                }),
                _ => Err(length),
            },
            code::WRITE | code::REG_WRITE => {
                let (address, data) = split_u16(params).ok_or(length)?;
                Ok(if code == code::WRITE {
                    Instruction::Write { address, data }
                } else {
                    Instruction::RegWrite { address, data }
                })
            }
            code::FACTORY_RESET => match params {
                [0xFF] => Ok(Instruction::FactoryReset(FactoryReset::All)),
                [0x01] => Ok(Instruction::FactoryReset(FactoryReset::KeepId)),
                [0x02] => Ok(Instruction::FactoryReset(FactoryReset::KeepIdAndBaud)),
                [_] => Err(key),
                _ => Err(length),
            },
            code::CLEAR if params.len() != CLEAR_MULTI_TURN.len() => Err(length),
            code::CLEAR if params == CLEAR_MULTI_TURN => Ok(Instruction::ClearMultiTurn),
            code::CLEAR => Err(key),
            code::BACKUP => match params.split_first() {
                Some((0x01, rest)) if rest == BACKUP_KEY => Ok(Instruction::Backup(Backup::Store)),
                Some((0x02, rest)) if rest == BACKUP_KEY => {
                    Ok(Instruction::Backup(Backup::Restore))
                }
                Some((_, rest)) if rest.len() == BACKUP_KEY.len() => Err(key),
                _ => Err(length),
            },
            code::SYNC_READ | code::FAST_SYNC_READ => {
                let (address, rest) = split_u16(params).ok_or(length)?;
                let (length, ids) = split_u16(rest).ok_or(length)?;
                let list = SyncRead {
                    address,
                    length,
                    ids,
                };
                Ok(if code == code::SYNC_READ {
                    Instruction::SyncRead(list)
                } else {
                    Instruction::FastSyncRead(list)
                })
            }
            code::SYNC_WRITE => {
                let (address, rest) = split_u16(params).ok_or(length)?;
                let (data_len, entries) = split_u16(rest).ok_or(length)?;
                if data_len == 0 || !entries.len().is_multiple_of(1 + usize::from(data_len)) {
                    return Err(length);
                }
                Ok(Instruction::SyncWrite(SyncWrite {
                    address,
                    length: data_len,
                    entries,
                }))
            }
            code::BULK_READ | code::FAST_BULK_READ => {
                if !params.len().is_multiple_of(5) {
                    return Err(length);
                }
                let bulk = BulkRead { entries: params };
                Ok(if code == code::BULK_READ {
                    Instruction::BulkRead(bulk)
                } else {
                    Instruction::FastBulkRead(bulk)
                })
            }
            code::BULK_WRITE => {
                let mut rest = params;
                while !rest.is_empty() {
                    (_, rest) = split_bulk_write(rest).ok_or(length)?;
                }
                Ok(Instruction::BulkWrite(BulkWrite { entries: params }))
            }
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
            Instruction::FactoryReset(_) => code::FACTORY_RESET,
            Instruction::Reboot => code::REBOOT,
            Instruction::ClearMultiTurn => code::CLEAR,
            Instruction::Backup(_) => code::BACKUP,
            Instruction::SyncRead(_) => code::SYNC_READ,
            Instruction::FastSyncRead(_) => code::FAST_SYNC_READ,
            Instruction::SyncWrite(_) => code::SYNC_WRITE,
            Instruction::BulkRead(_) => code::BULK_READ,
            Instruction::FastBulkRead(_) => code::FAST_BULK_READ,
            Instruction::BulkWrite(_) => code::BULK_WRITE,
        }
    }

    /// Writes the instruction to `id` into `buf` and returns the frame's bytes.
    ///
    /// Sync and bulk instructions go to [`crate::BROADCAST_ID`].
    pub fn encode<'b>(&self, id: u8, buf: &'b mut [u8]) -> Result<&'b [u8], BufferTooSmall> {
        let mut writer = FrameWriter::new(buf, id, self.code());
        match *self {
            Instruction::Ping | Instruction::Action | Instruction::Reboot => {}
            Instruction::Read { address, length } => {
                writer.extend_u16(address);
                writer.extend_u16(length);
            }
            Instruction::Write { address, data } | Instruction::RegWrite { address, data } => {
                writer.extend_u16(address);
                writer.extend(data);
            }
            Instruction::FactoryReset(what) => writer.push(match what {
                FactoryReset::All => 0xFF,
                FactoryReset::KeepId => 0x01,
                FactoryReset::KeepIdAndBaud => 0x02,
            }),
            Instruction::ClearMultiTurn => writer.extend(&CLEAR_MULTI_TURN),
            Instruction::Backup(what) => {
                writer.push(match what {
                    Backup::Store => 0x01,
                    Backup::Restore => 0x02,
                });
                writer.extend(&BACKUP_KEY);
            }
            Instruction::SyncRead(list) | Instruction::FastSyncRead(list) => {
                writer.extend_u16(list.address);
                writer.extend_u16(list.length);
                writer.extend(list.ids);
            }
            Instruction::SyncWrite(SyncWrite {
                address,
                length,
                entries,
            }) => {
                writer.extend_u16(address);
                writer.extend_u16(length);
                writer.extend(entries);
            }
            Instruction::BulkRead(BulkRead { entries })
            | Instruction::FastBulkRead(BulkRead { entries })
            | Instruction::BulkWrite(BulkWrite { entries }) => writer.extend(entries),
        }
        writer.finish()
    }
}

fn split_u16(bytes: &[u8]) -> Option<(u16, &[u8])> {
    let (head, rest) = bytes.split_first_chunk::<2>()?;
    Some((u16::from_le_bytes(*head), rest))
}
