//! One simulated servo: control table, motor, latched errors, bus watchdog, moved along by time alone.

pub use super::ailments::Ailments;
use super::modes::centre_rad;
use super::motor::{Motor, Profile, SUBSTEP_NANOS};
use super::table::{ControlTable, Device};
use super::thermal::{TICK_SUBSTEPS, Thermal};
use crate::base::Time;
use crate::bus::dynamixel::model::{RAM_BEGIN, address};
use std::time::Duration;

/// How long a servo is deaf and mute after a reboot.
pub const BOOT_TIME: Duration = Duration::from_millis(250);

/// Velocity error, as a share of the no-load speed, times this is duty in velocity mode.
const VELOCITY_GAIN: f64 = 4.0;

/// What the control loop needs of the table, taken over after each write.
#[derive(Copy, Clone, Debug, Default)]
pub(super) struct Setpoint {
    pub mode: u8,
    pub torque_on: bool,
    pub goal_rad: f64,
    pub goal_rad_s: f64,
    pub goal_duty: f64,
    pub duty_limit: f64,
    pub duty_per_rad: f64,
    /// Goal current as a share of the stall current; of a position mode the most that is used.
    pub goal_current: f64,
    pub speed: Option<f64>,
    pub acceleration: Option<f64>,
    pub direction: f64,
}

/// A simulated servo.
#[derive(Clone, Debug)]
pub struct Servo {
    pub(super) table: ControlTable,
    pub(super) motor: Motor,
    pub(super) profile: Profile,
    pub(super) setpoint: Setpoint,
    pub(super) ailments: Ailments,
    pub(super) thermal: Thermal,
    /// Torque that somebody outside pushes the shaft with, N m.
    pub(super) pushed_nm: f64,
    /// Substeps integrated so far, counted from time zero.
    substep: i64,
    pub(super) booted_at: Time,
    offline_until: Time,
    fed_at: Time,
    pub(super) held_write: Option<u16>,
    pub(super) held_data: Vec<u8>,
    pub(super) backup: Option<ControlTable>,
}

impl Servo {
    /// A servo out of the box: id 1, 57,600 baud, return delay 500 us, torque off, in the middle of the turn.
    pub fn factory(device: &'static Device) -> Self {
        let table = ControlTable::new(device);
        let nominal_v = 0.1 * f64::from(table.get(address::PRESENT_INPUT_VOLTAGE));
        let mut servo = Self {
            table,
            motor: Motor::new(device.motor, centre_rad(device)),
            profile: Profile::default(),
            setpoint: Setpoint::default(),
            ailments: Ailments::default(),
            thermal: Thermal::new(&device.motor, nominal_v),
            pushed_nm: 0.0,
            substep: 0,
            booted_at: Time::ZERO,
            offline_until: Time::ZERO,
            fed_at: Time::ZERO,
            held_write: None,
            held_data: Vec::with_capacity(256),
            backup: None,
        };
        servo.boot();
        servo
    }

    /// A servo as commissioned for a chain: `id`, the register value for its baud rate, no return delay.
    pub fn commissioned(device: &'static Device, id: u8, baud_code: u8) -> Self {
        let mut servo = Self::factory(device);
        servo.table.set(address::ID, i64::from(id));
        servo.table.set(address::BAUD_RATE, i64::from(baud_code));
        servo.table.set(address::RETURN_DELAY_TIME, 0);
        servo
    }

    /// The same servo with another firmware version; before 45 an XL430 knows no fast reads, before 52 a servo of the 330
    /// size has its indirect data elsewhere.
    pub fn with_firmware(mut self, version: u8) -> Self {
        let mut table = ControlTable::with_firmware(self.table.device(), version);
        // The indirect addresses behind are those of the new firmware.
        table.copy_from(&self.table, |register| register <= address::BACKUP_READY);
        self.table = table;
        self
    }

    /// The same servo resting at `angle_rad` from the middle of the turn, its goal there too.
    pub fn with_angle(mut self, angle_rad: f64) -> Self {
        self.motor.angle_rad = self.centre_rad() + angle_rad;
        let pulses = self.position_pulses().round() as i64;
        self.table.set(address::GOAL_POSITION, pulses);
        self.take_setpoint();
        self
    }

    /// Its id.
    pub fn id(&self) -> u8 {
        self.table.get(address::ID) as u8
    }

    /// Whether torque is on.
    pub fn torque_enabled(&self) -> bool {
        self.setpoint.torque_on
    }

    /// Position in pulses, unrounded, as the register would show it.
    pub fn position_pulses(&self) -> f64 {
        self.to_pulses(self.measured_rad())
    }

    /// Angle of the shaft as its encoder has it, radians.
    pub(super) fn measured_rad(&self) -> f64 {
        self.motor.angle_rad + self.ailments.encoder_jump_rad
    }

    /// Angle from the middle of the turn, radians, in the register's direction.
    pub fn angle_rad(&self) -> f64 {
        (self.position_pulses() - self.centre_pulse()) * self.pulse_rad()
    }

