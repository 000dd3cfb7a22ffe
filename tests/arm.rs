//! The shipped arm: led by the dancer's hands through a pose map, and every shipped character played.

mod support;

use handwave::config::Character;
use handwave::pose::PoseSample;
use handwave::puppet::Stage;
use support::character::{Player, RATE_HZ, performance, shipped};
use support::data::shared_data;
use support::folder::Folder;
use support::limits::LimitWatch;
use support::program::{handwave, refused, run_virtual};
use support::targets::Targets;

const JOINTS: [&str; 5] = ["joint1", "joint2", "joint3", "joint4", "gripper"];

fn arm() -> Character {
    let mut all = shipped();
    let at = all.iter().position(|(name, _)| name == "arm.toml");
    all.swap_remove(at.expect("configs/arm.toml")).1
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let sum =
        |f: fn(f64, f64) -> f64| -> f64 { a.iter().zip(b).map(|(a, b)| f(a - ma, b - mb)).sum() };
    sum(|a, b| a * b) / (sum(|a, _| a * a) * sum(|_, b| b * b)).sqrt()
}

/// A coordinate of a hand against the head at time `t`, held between samples.
fn hand(samples: &[PoseSample], point: usize, axis: usize, t: f64) -> f64 {
    let at = samples.partition_point(|s| s.t <= t).max(1) - 1;
    let place = |point: usize| samples[at].points[point].expect("seen")[axis];
    place(point) - place(0)
}

#[test]
fn a_broken_map_or_class_is_refused_with_file_and_key() {
    let folder = Folder::of_configs();
    let check = |file: &str, from: &str, to: &str, parts: &[&str]| {
        let before = folder.read(file);
        folder.edit(file, from, to);
        let played = if file == "quadruped.toml" {
            file
        } else {
            "arm.toml"
        };
        refused(run_virtual(&[&folder.text(played)]), 2, parts);
        folder.write(file, &before);
    };
    let map = "maps/arm.toml";
    check(map, "spread_m", "spred_m", &["maps/arm.toml", "spred_m"]);
    check(map, "version = 1", "version = 7", &["version", "found 7"]);
    check(map, "\"joint3\"", "\"joint33\"", &["joint33"]);
    check(
        map,
        "\"gripper\" = ",
        "\"griper\" = ",
        &["griper", "did you mean \"gripper\"?"],
    );
    check(
        map,
        "anchor = \"head\"",
        "anchor = \"hed\"",
        &["source.global.anchor", "hed"],
    );
    check(
        map,
        "\"right\"",
        "\"foot\"",
        &["no point foot", "map learn"],
    );
    check(
        map,
        "smoothing_s = 0.1",
        "smoothing_s = -1.0",
        &["options.smoothing_s", "-1"],
    );
    check(
        map,
        "\"joint1\" = -0.55",
        "\"joint1\" = -2.95",
        &["pair 1", "outside its limits"],
    );
    let config = "arm.toml";
    check(
        config,
        "maps/arm.toml\"",
        "maps/leg.toml\"",
        &["arm.toml:", "class.map", "leg.toml"],
    );
    check(
        config,
        "map = \"maps/arm.toml\"",
        "",
        &["arm.toml", "no gesture file", "a class with `map`"],
    );
    check(
        "quadruped.toml",
        "gesture = \"drum\"\n",
        "",
        &["class.gesture", "needs a gesture"],
    );
    check(
        config,
        "map = \"maps/arm.toml\"",
        "map = \"maps/arm.toml\"\nclip = [{ file = \"clips/arm_reach.json\" }]",
        &["class.map", "not both"],
    );
}

