//! Servo models as data: model number, registers, units.
//!
//! Facts from the vendor's e-manual, control table of XL430-W250. A new model is a new table.

use std::f64::consts::TAU;

/// Addresses that the driver itself uses; the same on every X series servo.
pub mod address {
    /// Return delay time, drive mode and operating mode: 3 bytes.
    pub const RETURN_DELAY: u16 = 9;
    /// Drive mode.
    pub const DRIVE_MODE: u16 = 10;
    /// Operating mode.
    pub const OPERATING_MODE: u16 = 11;
    /// Maximum and, 4 bytes on, minimum position limit.
    pub const MAX_POSITION_LIMIT: u16 = 48;
    /// Torque enable.
    pub const TORQUE_ENABLE: u16 = 64;
    /// Status return level.
    pub const STATUS_RETURN_LEVEL: u16 = 68;
    /// Hardware error status.
    pub const HARDWARE_ERROR: u16 = 70;
    /// Bus watchdog.
    pub const BUS_WATCHDOG: u16 = 98;
    /// Profile acceleration and, 4 bytes on, profile velocity.
    pub const PROFILE_ACCELERATION: u16 = 108;
    /// Goal position.
    pub const GOAL_POSITION: u16 = 116;
    /// Present load (2 bytes), velocity (4), position (4).
    pub const PRESENT_STATE: u16 = 126;
    /// Present position.
    pub const PRESENT_POSITION: u16 = 132;
}

/// Bytes from [`address::PRESENT_STATE`]: load, velocity, position.
pub const STATE_BYTES: usize = 10;
/// Where EEPROM ends and RAM begins. EEPROM can be written only while torque is off.
pub const RAM_BEGIN: u16 = 64;
/// Operating mode: position control within one turn.
pub const POSITION_MODE: u8 = 3;

/// Bits of the hardware error status (register 70) and what they mean.
pub const HARDWARE_ERRORS: [(u8, &str); 5] = [
    (0, "input voltage out of range"),
    (2, "overheating"),
    (3, "motor encoder"),
    (4, "electrical shock or too little power"),
    (5, "overload"),
];

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

/// A servo model.
#[derive(Debug, PartialEq)]
pub struct Model {
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
        MODELS.iter().find(|model| model.number == number)
    }

    /// The model with this name.
    pub fn by_name(name: &str) -> Option<&'static Model> {
        MODELS
            .iter()
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
pub static MODELS: [Model; 1] = [XL430_W250];

/// XL430-W250: the servo of small walking robots. Reports load, not current.
const XL430_W250: Model = Model {
    name: "xl430-w250",
    number: 1060,
    fast_reads_since: 45,
    watchdog_since: 38,
    pulses_per_turn: 4096.0,
    velocity_unit_rad_s: 0.229 * TAU / 60.0,
    effort_unit: 0.001,
    registers: &X430,
};

const fn r(
    name: &'static str,
    address: u16,
    size: u8,
    min: i64,
    max: i64,
    unit: &'static str,
) -> Register {
    Register {
        name,
        address,
        size,
        access: Access::Read,
        min,
        max,
        unit,
    }
}

const fn rw(
    name: &'static str,
    address: u16,
    size: u8,
    min: i64,
    max: i64,
    unit: &'static str,
) -> Register {
    Register {
        name,
        address,
        size,
        access: Access::ReadWrite,
        min,
        max,
        unit,
    }
}

const U8: i64 = 255;
const U16: i64 = 65_535;
const U32: i64 = 4_294_967_295;
const I16: i64 = 32_767;
const I32: i64 = 2_147_483_647;
const PULSE: &str = "0.088 deg";
const VELOCITY: &str = "0.229 rev/min";
const ACCELERATION: &str = "214.577 rev/min2";
const PWM: &str = "0.113 %";
const VOLT: &str = "0.1 V";

static X430: [Register; 52] = [
    r("model_number", 0, 2, 0, U16, ""),
    r("model_information", 2, 4, 0, U32, ""),
    r("firmware_version", 6, 1, 0, U8, ""),
    rw("id", 7, 1, 0, 252, ""),
    rw("baud_rate", 8, 1, 0, 7, ""),
    rw("return_delay_time", 9, 1, 0, 254, "2 us"),
    rw("drive_mode", 10, 1, 0, 13, ""),
    rw("operating_mode", 11, 1, 1, 16, ""),
    rw("secondary_id", 12, 1, 0, U8, ""),
    rw("protocol_type", 13, 1, 1, 2, ""),
    rw("homing_offset", 20, 4, -1_044_479, 1_044_479, PULSE),
    rw("moving_threshold", 24, 4, 0, 1023, VELOCITY),
    rw("temperature_limit", 31, 1, 0, 100, "C"),
    rw("max_voltage_limit", 32, 2, 60, 140, VOLT),
    rw("min_voltage_limit", 34, 2, 60, 140, VOLT),
    rw("pwm_limit", 36, 2, 0, 885, PWM),
    rw("velocity_limit", 44, 4, 0, 1023, VELOCITY),
    rw("max_position_limit", 48, 4, 0, 4095, PULSE),
    rw("min_position_limit", 52, 4, 0, 4095, PULSE),
    rw("startup_configuration", 60, 1, 0, 3, ""),
    rw("shutdown", 63, 1, 0, U8, ""),
    rw("torque_enable", 64, 1, 0, 1, ""),
    rw("led", 65, 1, 0, 1, ""),
    rw("status_return_level", 68, 1, 0, 2, ""),
    r("registered_instruction", 69, 1, 0, 1, ""),
    r("hardware_error_status", 70, 1, 0, U8, ""),
    rw("velocity_i_gain", 76, 2, 0, 16_383, ""),
    rw("velocity_p_gain", 78, 2, 0, 16_383, ""),
    rw("position_d_gain", 80, 2, 0, 16_383, ""),
    rw("position_i_gain", 82, 2, 0, 16_383, ""),
    rw("position_p_gain", 84, 2, 0, 16_383, ""),
    rw("feedforward_2nd_gain", 88, 2, 0, 16_383, ""),
    rw("feedforward_1st_gain", 90, 2, 0, 16_383, ""),
    rw("bus_watchdog", 98, 1, -1, 127, "20 ms"),
    rw("goal_pwm", 100, 2, -885, 885, PWM),
    rw("goal_velocity", 104, 4, -1023, 1023, VELOCITY),
    rw("profile_acceleration", 108, 4, 0, 32_767, ACCELERATION),
    rw("profile_velocity", 112, 4, 0, 32_767, VELOCITY),
    rw("goal_position", 116, 4, -1_048_575, 1_048_575, PULSE),
    r("realtime_tick", 120, 2, 0, 32_767, "ms"),
    r("moving", 122, 1, 0, 1, ""),
    r("moving_status", 123, 1, 0, U8, ""),
    r("present_pwm", 124, 2, -I16, I16, PWM),
    r("present_load", 126, 2, -I16, I16, "0.1 %"),
    r("present_velocity", 128, 4, -I32, I32, VELOCITY),
    r("present_position", 132, 4, -I32, I32, PULSE),
    r("velocity_trajectory", 136, 4, -I32, I32, VELOCITY),
    r("position_trajectory", 140, 4, -I32, I32, PULSE),
    r("present_input_voltage", 144, 2, 0, U16, VOLT),
    r("present_temperature", 146, 1, 0, U8, "C"),
    r("backup_ready", 147, 1, 0, 1, ""),
    rw("indirect_address_1", 168, 2, 64, 661, ""),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_stand_in_order_and_do_not_overlap() {
        for model in &MODELS {
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
