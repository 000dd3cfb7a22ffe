//! A person at the servos: calibrating by hand, leading and playing, jogging, watching. Torque off on every way out.

mod support;

use support::bench::{Bench, teach};

/// The four servos of `configs/arm4.toml`, set up.
fn arm() -> Bench {
    Bench::start("11-14", &[])
}

/// Torque of the four; tried again while another command is still giving the port back.
#[track_caller]
fn torque(bench: &Bench) -> Vec<i64> {
    (11..=14)
        .map(|id| bench.register(id, "torque_enable"))
        .collect()
}

#[test]
fn a_calibration_finds_zero_sign_and_range_and_keeps_comments() {
    let mut bench = arm();
    let bus = bench.bus.clone();
    let before = bench.folder.read("arm4.toml");
    bench.hand("turn 12 10");
    bench.hand("turn 13 -15");
    let args = [
        "bus",
        "calibrate",
        &bus,
        "--config",
        "arm4.toml",
        "--joint",
        "joint2",
        "--joint",
        "joint3",
    ];
    let mut asking = bench.ask(&args);
    asking.hear("joint2 (servo 12)");
    teach(&mut bench, &mut asking, 12, 1, (-88, 88));
    asking.hear("joint3 (servo 13)");
    teach(&mut bench, &mut asking, 13, -1, (-88, 82));
    asking.hear("Write this into arm4.toml");
    asking.answer("y");
    for (id, degrees) in [(12, 15), (13, -15)] {
        asking.hear("(s skips): ");
        bench.hand(&format!("turn {id} {degrees}"));
        asking.answer("");
        asking.hear("right");
    }
    asking
        .finish()
        .expect(0, &["calibrated", "handwave run arm4.toml"]);

    let after = bench.folder.read("arm4.toml");
    assert_eq!(bench.folder.read("arm4.toml.before"), before);
    let line = |text: &str, joint: &str| -> String {
        let found = text.lines().find(|l| l.contains(joint)).expect(joint);
        found.to_owned()
    };
    // 10 degrees are 114 pulses, 15 are 171; the reach is 88 degrees to both sides.
    let joint2 = line(&after, "\"joint2\"");
    assert!(
        joint2.contains("servo = 12, zero_pulse = 21") && joint2.contains("direction = 1,"),
        "{joint2}"
    );
    assert!(
        joint2.ends_with("]  },   # shoulder") || joint2.ends_with("] },   # shoulder"),
        "{joint2}"
    );
    let joint3 = line(&after, "\"joint3\"");
    assert!(
        joint3.contains("zero_pulse = 187") && joint3.contains("direction = -1,"),
        "{joint3}"
    );
    for (a, b) in before.lines().zip(after.lines()) {
        let calibrated = a.contains("\"joint2\"") || a.contains("\"joint3\"");
        assert!(calibrated || a == b, "{a:?} became {b:?}");
    }
}

#[test]
fn a_wrong_sign_is_caught_and_the_old_configuration_put_back() {
    let mut bench = arm();
    let bus = bench.bus.clone();
    let before = bench.folder.read("arm4.toml");
    let args = [
        "bus",
        "calibrate",
        &bus,
        "--config",
        "arm4.toml",
        "--joint",
        "joint2",
        "--no-range",
    ];
    // Two movements in opposite ways, both called positive.
    let mut asking = bench.ask(&args);
    asking.hear("skips this joint): ");
    asking.answer("");
    asking.hear("Then Enter: ");
    bench.hand("turn 12 2");
    asking.answer("");
    asking.hear("2.0 degrees only");
    asking.hear("Then Enter: ");
    bench.hand("turn 12 -20");
    asking.answer("");
    asking.hear("To be sure, once more");
    asking.hear("then Enter: ");
    asking.answer("");
    asking.hear("Then Enter: ");
    bench.hand("turn 12 20");
    asking.answer("");
    asking
        .finish()
        .expect(2, &["opposite ways", "Nothing was written"]);
    assert_eq!(bench.folder.read("arm4.toml"), before);

    // Right at first, wrong in the test after writing.
    let mut asking = bench.ask(&args);
    asking.hear("skips this joint): ");
    asking.answer("");
    asking.hear("Then Enter: ");
    bench.hand("turn 12 20");
    asking.answer("");
    asking.hear("as configured");
    asking.hear("[Y/n]");
    asking.answer("");
    asking.hear("(s skips): ");
    bench.hand("turn 12 -20");
    asking.answer("");
    asking
        .finish()
        .expect(2, &["joint2", "20.0 degrees less", "as it was before"]);
    assert_eq!(bench.folder.read("arm4.toml"), before);
}

