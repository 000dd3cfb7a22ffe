//! Supervision of whole runs: each thing that is watched is made to go wrong, and the declared reaction is seen.
//!
//! The built-in quadruped walks from about 6 s on; servo 9 is its rear left knee (joint 8), servo 7 the hip.

mod support;

use handwave::config::file::{OnBusLost, OnOverrun, OnServoFault, Rearm};
use handwave::config::safety::StopGesture;
use handwave::live::control::Ending;
use handwave::live::safety::{FaultKind, ServoState};
use handwave::puppet::Stage;
use std::time::Duration;
use support::rig::{Ran, Rig};

const KNEE: usize = 8;

#[track_caller]
fn safety_stop<'a>(ran: &'a Ran, parts: &[&str]) -> &'a str {
    let Ending::SafetyStop(reason) = &ran.report.ending else {
        panic!("ended as {:?}", ran.report.ending);
    };
    for part in parts {
        assert!(reason.contains(part), "no {part:?} in: {reason}");
    }
    ran.expect_inside();
    let torque = ran.report.torque.as_ref().expect("read back");
    assert!(torque.is_ok(), "{torque:?}");
    reason
}

#[track_caller]
fn complete(ran: &Ran) {
    let ending = &ran.report.ending;
    assert!(matches!(ending, Ending::Complete), "ended as {ending:?}");
    ran.expect_inside();
}

#[test]
fn a_healthy_walk_trips_nothing() {
    let ran = Rig::new(20.0, &[]).run();
    complete(&ran);
    assert_eq!(ran.report.stats.faults, []);
    assert!(ran.rows.iter().all(|row| row.vigour == 1.0));
    assert_eq!(ran.at(0.5).robot, ServoState::Moving);
    let last = ran.rows.last().expect("rows");
    assert_eq!(last.robot, ServoState::Holding, "in the end pose");
}

#[test]
fn a_blocked_knee_is_named_as_stalled_and_the_run_lies_down() {
    let ran = Rig::new(24.0, &["9:stuck@12s"]).run();
    let reason = safety_stop(
        &ran,
        &["servo 9 (rear_left_knee)", "stalled", "Clear what blocks"],
    );
    let found = ran.faults(FaultKind::Stall);
    assert_eq!(found.len(), 1, "{found:?}");
    let after = found[0].from_s - 12.0;
    assert!((0.5..2.0).contains(&after), "found after {after} s");
    println!("found after {after:.2} s: {reason}");
}

#[test]
fn a_knee_that_slips_is_named_as_not_following() {
    // A stripped gear: it stays where it was and gives no effort.
    let mut at = None;
    let ran = Rig::new(20.0, &[])
        .with(|c| c.safety.supervision.following_error_rad = 0.15)
        .ill(move |t_s, states, _| {
            if t_s >= 8.0 {
                let place = *at.get_or_insert(states[KNEE].position - 0.4);
                states[KNEE].position = place;
                (states[KNEE].velocity, states[KNEE].effort) = (0.0, 0.02);
            }
        })
        .run();
    let reason = safety_stop(
        &ran,
        &["servo 9 (rear_left_knee)", "following error", "limit 0.15"],
    );
    let after = ran.faults(FaultKind::FollowingError)[0].from_s - 8.0;
    assert!((0.25..2.0).contains(&after), "found after {after} s");
    println!("found after {after:.2} s: {reason}");
}

#[test]
fn a_servo_that_warms_up_walks_smaller_before_the_run_ends() {
    // 50 degrees at 8 s, one more each half second: 60 at 13 s, 70 at 18 s.
    let ran = Rig::new(40.0, &[])
        .ill(|t_s, _, health| {
            health[KNEE].temperature_c = Some((50.0 + 2.0 * (t_s - 8.0).max(0.0)).floor());
        })
        .run();
    let reason = safety_stop(&ran, &["servo 9 (rear_left_knee)", "too hot", "70 degrees"]);
    let warm = ran.faults(FaultKind::Warm)[0].from_s;
    assert!((13.0..14.1).contains(&warm), "warm from {warm} s");
    let steps = ran
        .rows
        .windows(2)
        .map(|r| (r[1].vigour - r[0].vigour).abs());
    let largest = steps.fold(0.0, f64::max);
    assert!(largest <= 0.5 * 0.005 + 1e-9, "vigour jumped by {largest}");
    let least = ran.at(18.0).vigour;
    assert!(least < 0.5, "vigour {least} just below the limit");
    let (before, after) = (ran.sweep(KNEE, 10.0, 13.0), ran.sweep(KNEE, 16.5, 18.0));
    println!("knee sweeps {before:.2} rad, warm {after:.2} rad; vigour {least:.2}; {reason}");
}

