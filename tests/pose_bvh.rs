//! BVH files: what is refused and how it is said, where forward kinematics puts the joints, real walkers.

mod support;

use handwave::gesture::{CyclicMarks, FrontEnd, FrontEndOptions, GestureSet, define_cyclic};
use handwave::pose::bvh::{BvhFile, BvhOptions, LengthUnit, UnitGuess, to_recording};
use handwave::pose::{PoseFormat, PoseReader, Recording};
use proptest::prelude::*;
use std::path::Path;
use support::data::shared_data;

/// A root that travels, a joint with rotations only, one whose position channel replaces a part of
/// its offset, and an End Site.
const SMALL: &str = "HIERARCHY
ROOT Hips
{
  OFFSET 7 8 9
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Spine
  {
    OFFSET 0 20 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT Head
    {
      OFFSET 3 30 4
      CHANNELS 1 Yposition
      End Site
      {
        OFFSET 0 10 0
      }
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.05
1 2 3 0 0 0 0 0 0 30
1 2 3 90 0 0 0 90 0 25
";

fn places(text: &str, frame: usize) -> Vec<[f64; 3]> {
    let file = BvhFile::parse(text).unwrap_or_else(|fault| panic!("{fault}"));
    let mut places = Vec::new();
    file.places(frame, &mut places);
    places.iter().map(|place| place.position.into()).collect()
}

#[track_caller]
fn near(found: [f64; 3], expected: [f64; 3]) {
    for axis in 0..3 {
        let off = (found[axis] - expected[axis]).abs();
        assert!(off < 1e-9, "{found:?} instead of {expected:?}");
    }
}

#[test]
fn a_wrong_file_is_refused_with_its_line_and_what_may_stand_there() {
    for (from, to, line, expected) in [
        ("HIERARCHY", "HIERACHY", 1, "allowed: `HIERARCHY`"),
        ("ROOT Hips", "JOINT Hips", 2, "allowed: `ROOT NAME {`"),
        ("ROOT Hips\n", "ROOT \n", 2, "joint name"),
        ("OFFSET 7 8 9", "OFFSET 7 8", 5, "three numbers"),
        ("OFFSET 7 8 9", "OFFSET 7 8 nan", 4, "found `nan`"),
        ("OFFSET 7 8 9", "OFFSET 7 8 1e99", 4, "found `1e99`"),
        ("  OFFSET 7 8 9\n", "", 4, "`OFFSET x y z` first"),
        ("CHANNELS 6", "CHANNELS 4000000000", 5, "0 to 6"),
        ("CHANNELS 6", "CHANNELS 5", 5, "found `Yrotation`"),
        ("CHANNELS 3", "CHANNELS 4", 10, "found `JOINT`"),
        (
            "CHANNELS 1 Yposition",
            "CHANNELS 1 Wposition",
            13,
            "Xposition",
        ),
        (
            "CHANNELS 3 Zrotation Xrotation",
            "CHANNELS 3 Zrotation Zrotation",
            9,
            "twice in a joint",
        ),
        ("JOINT Head", "JOINT Spine", 10, "joint `Spine` twice"),
        ("JOINT Head", "JOINT a,b", 10, "without comma"),
        ("End Site", "End Effector", 14, "allowed: `Site`"),
        ("MOTION", "}\nMOTION", 21, "another `ROOT NAME {`"),
        ("Frames: 2", "Frames: two", 22, "`Frames: N`"),
        ("Frames: 2", "Frames: 0", 22, "N at least 1"),
        ("Frames: 2", "Frames: 1", 25, "more than the 1 frames"),
        (
            "Frames: 2",
            "Frames: 18446744073709551615",
            25,
            "after 2 of 18446744073709551615 frames",
        ),
        ("Time: 0.05", "Time: 0", 23, "frame time of 0.0001 to 1 s"),
        ("Time: 0.05", "Time: NaN", 23, "frame time of"),
        ("Time: 0.05", "Time: 0.05 s", 23, "end of the line"),
        (
            "1 2 3 0 0 0 0 0 0 30",
            "1 2 3 0 0 0 0 0 0",
            24,
            "9 numbers in frame 1",
        ),
        (
            "1 2 3 0 0 0 0 0 0 30",
            "1 2 3 0 0 0 0 0 0 30 1",
            24,
            "10 numbers a frame",
        ),
        (
            "1 2 3 90 0 0",
            "1 2 3 inf 0 0",
            25,
            "found `inf` in frame 2",
        ),
    ] {
        assert!(SMALL.contains(from), "{from}");
        let text = SMALL.replacen(from, to, 1);
        let fault = BvhFile::parse(&text).expect_err(to);
        let message = fault.to_string();
        assert!(message.contains(expected), "{from} -> {to}: {message}");
        assert_eq!(fault.line, line, "{from} -> {to}: {message}");
    }
    for (text, expected) in [
        (
            "",
            "line 1: found the end of the file; allowed: `HIERARCHY`",
        ),
        (
            "HIERARCHY\nMOTION",
            "line 2: found `MOTION`; allowed: `ROOT NAME {`",
        ),
        (
            "HIERARCHY ROOT a { OFFSET 0 0 0 } MOTION",
            "a skeleton without a channel",
        ),
    ] {
        let message = BvhFile::parse(text).expect_err(text).to_string();
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn a_file_cut_off_anywhere_says_that_it_ends() {
    for end in 0..SMALL.trim_end().len() {
        let Err(fault) = BvhFile::parse(&SMALL[..end]) else {
            // The last number may lose a digit and still be one.
            assert!(end + 2 > SMALL.trim_end().len(), "cut at {end} and read");
            continue;
        };
        let lines = SMALL[..end].trim_end().lines().count().max(1) as u64;
        assert!((1..=lines).contains(&fault.line), "cut at {end}: {fault}");
    }
}

#[test]
fn nesting_and_joints_are_bounded() {
    let joint = |k: usize| format!("JOINT j{k} {{ OFFSET 0 1 0\n");
    let tail = "MOTION\nFrames: 1\nFrame Time: 0.01\n0\n";
    let root = "HIERARCHY\nROOT r { OFFSET 0 0 0 CHANNELS 1 Xrotation\n";
    for (depth, refused) in [(199, false), (200, true), (100_000, true)] {
        let nested: String = (0..depth).map(joint).collect();
        let text = format!("{root}{nested}{}{tail}", "}".repeat(depth + 1));
        match BvhFile::parse(&text) {
            Ok(_) => assert!(!refused, "{depth} levels were read"),
            Err(fault) => assert!(
                refused && fault.to_string().contains("at most 200 levels"),
                "{depth}: {fault}"
            ),
        }
    }
    let beside: String = (0..1500).map(|k| format!("{} }}\n", joint(k))).collect();
    let message = BvhFile::parse(&format!("{root}{beside}}}{tail}"))
        .expect_err("1501 joints")
        .to_string();
    assert!(message.contains("at most 1000 joints"), "{message}");
}

#[test]
fn forward_kinematics_follow_the_channels() {
    // At rest: position channels replace the offset, wholly (hips) and in part (head, y only).
    let rest = places(SMALL, 0);
    near(rest[0], [1.0, 2.0, 3.0]);
    near(rest[1], [1.0, 22.0, 3.0]);
    near(rest[2], [4.0, 52.0, 7.0]);
    near(rest[3], [4.0, 62.0, 7.0]);
    // Hips turned by 90 degrees about z: up becomes -x. Spine turned by 90 about x in that frame:
    // its own up becomes the world's z, its own z the world's -(-x) = x.
    let turned = places(SMALL, 1);
    near(turned[1], [-19.0, 2.0, 3.0]);
    near(turned[2], [-19.0 + 4.0, 2.0 + 3.0, 3.0 + 25.0]);
    near(turned[3], [-15.0, 5.0, 38.0]);
}

#[test]
fn rotations_are_applied_in_the_order_of_the_channels() {
    let text = |order: &str, values: &str| {
        format!(
            "HIERARCHY\nROOT a\n{{ OFFSET 0 0 0 CHANNELS 3 {order}\nJOINT b {{ OFFSET 0 0 10 }} }}\n\
             MOTION\nFrames:\t1\nFrame Time:\t0.01\n{values}\n"
        )
    };
    // Rz(90) Rx(90) carries z to -y and on to x; Rx(90) Rz(90) leaves z alone first, then carries it to -y.
    let zxy = text("Zrotation Xrotation Yrotation", "90 90 0");
    near(places(&zxy, 0)[1], [10.0, 0.0, 0.0]);
    let xyz = text("Xrotation Yrotation Zrotation", "90 0 90");
    near(places(&xyz, 0)[1], [0.0, -10.0, 0.0]);
    // Any case, tabs, Windows line ends, blank lines.
    let odd = zxy
        .replace("Zrotation", "zROTATION")
        .replace("HIERARCHY", "\u{feff}Hierarchy")
        .replace('\n', "\r\n\r\n");
    near(places(&odd, 0)[1], [10.0, 0.0, 0.0]);
}

#[test]
fn a_stream_of_a_bvh_file_is_in_metres_and_seconds() {
    let mut reader = PoseReader::new(SMALL.as_bytes(), PoseFormat::Bvh, "small.bvh").expect("good");
    assert_eq!(reader.header().points, ["Hips", "Spine", "Head"]);
    // 60 units from hips to tip: a human's size in inches, cut in half.
    let said = reader.assumption().expect("the unit had to be guessed");
    assert!(said.starts_with("small.bvh: unit in (guessed"), "{said}");
    let samples: Vec<_> = (&mut reader)
        .collect::<Result<_, _>>()
        .expect("good frames");
    assert_eq!(samples.len(), 2);
    assert_eq!(samples[1].t, 0.05);
    near(
        samples[0].points[0].expect("seen"),
        [0.0254, 0.0508, 0.0762],
    );
    let error = PoseReader::new(&SMALL.as_bytes()[..300], PoseFormat::Bvh, "cut.bvh")
        .expect_err("cut off")
        .to_string();
    assert!(error.starts_with("cut.bvh:"), "{error}");
    // A unit that is told is not guessed, and End Sites come when asked for.
    let options = BvhOptions {
        unit: Some("cm".parse().expect("a unit")),
        ends: true,
    };
    let (recording, guess) = to_recording(BvhFile::parse(SMALL).expect("good"), options);
    assert_eq!(guess, None);
    assert_eq!(recording.header.points[3], "Head_end");
    near(
        recording.samples[0].points[3].expect("seen"),
        [0.04, 0.62, 0.07],
    );
    for (text, metres) in [("m", 1.0), ("0.0564", 0.0564)] {
        assert_eq!(text.parse(), Ok(LengthUnit { metres }));
    }
    let error = "km".parse::<LengthUnit>().expect_err("no such unit");
    assert!(
        error.contains("did you mean") && error.contains("mm, in, ft"),
        "{error}"
    );
}

#[test]
fn the_unit_is_guessed_from_the_size_of_the_skeleton() {
    // Tip to tip of a skeleton of 2.2 m, in each unit.
    for (length, unit, human) in [
        (2.2, "m", true),
        (220.0, "cm", true),
        (86.6, "in", true),
        (2200.0, "mm", true),
        (44.0, "in", false),
        (0.3, "m", false),
    ] {
        let text = format!(
            "HIERARCHY ROOT a {{ OFFSET 0 0 0 CHANNELS 1 Xrotation JOINT b {{ OFFSET 0 {length} 0 }} }}\n\
             MOTION\nFrames: 1\nFrame Time: 0.01\n0\n"
        );
        let guess = UnitGuess::of(&BvhFile::parse(&text).expect("good"));
        assert_eq!(guess.unit.to_string(), unit, "{length}: {guess}");
        assert_eq!(guess.is_human, human, "{length}: {guess}");
    }
}

/// Words that a mutation may put in the place of another.
const WORDS: [&str; 16] = [
    "{",
    "}",
    "JOINT",
    "End Site",
    "OFFSET",
    "CHANNELS",
    "MOTION",
    "ROOT",
    "Frames:",
    "NaN",
    "-1",
    "1e308",
    "99999999999999999999",
    "\u{0}",
    "\u{fffd}é",
    "Xposition",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn whatever_is_done_to_a_file_it_is_read_or_refused_with_a_line(
        from in 0..SMALL.len(),
        length in 0..60usize,
        word in 0..=WORDS.len(),
        repeat in 1..4usize,
    ) {
        let to = (from + length).min(SMALL.len());
        let put = WORDS.get(word).copied().unwrap_or(&SMALL[from..to]);
        let text = format!("{} {} {}", &SMALL[..from], put.repeat(repeat), &SMALL[to..]);
        match BvhFile::parse(&text) {
            Ok(file) => {
                let (recording, _) = to_recording(file, BvhOptions::default());
                for place in recording.samples.iter().flat_map(|s| &s.points).flatten() {
                    prop_assert!(place.iter().all(|v| v.is_finite()), "{place:?}");
                }
            }
            Err(fault) => {
                let lines = text.trim_end().lines().count() as u64;
                prop_assert!((1..=lines).contains(&fault.line), "{fault} of {lines}");
                prop_assert!(!fault.found.is_empty() && !fault.allowed.is_empty());
            }
        }
    }

    #[test]
    fn no_bytes_make_the_parser_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let _refused = PoseReader::new(&bytes[..], PoseFormat::Bvh, "fuzz");
        let text = format!("HIERARCHY\n{}", String::from_utf8_lossy(&bytes));
        prop_assert!(BvhFile::parse(&text).is_err());
    }
}

fn read(path: &Path) -> Recording {
    Recording::read(path)
        .unwrap_or_else(|error| panic!("{error}"))
        .0
}

/// Places of a point over time.
fn track(recording: &Recording, name: &str) -> Vec<[f64; 3]> {
    let points = &recording.header.points;
    let index = points.iter().position(|point| point == name);
    let index = index.unwrap_or_else(|| panic!("no {name} in {points:?}"));
    let samples = recording.samples.iter();
    samples.map(|s| s.points[index].expect("seen")).collect()
}

#[test]
fn a_recorded_walker_has_human_size_and_walks_at_the_measured_speed() {
    let Some(folder) = shared_data("human_bvh") else {
        return;
    };
    let walk = read(&folder.join("dataset-1_walk_normal_001.bvh"));
    assert_eq!(walk.samples.len(), 195);
    let hips = track(&walk, "Hips");
    let (first, last) = (hips[0], hips[hips.len() - 1]);
    let (from, to) = walk.span_s();
    let speed = (last[0] - first[0]).hypot(last[2] - first[2]) / (to - from);
    assert!(
        (speed / 1.25 - 1.0).abs() < 0.05,
        "hips travel at {speed:.3} m/s, measured 1.25"
    );
    for height in track(&walk, "Head").iter().map(|head| head[1]) {
        assert!((1.3..1.9).contains(&height), "head at {height:.3} m");
    }
    let turns = "joint_Root";
    assert!(
        !walk.header.points.iter().any(|point| point == turns),
        "the origin is no point of the body"
    );
}

#[test]
fn bones_of_recorded_people_keep_their_length() {
    let Some(folder) = shared_data("human_bvh") else {
        return;
    };
    let mut files = 0;
    for entry in std::fs::read_dir(folder).expect("readable") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|ending| ending != "bvh") {
            continue;
        }
        files += 1;
        let recording = read(&path);
        let file = BvhFile::parse(&std::fs::read_to_string(&path).expect("text")).expect("good");
        let guess = UnitGuess::of(&file);
        assert!(
            guess.is_human && guess.unit.metres == 0.01,
            "{}: {guess}",
            path.display()
        );
        for joint in file.joints.iter().filter(|joint| !joint.is_end) {
            let Some(parent) = joint.parent.map(|parent| &file.joints[parent].name) else {
                continue;
            };
            if parent == "joint_Root" {
                continue;
            }
            let lengths = track(&recording, parent)
                .into_iter()
                .zip(track(&recording, &joint.name));
            let lengths: Vec<f64> = lengths
                .map(|(a, b)| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt())
                .collect();
            let shortest = lengths.iter().copied().fold(f64::INFINITY, f64::min);
            let longest = lengths.iter().copied().fold(0.0, f64::max);
            assert!(
                longest - shortest < 1e-3,
                "{}: {parent} to {} measures {shortest:.4} to {longest:.4} m",
                path.display(),
                joint.name
            );
        }
    }
    assert_eq!(files, 20, "clips");
}

#[test]
fn a_walk_shown_once_reads_the_stride_of_other_walkers() {
    let Some(folder) = shared_data("human_bvh") else {
        return;
    };
    let shown = read(&folder.join("dataset-1_walk_normal_001.bvh"));
    let mut set = GestureSet::new(&shown.header, Vec::new());
    let marks = CyclicMarks {
        start_s: 2.0,
        end_s: None,
    };
    let definition = define_cyclic(&set, &shown, "walk", "test", marks).expect("periodic");
    set.put(definition.gesture);
    // Stride frequencies measured beside the recordings, in Hz.
    for (name, measured_hz) in [
        ("dataset-1_walk_normal_001", 0.930),
        ("dataset-2_walk_normal_001", 0.908),
        ("dataset-2_walk_active_001", 0.989),
        ("dataset-2_walk_exhausted_001", 0.886),
    ] {
        let walk = read(&folder.join(format!("{name}.bvh")));
        let mut front =
            FrontEnd::new(&set, &walk.header, FrontEndOptions::default()).expect("same joints");
        let (mut sum, mut count) = (0.0, 0.0);
        for sample in &walk.samples {
            front.push(sample).expect("a good sample");
            if (3.0..6.0).contains(&sample.t) {
                sum += front.estimates()[0].frequency_hz;
                count += 1.0;
            }
        }
        let found_hz = sum / count;
        assert!(
            (found_hz / measured_hz - 1.0).abs() < 0.05,
            "{name}: a stride of {found_hz:.3} Hz, measured {measured_hz}"
        );
    }
}
