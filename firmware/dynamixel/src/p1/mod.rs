//! Dynamixel Protocol 1.0, of the AX class and of MX servos with their first firmware.
//!
//! ```text
//! FF FF | ID | LEN | INST or ERR | PARAMS... | CHK
//! ```
//! LEN counts what follows it; CHK is the complement of the sum from ID on. Nothing is stuffed, registers have
//! addresses and lengths of one byte, and an instruction cannot be told from a status by its bytes: who
//! listens has to know which of them it expects. The checksum of eight bits lets one damaged frame in 256
//! through, so a host does well to check id and length of a status against what it asked.
//!
//! Facts are those of the vendor's e-manual, "DYNAMIXEL Protocol 1.0".

pub mod baud;
pub mod frame;
pub mod instruction;
pub mod lists;
pub mod parser;
pub mod status;
pub mod wire;

pub use frame::{Frame, FrameError, FrameWriter};
pub use instruction::{Instruction, InstructionError};
pub use parser::FrameParser;
pub use status::{Errors, Status};

/// The id that every servo listens to.
pub const BROADCAST_ID: u8 = 0xFE;
/// The highest id a servo can have.
pub const MAX_ID: u8 = 253;

/// Whether `id` can stand in a frame: that of a servo (0..=253) or broadcast (254).
pub const fn is_valid_id(id: u8) -> bool {
    id <= BROADCAST_ID
}