#[test]
fn a_weak_supply_makes_the_walk_smaller_and_a_good_one_large_again() {
    let ran = Rig::new(34.0, &[])
        .ill(|t_s, _, health| {
            let volts = if (15.0..20.0).contains(&t_s) {
                6.1
            } else {
                11.1
            };
            for health in health.iter_mut() {
                health.voltage_v = Some(volts);
            }
        })
        .run();
    complete(&ran);
    let weak = ran.faults(FaultKind::WeakSupply);
    assert_eq!(weak.len(), 12, "{weak:?}");
    let (low, back) = (ran.at(19.9).vigour, ran.at(28.0).vigour);
    assert!((0.4..0.6).contains(&low), "vigour {low} at 6.1 V");
    assert_eq!(back, 1.0, "8 s after the supply came back");
    let (before, during) = (ran.sweep(KNEE, 12.0, 14.0), ran.sweep(KNEE, 17.0, 20.0));
    assert!(
        during < 0.8 * before,
        "knee sweeps {before:.2} rad, then {during:.2} rad"
    );
    println!("knee sweeps {before:.2} rad, then {during:.2} rad at vigour {low:.2}");
}

#[test]
fn a_strained_servo_ends_the_run_after_motion_was_made_smaller() {
    let ran = Rig::new(40.0, &[])
        .ill(|t_s, states, _| {
            if t_s > 8.0 {
                states[KNEE].effort = 0.95;
            }
        })
        .run();
    safety_stop(&ran, &["servo 9 (rear_left_knee)", "overloaded", "effort"]);
    let strained = ran.faults(FaultKind::Strained)[0].from_s;
    let overloaded = ran.faults(FaultKind::Overload)[0].from_s;
    assert!(
        strained + 0.5 < overloaded,
        "strained at {strained} s, overloaded at {overloaded} s"
    );
}

#[test]
fn with_continue_a_blocked_knee_is_left_out_and_led_back_when_the_operator_says_so() {
    let ran = Rig::new(30.0, &["9:stuck@12s..16s"])
        .with(|c| c.safety.on_servo_fault = OnServoFault::Continue)
        .meddle(|record, _, stop| {
            if (record.t_s - 18.0).abs() < 1e-6 {
                stop.ask_rearm();
            }
        })
        .run();
    complete(&ran);
    let stall = ran.faults(FaultKind::Stall)[0];
    assert!(
        (12.5..14.0).contains(&stall.from_s),
        "stalled at {} s",
        stall.from_s
    );
    assert_eq!(stall.to_s, Some(18.005), "{stall:?}");
    assert!(ran.at(17.0).waits, "nobody is told to re-arm");
    assert_eq!(ran.at(17.0).robot, ServoState::Faulted);
    let (still, others) = (ran.sweep(KNEE, 16.0, 18.0), ran.sweep(KNEE - 3, 16.0, 18.0));
    assert!(still < 1e-3, "the knee is led {still} rad while left out");
    assert!(others > 0.1, "the others play on: {others} rad");
    let back = ran.sweep(KNEE, 21.0, 23.0);
    assert!(back > 0.1, "the knee plays again: {back} rad");
    assert!(!ran.at(22.0).waits);
    println!(
        "left out from {:.2} s, sweeps {back:.2} rad after",
        stall.from_s
    );
}

