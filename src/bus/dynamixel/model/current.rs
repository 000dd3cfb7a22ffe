//! Control tables of X430, X540 and MX servos: the XL430's with other ranges, and with current in place of load.

use super::table::{I16, r, rw, table};
use super::x430::{REGISTERS, VOLT};

const MA_2_69: &str = "2.69 mA";
const MA_3_36: &str = "3.36 mA";

table! {
    /// XC430: reports load.
    XC430 = &REGISTERS, [
        rw("max_voltage_limit", 32, 2, 60, 160, VOLT),
        rw("min_voltage_limit", 34, 2, 60, 160, VOLT),
    ], without []
}

table! {
    /// XM430.
    XM430 = &REGISTERS, [
        rw("operating_mode", 11, 1, 0, 16, ""),
        rw("max_voltage_limit", 32, 2, 95, 160, VOLT),
        rw("min_voltage_limit", 34, 2, 95, 160, VOLT),
        rw("current_limit", 38, 2, 0, 1193, MA_2_69),
        rw("goal_current", 102, 2, -1193, 1193, MA_2_69),
        r("present_current", 126, 2, -I16, I16, MA_2_69),
    ], without []
}

table! {
    /// XH430-W: a smaller motor.
    XH430 = &XM430, [
        rw("current_limit", 38, 2, 0, 648, MA_2_69),
        rw("goal_current", 102, 2, -648, 648, MA_2_69),
    ], without []
}

table! {
    /// XM540: three external ports.
    XM540 = &XM430, [
        rw("current_limit", 38, 2, 0, 2047, MA_2_69),
        rw("external_port_mode_1", 56, 1, 0, 3, ""),
        rw("external_port_mode_2", 57, 1, 0, 3, ""),
        rw("external_port_mode_3", 58, 1, 0, 3, ""),
        rw("goal_current", 102, 2, -2047, 2047, MA_2_69),
        rw("external_port_data_1", 152, 2, 0, 4095, ""),
        rw("external_port_data_2", 154, 2, 0, 4095, ""),
        rw("external_port_data_3", 156, 2, 0, 4095, ""),
    ], without []
}

table! {
    /// MX-28 (2.0): reports load; no start-up configuration, no backup.
    MX28 = &REGISTERS, [
        rw("max_voltage_limit", 32, 2, 95, 160, VOLT),
        rw("min_voltage_limit", 34, 2, 95, 160, VOLT),
        rw("acceleration_limit", 40, 4, 0, 32_767, "214.577 rev/min2"),
    ], without [60, 147]
}

table! {
    /// MX-64 (2.0).
    MX64 = &XM430, [
        rw("current_limit", 38, 2, 0, 1941, MA_3_36),
        rw("acceleration_limit", 40, 4, 0, 32_767, "214.577 rev/min2"),
        rw("goal_current", 102, 2, -1941, 1941, MA_3_36),
        r("present_current", 126, 2, -I16, I16, MA_3_36),
    ], without [60, 147]
}

table! {
    /// MX-106 (2.0).
    MX106 = &MX64, [
        rw("current_limit", 38, 2, 0, 2047, MA_3_36),
        rw("goal_current", 102, 2, -2047, 2047, MA_3_36),
    ], without []
}
