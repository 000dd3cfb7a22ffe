//! Other programs' recordings as pose streams: what is refused, what is read, and what can be chosen of it.

mod support;

use handwave::pose::import::{ImportKind, ImportOptions, Imported, import};
use handwave::pose::table::TableOptions;
use handwave::pose::{PoseFormat, PoseReader, PoseWriter, Recording};
use handwave::pose::{aframe, leap, live_link, table};
use proptest::prelude::*;
use std::path::Path;
use support::data::shared_data;
use support::folder::Folder;
use support::program::{handwave, refused};

const FACE: &str = "Timecode,BlendShapeCount,EyeBlinkLeft,JawOpen,HeadYaw
23:59:59:58.500,61,0.25,1.003,0.5
23:59:59:59.500,61,-0.01,0.5,0.4
00:00:00:00.500,0,,,
00:00:00:00.500,61,0.1,0.2,0.3
00:00:01:30.000,61,0.5,0.25,0.1
";

/// Head looks along -z (turned 0), left controller is turned by 90 degrees about y, then 90 about x.
const TRACKED: &str = r#"{"camera":{"poses":[
  {"position":{"x":0,"y":1.6,"z":0},"rotation":{"x":0,"y":0,"z":0},"timestamp":1000},
  {"position":{"x":0,"y":1.7,"z":0},"rotation":{"x":90,"y":0,"z":77},"timestamp":1010},
  {"position":{"x":0,"y":1.8,"z":0},"rotation":{"x":0,"y":90,"z":0},"timestamp":1200}],"events":[]},
 "left":{"gamepad":3,"poses":[
  {"position":{"x":1,"y":1,"z":1},"rotation":{"x":90,"y":90,"z":0},"timestamp":1001},
  {"position":{"x":2,"y":1,"z":1},"rotation":{"x":0,"y":90,"z":45},"timestamp":1012}]}}"#;

fn bring(text: &str, options: &ImportOptions) -> Result<Imported, String> {
    let folder = Folder::empty();
    let path = folder.write("recording", text);
    import(Path::new(&path), options).map_err(|error| error.to_string())
}

fn kind(kind: ImportKind) -> ImportOptions {
    ImportOptions {
        kind: Some(kind),
        ..ImportOptions::default()
    }
}

fn rate(rate_hz: f64, names: &[&str]) -> ImportOptions {
    ImportOptions {
        rate_hz: Some(rate_hz),
        names: names.iter().map(ToString::to_string).collect(),
        ..ImportOptions::default()
    }
}

#[test]
fn wrong_recordings_are_refused_with_their_line_and_what_is_allowed() {
    let plain = ImportOptions::default();
    let face = kind(ImportKind::LiveLinkFace);
    for (text, options, expected) in [
        ("", &plain, "no recording of a known kind; known: bvh, leap"),
        ("Some words.\n", &plain, "known: bvh, leap"),
        ("1,2,3\n", &plain, "--rate HZ"),
        (
            "HIERARCHY\n",
            &rate(60.0, &[]),
            "--rate belongs to recordings of kind table; this one is read as bvh",
        ),
        ("1,2,3\n", &rate(0.0, &[]), "0.01 to 10000 Hz"),
        ("1,2,3\n", &rate(f64::NAN, &[]), "0.01 to 10000 Hz"),
        (
            "1,2,3\n1,2\n",
            &rate(60.0, &[]),
            ":2: found 2 numbers; allowed: x, y and z",
        ),
        (
            "1,2,3\n1,2,x\n",
            &rate(60.0, &[]),
            ":2: found `x`; allowed: numbers",
        ),
        ("1,2,3\n1,2,inf\n", &rate(60.0, &[]), ":2: found `inf`"),
        (
            "1,2,3\n1,2,3,4,5,6\n",
            &rate(60.0, &[]),
            ":2: found 2 points; allowed: 1 points",
        ),
        ("1,2,3\n", &rate(60.0, &["a", "b"]), "as many as names"),
        ("1,2,3,4,5,6\n", &rate(60.0, &["a", "a"]), "`a` twice"),
        (
            "1,2,3\n",
            &face,
            ":1: found `1,2,3`; allowed: a first line `Timecode",
        ),
        (
            "Timecode,BlendShapeCount,JawOpen\n12:00:00,61,0.1\n",
            &plain,
            ":2: found `12:00:00`; allowed: hours:minutes:seconds:frames",
        ),
        (
            "Timecode,BlendShapeCount,JawOpen\n12:00:00:60,61,0\n",
            &plain,
            "frames below 60",
        ),
        (
            "Timecode,BlendShapeCount,JawOpen\n12:00:00:01,61,0.1,0.2\n",
            &plain,
            ":2: found 4 columns; allowed: 3 columns",
        ),
        (
            "Timecode,BlendShapeCount,JawOpen\n12:00:00:01,61,wide\n",
            &plain,
            ":2: found `wide` in column JawOpen",
        ),
        ("Timecode,BlendShapeCount,JawOpen\n", &plain, "no row"),
        (
            "{\"camera\":{\"poses\":[]}}",
            &kind(ImportKind::AFrame),
            "no device with poses",
        ),
        (
            "{\"camera\":7}",
            &kind(ImportKind::AFrame),
            "not an A-Frame motion capture recording",
        ),
        (
            "{\"frames\":3}",
            &kind(ImportKind::Leap),
            "not a Leap Motion recording",
        ),
        ("HIERARCHY\nROOT", &plain, ":2: found joint name"),
    ] {
        let message = bring(text, options).expect_err(text);
        assert!(message.contains(expected), "{text:?}: {message}");
    }
    let error = ImportKind::from_name("aframe").expect_err("no such kind");
    assert!(error.contains("did you mean \"a-frame\""), "{error}");
}

