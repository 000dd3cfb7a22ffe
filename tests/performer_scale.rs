//! One scale per performer: a small hand and a large one work with one gesture file.

mod gesture_support;
mod support;

use handwave::base::wrap_pi;
use handwave::gesture::{
    FrontEnd, FrontEndError, FrontEndOptions, GestureKind, GestureSet, PerformerScale,
};
use handwave::pose::{PoseHeader, PoseSample, Recording};
use std::f64::consts::TAU;
use std::path::Path;
use support::folder::Folder;
use support::program::{handwave, run_virtual};
use support::recipe;

fn configs(part: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("configs")
        .join(part)
}

fn bundled() -> (GestureSet, Recording) {
    let set = GestureSet::load(&configs("gestures/hand.toml")).expect("bundled");
    let file = configs("performances/drum_and_splay.jsonl");
    (set, Recording::read(&file).expect("bundled").0)
}

/// The same movement by a hand of `size` times the size.
fn resized(samples: &[PoseSample], size: f64) -> Vec<PoseSample> {
    let mut samples = samples.to_vec();
    for place in samples
        .iter_mut()
        .flat_map(|s| s.points.iter_mut().flatten())
    {
        place.iter_mut().for_each(|value| *value *= size);
    }
    samples
}

fn front(set: &GestureSet, header: &PoseHeader, scale: PerformerScale) -> FrontEnd {
    let options = FrontEndOptions {
        scale,
        ..FrontEndOptions::default()
    };
    FrontEnd::new(set, header, options).expect("points match")
}

#[test]
fn scales_that_nobody_has_are_refused() {
    let (set, recording) = bundled();
    for scale in [0.0, -1.0, 0.05, 11.0, f64::NAN, f64::INFINITY] {
        let options = FrontEndOptions {
            scale: PerformerScale::Declared(scale),
            ..FrontEndOptions::default()
        };
        let error = FrontEnd::new(&set, &recording.header, options).expect_err("refused");
        assert!(
            matches!(error, FrontEndError::Option { key: "scale", .. }),
            "{error}"
        );
    }
    for text in ["0.05", "resst", "", "1,5", "nan"] {
        let error = text.parse::<PerformerScale>().expect_err(text);
        assert!(
            error.contains("0.1 to 10") && error.contains("rest"),
            "{error}"
        );
    }
    let ended = handwave(&["run", "--headless", "--scale", "resst"]).expect(2);
    assert!(ended.err.contains("rest"), "{}", ended.err);
    let folder = Folder::of_configs();
    for (written, line) in [
        ("scale = \"reast\"", "input.scale"),
        ("scale = 20", "input.scale"),
    ] {
        folder.edit(
            "quadruped.toml",
            "window = 0.5 ",
            &format!("{written}\nwindow = 0.5 "),
        );
        let ended = run_virtual(&[&folder.text("quadruped.toml")]).expect(2);
        assert!(ended.err.contains(line), "{written}: {}", ended.err);
        folder.edit("quadruped.toml", &format!("{written}\n"), "");
    }
}

/// Differences between the waves of two front ends over the performance: amplitude, cycles.
/// On average while drumming (from 3 s into each stretch of it) and, of amplitude, at any time from 2 s
/// on: the first second is what a scale may be measured in.
fn difference(
    (one, other): (&mut FrontEnd, &mut FrontEnd),
    samples: &[PoseSample],
    others: &[PoseSample],
) -> [f64; 3] {
    let stretches = recipe::drumming();
    let (mut amplitude, mut phase, mut ever, mut count) = (0.0, 0.0, 0.0_f64, 0.0);
    for (sample, scaled) in samples.iter().zip(others) {
        one.push(sample).expect("good sample");
        other.push(scaled).expect("good sample");
        let steady = |s: &recipe::Segment| (s.from_s + 3.0..s.to_s).contains(&sample.t);
        let drumming = stretches.iter().any(steady);
        for (a, b) in one.estimates().iter().zip(other.estimates()) {
            let off = (a.amplitude - b.amplitude).abs();
            if sample.t > 2.0 {
                ever = ever.max(off);
            }
            if drumming && a.kind == GestureKind::Cyclic {
                count += 1.0;
                amplitude += off;
                phase += wrap_pi(a.phase_rad - b.phase_rad).abs() / TAU;
            }
        }
    }
    [amplitude / count, phase / count, ever]
}

