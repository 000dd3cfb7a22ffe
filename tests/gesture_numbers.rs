//! How exact the estimates are: pure waves, noise, held poses, steps. Printed with `--nocapture`.

mod gesture_support;

use gesture_support::{Path, Random, header, pose, sample, times, wave_set};
use handwave::base::wrap_pi;
use handwave::gesture::{Estimator, GestureOptions, PlanePoint};
use handwave::gesture::{FrontEnd, FrontEndOptions, GaborEstimator, GestureSet};
use std::f64::consts::{PI, TAU};

fn front(set: &GestureSet) -> FrontEnd {
    FrontEnd::new(set, &header(), FrontEndOptions::default()).expect("points match")
}

/// Worst steady errors over the last two seconds: amplitude and frequency relative, phase in
/// degrees against the best constant offset (the place of phase zero is the gesture's own).
fn steady(set: &GestureSet, path: Path, size: f64, hz: f64, rate: f64, seed: u64) -> [f64; 3] {
    let mut front = front(set);
    let until = 4.0 + 5.0 / hz.abs().min(1.0);
    let (mut a, mut f) = (0.0_f64, 0.0_f64);
    let mut offsets = Vec::new();
    for t in times(rate, until, 0.4, seed) {
        let phase = TAU * hz * t + seed as f64;
        front
            .push(&sample(t, &pose(path, size, phase)))
            .expect("good sample");
        let estimate = front.estimates()[0];
        if t > until - 2.0 {
            a = a.max((estimate.amplitude / size - 1.0).abs());
            f = f.max((estimate.frequency_hz / hz - 1.0).abs());
            offsets.push(wrap_pi(estimate.phase_rad - phase));
        }
    }
    let first = offsets[0];
    let turns: Vec<f64> = offsets.iter().map(|o| wrap_pi(o - first)).collect();
    let (low, high) = turns
        .iter()
        .fold((0.0_f64, 0.0_f64), |(l, h), o| (l.min(*o), h.max(*o)));
    [a, f, (0.5 * (high - low)).to_degrees()]
}

fn worst(path: Path, hertz: &[f64], rates: &[f64]) -> [f64; 3] {
    let set = wave_set(path);
    let mut worst = [0.0_f64; 3];
    for (index, hz) in hertz.iter().enumerate() {
        for rate in rates {
            for size in [0.1, 1.0, 1.5] {
                let errors = steady(&set, path, size, *hz, *rate, index as u64 + 1);
                for (worst, error) in worst.iter_mut().zip(errors) {
                    *worst = worst.max(error);
                }
                println!("{path:?} {hz} Hz at {rate} Hz size {size}: {errors:.4?}");
            }
        }
    }
    worst
}

#[test]
fn a_loop_is_measured_exactly_in_both_senses() {
    let [a, f, phase] = worst(Path::Loop, &[0.25, 1.0, 2.3, 5.5, -1.5], &[30.0, 60.0]);
    println!("loop: amplitude {a:.4}, frequency {f:.4}, phase {phase:.2} deg");
    assert!(a < 0.02, "amplitude off by {a:.4} of itself");
    assert!(f < 0.02, "frequency off by {f:.4} of itself");
    assert!(phase < 5.0, "phase off by {phase:.2} degrees");
}

#[test]
fn a_line_is_measured_as_well_as_a_loop() {
    let [a, f, phase] = worst(Path::Line, &[0.25, 0.6, 1.0, 2.3, 5.5], &[30.0, 60.0]);
    println!("line: amplitude {a:.4}, frequency {f:.4}, phase {phase:.2} deg");
    assert!(a < 0.02, "amplitude off by {a:.4} of itself");
    assert!(f < 0.02, "frequency off by {f:.4} of itself");
    assert!(phase < 5.0, "phase off by {phase:.2} degrees");
}

#[test]
fn twenty_samples_a_second_still_carry_slow_waves() {
    let [a, f, phase] = worst(Path::Loop, &[0.25, 1.0, 2.3], &[20.0]);
    println!("loop at 20 Hz: amplitude {a:.4}, frequency {f:.4}, phase {phase:.2} deg");
    assert!(
        a < 0.02 && f < 0.02 && phase < 5.0,
        "{a:.4} {f:.4} {phase:.2}"
    );
}

#[test]
fn a_held_pose_is_silent() {
    let set = wave_set(Path::Loop);
    let mut worst = 0.0_f64;
    for size in [0.0, 0.3, 1.0] {
        for phase in [0.0, 0.5 * PI, 2.0] {
            let mut front = front(&set);
            for t in times(60.0, 8.0, 0.3, 3) {
                front
                    .push(&sample(t, &pose(Path::Loop, size, phase)))
                    .expect("good sample");
                worst = worst.max(front.estimates()[0].amplitude);
            }
        }
    }
    println!("held pose: amplitude {worst:.4}");
    assert!(worst < 1e-6, "a held pose has amplitude {worst:.4}");
}

