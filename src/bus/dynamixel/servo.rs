//! One servo of a chain: what is declared of it, and joint coordinates to counts and back.

use super::model::{Effort, Mode, Model, Protocol, STATE_BYTES, address};
use super::settings::Settings;
use crate::base::{JointState, Time};
use std::fmt;

/// Which way a joint turns when the servo's count grows.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub enum Direction {
    /// Position grows with the count.
    #[default]
    Forward,
    /// Position falls as the count grows.
    Reverse,
}

impl Direction {
    /// 1 or -1.
    pub const fn sign(self) -> f64 {
        match self {
            Direction::Forward => 1.0,
            Direction::Reverse => -1.0,
        }
    }
}

/// What is declared of one servo.
#[derive(Clone, Debug, PartialEq)]
pub struct ServoSpec {
    /// Servo id, 0..=252.
    pub id: u8,
    /// Joint that it moves.
    pub joint: String,
    /// Servo model.
    pub model: &'static Model,
    /// Count at joint position 0; the middle of the turn is 2048.
    pub zero_pulse: i32,
    /// Which way the joint turns.
    pub direction: Direction,
    /// Least count that may be commanded.
    pub min_pulse: i32,
    /// Greatest count that may be commanded.
    ///
    /// Outside [`Mode::Position`] the range may span several turns, and the servo itself has no limits:
    /// this range alone holds the joint.
    pub max_pulse: i32,
    /// Operating mode that the servo is set to.
    pub mode: Mode,
    /// What is written to it before torque goes on.
    pub settings: Settings,
}

/// Why a declared servo makes no sense.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SpecError {
    /// The id cannot be that of a servo.
    #[error("joint {joint}: servo id {id} is not between 0 and 252")]
    Id {
        /// Joint.
        joint: String,
        /// Id.
        id: u8,
    },
    /// Two joints have the same servo.
    #[error("joints {first} and {second} both name servo {id}; every joint needs its own")]
    DuplicateId {
        /// Id.
        id: u8,
        /// One joint.
        first: String,
        /// The other joint.
        second: String,
    },
    /// Servos of both protocols on one line.
    #[error(
        "joint {first} has an {first_model}, which speaks Protocol {first_protocol}, joint {second} on the same bus an \
         {second_model}, which speaks Protocol {second_protocol}: on one line they would take one another's frames for \
         their own. Put them on two buses ([[bus]] in the configuration, a port each)"
    )]
    Protocol {
        /// One joint.
        first: String,
        /// Its model.
        first_model: &'static str,
        /// What it speaks.
        first_protocol: Protocol,
        /// The other joint.
        second: String,
        /// Its model.
        second_model: &'static str,
        /// What it speaks.
        second_protocol: Protocol,
    },
    /// The range is empty or not within what the mode has.
    #[error(
        "joint {joint}: pulse range {min} to {max} is not an ascending range within {bottom} to {top}{hint}"
    )]
    Range {
        /// Joint.
        joint: String,
        /// Least count.
        min: i32,
        /// Greatest count.
        max: i32,
        /// The least that the model has in that mode.
        bottom: i32,
        /// The greatest that the model has in that mode.
        top: i32,
        /// What else could be meant.
        hint: &'static str,
    },
    /// The model does not have the mode, or it is none for joints.
    #[error("joint {joint}: {model} has no mode \"{mode}\" for joints{reason}. Allowed: {}", Names(.modes))]
    Mode {
        /// Joint.
        joint: String,
        /// Name of the model.
        model: &'static str,
        /// Name of the mode.
        mode: &'static str,
        /// Why, if that is known.
        reason: &'static str,
        /// Modes that it has for joints.
        modes: Vec<&'static str>,
    },
    /// A setting that the model or mode cannot have.
    #[error("joint {joint}: {problem}")]
    Setting {
        /// Joint.
        joint: String,
        /// What was found and what is allowed.
        problem: String,
    },
}

/// Names with commas between.
struct Names<'a>(&'a [&'static str]);

impl fmt::Display for Names<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.join(", "))
    }
}

impl ServoSpec {
    /// A servo of `model` in position mode whose joint is 0 in the middle of the turn and may use the whole turn.
    pub fn new(id: u8, joint: impl Into<String>, model: &'static Model) -> Self {
        let (min_pulse, max_pulse) = model.turn_pulses;
        ServoSpec {
            id,
            joint: joint.into(),
            model,
            zero_pulse: model.centre_pulse,
            direction: Direction::Forward,
            min_pulse,
            max_pulse,
            mode: Mode::Position,
            settings: Settings::default(),
        }
    }

