//! Every instruction of Protocol 2.0 through the driver that ships, against simulated servos, in virtual time.

use handwave::base::{Clock, VirtualClock};
use handwave::bus::dynamixel::model::address;
use handwave::bus::dynamixel::{
    Backup, BulkReadEntry, BulkWriteEntry, Client, ClientError, FactoryReset, Master,
    MasterOptions, Outcome, client::meaning,
};
use handwave::sim::line::SharedLine;
use handwave::sim::models::XL430_W250;
use handwave::sim::{Line, LineOptions, SimPort};
use handwave_dynamixel::ErrorCode;
use std::sync::Arc;
use std::time::Duration;

const ALL: u8 = 254;

/// Four servos, and the master at the other end of the line.
struct Bench {
    clock: VirtualClock,
    line: SharedLine,
    master: Master,
}

impl Bench {
    fn new() -> Self {
        let clock = VirtualClock::new();
        let line = Line::commissioned(&XL430_W250, 1..=4, 1_000_000, LineOptions::default());
        let line = SharedLine::new(line.expect("a known rate"));
        let port = SimPort::new(line.clone(), Arc::new(clock.clone()), 1_000_000);
        Bench {
            master: Master::new(Box::new(port), MasterOptions::default()),
            clock,
            line,
        }
    }

    fn read<const N: usize>(&mut self, id: u8, address: u16) -> [u8; N] {
        let mut data = [0; N];
        let answer = self.master.read(id, address, &mut data);
        answer.unwrap_or_else(|error| panic!("servo {id}, register {address}: {error}"));
        data
    }

    fn write(&mut self, id: u8, address: u16, data: &[u8]) {
        let answer = self.master.write(id, address, data);
        answer.unwrap_or_else(|error| panic!("servo {id}, register {address}: {error}"));
    }

    fn wait(&self, seconds: f64) {
        let until = self.clock.now() + Duration::from_secs_f64(seconds);
        self.clock.sleep_until(until);
        self.line.lock().advance(until);
    }

    fn fault(&self, spec: &str) {
        let fault = spec.parse().expect("a good specification");
        self.line.lock().inject(fault).expect("a servo of the line");
    }
}

fn refusal<T: std::fmt::Debug>(outcome: Result<T, ClientError>) -> ErrorCode {
    match outcome {
        Err(ClientError::Refused { error, .. }) => error,
        other => panic!("expected a refusal, found {other:?}"),
    }
}

#[test]
fn held_writes_wait_for_the_action_and_begin_together() {
    let mut bench = Bench::new();
    let error = refusal(bench.master.action(1));
    assert_eq!(
        error,
        ErrorCode::Instruction,
        "an action without a held write"
    );
    for id in 1..=4 {
        bench.write(id, address::TORQUE_ENABLE, &[1]);
        let goal = (2048 + 100 * i32::from(id)).to_le_bytes();
        bench
            .master
            .reg_write(id, address::GOAL_POSITION, &goal)
            .expect("a write that can be held");
        assert_eq!(bench.read(id, address::REGISTERED_INSTRUCTION), [1]);
        assert_eq!(
            bench.read(id, address::GOAL_POSITION),
            2048i32.to_le_bytes()
        );
    }
    bench.master.action(ALL).expect("the port works");
    bench.wait(0.01);
    for id in 1..=4u8 {
        let goal = i32::from_le_bytes(bench.read(id, address::GOAL_POSITION));
        assert_eq!(
            goal,
            2048 + 100 * i32::from(id),
            "servo {id} after the action"
        );
        assert_eq!(bench.read(id, address::REGISTERED_INSTRUCTION), [0]);
    }
}

#[test]
fn a_bulk_write_reaches_registers_of_its_own_of_each() {
    let mut bench = Bench::new();
    let entries = [
        BulkWriteEntry {
            id: 3,
            address: address::GOAL_POSITION,
            data: &[0x10, 0x08, 0, 0],
        },
        BulkWriteEntry {
            id: 1,
            address: 65,
            data: &[1],
        },
        // The pattern that has to be stuffed.
        BulkWriteEntry {
            id: 2,
            address: address::PROFILE_ACCELERATION,
            data: &[0xFF, 0x7F, 0, 0, 0xFF, 0x7F, 0, 0],
        },
    ];
    bench.master.bulk_write(&entries).expect("the port works");
    bench.wait(0.01);
    assert_eq!(bench.read(3, address::GOAL_POSITION), [0x10, 0x08, 0, 0]);
    assert_eq!(bench.read(1, 65), [1], "led of servo 1");
    assert_eq!(bench.read(4, 65), [0], "led of servo 4, which nobody wrote");
    assert_eq!(bench.read(2, address::PROFILE_VELOCITY), [0xFF, 0x7F, 0, 0]);
    let twice = [entries[0], entries[0]];
    let error = bench.master.bulk_write(&twice).expect_err("servo 3 twice");
    assert!(
        error.to_string().contains("servo 3 stands twice"),
        "{error}"
    );
}

