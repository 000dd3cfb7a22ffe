//! The models, by series. Numbers are those of the vendor's `dynamixel.model`; units are in its model files.

use super::current::{MX28, MX64, MX106, XC430, XH430, XM430, XM540};
use super::ph42::PH42;
use super::x330::{XC330_M, XC330_T, XL330};
use super::x430;
use super::{
    ACCELERATION_UNIT_RAD_S2, Effort, IndirectBlock, Layout, Mode, Model, PULSES_PER_TURN,
    Protocol, VELOCITY_UNIT_RAD_S,
};
use std::f64::consts::TAU;

/// Modes of a servo that reports load.
const LOAD_MODES: &[Mode] = &[
    Mode::Velocity,
    Mode::Position,
    Mode::ExtendedPosition,
    Mode::Pwm,
];
/// Modes of an X series servo that measures current.
const CURRENT_MODES: &[Mode] = &[
    Mode::Current,
    Mode::Velocity,
    Mode::Position,
    Mode::ExtendedPosition,
    Mode::CurrentBasedPosition,
    Mode::Pwm,
];
/// Two blocks of 28 slots each.
const TWO_BLOCKS: &[IndirectBlock] = &[
    IndirectBlock::always(168, 224, 28),
    IndirectBlock::always(578, 634, 28),
];
/// The 330 size: the data moved with firmware 52. Of the older ones it is known where they begin; 20 slots fit both.
const MOVED_BLOCK: &[IndirectBlock] = &[
    IndirectBlock {
        until: 51,
        ..IndirectBlock::always(168, 224, 20)
    },
    IndirectBlock {
        since: 52,
        ..IndirectBlock::always(168, 208, 20)
    },
];
/// Never: the model has no such thing in any firmware.
const NEVER: u8 = u8::MAX;

/// What X series servos that report load have in common.
pub(super) const X_LOAD: Model = Model {
    protocol: Protocol::Two,
    name: "",
    number: 0,
    fast_reads_since: 45,
    watchdog_since: 38,
    pulses_per_turn: PULSES_PER_TURN,
    centre_pulse: 2048,
    turn_pulses: (0, 4095),
    velocity_unit_rad_s: VELOCITY_UNIT_RAD_S,
    acceleration_unit_rad_s2: ACCELERATION_UNIT_RAD_S2,
    effort: Effort::Load,
    effort_unit: 0.001,
    modes: LOAD_MODES,
    layout: Layout::X,
    indirect: TWO_BLOCKS,
    watchdog_defect: None,
    registers: &x430::REGISTERS,
};

/// What X430 and X540 servos that measure current have in common.
const X_CURRENT: Model = Model {
    effort: Effort::Current,
    effort_unit: 0.002_69,
    modes: CURRENT_MODES,
    registers: &XM430,
    ..X_LOAD
};

/// What servos of the 330 size have in common.
const X330: Model = Model {
    fast_reads_since: 46,
    effort_unit: 0.001,
    indirect: MOVED_BLOCK,
    watchdog_defect: Some(
        "servos of the 330 size are known to keep turning after their bus watchdog has tripped",
    ),
    registers: &XL330,
    ..X_CURRENT
};

/// What MX servos with Protocol 2.0 have in common.
const MX: Model = Model {
    fast_reads_since: NEVER,
    effort_unit: 0.003_36,
    registers: &MX64,
    ..X_CURRENT
};

/// XL430-W250: the servo of small walking robots. Reports load, not current.
pub static XL430_W250: Model = Model {
    name: "xl430-w250",
    number: 1060,
    ..X_LOAD
};
pub(super) static XC430_W150: Model = Model {
    name: "xc430-w150",
    number: 1070,
    registers: &XC430,
    ..X_LOAD
};
pub(super) static XC430_W240: Model = Model {
    name: "xc430-w240",
    number: 1080,
    registers: &XC430,
    ..X_LOAD
};
pub(super) static XM430_W210: Model = Model {
    name: "xm430-w210",
    number: 1030,
    ..X_CURRENT
};
pub(super) static XM430_W350: Model = Model {
    name: "xm430-w350",
    number: 1020,
    ..X_CURRENT
};
pub(super) static XH430_W350: Model = Model {
    name: "xh430-w350",
    number: 1000,
    registers: &XH430,
    ..X_CURRENT
};
pub(super) static XM540_W150: Model = Model {
    name: "xm540-w150",
    number: 1130,
    registers: &XM540,
    ..X_CURRENT
};
pub(super) static XM540_W270: Model = Model {
    name: "xm540-w270",
    number: 1120,
    registers: &XM540,
    ..X_CURRENT
};
pub(super) static XL330_M077: Model = Model {
    name: "xl330-m077",
    number: 1190,
    ..X330
};
pub(super) static XL330_M288: Model = Model {
    name: "xl330-m288",
    number: 1200,
    ..X330
};
pub(super) static XC330_T181: Model = Model {
    name: "xc330-t181",
    number: 1210,
    registers: &XC330_T,
    ..X330
};
pub(super) static XC330_T288: Model = Model {
    name: "xc330-t288",
    number: 1220,
    registers: &XC330_T,
    ..X330
};
pub(super) static XC330_M181: Model = Model {
    name: "xc330-m181",
    number: 1230,
    registers: &XC330_M,
    ..X330
};
pub(super) static XC330_M288: Model = Model {
    name: "xc330-m288",
    number: 1240,
    registers: &XC330_M,
    ..X330
};
pub(super) static MX_28: Model = Model {
    name: "mx-28-2",
    number: 30,
    effort: Effort::Load,
    effort_unit: 0.001,
    modes: LOAD_MODES,
    registers: &MX28,
    ..MX
};
pub(super) static MX_64: Model = Model {
    name: "mx-64-2",
    number: 311,
    ..MX
};
pub(super) static MX_106: Model = Model {
    name: "mx-106-2",
    number: 321,
    registers: &MX106,
    ..MX
};
pub(super) static PH42_020_S300: Model = Model {
    protocol: Protocol::Two,
    name: "ph42-020-s300",
    number: 2000,
    fast_reads_since: NEVER,
    watchdog_since: 0,
    pulses_per_turn: 607_500.0,
    centre_pulse: 0,
    turn_pulses: (-303_454, 303_454),
    velocity_unit_rad_s: 0.01 * TAU / 60.0,
    acceleration_unit_rad_s2: TAU / 3600.0,
    effort: Effort::Current,
    effort_unit: 0.001,
    modes: &[
        Mode::Current,
        Mode::Velocity,
        Mode::Position,
        Mode::ExtendedPosition,
        Mode::Pwm,
    ],
    layout: Layout::P,
    indirect: &[IndirectBlock::always(168, 634, 128)],
    watchdog_defect: None,
    registers: &PH42,
};
