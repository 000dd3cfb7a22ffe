//! Pose streams: what is refused and how it is said, what is read, and that it is written back.

use handwave::pose::{PoseError, PoseFormat, PoseReader, PoseWriter, Recording, SampleFault, leap};
use proptest::prelude::*;
use std::path::Path;

const HEADER: &str =
    r#"{"handwave":"poses","version":1,"points":["palm","tip"],"dim":3,"unit":"m"}"#;

fn json(text: &str) -> Result<PoseReader<&[u8]>, PoseError> {
    PoseReader::new(text.as_bytes(), PoseFormat::JsonLines, "in.jsonl")
}

fn csv(text: &str) -> Result<PoseReader<&[u8]>, PoseError> {
    PoseReader::new(text.as_bytes(), PoseFormat::Csv, "in.csv")
}

#[test]
fn bad_headers_say_what_stands_there_and_what_may() {
    for (text, expected) in [
        ("", "an empty file"),
        ("{\"t\":0}", "allowed: a first line like"),
        ("not json", "`not json`"),
        ("{\"handwave\":\"gestures\",\"version\":1}", "\"poses\""),
        (
            "{\"handwave\":\"poses\",\"version\":2,\"points\":[\"a\"]}",
            "version 2",
        ),
        ("{\"handwave\":\"poses\",\"points\":[\"a\"]}", "no version"),
        (
            "{\"handwave\":\"poses\",\"version\":1,\"points\":[]}",
            "no points",
        ),
        (
            "{\"handwave\":\"poses\",\"version\":1,\"points\":[\"a\",\"a\"]}",
            "`a` twice",
        ),
        (
            "{\"handwave\":\"poses\",\"version\":1,\"points\":[\"a\"],\"dim\":4}",
            "2 or 3",
        ),
        (
            "{\"handwave\":\"poses\",\"version\":1,\"points\":[\"a\"],\"unit\":\"ft\"}",
            "metres",
        ),
    ] {
        let message = json(text).expect_err(text).to_string();
        assert!(message.starts_with("in.jsonl:1: "), "{message}");
        assert!(message.contains(expected), "{text}: {message}");
    }
    for (text, expected) in [
        ("time,a.x,a.y\n", "first column is not t"),
        ("t\n", "no points"),
        ("t,a.x\n", "1 axes of point a"),
        ("t,a.x,a.y,b.x,b.y,b.z\n", "3 axes of point b"),
        ("t,a.x,a.z\n", "`a.z` out of order"),
        ("t,ch.e,a.x,a.y\n", "after a channel"),
        ("t,a.x,a.y,a.x,a.y\n", "`a` twice"),
    ] {
        let message = csv(text).expect_err(text).to_string();
        assert!(message.contains(expected), "{text}: {message}");
    }
    let message = PoseReader::open(Path::new("nowhere/poses.jsonl"))
        .expect_err("there is no such file")
        .to_string();
    assert!(
        message.contains("nowhere/poses.jsonl: cannot be read"),
        "{message}"
    );
}

#[test]
fn every_bad_sample_is_dropped_for_its_own_reason() {
    let long = format!(
        "{{\"t\":3,\"p\":[null,null],\"x\":\"{}\"}}",
        "y".repeat(70_000)
    );
    let lines = [
        HEADER,
        r#"{"t":1.0,"p":[[0,0,0],null],"c":[1.0,0.0],"ch":{"emotion":0.4}}"#,
        r#"{"t":1.0,"p":[[0,0,0],null]}"#,
        r#"{"t":0.5,"p":[[0,0,0],null]}"#,
        r#"{"t":2.0,"p":[[0,0,0]]}"#,
        r#"{"t":2.0,"p":[[0,0,1e999],null]}"#,
        r#"{"t":2.0,"p":[[0,0,NaN],null]}"#,
        r#"{"t":2.0,"p":[[0,0],null]}"#,
        "nonsense",
        long.as_str(),
        HEADER,
        r#"{"t":4.0,"p":[null,[1,2,3]]}"#,
    ];
    let text = lines.join("\r\n");
    let mut reader = json(&text).expect("good header");
    let samples: Vec<_> = (&mut reader)
        .collect::<Result<_, _>>()
        .expect("never ten bad in a row");
    let times: Vec<f64> = samples.iter().map(|sample| sample.t).collect();
    assert_eq!(times, [1.0, 4.0]);
    assert_eq!(samples[0].channels, [Some(0.4)]);
    assert_eq!(samples[0].confidence, [1.0, 0.0]);
    assert_eq!(reader.header().channels, ["emotion"]);
    let counts = reader.counts();
    assert_eq!(
        counts.by_reason().map(|(_, count)| count),
        [1, 2, 1, 2, 2, 0, 0],
        "{counts}"
    );
}