#[test]
fn a_face_becomes_clamped_channels_on_a_clock_that_passes_midnight() {
    let imported = bring(FACE, &ImportOptions::default()).expect("a face");
    assert_eq!(imported.kind, ImportKind::LiveLinkFace);
    let face = imported.recording;
    assert!(face.header.points.is_empty());
    assert_eq!(face.header.channels, ["EyeBlinkLeft", "JawOpen"]);
    let times: Vec<f64> = face.samples.iter().map(|sample| sample.t).collect();
    for (found, expected) in times.iter().zip([0.0, 1.0 / 60.0, 2.0 / 60.0, 91.5 / 60.0]) {
        assert!((found - expected).abs() < 1e-6, "{times:?}");
    }
    assert_eq!(
        times.len(),
        4,
        "a row at the time of the one before is dropped"
    );
    assert_eq!(face.samples[0].channels, [Some(0.25), Some(1.0)], "clamped");
    assert_eq!(face.samples[1].channels, [Some(0.0), Some(0.5)], "clamped");
    assert_eq!(face.samples[2].channels, [None, None], "no face seen");
    let with_rotations = ImportOptions {
        rotations: true,
        ..ImportOptions::default()
    };
    let turned = bring(FACE, &with_rotations).expect("a face").recording;
    assert_eq!(turned.header.channels[2], "HeadYaw");
    assert_eq!(turned.samples[3].channels[2], Some(0.1));
}

#[test]
fn a_stream_of_channels_alone_is_written_and_read_in_both_formats() {
    let face = bring(FACE, &ImportOptions::default())
        .expect("a face")
        .recording;
    for format in [PoseFormat::JsonLines, PoseFormat::Csv] {
        let mut writer = PoseWriter::new(Vec::new(), &face.header, format, 4).expect("memory");
        for sample in &face.samples {
            writer.write(sample).expect("memory");
        }
        let bytes = writer.finish().expect("memory");
        let mut reader = PoseReader::new(&bytes[..], format, "again").expect("a header");
        assert_eq!(reader.header(), &face.header);
        let again: Vec<_> = (&mut reader).collect::<Result<_, _>>().expect("samples");
        assert_eq!(reader.counts().total(), 0, "{}", reader.counts());
        assert_eq!(again.len(), face.samples.len());
        for (again, sample) in again.iter().zip(&face.samples) {
            assert_eq!(again.channels, sample.channels, "{format:?}");
        }
    }
    // Without points a sample needs no `p`; with points it does.
    for (points, good) in [("", 1), ("\"a\"", 0)] {
        let text = format!(
            "{{\"handwave\":\"poses\",\"version\":1,\"points\":[{points}],\"channels\":[\"x\"]}}\n{{\"t\":0,\"ch\":{{\"x\":1}}}}\n"
        );
        let reader = PoseReader::new(text.as_bytes(), PoseFormat::JsonLines, "x").expect("header");
        assert_eq!(
            reader.filter(Result::is_ok).count(),
            good,
            "points [{points}]"
        );
    }
}

