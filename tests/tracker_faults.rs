//! What trackers get wrong: jumping points, missing points, exchanged hands, rates that change.

mod gesture_support;

use gesture_support::{Path, Random, header, pose, sample, times, wave_set};
use handwave::base::wrap_pi;
use handwave::gesture::{
    CyclicMarks, FrontEnd, FrontEndOptions, GestureEstimate, GestureSet, TrackingCounts,
    define_cyclic,
};
use handwave::pose::{PoseSample, Recording};
use proptest::prelude::*;
use std::f64::consts::TAU;

fn front(set: &GestureSet, trust_tracker: bool) -> FrontEnd {
    let options = FrontEndOptions {
        trust_tracker,
        ..FrontEndOptions::default()
    };
    FrontEnd::new(set, &header(), options).expect("points match")
}

/// Mean amplitude error and largest phase error against a clean run, in share and cycles, from 3 s on.
#[derive(Debug)]
struct Off {
    mean_amplitude: f64,
    largest_amplitude: f64,
    phase_cycles: f64,
    counts: TrackingCounts,
}

/// Plays `stream` clean and spoilt by `spoil` and compares; samples that are `None` are lost.
fn compare(
    set: &GestureSet,
    stream: &[PoseSample],
    trust_tracker: bool,
    mut spoil: impl FnMut(&PoseSample) -> Option<PoseSample>,
) -> Off {
    let (mut clean, mut spoilt) = (front(set, true), front(set, trust_tracker));
    let (mut sums, mut largest, mut turn) = ([0.0; 2], 0.0_f64, 0.0_f64);
    for good in stream {
        clean.push(good).expect("good sample");
        if let Some(bad) = spoil(good) {
            // A sample of which too little is left is lost; the wave is carried over it.
            spoilt.push(&bad).ok();
        }
        if good.t > 3.0 {
            let (truth, read) = (clean.estimates()[0], spoilt.predict(0, good.t));
            sums[0] += truth.amplitude;
            sums[1] += read.amplitude;
            largest = largest.max((read.amplitude / truth.amplitude - 1.0).abs());
            turn = turn.max(wrap_pi(read.phase_rad - truth.phase_rad).abs() / TAU);
        }
    }
    Off {
        mean_amplitude: (sums[1] / sums[0] - 1.0).abs(),
        largest_amplitude: largest,
        phase_cycles: turn,
        counts: spoilt.tracking(),
    }
}

/// A gesture of 100 mm: the figure's hand at half its size.
fn small_wave(path: Path, hz: f64, rate_hz: f64, until: f64) -> Vec<PoseSample> {
    let stamps = times(rate_hz, until, 0.3, 7).into_iter();
    stamps
        .map(|t| sample(t, &pose(path, 0.5, TAU * hz * t)))
        .collect()
}

/// Every point of a sample jumps with `chance`, 0.1 to 1 m in any direction.
fn with_spikes(good: &PoseSample, chance: f64, random: &mut Random) -> (PoseSample, u64) {
    let mut bad = good.clone();
    let mut spikes = 0;
    for place in bad.points.iter_mut().flatten() {
        if random.unit() < chance {
            let way = [random.normal(), random.normal(), random.normal()];
            let length = way.iter().map(|v| v * v).sum::<f64>().sqrt();
            let size = 0.1 + 0.9 * random.unit();
            for axis in 0..3 {
                place[axis] += size * way[axis] / length;
            }
            spikes += 1;
        }
    }
    (bad, spikes)
}