#[test]
fn ten_bad_samples_in_a_row_name_the_first() {
    let mut text = format!("{HEADER}\n{{\"t\":0,\"p\":[null,null]}}\n");
    for _ in 0..9 {
        text.push_str("{\"t\":0,\"p\":[null,null]}\n");
    }
    let nine = json(&text)
        .expect("good header")
        .collect::<Result<Vec<_>, _>>();
    assert_eq!(nine.expect("nine may be dropped").len(), 1);
    text.push_str("rubbish\n{\"t\":9,\"p\":[null,null]}\n");
    let error = json(&text)
        .expect("good header")
        .collect::<Result<Vec<_>, _>>()
        .expect_err("ten in a row");
    match &error {
        PoseError::TooManyBad { line, fault, .. } => {
            assert_eq!(*line, 3, "{error}");
            assert_eq!(*fault, SampleFault::TimeBackwards { t: 0.0, last: 0.0 });
        }
        other => panic!("{other}"),
    }
    assert!(
        error
            .to_string()
            .starts_with("in.jsonl:3: time runs backwards"),
        "{error}"
    );
}

#[test]
fn stamps_in_milliseconds_are_refused_with_the_step_and_the_unit() {
    for (step, said) in [(9.25, "by 9.25 s"), (9250.0, "by 9250 s")] {
        let mut text = String::from("t,a.x,a.y\n");
        for k in 0..20 {
            text.push_str(&format!("{},0,0\n", step * f64::from(k)));
        }
        let error = csv(&text)
            .expect("good header")
            .collect::<Result<Vec<_>, _>>()
            .expect_err("no tracker is that slow")
            .to_string();
        assert!(
            error.starts_with("in.csv:3: time jumps ")
                && error.contains(said)
                && error.contains("t is in seconds"),
            "{error}"
        );
    }
}

#[test]
fn millimetres_and_image_points_are_read() {
    let text = "{\"handwave\":\"poses\",\"version\":1,\"points\":[\"a\"],\"dim\":2,\"unit\":\"mm\"}\n{\"t\":0,\"p\":[[10,20]]}";
    let sample = json(text)
        .expect("good header")
        .next()
        .expect("one sample")
        .expect("good sample");
    assert_eq!(sample.points, [Some([0.01, 0.02, 0.0])]);
}

#[test]
fn both_formats_give_back_what_was_written() {
    let text =
        "t,a.x,a.y,a.z,b.x,b.y,b.z,ch.mood\n0,0.1,-0.2,0.3,,,,0.5\n0.0333,0.1,0.2,0.3,1,2,3,\n";
    let mut reader = csv(text).expect("good header");
    let samples: Vec<_> = (&mut reader).collect::<Result<_, _>>().expect("good rows");
    assert_eq!(samples[0].points[1], None);
    assert_eq!(samples[0].channels, [Some(0.5)]);
    assert_eq!(samples[1].channels, [None]);
    for format in [PoseFormat::JsonLines, PoseFormat::Csv] {
        let mut writer =
            PoseWriter::new(Vec::new(), reader.header(), format, 4).expect("memory takes all");
        for sample in &samples {
            writer.write(sample).expect("memory takes all");
        }
        let bytes = writer.finish().expect("memory takes all");
        if format == PoseFormat::Csv {
            assert_eq!(String::from_utf8_lossy(&bytes), text);
        }
        let mut again = PoseReader::new(&bytes[..], format, "again").expect("good header");
        let read: Vec<_> = (&mut again)
            .collect::<Result<_, _>>()
            .expect("good samples");
        assert_eq!(read, samples);
        assert_eq!(again.header(), reader.header());
    }
}