/// Different registers and lengths of four servos, servo 9 not on the line, in both kinds of bulk read.
#[test]
fn a_bulk_read_says_what_became_of_each() {
    let entry = |id, address, length| BulkReadEntry {
        id,
        address,
        length,
    };
    for fast in [false, true] {
        let mut bench = Bench::new();
        let entries = [
            entry(4, address::PRESENT_POSITION, 4),
            entry(2, address::MODEL_NUMBER, 2),
            entry(3, address::PRESENT_TEMPERATURE, 1),
            entry(1, address::PRESENT_STATE, 10),
        ];
        let mut data = [0xEE; 17];
        let mut outcomes = [Outcome::NotReached; 4];
        let read = if fast {
            Master::fast_bulk_read
        } else {
            Master::bulk_read
        };
        let begin = bench.clock.now();
        read(&mut bench.master, &entries, &mut data, &mut outcomes).expect("the port works");
        let took_us = bench.clock.now().saturating_since(begin).as_micros();
        assert!(
            outcomes.iter().all(|o| matches!(o, Outcome::Fresh(_))),
            "fast {fast}: {outcomes:?}"
        );
        assert_eq!(
            data[..7],
            [0, 8, 0, 0, 0x24, 0x04, 32],
            "fast {fast}: {data:?}"
        );
        assert_eq!(
            data[13..],
            [0, 8, 0, 0],
            "fast {fast}, position of servo 1: {data:?}"
        );
        // 10 + 4 * 5 bytes out; 8 + 4 * 4 + 17 or 4 * 11 + 17 back.
        let wire_us = 10 * (30 + if fast { 41 } else { 61 });
        assert!(
            took_us.abs_diff(wire_us) <= 1,
            "fast {fast}: {took_us} us, wire time {wire_us} us"
        );

        // One that is not there takes the ones behind it along, as a fast read does.
        let mut outcomes = [Outcome::NotReached; 3];
        let absent = [entries[0], entry(9, 132, 4), entries[2]];
        read(&mut bench.master, &absent, &mut data, &mut outcomes).expect("the port works");
        assert!(
            matches!(outcomes[0], Outcome::Fresh(_)),
            "fast {fast}: {outcomes:?}"
        );
        assert_eq!(outcomes[1], Outcome::Silent, "fast {fast}: {outcomes:?}");

        // Damage on the line costs the blocks from there on, not those before.
        bench.fault(&format!("2:corrupt=1@{}s", bench.clock.now().secs()));
        let mut outcomes = [Outcome::NotReached; 4];
        read(&mut bench.master, &entries, &mut data, &mut outcomes).expect("the port works");
        assert!(
            matches!(outcomes[0], Outcome::Fresh(_)),
            "fast {fast}: {outcomes:?}"
        );
        assert!(
            !matches!(outcomes[1], Outcome::Fresh(_)),
            "fast {fast}: {outcomes:?}"
        );

        let twice = [entries[0], entries[0]];
        let error = read(&mut bench.master, &twice, &mut data, &mut outcomes);
        assert!(
            matches!(error, Err(ClientError::TwiceInList { id: 4 })),
            "{error:?}"
        );
    }
}

#[test]
fn turns_are_cleared_at_rest_only() {
    let mut bench = Bench::new();
    bench.write(1, address::OPERATING_MODE, &[4]);
    bench.write(1, address::TORQUE_ENABLE, &[1]);
    bench.write(1, address::GOAL_POSITION, &12_288i32.to_le_bytes());
    bench.wait(0.5);
    let error = refusal(bench.master.clear_multi_turn(1));
    assert_eq!(error, ErrorCode::ResultFail, "while it moves");
    bench.wait(6.0);
    let before = i32::from_le_bytes(bench.read(1, address::PRESENT_POSITION));
    assert!(
        (12_270..=12_300).contains(&before),
        "stands at {before} after three turns"
    );
    bench.master.clear_multi_turn(1).expect("at rest");
    let after = i32::from_le_bytes(bench.read(1, address::PRESENT_POSITION));
    assert_eq!(after, before.rem_euclid(4096), "whole turns are gone");
}