#[test]
fn a_range_that_falls_short_of_the_urdf_is_asked_for_again() {
    let mut bench = arm();
    let bus = bench.bus.clone();
    let mut asking = bench.ask(&[
        "bus",
        "calibrate",
        &bus,
        "--config",
        "arm4.toml",
        "--joint",
        "joint2",
    ]);
    asking.hear("skips this joint): ");
    asking.answer("");
    asking.hear("Then Enter: ");
    bench.hand("turn 12 40");
    asking.answer("");
    asking.hear("press Enter (k");
    asking.answer("");
    asking.hear("its URDF limits are -85.9 to 85.9 deg");
    asking.hear("press Enter (k");
    asking.interrupt();
    asking.finish().expect(130, &["torque is off"]);
    let all = bench.run(&["bus", "calibrate", &bus, "--config", "arm4.toml"]);
    all.expect(2, &["standard input has ended"]);
}

#[test]
fn what_a_hand_led_is_played_again_within_a_degree() {
    let mut bench = arm();
    let bus = bench.bus.clone();
    let with = ["--config", "arm4.toml"];
    // One servo holds: the torque is asked for.
    bench
        .run(&["bus", "write", &bus, "12", "torque_enable", "1"])
        .expect(0, &[]);
    let record = [&["bus", "record", &bus, "--out", "take.csv"][..], &with].concat();
    let mut asking = bench.ask(&record);
    asking.hear("Torque is on at joint2 (servo 12)");
    asking.hear("[y/N]");
    asking.answer("");
    asking.finish().expect(2, &["nothing was changed"]);
    assert_eq!(torque(&bench), [0, 1, 0, 0]);

    let mut asking = bench.ask(&record);
    asking.hear("[y/N]");
    asking.answer("y");
    asking.hear("press Enter to begin");
    asking.answer("");
    asking.hear("recording; Enter ends");
    bench.hand("turn 12 30");
    bench.hand("turn 13 -20");
    asking.answer("");
    asking.finish().expect(
        0,
        &[
            "take.csv",
            "4 joints",
            "handwave bus play --config arm4.toml",
            "handwave clip import take.csv",
        ],
    );
    let take = bench.folder.read("take.csv");
    let rows: Vec<Vec<f64>> = take
        .lines()
        .skip(1)
        .map(|line| {
            line.split(',')
                .map(|cell| cell.parse().expect("a number"))
                .collect()
        })
        .collect();
    assert_eq!(take.lines().next(), Some("t,joint1,joint2,joint3,joint4"));
    let last = rows.last().expect("rows");
    let degrees = [last[2].to_degrees(), last[3].to_degrees()];
    assert!(
        (degrees[0] - 30.0).abs() < 0.2 && (degrees[1] + 20.0).abs() < 0.2,
        "{degrees:?}"
    );
    assert!(
        rows.windows(2).all(|pair| pair[1][0] > pair[0][0]),
        "time stands still"
    );

    // It may become a clip.
    bench
        .run(&["clip", "import", "take.csv", "--out", "take.json"])
        .expect(0, &[]);

    // Back to where the take began; from there it is played, and left at its end.
    bench.hand("turn 12 -30");
    bench.hand("turn 13 20");
    let play = [&["bus", "play", &bus, "take.csv", "--yes"][..], &with].concat();
    let stay = [&play[..], &["--stay"]].concat();
    bench.run(&stay).expect(0, &["torque is off at 4 joints"]);
    bench.wait_for_position(12, 2048 + 341, 12);
    bench.wait_for_position(13, 2048 - 228, 12);
    assert_eq!(torque(&bench), [0; 4]);
    // And once more, back to where it stood.
    bench.run(&play).expect(0, &["torque is off at 4 joints"]);
    bench.wait_for_position(12, 2048 + 341, 12);
}

#[test]
fn a_take_beyond_the_limits_moves_nothing() {
    let bench = arm();
    let bus = bench.bus.clone();
    let play = |text: &str, parts: &[&str]| {
        bench.folder.write("wild.csv", text);
        let args = [
            "bus",
            "play",
            &bus,
            "wild.csv",
            "--config",
            "arm4.toml",
            "--yes",
        ];
        bench.run(&args).expect(2, parts);
    };
    play(
        "t,joint1,joint2\n0,0,0\n1,0,1.0\n2,0,1.7\n",
        &["joint2", "97.4 deg", "-85.9 to 85.9", "nothing was moved"],
    );
    play(
        "t,joint1\n0,0\n0.1,0.1\n0.2,0.9\n0.3,1.7\n",
        &["joint1", "deg/s", "--speed 0."],
    );
    play("t,joint1,hand\n0,0,0\n1,0,0\n", &["hand", "joint1, joint2"]);
    play("t,joint1\n0,0\n", &["at least 2"]);
    play("t,joint1\n0,nan\n1,0\n", &["wild.csv"]);
    let args = ["bus", "play", &bus, "wild.csv", "--yes"];
    bench.folder.write("wild.csv", "t,joint1\n0,0\n1,0\n");
    bench
        .run(&args)
        .expect(2, &["joint1", "--config FILE", "servo_ID"]);
    bench.folder.write("wild.csv", "t,servo_12\n0,0\n1,4.0\n");
    bench
        .run(&args)
        .expect(2, &["servo_12", "229.2 deg", "nothing was moved"]);
    for id in 11..=14 {
        bench.wait_for_position(id, 2048, 0);
    }
    assert_eq!(torque(&bench), [0; 4]);
}

