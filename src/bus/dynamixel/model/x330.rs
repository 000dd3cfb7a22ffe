//! Control tables of the 330 size: the XL430's with current in mA, a PWM slope, and 20 indirect slots.

use super::table::{I16, r, rw, table};
use super::x430::{REGISTERS, VELOCITY, VOLT};

const MA: &str = "1 mA";

table! {
    /// XL330: 5 V.
    XL330 = &REGISTERS, [
        rw("baud_rate", 8, 1, 0, 6, ""),
        rw("operating_mode", 11, 1, 0, 16, ""),
        rw("protocol_type", 13, 1, 2, 22, ""),
        rw("max_voltage_limit", 32, 2, 31, 70, VOLT),
        rw("min_voltage_limit", 34, 2, 31, 70, VOLT),
        rw("current_limit", 38, 2, 0, 1750, MA),
        rw("velocity_limit", 44, 4, 0, 2047, VELOCITY),
        rw("pwm_slope", 62, 1, 1, 255, "1.977 mV/ms"),
        rw("goal_current", 102, 2, -1750, 1750, MA),
        rw("goal_velocity", 104, 4, -2047, 2047, VELOCITY),
        r("present_current", 126, 2, -I16, I16, MA),
        rw("indirect_address_1", 168, 2, 64, 251, ""),
    ], without []
}

table! {
    /// XC330-M: 5 V.
    XC330_M = &XL330, [
        rw("current_limit", 38, 2, 0, 2352, MA),
        rw("goal_current", 102, 2, -2352, 2352, MA),
    ], without []
}

table! {
    /// XC330-T: 12 V.
    XC330_T = &XL330, [
        rw("max_voltage_limit", 32, 2, 55, 140, VOLT),
        rw("min_voltage_limit", 34, 2, 55, 140, VOLT),
        rw("current_limit", 38, 2, 0, 910, MA),
        rw("pwm_slope", 62, 1, 1, 255, "3.955 mV/ms"),
        rw("goal_current", 102, 2, -910, 910, MA),
    ], without []
}
