//! Points in time as arguments, and the clock trait that only `live` implements for real.

use std::ops::{Add, Sub};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;

/// A point in time, in nanoseconds since the start of the run (monotonic).
///
/// Negative values are before the start. Arithmetic saturates, so no input can overflow it.
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Hash)]
pub struct Time(i64);

impl Time {
    /// The start of the run.
    pub const ZERO: Time = Time(0);

    /// `nanos` nanoseconds after the start.
    pub const fn from_nanos(nanos: i64) -> Self {
        Time(nanos)
    }

    /// `secs` seconds after the start, rounded to the nearest nanosecond.
    ///
    /// NaN becomes zero, values beyond about 292 years saturate.
    pub fn from_secs(secs: f64) -> Self {
        Time((secs * 1e9).round() as i64)
    }

    /// Nanoseconds since the start.
    pub const fn nanos(self) -> i64 {
        self.0
    }

    /// Seconds since the start.
    pub fn secs(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// Seconds from `earlier` to `self`; negative when `earlier` is later.
    pub fn secs_since(self, earlier: Time) -> f64 {
        self.0.saturating_sub(earlier.0) as f64 * 1e-9
    }

    /// Time from `earlier` to `self`, zero when `earlier` is later.
    pub fn saturating_since(self, earlier: Time) -> Duration {
        Duration::from_nanos(self.0.saturating_sub(earlier.0).max(0) as u64)
    }
}

impl Add<Duration> for Time {
    type Output = Time;
    fn add(self, span: Duration) -> Time {
        Time(
            self.0
                .saturating_add(i64::try_from(span.as_nanos()).unwrap_or(i64::MAX)),
        )
    }
}

impl Sub<Duration> for Time {
    type Output = Time;
    fn sub(self, span: Duration) -> Time {
        Time(
            self.0
                .saturating_sub(i64::try_from(span.as_nanos()).unwrap_or(i64::MAX)),
        )
    }
}

/// A source of time that can be waited on.
///
/// The real clock lives in `live`; everything below takes a clock or a [`Time`] as an argument,
/// so the same code runs in virtual time.
pub trait Clock: Send + Sync {
    /// The time now.
    fn now(&self) -> Time;
    /// Returns at `time` or later; at once when `time` has passed.
    fn sleep_until(&self, time: Time);
    /// A clock of its own for one of several things that happen at the same time and are computed one
    /// after the other: it begins where this one stands. `None` where time passes by itself.
    fn branch(&self) -> Option<VirtualClock> {
        None
    }
}

/// A clock that stands still until somebody waits on it: sleeping moves it forward.
///
/// Clones share the same time. Meant for one thread that owns both ends of a simulated wire.
#[derive(Clone, Debug, Default)]
pub struct VirtualClock(Arc<AtomicI64>);

impl VirtualClock {
    /// A clock that stands at [`Time::ZERO`].
    pub fn new() -> Self {
        Self::default()
    }

    /// Moves the clock forward to `time`; never backwards.
    pub fn advance_to(&self, time: Time) {
        self.0.fetch_max(time.nanos(), Ordering::Relaxed);
    }
}

impl Clock for VirtualClock {
    fn now(&self) -> Time {
        Time(self.0.load(Ordering::Relaxed))
    }
    fn sleep_until(&self, time: Time) {
        self.advance_to(time);
    }
    fn branch(&self) -> Option<VirtualClock> {
        let branch = VirtualClock::new();
        branch.advance_to(self.now());
        Some(branch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arithmetic_saturates_instead_of_overflowing() {
        let late = Time::from_nanos(i64::MAX);
        assert_eq!(late + Duration::from_secs(1), late);
        assert_eq!(Time::from_secs(f64::NAN), Time::ZERO);
        assert_eq!(
            Time::ZERO.saturating_since(Time::from_secs(1.0)),
            Duration::ZERO
        );
    }

    #[test]
    fn virtual_clock_moves_when_waited_on_and_never_back() {
        let clock = VirtualClock::new();
        let other = clock.clone();
        clock.sleep_until(Time::from_secs(0.5));
        other.sleep_until(Time::from_secs(0.25));
        assert_eq!(clock.now(), Time::from_secs(0.5));
    }
}
