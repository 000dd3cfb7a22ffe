//! What is looked at before a servo may move, and the way to torque.

use super::chain::{DynamixelChain, Link, QUIET, Servo};
use super::client::ClientError;
use super::goals::resting_goal;
use super::groups::FastReads;
use super::model::{Mode, Model, Protocol, STATE_BYTES, address, hardware_error};
use super::servo::position_pulse;
use crate::base::JointState;
use crate::bus::BusError;
use handwave_dynamixel::wire;

/// Drive mode bits that change what goals mean: reverse (0) and time-based profile (2).
const DRIVE_MODE_FOREIGN: u8 = 0b101;
/// Drive mode bit 3: a goal turns torque on.
const TORQUE_ON_BY_GOAL: u8 = 0b1000;

impl Servo {
    /// Keeps where it is, in counts that can be believed: without torque it may have lost count of its turns, and jumps then.
    pub(super) fn stands_at(&mut self, pulse: i32) {
        let believed = match self.link {
            Link::Driven | Link::Ramping => true,
            Link::Torqueless | Link::Silent => false,
            Link::Resting => !self.lost_turns(pulse),
        };
        if believed {
            self.last_pulse = Some(pulse);
        }
    }

    /// Whether it may make several turns and `pulse` is more than half a turn from where it was last.
    fn lost_turns(&self, pulse: i32) -> bool {
        let turn = self.spec.model.pulses_per_turn as u32;
        self.last_pulse.is_some_and(|last| {
            self.spec.max_pulse.abs_diff(self.spec.min_pulse) >= turn
                && pulse.abs_diff(last) > turn / 2
        })
    }
}

impl DynamixelChain {
    /// Looks at every servo and reads all present states; changes no torque and no EEPROM.
    pub(super) fn check_all(&mut self, states: &mut [JointState]) -> Result<(), BusError> {
        self.notes.clear();
        self.facts.clear();
        let mut return_delay = 0;
        let mut slow = 0;
        for (index, state) in (0..self.servos.len()).zip(states) {
            let delay = self.check_servo(index, state)?;
            slow += usize::from(delay > 0);
            return_delay = return_delay.max(delay);
        }
        self.client
            .set_return_delay(wire::return_delay(return_delay));
        if slow > 0 {
            self.notes.push(format!(
                "{slow} servo(s) wait up to {} us before each answer (return_delay_time {return_delay}), \
                 which costs bus time in every cycle. With torque off set it to 0: \
                 `handwave bus write {} ID return_delay_time 0`",
                2 * u32::from(return_delay),
                self.options.bus
            ));
        }
        self.choose_reads();
        Ok(())
    }

    /// Fast reads for servos that are read together and all know them.
    fn choose_reads(&mut self) {
        for (group, reads) in self.groups.iter_mut().enumerate() {
            let old = self.servos.iter().find(|servo| {
                servo.group == group && servo.firmware < servo.spec.model.fast_reads_since
            });
            reads.fast = FastReads::new(old.is_none());
            let Some(old) = old else { continue };
            let (id, model) = (old.spec.id, old.spec.model);
            if model.protocol == Protocol::One {
                // Nobody expects them of it.
                continue;
            }
            self.notes.push(if model.fast_reads_since == u8::MAX {
                format!(
                    "servo {id} is an {}, which knows no fast reads: ordinary sync reads are used",
                    model.name
                )
            } else {
                format!(
                    "servo {id} has firmware {}, fast reads need {}: ordinary sync reads are used",
                    old.firmware, model.fast_reads_since
                )
            });
        }
    }

