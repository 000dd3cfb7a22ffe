//! The combined status of fast sync and fast bulk reads.
//!
//! ```text
//! FF FF FD 00 FE LEN_L LEN_H 55 | ERR ID DATA... CRC_L CRC_H | ERR ID DATA... CRC_L CRC_H | ...
//! ```
//! The first servo sends the prefix with the length of all, each servo its block when it has heard
//! its predecessor. Each block's checksum covers every byte since the first FF, earlier checksums
//! included; so the last one is that of the frame, and the blocks before the first bad one are good.
//! Behind a bad one the check can be taken up again from its checksum, see [`Blocks::skip_block`].
//! The frame is not stuffed.

use crate::BROADCAST_ID;
use crate::crc::Crc;
use crate::frame::{BufferTooSmall, HEADER, STATUS};
use crate::status::{ALERT, ErrorCode};
use core::fmt;

/// Bytes before the first block.
pub const PREFIX_LEN: usize = 8;
/// Bytes of a block beside its data: error, id, checksum.
pub const BLOCK_OVERHEAD: usize = 4;

/// Device side: writes the prefix that the first servo sends and takes it into `crc`.
///
/// `blocks_len` is the length of all blocks together: the sum of data lengths plus
/// [`BLOCK_OVERHEAD`] each. Returns the [`PREFIX_LEN`] bytes.
pub fn encode_prefix<'b>(
    buf: &'b mut [u8],
    blocks_len: u16,
    crc: &mut Crc,
) -> Result<&'b [u8], BufferTooSmall> {
    let capacity = buf.len();
    let prefix = buf
        .get_mut(..PREFIX_LEN)
        .ok_or(BufferTooSmall { capacity })?;
    prefix[..4].copy_from_slice(&HEADER);
    prefix[4] = BROADCAST_ID;
    // LEN counts the instruction byte too and ends with the last checksum.
    prefix[5..7].copy_from_slice(&blocks_len.saturating_add(1).to_le_bytes());
    prefix[7] = STATUS;
    crc.update(prefix);
    Ok(prefix)
}

/// Device side: writes one servo's block.
///
/// `crc` has taken in all bytes of the combined status that the servo heard so far, and takes in
/// the block, its checksum included. Returns the block's bytes.
pub fn encode_block<'b>(
    buf: &'b mut [u8],
    error_byte: u8,
    id: u8,
    data: &[u8],
    crc: &mut Crc,
) -> Result<&'b [u8], BufferTooSmall> {
    let capacity = buf.len();
    let block = buf
        .get_mut(..data.len() + BLOCK_OVERHEAD)
        .ok_or(BufferTooSmall { capacity })?;
    let (covered, checksum) = block.split_at_mut(data.len() + 2);
    covered[0] = error_byte;
    covered[1] = id;
    covered[2..].copy_from_slice(data);
    crc.update(covered);
    checksum.copy_from_slice(&crc.value().to_le_bytes());
    crc.update(checksum);
    Ok(block)
}

/// One servo's part of a combined status.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Block<'a> {
    /// Who answers.
    pub id: u8,
    /// A hardware error is latched.
    pub alert: bool,
    /// Whether the servo could read what was asked.
    pub error: ErrorCode,
    /// The data asked for.
    pub data: &'a [u8],
}

/// Why a block cannot be used.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum BlockError {
    /// The block is not complete.
    Incomplete {
        /// Bytes still missing.
        missing: usize,
    },
    /// The cumulative checksum is wrong.
    Crc {
        /// Computed over the bytes.
        expected: u16,
        /// Found at the block's end.
        found: u16,
    },
    /// Another servo answered than the one asked.
    Id {
        /// Asked.
        expected: u8,
        /// Answered.
        found: u8,
    },
}

impl fmt::Display for BlockError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            BlockError::Incomplete { missing } => write!(f, "{missing} bytes missing"),
            BlockError::Crc { expected, found } => {
                write!(f, "checksum {found:#06X}, expected {expected:#06X}")
            }
            BlockError::Id { expected, found } => {
                write!(f, "servo {found} answered, expected {expected}")
            }
        }
    }
}

impl core::error::Error for BlockError {}

/// Host side: where the prefix of a combined status with blocks of `blocks_len` bytes lies in `bytes`.
///
/// `None` until all [`PREFIX_LEN`] bytes are there. Whatever stands before it is stale or noise.
pub fn find_prefix(bytes: &[u8], blocks_len: u16) -> Option<usize> {
    let mut prefix = [0; PREFIX_LEN];
    // Eight bytes fit into eight.
    encode_prefix(&mut prefix, blocks_len, &mut Crc::new()).ok()?;
    bytes
        .windows(PREFIX_LEN)
        .position(|window| window == prefix)
}

/// Host side: reads a combined status block by block, as far as it arrived.
#[derive(Copy, Clone, Debug)]
pub struct Blocks<'a> {
    bytes: &'a [u8],
    position: usize,
    crc: Crc,
}

impl<'a> Blocks<'a> {
    /// Begins at the first block; `bytes` starts with the prefix (see [`find_prefix`]).
    pub fn new(bytes: &'a [u8]) -> Self {
        let position = PREFIX_LEN.min(bytes.len());
        let mut crc = Crc::new();
        crc.update(&bytes[..position]);
        Blocks {
            bytes,
            position,
            crc,
        }
    }

    /// The next block, that of servo `id` with `data_len` bytes of data.
    ///
    /// After an error the position stays: the same call on more bytes may succeed, or
    /// [`skip_block`](Self::skip_block) leads past it.
    pub fn next_block(&mut self, id: u8, data_len: usize) -> Result<Block<'a>, BlockError> {
        let rest = &self.bytes[self.position..];
        let block_len = data_len.saturating_add(BLOCK_OVERHEAD);
        let block = rest
            .get(..block_len)
            .ok_or_else(|| BlockError::Incomplete {
                missing: block_len - rest.len(),
            })?;
        let (covered, checksum) = block.split_at(data_len + 2);
        let mut crc = self.crc;
        crc.update(covered);
        let found = u16::from_le_bytes([checksum[0], checksum[1]]);
        if crc.value() != found {
            return Err(BlockError::Crc {
                expected: crc.value(),
                found,
            });
        }
        if covered[1] != id {
            return Err(BlockError::Id {
                expected: id,
                found: covered[1],
            });
        }
        crc.update(checksum);
        self.crc = crc;
        self.position += block_len;
        Ok(Block {
            id,
            alert: covered[0] & ALERT != 0,
            error: ErrorCode::from_byte(covered[0]),
            data: &covered[2..],
        })
    }

    /// Passes over a damaged block with `data_len` bytes of data; false when it is not complete.
    ///
    /// The checksum at its end, if that is intact, is what the sender's sum stood at: from there the
    /// following blocks check as strictly as ever. If it is not, the next block fails too.
    pub fn skip_block(&mut self, data_len: usize) -> bool {
        let rest = &self.bytes[self.position..];
        let block_len = data_len.saturating_add(BLOCK_OVERHEAD);
        let Some([.., low, high]) = rest.get(..block_len) else {
            return false;
        };
        self.crc = Crc::from_value(u16::from_le_bytes([*low, *high]));
        self.crc.update(&[*low, *high]);
        self.position += block_len;
        true
    }
}
