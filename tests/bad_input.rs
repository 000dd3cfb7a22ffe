//! Bad input of every kind: exit code 2 (3 for a port), and a message that says where, what and what is allowed.

mod support;

use support::folder::Folder;
use support::program::{Ended, handwave, refused, run_virtual};

const CONFIG: &str = "quadruped.toml";

/// The configuration with one edit: refused, naming file and line of the edit (of `key` when given).
#[track_caller]
fn edited(from: &str, to: &str, parts: &[&str]) {
    let folder = Folder::of_configs();
    let line = folder.edit(CONFIG, from, to);
    let at = format!("{}:{line}", folder.text(CONFIG));
    refused(
        run_virtual(&[&folder.text(CONFIG)]),
        2,
        &[&[at.as_str()], parts].concat(),
    );
}

/// A run with `lines` as its pose stream, beside the header of the bundled performance.
#[track_caller]
fn poses(lines: &[String]) -> (Folder, Ended) {
    let folder = Folder::of_configs();
    let good = folder.read("performances/drum_and_splay.jsonl");
    let head: Vec<&str> = good.lines().take(20).collect();
    let text = format!("{}\n{}\n", head.join("\n"), lines.join("\n"));
    let file = folder.write("take.jsonl", &text);
    let ended = run_virtual(&["--input", &format!("file:{file}")]);
    (folder, ended)
}

