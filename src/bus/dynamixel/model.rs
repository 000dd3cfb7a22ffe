//! Servo models as data: model number, registers, units.
//!
//! Facts from the vendor's e-manual, control table of XL430-W250. A new model is a new table.

pub mod address;
mod x430;

use std::f64::consts::TAU;

/// Bytes from [`address::PRESENT_STATE`]: load, velocity, position.
pub const STATE_BYTES: usize = 10;
/// Where EEPROM ends and RAM begins. EEPROM can be written only while torque is off.
pub const RAM_BEGIN: u16 = 64;
/// Operating mode: position control within one turn.
pub const POSITION_MODE: u8 = 3;

/// Position counts of a whole turn.
pub const PULSES_PER_TURN: f64 = 4096.0;
/// One count of velocity, 0.229 rev/min, in rad/s.
pub const VELOCITY_UNIT_RAD_S: f64 = 0.229 * TAU / 60.0;

/// Bits of the hardware error status (register 70).
pub mod hardware_error {
    /// Input voltage out of range.
    pub const VOLTAGE: u8 = 1 << 0;
    /// Too hot.
    pub const OVERHEATING: u8 = 1 << 2;
    /// Motor encoder.
    pub const ENCODER: u8 = 1 << 3;
    /// Electrical shock or too little power.
    pub const SHOCK: u8 = 1 << 4;
    /// Overload.
    pub const OVERLOAD: u8 = 1 << 5;

    /// What each bit means, for the reader.
    pub const NAMES: [(u8, &str); 5] = [
        (VOLTAGE, "input voltage out of range"),
        (OVERHEATING, "overheating"),
        (ENCODER, "motor encoder"),
        (SHOCK, "electrical shock or too little power"),
        (OVERLOAD, "overload"),
    ];
}

/// What may be done with a register.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Access {
    /// Read only.
    Read,
    /// Read and write.
    ReadWrite,
}

/// One register of a control table.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Register {
    /// Name in lower case with underscores, such as `torque_enable`.
    pub name: &'static str,
    /// First byte.
    pub address: u16,
    /// Bytes: 1, 2 or 4.
    pub size: u8,
    /// Whether it can be written.
    pub access: Access,
    /// Least value; a negative one makes the register signed (two's complement).
    pub min: i64,
    /// Greatest value.
    pub max: i64,
    /// What one count is, empty for plain numbers and flags.
    pub unit: &'static str,
}

impl Register {
    /// Whether the register keeps its value without power and is locked while torque is on.
    pub const fn is_eeprom(&self) -> bool {
        self.address < RAM_BEGIN
    }

    /// The value in `bytes`, of which there are [`size`](Self::size), low byte first.
    pub fn decode(&self, bytes: &[u8]) -> i64 {
        let unsigned = bytes
            .iter()
            .rev()
            .fold(0i64, |value, &byte| (value << 8) | i64::from(byte));
        let bits = 8 * u32::from(self.size);
        if self.min < 0 && bits < 64 && unsigned >= 1 << (bits - 1) {
            unsigned - (1 << bits)
        } else {
            unsigned
        }
    }

    /// The bytes of `value`; the first [`size`](Self::size) count.
    pub fn encode(&self, value: i64) -> [u8; 4] {
        // Two's complement: cutting to the low bytes is what the register holds.
        (value as u32).to_le_bytes()
    }
}

/// The protocol that a servo speaks.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub enum Protocol {
    /// Protocol 1.0: AX and old MX servos.
    One,
    /// Protocol 2.0.
    #[default]
    Two,
}

/// A servo model.
#[derive(Debug, PartialEq)]
pub struct Model {
    /// The protocol that it speaks out of the box.
    pub protocol: Protocol,
    /// Name as in the vendor's catalogue, lower case, such as `xl430-w250`.
    pub name: &'static str,
    /// Model number (register 0).
    pub number: u16,
    /// Firmware from which on fast reads are understood.
    pub fast_reads_since: u8,
    /// Firmware from which on there is a bus watchdog.
    pub watchdog_since: u8,
    /// Position counts of a whole turn.
    pub pulses_per_turn: f64,
    /// One count of velocity, in rad/s.
    pub velocity_unit_rad_s: f64,
    /// One count of load or current, in the unit of [`JointState::effort`](crate::base::JointState::effort).
    pub effort_unit: f64,
    /// Control table, by address.
    pub registers: &'static [Register],
}

impl Model {
    /// The model with this number.
    pub fn by_number(number: u16) -> Option<&'static Model> {
        MODELS.into_iter().find(|model| model.number == number)
    }

    /// The model with this name.
    pub fn by_name(name: &str) -> Option<&'static Model> {
        MODELS
            .into_iter()
            .find(|model| model.name.eq_ignore_ascii_case(name))
    }

    /// The register with this name.
    pub fn register(&self, name: &str) -> Option<&'static Register> {
        self.registers.iter().find(|register| register.name == name)
    }

    /// The register that begins at this address.
    pub fn register_at(&self, address: u16) -> Option<&'static Register> {
        self.registers
            .iter()
            .find(|register| register.address == address)
    }
}

/// All models known.
pub static MODELS: [&Model; 1] = [&XL430_W250];

/// XL430-W250: the servo of small walking robots. Reports load, not current.
pub static XL430_W250: Model = Model {
    protocol: Protocol::Two,
    name: "xl430-w250",
    number: 1060,
    fast_reads_since: 45,
    watchdog_since: 38,
    pulses_per_turn: PULSES_PER_TURN,
    velocity_unit_rad_s: VELOCITY_UNIT_RAD_S,
    effort_unit: 0.001,
    registers: &x430::REGISTERS,
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_stand_in_order_and_do_not_overlap() {
        for model in MODELS {
            for pair in model.registers.windows(2) {
                let end = pair[0].address + u16::from(pair[0].size);
                assert!(
                    end <= pair[1].address,
                    "{} reaches into {}",
                    pair[0].name,
                    pair[1].name
                );
            }
        }
    }

    #[test]
    fn values_survive_their_bytes() {
        let model = Model::by_number(1060).expect("XL430-W250 is known");
        for register in model.registers {
            for value in [register.min, 0, register.max] {
                let bytes = register.encode(value);
                let found = register.decode(&bytes[..usize::from(register.size)]);
                assert_eq!(found, value, "{}", register.name);
            }
        }
        let watchdog = model.register("bus_watchdog").expect("it has one");
        assert_eq!(watchdog.decode(&[0xFF]), -1, "a tripped watchdog");
    }
}
