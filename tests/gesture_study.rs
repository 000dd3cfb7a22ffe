//! `handwave gesture study` from end to end: bad input, files, figures that are plausible, the same
//! rows from the same seed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn handwave(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_handwave"))
        .args(args)
        .output()
        .expect("the program was built")
}

fn study(out: &Path, more: &[&str]) -> Output {
    let out = out.display().to_string();
    let output = handwave(&[&["gesture", "study", "--quick", "--out", &out], more].concat());
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{more:?}: {message}");
    output
}

/// Values by (sequence, estimator, noise, metric), at the window as shipped.
type Rows = BTreeMap<(String, String, String, String), f64>;

fn rows(csv: &str) -> Rows {
    let mut lines = csv.lines();
    assert_eq!(
        lines.next(),
        Some("sequence,estimator,noise,metric,value,unit,lambda")
    );
    let mut rows = Rows::new();
    for line in lines {
        // Only names of methods are quoted, and no quoted name holds a quote.
        let mut parts: Vec<String> = Vec::new();
        for (index, piece) in line.split('"').enumerate() {
            if index % 2 == 1 {
                parts.last_mut().expect("a cell is open").push_str(piece);
            } else {
                for (k, cell) in piece.split(',').enumerate() {
                    match parts.last_mut().filter(|_| k == 0) {
                        Some(last) => last.push_str(cell),
                        None => parts.push(cell.to_owned()),
                    }
                }
            }
        }
        let [sequence, estimator, noise, metric, value, unit, lambda] = &parts[..] else {
            panic!("{} cells in {line:?}", parts.len());
        };
        assert!(!unit.is_empty() && !metric.is_empty(), "{line}");
        let number: f64 = value.parse().expect("a number");
        assert!(!number.is_nan(), "not a number: {line}");
        let lambda: f64 = lambda.parse().expect("a number");
        assert!((0.1..=2.0).contains(&lambda), "{line}");
        if lambda == 0.6667 {
            let key = [sequence, estimator, noise, metric].map(String::clone);
            let [a, b, c, d] = key;
            let old = rows.insert((a, b, c, d), number);
            assert_eq!(old, None, "twice: {line}");
        }
    }
    rows
}

#[test]
fn bad_input_ends_with_2_and_a_reason() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("file");
    std::fs::write(&file, "in the way").expect("writable");
    let file = file.display().to_string();
    let out = folder.path().join("out").display().to_string();
    for (args, expected) in [
        (&["--quick"][..], "--out"),
        (
            &["--out", &out, "--estimators", "gobor"][..],
            "did you mean \"gabor\"?",
        ),
        (
            &["--out", &out, "--estimators", ""][..],
            "separated by commas",
        ),
        (&["--out", &out, "--seed", "x"][..], "--seed"),
        (&["--out", &file][..], "cannot be written"),
    ] {
        let output = handwave(&[&["gesture", "study"], args].concat());
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
        assert!(message.contains(expected), "{args:?}: {message}");
    }
    assert!(
        !PathBuf::from(&out).exists(),
        "a refused study made a folder"
    );
}

