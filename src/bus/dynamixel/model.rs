//! Servo models as data: model number, registers, units, modes.
//!
//! Facts from the vendor's model files (`tables`, held by a test) and, for ranges, firmware and modes, its e-Manual. A new
//! model is an entry in the catalogue and, where its registers differ, a table.

pub mod address;
mod ax;
mod catalogue;
mod current;
mod layout;
mod mode;
mod ph42;
mod table;
#[cfg(test)]
mod vendor;
mod x330;
mod x430;

pub use catalogue::XL430_W250;
pub use layout::{IndirectBlock, Layout};
pub use mode::{MODES, Mode};

use super::one;
use std::f64::consts::TAU;
use std::fmt;

/// Bytes from [`address::PRESENT_STATE`]: load or current, velocity, position.
pub const STATE_BYTES: usize = 10;
/// Where EEPROM ends and RAM begins on X series servos. EEPROM can be written only while torque is off.
pub const RAM_BEGIN: u16 = 64;
/// Operating mode: position control within one turn.
pub const POSITION_MODE: u8 = Mode::Position.number();
/// One count of the bus watchdog, milliseconds.
pub const WATCHDOG_UNIT_MS: u64 = 20;
/// How many turns either way a goal may be in modes of several turns.
pub const TURNS_EITHER_WAY: i32 = 256;

/// Position counts of a whole turn.
pub const PULSES_PER_TURN: f64 = 4096.0;
/// One count of velocity, 0.229 rev/min, in rad/s.
pub const VELOCITY_UNIT_RAD_S: f64 = 0.229 * TAU / 60.0;
/// One count of profile acceleration, 214.577 rev/min2, in rad/s2.
pub const ACCELERATION_UNIT_RAD_S2: f64 = 214.577 * TAU / 3600.0;

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
    /// How a negative value stands in it.
    pub sign: Sign,
}

/// How a register holds negative values.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub enum Sign {
    /// As two's complement.
    #[default]
    TwosComplement,
    /// As a magnitude of ten bits with the sign in bit 10, clockwise: speed and load of Protocol 1.0.
    Bit10,
}

/// The sign of [`Sign::Bit10`].
const BIT_10: i64 = 1 << 10;

impl Register {
    /// Whether the register keeps its value without power and is locked while torque is on, on X series servos;
    /// [`Model::is_eeprom`] knows the others.
    pub const fn is_eeprom(&self) -> bool {
        Layout::X.is_eeprom(self.address)
    }

    /// The value in `bytes`, of which there are [`size`](Self::size), low byte first.
    pub fn decode(&self, bytes: &[u8]) -> i64 {
        let unsigned = bytes
            .iter()
            .rev()
            .fold(0i64, |value, &byte| (value << 8) | i64::from(byte));
        if self.sign == Sign::Bit10 {
            let magnitude = unsigned & (BIT_10 - 1);
            return match unsigned & BIT_10 {
                0 => magnitude,
                _ => -magnitude,
            };
        }
        let bits = 8 * u32::from(self.size);
        if self.min < 0 && bits < 64 && unsigned >= 1 << (bits - 1) {
            unsigned - (1 << bits)
        } else {
            unsigned
        }
    }

    /// The bytes of `value`; the first [`size`](Self::size) count.
    pub fn encode(&self, value: i64) -> [u8; 4] {
        if self.sign == Sign::Bit10 && value < 0 {
            return ((value.abs() | BIT_10) as u32).to_le_bytes();
        }
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

impl fmt::Display for Protocol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Protocol::One => "1.0",
            Protocol::Two => "2.0",
        })
    }
}

/// What a servo tells of its effort (register 126), and with that what [`JointState::effort`](crate::base::JointState::effort) is.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub enum Effort {
    /// Share of its greatest torque, -1..1, estimated by the servo. No current can be set.
    #[default]
    Load,
    /// Measured current, in ampere.
    Current,
}

impl Effort {
    /// The unit, for the reader.
    pub const fn unit(self) -> &'static str {
        match self {
            Effort::Load => "share of the greatest load",
            Effort::Current => "A",
        }
    }
}

