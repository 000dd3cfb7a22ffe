//! What a log consists of: the answers of clock, port and pose source, in the order in which they were asked.
//!
//! An event is a byte that names its kind, then its fields. Numbers take seven bits a byte, lowest first;
//! times are zig-zag differences in nanoseconds from the log's last one; floats are eight bytes, little end
//! first; byte strings are preceded by their count.

use super::log::Entry;
use crate::base::Time;
use crate::bus::PortError;
use std::time::Duration;

pub(super) const GAP: u8 = 0;
const OPEN: u8 = 1;
const NOW: u8 = 2;
const READ: u8 = 3;
const WRITE: u8 = 4;
const DISCARD: u8 = 5;
const BAUD: u8 = 6;
const FAULT: u8 = 7;
const POSE: u8 = 8;
const ENDED: u8 = 9;
const SEEN: u8 = 10;
const TARGETS: u8 = 11;

/// One answer from outside.
#[derive(Clone, Debug, PartialEq)]
pub enum Event<'a> {
    /// So many entries were lost here: nobody took them in time. No replay goes beyond.
    Gap(u64),
    /// The port as it was opened: name, baud rate, how long its adapter keeps bytes back.
    Open(&'a [u8], u32, Duration),
    /// The time, asked for by the program.
    Now(Time),
    /// Bytes came in (none: the deadline passed), at this time.
    Read(Time, &'a [u8]),
    /// Bytes were handed to the wire, at this time.
    Write(Time, &'a [u8]),
    /// What had come in was thrown away.
    Discard,
    /// The port was set to this rate.
    Baud(u32),
    /// The port failed in place of the answer.
    Fault(PortFault<'a>),
    /// A pose sample was due; its bytes mean something to whoever wrote them.
    Pose(&'a [u8]),
    /// The pose source ended.
    Ended,
    /// A value that others set while the run goes on has changed: its number and the value.
    Seen(u8, u64),
    /// Targets of an avatar: no bytes, their checksum.
    Targets(u64),
}

/// A failure of a port, with its words.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct PortFault<'a> {
    /// 0 cannot be opened, 1 gone, 2 baud rate refused.
    pub kind: u8,
    /// The rate of a refusal.
    pub baud: u32,
    /// What the system said.
    pub reason: &'a [u8],
    /// What to check.
    pub advice: &'a [u8],
}

impl<'a> PortFault<'a> {
    /// The failure as it is logged.
    pub fn of(error: &'a PortError) -> Self {
        let (kind, baud, reason, advice) = match error {
            PortError::Open { reason, advice, .. } => (0, 0, reason.as_str(), advice.as_str()),
            PortError::Gone { reason, .. } => (1, 0, reason.as_str(), ""),
            PortError::Baud { baud, reason, .. } => (2, *baud, reason.as_str(), ""),
        };
        Self {
            kind,
            baud,
            reason: reason.as_bytes(),
            advice: advice.as_bytes(),
        }
    }

    /// The failure of the port `port` again.
    pub fn error(&self, port: &str) -> PortError {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let (port, reason) = (port.to_owned(), text(self.reason));
        match self.kind {
            0 => PortError::Open {
                port,
                reason,
                advice: text(self.advice),
            },
            2 => PortError::Baud {
                port,
                baud: self.baud,
                reason,
            },
            _ => PortError::Gone { port, reason },
        }
    }
}

impl Event<'_> {
    /// Appends the event to a log. Allocates nothing.
    pub fn write(&self, entry: &mut Entry<'_>) {
        match self {
            Event::Gap(count) => {
                entry.byte(GAP);
                entry.number(*count);
            }
            Event::Open(name, baud, latency) => {
                entry.byte(OPEN);
                entry.bytes(name);
                entry.number(u64::from(*baud));
                entry.number(u64::try_from(latency.as_nanos()).unwrap_or(u64::MAX));
            }
            Event::Now(time) => {
                entry.byte(NOW);
                entry.time(*time);
            }
            Event::Read(time, bytes) => {
                entry.byte(READ);
                entry.time(*time);
                entry.bytes(bytes);
            }
            Event::Write(time, bytes) => {
                entry.byte(WRITE);
                entry.time(*time);
                entry.bytes(bytes);
            }
            Event::Discard => entry.byte(DISCARD),
            Event::Baud(baud) => {
                entry.byte(BAUD);
                entry.number(u64::from(*baud));
            }
            Event::Fault(fault) => {
                entry.byte(FAULT);
                entry.byte(fault.kind);
                entry.number(u64::from(fault.baud));
                entry.bytes(fault.reason);
                entry.bytes(fault.advice);
            }
            Event::Pose(sample) => {
                entry.byte(POSE);
                entry.bytes(sample);
            }
            Event::Ended => entry.byte(ENDED),
            Event::Seen(what, value) => {
                entry.byte(SEEN);
                entry.byte(*what);
                entry.number(*value);
            }
            Event::Targets(sum) => {
                entry.byte(TARGETS);
                entry.number(*sum);
            }
        }
    }

    /// What it is, for messages.
    pub fn kind(&self) -> &'static str {
        match self {
            Event::Gap(_) => "a gap in the recording",
            Event::Open(..) => "opening the port",
            Event::Now(_) => "a look at the clock",
            Event::Read(..) => "a read",
            Event::Write(..) => "a write",
            Event::Discard => "discarding input",
            Event::Baud(_) => "a change of baud rate",
            Event::Fault(_) => "a failure of the port",
            Event::Pose(_) => "a pose sample",
            Event::Ended => "the end of the poses",
            Event::Seen(..) => "a request from outside",
            Event::Targets(_) => "targets of an avatar",
        }
    }
}

/// Begins a [`Event::Pose`] of `bytes` bytes, which the caller appends: without a buffer in between.
pub fn begin_pose(entry: &mut Entry<'_>, bytes: usize) {
    entry.byte(POSE);
    entry.number(bytes as u64);
}

/// Fields of an event, one after the other; `None` when the bytes end.
#[derive(Copy, Clone, Debug)]
pub struct Fields<'a>(pub &'a [u8]);

