//! `docs/first_robot.md` done anew: from four servos out of the box to an arm led by a hand, by the commands that stand there.

mod support;

use support::bench::{Bench, teach};

/// The commands that the page says, in its order.
fn commands() -> Vec<String> {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/first_robot.md");
    let text = std::fs::read_to_string(page).expect("docs/first_robot.md");
    let lines = text
        .lines()
        .filter_map(|line| line.trim().strip_prefix("$ handwave "));
    lines.map(str::to_owned).collect()
}

#[test]
fn from_four_new_servos_to_an_arm_led_by_a_hand() {
    let mut bench = Bench::start("1-4", &["--factory"]);
    let said = commands();
    let mut next = 0;
    // The next command of the page, which must begin like this; on this bench's line instead of the adapter's.
    let bus = bench.bus.clone();
    let mut command = |begin: &str| -> Vec<String> {
        let line = said
            .get(next)
            .unwrap_or_else(|| panic!("no '{begin}' on the page"));
        assert!(
            line.starts_with(begin),
            "expected '{begin}', the page goes on with '{line}'"
        );
        next += 1;
        let line = line.replace("dynamixel:/dev/ttyUSB0", &bus);
        let line = line.replace("my_arm/", "");
        line.split_whitespace().map(str::to_owned).collect()
    };
    fn words(command: &[String]) -> Vec<&str> {
        command.iter().map(String::as_str).collect()
    }

    bench.plug(1, 1, 57_600);
    let scan = command("bus scan");
    bench.run(&words(&scan)).expect(0, &["xl430-w250", "57600"]);

    let setup = command("bus setup");
    let mut asking = bench.ask(&words(&setup));
    for label in 1..=4_u8 {
        asking.hear(&format!(
            "{label} of 4: joint{label} (servo {})",
            10 + label
        ));
        // The port is the command's now, so the servo is asked for by it until it has booted.
        bench.hand(&format!("plug {label}"));
        asking.hear("q ends): ");
        loop {
            asking.answer("");
            if asking.hear_one_of(&["[Y/n]", "q ends): "]) == 0 {
                break;
            }
        }
        asking.answer("y");
        asking.hear("written and read back");
    }
    asking.finish().expect(0, &["handwave bus calibrate"]);
    let scan = command("bus scan");
    bench
        .run(&words(&scan))
        .expect(0, &["  11  xl", "  14  xl"]);

    let calibrate = command("bus calibrate");
    bench.hand("turn 2 -5");
    bench.hand("turn 3 20");
    let mut asking = bench.ask(&words(&calibrate));
    let ends = [(-161, 161), (-88, 88), (-88, 82), (-99, 114)];
    for (label, ends) in (1..=4).zip(ends) {
        asking.hear(&format!("joint{label} (servo 1{label})"));
        teach(
            &mut bench,
            &mut asking,
            label,
            if label == 3 { -1 } else { 1 },
            ends,
        );
    }
    asking.hear("[Y/n]");
    asking.answer("y");
    for label in 1..=4 {
        asking.hear("(s skips): ");
        bench.hand(&format!(
            "turn {label} {}",
            if label == 3 { -15 } else { 15 }
        ));
        asking.answer("");
        asking.hear("right");
    }
    asking.finish().expect(0, &["calibrated"]);

    let setup = command("bus setup");
    let mut asking = bench.ask(&words(&setup));
    for _ in 0..4 {
        asking.hear("differs");
        asking.hear("[Y/n]");
        asking.answer("");
    }
    asking.finish().expect(0, &["handwave run"]);
    let monitor = command("bus monitor");
    bench.run(&words(&monitor)).expect(0, &["joint1", "joint4"]);

    // The arm is led by a hand's recording. A busy machine may starve the simulator for a moment.
    let run = command("run");
    bench
        .run(&words(&run))
        .expect(0, &["read back from 4 of 4 servos"]);
    for id in 11..=14 {
        assert_eq!(bench.register(id, "torque_enable"), 0, "servo {id}");
    }
    // It ends folded, somewhere else than where it was calibrated.
    let shoulder = bench.register(12, "present_position");
    assert!(
        (1013..1991).contains(&shoulder),
        "joint2 ends at {shoulder}, not folded back"
    );

    let record = command("bus record");
    let mut asking = bench.ask(&words(&record));
    asking.hear("press Enter to begin");
    asking.answer("");
    asking.hear("Enter ends");
    bench.hand("turn 1 40");
    bench.hand("turn 1 -40");
    asking.answer("");
    asking.finish().expect(0, &["wave.csv"]);
    let play = command("bus play");
    let mut asking = bench.ask(&words(&play));
    asking.hear("[y/N]");
    asking.answer("y");
    asking.finish().expect(0, &["torque is off at 4 joints"]);
}
