//! One scenario per fault of a servo: injected at 8 s while the quadruped trots, in virtual time.
//!
//! Of every run the harness checks that no target leaves the envelope, that the run ends lying, and that
//! torque is read back off.

mod support;

use support::program::handwave;
use support::scenario::{CYCLE_S, OVER_S, Played, SERVO, STRIKES_S, play};

/// For the second in which the legs trot.
fn struck(fault: &str, codes: &[i32]) -> Played {
    let spec = format!("{SERVO}:{fault}@{STRIKES_S:.1}s..{OVER_S:.1}s");
    let played = play(&[&spec], codes);
    println!("{}", played.line());
    let told = played.summary["injected"][0].as_str();
    assert_eq!(
        told,
        Some(spec.as_str()),
        "the summary lists what was injected"
    );
    played
}

/// It answers nothing that can be used, and is back when the fault is over.
fn drops_out(fault: &str, healthy_missed: u64) {
    let played = struck(fault, &[0]);
    played.expect_reported(STRIKES_S);
    played.expect_healthy_joints_missed_at_most(healthy_missed);
    played.expect_others_to_move();
    let back_s = played
        .faults()
        .iter()
        .filter(|f| f.servo == SERVO)
        .map(|f| f.to_s)
        .fold(0.0, f64::max);
    // A silent servo is asked again four times a second.
    assert!(
        (OVER_S - CYCLE_S..OVER_S + 0.3).contains(&back_s),
        "{fault}: back at {back_s:.3} s"
    );
}

/// It latches an error: the run ends lying, with the servo named and what to do.
fn latches(fault: &str) {
    let played = struck(fault, &[4]);
    played.expect_reported(STRIKES_S);
    played.expect_healthy_joints_missed_at_most(0);
    played.expect_advice();
    let cycles = played.summary["cycles"].as_u64().unwrap_or(0);
    assert!(
        cycles < 2600,
        "{fault}: lying down took until cycle {cycles}"
    );
}

/// What it does shows in its motion only: the wire stays clean, the run goes on or ends as declared.
fn misbehaves(fault: &str) -> Played {
    let played = struck(fault, &[0, 4]);
    played.expect_healthy_joints_missed_at_most(0);
    if played.code() == 4 {
        played.expect_advice();
    } else {
        played.expect_others_to_move();
    }
    played
}

#[test]
fn one_that_falls_silent_costs_only_itself() {
    drops_out("silent", 0);
    drops_out("disconnected", 0);
}

#[test]
fn one_that_answers_late_costs_the_others_the_cycle_it_speaks_into() {
    for ms in ["0.2", "1", "3"] {
        let played = struck(&format!("late={ms}"), &[0]);
        played.expect_healthy_joints_missed_at_most(1);
        played.expect_others_to_move();
    }
    // 5 ms is a whole cycle: the answer falls into the next request, and what that brings about into the one after.
    drops_out("late", 2);
}

#[test]
fn one_whose_replies_are_damaged_costs_only_itself() {
    drops_out("corrupt", 0);
    drops_out("truncated", 0);
    drops_out("wrong-id", 0);
    drops_out("refuses", 0);
}

#[test]
fn one_that_shares_its_id_with_another_costs_only_itself() {
    drops_out("duplicate-id", 0);
}

#[test]
fn one_that_says_everything_twice_is_borne() {
    let played = struck("duplicated", &[0]);
    played.expect_healthy_joints_missed_at_most(1);
    played.expect_others_to_move();
    assert!(
        played.summary["damage"].as_u64() > Some(100),
        "{}",
        played.summary
    );
}

#[test]
fn each_latched_error_ends_the_run_lying_with_its_servo_named() {
    for fault in ["overload", "overheat", "voltage", "encoder", "shock"] {
        latches(fault);
    }
}

#[test]
fn a_supply_too_low_for_one_servo_latches_its_voltage_error() {
    latches("sag");
    // Four volts less: weaker, and within its limits.
    let weak = misbehaves("sag=4");
    assert_eq!(weak.code(), 0, "{}", weak.ended.err);
}

#[test]
fn a_brown_out_of_one_servo_ends_the_run_with_its_torque_off() {
    let played = struck("reboot", &[4]);
    played.expect_reported(STRIKES_S);
    played.expect_healthy_joints_missed_at_most(0);
    played.expect_advice();
    let torqueless = played
        .faults()
        .into_iter()
        .find(|f| f.kind == "without torque");
    let at_s = torqueless.map_or(f64::NAN, |f| f.from_s);
    // It is mute for a quarter of a second.
    assert!(
        (8.25..8.6).contains(&at_s),
        "without torque from {at_s:.3} s"
    );
}

#[test]
fn one_that_does_not_do_what_it_is_told_disturbs_nobody() {
    for fault in [
        "deaf",
        "torque-loss",
        "stuck",
        "slow",
        "heavy-load",
        "watchdog-trip",
    ] {
        misbehaves(fault);
    }
}

#[test]
fn one_whose_encoder_lies_disturbs_nobody() {
    for fault in ["encoder-jump", "noise", "frozen-position"] {
        misbehaves(fault);
    }
}

#[test]
fn a_defect_of_the_watchdog_does_not_show_while_the_host_lives() {
    for fault in ["watchdog-defect", "watchdog-runaway"] {
        let played = misbehaves(fault);
        assert_eq!(played.code(), 0, "{fault}: {}", played.ended.err);
    }
}

#[test]
fn a_blocked_leg_overloads_within_seconds_and_ends_the_run() {
    let spec = format!("{SERVO}:heavy-load=1.0@{STRIKES_S:.1}s");
    let played = play(&[&spec], &[4]);
    println!("{}", played.line());
    played.expect_advice();
}

#[test]
fn every_fault_in_the_list_has_a_scenario_here() {
    let source = include_str!("faults_servo.rs");
    let list = handwave(&["sim", "dynamixel", "--list-faults"]).expect(0);
    let names: Vec<&str> = list
        .out
        .lines()
        .filter_map(|line| line.split_once(' '))
        .filter(|(_, rest)| rest.starts_with("servo "))
        .map(|(name, _)| name)
        .collect();
    assert!(names.len() >= 15, "{names:?}");
    for name in names {
        let quoted = format!("\"{name}\"");
        assert!(source.contains(&quoted), "no scenario for {name}");
    }
}
