//! Control table of the XL430: names, addresses, sizes, access, ranges, units. The other X series tables differ from it in some rows.
//!
//! The one place where these facts stand; the driver, the commands and the simulated servos look them up.

use super::Register;
use super::table::{I16, I32, U8, U16, U32};
pub(super) use super::table::{r, rw};

pub(super) const PULSE: &str = "0.088 deg";
pub(super) const VELOCITY: &str = "0.229 rev/min";
const ACCELERATION: &str = "214.577 rev/min2";
const PWM: &str = "0.113 %";
pub(super) const VOLT: &str = "0.1 V";

/// Registers by address. The indirect blocks are there by their first register.
pub(super) static REGISTERS: [Register; 52] = [
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
    rw("shutdown", 63, 1, 0, 63, ""),
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
