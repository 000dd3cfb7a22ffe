//! How much later than computed an answer may come: learnt from how late answers are.

use std::mem;
use std::time::Duration;

/// The allowance for adapter and system, between its bounds.
#[derive(Debug)]
pub struct Allowance {
    now: Duration,
    min: Duration,
    /// The one to begin with, and the most that mere silence leads to.
    first: Duration,
    max: Duration,
    /// How late answers are as a rule.
    typical: Duration,
    /// Answers in a row of which nothing came in time.
    misses: u32,
    /// The last answer was given up: what comes before the next request is late.
    gave_up: bool,
}

impl Allowance {
    /// Begins at `first`.
    pub fn new(min: Duration, first: Duration, max: Duration) -> Self {
        let max = max.max(first);
        Allowance {
            now: first,
            min: min.min(max),
            first,
            max,
            typical: Duration::ZERO,
            misses: 0,
            gave_up: false,
        }
    }

    /// As at first: another adapter may be another one.
    pub fn begin_anew(&mut self) {
        *self = Self::new(self.min, self.first, self.max);
    }

    pub fn get(&self) -> Duration {
        self.now
    }

    pub fn max(&self) -> Duration {
        self.max
    }

    /// How late answers are as a rule: one turn of adapter and system.
    pub fn typical(&self) -> Duration {
        self.typical
    }

    fn wish(&self, lateness: Duration) -> Duration {
        (lateness * 2 + Duration::from_micros(100)).clamp(self.min, self.max)
    }

    /// Learns from a complete answer that came `lateness` after its computed time.
    pub fn arrived(&mut self, lateness: Duration) {
        self.misses = 0;
        self.typical = (self.typical * 7 + lateness.min(self.max)) / 8;
        let wish = self.wish(lateness);
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

    /// An answer that was given up came in the end, or nothing comes at all. Not beyond the first allowance:
    /// one servo that is always late must not hold up the cycle.
    pub fn lengthen(&mut self) {
        self.now = self.now.max((self.now * 3 / 2).min(self.first));
    }

    /// An answer that was given up came `lateness` after its computed time, and was waited for.
    pub fn came_late(&mut self, lateness: Duration) {
        self.now = self.now.max(self.wish(lateness));
    }
}
