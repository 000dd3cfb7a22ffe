//! Zero, direction and range of a joint, learnt from movements by hand while torque is off.

use crate::bus::dynamixel::servo::{Direction, ServoSpec};
use std::f64::consts::TAU;

/// Least movement from which a direction is read, radians: five degrees.
pub const LEAST_MOVE_RAD: f64 = 5.0 * TAU / 360.0;
/// By so much a hand may miss the end of a range, radians: three degrees.
pub const HAND_SLACK_RAD: f64 = 3.0 * TAU / 360.0;

/// Follows one servo's position while a hand moves it, also over the end of its turn.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Follower {
    per_turn: i64,
    last: i64,
    turns: i64,
    /// Least position seen, pulses; below 0 when it passed the end of the turn.
    pub min: i64,
    /// Greatest position seen, pulses.
    pub max: i64,
}

impl Follower {
    /// Begins at `pulse`.
    pub fn new(pulse: i32, pulses_per_turn: f64) -> Self {
        let pulse = i64::from(pulse);
        Self {
            per_turn: pulses_per_turn as i64,
            last: pulse,
            turns: 0,
            min: pulse,
            max: pulse,
        }
    }

    /// Takes a new reading in. Readings must come more often than every half turn.
    pub fn push(&mut self, pulse: i32) {
        let pulse = i64::from(pulse);
        let step = pulse - self.last;
        if step.abs() > self.per_turn / 2 {
            self.turns -= step.signum();
        }
        self.last = pulse;
        self.min = self.min.min(self.now());
        self.max = self.max.max(self.now());
    }

    /// Where it is, pulses, counted on over the end of the turn.
    pub fn now(&self) -> i64 {
        self.last + self.turns * self.per_turn
    }
}

/// Direction of a servo whose joint was moved in its positive sense from `from` to `to` (pulses); `None` when it
/// moved less than [`LEAST_MOVE_RAD`].
pub fn direction(from: i64, to: i64, pulses_per_turn: f64) -> Option<Direction> {
    let moved = (to - from) as f64 * TAU / pulses_per_turn;
    if moved.abs() < LEAST_MOVE_RAD {
        return None;
    }
    Some(match moved > 0.0 {
        true => Direction::Forward,
        false => Direction::Reverse,
    })
}

/// Why a measured range cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RangeProblem {
    /// The joint was not moved as far as the URDF lets it go.
    #[error(
        "{joint} was moved from {low:.1} to {high:.1} deg, and its URDF limits are {lower:.1} to {upper:.1} deg"
    )]
    Short {
        /// Joint.
        joint: String,
        /// Least that was reached, degrees.
        low: f64,
        /// Greatest that was reached, degrees.
        high: f64,
        /// URDF limits, degrees.
        lower: f64,
        /// URDF limits, degrees.
        upper: f64,
    },
    /// The servo's turn ends within the joint's range.
    #[error(
        "the range of {joint} passes the end of its servo's turn: it needs pulses {min} to {max} and there are 0 to {top}. \
         Take the horn off and put it back so that the joint's middle is near pulse {middle}"
    )]
    TurnEnds {
        /// Joint.
        joint: String,
        /// Least needed.
        min: i64,
        /// Greatest needed.
        max: i64,
        /// Greatest there is.
        top: i64,
        /// Middle of the turn.
        middle: i64,
    },
}

