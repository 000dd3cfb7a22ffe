//! The front end against bad input, gaps and company; gesture files; definitions that fail.

mod gesture_support;

use gesture_support::{Path as Way, Random, header, pose, sample, times, wave_set};
use handwave::base::wrap_pi;
use handwave::gesture::{
    CyclicMarks, DefineError, FrontEnd, FrontEndError, FrontEndOptions, GestureKind, GestureSet,
    NonCyclicMarks, define_cyclic, define_non_cyclic,
};
use handwave::pose::{PoseHeader, PoseSample, Recording, SampleFault};
use proptest::prelude::*;
use std::f64::consts::TAU;

fn front(set: &GestureSet) -> FrontEnd {
    FrontEnd::new(set, &header(), FrontEndOptions::default()).expect("points match")
}

fn recording(until: f64, place: impl Fn(f64) -> Vec<[f64; 3]>) -> Recording {
    Recording {
        header: header(),
        samples: times(60.0, until, 0.2, 4)
            .into_iter()
            .map(|t| sample(t, &place(t)))
            .collect(),
    }
}

#[test]
fn refused_samples_leave_no_trace() {
    let set = wave_set(Way::Loop);
    let (mut clean, mut dirty) = (front(&set), front(&set));
    for t in times(60.0, 4.0, 0.3, 2) {
        let good = sample(t, &pose(Way::Loop, 1.0, TAU * t));
        let mut nan = good.clone();
        nan.t += 1e-4;
        nan.points[5] = Some([f64::NAN, 0.0, 0.0]);
        let mut huge = nan.clone();
        huge.points[5] = Some([1e300, 0.0, 0.0]);
        let mut unseen = nan.clone();
        unseen.points = vec![None; 6];
        let mut short = good.clone();
        short.points.pop();
        let mut timeless = good.clone();
        timeless.t = f64::INFINITY;
        clean.push(&good).expect("good sample");
        dirty.push(&good).expect("good sample");
        assert_eq!(dirty.push(&nan), Err(SampleFault::NonFinite));
        assert_eq!(dirty.push(&huge), Err(SampleFault::NonFinite));
        assert_eq!(dirty.push(&timeless), Err(SampleFault::NonFinite));
        assert!(matches!(
            dirty.push(&good),
            Err(SampleFault::TimeBackwards { .. })
        ));
        assert!(matches!(
            dirty.push(&short),
            Err(SampleFault::PointCount { .. })
        ));
        assert!(matches!(
            dirty.push(&unseen),
            Err(SampleFault::TooFewPoints { .. })
        ));
        assert_eq!(clean.estimates(), dirty.estimates(), "at {t} s");
    }
    assert!(
        dirty.estimates()[0].amplitude > 0.9,
        "{:?}",
        dirty.estimates()
    );
    dirty.reset();
    assert_eq!(dirty.estimates()[0].amplitude, 0.0);
    assert_eq!(dirty.last_t(), None);
}

#[test]
fn points_are_matched_by_name_and_missing_ones_are_named() {
    let set = wave_set(Way::Loop);
    let mut stream = header();
    stream.points.reverse();
    stream.points.push("tail".into());
    stream.channels.push("mood".into());
    let mut turned = FrontEnd::new(&set, &stream, FrontEndOptions::default()).expect("all there");
    let mut straight = front(&set);
    for t in times(60.0, 3.0, 0.0, 1) {
        let good = sample(t, &pose(Way::Loop, 1.0, TAU * t));
        let mut other = good.clone();
        other.points.reverse();
        other.points.push(None);
        other.channels = vec![Some(0.25)];
        straight.push(&good).expect("good sample");
        turned.push(&other).expect("good sample");
    }
    assert_eq!(straight.estimates(), turned.estimates());
    let mood = turned.channel_index("mood").expect("the stream's channel");
    assert_eq!(turned.channel(mood), 0.25);
    assert!(turned.channel_index("yaw").is_some() && turned.channel_index("pitch").is_none());
    stream.points.retain(|name| name != "head");
    let error = FrontEnd::new(&set, &stream, FrontEndOptions::default()).expect_err("no head");
    assert!(matches!(error, FrontEndError::MissingPoints { .. }));
    assert!(error.to_string().contains("no point head"), "{error}");
}