impl<'a> Fields<'a> {
    /// A byte.
    pub fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    /// A number of seven bits a byte.
    pub fn number(&mut self) -> Option<u64> {
        let mut value = 0u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7F) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    /// A number of at most 32 bits.
    pub fn small(&mut self) -> Option<u32> {
        u32::try_from(self.number()?).ok()
    }

    /// A float.
    pub fn float(&mut self) -> Option<f64> {
        let (bytes, rest) = self.0.split_first_chunk::<8>()?;
        self.0 = rest;
        Some(f64::from_bits(u64::from_le_bytes(*bytes)))
    }

    /// Bytes with their count.
    pub fn bytes(&mut self) -> Option<&'a [u8]> {
        let count = usize::try_from(self.number()?).ok()?;
        let (bytes, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(bytes)
    }

    /// A count of things of at least a byte each, so that a damaged one cannot ask for memory.
    pub fn count(&mut self) -> Option<usize> {
        let count = usize::try_from(self.number()?).ok()?;
        (count <= self.0.len()).then_some(count)
    }
}

/// The events of a log, read again. Ends at the first byte that is not one, or in the middle of one.
#[derive(Clone, Debug)]
pub struct Events<'a> {
    fields: Fields<'a>,
    last: i64,
}

impl<'a> Events<'a> {
    /// Events in `bytes`, which follow an entry of time `base`.
    pub fn new(bytes: &'a [u8], base: Time) -> Self {
        Self {
            fields: Fields(bytes),
            last: base.nanos(),
        }
    }

    /// The time of the last event that had one.
    pub fn time(&self) -> Time {
        Time::from_nanos(self.last)
    }

