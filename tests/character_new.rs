//! `handwave character new`: from the URDF of a legged robot to a run that no limit holds back.

mod gait_support;
mod support;

use gait_support::{STRANGERS, stranger};
use support::data::shared_data;
use support::folder::Folder;
use support::program::{handwave, refused, run_virtual};

fn bundled(name: &str) -> String {
    format!("{}/configs/robots/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// The part of the recorded performance from `from` to `to` seconds: its file in `folder`.
fn excerpt(folder: &Folder, from: f64, to: f64) -> String {
    let path = "configs/performances/drum_and_splay.jsonl";
    let path = format!("{}/{path}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).expect("the bundled performance");
    let time = |line: &str| -> Option<f64> {
        let rest = line.strip_prefix("{\"t\":")?;
        rest.split(',').next()?.parse().ok()
    };
    let part: Vec<&str> = (text.lines())
        .filter(|line| time(line).is_none_or(|t| (from..to).contains(&t)))
        .collect();
    assert!(part.len() > 100, "{} samples", part.len());
    folder.write("excerpt.jsonl", &(part.join("\n") + "\n"))
}

/// Splayed twice: a bow or a greeting, and back; seconds of the performance.
const BOWING: (f64, f64) = (34.0, 44.0);
/// Drumming with the hand turned to either side, where legs are quickest.
const TURNING: (f64, f64) = (78.0, 90.0);
/// The hand is pushed away.
const SITTING: (f64, f64) = (94.0, 100.0);

/// Makes a character; its folder.
#[track_caller]
fn makes(urdf: &str, more: &[&str]) -> Folder {
    let folder = Folder::empty();
    let out = folder.text("beast");
    let args = ["character", "new", "--urdf", urdf, "--out", &out];
    let made = handwave(&[&args, more].concat()).expect(0);
    let next = format!("handwave run {}", folder.text("beast/beast.toml"));
    assert!(made.out.contains(&next), "{}", made.out);
    folder
}

/// Plays a part of the performance with at least so many transitions, inside all limits.
#[track_caller]
fn plays(folder: &Folder, config: &str, (from, to): (f64, f64), transitions: u64) {
    let input = format!("file:{}", excerpt(folder, from, to));
    let summary = run_virtual(&[config, "--json", "--input", &input])
        .expect(0)
        .json();
    let what = format!("{config}, {from}..{to} s: {summary}");
    assert_eq!(summary["envelope_cycles"], 0, "{what}");
    assert_eq!(summary["overruns"], 0, "{what}");
    assert!(
        summary["transitions"].as_u64() >= Some(transitions),
        "{what}"
    );
}

#[test]
fn a_quadruped_becomes_a_character_that_bows_and_turns() {
    let folder = makes(&bundled("pup.urdf"), &[]);
    let text = folder.read("beast/beast.toml");
    for part in [
        "name = \"turn\", channel = \"yaw\"",
        "trot_long_left.json",
        "name = \"z\"",
    ] {
        assert!(text.contains(part), "{part} is missing: {text}");
    }
    let config = folder.text("beast/beast.toml");
    plays(&folder, &config, BOWING, 1);
    handwave(&["graph", "check", &config]).expect(0);
}

#[test]
fn a_hexapod_becomes_a_character_and_its_clips_can_be_made_again() {
    let folder = makes(&bundled("phantomx.urdf"), &["--max-velocity", "4"]);
    let text = folder.read("beast/beast.toml");
    assert!(
        text.contains("greet.json") && !text.contains("sit.json"),
        "{text}"
    );
    plays(&folder, &folder.text("beast/beast.toml"), BOWING, 1);
    // A description can be changed and made again as the head of the configuration says.
    let urdf = folder.text("beast/robots/beast.urdf");
    let (toml, json) = ("beast/clips/greet.toml", "beast/clips/greet.json");
    let before = folder.read(json);
    let (toml, json) = (folder.text(toml), folder.text(json));
    handwave(&[
        "clip", "gait", "--urdf", &urdf, "--gait", &toml, "--out", &json,
    ])
    .expect(0);
    assert_eq!(folder.read("beast/clips/greet.json"), before);
}

#[test]
fn robots_of_others_become_characters() {
    for (name, _, velocity) in STRANGERS {
        let Some(path) = stranger(name) else { continue };
        let urdf = path.to_str().expect("a plain path");
        let velocity = velocity.to_string();
        let more = ["--max-velocity", velocity.as_str()];
        let folder = makes(urdf, if name == "solo12" { &more } else { &[] });
        // The long-legged one is the first to reach a limit; another one sits. All take too long here.
        let config = folder.text("beast/beast.toml");
        match name {
            "solo12" => plays(&folder, &config, TURNING, 0),
            "anymal_b" => plays(&folder, &config, SITTING, 1),
            _ => {}
        }
    }
}

#[test]
fn feet_without_links_of_their_own_get_them() {
    let Some(path) = shared_data("robots/phantomx/phantomx.urdf") else {
        return;
    };
    let folder = makes(path.to_str().expect("a plain path"), &[]);
    let urdf = folder.read("beast/robots/beast.urdf");
    assert!(urdf.contains("front_left_foot"), "{urdf}");
}

#[test]
fn the_shipped_hexapod_greets_inside_its_limits() {
    let config = format!("{}/configs/hexapod.toml", env!("CARGO_MANIFEST_DIR"));
    plays(&Folder::empty(), &config, BOWING, 1);
}

#[test]
fn what_cannot_be_made_is_refused_and_nothing_is_overwritten() {
    let folder = Folder::empty();
    let (pup, arm) = (bundled("pup.urdf"), bundled("open_manipulator_x.urdf"));
    let new = |urdf: &str, out: &str, more: &[&str]| {
        let args = ["character", "new", "--urdf", urdf, "--out", out];
        handwave(&[&args, more].concat())
    };
    refused(
        new(&arm, &folder.text("a"), &[]),
        2,
        &["cannot find four or six legs"],
    );
    refused(
        new(&pup, &folder.text("my dog"), &[]),
        2,
        &["letters, digits"],
    );
    refused(
        new(&pup, &folder.text(""), &["--name", "../x"]),
        2,
        &["letters, digits"],
    );
    refused(
        new("none.urdf", &folder.text("b"), &[]),
        2,
        &["cannot read none.urdf"],
    );
    folder.write("kept.txt", "mine");
    refused(
        new(&pup, &folder.text(""), &["--name", "x"]),
        2,
        &["nothing is overwritten"],
    );
    assert_eq!(folder.read("kept.txt"), "mine");
    if let Some(path) = stranger("solo12") {
        let urdf = path.to_str().expect("a plain path");
        refused(
            new(urdf, &folder.text("solo"), &[]),
            2,
            &["--max-velocity 4.7"],
        );
    }
}