    /// The same in another mode, with another range.
    pub fn in_mode(self, mode: Mode, min_pulse: i32, max_pulse: i32) -> Self {
        ServoSpec {
            mode,
            min_pulse,
            max_pulse,
            ..self
        }
    }

    /// Checks one servo on its own.
    pub fn check(&self) -> Result<(), SpecError> {
        let joint = || self.joint.clone();
        if self.id > handwave_dynamixel::MAX_ID {
            return Err(SpecError::Id {
                joint: joint(),
                id: self.id,
            });
        }
        if !self.model.modes.contains(&self.mode) || self.mode == Mode::Pwm {
            let joint_modes = self.model.modes.iter().filter(|mode| **mode != Mode::Pwm);
            let loads = self.mode.uses_current() && self.model.effort == Effort::Load;
            return Err(SpecError::Mode {
                joint: joint(),
                model: self.model.name,
                mode: self.mode.name(),
                reason: if loads {
                    ": it reports load and measures no current"
                } else {
                    ""
                },
                modes: joint_modes.map(|mode| mode.name()).collect(),
            });
        }
        let (bottom, top) = self.model.goal_range(self.mode);
        if self.min_pulse < bottom || self.max_pulse > top || self.min_pulse >= self.max_pulse {
            let turns = self.mode.has_position_limits() && self.min_pulse < self.max_pulse;
            return Err(SpecError::Range {
                joint: joint(),
                min: self.min_pulse,
                max: self.max_pulse,
                bottom,
                top,
                hint: if turns {
                    "; several turns need mode \"extended_position\""
                } else {
                    ""
                },
            });
        }
        self.settings
            .check(self.model, self.mode)
            .map_err(|problem| SpecError::Setting {
                joint: joint(),
                problem,
            })
    }

    /// This servo's address of an X series register.
    pub fn at(&self, x_series: u16) -> u16 {
        self.model.layout.at(x_series)
    }

    /// The address that its goal is written to in every cycle, and the goal's bytes.
    pub fn goal_register(&self) -> (u16, u8) {
        let (x_series, bytes) = self.mode.goal();
        (self.at(x_series), bytes)
    }

    /// The address from which its state is read in every cycle, [`STATE_BYTES`] long.
    pub fn state_register(&self) -> u16 {
        self.at(address::PRESENT_STATE)
    }

    /// Radians that the joint turns per count.
    pub(super) fn pulse_rad(&self) -> f64 {
        self.direction.sign() * self.model.pulse_rad()
    }

    /// Joint position in radians at `pulse`.
    pub fn position_rad(&self, pulse: i32) -> f64 {
        self.radians_at(f64::from(pulse))
    }

    /// Joint position in radians at a count with fractions.
    pub(super) fn radians_at(&self, pulse: f64) -> f64 {
        (pulse - f64::from(self.zero_pulse)) * self.pulse_rad()
    }

    /// The count, with fractions and not clamped, at a joint position in radians.
    pub(super) fn pulse_at(&self, position_rad: f64) -> f64 {
        position_rad / self.pulse_rad() + f64::from(self.zero_pulse)
    }

    /// The count for a joint position in radians, within the declared range; `None` for NaN.
    pub fn goal_pulse(&self, position_rad: f64) -> Option<i32> {
        if position_rad.is_nan() {
            return None;
        }
        let pulse = self.pulse_at(position_rad).round();
        // In range by the clamp, so the conversion is exact.
        Some(pulse.clamp(self.min_pulse.into(), self.max_pulse.into()) as i32)
    }

    /// Whether `pulse` lies within the declared range.
    pub fn contains(&self, pulse: i32) -> bool {
        (self.min_pulse..=self.max_pulse).contains(&pulse)
    }

    /// The joint state in the registers from 126 on: load or current, velocity, position. Effort is in the model's unit.
    pub fn state(&self, registers: &[u8; STATE_BYTES], measured_at: Time) -> JointState {
        let [l0, l1, v0, v1, v2, v3, p0, p1, p2, p3] = *registers;
        let sign = self.direction.sign();
        let load = i16::from_le_bytes([l0, l1]);
        let velocity = i32::from_le_bytes([v0, v1, v2, v3]);
        let position = i32::from_le_bytes([p0, p1, p2, p3]);
        JointState {
            position: self.position_rad(position),
            velocity: sign * f64::from(velocity) * self.model.velocity_unit_rad_s,
            effort: sign * f64::from(load) * self.model.effort_unit,
            measured_at: Some(measured_at),
        }
    }
}