    /// Bytes not read yet.
    pub fn remaining(&self) -> usize {
        self.fields.0.len()
    }

    fn time_field(&mut self) -> Option<Time> {
        let code = self.fields.number()?;
        let step = (code >> 1) as i64 ^ -((code & 1) as i64);
        self.last = self.last.wrapping_add(step);
        Some(self.time())
    }

    fn read(&mut self) -> Option<Event<'a>> {
        Some(match self.fields.byte()? {
            GAP => Event::Gap(self.fields.number()?),
            OPEN => Event::Open(
                self.fields.bytes()?,
                self.fields.small()?,
                Duration::from_nanos(self.fields.number()?),
            ),
            NOW => Event::Now(self.time_field()?),
            READ => Event::Read(self.time_field()?, self.fields.bytes()?),
            WRITE => Event::Write(self.time_field()?, self.fields.bytes()?),
            DISCARD => Event::Discard,
            BAUD => Event::Baud(self.fields.small()?),
            FAULT => Event::Fault(PortFault {
                kind: self.fields.byte()?,
                baud: self.fields.small()?,
                reason: self.fields.bytes()?,
                advice: self.fields.bytes()?,
            }),
            POSE => Event::Pose(self.fields.bytes()?),
            ENDED => Event::Ended,
            SEEN => Event::Seen(self.fields.byte()?, self.fields.number()?),
            TARGETS => Event::Targets(self.fields.number()?),
            _ => return None,
        })
    }
}

impl<'a> Iterator for Events<'a> {
    type Item = Event<'a>;

    fn next(&mut self) -> Option<Event<'a>> {
        let before = self.clone();
        let event = self.read();
        if event.is_none() {
            *self = before;
        }
        event
    }
}

#[cfg(test)]
mod tests {
    use super::super::Log;
    use super::*;
    use proptest::prelude::*;

    fn written(events: &[Event]) -> Vec<u8> {
        let log = Log::new("x", 1 << 16);
        for event in events {
            log.write(|entry| event.write(entry));
        }
        let mut bytes = Vec::new();
        log.take(&mut bytes);
        bytes
    }

    fn some_events<'a>() -> Vec<Event<'a>> {
        vec![
            Event::Open(b"/dev/ttyUSB0", 1_000_000, Duration::from_millis(1)),
            Event::Now(Time::from_nanos(i64::MAX)),
            Event::Write(Time::from_nanos(-5), &[0xFF, 0xFF, 0xFD]),
            Event::Read(Time::from_nanos(7_000_000), &[]),
            Event::Discard,
            Event::Baud(4_000_000),
            Event::Fault(PortFault {
                kind: 1,
                baud: 0,
                reason: b"unplugged",
                advice: b"",
            }),
            Event::Pose(&[1, 2, 3]),
            Event::Ended,
            Event::Seen(1, u64::MAX),
            Event::Targets(3),
            Event::Gap(4),
        ]
    }

    #[test]
    fn events_come_back_as_they_were() {
        let bytes = written(&some_events());
        let read: Vec<Event> = Events::new(&bytes, Time::ZERO).collect();
        assert_eq!(read, some_events());
    }

    #[test]
    fn a_log_cut_anywhere_gives_the_whole_events_before_the_cut() {
        let bytes = written(&some_events());
        let mut most = 0;
        for cut in 0..=bytes.len() {
            let read: Vec<Event> = Events::new(&bytes[..cut], Time::ZERO).collect();
            assert_eq!(read, some_events()[..read.len()], "cut at {cut}");
            assert!(read.len() >= most, "cut at {cut}");
            most = read.len();
        }
        assert_eq!(most, some_events().len());
    }

    proptest! {
        /// Any bytes are read without a panic and without end.
        #[test]
        fn noise_is_no_danger(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            prop_assert!(Events::new(&bytes, Time::ZERO).count() <= bytes.len());
        }
    }
}
