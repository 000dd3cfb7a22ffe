//! How one servo is at an instant, in one read: position, speed, effort, temperature, voltage, errors, torque.

use super::client::{Client, ClientError};
use super::model::{Model, Protocol, Register, address, hardware_error};

/// Registers that tell how a servo is.
const TORQUE: &str = "torque_enable";
const ERRORS: &str = "hardware_error_status";
const EFFORT: [&str; 2] = ["present_current", "present_load"];
const VELOCITY: [&str; 2] = ["present_velocity", "present_speed"];
const POSITION: &str = "present_position";
const VOLTAGE: [&str; 2] = ["present_input_voltage", "present_voltage"];
const TEMPERATURE: &str = "present_temperature";
/// Longest read, bytes.
const LONGEST: usize = 160;

/// How a servo is. What its model does not report is `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vitals {
    /// Present position, pulses.
    pub pulse: Option<i64>,
    /// Present velocity with its unit, such as (1.37, "rev/min").
    pub velocity: Option<(f64, &'static str)>,
    /// Present load or current with its unit, such as (3.2, "%") or (-40.0, "mA").
    pub effort: Option<(f64, &'static str)>,
    /// Degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Volts.
    pub voltage_v: Option<f64>,
    /// Hardware error status, bits of [`hardware_error`].
    pub errors: u8,
    /// Whether torque is on.
    pub torque: Option<bool>,
}

impl Vitals {
    /// Reads them from servo `id`: one instruction over all their registers. Changes nothing.
    ///
    /// # Errors
    /// The servo does not answer or refuses.
    pub fn read(
        client: &mut dyn Client,
        id: u8,
        model: &'static Model,
    ) -> Result<Self, ClientError> {
        let names = [TORQUE, ERRORS, POSITION, TEMPERATURE];
        let all = names.iter().chain(&EFFORT).chain(&VELOCITY).chain(&VOLTAGE);
        let registers: Vec<&Register> = all.filter_map(|name| model.register(name)).collect();
        let begin = registers.iter().map(|r| r.address).min().unwrap_or(0);
        let end = registers
            .iter()
            .map(|r| r.address + u16::from(r.size))
            .max();
        let length = usize::from(end.unwrap_or(begin) - begin);
        if length == 0 || length > LONGEST {
            return Ok(Self::default());
        }
        let mut bytes = [0; LONGEST];
        let reply = client.read(id, begin, &mut bytes[..length])?;
        let mut vitals = Self::decode(model, begin, &bytes[..length]);
        if reply.alert && model.protocol == Protocol::One {
            // No register of its own: they stand in every answer.
            let mut errors = [0];
            client.read(
                id,
                model.layout.at(address::HARDWARE_ERROR_STATUS),
                &mut errors,
            )?;
            [vitals.errors] = errors;
        }
        Ok(vitals)
    }

    /// From the bytes of the registers from `begin` on; registers that lie outside are `None`.
    pub fn decode(model: &'static Model, begin: u16, bytes: &[u8]) -> Self {
        let raw = |name: &str| {
            let register = model.register(name)?;
            let from = usize::from(register.address.checked_sub(begin)?);
            let cell = bytes.get(from..from + usize::from(register.size))?;
            Some((register, register.decode(cell)))
        };
        let first = |names: &[&str]| names.iter().find_map(|name| raw(name));
        let in_units = |found: Option<(&'static Register, i64)>| {
            found.map(|(register, value)| {
                let (factor, unit) = scale(register);
                (value as f64 * factor, unit)
            })
        };
        Self {
            pulse: raw(POSITION).map(|(_, value)| value),
            velocity: in_units(first(&VELOCITY)),
            effort: in_units(first(&EFFORT)),
            temperature_c: in_units(raw(TEMPERATURE)).map(|(value, _)| value),
            voltage_v: in_units(first(&VOLTAGE)).map(|(value, _)| value),
            errors: raw(ERRORS).map_or(0, |(_, value)| value as u8),
            torque: raw(TORQUE).map(|(_, value)| value != 0),
        }
    }

    /// Names of the latched errors, such as `overheating, overload`; empty without any.
    pub fn error_names(&self) -> String {
        let names: Vec<&str> = hardware_error::NAMES
            .iter()
            .filter(|(bit, _)| self.errors & bit != 0)
            .map(|(_, name)| *name)
            .collect();
        match (names.is_empty(), self.errors) {
            (true, 0) => String::new(),
            (true, errors) => format!("unknown error {errors:#04x}"),
            (false, _) => names.join(", "),
        }
    }
}

/// Factor and unit of a register whose unit reads `0.229 rev/min`, `C` or nothing.
fn scale(register: &'static Register) -> (f64, &'static str) {
    let (number, unit) = register.unit.split_once(' ').unwrap_or(("", register.unit));
    match number.parse() {
        Ok(factor) => (factor, unit),
        Err(_) => (1.0, register.unit),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_become_what_a_person_reads() {
        let model = Model::by_number(1060).expect("XL430-W250 is known");
        let mut bytes = [0; 83];
        let mut set = |address: usize, value: &[u8]| {
            bytes[address - 64..address - 64 + value.len()].copy_from_slice(value);
        };
        set(64, &[1]);
        set(70, &[0b10_0100]);
        set(126, &(-55_i16).to_le_bytes());
        set(128, &10_i32.to_le_bytes());
        set(132, &(-7_i32).to_le_bytes());
        set(144, &118_u16.to_le_bytes());
        set(146, &[71]);
        let vitals = Vitals::decode(model, 64, &bytes);
        assert_eq!(vitals.pulse, Some(-7));
        assert_eq!(vitals.effort, Some((-5.5, "%")));
        let (velocity, unit) = vitals.velocity.expect("a velocity");
        assert!(
            (velocity - 2.29).abs() < 1e-9 && unit == "rev/min",
            "{velocity} {unit}"
        );
        assert_eq!(vitals.temperature_c, Some(71.0));
        assert!((vitals.voltage_v.expect("a voltage") - 11.8).abs() < 1e-9);
        assert_eq!(vitals.error_names(), "overheating, overload");
        assert_eq!(vitals.torque, Some(true));
        let cut = Vitals::decode(model, 64, &bytes[..20]);
        assert_eq!((cut.pulse, cut.torque), (None, Some(true)));
    }
}
