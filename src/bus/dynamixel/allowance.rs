//! How much later than computed an answer may come: learnt from how late answers are.

use std::mem;
use std::time::Duration;

/// The allowance for adapter and system, between its bounds.
#[derive(Debug)]
pub struct Allowance {
    now: Duration,
    min: Duration,
    max: Duration,
    /// Answers in a row of which nothing came in time.
    misses: u32,
    /// The last answer was given up: what comes before the next request is late.
    gave_up: bool,
}

impl Allowance {
    /// Begins at `max`.
    pub fn new(min: Duration, max: Duration) -> Self {
        Allowance {
            now: max,
            min: min.min(max),
            max,
            misses: 0,
            gave_up: false,
        }
    }

    pub fn get(&self) -> Duration {
        self.now
    }

    pub fn max(&self) -> Duration {
        self.max
    }

    /// Learns from a complete answer that came `lateness` after its computed time.
    pub fn arrived(&mut self, lateness: Duration) {
        self.misses = 0;
        let wish = (lateness * 2 + Duration::from_micros(100)).clamp(self.min, self.max);
        // Up at once, down slowly: one quick answer says little about the next.
        self.now = match self.now.checked_sub(wish) {
            Some(excess) => self.now - excess / 64,
            None => wish,
        };
    }

    /// Learns from an answer that was given up. That nothing came of it, several times in a row, may
    /// mean that answers are late; a part of it means that the rest is lost.
    pub fn missed(&mut self, nothing: bool) {
        self.gave_up = true;
        self.misses = if nothing {
            self.misses.saturating_add(1)
        } else {
            0
        };
        if self.misses > 1 {
            self.lengthen();
        }
    }

    /// Whether an answer was given up since this was last asked.
    pub fn take_gave_up(&mut self) -> bool {
        mem::take(&mut self.gave_up)
    }

    /// An answer was late rather than lost.
    pub fn lengthen(&mut self) {
        self.now = (self.now * 3 / 2).min(self.max);
    }
}
