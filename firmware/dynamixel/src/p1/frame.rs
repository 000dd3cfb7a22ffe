//! One frame of Protocol 1.0: the checked view of its bytes, and the writer.

use super::is_valid_id;
use crate::frame::BufferTooSmall;
use core::fmt;

/// What every frame begins with.
pub const HEADER: [u8; 2] = [0xFF, 0xFF];
/// Bytes before the instruction or error byte: header, id, length.
pub const PREFIX_LEN: usize = 4;
/// The shortest frame: no parameters.
pub const MIN_LEN: usize = 6;
/// The longest frame that a length field of one byte allows.
pub const MAX_LEN: usize = PREFIX_LEN + 255;

/// The checksum over the bytes from the id to the last parameter.
pub fn checksum(bytes: &[u8]) -> u8 {
    !bytes.iter().fold(0u8, |sum, &byte| sum.wrapping_add(byte))
}

/// A frame that arrived whole: valid header, id, length and checksum.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Addressee of an instruction, sender of a status.
    pub id: u8,
    /// The instruction byte of an instruction, the error byte of a status.
    pub code: u8,
    /// What stands between that byte and the checksum.
    pub params: &'a [u8],
}

/// Why bytes are not a frame.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// The bytes do not begin with FF FF.
    Header,
    /// The id is one that no frame can have (255).
    Id {
        /// The id found.
        found: u8,
    },
    /// The length field does not fit the bytes.
    Length {
        /// Bytes after the length field.
        expected: usize,
        /// What the field says.
        found: usize,
    },
    /// The checksum is wrong.
    Checksum {
        /// Computed over the bytes.
        expected: u8,
        /// Found at their end.
        found: u8,
    },
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FrameError::Header => f.write_str("no frame header FF FF"),
            FrameError::Id { found } => write!(f, "id {found}, expected 0 to 254"),
            FrameError::Length { expected, found } => {
                write!(f, "length field {found}, expected {expected}")
            }
            FrameError::Checksum { expected, found } => {
                write!(f, "checksum {found:#04X}, expected {expected:#04X}")
            }
        }
    }
}

impl core::error::Error for FrameError {}

impl<'a> Frame<'a> {
    /// Checks that `bytes` are exactly one frame.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, FrameError> {
        if !bytes.starts_with(&HEADER) {
            return Err(FrameError::Header);
        }
        let [_, _, id, field, code, params @ .., found] = bytes else {
            return Err(FrameError::Length {
                expected: MIN_LEN - PREFIX_LEN,
                found: bytes.len().saturating_sub(PREFIX_LEN),
            });
        };
        if !is_valid_id(*id) {
            return Err(FrameError::Id { found: *id });
        }
        let (field, behind) = (usize::from(*field), bytes.len() - PREFIX_LEN);
        if field != behind {
            return Err(FrameError::Length {
                expected: behind,
                found: field,
            });
        }
        let expected = checksum(&bytes[HEADER.len()..bytes.len() - 1]);
        if *found != expected {
            return Err(FrameError::Checksum {
                expected,
                found: *found,
            });
        }
        Ok(Frame {
            id: *id,
            code: *code,
            params,
        })
    }

    /// How many bytes the frame takes on the line.
    pub const fn wire_len(&self) -> usize {
        MIN_LEN + self.params.len()
    }
}

/// Writes one frame into a buffer.
///
/// Running out of space is remembered and told once, by [`finish`](Self::finish).
#[derive(Debug)]
pub struct FrameWriter<'a> {
    buf: &'a mut [u8],
    len: usize,
    overflow: bool,
}

impl<'a> FrameWriter<'a> {
    /// Starts a frame to (or, for a status, from) `id`; `code` is the instruction or error byte.
    pub fn new(buf: &'a mut [u8], id: u8, code: u8) -> Self {
        // A length field of one byte bounds the frame, however large the buffer is.
        let capacity = buf.len().min(MAX_LEN);
        let mut writer = FrameWriter {
            buf: &mut buf[..capacity],
            len: 0,
            overflow: false,
        };
        writer.extend(&[HEADER[0], HEADER[1], id, 0, code]);
        writer
    }

    /// Appends one parameter byte.
    pub fn push(&mut self, byte: u8) {
        // One byte stays free for the checksum.
        if self.len + 1 < self.buf.len() {
            self.buf[self.len] = byte;
            self.len += 1;
        } else {
            self.overflow = true;
        }
    }

    /// Appends parameter bytes.
    pub fn extend(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.push(byte);
        }
    }

    /// Fills in length and checksum and returns the frame's bytes.
    pub fn finish(self) -> Result<&'a [u8], BufferTooSmall> {
        let FrameWriter { buf, len, overflow } = self;
        if overflow {
            return Err(BufferTooSmall {
                capacity: buf.len(),
            });
        }
        // Fits: `new` bounds the buffer by MAX_LEN.
        buf[3] = (len + 1 - PREFIX_LEN) as u8;
        buf[len] = checksum(&buf[HEADER.len()..len]);
        Ok(&buf[..=len])
    }
}