#[test]
fn turning_and_walking_about_changes_channels_and_not_the_wave() {
    let set = wave_set(Way::Loop);
    let mut front = front(&set);
    for t in times(60.0, 6.0, 0.3, 8) {
        let (yaw, x, z) = (0.4 * (0.5 * t).sin(), 0.3 * t, -0.2 * t);
        let (sin, cos) = yaw.sin_cos();
        let moved: Vec<[f64; 3]> = pose(Way::Loop, 1.0, TAU * t)
            .into_iter()
            .map(|p| {
                [
                    p[0] * cos + p[2] * sin + x,
                    p[1],
                    p[2] * cos - p[0] * sin + z,
                ]
            })
            .collect();
        front.push(&sample(t, &moved)).expect("good sample");
        let channel = |name| front.channel(front.channel_index(name).expect("global channel"));
        assert!(
            (channel("yaw_rad") - yaw).abs() < 0.1,
            "yaw {} for {yaw}",
            channel("yaw_rad")
        );
    }
    let estimate = front.estimates()[0];
    assert!((estimate.amplitude - 1.0).abs() < 0.02, "{estimate:?}");
    assert!((estimate.frequency_hz - 1.0).abs() < 0.02, "{estimate:?}");
}

#[test]
fn dropouts_and_holes_do_not_stop_the_wave() {
    let set = wave_set(Way::Loop);
    let mut front = front(&set);
    let mut random = Random(11);
    let (mut least, mut turn) = (f64::INFINITY, 0.0_f64);
    let mut offset = None;
    for t in times(60.0, 12.0, 0.4, 6) {
        let lost = random.unit() < 0.1 || (8.0..8.3).contains(&t);
        if !lost {
            let mut good = sample(t, &pose(Way::Loop, 1.0, TAU * t));
            if random.unit() < 0.1 {
                good.points[1] = None;
            }
            front.push(&good).expect("good sample");
        }
        let ahead = front.predict(0, t);
        if t > 3.0 {
            least = least.min(ahead.amplitude);
            let now = wrap_pi(ahead.phase_rad - TAU * t);
            turn = turn.max(wrap_pi(now - *offset.get_or_insert(now)).abs());
        }
    }
    println!("10 % lost and a 300 ms hole: least amplitude {least:.3}, phase off by {turn:.3} rad");
    assert!(least > 0.9, "amplitude fell to {least:.3}");
    assert!(turn < 0.1, "phase off by {turn:.3} rad");
}

/// What a gesture reads when it is shown until 6 s, then nothing for `gap` seconds, then `after`
/// (of the time since the gap): time since the gap and amplitude.
fn after_gap(way: Way, gap: f64, after: impl Fn(f64) -> (f64, f64)) -> Vec<(f64, f64)> {
    let mut front = front(&wave_set(way));
    let mut read = Vec::new();
    for t in times(60.0, 6.0, 0.3, 5) {
        (front.push(&sample(t, &pose(way, 1.0, TAU * t)))).expect("good sample");
    }
    assert!(front.estimates()[0].amplitude > 0.9);
    for u in times(60.0, 6.0, 0.3, 6) {
        let (size, phase) = after(u);
        (front.push(&sample(6.0 + gap + u, &pose(way, size, phase)))).expect("good sample");
        read.push((u, front.estimates()[0].amplitude));
    }
    read
}

#[test]
fn a_pose_held_after_a_gap_is_no_gesture() {
    for way in [Way::Loop, Way::Line] {
        for gap in [0.6, 1.0, 2.0, 7.0] {
            let mut most = 0.0_f64;
            for k in 0..4 {
                let phase = TAU * (f64::from(k) + 0.1) / 4.0;
                let read = after_gap(way, gap, |_| (1.0, phase));
                most = read.iter().fold(most, |most, (_, a)| most.max(*a));
            }
            println!("{way:?}, {gap} s gap, then held: amplitude at most {most:.3}");
            assert!(most < 0.1, "{way:?}, gap {gap} s: amplitude {most:.3}");
        }
    }
}

