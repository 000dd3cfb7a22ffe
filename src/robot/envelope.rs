//! The envelope: the last thing every target passes. Position, velocity, acceleration and, where asked for, jerk limits
//! that no input can break.

mod jerk;

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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DT: f64 = 0.005;
    const LIMIT: JointEnvelope = JointEnvelope {
        lower: -0.7,
        upper: 0.9,
        velocity: 4.0,
        acceleration: 80.0,
        jerk: f64::INFINITY,
    };
    const SMOOTH: JointEnvelope = JointEnvelope {
        jerk: 4_000.0,
        ..LIMIT
    };

    fn run(targets: impl IntoIterator<Item = f64>) -> Vec<(f64, usize)> {
        run_in(LIMIT, targets)
    }

    fn run_in(limit: JointEnvelope, targets: impl IntoIterator<Item = f64>) -> Vec<(f64, usize)> {
        let mut envelope = Envelope::new(vec![limit], DT);
        envelope.start(&[0.0]);
        let mut out = [0.0];
        targets
            .into_iter()
            .map(|t| {
                let acted = envelope.pass(&[t], &mut out);
                (out[0], acted)
            })
            .collect()
    }

    fn assert_inside(outputs: &[f64]) {
        assert_inside_of(LIMIT, outputs);
    }

    fn assert_inside_of(limit: JointEnvelope, outputs: &[f64]) {
        let mut position = 0.0;
        let mut velocity = 0.0;
        let mut acceleration = 0.0;
        for (k, p) in outputs.iter().enumerate() {
            let v = (p - position) / DT;
            let a = (v - velocity) / DT;
            assert!(
                (LIMIT.lower..=LIMIT.upper).contains(p),
                "step {k}: position {p} left {}..{}",
                LIMIT.lower,
                LIMIT.upper
            );
            assert!(v.abs() <= LIMIT.velocity + 1e-6, "step {k}: velocity {v}");
            assert!(
                a.abs() <= LIMIT.acceleration + 1e-3,
                "step {k}: acceleration {a}"
            );
            let j = (a - acceleration) / DT;
            assert!(
                j.abs() <= limit.jerk + 1e-3 * limit.jerk.min(1e6),
                "step {k}: jerk {j}"
            );
            position = *p;
            velocity = v;
            acceleration = a;
        }
    }

    #[test]
    fn with_limited_jerk_a_gentle_target_passes_untouched() {
        let wave = |k: i32| 0.3 * (1.0 - (f64::from(k) * DT * 4.0).cos());
        // Its second difference jumps from 0 to 4.8 rad/s^2 at its start: 960 rad/s^3.
        for (k, (p, acted)) in run_in(SMOOTH, (1..2000).map(wave)).into_iter().enumerate() {
            assert_eq!((p, acted), (wave(k as i32 + 1), 0), "step {k}");
        }
    }

    #[test]
    fn with_limited_jerk_a_jump_is_met_without_overshoot_and_tracking_resumes() {
        for jerk in [400.0, 4_000.0, 100_000.0] {
            let limit = JointEnvelope { jerk, ..LIMIT };
            let outputs = run_in(limit, std::iter::repeat_n(0.8, 400));
            let positions: Vec<f64> = outputs.iter().map(|o| o.0).collect();
            assert_inside_of(limit, &positions);
            let highest = positions.iter().copied().fold(0.0, f64::max);
            assert!(highest <= 0.8 + 1e-5, "jerk {jerk}: overshoot to {highest}");
            let settled = positions.iter().position(|p| (p - 0.8).abs() < 1e-4);
            assert!(
                settled.is_some_and(|k| k < 150),
                "jerk {jerk}: settled after {settled:?} steps"
            );
            assert_eq!(outputs[399].1, 0, "jerk {jerk}: still acting after arrival");
            println!("jerk {jerk}: settled after {settled:?} steps, highest {highest}");
        }
    }

    #[test]
    fn a_slower_pace_is_reached_by_braking_and_a_faster_one_by_speeding_up() {
        for limit in [LIMIT, SMOOTH] {
            let wide = JointEnvelope {
                lower: -100.0,
                upper: 100.0,
                ..limit
            };
            let mut envelope = Envelope::new(vec![wide], DT);
            envelope.start(&[0.0]);
            let (mut out, mut outputs) = ([0.0], Vec::new());
            for k in 0..900 {
                envelope.set_pace(if (300..600).contains(&k) { 0.25 } else { 1.0 });
                envelope.pass(&[90.0], &mut out);
                outputs.push(out[0]);
            }
            let speed = |k: usize| (outputs[k] - outputs[k - 1]) / DT;
            for (k, expected) in [(290, 4.0), (400, 1.0), (590, 1.0), (700, 4.0)] {
                let found = speed(k);
                assert!(
                    (found - expected).abs() < 0.02,
                    "jerk {}: {found} rad/s at step {k}, expected {expected}",
                    limit.jerk
                );
            }
            let (mut last, mut last_a) = (outputs[0] / DT, 0.0);
            for k in 1..outputs.len() {
                let a = (speed(k) - last) / DT;
                assert!(a.abs() <= 80.0 + 1e-3, "step {k}: {a} rad/s^2");
                let j = (a - last_a) / DT;
                assert!(
                    k == 1 || j.abs() <= limit.jerk * 1.001,
                    "step {k}: {j} rad/s^3"
                );
                (last, last_a) = (speed(k), a);
            }
        }
    }

    #[test]
    fn a_million_random_steps_stay_inside() {
        // Targets as a broken animator might send them: walks, jumps, limits, nothing, the absurd.
        for (limit, seed, steps) in [(LIMIT, 1, 600_000), (SMOOTH, 2, 400_000)] {
            let mut chance = crate::base::random::SplitMix::new(seed);
            let mut envelope = Envelope::new(vec![limit], DT);
            envelope.start(&[0.0]);
            let (mut out, mut target, mut left) = ([0.0], 0.0, 0);
            let (mut p, mut v, mut a) = (0.0, 0.0, 0.0);
            let mut kind = 0;
            for k in 0..steps {
                if left == 0 {
                    left = 1 + chance.bits() % 40;
                    kind = chance.bits() % 7;
                }
                left -= 1;
                target = match kind {
                    0 => f64::NAN,
                    1 => limit.upper,
                    2 => limit.lower - 1.0,
                    3 => 4.0 * chance.unit() - 2.0,
                    4 => [f64::INFINITY, -1e300, 1e-310][k % 3],
                    5 if f64::is_finite(target) => target + 0.01 * chance.normal(),
                    _ => 0.8 * (k as f64 * 0.07).sin(),
                };
                if chance.bits() % 512 == 0 {
                    envelope.set_pace(chance.unit());
                }
                envelope.pass(&[target], &mut out);
                let velocity = (out[0] - p) / DT;
                let acceleration = (velocity - v) / DT;
                let jerk = (acceleration - a) / DT;
                let inside = (limit.lower..=limit.upper).contains(&out[0])
                    && velocity.abs() <= limit.velocity + 1e-6
                    && acceleration.abs() <= limit.acceleration + 1e-3
                    && jerk.abs() <= limit.jerk + 1.0;
                assert!(
                    inside,
                    "seed {seed}, step {k}: position {} rad, {velocity} rad/s, {acceleration} rad/s^2, {jerk} rad/s^3",
                    out[0]
                );
                (p, v, a) = (out[0], velocity, acceleration);
            }
        }
    }

    #[test]
    fn not_a_number_brakes_and_holds() {
        let outputs = run([0.01, 0.02, 0.03].into_iter().chain([f64::NAN; 50]));
        let positions: Vec<f64> = outputs.iter().map(|o| o.0).collect();
        assert_inside(&positions);
        assert_eq!(
            positions[40], positions[52],
            "still moving after 200 ms without a target"
        );
        assert_eq!(outputs[10].1, 1);
    }

    #[test]
    fn a_gentle_target_passes_untouched() {
        let wave = |k: i32| 0.3 * (1.0 - (f64::from(k) * DT * 4.0).cos());
        for (k, (p, acted)) in run((1..2000).map(wave)).into_iter().enumerate() {
            assert_eq!((p, acted), (wave(k as i32 + 1), 0), "step {k}");
        }
    }

    #[test]
    fn a_jump_is_met_without_overshoot_and_tracking_resumes() {
        let outputs = run(std::iter::repeat_n(0.8, 200));
        let highest = outputs.iter().map(|o| o.0).fold(0.0, f64::max);
        let positions: Vec<f64> = outputs.iter().map(|o| o.0).collect();
        assert_inside(&positions);
        assert!(highest <= 0.8 + 1e-6, "overshoot to {highest}");
        let settled = outputs.iter().position(|o| (o.0 - 0.8).abs() < 1e-5);
        // Triangle of 4 rad/s and 80 rad/s^2: 0.25 s; braking at 80 % of it.
        assert!(
            settled.is_some_and(|k| k < 60),
            "settled after {settled:?} steps"
        );
        assert_eq!(outputs[199].1, 0, "still marked as acting after arrival");
    }

    #[test]
    fn from_outside_the_limits_only_inwards() {
        let mut envelope = Envelope::new(vec![LIMIT], DT);
        envelope.start(&[1.2]);
        let mut out = [0.0];
        let mut last = 1.2;
        for target in std::iter::repeat_n(1.5, 20).chain(std::iter::repeat_n(0.5, 200)) {
            envelope.pass(&[target], &mut out);
            assert!(
                out[0] <= last + 1e-12,
                "moved outwards from {last} to {}",
                out[0]
            );
            last = out[0];
        }
        assert!((last - 0.5).abs() < 1e-6, "ended at {last}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(256))]
        #[test]
        fn no_target_sequence_breaks_a_limit(
            targets in prop::collection::vec(
                prop_oneof![
                    -3.0..3.0f64,
                    Just(f64::NAN),
                    Just(f64::INFINITY),
                    Just(-1e300),
                    Just(0.9),
                    Just(-0.7),
                ],
                1..400,
            ),
            repeat in 1usize..20,
        ) {
            let held: Vec<f64> = targets
                .into_iter()
                .flat_map(|t| std::iter::repeat_n(t, repeat))
                .collect();
            for limit in [LIMIT, SMOOTH, JointEnvelope { jerk: 300.0, ..LIMIT }] {
                let outputs = run_in(limit, held.iter().copied());
                let outputs: Vec<f64> = outputs.into_iter().map(|o| o.0).collect();
                assert_inside_of(limit, &outputs);
            }
        }
    }
}
