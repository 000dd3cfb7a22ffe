//! Servo models as data: registers, ranges and start values of each.

use super::motor::XL430_MOTOR;
use super::table::{IndirectBlock, Model};
use std::ops::RangeInclusive;

/// Register addresses that the simulated servo itself looks at (X series).
pub mod addr {
    #![allow(
        missing_docs,
        reason = "the names are those of the vendor's control table"
    )]
    pub const MODEL_NUMBER: u16 = 0;
    pub const FIRMWARE_VERSION: u16 = 6;
    pub const ID: u16 = 7;
    pub const BAUD_RATE: u16 = 8;
    pub const RETURN_DELAY_TIME: u16 = 9;
    pub const DRIVE_MODE: u16 = 10;
    pub const OPERATING_MODE: u16 = 11;
    pub const SHADOW_ID: u16 = 12;
    pub const HOMING_OFFSET: u16 = 20;
    pub const MOVING_THRESHOLD: u16 = 24;
    pub const PWM_LIMIT: u16 = 36;
    pub const VELOCITY_LIMIT: u16 = 44;
    pub const MAX_POSITION_LIMIT: u16 = 48;
    pub const MIN_POSITION_LIMIT: u16 = 52;
    pub const STARTUP_CONFIGURATION: u16 = 60;
    pub const SHUTDOWN: u16 = 63;
    pub const TORQUE_ENABLE: u16 = 64;
    pub const LED: u16 = 65;
    pub const STATUS_RETURN_LEVEL: u16 = 68;
    pub const REGISTERED_INSTRUCTION: u16 = 69;
    pub const HARDWARE_ERROR_STATUS: u16 = 70;
    pub const VELOCITY_I_GAIN: u16 = 76;
    pub const POSITION_P_GAIN: u16 = 84;
    pub const FEEDFORWARD_1ST_GAIN: u16 = 90;
    pub const BUS_WATCHDOG: u16 = 98;
    pub const GOAL_PWM: u16 = 100;
    pub const GOAL_VELOCITY: u16 = 104;
    pub const PROFILE_ACCELERATION: u16 = 108;
    pub const PROFILE_VELOCITY: u16 = 112;
    pub const GOAL_POSITION: u16 = 116;
    pub const REALTIME_TICK: u16 = 120;
    pub const MOVING: u16 = 122;
    pub const MOVING_STATUS: u16 = 123;
    pub const PRESENT_PWM: u16 = 124;
    pub const PRESENT_LOAD: u16 = 126;
    pub const PRESENT_VELOCITY: u16 = 128;
    pub const PRESENT_POSITION: u16 = 132;
    pub const VELOCITY_TRAJECTORY: u16 = 136;
    pub const POSITION_TRAJECTORY: u16 = 140;
    pub const PRESENT_INPUT_VOLTAGE: u16 = 144;
    pub const PRESENT_TEMPERATURE: u16 = 146;
    pub const BACKUP_READY: u16 = 147;
}

/// Address, size, writable, initial value, range.
pub(super) type Row = (u16, u8, bool, i64, RangeInclusive<i64>);

const R: bool = false;
const RW: bool = true;
const ANY: RangeInclusive<i64> = 0..=0xFFFF_FFFF;

/// Every model the simulator knows.
pub static MODELS: &[&Model] = &[&XL430_W250];