#[test]
fn headset_and_controllers_are_points_with_tips_that_show_their_orientation() {
    let imported = bring(TRACKED, &ImportOptions::default()).expect("a tracked recording");
    assert_eq!(imported.kind, ImportKind::AFrame);
    let tracked = imported.recording;
    assert_eq!(
        tracked.header.points,
        ["head", "head_tip", "left", "left_tip"]
    );
    let near = |sample: usize, point: usize, expected: [f64; 3]| {
        let found = tracked.samples[sample].points[point].expect("seen");
        let off = (0..3)
            .map(|k| (found[k] - expected[k]).abs())
            .fold(0.0, f64::max);
        assert!(
            off < 1e-9,
            "sample {sample} point {point}: {found:?}, not {expected:?}"
        );
    };
    near(0, 1, [0.0, 1.6, -0.1]);
    near(1, 1, [0.0, 1.8, 0.0]);
    near(2, 1, [-0.1, 1.8, 0.0]);
    // About x first: forward goes up; the turn about y leaves it there. Roll changes no tip.
    near(0, 3, [1.0, 1.1, 1.0]);
    near(1, 3, [1.9, 1.0, 1.0]);
    assert_eq!(tracked.samples[2].points[2], None, "188 ms away");
    assert!((tracked.samples[2].t - 0.2).abs() < 1e-12);
}

#[test]
fn tables_are_read_with_any_divider_and_names() {
    let all = [
        "1,2,3,4,5,6\n7,8,9,,11,12\n",
        "1, 2,\t3,4,5,6,\n\n7,8,9,nan,11,12,\n",
        "1;2;3;4;5;6\n7;8;9;;11;12",
        "1\t2\t3\t4\t5\t6\r\n7\t8\t9\t\t11\t12\r\n",
        "1 2  3 4 5 6 \n 7 8 9 NaN 11 12\n",
    ];
    for text in all {
        let imported = bring(text, &rate(50.0, &[])).unwrap_or_else(|e| panic!("{text:?}: {e}"));
        assert_eq!(imported.kind, ImportKind::Table);
        let recording = imported.recording;
        assert_eq!(recording.header.points, ["p0", "p1"]);
        assert_eq!(
            recording.samples[0].points[1],
            Some([4.0, 5.0, 6.0]),
            "{text:?}"
        );
        assert_eq!(
            recording.samples[1].points,
            [Some([7.0, 8.0, 9.0]), None],
            "{text:?}"
        );
        assert_eq!(recording.samples[1].t, 0.02);
    }
    let mut named = rate(50.0, &["nose", "tail"]);
    named.unit = Some("mm".parse().expect("a unit"));
    let recording = bring(all[0], &named).expect("a table").recording;
    assert_eq!(recording.header.points, ["nose", "tail"]);
    assert_eq!(recording.samples[0].points[0], Some([0.001, 0.002, 0.003]));
}

#[test]
fn points_and_channels_are_chosen_by_name() {
    let names = |list: &[&str]| list.iter().map(ToString::to_string).collect::<Vec<_>>();
    let tracked = bring(TRACKED, &ImportOptions::default())
        .expect("read")
        .recording;
    let two = tracked
        .clone()
        .with_points(&names(&["left", "head"]))
        .expect("there");
    assert_eq!(two.header.points, ["left", "head"]);
    assert_eq!(two.samples[0].points[1], Some([0.0, 1.6, 0.0]));
    let error = tracked
        .clone()
        .with_points(&names(&["heat"]))
        .expect_err("not there");
    assert!(
        error.contains("did you mean \"head\"? Its points: head, head_tip"),
        "{error}"
    );
    let error = tracked
        .clone()
        .with_points(&names(&["head", "head"]))
        .expect_err("twice");
    assert!(error.contains("named twice"), "{error}");
    let error = tracked
        .with_channels_as_points(&names(&["JawOpen"]))
        .expect_err("none");
    assert!(error.contains("Its channels: none"), "{error}");

    let face = bring(FACE, &ImportOptions::default())
        .expect("a face")
        .recording;
    let points = face
        .with_channels_as_points(&names(&["JawOpen", "EyeBlinkLeft"]))
        .expect("there");
    let jaw: Vec<_> = points
        .samples
        .iter()
        .map(|sample| sample.points[0])
        .collect();
    assert_eq!(jaw[0], Some([0.05, 0.1, 0.0]));
    assert_eq!(jaw[1], Some([0.05, 0.05, 0.0]));
    assert_eq!(jaw[2], None);
    assert_eq!(points.header.channels.len(), 2, "channels stay");
}