#[test]
fn the_arm_follows_the_dancer() {
    let character = arm();
    let folder = Folder::empty();
    let file = folder.text("targets.csv");
    let ended = run_virtual(&["configs/arm.toml", "--targets", &file, "--json"]).expect(0);
    let summary = ended.json();
    for quiet in [
        "envelope_cycles",
        "overruns",
        "bus_errors",
        "poses_lost_cycles",
        "samples_refused",
    ] {
        assert_eq!(summary[quiet], 0, "{quiet}: {summary}");
    }
    let targets = Targets::read(std::path::Path::new(&file));
    assert_eq!(targets.joints, JOINTS);
    let watch = targets.expect_inside(&character.limits, RATE_HZ);
    println!("{}", watch.extremes());

    let (header, samples) = performance(&character);
    assert_eq!(header.points, ["head", "left", "right"]);
    // The performance begins when the arm has risen.
    let begins_s = character.safety.ramp_s;
    let rows = || (targets.rows.iter().enumerate()).filter(|(k, _)| (600..4300).contains(k));
    for (what, point, axis, joint, sign, least) in [
        (
            "right hand to the side, arm to the side",
            2,
            0,
            0,
            1.0,
            0.95,
        ),
        ("right hand up, forearm up", 2, 1, 2, -1.0, 0.9),
        ("left hand up, gripper open", 1, 1, 4, 1.0, 0.95),
    ] {
        let moved: Vec<f64> = rows().map(|(_, row)| sign * row[joint]).collect();
        let (best, lag_s) = (0..60)
            .map(|k| {
                let lag_s = f64::from(k) / RATE_HZ;
                let shown: Vec<f64> = rows()
                    .map(|(k, _)| {
                        hand(&samples, point, axis, k as f64 / RATE_HZ - begins_s - lag_s)
                    })
                    .collect();
                (correlation(&shown, &moved), lag_s)
            })
            .fold(
                (-1.0, 0.0),
                |best: (f64, f64), next| if next.0 > best.0 { next } else { best },
            );
        println!("{what}: correlation {best:.3}, {lag_s:.3} s behind");
        assert!(
            best > least,
            "{what}: correlation {best:.3}, at least {least} expected"
        );
        assert!(lag_s < 0.2, "{what}: {lag_s} s behind");
    }
}

#[test]
fn a_map_may_name_clips_in_place_of_its_volume() {
    let folder = Folder::of_configs();
    let play = || {
        let file = folder.text("t.csv");
        run_virtual(&[&folder.text("arm.toml"), "--targets", &file]).expect(0);
        Targets::read(std::path::Path::new(&file))
    };
    let whole = play();
    let map = folder.read("maps/arm.toml");
    let (from, to) = (
        map.find("[volume]").expect("a volume"),
        map.find("[[pair]]").expect("pairs"),
    );
    let clips = ["keys", "sweep", "reach", "raise", "grip", "stir"];
    let clips: Vec<String> = clips
        .iter()
        .map(|c| format!("\"../clips/arm_{c}.json\""))
        .collect();
    let linked = format!(
        "{}clips = [{}]\n\n{}",
        map[..from].trim_end().to_owned() + "\n",
        clips.join(", "),
        &map[to..]
    );
    folder.write("maps/arm.toml", &linked);
    let linked = play();
    let apart = (whole.rows.iter().zip(&linked.rows))
        .flat_map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b).abs()))
        .fold(0.0, f64::max);
    assert!(apart < 1e-4, "{apart} rad apart");
    folder.edit("maps/arm.toml", "arm_stir", "arm_stur");
    refused(
        run_virtual(&[&folder.text("arm.toml")]),
        2,
        &["class.map", "arm_stur.json"],
    );
}

#[test]
fn the_dance_is_what_the_importer_makes() {
    let Some(recording) = shared_data("hand/vr_controller/tracked-recording.json") else {
        return;
    };
    let folder = Folder::of_configs();
    let recording = recording.to_str().expect("a plain path");
    let out = folder.text("again.csv");
    handwave(&[
        "poses",
        "import",
        recording,
        "--points",
        "head,left,right",
        "--from",
        "4",
        "--to",
        "24",
        "--out",
        &out,
    ])
    .expect(0);
    let same = folder.read("again.csv") == folder.read("performances/vr_dance.csv");
    assert!(same, "configs/performances/vr_dance.csv is out of date");
}

