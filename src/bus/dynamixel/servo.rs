//! One servo of a chain: what is declared of it, and joint coordinates to counts and back.

use super::model::{Model, STATE_BYTES};
use crate::base::{JointState, Time};
use std::f64::consts::TAU;

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
    pub max_pulse: i32,
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
    /// The range is empty or not within one turn.
    #[error(
        "joint {joint}: pulse range {min} to {max} is not an ascending range within 0 to {top}"
    )]
    Range {
        /// Joint.
        joint: String,
        /// Least count.
        min: i32,
        /// Greatest count.
        max: i32,
        /// The greatest that the model has.
        top: i32,
    },
}

impl ServoSpec {
    /// A servo of `model` whose joint is 0 in the middle of the turn and may use the whole turn.
    pub fn new(id: u8, joint: impl Into<String>, model: &'static Model) -> Self {
        let turn = model.pulses_per_turn as i32;
        ServoSpec {
            id,
            joint: joint.into(),
            model,
            zero_pulse: turn / 2,
            direction: Direction::Forward,
            min_pulse: 0,
            max_pulse: turn - 1,
        }
    }

    /// Checks one servo on its own.
    pub fn check(&self) -> Result<(), SpecError> {
        let top = self.model.pulses_per_turn as i32 - 1;
        if self.id > handwave_dynamixel::MAX_ID {
            return Err(SpecError::Id {
                joint: self.joint.clone(),
                id: self.id,
            });
        }
        if self.min_pulse < 0 || self.max_pulse > top || self.min_pulse >= self.max_pulse {
            return Err(SpecError::Range {
                joint: self.joint.clone(),
                min: self.min_pulse,
                max: self.max_pulse,
                top,
            });
        }
        Ok(())
    }

    fn pulse_rad(&self) -> f64 {
        self.direction.sign() * TAU / self.model.pulses_per_turn
    }

    /// Joint position in radians at `pulse`.
    pub fn position_rad(&self, pulse: i32) -> f64 {
        (f64::from(pulse) - f64::from(self.zero_pulse)) * self.pulse_rad()
    }

    /// The count for a joint position in radians, within the declared range; `None` for NaN.
    pub fn goal_pulse(&self, position_rad: f64) -> Option<i32> {
        if position_rad.is_nan() {
            return None;
        }
        let pulse = (position_rad / self.pulse_rad() + f64::from(self.zero_pulse)).round();
        // In range by the clamp, so the conversion is exact.
        Some(pulse.clamp(self.min_pulse.into(), self.max_pulse.into()) as i32)
    }

    /// Whether `pulse` lies within the declared range.
    pub fn contains(&self, pulse: i32) -> bool {
        (self.min_pulse..=self.max_pulse).contains(&pulse)
    }

    /// The joint state in the registers from 126 on: load, velocity, position.
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
