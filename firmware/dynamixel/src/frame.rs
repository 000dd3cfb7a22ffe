//! One frame: the checked view of its bytes, and the writer.
//!
//! ```text
//! FF FF FD 00 | ID | LEN_L LEN_H | INST | [ERR] PARAMS... | CRC_L CRC_H
//! ```
//! LEN counts what follows it: instruction, parameters after stuffing, checksum.

use crate::crc::crc16;
use crate::stuffing::{Stuffer, unstuff};
use crate::{BROADCAST_ID, is_valid_id};
use core::fmt;

/// What every frame begins with.
pub const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];
/// Bytes before the instruction byte: header, id, length.
pub const PREFIX_LEN: usize = 7;
/// The shortest frame: an instruction without parameters.
pub const MIN_LEN: usize = 10;
/// The instruction byte of every status.
pub const STATUS: u8 = 0x55;

/// A frame that arrived whole: valid header, id, length and checksum, stuffing removed.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Addressee of an instruction, sender of a status.
    pub id: u8,
    /// The instruction byte; 0x55 marks a status.
    pub instruction: u8,
    /// What follows the instruction byte, without stuffing and checksum; in a status the error byte comes first.
    pub params: &'a [u8],
    /// How many bytes the frame took on the line.
    pub wire_len: usize,
}

/// Why bytes are not a frame.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// The bytes do not begin with FF FF FD 00.
    Header,
    /// The id is one that no frame can have (253 or 255).
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
    Crc {
        /// Computed over the bytes.
        expected: u16,
        /// Found at their end.
        found: u16,
    },
    /// Another frame begins inside the body, where stuffing allows none: two frames, the first cut short.
    HeaderInside,
}

/// Whether `body`, the bytes on the line from the instruction byte on, holds the start of another frame.
///
/// Stuffing keeps headers out of every body but that of the combined status of fast reads.
pub(crate) fn holds_a_header(id: u8, body: &[u8]) -> bool {
    !is_combined(id, body) && body.windows(HEADER.len()).any(|window| window == HEADER)
}

/// Whether a body belongs to the combined status of fast reads: the only status that comes from the
/// broadcast id, and the only frame that is not stuffed.
fn is_combined(id: u8, body: &[u8]) -> bool {
    id == BROADCAST_ID && body.first() == Some(&STATUS)
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FrameError::Header => f.write_str("no frame header FF FF FD 00"),
            FrameError::Id { found } => write!(f, "id {found}, expected 0 to 252 or 254"),
            FrameError::Length { expected, found } => {
                write!(f, "length field {found}, expected {expected}")
            }
            FrameError::Crc { expected, found } => {
                write!(f, "checksum {found:#06X}, expected {expected:#06X}")
            }
            FrameError::HeaderInside => {
                f.write_str("another frame header FF FF FD 00 inside the body")
            }
        }
    }
}

impl core::error::Error for FrameError {}

impl<'a> Frame<'a> {
    /// Checks that `bytes` are exactly one frame and removes its stuffing in place.
    pub fn parse(bytes: &'a mut [u8]) -> Result<Self, FrameError> {
        let too_short = FrameError::Length {
            expected: MIN_LEN - PREFIX_LEN,
            found: bytes.len().saturating_sub(PREFIX_LEN),
        };
        if !bytes.starts_with(&HEADER) {
            return Err(FrameError::Header);
        }
        if bytes.len() < MIN_LEN {
            return Err(too_short);
        }
        let (id, field) = (
            bytes[4],
            usize::from(u16::from_le_bytes([bytes[5], bytes[6]])),
        );
        if !is_valid_id(id) {
            return Err(FrameError::Id { found: id });
        }
        let wire_len = bytes.len();
        if field != wire_len - PREFIX_LEN {
            return Err(FrameError::Length {
                expected: wire_len - PREFIX_LEN,
                found: field,
            });
        }
        let (covered, checksum) = bytes.split_at_mut(wire_len - 2);
        let found = u16::from_le_bytes([checksum[0], checksum[1]]);
        let expected = crc16(covered);
        if found != expected {
            return Err(FrameError::Crc { expected, found });
        }
        let body = &mut covered[PREFIX_LEN..];
        if holds_a_header(id, body) {
            return Err(FrameError::HeaderInside);
        }
        let instruction = body[0];
        let len = if is_combined(id, body) {
            body.len()
        } else {
            unstuff(body)
        };
        Ok(Frame {
            id,
            instruction,
            params: &body[1..len],
            wire_len,
        })
    }
}

/// The buffer given is too small for the frame.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct BufferTooSmall {
    /// Bytes the buffer has.
    pub capacity: usize,
}

impl fmt::Display for BufferTooSmall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the frame does not fit into {} bytes", self.capacity)
    }
}

impl core::error::Error for BufferTooSmall {}

/// Writes one frame into a buffer, stuffing as it goes.
///
/// Running out of space is remembered and told once, by [`finish`](Self::finish).
#[derive(Debug)]
pub struct FrameWriter<'a> {
    buf: &'a mut [u8],
    len: usize,
    stuffer: Stuffer,
    overflow: bool,
}

impl<'a> FrameWriter<'a> {
    /// Starts a frame to (or, for a status, from) `id`.
    pub fn new(buf: &'a mut [u8], id: u8, instruction: u8) -> Self {
        // A length field of 16 bits bounds the frame, however large the buffer is.
        let capacity = buf.len().min(PREFIX_LEN + usize::from(u16::MAX));
        let mut writer = FrameWriter {
            buf: &mut buf[..capacity],
            len: 0,
            stuffer: Stuffer::new(),
            overflow: false,
        };
        for byte in HEADER.into_iter().chain([id, 0, 0]) {
            writer.raw(byte);
        }
        writer.push(instruction);
        writer
    }

    /// Appends one parameter byte.
    pub fn push(&mut self, byte: u8) {
        self.raw(byte);
        if self.stuffer.push(byte) {
            self.raw(0xFD);
        }
    }

    /// Appends parameter bytes.
    pub fn extend(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.push(byte);
        }
    }

    /// Appends a 16-bit parameter, low byte first.
    pub fn extend_u16(&mut self, value: u16) {
        self.extend(&value.to_le_bytes());
    }

    fn raw(&mut self, byte: u8) {
        // Two bytes stay free for the checksum.
        if self.len + 2 < self.buf.len() {
            self.buf[self.len] = byte;
            self.len += 1;
        } else {
            self.overflow = true;
        }
    }

    /// Fills in length and checksum and returns the frame's bytes.
    pub fn finish(self) -> Result<&'a [u8], BufferTooSmall> {
        let FrameWriter { buf, len, .. } = self;
        if self.overflow {
            return Err(BufferTooSmall {
                capacity: buf.len(),
            });
        }
        // Fits: `new` bounds the buffer by PREFIX_LEN + u16::MAX.
        let field = (len + 2 - PREFIX_LEN) as u16;
        buf[5..7].copy_from_slice(&field.to_le_bytes());
        let checksum = crc16(&buf[..len]);
        buf[len..len + 2].copy_from_slice(&checksum.to_le_bytes());
        Ok(&buf[..len + 2])
    }
}
