//! What injected faults do to a servo itself, and what its own physics makes of a load.

use super::chance::noise;
use super::servo::Servo;
use crate::base::Time;
use crate::bus::dynamixel::model::{POSITION_MODE, address, hardware_error};

/// What injected faults do to a servo at present.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Ailments {
    /// Bits of Hardware Error Status that are raised while the fault lasts, and latched.
    pub hardware_error: u8,
    /// The shaft is blocked.
    pub stuck: bool,
    /// Torque from outside, as a share of the stall torque.
    pub load: f64,
    /// Drive at most, as a share of the full one.
    pub duty_limit: Option<f64>,
    /// What the supply is too low by, volts.
    pub sag_v: f64,
    /// The encoder reads so much too high, radians.
    pub encoder_jump_rad: f64,
    /// Position shown is off by up to so many pulses, at random from the seed.
    pub noise_pulses: Option<(f64, u64)>,
    /// Present position, velocity and load are not brought up to date.
    pub frozen: bool,
    /// Writes are answered and not done.
    pub deaf: bool,
    /// Every read and write is answered with this error.
    pub refuses: Option<u8>,
    /// A tripped bus watchdog does not stop the motion.
    pub watchdog_defect: bool,
    /// A trip of the bus watchdog moves the goal by the homing offset, or by so many pulses without one.
    pub watchdog_runaway: Option<f64>,
    /// Temperature that the servo reports, degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Supply voltage that the servo reports, volts.
    pub voltage_v: Option<f64>,
}

impl Servo {
    /// Sets what faults do to it from now on.
    pub fn set_ailments(&mut self, ailments: Ailments) {
        self.ailments = ailments;
        self.motor.blocked = ailments.stuck;
        self.push_shaft();
        self.feed_motor();
        self.raise(ailments.hardware_error);
    }

    /// Pushes the shaft with a torque from outside, N m, in the direction of growing pulses.
    pub fn set_external_torque(&mut self, torque_nm: f64) {
        self.pushed_nm = torque_nm;
        self.push_shaft();
    }

    /// Goal position as its register stands, pulses.
    pub fn goal_pulse(&self) -> i32 {
        self.table.get_signed(address::GOAL_POSITION)
    }

    /// Bus watchdog as its register stands: -1 when it has tripped.
    pub fn watchdog(&self) -> i32 {
        self.table.get_signed(address::BUS_WATCHDOG)
    }

    /// Its temperature, degrees Celsius, as the register shows it.
    pub fn temperature_c(&self) -> f64 {
        self.ailments
            .temperature_c
            .unwrap_or_else(|| self.thermal.sensor_c())
    }

    /// Its supply, volts, as the register shows it.
    pub fn voltage_v(&self) -> f64 {
        let real = (self.thermal.supply_v() - self.ailments.sag_v).max(0.0);
        self.ailments.voltage_v.unwrap_or(real)
    }

    /// What it draws from the supply, A, averaged over the last ten milliseconds.
    pub fn supply_current_a(&self) -> f64 {
        self.thermal.current_a()
    }

    /// Torque of the motor as a share of its stall torque, in the register's direction.
    pub fn effort(&self) -> f64 {
        self.motor.effort() * self.setpoint.direction
    }

    /// Its torque goes off as if 0 had been written to Torque Enable.
    pub(super) fn lose_torque(&mut self) {
        self.table.set(address::TORQUE_ENABLE, 0);
        self.take_setpoint();
    }

    /// Lowers the supply by what the whole line draws, volts.
    pub(super) fn set_supply_drop(&mut self, drop_v: f64) {
        self.thermal.set_drop(drop_v);
        self.feed_motor();
    }

    /// Position error that an ailing encoder shows at `now`, pulses.
    pub(super) fn encoder_noise(&self, now: Time) -> f64 {
        let noisy = self.ailments.noise_pulses;
        noisy.map_or(0.0, |(most, seed)| most * noise(seed, now.nanos()))
    }

    /// Latches what heat, load and supply have brought about: once a tick.
    pub(super) fn feel(&mut self) {
        let overload = self.thermal.tick();
        let limit = |address| f64::from(self.table.get(address));
        let mut bits = 0;
        if overload && self.setpoint.torque_on {
            bits |= hardware_error::OVERLOAD;
        }
        let hottest_c = limit(address::TEMPERATURE_LIMIT);
        if hottest_c > 0.0 && self.thermal.sensor_c() > hottest_c {
            bits |= hardware_error::OVERHEATING;
        }
        let volts = 10.0 * (self.thermal.supply_v() - self.ailments.sag_v).max(0.0);
        let (least, most) = (
            limit(address::MIN_VOLTAGE_LIMIT),
            limit(address::MAX_VOLTAGE_LIMIT),
        );
        if most > 0.0 && !(least..=most).contains(&volts) {
            bits |= hardware_error::VOLTAGE;
        }
        if bits != 0 {
            self.raise(bits);
        }
    }

    /// The trip of a watchdog that takes the homing offset into the goal twice.
    pub(super) fn run_away(&mut self, pulses: i64, astray: f64) {
        let offset = i64::from(self.table.get_signed(address::HOMING_OFFSET));
        let way = if offset == 0 { astray as i64 } else { offset };
        let limit = |address| i64::from(self.table.get(address));
        let mut goal = pulses + way;
        if self.setpoint.mode == POSITION_MODE {
            let highest = limit(address::MAX_POSITION_LIMIT);
            goal = goal.clamp(limit(address::MIN_POSITION_LIMIT).min(highest), highest);
        }
        self.table.set(address::GOAL_POSITION, goal);
        self.take_setpoint();
    }

    fn push_shaft(&mut self) {
        let push_nm = self.pushed_nm + self.ailments.load * self.motor.spec.stall_nm;
        self.motor.external_nm = push_nm * self.setpoint.direction;
    }

    fn feed_motor(&mut self) {
        self.motor.supply = self.thermal.supply_share(self.ailments.sag_v);
    }
}
