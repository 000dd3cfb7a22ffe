//! Single key presses from the terminal, as keyboards, presenter remotes and foot pedals send them.

use super::arrival::is_readable;
use crate::gesture::Mark;
use rustix::stdio::stdin;
use rustix::termios::{LocalModes, OptionalActions, SpecialCodeIndex, Termios};
use rustix::termios::{isatty, tcgetattr, tcsetattr};
use std::time::Duration;

/// The terminal with its keys read one by one, until dropped.
#[derive(Debug)]
pub struct Keys {
    before: Termios,
    bytes: Vec<u8>,
}

impl Keys {
    /// Takes the keys of standard input; `None` where that is no terminal.
    pub fn open() -> Option<Self> {
        if !isatty(stdin()) {
            return None;
        }
        let before = tcgetattr(stdin()).ok()?;
        let mut single = before.clone();
        // Ctrl-C stays a signal.
        single.local_modes -= LocalModes::ICANON | LocalModes::ECHO;
        single.special_codes[SpecialCodeIndex::VMIN] = 0;
        single.special_codes[SpecialCodeIndex::VTIME] = 0;
        tcsetattr(stdin(), OptionalActions::Now, &single).ok()?;
        Some(Self {
            before,
            bytes: Vec::new(),
        })
    }

    /// The next mark that a key gave, if there is one. Does not wait.
    pub fn mark(&mut self) -> Option<Mark> {
        self.fill();
        while !self.bytes.is_empty() {
            let (length, mark) = first_key(&self.bytes);
            self.bytes.drain(..length);
            if mark.is_some() {
                return mark;
            }
        }
        None
    }

    /// The next key, as the bytes that it sends: one for a letter, an escape sequence for an arrow. Does not wait.
    pub fn key(&mut self) -> Option<Vec<u8>> {
        self.fill();
        if self.bytes.is_empty() {
            return None;
        }
        let (length, _) = first_key(&self.bytes);
        Some(self.bytes.drain(..length).collect())
    }

    fn fill(&mut self) {
        let mut chunk = [0; 64];
        while is_readable(stdin(), Duration::ZERO).unwrap_or(false) {
            match rustix::io::read(stdin(), &mut chunk) {
                Ok(count) if count > 0 => self.bytes.extend_from_slice(&chunk[..count]),
                _ => break,
            }
        }
    }
}

impl Drop for Keys {
    fn drop(&mut self) {
        // A terminal that has gone needs no giving back.
        let _ = tcsetattr(stdin(), OptionalActions::Now, &self.before);
    }
}

/// Length in bytes of the first key in `bytes` (not empty), and what it means.
///
/// Space, Enter, Page Down and the right and down arrows are what presenter remotes and pedals send; Page Up
/// and left are their other button: once more. `q` and Escape leave.
fn first_key(bytes: &[u8]) -> (usize, Option<Mark>) {
    match bytes {
        [b' ' | b'\r' | b'\n', ..] => (1, Some(Mark::Next)),
        [b'q' | b'Q', ..] => (1, Some(Mark::Cancel)),
        [b'r' | b'R', ..] => (1, Some(Mark::Start)),
        [0x1b, b'[', b'6', b'~', ..] => (4, Some(Mark::Next)),
        [0x1b, b'[', b'5', b'~', ..] => (4, Some(Mark::Start)),
        [0x1b, b'[' | b'O', b'B' | b'C', ..] => (3, Some(Mark::Next)),
        [0x1b, b'[' | b'O', b'A' | b'D', ..] => (3, Some(Mark::Start)),
        // Another sequence: up to its last letter.
        [0x1b, b'[' | b'O', rest @ ..] => {
            let end = rest.iter().position(|b| (0x40..=0x7e).contains(b));
            (end.map_or(bytes.len(), |end| end + 3), None)
        }
        [0x1b, ..] => (1, Some(Mark::Cancel)),
        _ => (1, None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marks(mut bytes: &[u8]) -> Vec<Mark> {
        let mut found = Vec::new();
        while !bytes.is_empty() {
            let (length, mark) = first_key(bytes);
            found.extend(mark);
            bytes = &bytes[length..];
        }
        found
    }

    #[test]
    fn keys_of_remotes_and_pedals_are_marks_and_others_are_none() {
        assert_eq!(marks(b" \r\n\x1b[6~\x1b[C\x1bOB"), [Mark::Next; 6]);
        assert_eq!(marks(b"r\x1b[5~\x1b[D"), [Mark::Start; 3]);
        assert_eq!(marks(b"xyz\x1b[15~\x1b[1;5P7"), []);
        assert_eq!(marks(b"q\x1b"), [Mark::Cancel; 2]);
        for length in 1..6 {
            // No sequence, whole or cut, loops or panics.
            for byte in 0..=255 {
                let bytes = [0x1b, b'[', byte, byte, b'~', byte];
                marks(&bytes[..length]);
            }
        }
    }
}
