//! One scenario per fault of the line: injected at 8 s while the quadruped trots, in virtual time.
//!
//! Of every run the harness checks that no target leaves the envelope, that the run ends lying, and that
//! torque is read back off, unless the bus is gone.

mod support;

use support::program::handwave;
use support::scenario::{CYCLE_S, Played, SERVO, STRIKES_S, play};

fn struck(fault: &str, codes: &[i32]) -> Played {
    let spec = format!("bus:{fault}@8.0s..9.0s");
    let played = play(&[&spec], codes);
    println!("{}", played.line());
    played
}

/// The line stays good enough to play on: nobody is blamed for longer than `at_most_s` on end.
fn is_borne(fault: &str, at_most_s: f64) {
    let played = struck(fault, &[0]);
    played.expect_others_to_move();
    for seen in played.faults() {
        let lasted_s = seen.to_s - seen.from_s;
        assert!(
            seen.kind == "silent" && lasted_s <= at_most_s + 1e-9,
            "{fault}: {seen:?}"
        );
    }
}

#[test]
fn damage_now_and_then_costs_single_cycles() {
    is_borne("corrupt=0.02", 3.0 * CYCLE_S);
    is_borne("truncated=0.02", 3.0 * CYCLE_S);
    // Every fourth cycle is hit, and now and then the second try of a servo with it.
    is_borne("lost-bytes=0.001", 5.0 * CYCLE_S);
}

#[test]
fn replies_said_twice_foreign_ones_and_stale_bytes_are_told_from_ours() {
    is_borne("duplicated", 3.0 * CYCLE_S);
    is_borne("foreign", 3.0 * CYCLE_S);
    is_borne("noise", 3.0 * CYCLE_S);
}

#[test]
fn an_echo_is_told_from_an_answer() {
    is_borne("echo", 3.0 * CYCLE_S);
}

#[test]
fn an_adapter_that_keeps_bytes_back_is_borne_or_ends_the_run_as_declared() {
    for ms in ["1", "16"] {
        // Later than a cycle is long: at worst the bus counts as lost.
        let codes: &[i32] = if ms == "1" { &[0] } else { &[0, 3, 4] };
        struck(&format!("latency={ms}"), codes);
    }
}

#[test]
fn behind_a_silent_servo_those_that_wait_in_vain_lose_no_more_than_those_that_pass_over_it() {
    let silent = format!("{SERVO}:silent@{STRIKES_S:.1}s..9.0s");
    for more in [&[][..], &["bus:wait-in-vain@0s"]] {
        let specs = [&[silent.as_str()][..], more].concat();
        let played = play(&specs, &[0]);
        println!("{}", played.line());
        played.expect_reported(STRIKES_S);
        played.expect_healthy_joints_missed_at_most(1);
        played.expect_others_to_move();
    }
}

#[test]
fn a_brown_out_of_all_ends_the_run() {
    let played = struck("brown-out", &[3, 4]);
    assert!(
        played.ended.err.contains("torque") || played.ended.err.contains("servo"),
        "{}",
        played.ended.err
    );
}

#[test]
fn an_adapter_unplugged_for_good_ends_the_run_within_two_seconds() {
    for spec in ["bus:unplugged@8.0s", "bus:unplugged=1@8.0s..9.0s"] {
        let played = play(&[spec], &[3]);
        println!("{}: {}", played.line(), played.ended.err.trim());
        let cycles = played.targets.rows.len();
        assert!(
            (1599..=2000).contains(&cycles),
            "{spec}: ended after {cycles} cycles"
        );
        assert!(
            played.ended.err.contains("unplugged") || played.ended.err.contains("plugged it in"),
            "{}",
            played.ended.err
        );
    }
}

#[test]
fn every_fault_in_the_list_has_a_scenario_here() {
    let source = include_str!("faults_bus.rs");
    let list = handwave(&["sim", "dynamixel", "--list-faults"]).expect(0);
    let names: Vec<&str> = list
        .out
        .lines()
        .filter_map(|line| line.split_once(' '))
        .filter(|(_, rest)| rest.starts_with("bus "))
        .map(|(name, _)| name)
        .collect();
    assert!(names.len() >= 11, "{names:?}");
    for name in names {
        let found = ["\"", "=", "@"].iter().any(|end| {
            source.contains(&format!("\"{name}{end}"))
                || source.contains(&format!("bus:{name}{end}"))
        });
        assert!(found, "no scenario for {name}");
    }
}
