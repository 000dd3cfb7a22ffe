//! The X series' registers as a servo with Protocol 1.0 shows them: which of its bytes to ask for, and what they mean.

use super::{COUNTERPARTS, Counterpart};
use crate::bus::dynamixel::model::{Access, Mode, Register, address};
use handwave_dynamixel::{baud, p1};
use std::ops::Range;

/// Bytes of its whole table.
pub const TABLE_BYTES: usize = 128;

/// Angle limits: both 0 make a wheel of it.
const ANGLE_LIMITS: Range<u8> = 6..10;
/// Baud rate: another code than that of the X series.
const BAUD_RATE: u8 = 4;
/// Shown for a rate that the X series does not have.
const NO_RATE: u8 = u8::MAX;
/// Drive mode bit 3: a goal turns torque on.
const TORQUE_ON_BY_GOAL: u8 = 0b1000;

/// What is known of a servo's own registers: some of the bytes, and the error bits of its answer.
#[derive(Copy, Clone, Debug)]
pub struct View<'a> {
    /// Address of the first byte.
    pub begin: u8,
    /// The bytes.
    pub bytes: &'a [u8],
    /// Error bits that tell how the servo is.
    pub conditions: u8,
}

/// Whether the bytes `a` and `b` have one in common.
fn meet(a: &Range<u16>, b: &Range<u16>) -> bool {
    a.start < b.end && b.start < a.end
}

fn of_x_series(entry: &Counterpart) -> Range<u16> {
    entry.x_series..entry.x_series + u16::from(entry.size)
}

/// The servo's own bytes that are needed to tell the X series' `length` bytes from `begin` on; empty where none are.
pub fn needed(begin: u16, length: usize) -> Range<u8> {
    let asked = begin..begin.saturating_add(u16::try_from(length).unwrap_or(u16::MAX));
    let own = COUNTERPARTS
        .iter()
        .filter(|entry| meet(&of_x_series(entry), &asked))
        .map(|entry| entry.own..entry.own + entry.own_size);
    let mode = address::OPERATING_MODE..address::OPERATING_MODE + 1;
    let own = own.chain(meet(&mode, &asked).then_some(ANGLE_LIMITS));
    let rate = address::BAUD_RATE..address::BAUD_RATE + 1;
    let own = own.chain(meet(&rate, &asked).then_some(BAUD_RATE..BAUD_RATE + 1));
    own.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end))
        .unwrap_or(0..0)
}

impl View<'_> {
    fn own(&self, begin: u8, size: u8) -> Option<&[u8]> {
        let from = usize::from(begin.checked_sub(self.begin)?);
        self.bytes.get(from..from + usize::from(size))
    }

    /// Fills `out` with the X series' registers from `begin` on.
    pub fn show(&self, begin: u16, out: &mut [u8]) {
        out.fill(0);
        let mut put = |x_series: u16, bytes: &[u8]| {
            for (at, &byte) in (x_series..).zip(bytes) {
                let place = at.checked_sub(begin).map(usize::from);
                if let Some(cell) = place.and_then(|place| out.get_mut(place)) {
                    *cell = byte;
                }
            }
        };
        for entry in &COUNTERPARTS {
            if let Some(own) = self.own(entry.own, entry.own_size) {
                let value = entry.register().decode(own);
                put(
                    entry.x_series,
                    &entry.widened(value)[..usize::from(entry.size)],
                );
            }
        }
        if let Some(&[code]) = self.own(BAUD_RATE, 1) {
            put(
                address::BAUD_RATE,
                &[baud::code(p1::baud::rate(code)).unwrap_or(NO_RATE)],
            );
        }
        if let Some(limits) = self.own(ANGLE_LIMITS.start, ANGLE_LIMITS.end - ANGLE_LIMITS.start) {
            put(address::OPERATING_MODE, &[mode(limits).number()]);
        }
        put(address::DRIVE_MODE, &[TORQUE_ON_BY_GOAL]);
        put(address::HARDWARE_ERROR_STATUS, &[self.conditions]);
    }
}

/// What the angle limits make of a servo.
fn mode(limits: &[u8]) -> Mode {
    match limits {
        [0, 0, 0, 0] => Mode::Velocity,
        // Several turns, on MX servos.
        [0xFF, 0x0F, 0xFF, 0x0F] => Mode::ExtendedPosition,
        _ => Mode::Position,
    }
}

impl Counterpart {
    /// As a register, to decode and encode its values.
    fn register(&self) -> Register {
        Register {
            name: "",
            address: self.own.into(),
            size: self.own_size,
            access: Access::Read,
            min: 0,
            max: 0,
            unit: "",
            sign: self.sign,
        }
    }

    fn widened(&self, value: i64) -> [u8; 4] {
        // In four bytes' reach: it came from two.
        (value as i32).to_le_bytes()
    }

    /// The servo's own bytes of `value`; the first [`own_size`](Self::own_size) count.
    pub fn narrowed(&self, value: i64) -> [u8; 4] {
        self.register().encode(value)
    }
}

/// The servo's own bytes for a write of `data` to the X series' `begin`, in `out`: the first address and how many.
///
/// What it does not have is left out where the write asks for no more than it is anyway, such as no watchdog; 0 bytes where
/// nothing is left. `None`: it has no such thing, what is written is not next to one another in its own table, or is only
/// a part of a register.
pub fn write(begin: u16, data: &[u8], out: &mut [u8; TABLE_BYTES]) -> Option<(u8, usize)> {
    if let (address::BAUD_RATE, &[code]) = (begin, data) {
        out[0] = p1::baud::code(baud::rate(code)?)?;
        return Some((BAUD_RATE, 1));
    }
    let end = begin.checked_add(u16::try_from(data.len()).ok()?)?;
    let written = begin..end;
    let has = |at: u16| {
        let mut all = COUNTERPARTS.iter();
        all.any(|entry| of_x_series(entry).contains(&at))
    };
    let as_it_is = |at: u16, value: u8| match at {
        address::OPERATING_MODE => value == Mode::Position.number(),
        _ => value == 0,
    };
    if !(begin..)
        .zip(data)
        .all(|(at, &value)| has(at) || as_it_is(at, value))
    {
        return None;
    }
    let (mut first, mut filled) = (0, 0usize);
    for entry in COUNTERPARTS
        .iter()
        .filter(|entry| meet(&of_x_series(entry), &written))
    {
        let place = usize::from(entry.x_series.checked_sub(begin)?);
        let cell = data.get(place..place + usize::from(entry.size))?;
        let value = cell
            .iter()
            .rev()
            .fold(0i64, |value, &byte| (value << 8) | i64::from(byte));
        if filled == 0 {
            first = entry.own;
        } else if usize::from(entry.own) != usize::from(first) + filled {
            return None;
        }
        let size = usize::from(entry.own_size);
        out.get_mut(filled..filled + size)?
            .copy_from_slice(&entry.narrowed(value)[..size]);
        filled += size;
    }
    Some((first, filled))
}