#[test]
fn the_commands_read_bvh_wherever_they_read_poses_and_say_the_unit() {
    let folder = Folder::empty();
    // An arm of two joints that waves at 1 Hz for 4 s.
    let mut text = String::from(
        "HIERARCHY\nROOT Shoulder\n{ OFFSET 0 140 0 CHANNELS 3 Zrotation Xrotation Yrotation\n\
         JOINT Elbow { OFFSET 100 0 0 CHANNELS 1 Zrotation JOINT Hand { OFFSET 100 20 0 CHANNELS 0\n\
         End Site { OFFSET 20 0 0 } } } }\nMOTION\nFrames: 240\nFrame Time: 0.0166667\n",
    );
    for k in 0..240 {
        let swing = 30.0 * (f64::from(k) / 60.0 * std::f64::consts::TAU).sin();
        text += &format!("0 0 {} {swing}\n", 0.5 * swing);
    }
    let arm = folder.write("arm.bvh", &text);
    let said = "arm.bvh: unit cm (guessed";
    let ended = handwave(&["poses", "info", &arm, "--json"]).expect(0);
    assert!(ended.err.contains(said), "{}", ended.err);
    assert_eq!(ended.json()["samples"], 240);
    assert_eq!(ended.json()["points"][2]["name"], "Hand");
    let gestures = folder.text("arm.toml");
    let define = [
        "gesture", "define", "--name", "wave", "--start", "1", "--into", &gestures, "--poses", &arm,
    ];
    handwave(&define).expect(0);
    let waves = folder.text("waves.csv");
    handwave(&[
        "gesture",
        "estimate",
        "--gestures",
        &gestures,
        "--poses",
        &arm,
        "--out",
        &waves,
    ])
    .expect(0);
    let estimates = std::fs::read_to_string(&waves).expect("estimates");
    let last: Vec<&str> = estimates.lines().last().expect("rows").split(',').collect();
    let frequency_hz: f64 = last[3].parse().expect("a number");
    assert!(
        (frequency_hz.abs() - 1.0).abs() < 0.02,
        "the arm waves at {frequency_hz} Hz, made at 1 Hz"
    );

    let out = folder.text("hand.csv");
    let ended = handwave(&[
        "poses",
        "import",
        &arm,
        "--unit",
        "in",
        "--ends",
        "--points",
        "Hand,Hand_end",
        "--out",
        &out,
    ])
    .expect(0);
    assert!(
        !ended.err.contains("guessed"),
        "the unit was told: {}",
        ended.err
    );
    let hand = Recording::read(Path::new(&out)).expect("written").0;
    assert_eq!(hand.header.points, ["Hand", "Hand_end"]);
    let reach = hand.samples[0].points[1].expect("seen")[0];
    assert!(
        (reach - 220.0 * 0.0254).abs() < 1e-3,
        "the tip is {reach} m out, 220 inches"
    );

    refused(
        handwave(&["poses", "import", &arm, "--out", &folder.text("x.bvh")]),
        2,
        &["end in .jsonl or .csv"],
    );
    refused(
        handwave(&[
            "run",
            "--headless",
            "--speed",
            "max",
            "--input",
            &format!("file:{arm}"),
        ]),
        2,
        &[said, "no point palm", "the gestures were defined with palm"],
    );
    folder.edit("arm.bvh", "Frames: 240", "Frames: 241");
    refused(
        handwave(&["run", "--headless", "--input", &format!("file:{arm}")]),
        2,
        &["arm.bvh:248: found the end of the file after 240 of 241 frames"],
    );
}