fn sample(t: f64, points: usize, x: &str) -> String {
    let point = format!("[{x},0.2,0.1]");
    format!(r#"{{"t":{t},"p":[{}]}}"#, vec![point; points].join(","))
}

#[test]
fn ten_bad_samples_in_a_row_end_the_run_and_name_the_first_line() {
    let at = |k: usize| 1.0 + 0.01 * k as f64;
    let wrong_count = (0..12).map(|k| sample(at(k), 5, "0.1")).collect::<Vec<_>>();
    let nan = (0..12).map(|k| sample(at(k), 6, "NaN")).collect::<Vec<_>>();
    let huge = (0..12)
        .map(|k| sample(at(k), 6, "1e999"))
        .collect::<Vec<_>>();
    let backwards = (0..12)
        .map(|k| sample(0.05 - 0.001 * k as f64, 6, "0.1"))
        .collect::<Vec<_>>();
    let garbage = (0..12)
        .map(|_| "not a sample".to_owned())
        .collect::<Vec<_>>();
    for (lines, parts) in [
        (wrong_count, ["5", "6"]),
        (nan, ["take.jsonl", "21"]),
        (huge, ["take.jsonl", "21"]),
        (backwards, ["time", "back"]),
        (garbage, ["take.jsonl", "21"]),
    ] {
        let (folder, ended) = poses(&lines);
        let file = folder.text("take.jsonl");
        refused(ended, 2, &[&parts[..], &[&file, "21", "10"]].concat());
    }
}

#[test]
fn nine_bad_samples_in_a_row_are_counted_and_dropped() {
    let mut lines: Vec<String> = (0..9).map(|k| sample(1.0, 6 + k % 2, "NaN")).collect();
    lines.push(sample(1.2, 6, "0.1"));
    let folder = Folder::of_configs();
    let good = folder.read("performances/drum_and_splay.jsonl");
    let head: Vec<&str> = good.lines().take(20).collect();
    let file = folder.write(
        "take.jsonl",
        &format!("{}\n{}\n", head.join("\n"), lines.join("\n")),
    );
    let ended = run_virtual(&["--json", "--input", &format!("file:{file}")]).expect(0);
    let dropped = &ended.json()["samples_dropped"];
    let total: u64 = dropped.as_object().map_or(0, |d| {
        d.values().filter_map(serde_json::Value::as_u64).sum()
    });
    assert_eq!(total, 9, "{dropped}");
}

#[test]
fn a_pose_file_that_is_absent_or_no_pose_stream() {
    let folder = Folder::of_configs();
    let absent = folder.text("absent.jsonl");
    refused(
        run_virtual(&["--input", &format!("file:{absent}")]),
        2,
        &[&absent],
    );
    let ending = folder.write("take.txt", "x");
    refused(
        run_virtual(&["--input", &format!("file:{ending}")]),
        2,
        &[&ending, ".jsonl", ".csv"],
    );
    let empty = folder.write("empty.jsonl", "");
    refused(
        run_virtual(&["--input", &format!("file:{empty}")]),
        2,
        &[&empty],
    );
    let header = folder.write("header.jsonl", "{\"handwave\":\"posse\",\"version\":1}\n");
    refused(
        run_virtual(&["--input", &format!("file:{header}")]),
        2,
        &[&header],
    );
    let points = "{\"handwave\":\"poses\",\"version\":1,\"points\":[\"nose\"],\"dim\":3,\"unit\":\"m\"}\n{\"t\":0,\"p\":[[0,0,0]]}\n";
    let points = folder.write("points.jsonl", points);
    refused(
        run_virtual(&["--input", &format!("file:{points}")]),
        2,
        &["palm"],
    );
    let csv = folder.write("bad.csv", "time,wrist.x\n0,1\n");
    refused(
        run_virtual(&["--input", &format!("file:{csv}")]),
        2,
        &[&csv],
    );
}

#[test]
fn a_gesture_without_a_period() {
    let folder = Folder::empty();
    // A fingertip that goes its way once, and one that rests; 1e-4 m of a tracker's noise.
    type Way = fn(f64) -> f64;
    let moves: [(&str, Way, &str); 2] = [
        ("once", |t| 0.02 * t * t, "period"),
        ("held", |_| 0.0, "hardly moves"),
    ];
    for (name, way, expected) in moves {
        let mut text =
            String::from("t,wrist.x,wrist.y,wrist.z,tip.x,tip.y,tip.z,thumb.x,thumb.y,thumb.z\n");
        for k in 0..300_u32 {
            let t = 0.01 * f64::from(k);
            let noise = |n: u32| 1e-4 * f64::from((k * 7919 + n * 104_729) % 101) / 101.0;
            let tip = 0.2 + way(t);
            text += &format!(
                "{t:.3},{},0.1,{},{},{tip},0.1,-0.1,{},0.05\n",
                noise(1),
                noise(2),
                0.1 + noise(3),
                0.15 + noise(4)
            );
        }
        let poses = folder.write(&format!("{name}.csv"), &text);
        let into = folder.text("new.toml");
        let args = ["gesture", "define", "--poses", &poses, "--name", name];
        let marks = ["--start", "0.5", "--into", &into];
        refused(handwave(&[&args[..], &marks].concat()), 2, &[expected]);
        assert!(
            !folder.path("new.toml").exists(),
            "a refused gesture was written"
        );
    }
}

#[test]
fn a_typo_in_the_configuration() {
    edited(
        "watchdog_ms",
        "watchdg_ms",
        &["unknown key", "watchdg_ms", "did you mean \"watchdog_ms\""],
    );
    edited(
        "on_lost = \"idle\"",
        "on_lost = \"idel\"",
        &["idel", "did you mean \"idle\""],
    );
    edited(
        "[safety]",
        "[saftey]",
        &["saftey", "did you mean \"safety\""],
    );
    edited("rate_hz = 200.0", "rate_hz = \"fast\"", &["fast"]);
    edited("rate_hz = 200.0", "rate_hz = ", &[]);
}

#[test]
fn a_joint_map_that_does_not_fit_the_robot() {
    edited(
        "\"rear_left_knee\"",
        "\"rear_left_kneee\"",
        &[
            "robot.joint.name",
            "did you mean \"rear_left_knee\"",
            "front_left_hip",
        ],
    );
    edited(
        "servo = 12",
        "servo = 11",
        &["robot.joint.servo", "servo 11", "rear_right_thigh"],
    );
    edited(
        "\"rear_left_knee\"",
        "\"rear_left_thigh\"",
        &["rear_left_thigh", "twice"],
    );
    edited("servo = 12", "servo = 300", &["300"]);
    edited(
        "servo = 12, direction = -1",
        "servo = 12, direction = 2",
        &["direction", "1 or -1"],
    );
}

#[test]
fn a_joint_without_a_servo() {
    let folder = Folder::of_configs();
    folder.edit(CONFIG, "{ name = \"rear_left_hip\",     servo = 7 },", "");
    let file = folder.text(CONFIG);
    refused(
        run_virtual(&[&file]),
        2,
        &[&file, "robot.joint", "rear_left_hip", "servo = ID"],
    );
}

#[test]
fn files_that_the_configuration_names() {
    edited(
        "robots/pup.urdf",
        "robots/cat.urdf",
        &["robot.urdf", "cat.urdf"],
    );
    edited("clips/bow.json", "clips/bwo.json", &["bwo.json"]);
    edited("gestures/hand.toml", "gestures/foot.toml", &["foot.toml"]);
    edited(
        "gesture = \"splay\"",
        "gesture = \"splat\"",
        &["class.gesture", "did you mean \"splay\"", "drum"],
    );
    edited(
        "start = \"locomotion\"",
        "start = \"locomotoin\"",
        &["graph.start", "locomotion"],
    );
    edited(
        "estimator = \"default\"",
        "estimator = \"gabro\"",
        &["input.estimator", "gabro", "gabor"],
    );
    edited(
        "model = \"xl430-w250\"",
        "model = \"xl431\"",
        &["bus.model", "xl431", "xl430-w250"],
    );
    edited("bus = \"sim\"", "bus = \"smi\"", &["bus.bus", "smi"]);
}

#[test]
fn a_channel_that_the_stream_lacks() {
    let folder = Folder::of_configs();
    // The layer's, not that of the class's parameter before it.
    folder.edit(
        CONFIG,
        "channel = \"yaw\"          #",
        "channel = \"yav\"          #",
    );
    let file = folder.text(CONFIG);
    refused(
        run_virtual(&[&file]),
        2,
        &[
            &file,
            "layer",
            "yav",
            "has no channel",
            "yaw_rad",
            "height_m",
        ],
    );
}

#[test]
fn a_clip_of_another_robot() {
    let folder = Folder::of_configs();
    let clip = folder
        .read("clips/bow.json")
        .replace("rear_right_knee", "tail");
    folder.write("clips/bow.json", &clip);
    let file = folder.text(CONFIG);
    refused(
        run_virtual(&[&file]),
        2,
        &[&file, "bow.json", "rear_right_knee"],
    );
}

#[test]
fn a_robot_that_is_no_urdf() {
    let folder = Folder::of_configs();
    folder.write("robots/pup.urdf", "<robot name=\"pup\"><link");
    refused(
        run_virtual(&[&folder.text(CONFIG)]),
        2,
        &[&folder.text(CONFIG), "robot.urdf"],
    );
    let folder = Folder::of_configs();
    folder.edit("robots/pup.urdf", "lower=\"-0.7\"", "lower=\"nan\"");
    refused(
        run_virtual(&[&folder.text(CONFIG)]),
        2,
        &["robot.urdf", "front_left_hip"],
    );
}

#[test]
fn numbers_out_of_range() {
    for (from, to, parts) in [
        (
            "rate_hz = 200.0",
            "rate_hz = 5.0",
            ["bus.rate_hz", "10..2000"],
        ),
        (
            "rate_hz = 200.0",
            "rate_hz = nan",
            ["bus.rate_hz", "10..2000"],
        ),
        (
            "velocity_share = 1.0",
            "velocity_share = -0.5",
            ["robot.velocity_share", "0.01..1"],
        ),
        ("ramp_s = 2.0", "ramp_s = inf", ["safety.ramp_s", "0.1..60"]),
        (
            "lost_s = 1.0",
            "lost_s = 0.1",
            ["safety.lost_s", "0.35..60"],
        ),
        (
            "watchdog_ms = 200",
            "watchdog_ms = 9000",
            ["bus.watchdog_ms", "0..2540"],
        ),
        (
            "blend_s = 0.5",
            "blend_s = 0.0",
            ["graph.blend_s", "0.1..10"],
        ),
    ] {
        edited(from, to, &parts);
    }
    edited("watchdog_ms = 200", "watchdog_ms = -1", &["-1"]);
    edited(
        "range = [-0.6, 0.6]\ndead_zone",
        "range = [0.6, 0.6]\ndead_zone",
        &["layer.range"],
    );
    edited(
        "range = [-0.6, 0.6], dead_zone",
        "range = [0.6, 0.6], dead_zone",
        &["class.parameter.range"],
    );
}
