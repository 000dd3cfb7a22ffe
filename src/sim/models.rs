//! Simulated servo models as data: what a device has beside the facts that a host knows of it.

use super::motor::XL430_MOTOR;
use super::table::{Device, IndirectBlock};
use crate::bus::dynamixel::model;

/// Every model the simulator knows.
pub static MODELS: &[&Device] = &[&XL430_W250];

/// XL430-W250: 12 V, 57 rev/min, reports load instead of current.
///
/// Source: ROBOTIS e-Manual, "XL430-W250", control table.
pub static XL430_W250: Device = Device {
    model: &model::XL430_W250,
    firmware: 46,
    modes: &[1, model::POSITION_MODE, 4, 16],
    motor: XL430_MOTOR,
    initial: &[
        ("id", 1),
        ("baud_rate", 1),
        ("return_delay_time", 250),
        ("operating_mode", model::POSITION_MODE as i64),
        ("secondary_id", 255),
        ("protocol_type", 2),
        ("moving_threshold", 10),
        ("temperature_limit", 72),
        ("max_voltage_limit", 140),
        ("min_voltage_limit", 60),
        ("pwm_limit", 885),
        ("velocity_limit", 265),
        ("max_position_limit", 4095),
        ("shutdown", 52),
        ("status_return_level", 2),
        ("velocity_i_gain", 1000),
        ("velocity_p_gain", 100),
        ("position_d_gain", 4000),
        ("position_p_gain", 640),
        ("goal_pwm", 885),
        ("goal_position", 2048),
        ("present_position", 2048),
        ("position_trajectory", 2048),
        ("present_input_voltage", 111),
        ("present_temperature", 32),
    ],
    ranges: &[
        // It speaks Protocol 2.0 only.
        ("protocol_type", 2, 2),
        // -1, tripped, is the servo's own word.
        ("bus_watchdog", 0, 127),
        // What is out of reach depends on the mode and is told as a limit, not as a range.
        ("goal_position", i32::MIN as i64, i32::MAX as i64),
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
pub fn model(name: &str) -> Option<&'static Device> {
    MODELS
        .iter()
        .copied()
        .find(|device| device.model.name.eq_ignore_ascii_case(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_named_register_exists() {
        for device in MODELS {
            let initial = device.initial.iter().map(|(name, _)| *name);
            for name in initial.chain(device.ranges.iter().map(|(name, _, _)| *name)) {
                assert!(device.model.register(name).is_some(), "{name}");
            }
        }
    }

    #[test]
    fn initial_values_lie_in_their_range() {
        for device in MODELS {
            for (name, value) in device.initial {
                let register = device.model.register(name).expect("tested beside");
                let range = register.min..=register.max;
                assert!(range.contains(value), "{name} = {value}");
            }
        }
    }
}