/// A servo model.
#[derive(Debug, PartialEq)]
pub struct Model {
    /// The protocol that it speaks out of the box.
    pub protocol: Protocol,
    /// Name as in the vendor's catalogue, lower case, such as `xl430-w250`; MX servos with Protocol 2.0 end in `-2`.
    pub name: &'static str,
    /// Model number (register 0).
    pub number: u16,
    /// Firmware from which on fast reads are understood; 255 when none does.
    pub fast_reads_since: u8,
    /// Firmware from which on there is a bus watchdog.
    pub watchdog_since: u8,
    /// Position counts of a whole turn.
    pub pulses_per_turn: f64,
    /// Count in the middle of the turn.
    pub centre_pulse: i32,
    /// Least and greatest position out of the box, in counts: a whole turn, or a hair less.
    pub turn_pulses: (i32, i32),
    /// One count of velocity, in rad/s.
    pub velocity_unit_rad_s: f64,
    /// One count of profile acceleration, in rad/s2.
    pub acceleration_unit_rad_s2: f64,
    /// What it tells of its effort.
    pub effort: Effort,
    /// One count of load or current, in the unit of [`JointState::effort`](crate::base::JointState::effort).
    pub effort_unit: f64,
    /// Operating modes that it has.
    pub modes: &'static [Mode],
    /// Where its registers lie.
    pub layout: Layout,
    /// Indirect blocks of all firmwares; see [`Model::indirect`].
    pub indirect: &'static [IndirectBlock],
    /// Why its bus watchdog cannot be relied upon, as a sentence; `None` when it can.
    pub watchdog_defect: Option<&'static str>,
    /// Control table, by address. The indirect blocks are there by their first address register.
    pub registers: &'static [Register],
}

impl Model {
    /// The model with this number.
    pub fn by_number(number: u16) -> Option<&'static Model> {
        let mut models = MODELS.iter().copied();
        models.find(|model| model.number == number)
    }

    /// The model with this name.
    pub fn by_name(name: &str) -> Option<&'static Model> {
        let mut models = MODELS.iter().copied();
        models.find(|model| model.name.eq_ignore_ascii_case(name))
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

    /// The register that does here what the one at `x_series` does on an X series servo, if there is one.
    pub fn register_like(&self, x_series: u16) -> Option<&'static Register> {
        match self.protocol {
            Protocol::Two => self.register_at(self.layout.at(x_series)),
            Protocol::One => {
                one::counterpart(x_series).and_then(|address| self.register_at(address))
            }
        }
    }

    /// Whether a register keeps its value without power and is locked while torque is on.
    pub const fn is_eeprom(&self, register: &Register) -> bool {
        self.layout.is_eeprom(register.address)
    }

    /// The indirect blocks that a servo with this firmware has. On servos of the 330 size they moved with firmware 52.
    pub fn indirect(&self, firmware: u8) -> impl Iterator<Item = &'static IndirectBlock> + use<> {
        let blocks = self.indirect.iter();
        blocks.filter(move |block| block.is_in(firmware))
    }

    /// Radians of one position count.
    pub fn pulse_rad(&self) -> f64 {
        TAU / self.pulses_per_turn
    }

    /// Least and greatest count that a goal can have in a mode: one turn, or many.
    pub fn goal_range(&self, mode: Mode) -> (i32, i32) {
        let turn = self.pulses_per_turn as i32;
        if mode.has_position_limits() {
            match self.register_like(address::MAX_POSITION_LIMIT) {
                Some(limit) => (limit.min as i32, limit.max as i32),
                None => (0, turn - 1),
            }
        } else {
            let many = TURNS_EITHER_WAY * turn - 1;
            (-many, many)
        }
    }
}

