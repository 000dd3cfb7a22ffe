//! Finds frames of Protocol 1.0 in a stream of bytes that may hold garbage, damage and halves.

use super::frame::{Frame, HEADER, MIN_LEN, PREFIX_LEN};
use super::is_valid_id;
use crate::Damage;
use crate::finder::{Finder, Framing, Start};

/// A streaming parser with room for frames of up to `N` bytes on the line; 259 hold any frame.
///
/// Works as [`crate::FrameParser`] does. A header of two bytes and a length of one are soon found in garbage,
/// which then waits for up to 255 bytes that do not come: say when the line is [idle](Self::line_idle), or
/// [clear](Self::clear) it before a new request.
#[derive(Clone, Debug)]
pub struct FrameParser<const N: usize>(Finder<N>);

impl<const N: usize> Default for FrameParser<N> {
    fn default() -> Self {
        Self::new()
    }
}

/// Frames of Protocol 1.0.
struct One;

impl Framing for One {
    const SHORTEST: usize = MIN_LEN;

    fn look(bytes: &[u8], most: usize) -> Start {
        let seen = bytes.len().min(HEADER.len());
        // A third FF is no id, so the last two of a row of them are the header.
        if bytes[..seen] != HEADER[..seen] || bytes.get(2).is_some_and(|&id| !is_valid_id(id)) {
            return Start::Garbage;
        }
        let needed = bytes
            .get(3)
            .map_or(MIN_LEN, |&field| PREFIX_LEN + usize::from(field));
        if !(MIN_LEN..=most).contains(&needed) {
            Start::Garbage
        } else if bytes.len() >= needed {
            Start::Complete(needed)
        } else {
            Start::Missing(needed - bytes.len())
        }
    }

    fn is_sound(bytes: &[u8]) -> bool {
        Frame::parse(bytes).is_ok()
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
        let bytes = self.0.next::<One>()?;
        // Checked by the finder.
        Frame::parse(bytes).ok()
    }

    /// How many bytes are missing at least until [`next_frame`](Self::next_frame) can give a frame; at least 1.
    pub fn missing(&self) -> usize {
        self.0.missing::<One>()
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

    /// What was thrown away since the parser was made; `bad_crc` counts wrong checksums.
    pub const fn damage(&self) -> Damage {
        self.0.damage()
    }
}
