//! No sequence of targets breaks a limit; what can be reached passes untouched.

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
            if chance.bits().is_multiple_of(512) {
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