/// All models known.
pub static MODELS: &[&Model] = &[
    &XL430_W250,
    &catalogue::XC430_W150,
    &catalogue::XC430_W240,
    &catalogue::XM430_W210,
    &catalogue::XM430_W350,
    &catalogue::XH430_W350,
    &catalogue::XM540_W150,
    &catalogue::XM540_W270,
    &catalogue::XL330_M077,
    &catalogue::XL330_M288,
    &catalogue::XC330_T181,
    &catalogue::XC330_T288,
    &catalogue::XC330_M181,
    &catalogue::XC330_M288,
    &catalogue::MX_28,
    &catalogue::MX_64,
    &catalogue::MX_106,
    &catalogue::PH42_020_S300,
    &ax::AX_12A,
    &ax::AX_12W,
    &ax::AX_18A,
    &ax::MX_12W,
    &ax::MX_28,
    &ax::MX_64,
    &ax::MX_106,
];

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
                    "{}: {} reaches into {}",
                    model.name,
                    pair[0].name,
                    pair[1].name
                );
            }
        }
    }

    #[test]
    fn values_survive_their_bytes() {
        for model in MODELS {
            for register in model.registers {
                for value in [register.min, 0.max(register.min), register.max] {
                    let bytes = register.encode(value);
                    let found = register.decode(&bytes[..usize::from(register.size)]);
                    assert_eq!(found, value, "{} of {}", register.name, model.name);
                }
            }
        }
        let model = Model::by_number(1060).expect("XL430-W250 is known");
        let watchdog = model.register("bus_watchdog").expect("it has one");
        assert_eq!(watchdog.decode(&[0xFF]), -1, "a tripped watchdog");
    }

    #[test]
    fn numbers_and_names_belong_to_one_model() {
        for (index, model) in MODELS.iter().enumerate() {
            for other in &MODELS[..index] {
                assert_ne!(model.number, other.number, "{}", model.name);
                assert_ne!(model.name, other.name);
            }
            let limit = model.register("current_limit").is_some();
            assert_eq!(limit, model.effort == Effort::Current, "{}", model.name);
            for mode in model.modes {
                let (goal, _) = mode.goal();
                let register = model.register_like(goal);
                assert!(register.is_some(), "{}: no goal for {mode:?}", model.name);
                assert!(limit || !mode.uses_current(), "{}: {mode:?}", model.name);
            }
        }
    }

    #[test]
    fn every_layout_holds_the_registers_that_the_driver_works_with() {
        for x_series in XL430_W250.registers {
            // LEDs and the backup flag are where the model puts them; MX servos have no start-up configuration.
            if [
                "led",
                "backup_ready",
                "startup_configuration",
                "present_load",
            ]
            .contains(&x_series.name)
            {
                continue;
            }
            for model in MODELS
                .iter()
                .filter(|model| model.protocol == Protocol::Two)
            {
                let found = model
                    .register(x_series.name)
                    .unwrap_or_else(|| panic!("{} has no {}", model.name, x_series.name));
                let expected = match x_series.name {
                    "indirect_address_1" => x_series.address,
                    _ => model.layout.at(x_series.address),
                };
                assert_eq!(found.address, expected, "{} of {}", found.name, model.name);
                assert_eq!(
                    found.size, x_series.size,
                    "{} of {}",
                    found.name, model.name
                );
            }
        }
        for model in MODELS
            .iter()
            .filter(|model| model.protocol == Protocol::Two)
        {
            let effort = model.register_at(model.layout.at(address::PRESENT_STATE));
            let expected = match model.effort {
                Effort::Load => "present_load",
                Effort::Current => "present_current",
            };
            assert_eq!(effort.map(|e| e.name), Some(expected), "{}", model.name);
        }
    }

    #[test]
    fn the_indirect_data_of_the_330_size_moved_with_firmware_52() {
        let data = |name: &str, firmware| -> Vec<(u16, u16)> {
            let model = Model::by_name(name).expect("a known model");
            model
                .indirect(firmware)
                .map(|b| (b.data, b.slots))
                .collect()
        };
        assert_eq!(data("xl330-m288", 51), [(224, 20)]);
        assert_eq!(data("xl330-m288", 52), [(208, 20)]);
        assert_eq!(data("xm430-w350", 52), [(224, 28), (634, 28)]);
        assert_eq!(data("ph42-020-s300", 10), [(634, 128)]);
    }
}