#[test]
fn with_continue_and_auto_a_servo_that_restarted_is_armed_where_it_is_and_led_back() {
    let ran = Rig::new(20.0, &["9:reboot@8s"])
        .with(|c| {
            c.safety.on_servo_fault = OnServoFault::Continue;
            c.safety.rearm = Rearm::Auto;
        })
        .run();
    complete(&ran);
    let limp = ran.faults(FaultKind::Torqueless)[0];
    let back = limp.to_s.expect("taken back");
    assert!((limp.from_s..limp.from_s + 2.0).contains(&back), "{limp:?}");
    assert_eq!(ran.faults(FaultKind::Rearmed).len(), 1);
    // From the torque coming on, its goal is never far from where it is.
    let furthest = ran
        .between(back, back + 1.0)
        .map(|row| (row.targets[KNEE] - row.states[KNEE]).abs())
        .fold(0.0, f64::max);
    assert!(
        furthest < 0.15,
        "goal and knee {furthest} rad apart after the re-arm"
    );
    assert!(ran.sweep(KNEE, back + 2.5, back + 4.5) > 0.1);
    println!(
        "limp {:.2}..{back:.2} s, at most {furthest:.3} rad apart after",
        limp.from_s
    );
}

#[test]
fn with_continue_a_latched_error_takes_an_operator_who_has_it_rebooted_and_armed() {
    let ran = Rig::new(22.0, &["9:overload@8s..9s"])
        .with(|c| c.safety.on_servo_fault = OnServoFault::Continue)
        .meddle(|record, _, stop| {
            if (record.t_s - 12.0).abs() < 1e-6 {
                stop.ask_rearm();
            }
        })
        .run();
    complete(&ran);
    let alert = ran.faults(FaultKind::Alert)[0];
    assert!((8.0..8.02).contains(&alert.from_s), "{alert:?}");
    assert_eq!(alert.value, 32.0, "register 70 was not read: {alert:?}");
    assert_eq!(ran.at(11.9).robot, ServoState::Faulted);
    let rearmed = ran.faults(FaultKind::Rearmed);
    assert_eq!(rearmed.len(), 1, "{:?}", ran.report.stats.faults);
    assert!(
        (12.2..14.0).contains(&rearmed[0].from_s),
        "{:?}",
        rearmed[0]
    );
    assert_eq!(ran.at(16.0).robot, ServoState::Moving);
    println!(
        "re-armed {:.2} s after the operator asked",
        rearmed[0].from_s - 12.0
    );
}

#[test]
fn a_lost_bus_ends_the_run_at_once_unless_told_to_wait() {
    let ran = Rig::new(20.0, &["bus:unplugged@8s..10s"]).run();
    assert!(
        matches!(ran.report.ending, Ending::Bus(_)),
        "{:?}",
        ran.report.ending
    );
    let last = ran.rows.last().expect("rows").t_s;
    assert!((7.9..8.6).contains(&last), "last cycle at {last} s");
    assert_eq!(ran.faults(FaultKind::BusLost).len(), 1);
}

#[test]
fn with_wait_a_bus_that_is_back_moves_nothing_until_it_is_rearmed() {
    let ran = Rig::new(24.0, &["bus:unplugged@8s..10s"])
        .with(|c| c.safety.on_bus_lost = Some(OnBusLost::Wait))
        .meddle(|record, _, stop| {
            // Once too early, while it is away; then when it is back.
            if (record.t_s - 9.0).abs() < 1e-6 || (record.t_s - 13.0).abs() < 1e-6 {
                stop.ask_rearm();
            }
        })
        .run();
    complete(&ran);
    assert_eq!(ran.at(9.5).robot, ServoState::Offline);
    assert_eq!(ran.at(12.5).robot, ServoState::Present);
    assert!(ran.at(12.5).waits);
    for joint in 0..12 {
        let states: Vec<f64> = ran.between(11.5, 13.0).map(|r| r.states[joint]).collect();
        let moved = states
            .iter()
            .fold(0.0_f64, |m, s| m.max((s - states[0]).abs()));
        assert!(
            moved < 1e-3,
            "joint {joint} moved by {moved} rad before the re-arm"
        );
    }
    let lost = ran.faults(FaultKind::BusLost)[0];
    let back = lost.to_s.expect("it came back");
    assert!((13.0..13.5).contains(&back), "{lost:?}");
    let apart = ran.between(back, back + 0.1).flat_map(|row| {
        let pairs = row.targets.iter().zip(&row.states);
        pairs.map(|(target, state)| (target - state).abs())
    });
    let apart = apart.fold(0.0, f64::max);
    assert!(
        apart < 0.05,
        "goals {apart} rad from the servos after the re-arm"
    );
    assert_eq!(ran.at(17.0).robot, ServoState::Moving);
    assert!(ran.sweep(KNEE, 16.5, 18.5) > 0.1, "it does not walk again");
    println!("re-armed at {back:.3} s, goals at most {apart:.4} rad from the servos");
}

