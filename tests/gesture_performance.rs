//! The bundled performance: made again byte for byte, and read as it was meant.

use handwave::gesture::{
    CyclicMarks, FrontEnd, FrontEndOptions, GestureSet, NonCyclicMarks, define_cyclic,
    define_non_cyclic,
};
use handwave::pose::{Recording, compose};
use std::path::{Path, PathBuf};

fn configs(part: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("configs")
        .join(part)
}

fn read(part: &str) -> Recording {
    Recording::read(&configs(part)).expect("bundled").0
}

#[test]
fn the_recipe_makes_the_same_bytes() {
    let made = compose::compose(&configs("performances/drum_and_splay.toml")).expect("recipe");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("made.jsonl");
    made.write(&path).expect("writable");
    let made = std::fs::read(&path).expect("just written");
    let bundled = std::fs::read(configs("performances/drum_and_splay.jsonl")).expect("bundled");
    assert!(
        made == bundled,
        "compose drum_and_splay.toml again and commit the result"
    );
}

#[test]
fn the_marks_make_the_same_gesture_file() {
    let (waiting, splay) = (
        read("performances/waiting.csv"),
        read("performances/splay.csv"),
    );
    let mut set = GestureSet::new(&waiting.header, Vec::new());
    let marks = CyclicMarks {
        start_s: 0.5,
        end_s: None,
    };
    let drum = define_cyclic(&set, &waiting, "drum", "waiting.csv from 0.5 s", marks);
    set.put(drum.expect("drumming repeats").gesture);
    // The file keeps four and five decimals: what the second definition starts from.
    let mut set = GestureSet::from_toml(&set.to_toml(), "hand.toml").expect("just written");
    let marks = NonCyclicMarks {
        rest_s: 0.62,
        extreme_s: 0.95,
    };
    let source = "splay.csv, rest 0.62 s, extreme 0.95 s";
    let spread = define_non_cyclic(&set, &splay, "splay", source, marks);
    set.put(spread.expect("the fingers spread").gesture);
    let bundled = std::fs::read_to_string(configs("gestures/hand.toml")).expect("bundled");
    assert!(
        set.to_toml() == bundled,
        "define the gestures again and commit the result"
    );
}

#[test]
fn the_performance_is_read_as_it_was_meant() {
    let set = GestureSet::load(&configs("gestures/hand.toml")).expect("bundled");
    let performance = read("performances/drum_and_splay.jsonl");
    let options = FrontEndOptions::default();
    let mut front = FrontEnd::new(&set, &performance.header, options).expect("same points");
    let mut rows = Vec::new();
    for sample in &performance.samples {
        front.push(sample).expect("good sample");
        let [drum, splay] = front.estimates() else {
            panic!("two gestures");
        };
        rows.push((sample.t, *drum, *splay));
    }
    let between = |from: f64, to: f64| rows.iter().filter(move |row| row.0 >= from && row.0 < to);
    for (from, to, hz, size) in [
        (7.0, 11.5, 0.7, 0.7),
        (14.0, 19.5, 0.952, 1.0),
        (22.0, 27.5, 1.5, 0.9),
        (29.5, 33.5, 1.9, 0.7),
        (49.5, 52.7, 1.1, 1.0),
    ] {
        let count = between(from, to).count() as f64;
        let mean_hz = between(from, to).map(|row| row.1.frequency_hz).sum::<f64>() / count;
        let mean = between(from, to).map(|row| row.1.amplitude).sum::<f64>() / count;
        let splay = between(from, to)
            .map(|row| row.2.amplitude.abs())
            .fold(0.0, f64::max);
        println!(
            "{hz} Hz size {size}: {mean_hz:.3} Hz, amplitude {mean:.3}, splay up to {splay:.3}"
        );
        assert!(
            (mean_hz / hz - 1.0).abs() < 0.03,
            "{mean_hz:.3} Hz instead of {hz}"
        );
        assert!(
            (mean - size).abs() < 0.06,
            "amplitude {mean:.3} instead of {size}"
        );
        assert!(splay < 0.15, "splay {splay:.3} while drumming at {hz} Hz");
        let phases: Vec<f64> = between(from, to).map(|row| row.1.phase_rad).collect();
        let back = phases
            .windows(2)
            .map(|pair| handwave::base::wrap_pi(pair[1] - pair[0]))
            .fold(f64::INFINITY, f64::min);
        assert!(back >= 0.0, "phase ran back by {back:.4} rad at {hz} Hz");
    }
    for (from, to) in [(0.0, 3.5), (35.0, 46.7), (54.5, 56.0)] {
        let drum = between(from, to)
            .map(|row| row.1.amplitude)
            .fold(0.0, f64::max);
        println!("{from} to {to} s: drum up to {drum:.3}");
        assert!(
            drum < 0.12,
            "drum amplitude {drum:.3} between {from} and {to} s"
        );
    }
    let held = between(40.5, 42.8).map(|row| row.2.amplitude);
    let (low, high) = held.fold((f64::MAX, f64::MIN), |(l, h), z| (l.min(z), h.max(z)));
    assert!(
        low > 0.9 && high < 1.1,
        "held spread reads {low:.3} to {high:.3}"
    );
}
