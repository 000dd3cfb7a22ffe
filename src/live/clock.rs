//! The real clock.

use crate::base::{Clock, Time};
use std::time::{Duration, Instant};

/// The monotonic clock of the system, zero when it was made.
#[derive(Clone, Debug)]
pub struct RealClock {
    start: Instant,
}

impl RealClock {
    /// A clock that starts now.
    pub fn new() -> Self {
        Self {
            start: Instant::now(),
        }
    }
}

impl Default for RealClock {
    fn default() -> Self {
        Self::new()
    }
}

impl Clock for RealClock {
    fn now(&self) -> Time {
        Time::ZERO + self.start.elapsed()
    }

    fn sleep_until(&self, time: Time) {
        let wait = time.saturating_since(self.now());
        if wait > Duration::ZERO {
            std::thread::sleep(wait);
        }
    }
}
