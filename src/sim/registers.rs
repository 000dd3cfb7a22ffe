//! What a servo's registers show of it, and what writing them does to it.

use super::servo::Servo;
use super::table::TableError;
use crate::base::Time;
use crate::bus::dynamixel::model::{POSITION_MODE, TURNS_EITHER_WAY, address};
use std::f64::consts::{PI, TAU};

/// Share of a turn from the goal within which a servo counts as in position.
const IN_POSITION_TURNS: f64 = 10.0 / 4096.0;
/// Share of a turn from the path beyond which Moving Status tells a following error.
const FOLLOWING_ERROR_TURNS: f64 = 200.0 / 4096.0;

impl Servo {
    /// Brings the registers that show the present state up to date.
    pub(super) fn refresh(&mut self, now: Time) {
        let pulses = self.position_pulses();
        let shown = pulses + self.encoder_noise(now);
        let direction = self.setpoint.direction;
        let model = self.table.device().model;
        let speed = self.speed_rad_s() / model.velocity_unit_rad_s;
        let path = self.to_pulses(self.profile.angle_rad);
        let path_speed = self.profile.speed_rad_s * direction / model.velocity_unit_rad_s;
        let positioning = self.setpoint.torque_on && self.is_positioning();
        let on_the_way = positioning && !self.profile.arrived(self.setpoint.goal_rad);
        let threshold = f64::from(self.table.get(address::MOVING_THRESHOLD));
        let moving = speed.abs() > threshold || on_the_way;
        let goal = self.to_pulses(self.setpoint.goal_rad);
        let mut status = 0;
        if positioning && (goal - pulses).abs() <= IN_POSITION_TURNS * model.pulses_per_turn {
            status |= 1;
        }
        if on_the_way {
            let shape = if self.setpoint.acceleration.is_some() {
                3
            } else {
                1
            };
            status |= 1 << 1 | shape << 4;
        }
        if positioning && (path - pulses).abs() > FOLLOWING_ERROR_TURNS * model.pulses_per_turn {
            status |= 1 << 3;
        }
        let tick = now.saturating_since(self.booted_at).as_millis() % 32_768;
        let (voltage, temperature) = (self.voltage_v(), self.temperature_c());
        for (register, value) in [
            (address::REALTIME_TICK, tick as i64),
            (address::MOVING, i64::from(moving)),
            (address::MOVING_STATUS, status),
            (
                address::PRESENT_PWM,
                (self.motor.duty * direction * self.full_pwm()).round() as i64,
            ),
            (
                address::PRESENT_LOAD,
                (self.shown_effort() * direction).round() as i64,
            ),
            (address::PRESENT_VELOCITY, speed.round() as i64),
            (address::PRESENT_POSITION, shown.round() as i64),
            (address::VELOCITY_TRAJECTORY, path_speed.round() as i64),
            (address::POSITION_TRAJECTORY, path.round() as i64),
            (
                address::PRESENT_INPUT_VOLTAGE,
                (voltage * 10.0).round() as i64,
            ),
            (address::PRESENT_TEMPERATURE, temperature.round() as i64),
            (address::BACKUP_READY, i64::from(self.backup.is_some())),
        ] {
            let of_motion =
                (address::PRESENT_LOAD..address::VELOCITY_TRAJECTORY).contains(&register);
            if !(self.ailments.frozen && of_motion) {
                self.table.set(register, value);
            }
        }
    }

    /// Takes a write that was checked: stores it and does what the registers in it cause.
    pub(super) fn apply_write(&mut self, address: u16, data: &[u8]) {
        let pulses = self.position_pulses();
        let mode = self.mode();
        let torque_on = self.setpoint.torque_on;
        self.table.store(address, data);
        let touched = |register: u16| {
            (0..data.len())
                .any(|i| self.table.x_series(self.table.resolve(address + i as u16)) == register)
        };
        let goal_written = touched(address::GOAL_POSITION);
        let mode_written = touched(address::OPERATING_MODE);
        if mode_written && self.mode() != mode {
            self.change_mode();
        }
        if !torque_on && self.table.get(address::TORQUE_ENABLE) != 0 {
            if self.shut_down() {
                // Latched until a reboot; the servo answers, and its torque stays off.
                self.table.set(address::TORQUE_ENABLE, 0);
            } else {
                self.profile.angle_rad = self.measured_rad();
                self.profile.speed_rad_s = 0.0;
            }
        }
        self.take_setpoint();
        if goal_written {
            self.time_profile();
        }
        // Homing offset and direction change what is shown, not where the shaft is.
        let shift = self.position_pulses() - pulses;
        if shift != 0.0 && !goal_written {
            let goal = i64::from(self.table.get_signed(address::GOAL_POSITION));
            self.table
                .set(address::GOAL_POSITION, goal + shift.round() as i64);
            self.take_setpoint();
        }
    }

    /// What the register's neighbours allow: limits, modes, the watchdog's lock.
    pub(super) fn check_value(&self, register: u16, value: i64) -> Result<(), TableError> {
        let register = self.table.x_series(register);
        let limit = |addr| i64::from(self.table.get(addr));
        let goal = matches!(
            register,
            address::GOAL_PWM
                | address::GOAL_CURRENT
                | address::GOAL_VELOCITY
                | address::GOAL_POSITION
        );
        if goal && self.watchdog_tripped() {
            return Err(TableError::Range);
        }
        let within = match register {
            address::GOAL_PWM => value.abs() <= limit(address::PWM_LIMIT),
            address::GOAL_CURRENT => value.abs() <= limit(address::CURRENT_LIMIT),
            address::GOAL_VELOCITY => value.abs() <= limit(address::VELOCITY_LIMIT),
            address::GOAL_POSITION => match self.mode() {
                POSITION_MODE => {
                    let limit = |addr| i64::from(self.table.get_signed(addr));
                    let allowed =
                        limit(address::MIN_POSITION_LIMIT)..=limit(address::MAX_POSITION_LIMIT);
                    allowed.contains(&value)
                }
                _ => {
                    let turn = self.table.device().model.pulses_per_turn as i64;
                    value.abs() < i64::from(TURNS_EITHER_WAY) * turn
                }
            },
            address::OPERATING_MODE if !self.has_mode(value) => {
                return Err(TableError::Range);
            }
            _ => true,
        };
        if within {
            Ok(())
        } else {
            Err(TableError::Limit)
        }
    }

    /// Forgets full turns: the position comes back into one turn around the centre, 0..4095 on X series servos, apart from
    /// the homing offset.
    pub(super) fn clear_turns(&mut self) {
        let begin = self.centre_rad() - PI;
        self.motor.angle_rad = begin + (self.motor.angle_rad - begin).rem_euclid(TAU);
        self.profile.angle_rad = self.measured_rad();
        self.profile.speed_rad_s = 0.0;
        let pulses = self.position_pulses().round() as i64;
        self.table.set(address::GOAL_POSITION, pulses);
        self.take_setpoint();
    }

    /// Whether the shaft turns or is on its way.
    pub(super) fn is_moving(&self) -> bool {
        self.speed_rad_s().abs() / self.table.device().model.velocity_unit_rad_s
            > f64::from(self.table.get(address::MOVING_THRESHOLD))
    }
}
