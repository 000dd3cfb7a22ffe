//! The envelope: the last thing every target passes. Position, velocity, acceleration and, where asked for, jerk limits
//! that no input can break.

mod jerk;
#[cfg(test)]
mod tests;

use jerk::{Agility, Motion, Room};

/// Limits of one joint, in joint coordinates.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct JointEnvelope {
    /// Lowest position, rad.
    pub lower: f64,
    /// Highest position, rad.
    pub upper: f64,
    /// Highest speed, rad/s, above zero.
    pub velocity: f64,
    /// Highest acceleration, rad/s^2, above zero.
    pub acceleration: f64,
    /// Highest jerk, rad/s^3, above zero; infinite: acceleration may jump.
    pub jerk: f64,
}

/// Keeps a stream of joint targets inside its limits, one step per control cycle.
///
/// A target that is reachable passes unchanged. One that is not is approached as fast as the limits
/// allow and met without overshoot of the limits: the speed is always low enough to stop before the
/// position limit. Not-a-number means "no target": the joint brakes and stays.
///
/// With `p`, `v` the last output and its backward difference, each step chooses a speed from
/// `[v - a dt, v + a dt]`, `[-v_max, v_max]` and the speeds from which braking by `a dt` per step
/// still ends inside the position limits; the intersection is never empty once the start was inside.
/// Where jerk is limited, `jerk.rs` says how; what is guaranteed is the same, and the jerk limit with it.
#[derive(Clone, Debug)]
pub struct Envelope {
    limits: Vec<JointEnvelope>,
    joints: Vec<JointMotion>,
    dt_s: f64,
    /// Share of the velocity limits in use, 0..1.
    pace: f64,
}

#[derive(Copy, Clone, Debug, Default)]
struct JointMotion {
    position: f64,
    velocity: f64,
    /// Of the last step; where jerk is limited.
    acceleration: f64,
    /// Last target after clamping to the position limits, for its speed.
    last_target: f64,
    /// The output has left the target and is on its way back to it.
    catching_up: bool,
}

/// Slack for rounding: a billionth of a radian.
const EPSILON: f64 = 1e-9;

impl Envelope {
    /// An envelope for one step every `dt_s` seconds.
    pub fn new(limits: Vec<JointEnvelope>, dt_s: f64) -> Self {
        let joints = vec![JointMotion::default(); limits.len()];
        Self {
            limits,
            joints,
            dt_s,
            pace: 1.0,
        }
    }

    /// The limits, in joint order.
    pub fn limits(&self) -> &[JointEnvelope] {
        &self.limits
    }

    /// Uses this share of every velocity limit from the next step on, 0..1. A joint that is faster brakes
    /// within its acceleration.
    pub fn set_pace(&mut self, share: f64) {
        self.pace = share.clamp(0.0, 1.0);
    }

    /// Starts at rest from `present` (rad, joint order). A position outside the limits is kept;
    /// from there only movement towards the inside is let through.
    pub fn start(&mut self, present: &[f64]) {
        for (joint, position) in self.joints.iter_mut().zip(present) {
            *joint = JointMotion {
                position: *position,
                velocity: 0.0,
                acceleration: 0.0,
                last_target: *position,
                catching_up: false,
            };
        }
    }

    /// Takes on the state of `other`, an envelope of as many joints, without allocating.
    pub fn copy_from(&mut self, other: &Self) {
        self.joints.copy_from_slice(&other.joints);
        self.pace = other.pace;
    }

    /// Passes one step of targets into `out`. Returns how many joints had to be held back.
    ///
    /// Slices are in joint order. Constant time per joint, no allocation.
    pub fn pass(&mut self, targets: &[f64], out: &mut [f64]) -> usize {
        let dt = self.dt_s;
        let mut held_back = 0;
        for (((joint, limit), target), out) in self
            .joints
            .iter_mut()
            .zip(&self.limits)
            .zip(targets)
            .zip(out)
        {
            let acted = if limit.jerk.is_finite() {
                joint.step_smoothly(limit, self.pace, *target, dt)
            } else {
                let slowed = (joint.velocity.abs() - limit.acceleration * dt).max(0.0);
                let velocity = limit.velocity.min((self.pace * limit.velocity).max(slowed));
                joint.step(&JointEnvelope { velocity, ..*limit }, *target, dt)
            };
            held_back += usize::from(acted);
            *out = joint.position;
        }
        held_back
    }
}

