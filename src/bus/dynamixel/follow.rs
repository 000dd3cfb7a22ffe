//! The host's position loop for servos that have none in their mode: velocity and current.
//!
//! A joint-space target means the same in every mode, a position to be at. In [`Mode::Velocity`] the goal velocity is the
//! rate of the target plus a gain times the error of position, in [`Mode::Current`] the goal current is that of a spring and
//! a damper between joint and target ([`Follow`](super::settings::Follow)). What makes it safe: a target is clamped to the
//! declared range before, a goal to the servo's limit, and towards the outside of the range there is none. A servo that has not
//! told its position for [`STALE`] gets the goal at which it does nothing by itself: no velocity, no current.

use super::model::Mode;
use super::servo::ServoSpec;
use crate::base::{JointState, Time};
use std::time::Duration;

/// A position older than this is none.
pub(super) const STALE: Duration = Duration::from_millis(50);

/// What the loop of one servo remembers, in joint coordinates.
#[derive(Copy, Clone, Debug, Default)]
pub(super) struct Follower {
    /// Most counts of a goal, either way; register 44 or 38, or less when configured.
    pub limit: i32,
    last_target_rad: Option<f64>,
}

impl Follower {
    /// Begins anew: the target before counts no more.
    pub fn restart(&mut self) {
        self.last_target_rad = None;
    }

    /// The goal in counts that leads the servo from `state` to `target_rad`, `step_s` after the call before.
    pub fn goal(
        &mut self,
        spec: &ServoSpec,
        target_rad: f64,
        state: &JointState,
        step_s: f64,
        now: Time,
    ) -> i32 {
        let last_rad = self.last_target_rad.replace(target_rad);
        let fresh = state
            .measured_at
            .is_some_and(|at| now.saturating_since(at) <= STALE);
        if !fresh {
            return 0;
        }
        let rate_rad_s = match last_rad {
            Some(last) if step_s > 0.0 => (target_rad - last) / step_s,
            _ => 0.0,
        };
        let gains = spec.settings.follow;
        let error_rad = target_rad - state.position;
        let (wanted, unit) = match spec.mode {
            Mode::Velocity => (
                rate_rad_s + gains.p * error_rad,
                spec.model.velocity_unit_rad_s,
            ),
            _ => (
                gains.p * error_rad + gains.d * (rate_rad_s - state.velocity),
                spec.model.effort_unit,
            ),
        };
        let limit = f64::from(self.limit);
        let counts = (spec.direction.sign() * wanted / unit)
            .round()
            .clamp(-limit, limit);
        let pulse = spec.pulse_at(state.position);
        let outwards = (counts > 0.0 && pulse >= f64::from(spec.max_pulse))
            || (counts < 0.0 && pulse <= f64::from(spec.min_pulse));
        // Not a number cannot come of finite values; as a goal it would be 0.
        if outwards { 0 } else { counts as i32 }
    }
}

#[cfg(test)]
mod tests {
    use super::super::model::Model;
    use super::super::settings::Follow;
    use super::*;
    use proptest::prelude::*;

    fn spec(mode: Mode) -> ServoSpec {
        let model = Model::by_name("xm430-w350").expect("a known model");
        let mut spec = ServoSpec::new(1, "wheel", model).in_mode(mode, -8192, 8192);
        spec.settings.follow = Follow { p: 10.0, d: 0.5 };
        spec
    }

    fn at(position: f64, velocity: f64) -> JointState {
        JointState {
            position,
            velocity,
            effort: 0.0,
            measured_at: Some(Time::ZERO),
        }
    }

    #[test]
    fn a_target_that_moves_away_gives_its_rate_and_the_error() {
        let mut follower = Follower {
            limit: 1023,
            ..Follower::default()
        };
        let spec = spec(Mode::Velocity);
        let first = follower.goal(&spec, 0.0, &at(0.0, 0.0), 0.005, Time::ZERO);
        assert_eq!(first, 0, "no rate before a second target");
        // 0.005 rad in 5 ms are 1 rad/s, and 10/s times 0.005 rad is 0.05 rad/s; a count is 0.02398 rad/s.
        let second = follower.goal(&spec, 0.005, &at(0.0, 0.0), 0.005, Time::ZERO);
        assert_eq!(second, 44);
        follower.restart();
        let anew = follower.goal(&spec, 0.1, &at(0.0, 0.0), 0.005, Time::ZERO);
        assert_eq!(anew, 42, "after a restart no rate, 1 rad/s of error");
    }

    #[test]
    fn without_a_fresh_position_nothing_is_asked_for() {
        let spec = spec(Mode::Velocity);
        let late = Time::ZERO + STALE + Duration::from_millis(1);
        let never = JointState::default();
        for state in [at(0.0, 0.0), never] {
            let mut follower = Follower {
                limit: 1023,
                ..Follower::default()
            };
            assert_eq!(
                follower.goal(&spec, 1.0, &state, 0.005, late),
                0,
                "{state:?}"
            );
        }
    }

    proptest! {
        #[test]
        fn goals_keep_the_limit_and_never_lead_out_of_the_range(
            current in any::<bool>(),
            reverse in any::<bool>(),
            limit in 0..2048i32,
            targets in prop::collection::vec(-1e3..1e3f64, 1..20),
            position in -40.0..40.0f64,
            velocity in -1e3..1e3f64,
        ) {
            let mut spec = spec(if current { Mode::Current } else { Mode::Velocity });
            if reverse {
                spec.direction = super::super::Direction::Reverse;
            }
            let mut follower = Follower { limit, ..Follower::default() };
            for target in targets {
                let goal = follower.goal(&spec, target, &at(position, velocity), 0.005, Time::ZERO);
                prop_assert!(goal.abs() <= limit, "{goal} of {limit}");
                let pulse = spec.pulse_at(position);
                prop_assert!(!(pulse >= 8192.0 && goal > 0), "{goal} at {pulse}");
                prop_assert!(!(pulse <= -8192.0 && goal < 0), "{goal} at {pulse}");
            }
        }
    }
}
