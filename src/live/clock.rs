//! The real clock.

use crate::base::{Clock, Time};
use rustix::time::{ClockId, clock_gettime};
use std::time::Duration;

/// The system's clock that never jumps back and goes on while the machine is suspended, zero when it
/// was made. Servos do not sleep when the host does: their watchdogs must be seen to have run out.
#[derive(Clone, Debug)]
pub struct RealClock {
    start: Duration,
}

impl RealClock {
    /// A clock that starts now.
    pub fn new() -> Self {
        Self {
            start: since_boot(),
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
        Time::ZERO + since_boot().saturating_sub(self.start)
    }

    fn sleep_until(&self, time: Time) {
        let wait = time.saturating_since(self.now());
        if wait > Duration::ZERO {
            std::thread::sleep(wait);
        }
    }
}

/// The processor time that the calling thread has used so far, the kernel's work for it included.
pub fn thread_cpu_time() -> Duration {
    read(ClockId::ThreadCPUTime)
}

fn since_boot() -> Duration {
    read(ClockId::Boottime)
}

fn read(clock: ClockId) -> Duration {
    let now = clock_gettime(clock);
    let secs = u64::try_from(now.tv_sec).unwrap_or(0);
    Duration::new(secs, u32::try_from(now.tv_nsec).unwrap_or(0))
}
