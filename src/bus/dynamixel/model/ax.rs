//! Models with Protocol 1.0: the AX class, and MX servos with their first firmware.
//!
//! The vendor publishes no model files of them; registers, ranges, units and numbers are those of its e-Manual (AX-12A,
//! AX-12W, AX-18A, MX-12W, MX-28, MX-64, MX-106).

use super::table::{U8, U16, r, rw, table};
use super::{Effort, Layout, Mode, Model, Protocol, Register, Sign};
use std::f64::consts::TAU;

const PULSE: &str = "0.293 deg";
const SPEED: &str = "0.111 rev/min";
const FINE_PULSE: &str = "0.088 deg";
const FINE_SPEED: &str = "0.114 rev/min";
const VOLT: &str = "0.1 V";
const LOAD: &str = "0.1 %";
/// Counts of an AX servo in its 300 degrees, as if it had a whole turn.
const AX_PULSES_PER_TURN: f64 = 1023.0 * 360.0 / 300.0;
/// Never: Protocol 1.0 has no such thing.
const NEVER: u8 = u8::MAX;

/// A register of speed or load.
const fn signed(name: &'static str, address: u16, unit: &'static str) -> Register {
    Register {
        sign: Sign::Bit10,
        ..r(name, address, 2, -1023, 1023, unit)
    }
}

/// AX-12A.
static AX12: [Register; 32] = [
    r("model_number", 0, 2, 0, U16, ""),
    r("firmware_version", 2, 1, 0, U8, ""),
    rw("id", 3, 1, 0, 253, ""),
    rw("baud_rate", 4, 1, 1, 254, ""),
    rw("return_delay_time", 5, 1, 0, 254, "2 us"),
    rw("cw_angle_limit", 6, 2, 0, 1023, PULSE),
    rw("ccw_angle_limit", 8, 2, 0, 1023, PULSE),
    rw("temperature_limit", 11, 1, 0, 150, "C"),
    rw("min_voltage_limit", 12, 1, 50, 250, VOLT),
    rw("max_voltage_limit", 13, 1, 50, 250, VOLT),
    rw("max_torque", 14, 2, 0, 1023, LOAD),
    rw("status_return_level", 16, 1, 0, 2, ""),
    rw("alarm_led", 17, 1, 0, 127, ""),
    rw("shutdown", 18, 1, 0, 127, ""),
    rw("torque_enable", 24, 1, 0, 1, ""),
    rw("led", 25, 1, 0, 1, ""),
    rw("cw_compliance_margin", 26, 1, 0, 255, PULSE),
    rw("ccw_compliance_margin", 27, 1, 0, 255, PULSE),
    rw("cw_compliance_slope", 28, 1, 1, 254, ""),
    rw("ccw_compliance_slope", 29, 1, 1, 254, ""),
    rw("goal_position", 30, 2, 0, 1023, PULSE),
    rw("moving_speed", 32, 2, 0, 2047, SPEED),
    rw("torque_limit", 34, 2, 0, 1023, LOAD),
    r("present_position", 36, 2, 0, 1023, PULSE),
    signed("present_speed", 38, SPEED),
    signed("present_load", 40, LOAD),
    r("present_voltage", 42, 1, 0, U8, VOLT),
    r("present_temperature", 43, 1, 0, U8, "C"),
    r("registered", 44, 1, 0, 1, ""),
    r("moving", 46, 1, 0, 1, ""),
    rw("lock", 47, 1, 0, 1, ""),
    rw("punch", 48, 2, 0, 1023, ""),
];

table! {
    /// MX servos: a finer encoder, gains in place of compliance.
    MX = &AX12, [
        rw("baud_rate", 4, 1, 0, 254, ""),
        rw("cw_angle_limit", 6, 2, 0, 4095, FINE_PULSE),
        rw("ccw_angle_limit", 8, 2, 0, 4095, FINE_PULSE),
        rw("multi_turn_offset", 20, 2, -24_576, 24_576, FINE_PULSE),
        rw("resolution_divider", 22, 1, 1, 4, ""),
        rw("d_gain", 26, 1, 0, 254, ""),
        rw("i_gain", 27, 1, 0, 254, ""),
        rw("p_gain", 28, 1, 0, 254, ""),
        rw("goal_position", 30, 2, -28_672, 28_672, FINE_PULSE),
        rw("moving_speed", 32, 2, 0, 2047, FINE_SPEED),
        r("present_position", 36, 2, -28_672, 28_672, FINE_PULSE),
        signed("present_speed", 38, FINE_SPEED),
        r("realtime_tick", 50, 2, 0, 32_767, "ms"),
        rw("goal_acceleration", 73, 1, 0, 254, "8.583 deg/s2"),
    ], without [29]
}

/// What AX servos have in common.
const AX: Model = Model {
    protocol: Protocol::One,
    name: "",
    number: 0,
    fast_reads_since: NEVER,
    watchdog_since: NEVER,
    pulses_per_turn: AX_PULSES_PER_TURN,
    centre_pulse: 512,
    turn_pulses: (0, 1023),
    velocity_unit_rad_s: 0.111 * TAU / 60.0,
    acceleration_unit_rad_s2: 1.0,
    effort: Effort::Load,
    effort_unit: 1.0 / 1023.0,
    modes: &[Mode::Position],
    layout: Layout::ONE,
    indirect: &[],
    watchdog_defect: None,
    registers: &AX12,
};

/// What MX servos with Protocol 1.0 have in common.
const MX_ONE: Model = Model {
    pulses_per_turn: 4096.0,
    centre_pulse: 2048,
    turn_pulses: (0, 4095),
    velocity_unit_rad_s: 0.114 * TAU / 60.0,
    registers: &MX,
    ..AX
};

pub(super) static AX_12A: Model = Model {
    name: "ax-12a",
    number: 12,
    ..AX
};
pub(super) static AX_12W: Model = Model {
    name: "ax-12w",
    number: 300,
    ..AX
};
pub(super) static AX_18A: Model = Model {
    name: "ax-18a",
    number: 18,
    ..AX
};
pub(super) static MX_12W: Model = Model {
    name: "mx-12w",
    number: 360,
    velocity_unit_rad_s: 0.916 * TAU / 60.0,
    ..MX_ONE
};
pub(super) static MX_28: Model = Model {
    name: "mx-28",
    number: 29,
    ..MX_ONE
};
pub(super) static MX_64: Model = Model {
    name: "mx-64",
    number: 310,
    ..MX_ONE
};
pub(super) static MX_106: Model = Model {
    name: "mx-106",
    number: 320,
    ..MX_ONE
};
