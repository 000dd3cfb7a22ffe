//! How servos are beside their motion: temperature, voltage and hardware error, read of one servo in some
//! cycles, where the cycle has room.
//!
//! In turn rather than with every state: three bytes more of every servo in every cycle would cost 36 bytes a
//! cycle for twelve servos (7200 a second at 200 Hz); a read of its own costs 28 bytes, 840 a second.
//! The hardware error needs no reading in most turns: the alert flag of every answer tells when it changes.

use super::chain::DynamixelChain;
use super::client::ClientError;
use super::cycle::bit;
use super::model::{Model, Protocol, Register, address};
use crate::base::Time;
use crate::bus::{BusError, ServoHealth};
use handwave_dynamixel::wire;
use std::time::Duration;

/// Each servo has its turn this often.
const TURN_EVERY: Duration = Duration::from_millis(400);
/// In one turn of so many the hardware error is read though the alert flag did not change.
const ERROR_TURN: u8 = 4;
/// Left of the cycle after the read.
const MARGIN: Duration = Duration::from_micros(100);
/// Longest span of registers that is read in one go.
const SPAN_BYTES: usize = 8;

/// Counts of supply voltage in a volt.
const COUNTS_PER_VOLT: f64 = 10.0;

/// Where a model keeps what is watched.
#[derive(Copy, Clone, Debug, Default)]
struct Vitals {
    /// First byte and length of the span that holds voltage and temperature.
    address: u16,
    length: usize,
    voltage: Option<&'static Register>,
    temperature: Option<&'static Register>,
    /// Address of the hardware error.
    error: Option<u16>,
}

impl Vitals {
    fn of(model: &'static Model) -> Self {
        let named = |names: [&str; 2]| names.into_iter().find_map(|name| model.register(name));
        let voltage = named(["present_input_voltage", "present_voltage"]);
        let temperature = named(["present_temperature", "present_internal_temperature"]);
        let ends = |register: &Register| {
            let begin = usize::from(register.address);
            (begin, begin + usize::from(register.size))
        };
        let both = voltage.into_iter().chain(temperature).map(ends);
        let (begin, end) = both.fold((usize::MAX, 0), |(a, b), (c, d)| (a.min(c), b.max(d)));
        let near = begin < end && end - begin <= SPAN_BYTES;
        Vitals {
            // Both fit: addresses are 16 bits.
            address: if near { begin as u16 } else { 0 },
            length: if near { end - begin } else { 0 },
            voltage: voltage.filter(|_| near),
            temperature: temperature.filter(|_| near),
            error: match model.protocol {
                Protocol::Two => named(["hardware_error_status", "hardware_error"])
                    .map(|register| register.address),
                Protocol::One => Some(model.layout.at(address::HARDWARE_ERROR_STATUS)),
            },
        }
    }

    /// The value of `register` in the bytes of the span.
    fn value(&self, register: Option<&Register>, bytes: &[u8]) -> Option<f64> {
        let register = register?;
        let begin = usize::from(register.address.checked_sub(self.address)?);
        let bytes = bytes.get(begin..begin + usize::from(register.size))?;
        Some(register.decode(bytes) as f64)
    }
}

/// What is asked in a turn.
#[derive(Copy, Clone, PartialEq, Eq)]
enum Turn {
    Vitals,
    Error,
}

/// Who is looked at next, and what was found.
#[derive(Debug)]
pub(super) struct Watch {
    vitals: Vec<Vitals>,
    pub(super) values: Vec<ServoHealth>,
    /// The alert flag for which the hardware error was read last.
    alerts: Vec<bool>,
    /// Turns that each servo had.
    turns: Vec<u8>,
    next: usize,
    due_at: Time,
}

impl Watch {
    pub(super) fn new(models: impl Iterator<Item = &'static Model>, now: Time) -> Self {
        let vitals: Vec<Vitals> = models.map(Vitals::of).collect();
        let count = vitals.len();
        Watch {
            vitals,
            values: vec![ServoHealth::default(); count],
            alerts: vec![false; count],
            turns: vec![0; count],
            next: 0,
            due_at: now,
        }
    }

