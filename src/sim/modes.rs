//! What a servo's model and operating mode make of its registers: units, currents, and what a change of mode resets.

use super::servo::Servo;
use super::table::Device;
use crate::bus::dynamixel::model::{Effort, Mode, POSITION_MODE, address};

/// Angle of the shaft in the middle of the turn, radians.
pub(super) fn centre_rad(device: &Device) -> f64 {
    f64::from(device.model.centre_pulse) * device.model.pulse_rad()
}

impl Servo {
    /// The same servo set to another operating mode, torque off, as if it had been written; a mode that the model does not have
    /// is left out.
    pub fn with_mode(mut self, mode: Mode) -> Self {
        if self.has_mode(i64::from(mode.number())) {
            self.apply_write(address::OPERATING_MODE, &[mode.number()]);
        }
        self
    }

    /// The same servo with another value in the register of this name; a name that it does not have changes nothing.
    pub fn with_register(mut self, name: &str, value: i64) -> Self {
        let register = self.table.device().model.register(name);
        if let Some(register) = register {
            let address = self.table.x_series(register.address);
            self.table.set(address, value);
            self.take_setpoint();
        }
        self
    }

    pub(super) fn mode(&self) -> u8 {
        self.table.get(address::OPERATING_MODE) as u8
    }

    pub(super) fn has_mode(&self, number: i64) -> bool {
        let mut modes = self.table.device().model.modes.iter();
        modes.any(|mode| i64::from(mode.number()) == number)
    }

    /// Radians of one position count.
    pub(super) fn pulse_rad(&self) -> f64 {
        self.table.device().model.pulse_rad()
    }

    /// Count in the middle of the turn.
    pub(super) fn centre_pulse(&self) -> f64 {
        f64::from(self.table.device().model.centre_pulse)
    }

    /// Angle of the shaft in the middle of the turn, radians.
    pub(super) fn centre_rad(&self) -> f64 {
        centre_rad(self.table.device())
    }

    /// Goal PWM at full duty.
    pub(super) fn full_pwm(&self) -> f64 {
        let limit = self.table.device().model.register_at(address::PWM_LIMIT);
        limit.map_or(885.0, |register| register.max as f64)
    }

    /// What register 126 shows in the shaft's direction: load in 0.1 %, or current in its unit.
    pub(super) fn shown_effort(&self) -> f64 {
        let device = self.table.device();
        match device.model.effort {
            Effort::Load => self.motor.effort() * 1000.0,
            Effort::Current => self.motor.effort() * device.stall_a / device.model.effort_unit,
        }
    }

    /// Goal current as a share of the stall current; 0 on a servo that knows none.
    pub(super) fn goal_current_share(&self) -> f64 {
        let device = self.table.device();
        match device.model.effort {
            Effort::Load => 0.0,
            Effort::Current => {
                f64::from(self.table.get_signed(address::GOAL_CURRENT)) * device.model.effort_unit
                    / device.stall_a
            }
        }
    }

    /// The duty at which a current flows that is this share of the stall current: what the shaft's speed induces comes on top.
    pub(super) fn duty_of_current(&self, share: f64) -> f64 {
        share + self.motor.speed_rad_s / self.motor.spec.no_load_rad_s
    }

    /// A duty with no more current than the goal current, in the mode that has such a limit.
    pub(super) fn within_current(&self, duty: f64) -> f64 {
        if self.setpoint.mode != Mode::CurrentBasedPosition.number() {
            return duty;
        }
        let most = self.setpoint.goal_current.abs();
        let idle = self.duty_of_current(0.0);
        duty.clamp(idle - most, idle + most)
    }

    /// After a boot or a change of mode goal PWM and goal current stand at their limits: who turns torque on in a mode that goes
    /// by them writes a goal first.
    pub(super) fn goals_to_limits(&mut self) {
        for (goal, limit) in [
            (address::GOAL_PWM, address::PWM_LIMIT),
            (address::GOAL_CURRENT, address::CURRENT_LIMIT),
        ] {
            let limit = i64::from(self.table.get(limit));
            self.table.set(goal, limit);
        }
    }

    /// Gains, profile and goals are those of the new mode; back in position mode turns are forgotten.
    pub(super) fn change_mode(&mut self) {
        self.table
            .reset(|a| (address::VELOCITY_I_GAIN..=address::FEEDFORWARD_1ST_GAIN).contains(&a));
        self.table.set(address::PROFILE_ACCELERATION, 0);
        self.table.set(address::PROFILE_VELOCITY, 0);
        self.table.set(address::GOAL_VELOCITY, 0);
        self.goals_to_limits();
        if self.mode() == POSITION_MODE {
            self.take_setpoint();
            self.clear_turns();
        } else {
            let pulses = self.position_pulses().round() as i64;
            self.table.set(address::GOAL_POSITION, pulses);
        }
    }
}
