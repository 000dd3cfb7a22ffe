//! Models, modes and settings of servos in a configuration: what a servo cannot be or do is refused, naming file, line and
//! what is allowed; what it can plays.

mod support;

use support::folder::Folder;
use support::program::{refused, run_virtual};

const CONFIG: &str = "quadruped.toml";
const HIP: &str = "servo = 1 },";

/// The quadruped with `more` in its first joint: refused, naming file and line.
#[track_caller]
fn joint(more: &str, parts: &[&str]) {
    let folder = Folder::of_configs();
    let line = folder.edit(CONFIG, HIP, &format!("servo = 1, {more} }},"));
    let at = format!("{}:{line}", folder.text(CONFIG));
    refused(
        run_virtual(&[&folder.text(CONFIG)]),
        2,
        &[&[at.as_str()], parts].concat(),
    );
}

#[test]
fn models_and_modes_that_there_are_not() {
    joint(
        "model = \"xm430-w35\"",
        &[
            "robot.joint.model",
            "did you mean \"xm430-w350\"?",
            "xl430-w250",
        ],
    );
    joint(
        "mode = \"extended\"",
        &["robot.joint.mode", "extended_position", "velocity"],
    );
    joint("mode = \"curent\"", &["did you mean \"current\"?"]);
    joint(
        "mode = \"pwm\"",
        &["no mode \"pwm\" for joints", "Allowed: velocity"],
    );
    joint(
        "mode = \"current\", host_gains = { p = 1.0 }",
        &[
            "xl430-w250",
            "measures no current",
            "Allowed: velocity, position, extended_position",
        ],
    );
    joint(
        "model = \"ph42-020-s300\", mode = \"current_based_position\"",
        &["ph42-020-s300 has no mode", "Allowed: current, velocity"],
    );
    joint("modle = \"xm430-w350\"", &["modle", "model"]);
}

#[test]
fn ranges_that_a_mode_does_not_have() {
    joint(
        "range_pulse = [-4096, 8191]",
        &[
            "-4096 to 8191",
            "0 to 4095",
            "several turns need mode \"extended_position\"",
        ],
    );
    joint(
        "mode = \"extended_position\", range_pulse = [0, 2000000]",
        &["-1048575 to 1048575"],
    );
    joint(
        "mode = \"extended_position\", range_pulse = [100, 100]",
        &["not an ascending range"],
    );
    joint(
        "mode = \"extended_position\", range_pulse = [2047, 2049]",
        &["its servo only reaches"],
    );
}

#[test]
fn settings_that_a_servo_does_not_have() {
    joint(
        "gains = { p = 20000 }",
        &["gains.p = 20000", "takes 0 to 16383"],
    );
    joint("gains = { q = 1 }", &["unknown key", "feedforward_1"]);
    joint(
        "profile = { velocity_rad_s = -1.0 }",
        &["profile.velocity_rad_s = -1", "0 (no limit)"],
    );
    joint("current_a = 0.5", &["current_a is for modes"]);
    joint(
        "host_gains = { p = 1.0 }",
        &["closes the position loop itself"],
    );
    joint(
        "mode = \"velocity\", gains = { p = 1 }",
        &["the host's are host_gains"],
    );
    joint(
        "mode = \"velocity\", host_gains = { p = -1.0 }",
        &["p takes more than 0"],
    );
    joint(
        "model = \"xm430-w350\", mode = \"current\"",
        &["needs host_gains = { p = A/rad, d = A s/rad }"],
    );
    joint(
        "model = \"xm430-w350\", mode = \"current_based_position\", current_a = 99.0",
        &["current_a = 99", "at most 3.209 A"],
    );
}

#[test]
fn a_servo_that_nothing_would_stop() {
    let folder = Folder::of_configs();
    folder.edit(CONFIG, HIP, "servo = 1, mode = \"velocity\" },");
    folder.edit(CONFIG, "on_exit = \"torque_off\"", "on_exit = \"hold\"");
    refused(
        run_virtual(&[&folder.text(CONFIG)]),
        2,
        &["safety.on_exit", "front_left_hip", "torque_off"],
    );
    let folder = Folder::of_configs();
    folder.edit(CONFIG, HIP, "servo = 1, mode = \"velocity\" },");
    folder.edit(CONFIG, "watchdog_ms = 200", "watchdog_ms = 0");
    refused(
        run_virtual(&[&folder.text(CONFIG)]),
        2,
        &["bus.watchdog_ms", "front_left_hip"],
    );
}

#[test]
fn a_quadruped_of_many_models_and_modes_walks() {
    let folder = Folder::of_configs();
    for (servo, more) in [
        (
            "servo = 1 }",
            "servo = 1, model = \"xm430-w350\", gains = { p = 900 } }",
        ),
        ("servo = 2 }", "servo = 2, model = \"xl330-m077\" }"),
        ("servo = 4 }", "servo = 4, mode = \"extended_position\" }"),
        (
            "servo = 7 }",
            "servo = 7, model = \"xm430-w210\", mode = \"current_based_position\", current_a = 1.5 }",
        ),
        (
            "servo = 10 }",
            "servo = 10, model = \"xm430-w210\", mode = \"velocity\" }",
        ),
        ("servo = 8 }", "servo = 8, model = \"xc430-w150\" }"),
    ] {
        folder.edit(CONFIG, servo, more);
    }
    let ended = run_virtual(&["--json", "--duration", "12", &folder.text(CONFIG)]).expect(0);
    let summary = ended.json();
    assert_eq!(summary["bus_errors"], 0, "{summary}");
    let ended = run_virtual(&["--duration", "4", &folder.text(CONFIG)]).expect(0);
    let note = "servo 2 (xl330-m077, joint front_left_thigh) is not protected by a bus watchdog";
    assert!(ended.out.contains(note), "no word on it: {}", ended.out);
}