/// XL430-W250: 12 V, 57 rev/min, reports load instead of current.
///
/// Source: ROBOTIS e-Manual, "XL430-W250", control table.
pub static XL430_W250: Model = Model {
    name: "xl430-w250",
    number: 1060,
    firmware: 46,
    fast_read_firmware: 45,
    modes: &[1, 3, 4, 16],
    motor: XL430_MOTOR,
    rows: &[
        (addr::MODEL_NUMBER, 2, R, 1060, ANY),
        (2, 4, R, 0, ANY),
        (addr::FIRMWARE_VERSION, 1, R, 46, ANY),
        (addr::ID, 1, RW, 1, 0..=252),
        (addr::BAUD_RATE, 1, RW, 1, 0..=7),
        (addr::RETURN_DELAY_TIME, 1, RW, 250, 0..=254),
        (addr::DRIVE_MODE, 1, RW, 0, 0..=13),
        (addr::OPERATING_MODE, 1, RW, 3, 1..=16),
        (addr::SHADOW_ID, 1, RW, 255, 0..=255),
        (13, 1, RW, 2, 2..=2),
        (addr::HOMING_OFFSET, 4, RW, 0, -1_044_479..=1_044_479),
        (addr::MOVING_THRESHOLD, 4, RW, 10, 0..=1023),
        (31, 1, RW, 72, 0..=100),
        (32, 2, RW, 140, 60..=140),
        (34, 2, RW, 60, 60..=140),
        (addr::PWM_LIMIT, 2, RW, 885, 0..=885),
        (addr::VELOCITY_LIMIT, 4, RW, 265, 0..=1023),
        (addr::MAX_POSITION_LIMIT, 4, RW, 4095, 0..=4095),
        (addr::MIN_POSITION_LIMIT, 4, RW, 0, 0..=4095),
        (addr::STARTUP_CONFIGURATION, 1, RW, 0, 0..=3),
        (addr::SHUTDOWN, 1, RW, 52, 0..=63),
        (addr::TORQUE_ENABLE, 1, RW, 0, 0..=1),
        (addr::LED, 1, RW, 0, 0..=1),
        (addr::STATUS_RETURN_LEVEL, 1, RW, 2, 0..=2),
        (addr::REGISTERED_INSTRUCTION, 1, R, 0, ANY),
        (addr::HARDWARE_ERROR_STATUS, 1, R, 0, ANY),
        (addr::VELOCITY_I_GAIN, 2, RW, 1000, 0..=16383),
        (78, 2, RW, 100, 0..=16383),
        (80, 2, RW, 4000, 0..=16383),
        (82, 2, RW, 0, 0..=16383),
        (addr::POSITION_P_GAIN, 2, RW, 640, 0..=16383),
        (88, 2, RW, 0, 0..=16383),
        (addr::FEEDFORWARD_1ST_GAIN, 2, RW, 0, 0..=16383),
        (addr::BUS_WATCHDOG, 1, RW, 0, 0..=127),
        (addr::GOAL_PWM, 2, RW, 885, -885..=885),
        (addr::GOAL_VELOCITY, 4, RW, 0, -1023..=1023),
        (addr::PROFILE_ACCELERATION, 4, RW, 0, 0..=32767),
        (addr::PROFILE_VELOCITY, 4, RW, 0, 0..=32767),
        (
            addr::GOAL_POSITION,
            4,
            RW,
            2048,
            -2_147_483_648..=2_147_483_647,
        ),
        (addr::REALTIME_TICK, 2, R, 0, ANY),
        (addr::MOVING, 1, R, 0, ANY),
        (addr::MOVING_STATUS, 1, R, 0, ANY),
        (addr::PRESENT_PWM, 2, R, 0, ANY),
        (addr::PRESENT_LOAD, 2, R, 0, ANY),
        (addr::PRESENT_VELOCITY, 4, R, 0, ANY),
        (addr::PRESENT_POSITION, 4, R, 2048, ANY),
        (addr::VELOCITY_TRAJECTORY, 4, R, 0, ANY),
        (addr::POSITION_TRAJECTORY, 4, R, 2048, ANY),
        (addr::PRESENT_INPUT_VOLTAGE, 2, R, 111, ANY),
        (addr::PRESENT_TEMPERATURE, 1, R, 32, ANY),
        (addr::BACKUP_READY, 1, R, 0, ANY),
    ],
    indirect: &[
        IndirectBlock {
            address: 168,
            data: 224,
            slots: 28,
        },
        IndirectBlock {
            address: 578,
            data: 634,
            slots: 28,
        },
    ],
};

/// The model called `name`, in any case; `None` when the simulator does not know it.
pub fn model(name: &str) -> Option<&'static Model> {
    MODELS
        .iter()
        .copied()
        .find(|model| model.name.eq_ignore_ascii_case(name))
}
