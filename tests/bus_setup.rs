//! Servos out of the box become those of a chain: one at a time, refused where one cannot tell, undone, gone on with.

mod support;

use support::bench::Bench;

/// Rates of this bench; all eight take half a minute.
const AT: [&str; 2] = ["--at", "57600,1000000"];

fn setup<'a>(bench: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["bus", "setup", bench][..], &AT, more].concat()
}

#[test]
fn what_is_not_said_or_does_not_exist_is_refused_before_anything_is_written() {
    let bench = Bench::start("1-2", &["--factory"]);
    let bus = bench.bus.clone();
    let refused = |args: &[&str], code: i32, parts: &[&str]| {
        bench.run(&setup(&bus, args)).expect(code, parts);
    };
    refused(&["--yes"], 2, &["--config FILE", "--id N"]);
    refused(&["--id", "253", "--yes"], 2, &["--id", "252"]);
    refused(&["--id", "3", "--baud", "fast"], 2, &["fast"]);
    refused(&["--id", "3", "--limits", "3000-10"], 2, &["3000-10"]);
    refused(&["--config", "nowhere.toml"], 2, &["nowhere.toml"]);
    refused(&["--config", "fox.toml"], 2, &["avatar"]);
    refused(
        &["--config", "arm4.toml", "--joint", "elbow"],
        2,
        &["elbow", "joint1, joint2, joint3, joint4"],
    );
    refused(&["--config", "arm4.toml", "--yes"], 2, &["--joint NAME"]);
    refused(&["--undo", "nothing.jsonl", "--yes"], 2, &["nothing.jsonl"]);
    refused(
        &["--id", "3", "--yes"],
        3,
        &["no servo answers", "--at all"],
    );
    let gone = "dynamixel:/nowhere/at/all";
    bench
        .run(&setup(gone, &["--id", "3", "--yes"]))
        .expect(3, &["/nowhere/at/all"]);
}

#[test]
fn two_new_servos_at_once_are_refused_and_neither_is_written() {
    let mut bench = Bench::start("1-2", &["--factory"]);
    bench.plug(1, 1, 57_600);
    bench.hand("plug 2");
    let bus = bench.bus.clone();
    // The second one boots meanwhile; once both are up they talk over each other.
    let begin = std::time::Instant::now();
    loop {
        let scan = bench.run(&["bus", "scan", &bus, "--baud", "57600"]);
        if scan.err.contains("several servos") {
            break;
        }
        assert!(begin.elapsed().as_secs() < 30, "not noticed: {scan:?}");
    }
    let told = bench.run(&setup(&bus, &["--id", "3", "--yes"]));
    told.expect(
        3,
        &[
            "several servos answer at once",
            "Unplug all of them but one",
        ],
    );
    assert!(
        !bench.folder.path("servo_undo.jsonl").exists(),
        "something was written"
    );
}

#[test]
fn a_configuration_guides_from_the_box_to_the_chain_and_goes_on_where_it_was_left() {
    let mut bench = Bench::start("1-4", &["--factory"]);
    let bus = bench.bus.clone();
    let guided = setup(&bus, &["--config", "arm4.toml"]);

    let mut asking = bench.ask(&guided);
    asking.hear("1 of 4: joint1 (servo 11)");
    asking.hear("press Enter");
    asking.answer("");
    asking.hear("no servo answers");
    asking.hear("press Enter");
    bench.hand("plug 1");
    // While it boots nobody answers, and the question comes again.
    loop {
        asking.answer("");
        if asking.hear_one_of(&["Write these? [Y/n]", "press Enter"]) == 0 {
            break;
        }
    }
    asking.answer("y");
    asking.hear("joint1 (servo 11) is id 11 at 1000000 baud");
    asking.hear("2 of 4: joint2 (servo 12)");
    asking.answer("q");
    asking.finish().expect(130, &["goes on from here"]);

    // On from there, the first servo left on the chain.
    bench.plug(2, 1, 57_600);
    let mut asking = bench.ask(&guided);
    asking.hear("1 of 4: joint1 (servo 11) is set up already");
    asking.hear("2 of 4: joint2 (servo 12)");
    asking.answer("");
    asking.hear("Write these? [Y/n]");
    asking.answer("");
    asking.hear("joint2 (servo 12) is id 12 at 1000000 baud");
    asking.hear("3 of 4: joint3");
    // No new servo: only those of the chain.
    asking.answer("");
    asking.hear("no new servo is among those that answer");
    asking.answer("s");
    asking.hear("4 of 4: joint4");
    asking.answer("s");
    asking
        .finish()
        .expect(0, &["handwave bus calibrate --config arm4.toml"]);
    for id in [11, 12] {
        assert_eq!(bench.register(id, "return_delay_time"), 0, "servo {id}");
        assert_eq!(bench.register(id, "status_return_level"), 2, "servo {id}");
        assert_eq!(bench.register(id, "torque_enable"), 0, "servo {id}");
    }
}

