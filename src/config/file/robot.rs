//! `[robot]` and `[bus]` as a user writes them: joints, their servos, the line that carries them.

use super::{control_rate, one, yes};
use serde::Deserialize;
use std::collections::BTreeMap;
use toml::Spanned;

/// The robot.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotEntry {
    /// Path of the URDF.
    pub urdf: Spanned<String>,
    /// Acceleration every joint may use, rad/s^2.
    pub acceleration_rad_s2: f64,
    /// Share of the URDF's velocity limits to use.
    #[serde(default = "one")]
    pub velocity_share: f64,
    /// Foot link of each leg, by leg name; found in the URDF when not given.
    #[serde(default)]
    pub legs: BTreeMap<String, String>,
    /// Feet stay where they stand while the motion has them on the ground.
    #[serde(default = "yes")]
    pub pin_feet: bool,
    /// Joint to servo.
    pub joint: Vec<JointEntry>,
}

/// One joint and its servo.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointEntry {
    /// Joint name as in the URDF.
    pub name: Spanned<String>,
    /// Servo id on the bus.
    pub servo: Spanned<u8>,
    /// Servo model; that of `bus.model` when not given.
    pub model: Option<Spanned<String>>,
    /// Operating mode: `position`, `extended_position`, `current_based_position`, `velocity` or `current`, as the model has them.
    pub mode: Option<Spanned<String>>,
    /// Servo position at joint position zero, pulses; the middle of the turn when not given.
    pub zero_pulse: Option<i32>,
    /// +1 or -1.
    #[serde(default = "plus_one")]
    pub direction: i8,
    /// Lowest and highest servo position, pulses. Not given: the whole turn in mode `position`, in other modes what the URDF's
    /// limits need.
    pub range_pulse: Option<Spanned<[i32; 2]>>,
    /// Gains of the servo's position loop, in its own counts; written at each arming.
    pub gains: Option<GainsEntry>,
    /// Limits of the servo's own path to each goal; written at each arming.
    pub profile: Option<ProfileEntry>,
    /// The most current in modes `current_based_position` and `current`, ampere; what the servo's own limit allows when not given.
    pub current_a: Option<f64>,
    /// Gains of the host's position loop in modes `velocity` and `current`, where the servo has none.
    pub host_gains: Option<HostGainsEntry>,
}

/// Gains of a servo's position loop; those not given stay as the servo has them.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainsEntry {
    /// Position P gain.
    pub p: Option<u16>,
    /// Position I gain.
    pub i: Option<u16>,
    /// Position D gain.
    pub d: Option<u16>,
    /// Feedforward first gain.
    pub feedforward_1: Option<u16>,
    /// Feedforward second gain.
    pub feedforward_2: Option<u16>,
}

/// Limits of a servo's own path; 0 is none.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProfileEntry {
    /// Acceleration, rad/s^2.
    #[serde(default)]
    pub acceleration_rad_s2: f64,
    /// Velocity, rad/s.
    #[serde(default)]
    pub velocity_rad_s: f64,
}

/// Gains of the host's position loop.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HostGainsEntry {
    /// On the error of position: 1/s in mode `velocity`, A/rad in mode `current`.
    pub p: f64,
    /// On the error of velocity, A s/rad; of mode `current`.
    #[serde(default)]
    pub d: f64,
}

/// The bus.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BusEntry {
    /// `sim` or a bus such as `dynamixel:/dev/ttyUSB0@1000000`.
    pub bus: String,
    /// Baud rate of the simulated line.
    #[serde(default = "one_megabaud")]
    pub baud: u32,
    /// Servo model that the configuration expects.
    #[serde(default = "servo_model")]
    pub model: Spanned<String>,
    /// Control cycles per second.
    #[serde(default = "control_rate")]
    pub rate_hz: f64,
    /// The servos stop by themselves after this long without a packet, ms; 0 is off.
    #[serde(default = "watchdog")]
    pub watchdog_ms: u32,
}

fn watchdog() -> u32 {
    200
}

fn one_megabaud() -> u32 {
    1_000_000
}

fn servo_model() -> Spanned<String> {
    Spanned::new(0..0, "xl430-w250".into())
}

fn plus_one() -> i8 {
    1
}
