//! The wire itself: bytes on their way to the host, each with its time, and what happens when two overlap.

use super::fault::Chance;
use crate::base::Time;
use std::collections::VecDeque;
use std::time::Duration;

/// How long bytes take on the line.
#[derive(Copy, Clone, Debug)]
pub(super) struct Pace {
    /// Bits per second; `None` = bytes take no time.
    pub baud: Option<u32>,
}

impl Pace {
    /// Time of `count` bytes. Computed from the count, so that no rounding adds up.
    pub fn bytes(self, count: usize) -> Duration {
        self.baud.map_or(Duration::ZERO, |baud| {
            handwave_dynamixel::wire::duration(count, baud)
        })
    }
}

/// A byte on its way to the host.
#[derive(Copy, Clone, Debug)]
struct Cell {
    /// When it ends on the line.
    at: Time,
    /// When the adapter hands it to the host.
    arrives: Time,
    byte: u8,
}

/// Bytes that the host will receive, in the order of their times.
#[derive(Debug)]
pub(super) struct Wire {
    bytes: VecDeque<Cell>,
    /// From the line to the host.
    pub delay: Duration,
    /// Probability with which a byte is lost on that way.
    pub loss: f64,
}

impl Wire {
    pub fn new(delay: Duration) -> Self {
        Self {
            bytes: VecDeque::with_capacity(8192),
            delay,
            loss: 0.0,
        }
    }

    /// Puts bytes on the line, the first of which begins at `start`. Returns when the last one ended.
    ///
    /// Bytes of two senders that overlap damage each other.
    pub fn send(&mut self, start: Time, bytes: &[u8], pace: Pace, chance: &mut Chance) -> Time {
        for (index, &byte) in bytes.iter().enumerate() {
            let at = start + pace.bytes(index + 1);
            let byte = match self.collide(at, pace, chance) {
                true => byte ^ chance.flips(),
                false => byte,
            };
            if self.loss > 0.0 && chance.happens(self.loss) {
                continue;
            }
            let behind = self.bytes.iter().rev().take_while(|cell| cell.at > at);
            let place = self.bytes.len() - behind.count();
            let before = place.checked_sub(1).and_then(|i| self.bytes.get(i));
            // An adapter does not change the order, also when its delay becomes shorter.
            let arrives = before.map_or(Time::from_nanos(i64::MIN), |cell| cell.arrives);
            let arrives = arrives.max(at + self.delay);
            self.bytes.insert(place, Cell { at, arrives, byte });
        }
        start + pace.bytes(bytes.len())
    }

    /// Damages the bytes that a byte ending at `at` overlaps; whether there are any.
    pub fn collide(&mut self, at: Time, pace: Pace, chance: &mut Chance) -> bool {
        let byte_time = pace.bytes(1);
        // Bytes of one sender are rounded to nanoseconds and so may seem to overlap by one.
        let touching = byte_time.saturating_sub(Duration::from_nanos(2));
        let (from, to) = (at - touching, at + touching);
        let mut any = false;
        let later = self.bytes.iter_mut().rev();
        for cell in later
            .skip_while(|cell| cell.at >= to)
            .take_while(|cell| cell.at > from)
        {
            cell.byte ^= chance.flips();
            any = true;
        }
        any
    }

    /// When the byte that is `index` places from the next one arrives at the host.
    pub fn arrival(&self, index: usize) -> Option<Time> {
        self.bytes.get(index).map(|cell| cell.arrives)
    }

    /// Takes the next byte if it has arrived by `now`.
    pub fn pop(&mut self, now: Time) -> Option<u8> {
        let next = self.bytes.front().filter(|cell| cell.arrives <= now)?;
        let byte = next.byte;
        self.bytes.pop_front();
        Some(byte)
    }

    /// Forgets everything on its way.
    pub fn clear(&mut self) {
        self.bytes.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_senders_at_once_damage_each_other_and_neighbours_do_not() {
        let pace = Pace {
            baud: Some(3_000_000),
        };
        let (mut wire, mut chance) = (Wire::new(Duration::ZERO), Chance::new(1));
        let end = wire.send(Time::ZERO, &[1; 50], pace, &mut chance);
        wire.send(end, &[2; 50], pace, &mut chance);
        wire.send(Time::ZERO + pace.bytes(70), &[3; 2], pace, &mut chance);
        let bytes: Vec<u8> = std::iter::from_fn(|| wire.pop(Time::from_secs(1.0))).collect();
        assert_eq!(bytes.len(), 102);
        let damaged = bytes.iter().filter(|b| ![1, 2, 3].contains(*b)).count();
        assert!(damaged <= 4, "{damaged} of 4 overlapping bytes changed");
        let untouched = bytes[..69].iter().all(|b| [1, 2].contains(b));
        assert!(untouched, "{bytes:?}");
        assert_eq!(bytes.iter().filter(|&&b| b == 3).count(), 0);
    }

    #[test]
    fn without_pace_nothing_takes_time_and_nothing_collides() {
        let (mut wire, mut chance) = (Wire::new(Duration::ZERO), Chance::new(1));
        let pace = Pace { baud: None };
        assert_eq!(
            wire.send(Time::ZERO, &[1, 2], pace, &mut chance),
            Time::ZERO
        );
        wire.send(Time::ZERO, &[3], pace, &mut chance);
        let bytes: Vec<u8> = std::iter::from_fn(|| wire.pop(Time::ZERO)).collect();
        assert_eq!(bytes, [1, 2, 3]);
    }
}
