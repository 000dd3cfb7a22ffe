//! The real clock.

use crate::base::{Clock, Time};
use std::thread;
use std::time::Instant;

/// Real, monotonic time since the clock was made.
#[derive(Copy, Clone, Debug)]
pub struct RealClock {
    start: Instant,
}

impl RealClock {
    /// A clock that stands at [`Time::ZERO`] now.
    pub fn new() -> Self {
        RealClock {
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
        thread::sleep(time.saturating_since(self.now()));
    }
}