#[test]
fn a_gesture_after_a_gap_is_found_as_soon_as_at_the_start() {
    let onset = |read: &[(f64, f64)]| {
        let found = read.iter().find(|(_, amplitude)| *amplitude > 0.8);
        found.map_or(f64::INFINITY, |(u, _)| *u)
    };
    for way in [Way::Loop, Way::Line] {
        let mut first = front(&wave_set(way));
        let mut read = Vec::new();
        for u in times(60.0, 6.0, 0.3, 6) {
            (first.push(&sample(u, &pose(way, 1.0, TAU * u)))).expect("good sample");
            read.push((u, first.estimates()[0].amplitude));
        }
        let usual = onset(&read);
        for gap in [0.6, 1.0, 2.0, 7.0] {
            let again = onset(&after_gap(way, gap, |u| (1.0, TAU * u)));
            println!("{way:?}: above 0.8 after {usual:.2} s, after a {gap} s gap {again:.2} s");
            assert!(again <= usual + 0.05, "{way:?}, gap {gap} s: {again:.2} s");
        }
    }
}

/// Right hand circles, left hand nods; both may move at once.
fn two(right: f64, left: f64, t: f64) -> Vec<[f64; 3]> {
    let mut places = pose(Way::Loop, right, TAU * t);
    places[3][1] += 0.2 * left * (TAU * 1.7 * t).cos();
    places[3][2] += 0.2 * left * (TAU * 1.7 * t).sin();
    // Both pull at the chest: a shared joint.
    places[1][1] += 0.03 * left * (TAU * 1.7 * t).cos() + 0.03 * right * (TAU * t).cos();
    places
}

#[test]
fn two_gestures_at_once_do_not_disturb_one_another() {
    let mut set = GestureSet::new(&header(), Vec::new());
    for (name, right, left) in [("right", 1.0, 0.0), ("left", 0.0, 1.0)] {
        let shown = recording(4.0, |t| two(right, left, t));
        let marks = CyclicMarks {
            start_s: 0.5,
            end_s: None,
        };
        let found = define_cyclic(&set, &shown, name, "test", marks).expect("periodic");
        set.put(found.gesture);
    }
    let mut worst = [0.0_f64; 2];
    for (case, (right, left)) in [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].into_iter().enumerate() {
        let mut front = front(&set);
        for t in times(60.0, 6.0, 0.3, 3) {
            front
                .push(&sample(t, &two(right, left, t)))
                .expect("good sample");
            if t > 4.0 {
                for (estimate, truth) in front.estimates().iter().zip([right, left]) {
                    let slot = &mut worst[usize::from(case == 2)];
                    *slot = slot.max((estimate.amplitude - truth).abs());
                }
            }
        }
    }
    println!(
        "interference: alone {:.4}, together {:.4}",
        worst[0], worst[1]
    );
    assert!(
        worst[0] < 0.1 && worst[1] < 0.1,
        "amplitude off by {worst:.4?}"
    );
}

#[test]
fn a_raised_arm_gives_a_progression() {
    let mut set = GestureSet::new(&header(), Vec::new());
    let shown = recording(2.0, |t| pose(Way::Line, 1.0, 0.5 * TAU * (1.0 + t)));
    let marks = NonCyclicMarks {
        rest_s: 0.0,
        extreme_s: 1.0,
    };
    let found = define_non_cyclic(&set, &shown, "raise", "test", marks).expect("the arm moves");
    set.put(found.gesture);
    let mut front = front(&set);
    for (t, phase, expected) in [(0.0, 0.5, 0.0), (1.0, 1.0, 1.0), (2.0, 0.75, 0.5)] {
        front
            .push(&sample(t, &pose(Way::Line, 1.0, TAU * phase)))
            .expect("good sample");
        let estimate = front.estimates()[0];
        assert_eq!(estimate.kind, GestureKind::NonCyclic);
        assert_eq!(estimate.frequency_hz, 0.0);
        assert!(
            (estimate.amplitude - expected).abs() < 0.06,
            "{estimate:?} for {expected}"
        );
    }
}

