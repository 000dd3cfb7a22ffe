//! Keys of classes, layers, search, legs and avatars with bad values: file, line, key, and what is allowed.

mod support;

use support::folder::Folder;
use support::program::{refused, run_virtual};

/// `config` with one edit is refused with exit code 2, naming file and line of the edit, then `parts`.
#[track_caller]
fn edited(config: &str, from: &str, to: &str, parts: &[&str]) {
    let folder = Folder::of_configs();
    let line = folder.edit(config, from, to);
    let at = format!("{}:{line}", folder.text(config));
    let ended = run_virtual(&[&folder.text(config)]);
    refused(ended, 2, &[&[at.as_str()], parts].concat());
}

#[track_caller]
fn pup(from: &str, to: &str, parts: &[&str]) {
    edited("quadruped.toml", from, to, parts);
}

const TURN: &str =
    r#"parameter = [{ name = "turn", channel = "yaw", range = [-0.6, 0.6], dead_zone = 0.25 }]"#;
const SIT: &str = r#"channel = { name = "z", range = [-0.03, -0.12] }"#;
const LEFT: &str =
    r#"walk_long_left.json",   amplitude = 1.0, frequency_hz = 0.8, at = { turn = 1.0 }"#;

#[test]
fn parameters_of_a_class() {
    let with = |from: &str, to: &str| TURN.replace(from, to);
    pup(
        TURN,
        &with(r#""yaw""#, r#""yav""#),
        &["class.parameter", "yav", "yaw"],
    );
    pup(
        TURN,
        &with("[-0.6, 0.6]", "[0.6, 0.6]"),
        &["class.parameter.range", "different"],
    );
    pup(
        TURN,
        &with("0.25", "1.5"),
        &["class.parameter.dead_zone", "1.5", "0..0.9"],
    );
    pup(
        TURN,
        &with(r#""turn""#, r#""amplitude""#),
        &["class.parameter", "amplitude"],
    );
    pup(
        TURN,
        &with("dead_zone", "deadzone"),
        &["deadzone", "dead_zone"],
    );
    pup(TURN, "parameter = 3", &["3", "sequence"]);
}

#[test]
fn where_a_clip_is_in_a_parameter() {
    let with = |to: &str| LEFT.replace("turn = 1.0", to);
    pup(
        LEFT,
        &with("tern = 1.0"),
        &["class.clip.at", "tern", "turn"],
    );
    pup(LEFT, &with("turn = nan"), &["class.clip.at", "turn", "NaN"]);
    pup(LEFT, &with("turn = 1e9"), &["class.clip.at", "turn"]);
}

#[test]
fn the_channel_that_drives_a_class() {
    let with = |from: &str, to: &str| SIT.replace(from, to);
    pup(
        SIT,
        &with(r#""z""#, r#""zet""#),
        &["class.channel.name", "zet", "height"],
    );
    pup(
        SIT,
        &with("-0.12", "-0.03"),
        &["class.channel.range", "different"],
    );
    pup(
        SIT,
        &with("-0.12", "inf"),
        &["class.channel.range", "finite"],
    );
    pup(
        SIT,
        &with("-0.12]", "-0.12], dead_zone = -1.0"),
        &["class.channel.dead_zone", "0..0.9"],
    );
}

#[test]
fn a_class_without_a_gesture_cannot_be_reversed() {
    let folder = Folder::of_configs();
    folder.edit("quadruped.toml", SIT, &format!("{SIT}\nreverse = true"));
    let ended = run_virtual(&[&folder.text("quadruped.toml")]);
    refused(ended, 2, &["quadruped.toml:", "reverse", "gesture"]);
    pup("reverse = true", "reverse = 1", &["1", "boolean"]);
}

#[test]
fn how_a_class_is_played() {
    pup(
        r#"play = "once""#,
        r#"play = "twice""#,
        &["class.play", "twice", "gesture, once, loop"],
    );
}

#[test]
fn when_a_class_may_be_left() {
    let key = "# leave = [[0.0, 0.2], [0.5, 0.7]]";
    pup(key, "leave = [[0.0, 1.2]]", &["class.leave", "1.2", "0"]);
    pup(key, "leave = [[nan, 0.5]]", &["class.leave", "0"]);
    pup(key, "leave = [0.1, 0.2]", &["0.1", "array of length 2"]);
}

#[test]
fn what_a_limb_may_gain() {
    let key = "# limb_advance = 0.05";
    pup(
        key,
        "limb_advance = -0.1",
        &["class.limb_advance", "-0.1", "0"],
    );
    pup(
        key,
        "limb_advance = nan",
        &["class.limb_advance", "NaN", "0"],
    );
}

#[test]
fn weights_of_a_class() {
    pup(
        r#"# weights = "rose""#,
        r#"weights = "tulip""#,
        &["class.weights", "tulip", "rose", "inverse_distance"],
    );
}

const CROUCH: &str =
    r#"channel = "height"       # of the palm above the tracker, m: lower hand, lower body"#;

#[test]
fn what_drives_a_layer() {
    pup(
        CROUCH,
        r#"gesture = "splya""#,
        &["layer.gesture", "splya", "splay"],
    );
    let folder = Folder::of_configs();
    folder.edit(
        "quadruped.toml",
        CROUCH,
        "clock = true\nchannel = \"height\"",
    );
    let ended = run_virtual(&[&folder.text("quadruped.toml")]);
    refused(
        ended,
        2,
        &["quadruped.toml:", "layer crouch", "exactly one"],
    );
    let folder = Folder::of_configs();
    folder.edit("quadruped.toml", CROUCH, "clock = true");
    let ended = run_virtual(&[&folder.text("quadruped.toml")]);
    refused(ended, 2, &["quadruped.toml:", "layer crouch", "cycles"]);
}

#[test]
fn joints_of_a_layer() {
    let folder = Folder::of_configs();
    let key = "range = [0.14, 0.07]";
    folder.edit(
        "quadruped.toml",
        key,
        &format!("{key}\njoints = [\"front_left_hp\"]"),
    );
    let ended = run_virtual(&[&folder.text("quadruped.toml")]);
    refused(
        ended,
        2,
        &[
            "quadruped.toml:",
            "layer",
            "front_left_hp",
            "front_left_hip",
        ],
    );
}

#[test]
fn tempo_of_a_layer() {
    for bad in ["0.0", "-1.0", "nan", "1e6"] {
        let folder = Folder::of_configs();
        let key = "range = [0.14, 0.07]";
        folder.edit(
            "quadruped.toml",
            key,
            &format!("{key}\nfrequency_hz = {bad}"),
        );
        let ended = run_virtual(&[&folder.text("quadruped.toml")]);
        refused(
            ended,
            2,
            &["quadruped.toml:", "layer.frequency_hz", "0..50"],
        );
    }
}

#[test]
fn a_layer_at_rest_only() {
    let key = "one_sided = true";
    pup(key, "idle_only = \"yes\"", &["boolean"]);
}

#[test]
fn numbers_of_the_transition_search() {
    for (text, key, allowed) in [
        ("depth = 0", "depth", "1..20"),
        ("depth = 1000", "depth", "1..20"),
        ("step = 0.0", "step", "0.02..0.5"),
        ("lambda = -1.0", "lambda", "0..1000000"),
        ("kappa = 0.0", "kappa", "0.000001..1000000000"),
        ("s_min = 1.0", "s_min", "0..0.999"),
        ("latency_s = nan", "latency_s", "0.05..10"),
        (r#"edges = [["locomotion", "prence"]]"#, "edges", "prance"),
        (r#"edges = [["bow", "locomotion"]]"#, "edges", "cycles"),
    ] {
        let to = format!("[graph.search]\n{text}\n\n");
        let folder = Folder::of_configs();
        let from = "search = { kappa = 180.0, latency_s = 0.6 }";
        let line = folder.edit("quadruped.toml", from, &to) + 1;
        let at = format!("quadruped.toml:{line}");
        let ended = run_virtual(&[&folder.text("quadruped.toml")]);
        refused(ended, 2, &[&at, &format!("graph.search.{key}"), allowed]);
    }
}

const LEGS: &str = r#"# legs = { front_left = "front_left_foot", ... }"#;

#[test]
fn legs_of_a_robot() {
    pup(
        LEGS,
        r#"legs = { front_left = "front_left_fot" }"#,
        &["robot.legs", "front_left_fot", "front_left_foot"],
    );
    pup("pin_feet = true ", "pin_feet = 2 ", &["boolean"]);
}

#[test]
fn keys_of_an_avatar() {
    let fox = |from: &str, to: &str, parts: &[&str]| edited("fox.toml", from, to, parts);
    fox(
        "avatars/fox.glb",
        "avatars/fax.glb",
        &["avatar.model", "fax.glb"],
    );
    let folder = Folder::of_configs();
    folder.edit("fox.toml", "rate_hz = 200.0", "rate_hz = 0.0");
    refused(
        run_virtual(&[&folder.text("fox.toml")]),
        2,
        &["fox.toml:", "rate_hz"],
    );
}