#[test]
fn a_quick_study_of_all_estimators_is_complete_and_plausible() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = study(folder.path(), &[]);
    let table = String::from_utf8_lossy(&output.stdout);
    assert!(table.contains("gabor (thesis)"), "{table}");
    let read = |name: &str| {
        std::fs::read_to_string(folder.path().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    };
    let report = read("report.md");
    for line in report.lines().filter(|line| line.starts_with("![")) {
        let plot = line.split(['(', ')']).nth(1).expect("a link");
        let svg = read(plot);
        assert!(
            svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"),
            "{plot} is no SVG"
        );
        for word in ["NaN", "inf\""] {
            assert!(
                !svg.contains(word),
                "{plot} has coordinates that are {word}"
            );
        }
    }
    let plots = report.matches(".svg)").count();
    let expected = if cfg!(feature = "plot") { 6 } else { 0 };
    assert_eq!(plots, expected, "plots in the report");
    let csv = read("study.csv");
    repeats(&csv);
    let rows = rows(&csv);
    let value = |sequence: &str, estimator: &str, noise: &str, metric: &str| {
        let key = [sequence, estimator, noise, metric].map(String::from);
        let [a, b, c, d] = key;
        *rows
            .get(&(a, b, c, d))
            .unwrap_or_else(|| panic!("no row {sequence},{estimator},{noise},{metric}"))
    };
    // The thesis's estimator, whose figures are known from elsewhere.
    for (sequence, noise, metric, low, high) in [
        (
            "frequency-step-loop",
            "0.0300",
            "frequency_settling",
            0.3,
            1.5,
        ),
        (
            "amplitude-step-loop",
            "0.0300",
            "amplitude_settling",
            0.6,
            2.0,
        ),
        (
            "frequency-step-loop",
            "0.0300",
            "steady_frequency_error",
            1e-4,
            0.03,
        ),
        (
            "frequency-step-loop",
            "0.0300",
            "steady_amplitude_error",
            1e-4,
            0.03,
        ),
        ("noise-sweep", "0.1000", "steady_phase_error", 0.1, 10.0),
        ("tempo-ramp", "0.0300", "frequency_delay", 0.2, 1.2),
        ("pure-noise-60hz", "0.3000", "share_above_0.2", 0.0, 0.1),
        ("onset-release", "0.0300", "onset_to_0.2", 0.02, 1.0),
        ("onset-release", "0.0300", "activations", 1.0, 1.0),
        ("held-pose", "0.0000", "held_amplitude", 0.0, 0.01),
        (
            "opposite-sense",
            "0.0000",
            "steady_frequency_error",
            0.0,
            0.05,
        ),
        (
            "shared-joints-one",
            "0.0300",
            "interference_largest",
            0.0,
            0.1,
        ),
        (
            "shared-joints-other",
            "0.0300",
            "interference_largest",
            0.0,
            0.1,
        ),
        ("gap", "0.0300", "least_amplitude", 0.8, 1.05),
        ("recorded-hand", "0.0000", "frequency_error", 0.0, 0.2),
    ] {
        let found = value(sequence, "gabor", noise, metric);
        assert!(
            (low..=high).contains(&found),
            "gabor, {sequence}, noise {noise}: {metric} is {found}, expected {low} to {high}"
        );
    }
    // Figure 9.15: waves keep apart what shares joints; cross-correlation does not.
    let during = |method: &str, metric: &str| value("figure-9.15", method, "0.0000", metric);
    for metric in ["mean_thumb_during_hand", "mean_hand_during_thumb"] {
        let (waves, correlation) = (
            during("waves (gabor)", metric),
            during("cross-correlation", metric),
        );
        assert!(waves < 0.1, "waves: {metric} is {waves}");
        assert!(
            correlation > 0.3,
            "cross-correlation: {metric} is {correlation}"
        );
    }
    for gesture in ["thumb", "hand"] {
        for method in [
            "waves (gabor)",
            "cross-correlation",
            "cross-correlation, size",
            "svm",
        ] {
            let found = during(method, &format!("detected_{gesture}_during_{gesture}"));
            assert!(
                found > 0.9,
                "{method} finds {gesture} in {found} of its time"
            );
        }
        let both = during(
            "waves (gabor)",
            &format!("detected_{gesture}_during_thumb+hand"),
        );
        assert!(
            both > 0.9,
            "waves find {gesture} in {both} of the time of both"
        );
    }
}

/// The rows of one estimator do not depend on which others are studied, and come out the same from
/// the same seed; `csv` is the study of all from seed 1.
fn repeats(csv: &str) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let run = |seed: &str| {
        let out = folder.path().join(seed);
        let output = study(&out, &["--estimators", "direct", "--seed", seed, "--json"]);
        let csv = std::fs::read_to_string(out.join("study.csv")).expect("written");
        let json = String::from_utf8_lossy(&output.stdout).into_owned();
        for line in json.lines() {
            let row: serde_json::Value = serde_json::from_str(line).expect("JSON Lines");
            assert!(
                row["sequence"].is_string() && row["lambda"].is_number(),
                "{line}"
            );
        }
        assert_eq!(json.lines().count(), csv.lines().count() - 1, "JSON rows");
        csv
    };
    let of_direct = |csv: &str| -> Vec<String> {
        let lines = csv.lines().filter(|line| line.contains(",direct,"));
        lines.map(String::from).collect()
    };
    let (all, alone) = (of_direct(csv), of_direct(&run("1")));
    assert!(all.len() > 50, "only {} rows of one estimator", all.len());
    assert!(all == alone, "the same seed gave other figures");
    assert!(
        all != of_direct(&run("2")),
        "another seed gave the same figures"
    );
}
