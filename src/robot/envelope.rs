//! The envelope: the last thing every target passes. Position, velocity and acceleration limits
//! that no input can break.

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
#[derive(Clone, Debug)]
pub struct Envelope {
    limits: Vec<JointEnvelope>,
    joints: Vec<JointMotion>,
    dt_s: f64,
}

#[derive(Copy, Clone, Debug, Default)]
struct JointMotion {
    position: f64,
    velocity: f64,
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
        }
    }

    /// The limits, in joint order.
    pub fn limits(&self) -> &[JointEnvelope] {
        &self.limits
    }

    /// Starts at rest from `present` (rad, joint order). A position outside the limits is kept;
    /// from there only movement towards the inside is let through.
    pub fn start(&mut self, present: &[f64]) {
        for (joint, position) in self.joints.iter_mut().zip(present) {
            *joint = JointMotion {
                position: *position,
                velocity: 0.0,
                last_target: *position,
                catching_up: false,
            };
        }
    }

    /// Takes on the state of `other`, an envelope of as many joints, without allocating.
    pub fn copy_from(&mut self, other: &Self) {
        self.joints.copy_from_slice(&other.joints);
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
            let acted = joint.step(limit, *target, dt);
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
    };

    fn run(targets: impl IntoIterator<Item = f64>) -> Vec<(f64, usize)> {
        let mut envelope = Envelope::new(vec![LIMIT], DT);
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
        let mut position = 0.0;
        let mut velocity = 0.0;
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
            position = *p;
            velocity = v;
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
            let held = targets.into_iter().flat_map(|t| std::iter::repeat_n(t, repeat));
            let outputs: Vec<f64> = run(held).into_iter().map(|o| o.0).collect();
            assert_inside(&outputs);
        }
    }
}