#[test]
fn a_backup_brings_the_table_back() {
    let mut bench = Bench::new();
    bench.write(2, address::TORQUE_ENABLE, &[1]);
    let error = refusal(bench.master.back_up(2, Backup::Store));
    assert_eq!(error, ErrorCode::ResultFail, "torque is on");
    bench.write(2, address::TORQUE_ENABLE, &[0]);
    bench.write(2, address::MOVING_THRESHOLD, &77i32.to_le_bytes());
    bench.write(2, address::POSITION_P_GAIN, &700u16.to_le_bytes());
    bench
        .master
        .back_up(2, Backup::Store)
        .expect("torque is off");
    bench.write(2, address::MOVING_THRESHOLD, &5i32.to_le_bytes());
    bench.write(2, address::POSITION_P_GAIN, &100u16.to_le_bytes());
    bench
        .master
        .back_up(2, Backup::Restore)
        .expect("there is a backup");
    bench.wait(0.6);
    assert_eq!(
        bench.read(2, address::MOVING_THRESHOLD),
        77i32.to_le_bytes()
    );
    assert_eq!(
        bench.read(2, address::POSITION_P_GAIN),
        700u16.to_le_bytes()
    );
    let error = refusal(bench.master.back_up(3, Backup::Restore));
    assert_eq!(error, ErrorCode::DataRange, "nothing was stored");
}

#[test]
fn a_factory_reset_keeps_what_it_is_told_to() {
    for (what, id, baud) in [
        (FactoryReset::KeepIdAndBaud, 3, 1_000_000),
        (FactoryReset::KeepId, 3, 57_600),
        (FactoryReset::All, 1, 57_600),
    ] {
        let mut bench = Bench::new();
        bench.line.lock().set_plugged(1, false, bench.clock.now());
        bench.write(3, address::MOVING_THRESHOLD, &77i32.to_le_bytes());
        bench
            .master
            .factory_reset(3, what)
            .expect("it answers before it restarts");
        bench.wait(0.6);
        bench.master.set_baud(baud).expect("any rate");
        assert_eq!(
            bench.read(id, address::MOVING_THRESHOLD),
            10i32.to_le_bytes(),
            "{what:?}"
        );
        assert_eq!(
            bench.read(id, address::RETURN_DELAY_TIME),
            [250],
            "{what:?}"
        );
    }
    // Never everything of everybody: all would have one id.
    let mut bench = Bench::new();
    bench
        .master
        .factory_reset(ALL, FactoryReset::All)
        .expect("the port works");
    bench.wait(0.6);
    bench
        .master
        .ping(4)
        .expect("firmware 42 and above ignores it");
}

#[test]
fn refusals_are_told_apart() {
    let mut bench = Bench::new();
    bench.write(1, address::TORQUE_ENABLE, &[1]);
    for (what, address, data, expected) in [
        (
            "a read-only register",
            address::PRESENT_POSITION,
            &[0, 0, 0, 0][..],
            ErrorCode::Access,
        ),
        (
            "EEPROM with torque on",
            address::ID,
            &[9],
            ErrorCode::Access,
        ),
        ("a register that is not there", 700, &[0], ErrorCode::Access),
        (
            "half a register",
            address::GOAL_POSITION,
            &[0, 0],
            ErrorCode::DataLength,
        ),
        ("a value out of range", 65, &[2], ErrorCode::DataRange),
        (
            "a goal beyond the limits",
            address::GOAL_POSITION,
            &[0, 0x20, 0, 0],
            ErrorCode::DataLimit,
        ),
    ] {
        let outcome = bench.master.write(1, address, data);
        let text = outcome.as_ref().expect_err(what).to_string();
        assert_eq!(refusal(outcome), expected, "{what}: {text}");
        assert!(text.contains(meaning(expected)), "{what}: {text}");
    }
    // The alert flag stands beside a valid answer.
    bench.fault(&format!("2:overload@{}s", bench.clock.now().secs()));
    bench.wait(0.01);
    let mut errors = [0];
    let reply = bench
        .master
        .read(2, address::HARDWARE_ERROR_STATUS, &mut errors);
    assert!(reply.expect("alert is no failure").alert);
    assert_eq!(errors, [0x20], "overload");
}
