//! A log in memory: one thread writes entries, another takes them away, neither ever waits.

use crate::base::Time;
use std::sync::atomic::{AtomicI64, AtomicU8, AtomicU64, AtomicUsize, Ordering};

/// A bounded byte queue for entries of one thread, read by one other.
///
/// Allocated once; writing takes no lock and never waits. An entry that finds no room is lost and counted, and
/// the next one that does is preceded by a gap ([`super::Event::Gap`]): what is behind cannot be replayed.
/// Should two threads write at once, bytes get mixed up and nothing worse.
#[derive(Debug)]
pub struct Log {
    name: String,
    cells: Box<[AtomicU8]>,
    /// Bytes written and taken since the start; their places are these modulo the size.
    written: AtomicUsize,
    taken: AtomicUsize,
    /// Entries lost since the last gap was written, and all of them.
    missing: AtomicU64,
    lost: AtomicU64,
    /// Time of the last entry that had one: times are written as differences.
    last: AtomicI64,
}

/// One entry being written.
#[derive(Debug)]
pub struct Entry<'a> {
    log: &'a Log,
    at: usize,
    end: usize,
    last: i64,
    full: bool,
}

impl Log {
    /// A log called `name` for `bytes` bytes that nobody has taken yet.
    pub fn new(name: &str, bytes: usize) -> Self {
        Self {
            name: name.to_owned(),
            cells: (0..bytes.max(64)).map(|_| AtomicU8::new(0)).collect(),
            written: AtomicUsize::new(0),
            taken: AtomicUsize::new(0),
            missing: AtomicU64::new(0),
            lost: AtomicU64::new(0),
            last: AtomicI64::new(0),
        }
    }

    /// Whose log this is: `control`, or a bus as written on the command line.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Writes one entry, whole or not at all. Only the thread whose log this is may call it.
    pub fn write(&self, fill: impl Fn(&mut Entry<'_>)) {
        let missing = self.missing.load(Ordering::Relaxed);
        let mut entry = self.entry();
        if missing > 0 {
            entry.byte(super::event::GAP);
            entry.number(missing);
        }
        fill(&mut entry);
        if entry.full {
            self.missing.store(missing + 1, Ordering::Relaxed);
            self.lost
                .store(self.lost.load(Ordering::Relaxed) + 1, Ordering::Relaxed);
            return;
        }
        let (at, last) = (entry.at, entry.last);
        self.missing.store(0, Ordering::Relaxed);
        self.last.store(last, Ordering::Relaxed);
        self.written.store(at, Ordering::Release);
    }

    fn entry(&self) -> Entry<'_> {
        let taken = self.taken.load(Ordering::Acquire);
        Entry {
            log: self,
            at: self.written.load(Ordering::Relaxed),
            end: taken.wrapping_add(self.cells.len()),
            last: self.last.load(Ordering::Relaxed),
            full: false,
        }
    }

    /// Moves all whole entries to the end of `out`. Only one thread may call it.
    pub fn take(&self, out: &mut Vec<u8>) {
        let written = self.written.load(Ordering::Acquire);
        let mut at = self.taken.load(Ordering::Relaxed);
        out.reserve(written.wrapping_sub(at));
        while at != written {
            out.push(self.cells[at % self.cells.len()].load(Ordering::Relaxed));
            at = at.wrapping_add(1);
        }
        self.taken.store(at, Ordering::Release);
    }

    /// Entries lost so far because nobody took them in time.
    pub fn lost(&self) -> u64 {
        self.lost.load(Ordering::Relaxed)
    }
}

impl Entry<'_> {
    /// Appends a byte.
    pub fn byte(&mut self, byte: u8) {
        if self.at == self.end {
            self.full = true;
        }
        if self.full {
            return;
        }
        self.log.cells[self.at % self.log.cells.len()].store(byte, Ordering::Relaxed);
        self.at = self.at.wrapping_add(1);
    }

    /// Appends a number, seven bits a byte, lowest first.
    pub fn number(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.byte(value as u8 | 0x80);
            value >>= 7;
        }
        self.byte(value as u8);
    }

    /// Appends a time as its difference from the log's last one.
    pub fn time(&mut self, time: Time) {
        let step = time.nanos().wrapping_sub(self.last);
        self.last = time.nanos();
        self.number((step << 1 ^ step >> 63) as u64);
    }

    /// Appends a float, bit for bit.
    pub fn float(&mut self, value: f64) {
        for byte in value.to_bits().to_le_bytes() {
            self.byte(byte);
        }
    }

    /// Appends bytes with their count.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.number(bytes.len() as u64);
        for &byte in bytes {
            self.byte(byte);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Event, Events};
    use super::*;

    #[test]
    fn what_finds_no_room_is_counted_and_leaves_a_gap() {
        let log = Log::new("bus", 64);
        for k in 0..20 {
            log.write(|e| Event::Now(Time::from_nanos(k * 1_000_000)).write(e));
        }
        let lost = log.lost();
        assert!((1..20).contains(&lost), "{lost} of 20 lost in 64 bytes");
        let mut bytes = Vec::new();
        log.take(&mut bytes);
        log.write(|e| Event::Now(Time::from_nanos(99)).write(e));
        log.take(&mut bytes);
        let events: Vec<Event> = Events::new(&bytes, Time::ZERO).collect();
        let kept = 20 - lost as usize;
        assert_eq!(events.len(), kept + 2, "{events:?}");
        assert_eq!(events[kept], Event::Gap(lost));
        assert_eq!(events[kept + 1], Event::Now(Time::from_nanos(99)));
    }

    #[test]
    fn entries_go_round_the_end_of_the_memory() {
        let log = Log::new("bus", 64);
        let mut bytes = Vec::new();
        for k in 0..1000u64 {
            log.write(|e| Event::Seen(3, k).write(e));
            if k % 7 == 0 {
                log.take(&mut bytes);
            }
        }
        log.take(&mut bytes);
        let events: Vec<Event> = Events::new(&bytes, Time::ZERO).collect();
        let whole = events.iter().zip(0..).all(|(e, k)| *e == Event::Seen(3, k));
        assert!(whole && events.len() == 1000, "{} events", events.len());
        assert_eq!(log.lost(), 0);
    }
}
