//! Host side of Protocol 1.0: instructions whose list of servos is written straight into the frame.

use super::BROADCAST_ID;
use super::frame::FrameWriter;
use super::instruction::{BulkReadEntry, code};
use crate::frame::BufferTooSmall;

/// Writes a sync write of `length` bytes at `address` for each (id, data).
///
/// Data longer than `length` is cut, shorter data is filled with zeros. A frame holds 251 / (1 + `length`) servos.
pub fn encode_sync_write<D: AsRef<[u8]>>(
    buf: &mut [u8],
    address: u8,
    length: u8,
    items: impl IntoIterator<Item = (u8, D)>,
) -> Result<&[u8], BufferTooSmall> {
    let mut writer = FrameWriter::new(buf, BROADCAST_ID, code::SYNC_WRITE);
    writer.extend(&[address, length]);
    for (id, data) in items {
        writer.push(id);
        let padded = data.as_ref().iter().copied().chain(core::iter::repeat(0));
        for byte in padded.take(usize::from(length)) {
            writer.push(byte);
        }
    }
    writer.finish()
}

/// Writes a bulk read. An id may stand in it once; a frame holds 84 servos.
pub fn encode_bulk_read(
    buf: &mut [u8],
    entries: impl IntoIterator<Item = BulkReadEntry>,
) -> Result<&[u8], BufferTooSmall> {
    let mut writer = FrameWriter::new(buf, BROADCAST_ID, code::BULK_READ);
    writer.push(0);
    for entry in entries {
        writer.extend(&[entry.length, entry.id, entry.address]);
    }
    writer.finish()
}