    /// Speed in the register's direction, rad/s.
    pub fn speed_rad_s(&self) -> f64 {
        self.motor.speed_rad_s * self.setpoint.direction
    }

    /// The value of the register at an X series address as it stands, unsigned; 0 for an address without register.
    pub fn register(&self, addr: u16) -> u32 {
        self.table.get(addr)
    }

    /// Turns the shaft by hand, by `pulses` in the register's direction; false when torque is on and holds it.
    pub fn turn_by_hand(&mut self, pulses: f64) -> bool {
        let free = !self.setpoint.torque_on;
        if free {
            self.motor.angle_rad += pulses * self.pulse_rad() * self.setpoint.direction;
            self.motor.speed_rad_s = 0.0;
        }
        free
    }

    /// Whether it is up (not rebooting) at `now`.
    pub fn is_online(&self, now: Time) -> bool {
        now >= self.offline_until
    }

    /// Whether a hardware error is latched: the alert bit of every status.
    pub fn alert(&self) -> bool {
        self.table.get(address::HARDWARE_ERROR_STATUS) != 0
    }

    /// Restarts at `now`: RAM back to defaults, torque off, errors cleared, mute for [`BOOT_TIME`].
    pub fn reboot(&mut self, now: Time) {
        self.boot();
        self.booted_at = now;
        self.offline_until = now + BOOT_TIME;
    }

    /// An instruction for whomsoever was heard on the bus: feeds the watchdog.
    pub fn heard(&mut self, now: Time) {
        self.fed_at = now;
    }

    /// Moves the servo on to `now`; earlier times change nothing.
    pub fn advance(&mut self, now: Time) {
        if let Some(expiry) = self.watchdog_expiry().filter(|&expiry| expiry <= now) {
            self.integrate(expiry);
            self.trip_watchdog();
        }
        self.integrate(now);
    }

    fn boot(&mut self) {
        let restore = self.table.get(address::STARTUP_CONFIGURATION);
        self.table.reset(|register| register >= RAM_BEGIN);
        if restore & 2 != 0
            && let Some(backup) = &self.backup
        {
            self.table.copy_from(backup, is_backed_up_ram);
        }
        self.held_write = None;
        self.table
            .set(address::TORQUE_ENABLE, i64::from(restore & 1));
        self.goals_to_limits();
        self.take_setpoint();
        self.clear_turns();
        self.thermal.restart();
        self.raise(self.ailments.hardware_error);
    }

    pub(super) fn take_setpoint(&mut self) {
        let table = &self.table;
        let unit = |addr, scale: f64| match table.get(addr) {
            0 => None,
            value => Some(f64::from(value) * scale),
        };
        let timed = table.get(address::DRIVE_MODE) & 4 != 0;
        let reverse = table.get(address::DRIVE_MODE) & 1 != 0;
        let goal_pwm = f64::from(table.get_signed(address::GOAL_PWM));
        let pwm_limit = f64::from(table.get(address::PWM_LIMIT));
        let direction = if reverse { -1.0 } else { 1.0 };
        let gain = f64::from(table.get(address::POSITION_P_GAIN));
        let device = table.device();
        let full_pwm = self.full_pwm();
        let before = self.setpoint;
        self.setpoint = Setpoint {
            mode: table.get(address::OPERATING_MODE) as u8,
            torque_on: table.get(address::TORQUE_ENABLE) != 0,
            goal_rad: 0.0,
            goal_rad_s: f64::from(table.get_signed(address::GOAL_VELOCITY))
                * device.model.velocity_unit_rad_s
                * direction,
            goal_duty: goal_pwm / full_pwm * direction,
            duty_limit: goal_pwm.abs().min(pwm_limit) / full_pwm,
            duty_per_rad: gain * device.duty_per_rad,
            goal_current: self.goal_current_share() * direction,
            // In time mode the limits follow from each goal's distance.
            speed: match timed {
                true => before.speed,
                false => unit(address::PROFILE_VELOCITY, device.model.velocity_unit_rad_s),
            },
            acceleration: match timed {
                true => before.acceleration,
                false => unit(
                    address::PROFILE_ACCELERATION,
                    device.model.acceleration_unit_rad_s2,
                ),
            },
            direction,
        };
        self.setpoint.goal_rad =
            self.to_angle(f64::from(self.table.get_signed(address::GOAL_POSITION)));
    }

    /// Time-based profile: the limits that reach the new goal in the milliseconds of registers 112 and 108.
    pub(super) fn time_profile(&mut self) {
        if self.table.get(address::DRIVE_MODE) & 4 == 0 {
            return;
        }
        let whole_s = f64::from(self.table.get(address::PROFILE_VELOCITY)) * 1e-3;
        let ramp_s =
            (f64::from(self.table.get(address::PROFILE_ACCELERATION)) * 1e-3).min(0.5 * whole_s);
        let way = (self.setpoint.goal_rad - self.profile.angle_rad).abs();
        let speed = (whole_s > 0.0 && way > 0.0).then(|| way / (whole_s - ramp_s));
        self.setpoint.acceleration = speed.filter(|_| ramp_s > 0.0).map(|v| v / ramp_s);
        self.setpoint.speed = speed;
    }

