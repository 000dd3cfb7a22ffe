//! Steps of a joint whose acceleration may change only so fast.
//!
//! With `p`, `v`, `a` the last output and its first and second backward differences, a step chooses the next `a` within
//! `j dt` of the last and within `[-a_max, a_max]`. The proof that no limit is ever left is by induction over
//! [`Motion::brake`], one fixed way to a stand-still: every step leads to a motion whose brake stays inside the position
//! and velocity limits, because the step is chosen only after the brake behind it was played through; and the first step
//! of the brake is always left as a choice, because what follows it is the rest of the brake that was played through
//! before, bit for bit. Braking distance with jerk is thus not estimated, it is driven.

use super::speed_to_stop_within;

/// Longer than this no brake is played through, steps; a step that would need a longer one is not chosen.
const LONGEST_BRAKE: usize = 4096;
/// Halvings of the span between what is asked and the brake, in search of what is still allowed.
const HALVINGS: usize = 10;
/// Below this a brake has come to its end, rad/s.
const AT_REST_RAD_S: f64 = 1e-12;

/// A joint's position, speed and acceleration as differences over whole steps.
#[derive(Copy, Clone, Debug, Default)]
pub(super) struct Motion {
    pub position: f64,
    pub velocity: f64,
    pub acceleration: f64,
}

/// How acceleration may change, and how large it may be.
#[derive(Copy, Clone, Debug)]
pub(super) struct Agility {
    /// rad/s^2.
    pub acceleration: f64,
    /// rad/s^3.
    pub jerk: f64,
    pub dt: f64,
}

/// Where a brake must stay.
#[derive(Copy, Clone, Debug)]
pub(super) struct Room {
    pub lower: f64,
    pub upper: f64,
    pub velocity: f64,
}

impl Motion {
    /// The motion one step later, with this acceleration.
    pub fn moved(self, acceleration: f64, dt: f64) -> Self {
        let velocity = self.velocity + acceleration * dt;
        Self {
            position: self.position + velocity * dt,
            velocity,
            acceleration,
        }
    }

    /// The acceleration of the next step towards a stand-still: as much against the motion as is allowed and can be
    /// taken back by `j dt` per step before the speed is used up. Taking back `m` costs the speed
    /// `dt ((n+1) m - j dt n(n+1)/2)` over `n` more steps: the same sum as for a way, one derivative higher.
    pub fn brake(self, agility: &Agility) -> f64 {
        let Agility {
            acceleration,
            jerk,
            dt,
        } = *agility;
        let most = speed_to_stop_within(self.velocity.abs(), jerk, dt).min(acceleration);
        let wanted = if self.velocity > 0.0 { -most } else { most };
        wanted.clamp(self.acceleration - jerk * dt, self.acceleration + jerk * dt)
    }

    fn at_rest(self, agility: &Agility) -> bool {
        self.velocity.abs() < AT_REST_RAD_S && self.acceleration.abs() <= agility.jerk * agility.dt
    }

    /// Plays the brake through; false when it leaves the room or does not end.
    pub fn brakes_within(mut self, room: &Room, agility: &Agility) -> bool {
        for _ in 0..LONGEST_BRAKE {
            let inside = self.position >= room.lower
                && self.position <= room.upper
                && self.velocity.abs() <= room.velocity;
            if !inside {
                return false;
            }
            if self.at_rest(agility) {
                return true;
            }
            self = self.moved(self.brake(agility), agility.dt);
        }
        false
    }

    /// How far the brake leads.
    fn braking_way(mut self, agility: &Agility) -> f64 {
        let from = self.position;
        for _ in 0..LONGEST_BRAKE {
            if self.at_rest(agility) {
                break;
            }
            self = self.moved(self.brake(agility), agility.dt);
        }
        self.position - from
    }

    /// The acceleration nearest to `wanted` (by halving) after which the brake stays in the room; that of the brake
    /// when there is none, as after the room became smaller than the motion fits: the brake keeps to the old one.
    pub fn nearest_allowed(self, wanted: f64, room: &Room, agility: &Agility) -> f64 {
        let allowed = |a: f64| self.moved(a, agility.dt).brakes_within(room, agility);
        if allowed(wanted) {
            return wanted;
        }
        let (mut good, mut bad) = (self.brake(agility), wanted);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (good + bad);
            if allowed(middle) {
                good = middle;
            } else {
                bad = middle;
            }
        }
        good
    }

    /// The acceleration of the next step that leads to a target now `ahead` of this motion and moving at `speed`, so
    /// that the brake behind it would end on the target.
    pub fn closing(self, ahead: f64, speed: f64, agility: &Agility) -> f64 {
        let step = agility.jerk * agility.dt;
        let most = agility.acceleration;
        let mut low = (self.acceleration - step).clamp(-most, most);
        let mut high = (self.acceleration + step).clamp(-most, most);
        // Seen from the target, which moves on evenly.
        let seen = Motion {
            position: -ahead,
            velocity: self.velocity - speed,
            acceleration: self.acceleration,
        };
        let ends_beyond = |a: f64| {
            let next = seen.moved(a, agility.dt);
            next.position + next.braking_way(agility) > 0.0
        };
        if ends_beyond(low) {
            return low;
        }
        if !ends_beyond(high) {
            return high;
        }
        for _ in 0..2 * HALVINGS {
            let middle = 0.5 * (low + high);
            if ends_beyond(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_brake_ends_at_rest_whatever_it_begins_with_and_changes_direction_once_at_most() {
        for jerk in [100.0, 1_000.0, 20_000.0, 1e6] {
            let agility = Agility {
                acceleration: 80.0,
                jerk,
                dt: 0.005,
            };
            for velocity in [-6.0, -0.3, -1e-7, 0.0, 0.011, 2.0, 6.0] {
                for acceleration in [-80.0, -3.0, 0.0, 0.7, 80.0] {
                    let mut motion = Motion {
                        position: 0.0,
                        velocity,
                        acceleration,
                    };
                    let (mut steps, mut turns) = (0, 0);
                    while !motion.at_rest(&agility) && steps < 2000 {
                        let next = motion.moved(motion.brake(&agility), agility.dt);
                        // What rounding leaves at the end has no direction.
                        let real = next.velocity.abs() > 1e-9 && motion.velocity.abs() > 1e-9;
                        turns += usize::from(real && next.velocity * motion.velocity < 0.0);
                        let change = (next.acceleration - motion.acceleration).abs();
                        assert!(change <= jerk * agility.dt * (1.0 + 1e-12));
                        assert!(next.acceleration.abs() <= 80.0);
                        motion = next;
                        steps += 1;
                    }
                    assert!(
                        steps < 2000 && turns <= 1,
                        "from {velocity} rad/s, {acceleration} rad/s^2 at {jerk} rad/s^3: {steps} steps, {turns} turns"
                    );
                }
            }
        }
    }
}