/// Share of the time the amplitude is above `threshold` when only noise comes in.
fn noise_above(threshold: f64, rate: f64) -> f64 {
    let mut estimator = GaborEstimator::new(&GestureOptions::default());
    let mut random = Random(77);
    let (mut above, mut all) = (0, 0);
    for k in 0..(200.0 * rate) as usize {
        let z = [0.3 * random.normal(), 0.3 * random.normal()];
        let point = PlanePoint {
            z,
            ..PlanePoint::default()
        };
        estimator.push(k as f64 / rate, point);
        if k as f64 > 6.0 * rate {
            all += 1;
            above += usize::from(estimator.estimate().amplitude > threshold);
        }
    }
    above as f64 / all as f64
}

#[test]
fn noise_alone_hardly_ever_counts_as_a_gesture_to_the_thesis_s_bank() {
    for (rate, rise, abort) in [(30.0, 0.06, 0.6), (60.0, 0.001, 0.06), (120.0, 1e-6, 1e-3)] {
        let (above_rise, above_abort) = (noise_above(0.2, rate), noise_above(0.1, rate));
        println!("noise 0.3 at {rate} Hz: above 0.2 {above_rise:.4}, above 0.1 {above_abort:.4}");
        assert!(
            above_rise <= rise,
            "{rate} Hz: above 0.2 in {above_rise:.4} of the time"
        );
        assert!(
            above_abort <= abort,
            "{rate} Hz: above 0.1 in {above_abort:.4} of the time"
        );
    }
}

/// Last time after the step at which the estimate is more than 10 % off.
fn settles(step: impl Fn(f64) -> (f64, f64), value: impl Fn(&FrontEnd) -> f64, target: f64) -> f64 {
    let set = wave_set(Path::Loop);
    let mut front = front(&set);
    let (mut phase, mut last, mut settled) = (0.0, 0.0, 0.0);
    for t in times(60.0, 14.0, 0.0, 1) {
        let (size, hz) = step(t - 8.0);
        phase += TAU * hz * (t - last);
        last = t;
        front
            .push(&sample(t, &pose(Path::Loop, size, phase)))
            .expect("good sample");
        if t >= 8.0 && (value(&front) / target - 1.0).abs() > 0.1 {
            settled = t - 8.0;
        }
    }
    settled
}

#[test]
fn steps_settle_within_half_a_period() {
    let f = settles(
        |t| (1.0, if t < 0.0 { 1.0 } else { 2.0 }),
        |front| front.estimates()[0].frequency_hz,
        2.0,
    );
    let a = settles(
        |t| (if t < 0.0 { 1.0 } else { 0.5 }, 1.0),
        |front| front.estimates()[0].amplitude,
        0.5,
    );
    println!("settling, smoothed: frequency 1 -> 2 Hz {f:.2} s, amplitude 1 -> 0.5 {a:.2} s");
    assert!(f < 0.25, "frequency settles in {f:.2} s");
    assert!(a < 0.5, "amplitude settles in {a:.2} s");
}

#[test]
fn a_steady_phase_never_runs_back_and_never_jumps() {
    let set = wave_set(Path::Loop);
    let mut random = Random(5);
    let mut front = front(&set);
    let (mut last, mut last_t) = (0.0, 0.0);
    let (mut back, mut jump) = (f64::INFINITY, 0.0_f64);
    for t in times(60.0, 15.0, 0.3, 9) {
        let mut places = pose(Path::Loop, 1.0, TAU * t);
        for value in places.as_flattened_mut() {
            *value += 0.01 * random.normal();
        }
        front.push(&sample(t, &places)).expect("good sample");
        let phase = front.estimates()[0].phase_rad;
        if t > 3.0 {
            let advance = wrap_pi(phase - last);
            back = back.min(advance);
            // Beyond the advance of the wave itself, per 33 ms.
            jump = jump.max((advance - TAU * (t - last_t)).abs() * (0.033 / (t - last_t)).min(2.5));
        }
        (last, last_t) = (phase, t);
    }
    println!("1 cm noise: least advance {back:.4} rad, largest jump {jump:.4} rad per 33 ms");
    assert!(back >= 0.0, "the phase ran back by {back:.4} rad");
    assert!(jump < 0.2, "the phase jumped by {jump:.4} rad per 33 ms");
}
