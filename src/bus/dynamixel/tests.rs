//! Master and chain against scripted servos, in virtual time.

use super::model::address;
use super::scripted::{Stage, model};
use super::{
    ChainOptions, Client, ClientError, DynamixelChain, Master, MasterOptions, Outcome, ServoSpec,
};
use crate::base::{Clock, JointState, VirtualClock};
use crate::bus::{BusError, ServoBus};
use std::time::Duration;

const SERVOS: u8 = 12;
const PERIOD: Duration = Duration::from_millis(5);

struct Bench {
    stage: Stage,
    clock: VirtualClock,
    chain: DynamixelChain,
    states: Vec<JointState>,
    targets: Vec<f64>,
}

impl Bench {
    fn new() -> Self {
        let stage = Stage::new(SERVOS);
        let clock = VirtualClock::new();
        let chain = chain(&stage, &clock);
        Bench {
            stage,
            clock,
            chain,
            states: vec![JointState::default(); SERVOS.into()],
            targets: vec![0.0; SERVOS.into()],
        }
    }

    /// Prepared, armed and a second in motion, so that the allowance is learnt.
    fn running() -> Self {
        let mut bench = Bench::new();
        bench
            .chain
            .prepare(&mut bench.states)
            .expect("a healthy chain");
        bench.chain.arm().expect("a healthy chain");
        for _ in 0..200 {
            let report = bench.cycle().expect("a healthy chain");
            assert_eq!(report.fresh, u16::from(SERVOS), "{report:?}");
        }
        bench
    }

    fn cycle(&mut self) -> Result<crate::bus::CycleReport, BusError> {
        let next = self.clock.now() + PERIOD;
        let report = self.chain.exchange(&self.targets, &mut self.states);
        self.clock.sleep_until(next);
        report
    }
}

fn chain(stage: &Stage, clock: &VirtualClock) -> DynamixelChain {
    let master = Master::new(Box::new(stage.port(clock)), MasterOptions::default());
    let specs = (1..=SERVOS)
        .map(|id| ServoSpec::new(id, format!("joint{id}"), model()))
        .collect();
    let options = ChainOptions {
        bus: "dynamixel:/dev/ttyUSB0@1000000".into(),
        ..ChainOptions::default()
    };
    DynamixelChain::new(Box::new(master), specs, options).expect("sensible specs")
}

#[test]
fn a_fast_cycle_of_twelve_takes_its_wire_time() {
    let mut bench = Bench::running();
    let report = bench.cycle().expect("a healthy chain");
    assert_eq!(report.cycle_us, 2760, "fast cycle, us");
    assert_eq!(report.bytes, 276, "fast cycle, bytes");
    bench.stage.lock().fast = false;
    for _ in 0..10 {
        bench.cycle().expect("ordinary reads get through");
    }
    assert!(
        !bench.chain.uses_fast_reads(),
        "fast reads were not given up"
    );
    for _ in 0..400 {
        bench.cycle().expect("ordinary reads get through");
    }
    let report = bench.cycle().expect("a healthy chain");
    assert_eq!(report.fresh, 12, "{report:?}");
    assert_eq!(report.cycle_us, 3520, "ordinary cycle, us");
}

#[test]
fn a_silent_servo_costs_the_others_nothing() {
    let mut bench = Bench::running();
    bench.targets.fill(0.1);
    for silent in [0, 4, 11] {
        bench.stage.lock().puppets[silent].silent = true;
        for cycle in 0..100 {
            let report = bench.cycle().expect("eleven answer");
            assert_eq!(
                report.fresh,
                11,
                "cycle {cycle}, servo {} silent: {report:?}",
                silent + 1
            );
            assert_eq!(report.silent_mask, 1 << silent, "cycle {cycle}");
            assert!(
                report.cycle_us < 5000,
                "cycle {cycle} took {} us",
                report.cycle_us
            );
        }
        bench.stage.lock().puppets[silent].silent = false;
        for _ in 0..100 {
            bench.cycle().expect("all are back");
        }
        let report = bench.cycle().expect("all are back");
        assert_eq!((report.fresh, report.silent_mask), (12, 0), "{report:?}");
    }
}

#[test]
fn a_servo_that_was_silent_is_led_back_to_its_target() {
    let mut bench = Bench::running();
    bench.stage.lock().puppets[3].silent = true;
    bench.targets.fill(0.5);
    for _ in 0..100 {
        bench.cycle().expect("eleven answer");
    }
    bench.stage.lock().puppets[3].silent = false;
    let mut before = bench.stage.lock().puppets[3].goal();
    let mut ramping = 0;
    for _ in 0..300 {
        let report = bench.cycle().expect("all answer");
        let goal = bench.stage.lock().puppets[3].goal();
        // 1 rad/s in 5 ms are 3.3 counts.
        assert!(
            (goal - before).abs() <= 4,
            "goal jumps from {before} to {goal}"
        );
        before = goal;
        ramping += u32::from(report.ramping_mask == 1 << 3);
    }
    assert_eq!(before, 2374, "goal after the ramp");
    assert!(
        (95..=105).contains(&ramping),
        "0.5 rad at 1 rad/s took {ramping} cycles of 5 ms"
    );
}