/// What the servos of a line speak; none of them: Protocol 2.0.
///
/// # Errors
/// They do not speak the same.
pub fn protocol_of(specs: &[ServoSpec]) -> Result<Protocol, SpecError> {
    let Some((first, rest)) = specs.split_first() else {
        return Ok(Protocol::Two);
    };
    let protocol = first.model.protocol;
    match rest.iter().find(|other| other.model.protocol != protocol) {
        None => Ok(protocol),
        Some(other) => Err(SpecError::Protocol {
            first: first.joint.clone(),
            first_model: first.model.name,
            first_protocol: protocol,
            second: other.joint.clone(),
            second_model: other.model.name,
            second_protocol: other.model.protocol,
        }),
    }
}

/// The position in the registers from 126 on.
pub(super) fn position_pulse(registers: &[u8; STATE_BYTES]) -> i32 {
    let [.., p0, p1, p2, p3] = *registers;
    i32::from_le_bytes([p0, p1, p2, p3])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn spec() -> ServoSpec {
        let model = Model::by_name("XL430-W250").expect("XL430-W250 is known");
        ServoSpec::new(1, "hip", model)
    }

    #[test]
    fn a_quarter_turn_is_1024_counts_either_way() {
        let forward = spec();
        let reverse = ServoSpec {
            direction: Direction::Reverse,
            ..spec()
        };
        assert_eq!(forward.goal_pulse(FRAC_PI_2), Some(3072));
        assert_eq!(reverse.goal_pulse(FRAC_PI_2), Some(1024));
        for pulse in 0..4096 {
            for spec in [&forward, &reverse] {
                let back = spec.goal_pulse(spec.position_rad(pulse));
                assert_eq!(back, Some(pulse), "{:?}", spec.direction);
            }
        }
    }

    #[test]
    fn a_goal_never_leaves_the_declared_range() {
        let spec = ServoSpec {
            min_pulse: 1500,
            max_pulse: 2500,
            ..spec()
        };
        for (position_rad, expected) in [
            (1e300, Some(2500)),
            (-1e300, Some(1500)),
            (f64::INFINITY, Some(2500)),
            (f64::NEG_INFINITY, Some(1500)),
            (f64::NAN, None),
        ] {
            assert_eq!(spec.goal_pulse(position_rad), expected, "{position_rad}");
        }
    }

    #[test]
    fn several_turns_are_for_modes_that_have_them() {
        let turns = |mode, min, max| spec().in_mode(mode, min, max).check();
        assert_eq!(turns(Mode::ExtendedPosition, -4096, 8191), Ok(()));
        assert_eq!(turns(Mode::Velocity, -1_048_575, 1_048_575), Ok(()));
        for (mode, min, max, expected) in [
            (Mode::Position, 0, 8191, "extended_position"),
            (Mode::Position, 4095, 0, "ascending range within 0 to 4095"),
            (Mode::ExtendedPosition, 0, 1_048_576, "-1048575 to 1048575"),
            (
                Mode::Current,
                0,
                4095,
                "measures no current. Allowed: velocity, position, extended_position",
            ),
            (Mode::CurrentBasedPosition, 0, 4095, "measures no current"),
            (Mode::Pwm, 0, 4095, "Allowed: velocity"),
        ] {
            let message = turns(mode, min, max).expect_err("refused").to_string();
            assert!(
                message.contains(expected),
                "{mode:?} {min}..{max}: {message}"
            );
        }
        let fine = Model::by_name("ph42-020-s300").expect("a known model");
        let spec = ServoSpec::new(1, "hip", fine);
        assert_eq!((spec.min_pulse, spec.max_pulse), (-303_454, 303_454));
        assert_eq!(spec.goal_pulse(FRAC_PI_2), Some(151_875));
    }

    #[test]
    fn registers_become_si_units() {
        // Load -50.0 %, 100 counts of 0.229 rev/min, count 3072.
        let registers = [0x0C, 0xFE, 100, 0, 0, 0, 0x00, 0x0C, 0, 0];
        let state = spec().state(&registers, Time::ZERO);
        assert!(
            (state.effort + 0.5).abs() < 1e-12,
            "effort {}",
            state.effort
        );
        assert!(
            (state.velocity - 2.398_082).abs() < 1e-6,
            "velocity {}",
            state.velocity
        );
        assert!(
            (state.position - FRAC_PI_2).abs() < 1e-12,
            "position {}",
            state.position
        );
    }
}