#[test]
fn spikes_change_nothing_that_matters_and_without_the_filter_they_do() {
    let mut set = wave_set(Path::Loop);
    // Half the figure's reach is the whole gesture: 100 mm.
    for frame in &mut set.gestures[0].frames {
        let still = pose(Path::Loop, 0.0, 0.0);
        for (place, still) in frame.iter_mut().zip(still) {
            for axis in 0..3 {
                place[axis] = still[axis] + 0.5 * (place[axis] - still[axis]);
            }
        }
    }
    for (rate_hz, hz) in [(60.0, 1.0), (108.0, 1.0), (108.0, 3.0), (30.0, 1.0)] {
        for chance in [0.01, 0.05] {
            let stream = small_wave(Path::Loop, hz, rate_hz, 10.0);
            let mut measured = Vec::new();
            for trust in [false, true] {
                let mut random = Random(41);
                let mut spikes = 0;
                let off = compare(&set, &stream, trust, |good| {
                    let (bad, count) = with_spikes(good, chance, &mut random);
                    spikes += count;
                    Some(bad)
                });
                println!(
                    "{hz} Hz at {rate_hz} Hz, {spikes} spikes, filter {}: {off:.4?}",
                    !trust
                );
                measured.push((off, spikes));
            }
            let ((with, spikes), (without, _)) = (&measured[0], &measured[1]);
            assert!(
                with.largest_amplitude < 0.05
                    && with.mean_amplitude < 0.02
                    && with.phase_cycles < 0.05,
                "{hz} Hz at {rate_hz} Hz: {with:.4?}"
            );
            assert!(
                with.counts.outliers as f64 > 0.8 * *spikes as f64,
                "{} of {spikes} spikes rejected",
                with.counts.outliers
            );
            if chance == 0.05 {
                assert!(
                    without.largest_amplitude > 0.05,
                    "the spikes harm nobody: {without:.4?}"
                );
            }
        }
    }
}

/// Bits of all estimates of a stream.
fn bits(
    set: &GestureSet,
    stream: &[PoseSample],
    trust_tracker: bool,
) -> (Vec<u64>, TrackingCounts) {
    let mut front = front(set, trust_tracker);
    let mut bits = Vec::new();
    for sample in stream {
        front.push(sample).expect("good sample");
        let read = |e: &GestureEstimate| [e.amplitude, e.frequency_hz, e.phase_rad, e.quality];
        bits.extend(front.estimates().iter().flat_map(read).map(f64::to_bits));
    }
    (bits, front.tracking())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn clean_waves_pass_bit_for_bit(
        hz in 0.1..6.0f64,
        rate_hz in 20.0..120.0f64,
        jitter in 0.0..0.45f64,
        size in 0.05..1.5f64,
        start in 0.0..6.3f64,
        line in any::<bool>(),
        seed in 1u64..1000,
    ) {
        let path = if line { Path::Line } else { Path::Loop };
        let set = wave_set(path);
        let stamps = times(rate_hz, 3.0, jitter, seed).into_iter();
        let stream: Vec<PoseSample> = stamps
            .map(|t| sample(t, &pose(path, size, start + TAU * hz * t)))
            .collect();
        let (filtered, counts) = bits(&set, &stream, false);
        let (plain, _) = bits(&set, &stream, true);
        prop_assert_eq!(counts, TrackingCounts::default());
        prop_assert!(filtered == plain, "estimates differ");
    }
}

#[test]
fn recordings_of_real_hands_are_left_alone() {
    let configs = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let set = GestureSet::load(&configs.join("gestures/hand.toml")).expect("bundled");
    for name in ["waiting.csv", "splay.csv", "drum_and_splay.jsonl"] {
        let file = configs.join("performances").join(name);
        let recording = Recording::read(&file).expect("bundled").0;
        let options = FrontEndOptions::default();
        let mut front = FrontEnd::new(&set, &recording.header, options).expect("match");
        for sample in &recording.samples {
            front.push(sample).expect("good sample");
        }
        assert_eq!(front.tracking(), TrackingCounts::default(), "{name}");
    }
}

#[test]
fn a_step_is_an_outlier_for_two_samples_at_most() {
    let set = wave_set(Path::Loop);
    for rate_hz in [20.0, 60.0, 120.0] {
        let mut front = front(&set, false);
        let mut rejected = Vec::new();
        for t in times(rate_hz, 4.0, 0.2, 3) {
            let mut places = pose(Path::Loop, 0.0, 0.0);
            if t > 2.0 {
                places[3][0] -= 0.6;
            }
            front.push(&sample(t, &places)).expect("good sample");
            if front.tracking().outliers as usize > rejected.len() {
                rejected.push(t);
            }
        }
        println!("step at 2 s, {rate_hz} Hz: rejected at {rejected:.3?} s");
        assert!(rejected.len() <= 2, "rejected at {rejected:.3?} s");
        assert!(rejected.iter().all(|t| *t < 2.12), "{rejected:.3?}");
    }
}