#[test]
fn every_shipped_character_plays_to_its_end() {
    let names: Vec<String> = shipped().into_iter().map(|(name, _)| name).collect();
    assert!(names.len() >= 2, "{names:?}");
    for name in names {
        let summary = run_virtual(&[&format!("configs/{name}"), "--json"])
            .expect(0)
            .json();
        assert_eq!(
            summary["ending"], "performance complete",
            "{name}: {summary}"
        );
        assert_eq!(summary["envelope_cycles"], 0, "{name}: {summary}");
    }
}

#[test]
fn lost_poses_bring_the_arm_to_rest_and_it_eases_in_when_they_return() {
    let character = arm();
    let begins_s = character.safety.ramp_s + 0.005;
    let mut player = Player::new(&character, begins_s);
    let mut watch = LimitWatch::new(&character.limits, 1.0 / RATE_HZ);
    let mut acted = 0;
    let mut play = |player: &mut Player, until_s: f64, heard: bool| {
        let mut fastest: f64 = 0.0;
        while player.t_s() < until_s && player.step(heard) {
            watch
                .see(player.positions())
                .unwrap_or_else(|e| panic!("{e}"));
            fastest = fastest.max(watch.fastest_rad_s());
            acted += player.puppet.targets().held_back;
        }
        fastest
    };
    play(&mut player, begins_s + 8.0, true);
    let before = player.positions().to_vec();
    let held = play(&mut player, begins_s + 8.3, false);
    let eased = play(&mut player, begins_s + 11.0, false);
    let resting = play(&mut player, begins_s + 11.5, false);
    assert!(player.puppet.targets().poses_lost, "not lost after 3 s");
    assert!(resting < 0.02, "still moving at {resting} rad/s");
    let resumed = play(&mut player, begins_s + 13.5, true);
    assert!(resumed > 0.5, "poses are back, joints at {resumed} rad/s");
    let way = before
        .iter()
        .zip(player.positions())
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    assert_eq!(player.puppet.stage(), Stage::Playing);
    assert_eq!(acted, 0, "the envelope acted");
    println!(
        "coasting {held:.2}, easing {eased:.2}, resting {resting:.4}, resumed {resumed:.2} rad/s, {way:.2} rad away"
    );
}

#[test]
fn a_gesture_can_lead_into_a_map_and_out_of_it() {
    // The quadruped with a map of the hand to its bow, active while the hand is splayed.
    let folder = Folder::of_configs();
    let at = |name: &str| folder.text(name);
    let learned = handwave(&[
        "map",
        "learn",
        "--poses",
        &at("performances/drum_and_splay.jsonl"),
        "--urdf",
        &at("robots/pup.urdf"),
        "--clip",
        &at("clips/bow.json"),
        "--pair",
        "37.8=bow@0",
        "--pair",
        "39=bow@0.5",
        "--pair",
        "41=bow@1",
        "--out",
        &at("maps/bow.toml"),
    ]);
    learned.expect(0);
    folder.edit(
        "quadruped.toml",
        "clip = [{ file = \"clips/bow.json\" }]",
        "map = \"maps/bow.toml\"",
    );
    let ended =
        run_virtual(&[&at("quadruped.toml"), "--targets", &at("t.csv"), "--json"]).expect(0);
    let summary = ended.json();
    assert!(summary["transitions"].as_u64() >= Some(2), "{summary}");
    assert_eq!(summary["envelope_cycles"], 0, "{summary}");
    // Without a gesture it would have to be where the graph starts.
    folder.edit(
        "quadruped.toml",
        "gesture = \"splay\"        # non-cyclic",
        "# non-cyclic",
    );
    refused(
        run_virtual(&[&at("quadruped.toml")]),
        2,
        &["class.map", "graph.start"],
    );
    folder.edit(
        "quadruped.toml",
        "start = \"locomotion\"",
        "start = \"bow\"",
    );
    run_virtual(&[&at("quadruped.toml")]).expect(0);
}
