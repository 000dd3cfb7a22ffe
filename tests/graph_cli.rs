//! `handwave graph` as users call it.

mod support;

use std::collections::BTreeMap;
use std::path::Path;
use support::program::Ended;

fn config(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    folder.join(name).display().to_string()
}

fn handwave(args: &[&str], code: i32) -> Ended {
    support::program::handwave(args).expect(code)
}

/// The quadruped's files with its graph changed by `change`, in a folder of its own.
fn changed(change: impl Fn(&str) -> String) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    for part in ["robots", "clips", "gestures", "performances"] {
        let link = folder.path().join(part);
        std::os::unix::fs::symlink(configs.join(part), link).expect("a link");
    }
    let text = std::fs::read_to_string(configs.join("quadruped.toml")).expect("bundled");
    let path = folder.path().join("changed.toml");
    std::fs::write(&path, change(&text)).expect("writable");
    (folder, path.display().to_string())
}

#[test]
fn bad_usage_and_bad_input_end_with_2_and_a_reason() {
    for (args, expected) in [
        (&["graph", "study", "--parameters", "4"][..], "1..=3"),
        (&["graph", "study", "--requests", "0"], "--requests"),
        (
            &["graph", "check", "--s-min", "2"],
            "--s-min 2 must lie in 0..1",
        ),
        (&["graph", "check", "--far-mm", "nan"], "--far-mm"),
        (&["graph", "check", "/no/such.toml"], "/no/such.toml"),
        (&["graph", "show", "--out", "graph.png"], ".svg"),
        (&["graph", "study", &config("arm.toml")], "maps poses"),
    ] {
        let ended = handwave(args, 2);
        assert!(ended.err.contains(expected), "{args:?}: {}", ended.err);
    }
}

#[test]
fn the_study_has_a_row_for_every_method_and_searching_online_wins() {
    let args = [
        "graph",
        "study",
        "--requests",
        "12",
        "--seed",
        "7",
        "--json",
    ];
    let ended = handwave(&args, 0);
    assert!(
        ended.err.contains("walk_long") && ended.err.contains("trot_long"),
        "{}",
        ended.err
    );
    let mut rows = BTreeMap::new();
    for line in ended.out.lines() {
        let row: serde_json::Value = serde_json::from_str(line).expect("a JSON object a line");
        let keys: Vec<&str> = row
            .as_object()
            .expect("object")
            .keys()
            .map(String::as_str)
            .collect();
        let mut expected = ["method", "cost", "e_s", "latency_s", "time_us"];
        expected.sort_unstable();
        assert_eq!(keys, expected);
        let value = |key: &str| row[key].as_f64().expect("a number");
        assert!(value("time_us") > 0.0);
        let method = row["method"].as_str().expect("a name").to_owned();
        rows.insert(method, (value("cost"), value("e_s"), value("latency_s")));
    }
    let stored = ["stored-1", "stored-5", "stored-10"];
    let methods = [
        "online-3",
        "online-5",
        "online-10",
        "online-12",
        "exhaustive-10",
    ];
    assert_eq!(rows.len(), stored.len() + methods.len());
    let (online, all) = (rows["online-10"], rows["exhaustive-10"]);
    assert!(
        (online.0 - all.0).abs() < 1e-9 * all.0,
        "online {online:?}, all pairs {all:?}"
    );
    for pair in methods[..4].windows(2) {
        let (shallow, deep) = (rows[pair[0]].0, rows[pair[1]].0);
        assert!(deep <= shallow + 1e-9, "{pair:?}: {shallow} and {deep}");
    }
    for method in stored {
        assert!(
            online.0 <= rows[method].0,
            "{method}: {:?}, online {online:?}",
            rows[method]
        );
    }
    let mean = stored.map(|m| rows[m].2).iter().sum::<f64>() / 3.0;
    assert!(
        online.2 < mean,
        "latency online {} s, stored {mean} s",
        online.2
    );
    // The same seed gives the same requests.
    let again = handwave(&args, 0);
    let costs = |text: &str| -> Vec<f64> {
        let rows = text
            .lines()
            .map(|l| serde_json::from_str::<serde_json::Value>(l).expect("row"));
        rows.map(|row| row["cost"].as_f64().expect("a number"))
            .collect()
    };
    assert_eq!(costs(&ended.out), costs(&again.out));
}