#[test]
fn a_missing_hand_is_where_the_elbow_says() {
    for path in [Path::Loop, Path::Line] {
        let set = wave_set(path);
        let stamps = times(60.0, 10.0, 0.3, 9).into_iter();
        let stream: Vec<PoseSample> = stamps
            .map(|t| sample(t, &pose(path, 1.0, TAU * 1.2 * t)))
            .collect();
        for (name, hole) in [("30 % at random", false), ("for 1 s", true)] {
            let mut random = Random(5);
            let off = compare(&set, &stream, false, |good| {
                let mut bad = good.clone();
                let missing = if hole {
                    (6.0..7.0).contains(&good.t)
                } else {
                    random.unit() < 0.3
                };
                if missing {
                    bad.points[5] = None;
                }
                Some(bad)
            });
            println!("{path:?}, right hand missing {name}: {off:.4?}");
            assert!(off.counts.filled > 50, "nothing was missing: {off:?}");
            assert!(
                off.largest_amplitude < 0.1 && off.phase_cycles < 0.1,
                "{path:?}, {name}: {off:.4?}"
            );
        }
    }
}

#[test]
fn a_point_of_a_real_hand_may_be_hidden() {
    let configs = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let set = GestureSet::load(&configs.join("gestures/hand.toml")).expect("bundled");
    let file = configs.join("performances/drum_and_splay.jsonl");
    let performance = Recording::read(&file).expect("bundled").0;
    // Frozen where it was, the ring finger, which carries most of the drumming, costs nine tenths of
    // the amplitude when it is hidden for a period.
    for finger in 0..performance.header.points.len() {
        for (name, hole) in [("30 % at random", false), ("for 1 s", true)] {
            let (mut clean, mut spoilt) = [(); 2]
                .map(|()| {
                    let options = FrontEndOptions::default();
                    FrontEnd::new(&set, &performance.header, options).expect("match")
                })
                .into();
            let mut random = Random(6);
            let (mut largest, mut turn) = (0.0_f64, 0.0_f64);
            let (mut off_m, mut off_rad) = (0.0_f64, 0.0_f64);
            for good in performance
                .samples
                .iter()
                .filter(|s| (11.5..19.5).contains(&s.t))
            {
                let mut bad = good.clone();
                if if hole {
                    (16.0..17.0).contains(&good.t)
                } else {
                    random.unit() < 0.3
                } {
                    bad.points[finger] = None;
                }
                clean.push(good).expect("good sample");
                spoilt.push(&bad).expect("enough points");
                let (here, there) = (clean.global_motion(), spoilt.global_motion());
                off_m = off_m.max((here.height_m - there.height_m).abs());
                off_rad = off_rad.max(wrap_pi(here.yaw_rad - there.yaw_rad).abs());
                if good.t > 14.5 {
                    let (truth, read) = (clean.estimates()[0], spoilt.estimates()[0]);
                    largest = largest.max((read.amplitude / truth.amplitude - 1.0).abs());
                    turn = turn.max(wrap_pi(read.phase_rad - truth.phase_rad).abs() / TAU);
                }
            }
            let hidden = &performance.header.points[finger];
            println!(
                "{hidden} hidden {name}: amplitude off {largest:.3}, phase {turn:.3} cycles, height {off_m:.4} m, yaw {off_rad:.3} rad"
            );
            // Nothing but the palm tells where the hand as a whole is: without it for long, what
            // the fingers do together is lost.
            let most = match (hole, finger) {
                (false, _) => [0.04, 0.02, 0.02, 0.1],
                (true, 0) => [0.3, 0.1, 0.02, 0.2],
                (true, _) => [0.12, 0.1, 0.02, 0.2],
            };
            for (off, most) in [largest, turn, off_m, off_rad].into_iter().zip(most) {
                assert!(off < most, "{hidden} hidden {name}: {off:.3}, bound {most}");
            }
        }
    }
}