#[test]
fn with_wait_a_bus_that_never_returns_is_a_bus_failure_at_the_end() {
    let ran = Rig::new(12.0, &["bus:unplugged@8s"])
        .with(|c| c.safety.on_bus_lost = Some(OnBusLost::Wait))
        .run();
    assert!(
        matches!(ran.report.ending, Ending::Bus(_)),
        "{:?}",
        ran.report.ending
    );
    // An operator who does not want to wait any longer is heard too.
    let ran = Rig::new(60.0, &["bus:unplugged@8s"])
        .with(|c| c.safety.on_bus_lost = Some(OnBusLost::Wait))
        .meddle(|record, _, stop| {
            if (record.t_s - 9.0).abs() < 1e-6 {
                stop.press();
            }
        })
        .run();
    let last = ran.rows.last().expect("rows").t_s;
    assert!((9.0..9.1).contains(&last), "ended at {last} s");
}

#[test]
fn a_machine_that_is_too_slow_holds_the_motion_and_goes_on_when_it_is_not() {
    for (on_overrun, stops) in [(OnOverrun::Hold, false), (OnOverrun::Stop, true)] {
        let ran = Rig::new(24.0, &[])
            .with(|c| c.safety.on_overrun = on_overrun)
            .meddle(|record, clock, _| {
                // Three seconds in which every cycle takes 7 ms longer than it may.
                if (8.0..11.0).contains(&record.t_s) && record.bus.bytes > 0 {
                    let late = Duration::from_millis(12);
                    handwave::base::Clock::sleep_until(
                        clock,
                        handwave::base::Clock::now(clock) + late,
                    );
                }
            })
            .run();
        let late = ran.faults(FaultKind::Overrun);
        assert_eq!(late.len(), 1, "{:?}", ran.report.stats.faults);
        if stops {
            safety_stop(&ran, &["cycles keep beginning late", "on_overrun"]);
            continue;
        }
        complete(&ran);
        let from = late[0].from_s;
        let held = ran.sweep(KNEE, from + 0.5, 11.0);
        assert!(held < 0.02, "held, the knee sweeps {held} rad");
        assert!(late[0].to_s.is_some_and(|to| to < 14.0), "{late:?}");
        assert!(ran.sweep(KNEE, 15.0, 17.0) > 0.1, "it does not walk again");
        println!("held {from:.2}..{:?} s", late[0].to_s);
    }
}

#[test]
fn the_stop_gesture_ends_the_run_in_order_like_the_key() {
    let ran = Rig::new(60.0, &[])
        .with(|c| {
            c.safety.stop_gesture = Some(StopGesture {
                name: "splay".into(),
                level: 0.6,
                hold_s: 0.3,
            });
        })
        .run();
    assert!(
        matches!(ran.report.ending, Ending::Interrupted),
        "{:?}",
        ran.report.ending
    );
    ran.expect_inside();
    let stopped = ran.faults(FaultKind::StopGesture);
    assert_eq!(stopped.len(), 1);
    let last = ran.rows.last().expect("rows");
    assert_eq!(last.stage, Stage::Done, "not in the end pose");
    println!(
        "stopped at {:.2} s, down at {:.2} s",
        stopped[0].from_s, last.t_s
    );
}