impl JointMotion {
    /// Moves by one step; true when the output is not the target that was asked for.
    fn step(&mut self, limit: &JointEnvelope, asked: f64, dt: f64) -> bool {
        let gain = limit.acceleration * dt;
        let room_up = speed_to_stop_within(limit.upper - self.position, limit.acceleration, dt);
        let room_down = speed_to_stop_within(self.position - limit.lower, limit.acceleration, dt);
        let highest = (self.velocity + gain).min(limit.velocity).min(room_up);
        let lowest = (self.velocity - gain).max(-limit.velocity).max(-room_down);
        // Empty only by rounding, or at the start outside the limits: then the position limit wins.
        let (lowest, highest) = if lowest > highest {
            let v = if room_up < self.velocity {
                highest
            } else {
                lowest
            };
            (v, v)
        } else {
            (lowest, highest)
        };
        if !asked.is_finite() {
            let velocity = 0.0_f64.clamp(lowest, highest);
            self.position += velocity * dt;
            self.velocity = velocity;
            self.last_target = self.position;
            self.catching_up = true;
            return true;
        }
        let target = asked.clamp(
            limit.lower.min(self.position),
            limit.upper.max(self.position),
        );
        let target_velocity =
            ((target - self.last_target) / dt).clamp(-limit.velocity, limit.velocity);
        self.last_target = target;
        let exact = (target - self.position) / dt;
        let reachable = exact >= lowest - EPSILON && exact <= highest + EPSILON;
        let velocity = if reachable && !self.catching_up {
            self.velocity = exact;
            self.position = target;
            return target != asked;
        } else {
            // Approach the moving target so that the difference in speed can be braked away in time.
            let behind = target - target_velocity * dt - self.position;
            let closing =
                speed_to_stop_within(behind.abs(), 0.8 * limit.acceleration, dt) * behind.signum();
            (target_velocity + closing).clamp(lowest, highest)
        };
        self.catching_up = true;
        self.position += velocity * dt;
        self.velocity = velocity;
        let left = target - self.position;
        if left.abs() < 1e-6 && (velocity - target_velocity).abs() < gain {
            self.catching_up = false;
        }
        // Rounding must not carry the output over a limit that it was inside of.
        if self.position > limit.upper && self.position < limit.upper + EPSILON {
            self.position = limit.upper;
        }
        if self.position < limit.lower && self.position > limit.lower - EPSILON {
            self.position = limit.lower;
        }
        true
    }
}

impl JointMotion {
    /// The same with limited jerk.
    fn step_smoothly(&mut self, limit: &JointEnvelope, pace: f64, asked: f64, dt: f64) -> bool {
        let agility = Agility {
            acceleration: limit.acceleration,
            jerk: limit.jerk,
            dt,
        };
        let now = Motion {
            position: self.position,
            velocity: self.velocity,
            acceleration: self.acceleration,
        };
        // A joint that is faster than the pace brakes as its jerk allows: nothing else is left to it.
        let velocity = pace * limit.velocity;
        let room = Room {
            lower: limit.lower.min(self.position),
            upper: limit.upper.max(self.position),
            velocity,
        };
        let (next, acted) = if asked.is_finite() {
            let target = asked.clamp(room.lower, room.upper);
            let speed = ((target - self.last_target) / dt).clamp(-velocity, velocity);
            self.last_target = target;
            match self.exactly(target, &agility) {
                Some(next) if !self.catching_up && next.brakes_within(&room, &agility) => {
                    (next, target != asked)
                }
                _ => {
                    // Gentler than it has to be, so that something is left for a target that changes its speed.
                    let gentle = Agility {
                        acceleration: 0.8 * limit.acceleration,
                        jerk: 0.8 * limit.jerk,
                        dt,
                    };
                    let ahead = target - speed * dt - self.position;
                    let wanted = now.closing(ahead, speed, &gentle);
                    let step = now.nearest_allowed(wanted, &room, &agility);
                    let next = now.moved(step, dt);
                    let arrived = (target - next.position).abs() < 1e-6
                        && (next.velocity - speed).abs() < limit.jerk * dt * dt
                        && next.acceleration.abs() < limit.jerk * dt;
                    self.catching_up = !arrived;
                    (next, true)
                }
            }
        } else {
            self.catching_up = true;
            let next = now.moved(now.brake(&agility), dt);
            self.last_target = next.position;
            (next, true)
        };
        self.position = next.position;
        self.velocity = next.velocity;
        self.acceleration = next.acceleration;
        acted
    }

    /// The motion that is on `target` after this step, when acceleration and jerk allow it.
    fn exactly(&self, target: f64, agility: &Agility) -> Option<Motion> {
        let velocity = (target - self.position) / agility.dt;
        let acceleration = (velocity - self.velocity) / agility.dt;
        // Rounding of a target is worth this much after three differences.
        let slack = EPSILON / agility.dt + 1e-9 * agility.acceleration;
        let jerk = (acceleration - self.acceleration).abs() <= agility.jerk * agility.dt + slack;
        (jerk && acceleration.abs() <= agility.acceleration + slack).then_some(Motion {
            position: target,
            velocity,
            acceleration,
        })
    }
}

/// The highest speed from which a joint that loses `acceleration * dt` of it per step travels at
/// most `distance`, the coming step included. Zero when there is no room.
///
/// With n whole braking steps the way is `dt ((n+1) v - a dt n(n+1)/2)`; solved for v.
fn speed_to_stop_within(distance: f64, acceleration: f64, dt: f64) -> f64 {
    if !(distance > 0.0) {
        return 0.0;
    }
    if distance == f64::INFINITY {
        return f64::INFINITY;
    }
    let quantum = acceleration * dt * dt;
    let n = ((-1.0 + (1.0 + 8.0 * distance / quantum).sqrt()) / 2.0).floor();
    (distance / dt + acceleration * dt * n * (n + 1.0) / 2.0) / (n + 1.0)
}