#[test]
fn confidence_says_how_far_a_point_is_believed() {
    let set = wave_set(Path::Loop);
    let mut middle = pose(Path::Loop, 0.0, 0.0);
    let mut read = Vec::new();
    for confidence in [0.05, 0.1, 0.4, 0.7, 1.0] {
        let mut front = front(&set, true);
        for t in times(60.0, 4.0, 0.0, 1) {
            // The hand alone moves: the elbow contradicts it.
            middle[5] = pose(Path::Loop, 1.0, TAU * t)[5];
            let mut shown = sample(t, &middle);
            shown.confidence = vec![1.0; 6];
            shown.confidence[5] = confidence;
            front.push(&shown).expect("good sample");
        }
        read.push(front.estimates()[0].amplitude);
    }
    println!("amplitude by confidence 0.05, 0.1, 0.4, 0.7, 1: {read:.3?}");
    assert!(read[0] < 0.05, "not seen, and yet {read:.3?}");
    assert!(read.windows(2).all(|pair| pair[0] < pair[1]), "{read:.3?}");
    assert!(read[4] > 0.7, "{read:.3?}");
}

/// Two hands that circle, each in its own time, as a set with one gesture for the right one.
fn hands(t: f64, right: f64, left: f64) -> Vec<[f64; 3]> {
    let mut places = pose(Path::Loop, right, TAU * t);
    places[3][1] += 0.15 * left * (TAU * 0.7 * t).cos();
    places[3][2] += 0.15 * left * (TAU * 0.7 * t).sin();
    places
}

fn two_hand_set() -> (GestureSet, handwave::pose::PoseHeader) {
    let mut header = header();
    header.points[4] = "elbow".into();
    let mut set = GestureSet::new(&header, Vec::new());
    for (name, right, left) in [("right", 1.0, 0.0), ("left", 0.0, 1.0)] {
        let recording = Recording {
            header: header.clone(),
            samples: times(60.0, 5.0, 0.0, 1)
                .into_iter()
                .map(|t| sample(t, &hands(t, right, left)))
                .collect(),
        };
        let marks = CyclicMarks {
            start_s: 0.1,
            end_s: None,
        };
        let found = define_cyclic(&set, &recording, name, "test", marks).expect("periodic");
        set.put(found.gesture);
    }
    (set, header)
}

#[test]
fn exchanged_hands_are_put_back() {
    let (set, header) = two_hand_set();
    let options = FrontEndOptions::default();
    for (name, chance, stay) in [("single samples", 0.03, 1.0), ("stretches", 0.01, 0.95)] {
        let mut fronts = [false, false, true].map(|trust_tracker| {
            FrontEnd::new(
                &set,
                &header,
                FrontEndOptions {
                    trust_tracker,
                    ..options
                },
            )
            .expect("match")
        });
        let mut random = Random(77);
        let (mut swapped, mut truly, mut worst) = (false, 0, [0.0_f64; 2]);
        for t in times(60.0, 12.0, 0.3, 2) {
            let good = sample(t, &hands(t, 1.0, 1.0));
            let mut bad = good.clone();
            swapped = if swapped {
                stay < 1.0 && random.unit() < stay
            } else {
                random.unit() < chance
            };
            if t > 1.0 && swapped {
                bad.points.swap(3, 5);
                truly += 1;
            }
            let [clean, mended, trusting] = &mut fronts;
            clean.push(&good).expect("good sample");
            mended.push(&bad).expect("good sample");
            trusting.push(&bad).expect("good sample");
            if t > 3.0 {
                for (worst, front) in worst.iter_mut().zip([mended, trusting]) {
                    for (read, truth) in front.estimates().iter().zip(clean.estimates()) {
                        *worst = worst.max((read.amplitude - truth.amplitude).abs());
                    }
                }
            }
        }
        let counts = fronts[1].tracking();
        println!(
            "{name}: {truly} samples exchanged, {counts:?}, amplitude off {worst:.4?} (mended, not)"
        );
        assert!(truly > 20, "only {truly} samples were exchanged");
        assert_eq!(counts.swapped, truly, "{name}");
        assert_eq!(worst[0], 0.0, "{name}: mended is not clean");
        assert!(
            worst[1] > 0.2,
            "{name}: exchanged hands harm nobody: {worst:.3?}"
        );
    }
}