    /// Checks one servo and returns its return delay register.
    fn check_servo(&mut self, index: usize, state: &mut JointState) -> Result<u8, BusError> {
        let bus = self.options.bus.clone();
        let spec = self.servos[index].spec.clone();
        let id = spec.id;
        let ping = self.insist(index, |client, id| client.ping(id))?;
        if ping.model != spec.model.number {
            let found = Model::by_number(ping.model)
                .map_or_else(|| "an unknown model".into(), |model| model.name.to_owned());
            return Err(self.servo_problem(
                index,
                format!(
                    "it is {found} (model number {}), the configuration says {} ({})",
                    ping.model, spec.model.name, spec.model.number
                ),
                "Correct the model in the configuration, or check the ids of the chain".into(),
            ));
        }
        self.servos[index].firmware = ping.firmware;
        self.ensure_answers(index)?;

        let [errors] = self.read_register(index, address::HARDWARE_ERROR_STATUS)?;
        if errors != 0 {
            return Err(self.hardware_error(index, errors));
        }
        let [delay, drive_mode, mode] = self.read_register(index, address::RETURN_DELAY_TIME)?;
        let wanted = spec.mode.number();
        if mode != wanted {
            return Err(self.servo_problem(
                index,
                format!(
                    "operating mode is {mode}{}, needed is {wanted} ({})",
                    Mode::from_number(mode).map_or(String::new(), |mode| format!(" ({})", mode.name())),
                    spec.mode.name()
                ),
                match spec.model.protocol {
                    Protocol::Two => format!(
                        "With torque off set it by `handwave bus write {bus} {id} operating_mode {wanted}`"
                    ),
                    Protocol::One => format!(
                        "Its angle limits say so. With torque off set them by `handwave bus write {bus} {id} \
                         cw_angle_limit {}`, `handwave bus write {bus} {id} ccw_angle_limit {}`",
                        spec.min_pulse, spec.max_pulse
                    ),
                },
            ));
        }
        if drive_mode & DRIVE_MODE_FOREIGN != 0 {
            return Err(self.servo_problem(
                index,
                format!(
                    "drive mode is {drive_mode}: reverse direction (bit 0) and time-based profile \
                     (bit 2) must be off, the configuration's direction does that work"
                ),
                format!(
                    "With torque off set it by `handwave bus write {bus} {id} drive_mode {}`",
                    drive_mode & !DRIVE_MODE_FOREIGN
                ),
            ));
        }
        if drive_mode & TORQUE_ON_BY_GOAL != 0 {
            self.notes.push(format!(
                "servo {id} turns torque on by itself when it gets a goal (drive_mode bit 3)"
            ));
        }
        if spec.mode.has_position_limits() {
            self.check_limits(index)?;
        }
        self.look_at(index)?;
        let [watchdog] = self.read_register(index, address::BUS_WATCHDOG)?;
        if watchdog != 0 {
            // Left running or tripped by whoever used the chain before; tripped, it refuses goals.
            self.write_register(index, address::BUS_WATCHDOG, &[0])?;
        }

        let registers: [u8; STATE_BYTES] = self.read_register(index, address::PRESENT_STATE)?;
        let pulse = position_pulse(&registers);
        self.check_position(index, pulse)?;
        let servo = &mut self.servos[index];
        servo.goal_pulse = f64::from(pulse);
        servo.last_pulse = Some(pulse);
        servo.link = Link::Resting;
        *state = servo.spec.state(&registers, self.client.now());
        Ok(delay)
    }

    /// Sees to it that the servo answers reads and writes (status return level 2, in RAM).
    fn ensure_answers(&mut self, index: usize) -> Result<(), BusError> {
        let id = self.servos[index].spec.id;
        let mut level = [0];
        let register = self.servos[index].spec.at(address::STATUS_RETURN_LEVEL);
        match self.client.read(id, register, &mut level) {
            Ok(_) if level == [2] => return Ok(()),
            // At level 0 not even a read is answered, though the ping was.
            Ok(_) => {}
            Err(ClientError::Timeout { .. }) => {
                // Or late: then it must not be taken for the answer to what is asked next.
                let settled = self.client.settle(QUIET);
                settled.map_err(|error| self.servo_error(index, error))?;
            }
            Err(error) => return Err(self.servo_error(index, error)),
        }
        // A sync write never expects an answer.
        self.client
            .sync_write(register, 1, &[id], &[2])
            .map_err(|error| self.servo_error(index, error))?;
        let [level] = self.read_register(index, address::STATUS_RETURN_LEVEL)?;
        if level != 2 {
            return Err(self.servo_problem(
                index,
                format!("status return level stays {level}, needed is 2"),
                "Reboot the servo and try again".into(),
            ));
        }
        Ok(())
    }

    /// The declared range must lie within the servo's own limits, or it would drop goals without a word.
    fn check_limits(&mut self, index: usize) -> Result<(), BusError> {
        let bytes: [u8; 8] = self.read_register(index, address::MAX_POSITION_LIMIT)?;
        let [a, b, c, d, e, f, g, h] = bytes;
        let max = i32::from_le_bytes([a, b, c, d]);
        let min = i32::from_le_bytes([e, f, g, h]);
        let spec = &self.servos[index].spec;
        if min <= spec.min_pulse && spec.max_pulse <= max {
            return Ok(());
        }
        let (id, bus) = (spec.id, &self.options.bus);
        let name = |x_series| {
            let register = spec.model.register_like(x_series);
            register.map_or("", |register| register.name)
        };
        Err(self.servo_problem(
            index,
            format!(
                "its position limits are {min} to {max}, the configuration wants {} to {}; \
                 it would ignore goals outside its limits",
                spec.min_pulse, spec.max_pulse
            ),
            format!(
                "Narrow the configured range, or with torque off widen the limits: \
                 `handwave bus write {bus} {id} {} {}`, `handwave bus write {bus} {id} {} {}`",
                name(address::MIN_POSITION_LIMIT),
                spec.min_pulse,
                name(address::MAX_POSITION_LIMIT),
                spec.max_pulse
            ),
        ))
    }