#[test]
fn a_servo_that_comes_back_without_torque_is_not_driven() {
    let mut bench = Bench::running();
    bench.stage.lock().puppets[3].silent = true;
    bench.cycle().expect("eleven answer");
    {
        let mut stage = bench.stage.lock();
        stage.puppets[3].set(address::TORQUE_ENABLE, &[0]);
        stage.puppets[3].set(address::GOAL_POSITION, &[0; 4]);
    }
    for _ in 0..60 {
        bench.cycle().expect("eleven answer");
    }
    bench.stage.lock().puppets[3].silent = false;
    bench.targets.fill(0.5);
    for _ in 0..100 {
        bench.cycle().expect("all answer");
    }
    let report = bench.cycle().expect("all answer");
    assert_eq!(
        (report.fresh, report.torqueless_mask),
        (12, 1 << 3),
        "{report:?}"
    );
    assert_eq!(
        bench.stage.lock().puppets[3].goal(),
        0,
        "a goal was sent without torque"
    );
    bench.chain.rearm(3).expect("it can be rearmed");
    let report = bench.cycle().expect("all answer");
    assert_eq!(
        (report.torqueless_mask, report.ramping_mask),
        (0, 1 << 3),
        "{report:?}"
    );
    let goal = bench.stage.lock().puppets[3].goal();
    assert!(
        (2048..=2060).contains(&goal),
        "goal {goal} right after rearming at 2048"
    );
}

#[test]
fn damage_in_a_fast_answer_is_asked_for_again() {
    let mut bench = Bench::running();
    for (byte, least) in [(3, 0), (12, 11), (80, 11), (175, 11)] {
        bench.stage.lock().damage = Some(byte);
        let report = bench.cycle().expect("all answer");
        assert!(report.fresh >= least, "byte {byte} damaged: {report:?}");
        assert!(report.damaged > 0, "byte {byte} damaged and not counted");
        bench.stage.lock().damage = None;
        let report = bench.cycle().expect("all answer");
        assert_eq!(
            (report.fresh, report.ramping_mask),
            (12, 0),
            "byte {byte} damaged before"
        );
    }
    assert!(
        bench.chain.uses_fast_reads(),
        "single damages made it give fast reads up"
    );
}

#[test]
fn a_bus_without_any_answer_is_lost_after_half_a_second() {
    let mut bench = Bench::running();
    for puppet in &mut bench.stage.lock().puppets {
        puppet.silent = true;
    }
    let begin = bench.clock.now();
    let error = loop {
        if let Err(error) = bench.cycle() {
            break error;
        }
    };
    let after_s = bench.clock.now().secs_since(begin);
    assert!(matches!(error, BusError::Lost { .. }), "{error}");
    assert!((0.49..0.55).contains(&after_s), "lost after {after_s} s");
}

#[test]
fn torque_off_is_read_back_and_ends_soon_when_nobody_answers() {
    let mut bench = Bench::running();
    let report = bench.chain.torque_off().expect("the port works");
    assert_eq!(report.confirmed_off.len(), 12, "{report:?}");
    assert!(
        bench
            .stage
            .lock()
            .puppets
            .iter()
            .all(|p| p.get(64, 1) == [0] && p.get(98, 1) == [0])
    );

    for puppet in &mut bench.stage.lock().puppets {
        puppet.silent = true;
    }
    let begin = bench.clock.now();
    let report = bench.chain.torque_off().expect("the port works");
    let took_s = bench.clock.now().secs_since(begin);
    assert_eq!(report.unconfirmed.len(), 12, "{report:?}");
    assert!(took_s < 0.3, "gave up after {took_s} s");
}

#[test]
fn after_a_pause_of_our_own_tripped_watchdogs_are_cleared() {
    let mut bench = Bench::running();
    assert_eq!(
        bench.stage.lock().puppets[0].get(98, 1),
        [5],
        "watchdog armed"
    );
    for puppet in &mut bench.stage.lock().puppets {
        puppet.set(98, &[0xFF]);
    }
    bench
        .clock
        .advance_to(bench.clock.now() + Duration::from_millis(150));
    let report = bench.cycle().expect("all answer");
    assert_eq!(report.fresh, 12, "{report:?}");
    assert!(
        bench
            .stage
            .lock()
            .puppets
            .iter()
            .all(|p| p.get(98, 1) == [5]),
        "armed again"
    );
}

