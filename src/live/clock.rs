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

/// The time since 1970, UTC, by the system's wall clock: for names and labels of files, never for control.
pub fn unix_now() -> Duration {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since.unwrap_or_default()
}

/// A time since 1970 as `YYYYMMDD-HHMMSS`, UTC.
pub fn calendar(since_1970: Duration) -> String {
    let seconds = since_1970.as_secs();
    // Days to a date in the proleptic Gregorian calendar, counted in years that begin in March
    // (Hinnant, "chrono-compatible low-level date algorithms").
    let days = seconds / 86_400 + 719_468;
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era =
        (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted + 2) / 5 + 1;
    let month = if shifted < 10 {
        shifted + 3
    } else {
        shifted - 9
    };
    let year = era * 400 + year_of_era + u64::from(month <= 2);
    let (hour, minute, second) = (seconds / 3600 % 24, seconds / 60 % 60, seconds % 60);
    format!("{year:04}{month:02}{day:02}-{hour:02}{minute:02}{second:02}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (seconds, date) in [
            (0, "19700101-000000"),
            (951_782_399, "20000228-235959"),
            (951_782_400, "20000229-000000"),
            (1_735_689_599, "20241231-235959"),
            (4_107_542_400, "21000301-000000"),
        ] {
            assert_eq!(calendar(Duration::from_secs(seconds)), date);
        }
    }
}