    /// Whether `pulse` is where the servo may stand: in its declared range, and within half a turn of where it was last, if it
    /// may make several.
    fn check_position(&self, index: usize, pulse: i32) -> Result<(), BusError> {
        let Servo {
            spec, last_pulse, ..
        } = &self.servos[index];
        if !spec.contains(pulse) {
            return Err(self.servo_problem(
                index,
                format!(
                    "it stands at {pulse} ({:.1} deg), outside its declared range {} to {}",
                    spec.position_rad(pulse).to_degrees(),
                    spec.min_pulse,
                    spec.max_pulse
                ),
                "Turn the joint into its range by hand (torque is off), \
                 or check zero, direction and range in the configuration"
                    .into(),
            ));
        }
        let Some(last) = last_pulse.filter(|_| self.servos[index].lost_turns(pulse)) else {
            return Ok(());
        };
        // After a reboot or without power a servo counts from within one turn again.
        Err(self.servo_problem(
            index,
            format!(
                "it tells {pulse} and told {last} before: a joint of several turns has lost count of them, \
                 or was turned by more than half a turn"
            ),
            "Turn it by hand (torque is off) into the turn that its count means, then start again".into(),
        ))
    }

    /// What to do first, and how to restart servo `index` then.
    fn restart_advice(&self, index: usize, first: &str) -> String {
        let spec = &self.servos[index].spec;
        match spec.model.protocol {
            Protocol::Two => format!(
                "{first}, then `handwave bus reboot {} {}`",
                self.options.bus, spec.id
            ),
            Protocol::One => format!("{first}, then switch its power off and on"),
        }
    }

    /// Says which hardware errors are latched and how to get rid of them.
    pub(super) fn hardware_error(&self, index: usize, errors: u8) -> BusError {
        let names: Vec<&str> = hardware_error::NAMES
            .iter()
            .filter(|(bit, _)| errors & bit != 0)
            .map(|(_, name)| *name)
            .collect();
        let protocol = self.servos[index].spec.model.protocol;
        let what = if names.is_empty() {
            "unknown".into()
        } else {
            names.join(", ")
        };
        self.servo_problem(
            index,
            match protocol {
                Protocol::Two => {
                    format!("hardware error latched: {what} (register 70 = {errors:#04x})")
                }
                Protocol::One => format!("it reports {what} (error bits {errors:#04x})"),
            },
            self.restart_advice(index, "Remove the cause"),
        )
    }

    /// Goal := present position, torque on and read back, for one servo.
    pub(super) fn arm_servo(&mut self, index: usize) -> Result<(), BusError> {
        let [errors] = self.read_register(index, address::HARDWARE_ERROR_STATUS)?;
        if errors != 0 {
            return Err(self.hardware_error(index, errors));
        }
        // A tripped watchdog refuses goals.
        self.write_register(index, address::BUS_WATCHDOG, &[0])?;
        self.write_settings(index)?;
        let pulse = i32::from_le_bytes(self.read_register(index, address::PRESENT_POSITION)?);
        self.check_position(index, pulse)?;
        let (goal, bytes, size) = resting_goal(&self.servos[index].spec, pulse);
        self.insist(index, |client, id| client.write(id, goal, &bytes[..size]))?;
        // From here on torque may be on, whatever the answers say.
        self.servos[index].armed = true;
        self.write_register(index, address::TORQUE_ENABLE, &[1])?;
        let [torque] = self.read_register(index, address::TORQUE_ENABLE)?;
        if torque != 1 {
            return Err(self.servo_problem(
                index,
                format!("torque does not come on (torque_enable reads {torque})"),
                self.restart_advice(index, "Check its supply"),
            ));
        }
        let servo = &mut self.servos[index];
        servo.goal_pulse = f64::from(pulse);
        servo.last_pulse = Some(pulse);
        servo.follower.restart();
        servo.link = Link::Driven;
        Ok(())
    }

    /// Profile, gains and current limit: RAM that a reboot or a change of mode has put back.
    fn write_settings(&mut self, index: usize) -> Result<(), BusError> {
        let spec = &self.servos[index].spec;
        let (acceleration, velocity) = match &spec.settings.profile {
            Some(profile) => profile.counts(spec.model),
            None => (
                self.options.profile_acceleration,
                self.options.profile_velocity,
            ),
        };
        let gains = spec.settings.gains.registers();
        let limit = self.servos[index].follower.limit;
        let limits_current = spec.mode == Mode::CurrentBasedPosition;
        let mut profile = [0; 8];
        profile[..4].copy_from_slice(&acceleration.to_le_bytes());
        profile[4..].copy_from_slice(&velocity.to_le_bytes());
        self.write_register(index, address::PROFILE_ACCELERATION, &profile)?;
        for (_, register, value) in gains {
            if let Some(value) = value {
                self.write_register(index, register, &value.to_le_bytes())?;
            }
        }
        if limits_current {
            // In this mode the goal current is the most that it uses, either way.
            let counts = limit.clamp(0, i32::from(i16::MAX)) as u16;
            self.write_register(index, address::GOAL_CURRENT, &counts.to_le_bytes())?;
        }
        Ok(())
    }

    /// Starts the watchdog of one servo where it is wanted and there is one. Only with torque on: it counts then only.
    pub(super) fn start_watchdog(&mut self, index: usize) -> Result<(), BusError> {
        let counts = self.servos[index].watchdog;
        if counts == 0 {
            return Ok(());
        }
        self.write_register(index, address::BUS_WATCHDOG, &[counts])
    }
}
