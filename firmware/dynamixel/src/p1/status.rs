//! What a servo of Protocol 1.0 answers: error bits and parameters.

use super::frame::{Frame, FrameWriter};
use crate::frame::BufferTooSmall;
use core::fmt;

/// The error byte of a status: a bit for each thing that is wrong.
///
/// The bits of [`CONDITIONS`](Self::CONDITIONS) tell how the servo is and stand beside a valid answer; the
/// others say that the instruction was not carried out.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Errors(pub u8);

impl Errors {
    /// Supply voltage outside its limits.
    pub const VOLTAGE: u8 = 1 << 0;
    /// Goal position outside the angle limits.
    pub const ANGLE_LIMIT: u8 = 1 << 1;
    /// Temperature above its limit.
    pub const OVERHEATING: u8 = 1 << 2;
    /// A value or address that the instruction cannot have.
    pub const RANGE: u8 = 1 << 3;
    /// The instruction arrived with a wrong checksum.
    pub const CHECKSUM: u8 = 1 << 4;
    /// The load cannot be held with the torque that is allowed.
    pub const OVERLOAD: u8 = 1 << 5;
    /// Unknown instruction, or Action without a registered write.
    pub const INSTRUCTION: u8 = 1 << 6;
    /// What is wrong with the servo itself, not with the instruction.
    pub const CONDITIONS: u8 = Self::VOLTAGE | Self::OVERHEATING | Self::OVERLOAD;

    const NAMES: [&'static str; 8] = [
        "voltage",
        "angle limit",
        "overheating",
        "range",
        "checksum",
        "overload",
        "instruction",
        "bit 7",
    ];

    /// Whether nothing is wrong.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// What is wrong with the servo itself.
    pub const fn conditions(self) -> Self {
        Errors(self.0 & Self::CONDITIONS)
    }

    /// Why the instruction was not carried out.
    pub const fn refusals(self) -> Self {
        Errors(self.0 & !Self::CONDITIONS)
    }
}

impl fmt::Display for Errors {
    /// The names of all bits set, such as `overheating, overload`; `none`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_empty() {
            return f.write_str("none");
        }
        let mut separator = "";
        for (bit, name) in Self::NAMES.iter().enumerate() {
            if self.0 & (1 << bit) != 0 {
                write!(f, "{separator}{name}")?;
                separator = ", ";
            }
        }
        Ok(())
    }
}

/// A servo's answer.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Status<'a> {
    /// Who answers.
    pub id: u8,
    /// What is wrong.
    pub errors: Errors,
    /// The data asked for; empty for a write.
    pub params: &'a [u8],
}

impl<'a> Status<'a> {
    /// Reads a frame as a status: whether it is one, only the listener knows.
    pub const fn of(frame: &Frame<'a>) -> Self {
        Status {
            id: frame.id,
            errors: Errors(frame.code),
            params: frame.params,
        }
    }

    /// Writes the status into `buf` and returns the frame's bytes.
    pub fn encode<'b>(&self, buf: &'b mut [u8]) -> Result<&'b [u8], BufferTooSmall> {
        let mut writer = FrameWriter::new(buf, self.id, self.errors.0);
        writer.extend(self.params);
        writer.finish()
    }
}
