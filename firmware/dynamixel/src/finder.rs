//! What the stream parsers of both protocols share: bytes in, the places of frames out.

use crate::Damage;

/// What stands at the start of some bytes.
pub(crate) enum Start {
    /// Too few bytes to know more; this many are missing at least.
    Missing(usize),
    /// Cannot be the start of a frame.
    Garbage,
    /// All bytes of a frame of this length are there.
    Complete(usize),
}

/// How a protocol's frames are told from other bytes.
pub(crate) trait Framing {
    /// What stands at the start of `bytes`, of which there is at least one; frames longer than `most` count as garbage.
    fn look(bytes: &[u8], most: usize) -> Start;
    /// Whether the bytes of a complete frame have the right checksum.
    fn is_sound(bytes: &[u8]) -> bool;
    /// Bytes of the shortest frame.
    const SHORTEST: usize;
}

/// A buffer of `N` bytes in which frames are looked for, byte by byte where they are not.
#[derive(Clone, Debug)]
pub(crate) struct Finder<const N: usize> {
    buf: [u8; N],
    /// Start of what was not consumed.
    start: usize,
    /// End of what was received.
    end: usize,
    /// Bytes before this place arrived before an idle gap: no frame reaches across it.
    gap: usize,
    damage: Damage,
}

impl<const N: usize> Finder<N> {
    pub const fn new() -> Self {
        Finder {
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

    pub const fn buffered(&self) -> usize {
        self.end - self.start
    }

    /// The bytes of the next sound frame, which are consumed.
    pub fn next<F: Framing>(&mut self) -> Option<&mut [u8]> {
        let (from, len) = loop {
            match self.candidate::<F>() {
                Start::Missing(_) => return None,
                Start::Garbage => {}
                Start::Complete(len) => {
                    if F::is_sound(&self.buf[self.start..self.start + len]) {
                        break (self.start, len);
                    }
                    self.damage.bad_crc = self.damage.bad_crc.saturating_add(1);
                }
            }
            self.start += 1;
            self.damage.stray_bytes = self.damage.stray_bytes.saturating_add(1);
        };
        self.start = from + len;
        Some(&mut self.buf[from..from + len])
    }

    /// How many bytes are missing at least until [`next`](Self::next) can give a frame; at least 1.
    pub fn missing<F: Framing>(&self) -> usize {
        match self.candidate::<F>() {
            Start::Missing(count) => count,
            Start::Garbage | Start::Complete(_) => 1,
        }
    }

    /// The line was idle for longer than any sender pauses within a frame.
    pub fn line_idle(&mut self) {
        self.gap = self.end;
    }

    /// Forgets all bytes, not the damage.
    pub fn clear(&mut self) {
        self.start = 0;
        self.end = 0;
        self.gap = 0;
    }

    pub const fn damage(&self) -> Damage {
        self.damage
    }

    fn candidate<F: Framing>(&self) -> Start {
        let bytes = &self.buf[self.start..self.end];
        if bytes.is_empty() {
            return Start::Missing(F::SHORTEST);
        }
        let is_before_gap = self.start < self.gap;
        match F::look(bytes, N) {
            // Its end came, or would come, after an idle gap: two halves of different frames.
            Start::Complete(len) if is_before_gap && self.start + len > self.gap => Start::Garbage,
            Start::Missing(_) if is_before_gap => Start::Garbage,
            found => found,
        }
    }
}
