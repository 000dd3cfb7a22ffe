//! Simulated servo models as data: what a device has beside the facts that a host knows of it.
//!
//! Initial values are those of the vendor's e-Manual, "Control Table" of each model; stall torque, stall current and speed
//! without load those of its "Specifications", at the supply that it recommends (the initial present input voltage).

use super::motor::{MotorSpec, XL430_MOTOR};
use super::table::Device;
use crate::bus::dynamixel::model::{Model, PULSES_PER_TURN};
use std::f64::consts::TAU;

/// Duty per radian of error and count of the position P gain on X series servos: one PWM unit (of 885) per pulse of error at a
/// gain of 100.
///
/// The manual divides by 128; 100 makes up for the derivative gain, which is not modelled, and lets
/// an XL430 at the default gain of 640 follow a steadily moving goal some 35 ms behind.
const X_DUTY_PER_RAD: f64 = PULSES_PER_TURN / TAU / 100.0 / 885.0;

/// A motor from what the vendor publishes; the rest in proportion to the XL430's, see [`XL430_MOTOR`].
const fn motor(stall_nm: f64, no_load_rev_min: f64) -> MotorSpec {
    let no_load_rad_s = no_load_rev_min * TAU / 60.0;
    MotorSpec {
        no_load_rad_s,
        stall_nm,
        inertia_kg_m2: 0.008 * stall_nm / no_load_rad_s,
        friction_nm: XL430_MOTOR.friction_nm / XL430_MOTOR.stall_nm * stall_nm,
        friction_off_nm: XL430_MOTOR.friction_off_nm / XL430_MOTOR.stall_nm * stall_nm,
    }
}

/// The host's model of this name. One that it does not know does not compile.
const fn host(name: &str) -> &'static Model {
    let models = crate::bus::dynamixel::model::MODELS;
    let mut index = 0;
    while index < models.len() {
        if same(models[index].name, name) {
            return models[index];
        }
        index += 1;
    }
    panic!("no model of that name");
}

const fn same(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    let mut index = 0;
    while index < a.len() && index < b.len() && a[index] == b[index] {
        index += 1;
    }
    index == a.len() && index == b.len()
}

/// XL430-W250: 12 V, 57 rev/min, reports load instead of current.
pub static XL430_W250: Device = Device {
    model: host("xl430-w250"),
    firmware: 46,
    motor: XL430_MOTOR,
    stall_a: 1.3,
    duty_per_rad: X_DUTY_PER_RAD,
    initial: &[
        ("temperature_limit", 72),
        ("max_voltage_limit", 140),
        ("min_voltage_limit", 60),
        ("velocity_limit", 265),
        ("velocity_i_gain", 1000),
        ("velocity_p_gain", 100),
        ("position_d_gain", 4000),
        ("position_p_gain", 640),
        ("present_input_voltage", 111),
    ],
    // It speaks Protocol 2.0 only.
    ranges: &[("protocol_type", 2, 2)],
};

