//! Dynamixel Protocols 2.0 and 1.0 on bytes alone: frames, instructions, statuses, for host and device.
//!
//! Nothing here does I/O, reads a clock or allocates; buffers belong to the caller. The two levels:
//!
//! * raw: [`Frame`] is a checked view of one frame's bytes, found in a noisy stream by
//!   [`FrameParser`] and written by [`FrameWriter`] ([`crc`] and [`stuffing`] lie below);
//! * typed: [`Instruction`] and [`Status`] hold only what has a meaning, for both ends of the line,
//!   [`fast`] the combined reply of fast sync and fast bulk reads.
//!
//! Protocol 1.0 of the AX class has its own [`p1`], in the same two levels.
//!
//! [`wire`] computes how long all this takes on the line, [`baud`] maps the baud rate register.
//!
//! Facts are those of the vendor's e-manual, "DYNAMIXEL Protocol 2.0" and "1.0".
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod baud;
pub mod crc;
pub mod fast;
mod finder;
pub mod frame;
pub mod instruction;
pub mod lists;
pub mod p1;
pub mod parser;
pub mod status;
pub mod stuffing;
pub mod wire;

pub use crc::Crc;
pub use frame::{BufferTooSmall, Frame, FrameError, FrameWriter};
pub use instruction::{Instruction, InstructionError};
pub use parser::{Damage, FrameParser};
pub use status::{ErrorCode, Status, StatusError};

/// The id that every servo listens to.
pub const BROADCAST_ID: u8 = 0xFE;
/// The highest id a servo can have.
pub const MAX_ID: u8 = 252;

/// Whether `id` can stand in a frame: that of a servo (0..=252) or broadcast (254).
pub const fn is_valid_id(id: u8) -> bool {
    id <= MAX_ID || id == BROADCAST_ID
}