    pub(super) fn to_pulses(&self, angle_rad: f64) -> f64 {
        let offset = f64::from(self.table.get_signed(address::HOMING_OFFSET));
        let centre = self.centre_pulse();
        centre + (angle_rad / self.pulse_rad() - centre) * self.setpoint.direction + offset
    }

    fn to_angle(&self, pulses: f64) -> f64 {
        let offset = f64::from(self.table.get_signed(address::HOMING_OFFSET));
        let centre = self.centre_pulse();
        (centre + (pulses - offset - centre) * self.setpoint.direction) * self.pulse_rad()
    }

    pub(super) fn is_positioning(&self) -> bool {
        matches!(self.setpoint.mode, 3..=5)
    }

    pub(super) fn shut_down(&self) -> bool {
        self.table.get(address::HARDWARE_ERROR_STATUS) & self.table.get(address::SHUTDOWN) != 0
    }

    /// Latches bits of Hardware Error Status, and shuts down for those of the Shutdown mask.
    pub(super) fn raise(&mut self, bits: u8) {
        let latched = self.table.get(address::HARDWARE_ERROR_STATUS) | u32::from(bits);
        self.table
            .set(address::HARDWARE_ERROR_STATUS, i64::from(latched));
        if self.shut_down() {
            self.table.set(address::TORQUE_ENABLE, 0);
            self.setpoint.torque_on = false;
        }
    }

    pub(super) fn watchdog_tripped(&self) -> bool {
        self.table.get_signed(address::BUS_WATCHDOG) == -1
    }

    fn watchdog_expiry(&self) -> Option<Time> {
        let counts = self.table.get_signed(address::BUS_WATCHDOG);
        (self.setpoint.torque_on && counts > 0)
            .then(|| self.fed_at + Duration::from_millis(20 * counts.unsigned_abs() as u64))
    }

    pub(super) fn trip_watchdog(&mut self) {
        self.table.set(address::BUS_WATCHDOG, -1);
        if self.ailments.watchdog_defect {
            return;
        }
        let pulses = self.position_pulses().round() as i64;
        if let Some(astray) = self.ailments.watchdog_runaway {
            self.run_away(pulses, astray);
            return;
        }
        self.table.set(address::GOAL_POSITION, pulses);
        self.table.set(address::GOAL_VELOCITY, 0);
        match self.setpoint.mode {
            0 => self.table.set(address::GOAL_CURRENT, 0),
            16 => self.table.set(address::GOAL_PWM, 0),
            _ => {}
        }
        self.take_setpoint();
        self.profile = Profile {
            angle_rad: self.setpoint.goal_rad,
            speed_rad_s: 0.0,
        };
    }

    fn integrate(&mut self, now: Time) {
        let target = now.nanos().div_euclid(SUBSTEP_NANOS);
        while self.substep < target {
            let settled = self.control();
            self.motor.step(settled.duty);
            let to_tick = TICK_SUBSTEPS - self.substep.rem_euclid(TICK_SUBSTEPS);
            let mut steps = 1;
            if settled.path_ended && self.motor.rests(settled.duty) {
                // Nothing but heat will change until the next write or fault.
                steps = to_tick.min(target - self.substep);
            }
            self.substep += steps;
            let effort = self.motor.effort();
            self.thermal.count(effort, self.motor.duty, steps);
            if steps == to_tick {
                self.feel();
            }
        }
    }

    /// Moves the path by one substep and computes the duty that follows it.
    fn control(&mut self) -> Control {
        let s = self.setpoint;
        if !s.torque_on {
            return Control {
                duty: None,
                path_ended: true,
            };
        }
        let (duty, path_ended) = match s.mode {
            1 => {
                self.profile.step_speed(s.goal_rad_s, s.acceleration);
                let full = self.motor.spec.no_load_rad_s;
                let error = self.profile.speed_rad_s - self.motor.speed_rad_s;
                let duty = (self.profile.speed_rad_s + VELOCITY_GAIN * error) / full;
                (duty, self.profile.speed_rad_s == s.goal_rad_s)
            }
            0 => (self.duty_of_current(s.goal_current), true),
            16 => (s.goal_duty, true),
            _ => {
                self.profile.step(s.goal_rad, s.speed, s.acceleration);
                let error = self.profile.angle_rad - self.measured_rad();
                let duty = self.within_current(error * s.duty_per_rad);
                (duty, self.profile.arrived(s.goal_rad))
            }
        };
        let most = s.duty_limit.min(self.ailments.duty_limit.unwrap_or(1.0));
        Control {
            duty: Some(duty.clamp(-most, most)),
            path_ended,
        }
    }
}

/// The RAM registers that a backup holds: gains and profile.
pub(super) fn is_backed_up_ram(register: u16) -> bool {
    matches!(
        register,
        address::VELOCITY_I_GAIN
            ..=address::FEEDFORWARD_1ST_GAIN
                | address::PROFILE_ACCELERATION
                | address::PROFILE_VELOCITY
    )
}

/// What the control loop decides in a substep.
struct Control {
    duty: Option<f64>,
    path_ended: bool,
}