/// Pulses that the joint of `spec` (its zero and direction are known) may be sent to: as far as the hand moved it,
/// and as far as the URDF says (`lower`..`upper`, radians) where the hand missed an end by a little.
///
/// # Errors
/// The hand did not reach the URDF's limits, or the servo's turn ends within the range.
pub fn range(
    spec: &ServoSpec,
    hand: &Follower,
    (lower, upper): (f64, f64),
) -> Result<[i32; 2], RangeProblem> {
    let per_pulse = TAU / spec.model.pulses_per_turn;
    let sign = spec.direction.sign();
    let rad = |pulse: i64| (pulse - i64::from(spec.zero_pulse)) as f64 * per_pulse * sign;
    let (a, b) = (rad(hand.min), rad(hand.max));
    let (low, high) = (a.min(b), a.max(b));
    let short = low > lower + HAND_SLACK_RAD || high < upper - HAND_SLACK_RAD;
    if short {
        return Err(RangeProblem::Short {
            joint: spec.joint.clone(),
            low: low.to_degrees(),
            high: high.to_degrees(),
            lower: lower.to_degrees(),
            upper: upper.to_degrees(),
        });
    }
    let pulse = |rad: f64| f64::from(spec.zero_pulse) + rad / per_pulse * sign;
    let (c, d) = (pulse(lower), pulse(upper));
    let top = spec.model.pulses_per_turn as i64 - 1;
    // What the URDF asks for must be there; what the hand passed beyond it is cut off at the end of the turn.
    let (need_min, need_max) = (c.min(d).floor() as i64, c.max(d).ceil() as i64);
    if need_min < 0 || need_max > top {
        return Err(RangeProblem::TurnEnds {
            joint: spec.joint.clone(),
            min: need_min,
            max: need_max,
            top,
            middle: (top + 1) / 2,
        });
    }
    let min = hand.min.min(need_min).clamp(0, top);
    let max = hand.max.max(need_max).clamp(0, top);
    // Within the turn by the clamp.
    Ok([min as i32, max as i32])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::dynamixel::model::Model;
    use proptest::prelude::*;

    fn spec(zero_pulse: i32, direction: Direction) -> ServoSpec {
        let model = Model::by_name("xl430-w250").expect("a known model");
        ServoSpec {
            zero_pulse,
            direction,
            ..ServoSpec::new(1, "knee", model)
        }
    }

    fn moved(pulses: &[i32]) -> Follower {
        let mut hand = Follower::new(pulses[0], 4096.0);
        pulses.iter().for_each(|p| hand.push(*p));
        hand
    }

    #[test]
    fn a_nudge_tells_no_direction() {
        assert_eq!(direction(2048, 2048, 4096.0), None);
        assert_eq!(direction(2048, 2098, 4096.0), None);
        assert_eq!(direction(2048, 2148, 4096.0), Some(Direction::Forward));
        assert_eq!(direction(2048, 1900, 4096.0), Some(Direction::Reverse));
    }

    #[test]
    fn a_range_shorter_than_the_urdf_is_refused_with_both() {
        let problem = range(
            &spec(2048, Direction::Forward),
            &moved(&[2048, 2400, 1700]),
            (-1.0, 1.0),
        );
        let text = problem.expect_err("too short").to_string();
        assert!(
            text.contains("-30.6 to 30.9 deg") && text.contains("-57.3 to 57.3"),
            "{text}"
        );
    }

    #[test]
    fn a_hand_that_misses_the_end_by_two_degrees_gets_the_urdf_s() {
        // 1 rad is 652 pulses; the hand stops 20 short above and goes on below.
        let hand = moved(&[2048, 2680, 1300]);
        let found = range(&spec(2048, Direction::Reverse), &hand, (-1.0, 1.0));
        assert_eq!(found, Ok([1300, 2700]));
    }

    #[test]
    fn a_horn_half_a_turn_off_is_told_to_be_moved() {
        let hand = moved(&[3900, 4090, 5, 400, 3300]);
        assert_eq!((hand.min, hand.max), (3300, 4496));
        let text = range(&spec(3900, Direction::Forward), &hand, (-0.9, 0.9))
            .expect_err("the turn ends")
            .to_string();
        assert!(
            text.contains("3313 to 4487") && text.contains("horn"),
            "{text}"
        );
    }

    proptest! {
        #[test]
        fn a_range_covers_the_limits_of_the_urdf(
            zero in 1400..2700_i32, forward: bool, lower in -1.9..-0.1_f64, upper in 0.1..1.9_f64,
        ) {
            let direction = if forward { Direction::Forward } else { Direction::Reverse };
            let mut spec = spec(zero, direction);
            let sign = direction.sign();
            let ends = [lower, upper].map(|q| f64::from(zero) + sign * q * 4096.0 / TAU);
            let hand = moved(&[zero, ends[0].round() as i32, zero, ends[1].round() as i32]);
            if let Ok([min, max]) = range(&spec, &hand, (lower, upper)) {
                spec.min_pulse = min;
                spec.max_pulse = max;
                prop_assert!(spec.check().is_ok(), "{spec:?}");
                let reach = [spec.position_rad(min), spec.position_rad(max)];
                prop_assert!(reach[0].min(reach[1]) <= lower + 1e-3, "{reach:?} for {lower}");
                prop_assert!(reach[0].max(reach[1]) >= upper - 1e-3, "{reach:?} for {upper}");
            } else {
                prop_assert!(ends.iter().any(|e| !(0.5..=4094.5).contains(e)), "refused {ends:?}");
            }
        }

        #[test]
        fn a_hand_is_followed_over_the_end_of_the_turn(start in 0..4096_i32, steps in prop::collection::vec(-900..900_i32, 1..50)) {
            let mut hand = Follower::new(start, 4096.0);
            let mut truth = i64::from(start);
            for step in steps {
                truth += i64::from(step);
                hand.push(truth.rem_euclid(4096) as i32);
                prop_assert_eq!(hand.now(), truth);
            }
        }
    }
}
