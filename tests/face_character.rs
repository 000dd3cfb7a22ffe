//! The quadruped played by a recorded face: its parts are made as documented, and the face moves it.

mod support;

use handwave::config::{self, Character, Files};
use handwave::pose::Recording;
use std::path::{Path, PathBuf};
use support::character::{Player, RATE_HZ, performance};
use support::data::shared_data;
use support::folder::Folder;
use support::limits::LimitWatch;
use support::program::{handwave, run_virtual};

fn configs(part: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("configs")
        .join(part)
}

fn face() -> Character {
    config::load(Files::Folder(configs("")), "face.toml").expect("a good configuration")
}

const CHANNELS: &str = "JawOpen,MouthSmileLeft,MouthSmileRight,MouthFrownLeft,MouthFrownRight,BrowInnerUp,BrowDownLeft,BrowDownRight,EyeBlinkLeft,EyeBlinkRight";

#[test]
fn the_bundled_face_is_the_stretch_of_the_recording_that_it_is_said_to_be() {
    let Some(raw) = shared_data("face/alex_rom_3.csv") else {
        return;
    };
    let folder = Folder::empty();
    let (raw, out) = (raw.display().to_string(), folder.text("face.csv"));
    let args = [
        "poses",
        "import",
        &raw,
        "--from",
        "116",
        "--to",
        "134",
        "--channels",
        CHANNELS,
        "--out",
        &out,
    ];
    handwave(&args).expect(0);
    let bundled = std::fs::read_to_string(configs("performances/face.csv")).expect("bundled");
    assert!(
        folder.read("face.csv") == bundled,
        "the bundled face is another"
    );
}

#[test]
fn the_bundled_gestures_of_the_face_are_made_by_the_documented_commands() {
    let folder = Folder::empty();
    let face = configs("performances/face.csv").display().to_string();
    let (points, into) = (folder.text("face_points.csv"), folder.text("face.toml"));
    let names = "JawOpen,MouthSmileLeft,MouthSmileRight";
    handwave(&[
        "poses",
        "import",
        &face,
        "--as-points",
        names,
        "--out",
        &points,
    ])
    .expect(0);
    for (name, rest, extreme) in [("smile", "12.5", "13.3"), ("open", "10.4", "11")] {
        let marks = ["--rest", rest, "--extreme", extreme, "--into", &into];
        let define = ["gesture", "define", "--poses", &points, "--name", name];
        handwave(&[&define[..], &marks].concat()).expect(0);
    }
    let bundled = std::fs::read_to_string(configs("gestures/face.toml")).expect("bundled");
    assert!(
        folder.read("face.toml") == bundled,
        "the bundled gestures are others"
    );
}

#[test]
fn a_smile_bows_it_an_open_mouth_lowers_it_and_a_frown_turns_it() {
    let character = face();
    let (header, samples) = performance(&character);
    assert!(
        header.points.is_empty(),
        "a face is a stream of channels alone"
    );
    let column = |name: &str| {
        header
            .channels
            .iter()
            .position(|c| c == name)
            .expect("there")
    };
    let (jaw, smile, frown) = (
        column("JawOpen"),
        column("MouthSmileLeft"),
        column("MouthFrownLeft"),
    );
    let begins_s = character.safety.ramp_s + 0.005;
    let start = samples[0].t;
    let mut player = Player::new(&character, begins_s);
    let mut watch = LimitWatch::new(&character.limits, 1.0 / RATE_HZ);
    let (mut smiling, mut straight, mut held_back) = (Vec::new(), Vec::new(), 0);
    let (mut turned, mut kept) = (Vec::new(), Vec::new());
    let (mut lowered, mut level) = (Vec::new(), Vec::new());
    while player.t_s() < player.ends_s() {
        player.step(true);
        watch
            .see(player.positions())
            .expect("targets inside the limits");
        held_back += usize::from(player.puppet.targets().held_back > 0);
        let t = player.t_s() - begins_s;
        // What the face does now and did for the last 0.4 s: the robot needs time to follow.
        let recent: Vec<_> = samples
            .iter()
            .filter(|sample| (t - 0.4..=t).contains(&(sample.t - start)))
            .collect();
        let least = |column: usize| {
            let values = recent.iter().map(|s| s.channels[column].unwrap_or(0.0));
            values.fold(f64::INFINITY, f64::min)
        };
        let most = |column: usize| {
            let values = recent.iter().map(|s| s.channels[column].unwrap_or(0.0));
            values.fold(0.0, f64::max)
        };
        if t < 0.4 {
            continue;
        }
        let animator = player.puppet.animator();
        let bow = animator.played()[0].amplitude;
        let [crouch, turn] = [0, 1].map(|layer| animator.layers()[layer].weight());
        if least(smile) > 0.75 {
            smiling.push(bow);
            kept.push(turn.abs());
        } else if most(smile) < 0.05 && most(jaw) < 0.15 {
            straight.push(bow);
        }
        if least(frown) > 0.45 && most(smile) < 0.05 {
            turned.push(turn.abs());
        }
        if least(jaw) > 0.7 {
            lowered.push(crouch);
        } else if most(jaw) < 0.15 {
            level.push(crouch);
        }
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    assert!(
        smiling.len() > 100 && straight.len() > 100,
        "{} {}",
        smiling.len(),
        straight.len()
    );
    assert!(
        mean(&smiling) > 0.8,
        "bows by {:.2} at a smile",
        mean(&smiling)
    );
    assert!(
        mean(&straight) < 0.1,
        "bows by {:.2} with a straight face",
        mean(&straight)
    );
    let (turned, kept) = (mean(&turned), mean(&kept));
    assert!(turned > 0.5, "turns by {turned:.2} at a frown");
    assert!(kept < 0.05, "turns by {kept:.2} at a smile");
    let (lowered, level) = (mean(&lowered), mean(&level));
    assert!(lowered > 0.5, "lowers by {lowered:.2} at an open mouth");
    assert!(level < 0.15, "lowers by {level:.2} at a closed one");
    assert_eq!(held_back, 0, "cycles in which the envelope acted");
}

#[test]
fn the_face_plays_to_its_end_in_the_program() {
    let config = configs("face.toml").display().to_string();
    let ended = run_virtual(&[&config, "--json"]).expect(0);
    let summary = ended.json();
    assert_eq!(summary["ending"], "performance complete");
    assert_eq!(summary["envelope_cycles"], 0, "{}", ended.out);
    let face = configs("performances/face.csv").display().to_string();
    let info = handwave(&["poses", "info", &face, "--json"])
        .expect(0)
        .json();
    assert_eq!(info["channels"][0], "JawOpen");
    let most = info["channel_values"][0]["max"].as_f64().expect("a number");
    assert!((0.85..=1.0).contains(&most), "the mouth opens to {most}");
    let (recording, _) = Recording::read(&configs("performances/face.csv")).expect("bundled");
    assert_eq!(summary["samples"], recording.samples.len());
    // A hand's gestures over a face: said by name, before anything moves.
    let hand = configs("quadruped.toml").display().to_string();
    let face = format!("file:{}", configs("performances/face.csv").display());
    let ended = run_virtual(&[&hand, "--input", &face]).expect(2);
    assert!(ended.err.contains("no point palm"), "{}", ended.err);
}