#[test]
fn a_leap_recording_becomes_metres_and_seconds() {
    let text = r#"{"frames":[
        {"timestamp":5000000,"hands":[],"pointables":[]},
        {"timestamp":5010000,"hands":[{"id":7,"palmPosition":[10,200,-5],"confidence":1}],
         "pointables":[{"handId":7,"type":1,"tipPosition":[1,2,3]},{"handId":8,"type":0,"tipPosition":[9,9,9]}]},
        {"timestamp":5010000,"hands":[],"pointables":[]}]}"#;
    let recording = leap::parse(text, false).expect("a leap recording");
    assert_eq!(
        recording.header.points[..3],
        ["palm", "thumb_tip", "index_tip"]
    );
    assert_eq!(recording.samples.len(), 2, "equal time stamps are dropped");
    assert_eq!(recording.samples[0].points, [None; 6]);
    assert_eq!(recording.samples[1].points[0], Some([0.01, 0.2, -0.005]));
    assert_eq!(recording.samples[1].points[1], None, "another hand's thumb");
    assert!((recording.samples[1].t - 0.01).abs() < 1e-12);
    assert!(leap::parse("[]", false).is_err_and(|what| what.contains("Leap")));
}

#[test]
fn gaps_are_filled_in_a_straight_line() {
    let text = "t,a.x,a.y\n0,,\n1,1,0\n2,,\n3,3,0\n4,,\n";
    let mut reader = csv(text).expect("good header");
    let samples = (&mut reader)
        .collect::<Result<Vec<_>, _>>()
        .expect("good rows");
    let recording = Recording {
        header: reader.header().clone(),
        samples,
    };
    let filled: Vec<f64> = recording
        .filled()
        .expect("seen twice")
        .iter()
        .map(|row| row[0][0])
        .collect();
    assert_eq!(filled, [1.0, 1.0, 2.0, 3.0, 3.0]);
}

proptest! {
    #[test]
    fn no_bytes_make_the_reader_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        for (format, header) in [
            (PoseFormat::JsonLines, format!("{HEADER}\n")),
            (PoseFormat::Csv, "t,a.x,a.y\n".into()),
            (PoseFormat::Bvh, "HIERARCHY\n".into()),
        ] {
            let mut stream = header.into_bytes();
            stream.extend(&bytes);
            if let Ok(reader) = PoseReader::new(&stream[..], format, "fuzz") {
                reader.for_each(drop);
            }
            if let Ok(reader) = PoseReader::new(&bytes[..], format, "fuzz") {
                reader.for_each(drop);
            }
        }
    }

    #[test]
    fn one_wild_stamp_loses_at_most_two_samples(
        steps in proptest::collection::vec(0.001..0.1f64, 30..80),
        place in 1..30usize,
        wild in prop_oneof![
            any::<f64>().prop_filter("written as a number", |t| t.is_finite()),
            Just(1e9), Just(1e300), -1e3..0.0f64, 50.0..1e7f64,
        ],
    ) {
        let mut text = String::from("t,a.x,a.y\n");
        let mut time = 0.0;
        for (k, step) in steps.iter().enumerate() {
            time += step;
            // What lies just ahead cannot be told from a pause; what lies far off is told.
            let wrong = k == place && (wild <= time || wild > time + 30.0);
            text.push_str(&format!("{},0,0\n", if wrong { wild } else { time }));
        }
        let mut reader = csv(&text).expect("good header");
        let samples = (&mut reader).collect::<Result<Vec<_>, _>>().expect("goes on");
        prop_assert!(samples.len() + 2 >= steps.len(), "{} of {}", samples.len(), steps.len());
        prop_assert_eq!(samples.len() as u64 + reader.counts().total(), steps.len() as u64);
    }

    #[test]
    fn accepted_times_rise_whatever_comes(times in proptest::collection::vec(-1e3..1e3f64, 0..60)) {
        let mut text = String::from("t,a.x,a.y\n");
        for t in &times {
            text.push_str(&format!("{t},0,0\n"));
        }
        let accepted: Vec<f64> = csv(&text)
            .expect("good header")
            .map_while(Result::ok)
            .map(|sample| sample.t)
            .collect();
        prop_assert!(accepted.windows(2).all(|pair| pair[0] < pair[1]), "{accepted:?}");
    }
}
