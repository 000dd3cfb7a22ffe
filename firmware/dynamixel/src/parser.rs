//! Finds frames in a stream of bytes that may hold garbage, damage and halves.

use crate::crc::crc16;
use crate::finder::{Finder, Framing, Start};
use crate::frame::{Frame, HEADER, MIN_LEN, PREFIX_LEN, holds_a_header};
use crate::is_valid_id;

/// What a parser had to throw away.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub struct Damage {
    /// Bytes that belong to no valid frame.
    pub stray_bytes: u32,
    /// Frames that looked right and had a wrong checksum.
    pub bad_crc: u32,
}

/// A streaming parser with room for frames of up to `N` bytes on the line.
///
/// Bytes go in by [`push`](Self::push) in pieces of any size, frames come out of
/// [`next_frame`](Self::next_frame). What is not a frame is skipped byte by byte, so a valid frame
/// behind or inside garbage is found. An idle line ends a frame that is not complete: say so by
/// [`line_idle`](Self::line_idle).
#[derive(Clone, Debug)]
pub struct FrameParser<const N: usize>(Finder<N>);

impl<const N: usize> Default for FrameParser<N> {
    fn default() -> Self {
        Self::new()
    }
}

/// Frames of Protocol 2.0.
struct Two;

impl Framing for Two {
    const SHORTEST: usize = MIN_LEN;

    fn look(bytes: &[u8], most: usize) -> Start {
        let seen = bytes.len().min(HEADER.len());
        if bytes[..seen] != HEADER[..seen] || bytes.get(4).is_some_and(|&id| !is_valid_id(id)) {
            return Start::Garbage;
        }
        let needed = match bytes.get(5..PREFIX_LEN) {
            None => MIN_LEN,
            Some(field) => PREFIX_LEN + usize::from(u16::from_le_bytes([field[0], field[1]])),
        };
        let (id, body_end) = (bytes.get(4), bytes.len().min(needed.saturating_sub(2)));
        let body = bytes.get(PREFIX_LEN..body_end).unwrap_or_default();
        if !(MIN_LEN..=most).contains(&needed) {
            Start::Garbage
        } else if id.is_some_and(|&id| holds_a_header(id, body)) {
            // A frame behind half a frame: no need to wait for the bytes that never come.
            Start::Garbage
        } else if bytes.len() >= needed {
            Start::Complete(needed)
        } else {
            Start::Missing(needed - bytes.len())
        }
    }

    fn is_sound(bytes: &[u8]) -> bool {
        bytes
            .split_last_chunk::<2>()
            .is_some_and(|(body, checksum)| crc16(body).to_le_bytes() == *checksum)
    }
}

impl<const N: usize> FrameParser<N> {
    /// An empty parser.
    pub const fn new() -> Self {
        FrameParser(Finder::new())
    }

    /// Takes in as many of `bytes` as there is room for and returns how many.
    ///
    /// All are taken if every frame was fetched before and `bytes` is at most
    /// `N -` [`buffered`](Self::buffered) long.
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        self.0.push(bytes)
    }

    /// Bytes received and not yet used.
    pub const fn buffered(&self) -> usize {
        self.0.buffered()
    }

    /// The next whole frame, or `None` until more bytes are pushed.
    pub fn next_frame(&mut self) -> Option<Frame<'_>> {
        let bytes = self.0.next::<Two>()?;
        // All that `parse` checks was checked by the finder.
        Frame::parse(bytes).ok()
    }

    /// How many bytes are missing at least until [`next_frame`](Self::next_frame) can give a frame; at least 1.
    ///
    /// Counted from the first byte that may be the start of one, so it is meant to be asked after
    /// `next_frame` gave `None`.
    pub fn missing(&self) -> usize {
        self.0.missing::<Two>()
    }

    /// Tells that the line was idle for longer than any sender pauses within a frame.
    ///
    /// What is incomplete now stays so: its first byte is dropped and the rest searched again.
    pub fn line_idle(&mut self) {
        self.0.line_idle();
    }

    /// Forgets all bytes. The damage counted so far stays.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// What was thrown away since the parser was made.
    pub const fn damage(&self) -> Damage {
        self.0.damage()
    }
}
