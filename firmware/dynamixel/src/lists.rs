//! Host side: instructions whose list of servos is written straight into the frame.

use crate::BROADCAST_ID;
use crate::frame::{BufferTooSmall, FrameWriter};
use crate::instruction::{BulkReadEntry, BulkWriteEntry, code};

/// Writes a sync write of `length` bytes at `address` for each (id, data).
///
/// Data longer than `length` is cut, shorter data is filled with zeros.
pub fn encode_sync_write<D: AsRef<[u8]>>(
    buf: &mut [u8],
    address: u16,
    length: u16,
    items: impl IntoIterator<Item = (u8, D)>,
) -> Result<&[u8], BufferTooSmall> {
    let mut writer = FrameWriter::new(buf, BROADCAST_ID, code::SYNC_WRITE);
    writer.extend_u16(address);
    writer.extend_u16(length);
    for (id, data) in items {
        writer.push(id);
        let padded = data.as_ref().iter().copied().chain(core::iter::repeat(0));
        for byte in padded.take(usize::from(length)) {
            writer.push(byte);
        }
    }
    writer.finish()
}

/// Writes a bulk read, or with `fast` a fast bulk read. An id may stand in it once.
pub fn encode_bulk_read(
    buf: &mut [u8],
    fast: bool,
    entries: impl IntoIterator<Item = BulkReadEntry>,
) -> Result<&[u8], BufferTooSmall> {
    let instruction = if fast {
        code::FAST_BULK_READ
    } else {
        code::BULK_READ
    };
    let mut writer = FrameWriter::new(buf, BROADCAST_ID, instruction);
    for entry in entries {
        writer.push(entry.id);
        writer.extend_u16(entry.address);
        writer.extend_u16(entry.length);
    }
    writer.finish()
}

/// Writes a bulk write. An id may stand in it once; data beyond 65,535 bytes is cut.
pub fn encode_bulk_write<'d>(
    buf: &mut [u8],
    entries: impl IntoIterator<Item = BulkWriteEntry<'d>>,
) -> Result<&[u8], BufferTooSmall> {
    let mut writer = FrameWriter::new(buf, BROADCAST_ID, code::BULK_WRITE);
    for entry in entries {
        let length = u16::try_from(entry.data.len()).unwrap_or(u16::MAX);
        writer.push(entry.id);
        writer.extend_u16(entry.address);
        writer.extend_u16(length);
        writer.extend(&entry.data[..usize::from(length)]);
    }
    writer.finish()
}