/// An X430 or X540 servo: name, N m, rev/min, A, limits and gains.
macro_rules! x_series {
    ($(#[$doc:meta])* $name:ident = $model:literal, $stall_nm:literal, $rev_min:literal, $stall_a:literal,
     [$($initial:expr),* $(,)?]) => {
        $(#[$doc])*
        static $name: Device = Device {
            model: host($model),
            firmware: 46,
            motor: motor($stall_nm, $rev_min),
            stall_a: $stall_a,
            duty_per_rad: X_DUTY_PER_RAD,
            initial: &[
                ("velocity_i_gain", 1920),
                ("velocity_p_gain", 100),
                $($initial),*
            ],
            // Over Protocol 1.0 the line does not speak.
            ranges: &[("protocol_type", 2, 2)],
        };
    };
}

x_series!(
    XC430_W150 = "xc430-w150",
    1.6,
    106.0,
    1.4,
    [
        ("moving_threshold", 20),
        ("min_voltage_limit", 60),
        ("velocity_limit", 460),
        ("position_p_gain", 460),
    ]
);
x_series!(
    XC430_W240 = "xc430-w240",
    1.9,
    70.0,
    1.4,
    [
        ("min_voltage_limit", 60),
        ("velocity_limit", 306),
        ("position_p_gain", 700),
    ]
);
x_series!(
    XM430_W210 = "xm430-w210",
    3.0,
    77.0,
    2.3,
    [
        ("current_limit", 1193),
        ("velocity_limit", 330),
        ("position_p_gain", 800),
    ]
);
x_series!(
    XM430_W350 = "xm430-w350",
    4.1,
    46.0,
    2.3,
    [
        ("current_limit", 1193),
        ("velocity_limit", 200),
        ("position_p_gain", 800),
    ]
);
x_series!(
    XH430_W350 = "xh430-w350",
    3.4,
    30.0,
    1.3,
    [
        ("current_limit", 648),
        ("velocity_limit", 130),
        ("position_p_gain", 900),
    ]
);
x_series!(
    XM540_W150 = "xm540-w150",
    7.3,
    53.0,
    4.4,
    [
        ("current_limit", 2047),
        ("velocity_limit", 230),
        ("external_port_mode_1", 3),
        ("external_port_mode_2", 3),
        ("external_port_mode_3", 3),
        ("position_p_gain", 800),
    ]
);
x_series!(
    XM540_W270 = "xm540-w270",
    10.6,
    30.0,
    4.4,
    [
        ("current_limit", 2047),
        ("velocity_limit", 128),
        ("external_port_mode_1", 3),
        ("external_port_mode_2", 3),
        ("external_port_mode_3", 3),
        ("position_p_gain", 800),
    ]
);
x_series!(
    MX_28 = "mx-28-2",
    2.5,
    55.0,
    1.4,
    [
        ("acceleration_limit", 32_767),
        ("velocity_limit", 380),
        ("position_p_gain", 850),
    ]
);
x_series!(
    MX_64 = "mx-64-2",
    6.0,
    63.0,
    4.1,
    [
        ("current_limit", 1941),
        ("acceleration_limit", 32_767),
        ("velocity_limit", 435),
        ("position_p_gain", 850),
    ]
);
x_series!(
    MX_106 = "mx-106-2",
    8.4,
    45.0,
    5.2,
    [
        ("current_limit", 2047),
        ("acceleration_limit", 32_767),
        ("velocity_limit", 360),
        ("position_p_gain", 850),
    ]
);

/// A servo of the 330 size, with the firmware that has its indirect data at 208.
macro_rules! x330 {
    ($name:ident = $model:literal, $stall_nm:literal, $rev_min:literal, $stall_a:literal, [$($initial:expr),* $(,)?]) => {
        static $name: Device = Device {
            model: host($model),
            firmware: 52,
            motor: motor($stall_nm, $rev_min),
            stall_a: $stall_a,
            duty_per_rad: X_DUTY_PER_RAD,
            initial: &[("temperature_limit", 70), $($initial),*],
            // The RC protocols are not spoken.
            ranges: &[("protocol_type", 2, 2)],
        };
    };
}

x330!(
    XL330_M077 = "xl330-m077",
    0.215,
    383.0,
    1.47,
    [
        ("max_voltage_limit", 70),
        ("min_voltage_limit", 35),
        ("current_limit", 1750),
        ("velocity_limit", 1620),
        ("pwm_slope", 140),
        ("shutdown", 53),
        ("velocity_i_gain", 400),
        ("velocity_p_gain", 40),
        ("position_i_gain", 400),
        ("position_p_gain", 400),
        ("present_input_voltage", 50),
    ]
);
x330!(
    XL330_M288 = "xl330-m288",
    0.52,
    103.0,
    1.47,
    [
        ("max_voltage_limit", 70),
        ("min_voltage_limit", 35),
        ("current_limit", 1750),
        ("velocity_limit", 445),
        ("pwm_slope", 140),
        ("shutdown", 53),
        ("velocity_i_gain", 1600),
        ("velocity_p_gain", 180),
        ("position_p_gain", 400),
        ("present_input_voltage", 50),
    ]
);
x330!(
    XC330_M181 = "xc330-m181",
    0.60,
    129.0,
    1.80,
    [
        ("max_voltage_limit", 70),
        ("min_voltage_limit", 35),
        ("current_limit", 2352),
        ("velocity_limit", 545),
        ("pwm_slope", 140),
        ("velocity_i_gain", 1400),
        ("velocity_p_gain", 100),
        ("position_d_gain", 500),
        ("position_p_gain", 1200),
        ("present_input_voltage", 50),
    ]
);
x330!(
    XC330_M288 = "xc330-m288",
    0.93,
    81.0,
    1.80,
    [
        ("max_voltage_limit", 70),
        ("min_voltage_limit", 35),
        ("current_limit", 2352),
        ("velocity_limit", 350),
        ("pwm_slope", 140),
        ("velocity_i_gain", 1600),
        ("velocity_p_gain", 50),
        ("position_d_gain", 500),
        ("position_p_gain", 1100),
        ("present_input_voltage", 50),
    ]
);
x330!(
    XC330_T181 = "xc330-t181",
    0.76,
    104.0,
    0.80,
    [
        ("max_voltage_limit", 140),
        ("min_voltage_limit", 55),
        ("current_limit", 910),
        ("velocity_limit", 510),
        ("pwm_slope", 255),
        ("velocity_i_gain", 1200),
        ("velocity_p_gain", 40),
        ("position_p_gain", 900),
        ("present_input_voltage", 111),
    ]
);
x330!(
    XC330_T288 = "xc330-t288",
    0.92,
    65.0,
    0.80,
    [
        ("max_voltage_limit", 140),
        ("min_voltage_limit", 55),
        ("current_limit", 910),
        ("velocity_limit", 320),
        ("pwm_slope", 255),
        ("velocity_i_gain", 1200),
        ("velocity_p_gain", 40),
        ("position_p_gain", 900),
        ("present_input_voltage", 111),
    ]
);

/// PH42-020-S300: 24 V, 607,500 pulses a turn, RAM from 512 on.
///
/// The vendor publishes no stall torque: taken is the continuous torque per current (5.1 N m at 1.5 A) at the current limit of
/// 4.5 A. It publishes no default gains either; position P gain and its scale are chosen to follow some 35 ms behind.
static PH42_020_S300: Device = Device {
    model: host("ph42-020-s300"),
    firmware: 15,
    motor: motor(15.3, 32.7),
    stall_a: 4.5,
    duty_per_rad: 0.01,
    initial: &[
        ("moving_threshold", 20),
        ("max_voltage_limit", 350),
        ("min_voltage_limit", 150),
        ("pwm_limit", 2009),
        ("current_limit", 4500),
        ("acceleration_limit", 10_765),
        ("velocity_limit", 2920),
        ("max_position_limit", 303_454),
        ("min_position_limit", -303_454),
        ("external_port_mode_1", 3),
        ("external_port_mode_2", 3),
        ("external_port_mode_3", 3),
        ("external_port_mode_4", 3),
        ("shutdown", 58),
        ("position_p_gain", 850),
        ("present_input_voltage", 240),
    ],
    // Modbus is not spoken.
    ranges: &[("protocol_type", 2, 2)],
};

/// Every model the simulator knows; the first is what `handwave sim dynamixel` takes when none is named.
pub static MODELS: &[&Device] = &[
    &XL430_W250,
    &XC430_W150,
    &XC430_W240,
    &XM430_W210,
    &XM430_W350,
    &XH430_W350,
    &XM540_W150,
    &XM540_W270,
    &XL330_M077,
    &XL330_M288,
    &XC330_T181,
    &XC330_T288,
    &XC330_M181,
    &XC330_M288,
    &MX_28,
    &MX_64,
    &MX_106,
    &PH42_020_S300,
];

/// The model called `name`, in any case; `None` when the simulator does not know it.
pub fn model(name: &str) -> Option<&'static Device> {
    MODELS
        .iter()
        .copied()
        .find(|device| device.model.name.eq_ignore_ascii_case(name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::dynamixel::Protocol;
    use crate::bus::dynamixel::model::MODELS as KNOWN;

    #[test]
    fn every_named_register_exists() {
        for device in MODELS {
            let initial = device.initial.iter().map(|(name, _)| *name);
            for name in initial.chain(device.ranges.iter().map(|(name, _, _)| *name)) {
                let found = device.model.register(name);
                assert!(found.is_some(), "{name} of {}", device.model.name);
            }
        }
    }

    #[test]
    fn initial_values_lie_in_their_range() {
        for device in MODELS {
            for register in device.model.registers {
                let value = device.initial(register.name);
                // Filled in from elsewhere.
                let own = ["indirect_address_1", "model_number"].contains(&register.name);
                let range = register.min..=register.max;
                assert!(
                    own || range.contains(&value),
                    "{} of {} = {value}",
                    register.name,
                    device.model.name
                );
            }
        }
    }

    #[test]
    fn every_model_of_protocol_two_that_the_host_knows_can_be_simulated() {
        let two = KNOWN.iter().filter(|m| m.protocol == Protocol::Two);
        for known in two {
            assert!(model(known.name).is_some(), "{}", known.name);
        }
    }
}
