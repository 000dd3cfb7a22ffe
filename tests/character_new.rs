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

/// Makes a character and plays the performance: 25 s are walking and trotting, 45 s bowing too.
#[track_caller]
fn makes_and_plays(urdf: &str, more: &[&str], seconds: &str) -> Folder {
    let folder = Folder::empty();
    let out = folder.text("beast");
    let args = ["character", "new", "--urdf", urdf, "--out", &out];
    let made = handwave(&[&args, more].concat()).expect(0);
    let config = folder.text("beast/beast.toml");
    assert!(
        made.out.contains(&format!("handwave run {config}")),
        "{}",
        made.out
    );
    let summary = run_virtual(&[&config, "--json", "--duration", seconds])
        .expect(0)
        .json();
    assert_eq!(summary["envelope_cycles"], 0, "{urdf}: {summary}");
    assert!(
        summary["transitions"].as_u64() >= Some(1),
        "{urdf}: {summary}"
    );
    folder
}

#[test]
fn the_bundled_robots_become_characters() {
    makes_and_plays(&bundled("pup.urdf"), &[], "25");
    let folder = makes_and_plays(&bundled("phantomx.urdf"), &["--max-velocity", "4"], "45");
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
        makes_and_plays(urdf, if name == "solo12" { &more } else { &[] }, "25");
    }
    if let Some(path) = shared_data("robots/phantomx/phantomx.urdf") {
        let folder = makes_and_plays(path.to_str().expect("a plain path"), &[], "25");
        let urdf = folder.read("beast/robots/beast.urdf");
        assert!(
            urdf.contains("front_left_foot"),
            "feet have links of their own"
        );
    }
}

#[test]
fn the_shipped_hexapod_plays_its_performance_inside_its_limits() {
    let config = format!("{}/configs/hexapod.toml", env!("CARGO_MANIFEST_DIR"));
    let summary = run_virtual(&[&config, "--json"]).expect(0).json();
    assert_eq!(summary["envelope_cycles"], 0, "{summary}");
    assert_eq!(summary["overruns"], 0, "{summary}");
    assert_eq!(summary["transitions"], 2, "{summary}");
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