    fn period(&self) -> Duration {
        TURN_EVERY / u32::try_from(self.values.len().max(1)).unwrap_or(u32::MAX)
    }
}

impl DynamixelChain {
    /// Looks at one servo if one is due and the cycle that began at `begin` has room. `alert_mask` is that
    /// of the cycle's report. An answer that does not come is no silence: the next cycle tells.
    pub(super) fn look_after_health(
        &mut self,
        begin: Time,
        alert_mask: u64,
    ) -> Result<(), BusError> {
        let now = self.client.now();
        let alert = |index: usize| alert_mask & bit(index) != 0;
        let count = self.servos.len();
        let watch = &self.watch;
        // A flag that changed is looked into at once.
        let changed = (0..count).find(|&index| {
            let known = watch.vitals[index].error.is_some();
            known && self.servos[index].fresh && alert(index) != watch.alerts[index]
        });
        let (index, turn) = match changed {
            Some(index) => (index, Turn::Error),
            None if now < watch.due_at => return Ok(()),
            None => {
                let in_turn = (0..count).map(|step| (watch.next + step) % count);
                let Some(index) = in_turn.into_iter().find(|&index| self.servos[index].fresh)
                else {
                    return Ok(());
                };
                let for_error = (watch.turns[index] + 1).is_multiple_of(ERROR_TURN)
                    || watch.vitals[index].length == 0;
                let turn = if for_error { Turn::Error } else { Turn::Vitals };
                (index, turn)
            }
        };
        let length = match turn {
            Turn::Vitals => watch.vitals[index].length,
            Turn::Error => 1,
        };
        let bytes = wire::READ + wire::status(length);
        let needed = wire::duration(bytes, self.client.baud()) + self.client.lateness();
        let end = begin + self.options.cycle_budget - MARGIN;
        if now + needed > end {
            return Ok(());
        }
        if changed.is_none() {
            let watch = &mut self.watch;
            watch.due_at = now + watch.period();
            watch.next = (index + 1) % count;
            watch.turns[index] = (watch.turns[index] + 1) % ERROR_TURN;
        }
        self.read_health(index, turn, end, alert(index))
    }

    /// Reads all that is watched, of every servo; who does not answer is left out.
    pub(super) fn read_all_health(&mut self) -> Result<(), BusError> {
        for index in 0..self.servos.len() {
            for turn in [Turn::Vitals, Turn::Error] {
                let patience = self.client.now() + TURN_EVERY;
                self.read_health(index, turn, patience, false)?;
            }
        }
        self.watch.due_at = self.client.now();
        Ok(())
    }

    fn read_health(
        &mut self,
        index: usize,
        turn: Turn,
        latest: Time,
        alert: bool,
    ) -> Result<(), BusError> {
        let vitals = self.watch.vitals[index];
        let (begin, length) = match (turn, vitals.error) {
            (Turn::Vitals, _) => (vitals.address, vitals.length),
            (Turn::Error, Some(error)) => (error, 1),
            (Turn::Error, None) => return Ok(()),
        };
        let mut bytes = [0; SPAN_BYTES];
        let Some(bytes) = bytes.get_mut(..length).filter(|bytes| !bytes.is_empty()) else {
            return Ok(());
        };
        let id = self.servos[index].spec.id;
        match self.client.read_by(id, begin, bytes, latest) {
            Ok(_) => {}
            Err(ClientError::Port(error)) => return Err(error.into()),
            Err(_) => return Ok(()),
        }
        let value = &mut self.watch.values[index];
        value.measured_at = Some(self.client.now());
        match turn {
            Turn::Vitals => {
                let volts = vitals.value(vitals.voltage, bytes);
                value.voltage_v = volts.map(|count| count / COUNTS_PER_VOLT);
                value.temperature_c = vitals.value(vitals.temperature, bytes);
            }
            Turn::Error => {
                value.hardware_error = bytes[0].into();
                self.watch.alerts[index] = alert;
            }
        }
        Ok(())
    }
}
