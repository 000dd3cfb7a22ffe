//! What a servo answers: error byte and parameters.

use crate::frame::{BufferTooSmall, Frame, FrameWriter, STATUS};
use core::fmt;

/// The alert bit of the error byte: a hardware error is latched (read register 70).
pub const ALERT: u8 = 0x80;

/// The error code in the low seven bits of the error byte.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub enum ErrorCode {
    /// 0: the instruction was carried out.
    #[default]
    None,
    /// 1: the instruction could not be carried out.
    ResultFail,
    /// 2: unknown instruction, or Action without a registered write.
    Instruction,
    /// 3: the instruction arrived with a wrong checksum.
    Crc,
    /// 4: a value is out of the register's range.
    DataRange,
    /// 5: too few bytes for the register.
    DataLength,
    /// 6: a value is beyond a limit set in another register.
    DataLimit,
    /// 7: read-only or unmapped register, or EEPROM while torque is on.
    Access,
    /// A code that the manual does not list.
    Other(u8),
}

impl ErrorCode {
    /// The code in the low seven bits of `error_byte`.
    pub const fn from_byte(error_byte: u8) -> Self {
        match error_byte & !ALERT {
            0 => ErrorCode::None,
            1 => ErrorCode::ResultFail,
            2 => ErrorCode::Instruction,
            3 => ErrorCode::Crc,
            4 => ErrorCode::DataRange,
            5 => ErrorCode::DataLength,
            6 => ErrorCode::DataLimit,
            7 => ErrorCode::Access,
            other => ErrorCode::Other(other),
        }
    }

    /// The code as it stands in the error byte, 0..=127.
    pub const fn to_byte(self) -> u8 {
        match self {
            ErrorCode::None => 0,
            ErrorCode::ResultFail => 1,
            ErrorCode::Instruction => 2,
            ErrorCode::Crc => 3,
            ErrorCode::DataRange => 4,
            ErrorCode::DataLength => 5,
            ErrorCode::DataLimit => 6,
            ErrorCode::Access => 7,
            ErrorCode::Other(code) => code & !ALERT,
        }
    }
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            ErrorCode::None => "no error",
            ErrorCode::ResultFail => "result fail",
            ErrorCode::Instruction => "instruction error",
            ErrorCode::Crc => "checksum error",
            ErrorCode::DataRange => "data range error",
            ErrorCode::DataLength => "data length error",
            ErrorCode::DataLimit => "data limit error",
            ErrorCode::Access => "access error",
            ErrorCode::Other(code) => return write!(f, "unknown error {code}"),
        })
    }
}

/// A servo's answer.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Status<'a> {
    /// Who answers.
    pub id: u8,
    /// A hardware error is latched. Stands beside a valid answer and is no failure of the instruction.
    pub alert: bool,
    /// Whether the instruction was carried out.
    pub error: ErrorCode,
    /// The data asked for; empty for a write.
    pub params: &'a [u8],
}

/// Why a frame is not a status.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum StatusError {
    /// The frame is an instruction.
    NotAStatus {
        /// Its instruction byte.
        instruction: u8,
    },
    /// The error byte is missing.
    Empty,
}

impl fmt::Display for StatusError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StatusError::NotAStatus { instruction } => {
                write!(
                    f,
                    "instruction {instruction:#04X}, expected a status (0x55)"
                )
            }
            StatusError::Empty => f.write_str("status without error byte"),
        }
    }
}

impl core::error::Error for StatusError {}

impl<'a> Status<'a> {
    /// Reads a frame as a status. Not for the combined status of fast reads, see [`crate::fast`].
    pub fn parse(frame: &Frame<'a>) -> Result<Self, StatusError> {
        if frame.instruction != STATUS {
            return Err(StatusError::NotAStatus {
                instruction: frame.instruction,
            });
        }
        let (&error_byte, params) = frame.params.split_first().ok_or(StatusError::Empty)?;
        Ok(Status {
            id: frame.id,
            alert: error_byte & ALERT != 0,
            error: ErrorCode::from_byte(error_byte),
            params,
        })
    }

    /// The error byte: code and alert bit.
    pub const fn error_byte(&self) -> u8 {
        self.error.to_byte() | if self.alert { ALERT } else { 0 }
    }

    /// Writes the status into `buf` and returns the frame's bytes.
    pub fn encode<'b>(&self, buf: &'b mut [u8]) -> Result<&'b [u8], BufferTooSmall> {
        let mut writer = FrameWriter::new(buf, self.id, STATUS);
        writer.push(self.error_byte());
        writer.extend(self.params);
        writer.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_error_byte_survives_the_typed_form() {
        for byte in 0..=255u8 {
            let status = Status {
                id: 1,
                alert: byte & ALERT != 0,
                error: ErrorCode::from_byte(byte),
                params: &[],
            };
            assert_eq!(status.error_byte(), byte);
        }
    }

    #[test]
    fn an_instruction_is_not_taken_for_a_status() {
        let mut bytes = [0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01, 0x19, 0x4E];
        let frame = Frame::parse(&mut bytes).expect("the published ping");
        assert_eq!(
            Status::parse(&frame),
            Err(StatusError::NotAStatus { instruction: 1 })
        );
    }
}