#[test]
fn a_progression_after_a_gap_lies_between_old_and_new() {
    let mut set = GestureSet::new(&header(), Vec::new());
    let shown = recording(2.0, |t| pose(Way::Line, 1.0, 0.5 * TAU * (1.0 + t)));
    let marks = NonCyclicMarks {
        rest_s: 0.0,
        extreme_s: 1.0,
    };
    let found = define_non_cyclic(&set, &shown, "raise", "test", marks).expect("the arm moves");
    set.put(found.gesture);
    for smoothing in [0.0, 0.05, 2.0] {
        set.options.progression_smoothing_s = smoothing;
        for gap in [0.1, 0.3, 0.6, 2.0, 7.0] {
            let mut front = front(&set);
            let mut show = |t: f64, phase: f64| {
                (front.push(&sample(t, &pose(Way::Line, 1.0, TAU * phase)))).expect("good sample");
                front.estimates()[0].amplitude
            };
            let old = (0..60).fold(0.0, |_, k| show(f64::from(k) / 60.0, 0.5));
            let mut last = old;
            for k in 0..600 {
                let now = show(1.0 + gap + f64::from(k) / 60.0, 0.75);
                assert!(
                    now >= last - 1e-9 && now < 0.56,
                    "gap {gap} s, smoothing {smoothing} s: {last:.3} to {now:.3}"
                );
                last = now;
            }
            assert!((last - 0.5).abs() < 0.06, "ends at {last:.3}");
        }
    }
}

#[test]
fn marks_that_make_no_gesture_are_explained() {
    let set = GestureSet::new(&header(), Vec::new());
    let cyclic = |recording: &Recording, start_s, end_s| {
        define_cyclic(&set, recording, "x", "test", CyclicMarks { start_s, end_s })
            .map(|found| found.gesture.duration_s)
    };
    let wave = recording(4.0, |t| pose(Way::Loop, 1.0, TAU * t));
    let still = recording(4.0, |_| pose(Way::Loop, 1.0, 0.0));
    let once = recording(4.0, |t| {
        pose(Way::Loop, 1.0, 1.5 * (1.5 * (t - 2.0)).tanh())
    });
    for marks in [
        (9.0, None),
        (-1.0, None),
        (f64::NAN, None),
        (1.0, Some(77.0)),
    ] {
        let error = cyclic(&wave, marks.0, marks.1).expect_err("a mark lies outside");
        assert!(
            matches!(error, DefineError::OutsideRecording { .. }),
            "{error}"
        );
    }
    assert!(matches!(
        cyclic(&still, 0.0, None),
        Err(DefineError::NoMotion { .. })
    ));
    let error = cyclic(&once, 0.0, None).expect_err("moves once");
    assert!(
        error.to_string().contains("a gesture without a period"),
        "{error}"
    );
    assert!(matches!(
        cyclic(&wave, 1.0, Some(0.5)),
        Err(DefineError::TooShort { .. })
    ));
    assert!(matches!(
        cyclic(&wave, 1.0, Some(1.05)),
        Err(DefineError::PeriodOutOfRange { .. })
    ));
    for start in [0.0, 0.3, 0.77, 1.5] {
        let period = cyclic(&wave, start, None).expect("periodic");
        assert!(
            (period - 1.0).abs() < 0.01,
            "period {period:.4} from {start}"
        );
        let line = recording(4.0, |t| pose(Way::Line, 1.0, TAU * t));
        let period = cyclic(&line, start, None).expect("periodic");
        assert!(
            (period - 1.0).abs() < 0.01,
            "line: period {period:.4} from {start}"
        );
    }
    let marks = NonCyclicMarks {
        rest_s: 1.0,
        extreme_s: 1.001,
    };
    let error = define_non_cyclic(&set, &wave, "x", "test", marks).expect_err("too close");
    assert!(matches!(error, DefineError::TooShort { .. }), "{error}");
}