#[test]
fn the_recorded_face_has_its_length_and_its_blinks() {
    let Some(path) = shared_data("face/alex_rom_3.csv") else {
        return;
    };
    let face = import(&path, &ImportOptions::default())
        .expect("a face")
        .recording;
    let (from, to) = face.span_s();
    assert!((to - from - 134.38).abs() < 0.01, "{:.3} s", to - from);
    assert_eq!(face.header.channels.len(), 52, "{:?}", face.header.channels);
    let count = |name: &str, level: f64| {
        let index = face
            .header
            .channels
            .iter()
            .position(|c| c == name)
            .expect("there");
        let values: Vec<f64> = face
            .samples
            .iter()
            .filter_map(|s| s.channels[index])
            .collect();
        assert!(
            values.iter().all(|v| (0.0..=1.0).contains(v)),
            "{name} not in 0..1"
        );
        values
            .windows(2)
            .filter(|pair| pair[0] < level && pair[1] >= level)
            .count()
    };
    assert_eq!(count("EyeBlinkLeft", 0.5), 44, "blinks");
    assert_eq!(count("JawOpen", 0.3), 25, "openings of the mouth");
}

#[test]
fn the_recorded_controllers_have_their_length_and_tips_at_arm_of_ten_centimetres() {
    let Some(path) = shared_data("hand/vr_controller/tracked-recording.json") else {
        return;
    };
    let tracked = import(&path, &ImportOptions::default())
        .expect("tracked")
        .recording;
    let (from, to) = tracked.span_s();
    assert!((to - from - 29.24).abs() < 0.01, "{:.3} s", to - from);
    assert_eq!(tracked.samples.len(), 2568);
    for sample in &tracked.samples {
        for pair in sample.points.chunks_exact(2) {
            let (a, b) = (pair[0].expect("seen"), pair[1].expect("seen"));
            let arm = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
            assert!((arm - 0.1).abs() < 1e-9, "{arm} m at {} s", sample.t);
        }
    }
}

#[test]
fn the_recorded_dog_is_a_table_of_27_points() {
    let Some(path) = shared_data("quadruped/dog_points/dog_walk03_joint_pos.txt") else {
        return;
    };
    let dog = import(&path, &rate(60.0, &[])).expect("a table").recording;
    assert_eq!(dog.samples.len(), 548);
    assert_eq!(dog.header.points.len(), 27);
    let (from, to) = dog.span_s();
    assert!((to - from - 547.0 / 60.0).abs() < 1e-9, "{} s", to - from);
}

proptest! {
    #[test]
    fn whatever_is_done_to_a_recording_it_is_read_or_refused(
        from in 0..FACE.len(),
        length in 0..30usize,
        word in prop_oneof![
            Just(""), Just(","), Just("1e999"), Just("-"), Just("{"), Just("]"), Just("null"),
            Just("\"x\""), Just("9999999999999999999999"), Just("é"), Just("\n"), Just(":"),
        ],
    ) {
        let table_text = "1,2,3,4,5,6\n7,8,9,,11,12\n1,2,3,4,5,6\n7,8,9,,11,12\n";
        let options = TableOptions {
            rate_hz: 60.0,
            names: Vec::new(),
            unit: Default::default(),
        };
        let is_finite = |recording: &Recording| {
            let samples = recording.samples.iter();
            let places = samples.clone().flat_map(|s| s.points.iter().flatten().flatten());
            let channels = samples.clone().flat_map(|s| s.channels.iter().flatten());
            let times = recording.samples.windows(2).all(|pair| pair[0].t < pair[1].t);
            times && places.chain(channels).all(|value| value.is_finite())
        };
        for text in [FACE, TRACKED, table_text] {
            let from = from % text.len();
            let to = (from + length).min(text.len());
            let text = format!("{}{word}{}", &text[..from], &text[to..]);
            for read in [
                live_link::parse(&text, true).map_err(|fault| (fault.line, fault.to_string())),
                table::parse(&text, &options).map_err(|fault| (fault.line, fault.to_string())),
                aframe::parse(&text).map_err(|what| (1, what)),
                leap::parse(&text, true).map_err(|what| (1, what)),
            ] {
                match read {
                    Ok(recording) => prop_assert!(is_finite(&recording), "{text}"),
                    Err((line, what)) => {
                        let lines = text.lines().count().max(1) as u64;
                        prop_assert!((1..=lines).contains(&line) && !what.is_empty(), "{what}");
                    }
                }
            }
        }
    }
}
