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

/// Bytes that the host will receive, in the order of their times.
#[derive(Debug)]
pub(super) struct Wire {
    bytes: VecDeque<(Time, u8)>,
}

impl Wire {
    pub fn new() -> Self {
        Self {
            bytes: VecDeque::with_capacity(8192),
        }
    }

    /// Puts bytes on the line, the first of which begins at `start`. Returns when the last one ended.
    ///
    /// Bytes of two senders that overlap damage each other.
    pub fn send(&mut self, start: Time, bytes: &[u8], pace: Pace, chance: &mut Chance) -> Time {
        for (index, &byte) in bytes.iter().enumerate() {
            let at = start + pace.bytes(index + 1);
            let byte = match self.collide(at, pace, chance) {
                true => byte ^ flip(chance),
                false => byte,
            };
            let behind = self.bytes.iter().rev().take_while(|(t, _)| *t > at);
            let place = self.bytes.len() - behind.count();
            self.bytes.insert(place, (at, byte));
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
        for (_, byte) in later
            .skip_while(|(t, _)| *t >= to)
            .take_while(|(t, _)| *t > from)
        {
            *byte ^= flip(chance);
            any = true;
        }
        any
    }

    /// When the byte that is `index` places from the next one ends.
    pub fn time_of(&self, index: usize) -> Option<Time> {
        self.bytes.get(index).map(|(t, _)| *t)
    }

    /// Takes the next byte if it has ended by `now`.
    pub fn pop(&mut self, now: Time) -> Option<u8> {
        let (at, byte) = *self.bytes.front()?;
        if at > now {
            return None;
        }
        self.bytes.pop_front();
        Some(byte)
    }

    /// Forgets everything on its way.
    pub fn clear(&mut self) {
        self.bytes.clear();
    }
}

/// A mask with one to eight bits set.
fn flip(chance: &mut Chance) -> u8 {
    (chance.bits() as u8) | 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_senders_at_once_damage_each_other_and_neighbours_do_not() {
        let pace = Pace {
            baud: Some(3_000_000),
        };
        let (mut wire, mut chance) = (Wire::new(), Chance::new(1));
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
        let (mut wire, mut chance) = (Wire::new(), Chance::new(1));
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