/// What `prepare` says when one register of servo 2 holds these bytes.
fn complaint(address: u16, bytes: &[u8]) -> String {
    let mut bench = Bench::new();
    bench.stage.lock().puppets[1].set(address, bytes);
    let outcome = bench.chain.prepare(&mut bench.states);
    outcome.expect_err("it should be refused").to_string()
}

#[test]
fn an_unfit_servo_is_refused_with_the_command_that_mends_it() {
    for (address, bytes, part) in [
        (
            0,
            &[0x5E, 0x01][..],
            "it is an unknown model (model number 350)",
        ),
        (0, &[0xFC, 0x03][..], "it is xm430-w350 (model number 1020)"),
        (
            11,
            &[4],
            "handwave bus write dynamixel:/dev/ttyUSB0@1000000 2 operating_mode 3",
        ),
        (
            10,
            &[1],
            "handwave bus write dynamixel:/dev/ttyUSB0@1000000 2 drive_mode 0",
        ),
        (70, &[0x24], "overheating, overload (register 70 = 0x24)"),
        (
            70,
            &[0x04],
            "handwave bus reboot dynamixel:/dev/ttyUSB0@1000000 2",
        ),
        (48, &[0, 8, 0, 0], "its position limits are 0 to 2048"),
        (132, &[0, 0x20, 0, 0], "it stands at 8192"),
    ] {
        let message = complaint(address, bytes);
        assert!(message.contains(part), "register {address}: {message}");
        assert!(message.contains("servo 2 (joint joint2)"), "{message}");
    }
}

#[test]
fn an_absent_servo_is_named() {
    let mut bench = Bench::new();
    bench.stage.lock().puppets[6].silent = true;
    let error = bench
        .chain
        .prepare(&mut bench.states)
        .expect_err("servo 7 is absent");
    let message = error.to_string();
    assert!(
        message.contains("servo 7 (joint joint7) does not answer on scripted"),
        "{message}"
    );
}

#[test]
fn preparing_turns_no_torque_on_and_arming_starts_from_where_it_stands() {
    let mut bench = Bench::new();
    bench.stage.lock().puppets[4].set(address::PRESENT_POSITION, &1500i32.to_le_bytes());
    bench.stage.lock().puppets[5].set(98, &[0xFF]);
    bench
        .chain
        .prepare(&mut bench.states)
        .expect("a healthy chain");
    assert!(
        bench
            .stage
            .lock()
            .puppets
            .iter()
            .all(|p| p.get(64, 1) == [0]),
        "torque came on"
    );
    bench.targets.fill(1.0);
    bench.cycle().expect("reading before arming");
    assert_eq!(
        bench.stage.lock().puppets[0].goal(),
        0,
        "a goal was sent before arming"
    );
    bench.chain.arm().expect("a healthy chain");
    let stage = bench.stage.lock();
    assert_eq!(
        (stage.puppets[0].goal(), stage.puppets[4].goal()),
        (2048, 1500)
    );
    assert!(
        stage.puppets.iter().all(|p| p.get(64, 1) == [1]),
        "torque is on"
    );
}

#[test]
fn an_absent_servo_costs_a_read_little_more_than_its_wire_time() {
    let stage = Stage::new(1);
    let clock = VirtualClock::new();
    let mut master = Master::new(Box::new(stage.port(&clock)), MasterOptions::default());
    for _ in 0..1000 {
        master.ping(1).expect("servo 1 answers");
    }
    let begin = clock.now();
    let error = master
        .read(2, 132, &mut [0; 4])
        .expect_err("servo 2 is absent");
    assert!(
        matches!(error, ClientError::Timeout { id: 2, .. }),
        "{error}"
    );
    let took = clock.now().saturating_since(begin);
    assert!(took < Duration::from_millis(2), "gave up after {took:?}");
}

#[test]
fn a_read_of_several_says_what_became_of_each() {
    let stage = Stage::new(4);
    stage.lock().puppets[2].silent = true;
    let clock = VirtualClock::new();
    let mut master = Master::new(Box::new(stage.port(&clock)), MasterOptions::default());
    let mut data = [0xEE; 16];
    let mut outcomes = [Outcome::NotReached; 4];
    for fast in [false, true] {
        let read = if fast {
            Master::fast_sync_read
        } else {
            Master::sync_read
        };
        read(&mut master, 132, 4, &[1, 2, 3, 4], &mut data, &mut outcomes).expect("the port works");
        assert!(
            matches!(
                outcomes,
                [
                    Outcome::Fresh(_),
                    Outcome::Fresh(_),
                    Outcome::Silent,
                    Outcome::NotReached
                ]
            ),
            "fast {fast}: {outcomes:?}"
        );
        assert_eq!(
            data[8..],
            [0xEE; 8],
            "fast {fast}: data of silent servos was touched"
        );
    }
}
