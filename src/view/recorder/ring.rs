//! The latest past of a run in memory, bounded, to be written when something went wrong.

use super::channel::Channel;
use super::file::{About, McapFile, Piece};
use crate::base::Time;
use std::collections::VecDeque;
use std::io;
use std::path::Path;
use std::time::Duration;

/// How far back messages and frames in words go.
const PAST: Duration = Duration::from_secs(60);
/// Memory of messages is a quarter of that of logs at most.
const MESSAGE_SHARE: usize = 4;
/// What an entry costs beside its bytes.
const OVERHEAD: usize = 64;

/// Logs of the whole run as long as they fit, then of its latest part; messages of the last minute.
#[derive(Debug, Default)]
pub(super) struct Ring {
    most_bytes: usize,
    pieces: VecDeque<Piece>,
    piece_bytes: usize,
    messages: VecDeque<(Channel, f64, String)>,
    message_bytes: usize,
    /// Nothing of the logs was dropped yet: the run can be replayed from its beginning.
    begun: bool,
}

impl Ring {
    /// A ring that keeps `most_bytes` of logs, and a quarter of it in messages.
    pub fn new(most_bytes: usize) -> Self {
        Self {
            most_bytes,
            begun: true,
            ..Self::default()
        }
    }

    pub fn piece(&mut self, piece: Piece) {
        self.piece_bytes += piece.bytes.len() + OVERHEAD;
        self.pieces.push_back(piece);
        while self.piece_bytes > self.most_bytes {
            let Some(old) = self.pieces.pop_front() else {
                break;
            };
            self.piece_bytes -= old.bytes.len() + OVERHEAD;
            self.begun = false;
        }
    }

    pub fn message(&mut self, channel: Channel, t_s: f64, text: String) {
        self.message_bytes += text.len() + OVERHEAD;
        self.messages.push_back((channel, t_s, text));
        let past = |t: f64| t_s - t > PAST.as_secs_f64();
        while self.message_bytes > self.most_bytes / MESSAGE_SHARE
            || self.messages.front().is_some_and(|(_, t, _)| past(*t))
        {
            let Some((_, _, old)) = self.messages.pop_front() else {
                break;
            };
            self.message_bytes -= old.len() + OVERHEAD;
        }
    }

    /// Writes all there is; true when it can be replayed from the beginning of the run.
    pub fn dump(&self, path: &Path, about: &About) -> io::Result<bool> {
        let mut file = McapFile::create(path, about, self.begun)?;
        let newest = self.pieces.back().map_or(Time::ZERO, |piece| piece.end);
        let mut messages = self.messages.iter().peekable();
        let mut started = false;
        for piece in &self.pieces {
            file.piece(piece, newest.saturating_since(piece.end) <= PAST);
            started |= piece.log == 0;
            // Messages in between, so that the file is in the order of time as far as pieces are.
            while let Some((channel, t_s, text)) =
                messages.next_if(|(_, t, _)| started && file.is_past(*t, piece.end))
            {
                file.message(*channel, *t_s, text);
            }
            file.flush_if_due();
        }
        for (channel, t_s, text) in messages {
            file.message(*channel, *t_s, text);
        }
        file.finish().map_err(io::Error::other)?;
        Ok(self.begun)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_bounded_and_the_latest_is_kept() {
        let mut ring = Ring::new(10_000);
        for k in 0..1000 {
            ring.piece(Piece {
                log: 1,
                base: Time::from_nanos(k),
                end: Time::from_nanos(k + 1),
                bytes: vec![0; 100],
            });
            ring.message(Channel::Bus, k as f64, "x".repeat(100));
        }
        assert!(ring.piece_bytes <= 10_000, "{} bytes", ring.piece_bytes);
        assert!(ring.message_bytes <= 2_500, "{} bytes", ring.message_bytes);
        assert!(!ring.begun);
        assert_eq!(
            ring.pieces.back().map(|p| p.end),
            Some(Time::from_nanos(1000))
        );
        assert_eq!(ring.messages.back().map(|m| m.1), Some(999.0));
        assert!(ring.messages.iter().all(|m| 999.0 - m.1 <= 60.0));
    }
}