#[test]
fn the_study_draws_and_writes_a_table() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("study").display().to_string();
    let ended = handwave(&["graph", "study", "--requests", "4", "--out", &out], 0);
    assert!(
        ended.out.contains("online-10 and exhaustive-10 differ by"),
        "{}",
        ended.out
    );
    let csv = std::fs::read_to_string(Path::new(&out).join("study.csv")).expect("written");
    assert_eq!(csv.lines().count(), 9, "{csv}");
    if cfg!(feature = "plot") {
        let svg = std::fs::read_to_string(Path::new(&out).join("study.svg")).expect("written");
        assert!(svg.contains("<svg") && svg.contains("stored-10"));
    }
}

#[test]
fn the_graph_is_shown_as_text_and_as_pictures() {
    let text = handwave(&["graph", "show"], 0).out;
    for expected in [
        "locomotion  (start)",
        "trot_long: amplitude 1, 1.7 Hz",
        "-> bow",
    ] {
        assert!(text.contains(expected), "{expected:?} is not in {text}");
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("pup.svg");
    handwave(&["graph", "show", "--out", &out.display().to_string()], 0);
    let svg = std::fs::read_to_string(&out).expect("written");
    assert!(svg.contains("locomotion") && svg.contains("bow"), "{svg}");
    let edges = folder.path().join("pup_edges");
    for name in ["locomotion_to_bow.svg", "bow_to_locomotion.svg"] {
        let svg = std::fs::read_to_string(edges.join(name)).expect("written");
        assert!(
            svg.contains("progression 0 to 1") && svg.contains("trot_short"),
            "{name}"
        );
        assert!(!svg.contains("NaN"), "{name}");
    }
}

#[test]
fn the_bundled_characters_pass_the_check() {
    for name in ["quadruped.toml", "face.toml", "arm.toml"] {
        let summary = handwave(&["graph", "check", &config(name), "--json"], 0).json();
        assert_eq!(summary["ok"], true, "{name}: {summary}");
        assert_eq!(
            summary["broken"].as_array().map(Vec::len),
            Some(0),
            "{name}: {summary}"
        );
    }
    let summary = handwave(&["graph", "check", "--json"], 0).json();
    // The bow begins as the quadruped stands.
    let best = summary["edges"][0]["best_similarity"]
        .as_f64()
        .expect("a number");
    assert!(best > 0.99, "{summary}");
}

#[test]
fn a_graph_that_cannot_be_walked_is_named() {
    let edges = |list: &str| {
        let list = list.to_owned();
        move |text: &str| {
            text.replace(
                "start = \"locomotion\"",
                &format!("edges = [{list}]\nstart = \"locomotion\""),
            )
        }
    };
    let (_folder, path) = changed(edges(""));
    let ended = handwave(&["graph", "check", &path], 2);
    assert!(
        ended.err.contains("\"bow\" is never played"),
        "{}",
        ended.err
    );
    let (_folder, path) = changed(edges("[\"locomotion\", \"bow\"]"));
    let ended = handwave(&["graph", "check", &path], 2);
    assert!(ended.err.contains("\"bow\" is a dead end"), "{}", ended.err);
    let ended = handwave(&["graph", "check", &path, "--json"], 2);
    let summary: serde_json::Value = serde_json::from_str(&ended.out).expect("one object");
    let kinds: Vec<&serde_json::Value> = summary["broken"]
        .as_array()
        .expect("a list")
        .iter()
        .map(|b| &b["kind"])
        .collect();
    assert_eq!(
        kinds,
        ["unreachable", "unreachable", "unreachable", "dead_end"],
        "{summary}"
    );
}

#[test]
fn what_will_not_look_good_is_a_warning_with_figures() {
    // From walking without a clip at rest to a deep bow: nothing is alike within a millimetre.
    let ended = handwave(&["graph", "check", "--s-min", "1", "--far-mm", "0.001"], 0);
    assert!(
        ended.err.contains("locomotion -> bow") && ended.err.contains("mm apart"),
        "{}",
        ended.err
    );
    let (_folder, path) = changed(|text| {
        text.replace(
            "trot_long.json\",        amplitude = 1.0, frequency_hz = 1.7",
            "trot_long.json\",        amplitude = 1.5, frequency_hz = 9.0",
        )
    });
    let summary = handwave(&["graph", "check", &path, "--json"], 0).json();
    let kinds: Vec<&str> = summary["warnings"]
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|w| w["kind"].as_str())
        .collect();
    assert_eq!(kinds, ["out_of_reach", "out_of_reach"], "{summary}");
}