#[test]
fn gesture_files_come_back_and_say_what_is_wrong_with_them() {
    let set = wave_set(Way::Loop);
    let text = set.to_toml();
    let again = GestureSet::from_toml(&text, "g.toml").expect("what was written");
    assert_eq!(again.to_toml(), text, "written again, the same bytes");
    for (from, to, expected) in [
        ("version = 1", "version = 3", "version: found 3"),
        ("\"gestures\"", "\"poses\"", "allowed: \"gestures\""),
        ("dim = 3", "dim = 5", "dim: found 5"),
        (
            "lambda = 0.666667",
            "lambda = 9.0",
            "options.lambda: found 9",
        ),
        ("lambda = 0.666667", "lamda = 0.6", "lamda"),
        ("kind = \"cyclic\"", "kind = \"round\"", "cyclic"),
        ("duration_s = 0.9997", "duration_s = -1.0", "duration_s"),
        (
            "  [0.0, ",
            "  [0.0, 7.0, ",
            "row 1: found 20 numbers; allowed: 19",
        ),
        ("  [0.0, ", "  [9.0, ", "row 1: found time 9"),
        ("reference = [", "reference = [nan, ", "reference"),
    ] {
        let broken = text.replacen(from, to, 1);
        assert!(broken != text, "{from}");
        let message = GestureSet::from_toml(&broken, "g.toml")
            .expect_err(to)
            .to_string();
        assert!(
            message.starts_with("g.toml: ") && message.contains(expected),
            "{to}: {message}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn whatever_comes_the_estimates_stay_finite(
        steps in proptest::collection::vec((prop_oneof![Just(f64::NAN), -0.1..2.0f64, Just(1e9)], -10.0..10.0f64), 1..60)
    ) {
        let set = wave_set(Way::Loop);
        let mut front = front(&set);
        let mut t = 0.0;
        for (step, offset) in steps {
            if step.is_finite() { t += step }
            let mut places = pose(Way::Loop, offset, t);
            places[0][0] += offset;
            let shown = sample(if step.is_nan() { step } else { t }, &places);
            let _ = front.push(&shown);
            let estimate = front.predict(0, t + offset);
            prop_assert!(estimate.amplitude.is_finite() && estimate.amplitude >= 0.0);
            prop_assert!(estimate.frequency_hz.abs() <= 6.5);
            prop_assert!((0.0..TAU).contains(&estimate.phase_rad));
            prop_assert!((0.0..=1.0).contains(&estimate.quality));
        }
    }

    #[test]
    fn no_text_makes_the_gesture_file_panic(text in "\\PC{0,200}") {
        let _ = GestureSet::from_toml(&text, "g.toml");
    }
}

#[test]
fn a_single_point_is_a_gesture_too() {
    let header = PoseHeader {
        points: vec!["finger".into()],
        dim: 2,
        channels: Vec::new(),
    };
    let place = |t: f64| PoseSample {
        t,
        points: vec![Some([0.1 * (TAU * t).cos(), 0.1 * (TAU * t).sin(), 0.0])],
        ..PoseSample::default()
    };
    let samples = times(30.0, 3.0, 0.0, 1).into_iter().map(place).collect();
    let recording = Recording {
        header: header.clone(),
        samples,
    };
    let mut set = GestureSet::new(&header, Vec::new());
    let marks = CyclicMarks {
        start_s: 0.0,
        end_s: None,
    };
    let found = define_cyclic(&set, &recording, "circle", "test", marks).expect("periodic");
    set.put(found.gesture);
    let mut front = FrontEnd::new(&set, &header, FrontEndOptions::default()).expect("match");
    for t in times(30.0, 5.0, 0.0, 1) {
        front.push(&place(-t + 10.0)).err();
        front.push(&place(t + 10.0)).err();
    }
    let estimate = front.estimates()[0];
    assert!((estimate.amplitude - 1.0).abs() < 0.02, "{estimate:?}");
}
