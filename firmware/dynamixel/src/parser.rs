//! Finds frames in a stream of bytes that may hold garbage, damage and halves.

use crate::frame::{Frame, FrameError, HEADER, MIN_LEN, PREFIX_LEN, holds_a_header};
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
pub struct FrameParser<const N: usize> {
    buf: [u8; N],
    /// Start of what was not consumed.
    start: usize,
    /// End of what was received.
    end: usize,
    /// Bytes before this place arrived before an idle gap: no frame reaches across it.
    gap: usize,
    damage: Damage,
}

impl<const N: usize> Default for FrameParser<N> {
    fn default() -> Self {
        Self::new()
    }
}

/// What stands at the start of the buffered bytes.
enum Candidate {
    /// Too few bytes to know more; this many are missing at least.
    Missing(usize),
    /// Cannot be the start of a frame.
    Garbage,
    /// All bytes of a frame of this length are there.
    Complete(usize),
}

impl<const N: usize> FrameParser<N> {
    /// An empty parser.
    pub const fn new() -> Self {
        FrameParser {
            buf: [0; N],
            start: 0,
            end: 0,
            gap: 0,
            damage: Damage {
                stray_bytes: 0,
                bad_crc: 0,
            },
        }
    }

    /// Takes in as many of `bytes` as there is room for and returns how many.
    ///
    /// All are taken if every frame was fetched before and `bytes` is at most
    /// `N -` [`buffered`](Self::buffered) long.
    pub fn push(&mut self, bytes: &[u8]) -> usize {
        if self.start > 0 {
            self.buf.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.gap = self.gap.saturating_sub(self.start);
            self.start = 0;
        }
        let taken = bytes.len().min(N - self.end);
        self.buf[self.end..self.end + taken].copy_from_slice(&bytes[..taken]);
        self.end += taken;
        taken
    }

    /// Bytes received and not yet used.
    pub const fn buffered(&self) -> usize {
        self.end - self.start
    }

    /// The next whole frame, or `None` until more bytes are pushed.
    pub fn next_frame(&mut self) -> Option<Frame<'_>> {
        let (from, len) = loop {
            match self.candidate() {
                Candidate::Missing(_) => return None,
                Candidate::Garbage => {}
                Candidate::Complete(len) => {
                    let covered = &self.buf[self.start..self.start + len];
                    let (body, checksum) = covered.split_at(len - 2);
                    if crate::crc::crc16(body).to_le_bytes() == checksum {
                        break (self.start, len);
                    }
                    self.damage.bad_crc = self.damage.bad_crc.saturating_add(1);
                }
            }
            self.start += 1;
            self.damage.stray_bytes = self.damage.stray_bytes.saturating_add(1);
        };
        self.start = from + len;
        let frame: Result<_, FrameError> = Frame::parse(&mut self.buf[from..from + len]);
        // All that `parse` checks was checked above and in `candidate`.
        frame.ok()
    }

    /// How many bytes are missing at least until [`next_frame`](Self::next_frame) can give a frame; at least 1.
    ///
    /// Counted from the first byte that may be the start of one, so it is meant to be asked after
    /// `next_frame` gave `None`.
    pub fn missing(&self) -> usize {
        match self.candidate() {
            Candidate::Missing(count) => count,
            Candidate::Garbage | Candidate::Complete(_) => 1,
        }
    }

    /// Tells that the line was idle for longer than any sender pauses within a frame.
    ///
    /// What is incomplete now stays so: its first byte is dropped and the rest searched again.
    pub fn line_idle(&mut self) {
        self.gap = self.end;
    }

    /// Forgets all bytes. The damage counted so far stays.
    pub fn clear(&mut self) {
        self.start = 0;
        self.end = 0;
        self.gap = 0;
    }

    /// What was thrown away since the parser was made.
    pub const fn damage(&self) -> Damage {
        self.damage
    }

    fn candidate(&self) -> Candidate {
        let bytes = &self.buf[self.start..self.end];
        if bytes.is_empty() {
            return Candidate::Missing(MIN_LEN);
        }
        let seen = bytes.len().min(HEADER.len());
        if bytes[..seen] != HEADER[..seen] || bytes.get(4).is_some_and(|&id| !is_valid_id(id)) {
            return Candidate::Garbage;
        }
        let needed = match bytes.get(5..PREFIX_LEN) {
            None => MIN_LEN,
            Some(field) => PREFIX_LEN + usize::from(u16::from_le_bytes([field[0], field[1]])),
        };
        let (id, body_end) = (bytes.get(4), bytes.len().min(needed.saturating_sub(2)));
        let body = bytes.get(PREFIX_LEN..body_end).unwrap_or_default();
        if !(MIN_LEN..=N).contains(&needed) {
            Candidate::Garbage
        } else if id.is_some_and(|&id| holds_a_header(id, body)) {
            // A frame behind half a frame: no need to wait for the bytes that never come.
            Candidate::Garbage
        } else if bytes.len() >= needed && self.start + needed > self.gap && self.start < self.gap {
            // Its end came after an idle gap: two halves of different frames.
            Candidate::Garbage
        } else if bytes.len() >= needed {
            Candidate::Complete(needed)
        } else if self.start < self.gap {
            Candidate::Garbage
        } else {
            Candidate::Missing(needed - bytes.len())
        }
    }
}