#[test]
fn hands_that_cross_are_left_alone() {
    let (set, header) = two_hand_set();
    for (rate_hz, hz) in [(20.0, 0.5), (30.0, 1.0), (60.0, 2.0), (120.0, 3.0)] {
        for closest in [0.0, 0.01, 0.05] {
            let mut front =
                FrontEnd::new(&set, &header, FrontEndOptions::default()).expect("match");
            let mut random = Random(19);
            for t in times(rate_hz, 8.0, 0.3, 4) {
                let mut places = pose(Path::Loop, 0.0, 0.0);
                // Side to side in opposite directions: they pass one another twice a cycle.
                let across = 0.3 * (TAU * hz * t).cos();
                places[3] = [-across, 1.2, 0.4];
                places[5] = [across, 1.2 + closest, 0.4];
                for place in places.iter_mut().flatten() {
                    *place += 0.001 * random.normal();
                }
                front.push(&sample(t, &places)).expect("good sample");
            }
            let counts = front.tracking();
            println!("{hz} Hz at {rate_hz} Hz, {closest} m apart: {counts:?}");
            assert_eq!(
                counts.swapped, 0,
                "{hz} Hz at {rate_hz} Hz, {closest} m apart"
            );
        }
    }
}

#[test]
fn sides_exchanged_for_good_are_believed() {
    let (set, header) = two_hand_set();
    let mut front = FrontEnd::new(&set, &header, FrontEndOptions::default()).expect("match");
    let mut last_undone_s = 0.0;
    let mut undone = 0;
    for t in times(60.0, 10.0, 0.3, 4) {
        let mut shown = sample(t, &hands(t, 1.0, 1.0));
        if t > 4.0 {
            shown.points.swap(3, 5);
        }
        front.push(&shown).expect("good sample");
        if front.tracking().swapped > undone {
            undone = front.tracking().swapped;
            last_undone_s = t;
        }
    }
    println!("exchanged from 4 s on: undone until {last_undone_s:.2} s");
    assert!(
        (5.9..6.2).contains(&last_undone_s),
        "until {last_undone_s:.2} s"
    );
}

#[test]
fn a_rate_that_changes_in_mid_gesture_is_not_seen() {
    for path in [Path::Loop, Path::Line] {
        let set = wave_set(path);
        let mut front = front(&set, false);
        let mut stamps = times(120.0, 5.0, 0.2, 1);
        for (rate_hz, from) in [(20.0, 5.0), (60.0, 10.0)] {
            stamps.extend(
                times(rate_hz, 4.99, 0.2, 2)
                    .iter()
                    .map(|t| from + 0.004 + t),
            );
        }
        let (mut worst, mut least) = (0.0_f64, f64::INFINITY);
        for t in stamps {
            front
                .push(&sample(t, &pose(path, 1.0, TAU * 1.5 * t)))
                .expect("good sample");
            let amplitude = front.estimates()[0].amplitude;
            if t > 4.0 {
                least = least.min(amplitude);
                if !(5.0..6.0).contains(&t) && !(10.0..11.0).contains(&t) {
                    worst = worst.max((amplitude - 1.0).abs());
                }
            }
        }
        println!("{path:?}: 120, 20, 60 Hz: off by {worst:.4} 1 s later, never below {least:.3}");
        assert!(worst < 0.05, "{path:?}: amplitude off by {worst:.4}");
        assert!(least > 0.8, "{path:?}: amplitude fell to {least:.3}");
        assert_eq!(front.tracking(), TrackingCounts::default());
    }
}