#[test]
fn a_jog_goes_where_it_is_told_and_leaves_no_torque() {
    let bench = arm();
    let bus = bench.bus.clone();
    let jog = |args: &[&str]| bench.run(&[&["bus", "jog", &bus][..], args].concat());
    jog(&["12", "--by", "-10", "--speed", "60"]).expect(0, &["torque off"]);
    bench.wait_for_position(12, 2048 - 114, 4);
    jog(&["12", "--to", "2100p", "--speed", "60", "--hold"]).expect(0, &["torque stays on"]);
    assert_eq!(torque(&bench), [0, 1, 0, 0]);
    bench.wait_for_position(12, 2100, 4);
    // Taken over from a servo that holds.
    jog(&["12", "--to", "0", "--speed", "60"]).expect(0, &["torque off"]);
    assert_eq!(torque(&bench), [0; 4]);

    bench
        .run(&["bus", "write", &bus, "12", "max_position_limit", "2500"])
        .expect(0, &[]);
    jog(&["12", "--to", "90"]).expect(2, &["outside the position limits", "nothing was moved"]);
    jog(&["12", "--to", "far"]).expect(2, &["far", "2048p"]);
    jog(&["12", "--speed=-3", "--to", "1"]).expect(2, &["--speed"]);
    jog(&["12"]).expect(2, &["needs a terminal"]);
    jog(&["15", "--to", "0"]).expect(3, &["servo 15 does not answer"]);
}

#[test]
fn ctrl_c_in_a_jog_and_in_a_play_leaves_torque_off() {
    let bench = arm();
    let bus = bench.bus.clone();
    let mut asking = bench.ask(&["bus", "jog", &bus, "12", "--to", "170", "--speed", "5"]);
    asking.hear("stands at");
    asking.interrupt();
    asking.finish().expect(130, &["interrupted", "torque off"]);
    assert_eq!(torque(&bench), [0; 4]);

    bench.folder.write("slow.csv", "t,joint1\n0,0\n60,1\n");
    let mut asking = bench.ask(&["bus", "play", &bus, "slow.csv", "--config", "arm4.toml"]);
    asking.hear("Is the way clear? [y/N]");
    asking.answer("y");
    asking.hear("moving; Ctrl-C");
    asking.interrupt();
    asking.finish().expect(130, &["torque is off"]);
    assert_eq!(torque(&bench), [0; 4]);
}

#[test]
fn a_servo_that_latches_an_error_ends_a_jog_by_4() {
    let bench = Bench::start("12", &["--fault", "12:overload@1s..60s"]);
    let bus = bench.bus.clone();
    let told = bench.run(&["bus", "jog", &bus, "12", "--to", "170", "--speed", "5"]);
    told.expect(4, &["hardware error", "stopped"]);
    let watched = bench.run(&["bus", "monitor", &bus, "--once"]);
    watched.expect(0, &["overload", "off"]);
}

#[test]
fn the_monitor_names_joints_and_silent_servos_and_changes_nothing() {
    let bench = Bench::start("11-13", &["--fault", "12:overload@0s"]);
    let bus = bench.bus.clone();
    bench
        .run(&["bus", "write", &bus, "11", "torque_enable", "1"])
        .expect(0, &[]);
    let told = bench.run(&[
        "bus",
        "monitor",
        &bus,
        "--config",
        "arm4.toml",
        "--once",
        "--json",
    ]);
    let told = told.expect(0, &[]);
    let rows: Vec<serde_json::Value> = told
        .out
        .lines()
        .map(|line| serde_json::from_str(line).expect("one object a line"))
        .collect();
    let column = |name: &str| rows.iter().map(|row| row[name].clone()).collect::<Vec<_>>();
    assert_eq!(column("joint"), ["joint1", "joint2", "joint3", "joint4"]);
    assert_eq!(column("answers"), [true, true, true, false]);
    assert_eq!(rows[0]["torque"], true, "{told:?}");
    assert_eq!(rows[1]["errors"], "overload", "{told:?}");
    let table = bench.run(&["bus", "monitor", &bus, "--config", "arm4.toml", "--once"]);
    table.expect(0, &["joint4", "silent: check cable"]);
    assert_eq!(bench.register(11, "torque_enable"), 1);
    bench
        .run(&["bus", "monitor", &bus, "--ids", "77", "--once"])
        .expect(3, &["no servo answers"]);
    bench
        .run(&["bus", "monitor", &bus, "--rate", "0"])
        .expect(2, &["--rate"]);
}