#[test]
fn a_small_hand_makes_the_same_waves_and_keeps_its_metres() {
    let (set, recording) = bundled();
    for size in [0.6, 1.5] {
        let small = resized(&recording.samples, size);
        for scale in [PerformerScale::Declared(1.0 / size), PerformerScale::Rest] {
            let mut usual = front(&set, &recording.header, PerformerScale::default());
            let mut other = front(&set, &recording.header, scale);
            let [amplitude, phase, ever] =
                difference((&mut usual, &mut other), &recording.samples, &small);
            let used = other.performer_scale().expect("measured");
            println!(
                "size {size}, {scale:?}: scale {used:.4}, off by {amplitude:.4}, {phase:.4} cycles, at most ever {ever:.3}"
            );
            assert!((used * size - 1.0).abs() < 0.01, "scale {used}");
            assert!(
                amplitude < 0.01,
                "{scale:?}: amplitude off by {amplitude:.4}"
            );
            assert!(phase < 0.01, "{scale:?}: phase off by {phase:.4}");
            assert!(
                ever < 0.05,
                "{scale:?}: amplitude off by {ever:.4} at an onset"
            );
            let (here, there) = (usual.global_motion(), other.global_motion());
            assert!((there.height_m - size * here.height_m).abs() < 1e-9);
            assert!((there.distance_m - size * here.distance_m).abs() < 1e-9);
            assert!((there.yaw_rad - here.yaw_rad).abs() < 1e-9);
        }
        let mut usual = front(&set, &recording.header, PerformerScale::default());
        let mut other = front(&set, &recording.header, PerformerScale::default());
        let [amplitude, ..] = difference((&mut usual, &mut other), &recording.samples, &small);
        assert!(
            amplitude > 0.2,
            "without a scale off by {amplitude:.4} only"
        );
    }
}

#[test]
fn a_scale_is_measured_once_and_only_at_rest() {
    let (set, recording) = bundled();
    // From the drumming on: no still second until it stops at 33.5 s.
    let mut late = front(&set, &recording.header, PerformerScale::Rest);
    let mut measured_s = None;
    let mut seen = Vec::new();
    for sample in recording.samples.iter().filter(|s| s.t > 4.5) {
        late.push(sample).expect("good sample");
        match late.performer_scale() {
            None => assert_eq!(measured_s, None, "forgotten"),
            Some(scale) => {
                measured_s.get_or_insert(sample.t);
                seen.push(scale);
            }
        }
    }
    let measured_s = measured_s.expect("measured");
    println!(
        "drumming from 4.5 s: measured at {measured_s:.2} s as {:.4}",
        seen[0]
    );
    assert!(
        (34.5..36.5).contains(&measured_s),
        "measured at {measured_s} s"
    );
    assert!(
        seen.iter().all(|scale| *scale == seen[0]),
        "the scale changed"
    );
}

#[test]
fn run_and_estimate_take_a_scale_and_say_what_was_measured() {
    let folder = Folder::empty();
    let (_, recording) = bundled();
    let small = Recording {
        samples: resized(&recording.samples, 0.6),
        header: recording.header.clone(),
    };
    let path = std::path::PathBuf::from(folder.text("small.jsonl"));
    small.write(&path).expect("writable");
    let input = format!("file:{}", path.display());
    let run = |scale: &[&str]| {
        let args = [
            &["--json", "--duration", "16", "--input", &input][..],
            scale,
        ]
        .concat();
        run_virtual(&args).expect(0).json()
    };
    assert_eq!(run(&[])["performer_scale"], 1.0);
    assert_eq!(run(&["--scale", "1.6667"])["performer_scale"], 1.6667);
    let measured = run(&["--scale", "rest"])["performer_scale"].clone();
    let measured = measured.as_f64().expect("a number");
    assert!((measured * 0.6 - 1.0).abs() < 0.01, "{measured}");
    let (gestures, out) = (configs("gestures/hand.toml"), folder.text("waves.csv"));
    let [gestures, poses] = [&gestures, &path].map(|p| p.display().to_string());
    let mut highest = Vec::new();
    for scale in ["1", "1.6667", "rest"] {
        let ended = handwave(&[
            "gesture",
            "estimate",
            "--gestures",
            &gestures,
            "--poses",
            &poses,
            "--out",
            &out,
            "--scale",
            scale,
        ])
        .expect(0);
        assert_eq!(
            ended.err.contains("performer's scale 1.6"),
            scale == "rest",
            "{}",
            ended.err
        );
        let text = std::fs::read_to_string(&out).expect("estimates");
        let drum = text.lines().filter(|line| line.contains(",drum,"));
        let amplitudes = drum.filter_map(|line| line.split(',').nth(2)?.parse::<f64>().ok());
        highest.push(amplitudes.fold(0.0, f64::max));
    }
    println!("highest drum amplitude at scale 1, 1.6667, rest: {highest:.3?}");
    assert!(
        highest[0] < 0.75 && highest[1] > 0.95 && highest[2] > 0.95,
        "{highest:.3?}"
    );
}