#[test]
fn a_taken_id_is_refused_and_the_new_servo_left_as_it_was() {
    let mut bench = Bench::start("1-2", &["--factory"]);
    let bus = bench.bus.clone();
    bench.plug(1, 1, 57_600);
    bench
        .run(&setup(&bus, &["--id", "11", "--yes"]))
        .expect(0, &["read back"]);
    bench.plug(2, 1, 57_600);
    bench
        .run(&setup(&bus, &["--id", "11", "--yes"]))
        .expect(3, &["id 11 at 1000000 baud is taken"]);
    let joint = ["--config", "arm4.toml", "--joint", "joint1", "--yes"];
    bench
        .run(&setup(&bus, &joint))
        .expect(0, &["joint1 (servo 11) is set up already"]);
    bench.plug(2, 1, 57_600);
}

#[test]
fn what_was_written_is_undone_one_servo_at_a_time() {
    let mut bench = Bench::start("1-2", &["--factory"]);
    let bus = bench.bus.clone();
    for (label, id) in [(1, "11"), (2, "12")] {
        bench.plug(label, 1, 57_600);
        let args = ["--id", id, "--limits", "1000-3000", "--yes"];
        bench.run(&setup(&bus, &args)).expect(0, &["read back"]);
        assert_eq!(
            bench.register(id.parse().expect("a number"), "max_position_limit"),
            3000
        );
    }
    let undo = |more: &[&str]| {
        let args = [&["--undo", "servo_undo.jsonl", "--yes"][..], more].concat();
        bench.run(&setup(&bus, &args))
    };
    undo(&[]).expect(2, &["several servos, now 11, 12", "--id N"]);
    undo(&["--id", "13"]).expect(2, &["nothing in this file"]);
    undo(&["--id", "12"]).expect(0, &["id 1 at 57600 baud"]);
    let slow = format!("{bus}@57600");
    for (register, value) in [("return_delay_time", 250), ("max_position_limit", 4095)] {
        assert_eq!(bench.register_at(&slow, 1, register), value, "{register}");
    }
    // The other one would now come to the same place: refused, and it stays whole.
    undo(&["--id", "11"]).expect(3, &["taken", "another servo answers there"]);
    undo(&["--id", "12"]).expect(2, &["nothing in this file"]);
}

#[test]
fn unplugged_half_way_it_says_where_the_servo_is_and_goes_on() {
    let mut bench = Bench::start("1", &["--factory"]);
    let bus = bench.bus.clone();
    bench.plug(1, 1, 57_600);
    let mut asking = bench.ask(&setup(&bus, &["--id", "11"]));
    asking.hear("Write these? [Y/n]");
    bench.hand("unplug 1");
    asking.answer("y");
    let told = asking.finish().expect(
        3,
        &[
            "The servo is now id 1 at 57600 baud",
            "goes on from there",
            "--undo servo_undo.jsonl",
        ],
    );
    assert!(
        told.err
            .contains("not yet: return_delay_time, id, baud_rate"),
        "{}",
        told.err
    );
    bench.plug(1, 1, 57_600);
    bench
        .run(&setup(&bus, &["--id", "11", "--yes"]))
        .expect(0, &["servo 11 is id 11"]);
    assert_eq!(bench.register(11, "return_delay_time"), 0);
}

#[test]
fn the_middle_of_the_turn_is_put_where_the_shaft_stands() {
    let mut bench = Bench::start("1", &[]);
    let bus = bench.bus.clone();
    bench.hand("turn 1 40");
    bench.wait_for_position(1, 2048 + 455, 2);
    bench
        .run(&setup(&bus, &["--id", "1", "--zero-here", "--yes"]))
        .expect(0, &["homing_offset"]);
    bench.wait_for_position(1, 2048, 2);
    bench.hand("turn 1 120");
    bench.wait_for_position(1, 2048 + 1365, 2);
    bench
        .run(&setup(&bus, &["--id", "1", "--zero-here", "--yes"]))
        .expect(2, &["160 deg from the middle", "Take the horn off"]);
}
