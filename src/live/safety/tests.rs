//! The supervisor alone: shown cycles by hand, asked what follows.

use super::*;
use crate::base::{JointState, Time};
use crate::bus::{CycleReport, ServoFacts, ServoHealth};
use crate::config::file::{OnOverrun, OnServoFault, Rearm, SafetyEntry};
use crate::config::safety::{StopGesture, Supervision};

const DT_S: f64 = 0.005;

fn supervision() -> Supervision {
    let entry = SafetyEntry::default();
    Supervision {
        following_error_rad: entry.following_error_rad,
        following_error_s: entry.following_error_s,
        servo_lag_s: entry.servo_lag_s,
        stall_effort: entry.stall_effort,
        stall_s: entry.stall_s,
        temperature_limit_c: None,
        temperature_margin_c: entry.temperature_margin_c,
        voltage_range_v: None,
        voltage_margin_v: entry.voltage_margin_v,
        effort_limit: entry.effort_limit,
        effort_window_s: entry.effort_window_s,
        derate_least: entry.derate_least,
    }
}

fn policy(on_servo_fault: OnServoFault, rearm: Rearm) -> Policy {
    Policy {
        supervision: supervision(),
        on_servo_fault,
        rearm,
        on_overrun: OnOverrun::Hold,
        stop_gesture: None,
    }
}

/// Three servos that follow at once, until a test says otherwise.
struct Bench {
    supervisor: Supervisor,
    cycle: u64,
    targets: [f64; 3],
    states: [JointState; 3],
    health: [ServoHealth; 3],
    report: CycleReport,
    late: bool,
    not_finite: usize,
    rearm: bool,
    gesture: f64,
    follow: bool,
    told: Vec<(f64, Change)>,
}

impl Bench {
    fn new(policy: Policy) -> Self {
        let mut supervisor = Supervisor::new(3, policy);
        assert_eq!(supervisor.robot(), ServoState::Offline);
        let facts = ServoFacts {
            temperature_limit_c: Some(72.0),
            voltage_range_v: Some((6.0, 14.0)),
            ..ServoFacts::default()
        };
        supervisor.found(&[facts.clone(), facts.clone(), facts]);
        assert_eq!(supervisor.robot(), ServoState::Present);
        supervisor.armed();
        assert_eq!(supervisor.robot(), ServoState::Armed);
        Self {
            supervisor,
            cycle: 0,
            targets: [0.0; 3],
            states: [JointState::default(); 3],
            health: [ServoHealth::default(); 3],
            report: CycleReport::default(),
            late: false,
            not_finite: 0,
            rearm: false,
            gesture: 0.0,
            follow: true,
            told: Vec::new(),
        }
    }

    fn t_s(&self) -> f64 {
        self.cycle as f64 * DT_S
    }

    fn cycle(&mut self) -> Verdict {
        let t_s = self.t_s();
        for (joint, target) in self.targets.iter_mut().enumerate() {
            if target.is_finite() {
                *target = 0.5 * (2.0 * t_s + joint as f64).sin();
            }
        }
        for (joint, state) in self.states.iter_mut().enumerate() {
            if self.report.silent_mask >> joint & 1 == 1 {
                continue;
            }
            if self.follow {
                state.position = self.targets[joint];
                state.velocity = (2.0 * t_s).cos();
            }
            state.measured_at = Some(Time::from_secs(t_s));
        }
        for health in &mut self.health {
            health.measured_at = Some(Time::from_secs(t_s));
        }
        let verdict = self.supervisor.step(&Seen {
            t_s,
            targets: &self.targets,
            states: &self.states,
            report: &self.report,
            health: &self.health,
            late: self.late,
            not_finite: self.not_finite,
            rearm: std::mem::take(&mut self.rearm),
            stop_gesture: self.gesture,
        });
        let changes = self.supervisor.changes().iter();
        self.told.extend(changes.map(|change| (t_s, *change)));
        self.cycle += 1;
        verdict
    }

    fn run(&mut self, seconds: f64) -> Verdict {
        let mut verdict = Verdict::default();
        for _ in 0..(seconds / DT_S).round() as u64 {
            verdict = self.cycle();
        }
        verdict
    }

    fn began(&self, kind: FaultKind) -> Option<f64> {
        let mut found = self.told.iter().filter(|(_, c)| c.kind == kind && c.begins);
        found.next().map(|(t_s, _)| *t_s)
    }
}

#[test]
fn healthy_servos_move_and_nothing_is_told() {
    let mut bench = Bench::new(policy(OnServoFault::Stop, Rearm::Operator));
    let verdict = bench.run(5.0);
    assert_eq!(verdict.reaction, Reaction::GoOn);
    assert_eq!(verdict.vigour, 1.0);
    assert_eq!(bench.supervisor.robot(), ServoState::Moving);
    assert_eq!(bench.told, []);
}

#[test]
fn a_silent_servo_is_offline_and_re_enters_by_itself() {
    let mut bench = Bench::new(policy(OnServoFault::Stop, Rearm::Operator));
    bench.run(1.0);
    bench.report.silent_mask = 0b10;
    bench.run(1.0);
    assert_eq!(bench.supervisor.servo(1), ServoState::Offline);
    assert_eq!(bench.supervisor.robot(), ServoState::Offline);
    assert_eq!(bench.supervisor.servo(0), ServoState::Moving);
    // Back, far from its target: ramped by the bus, which is no following error.
    bench.report = CycleReport {
        ramping_mask: 0b10,
        ..CycleReport::default()
    };
    bench.follow = false;
    bench.cycle();
    assert_eq!(bench.supervisor.servo(1), ServoState::Armed);
    bench.run(0.2);
    assert_eq!(bench.supervisor.servo(1), ServoState::Moving);
    bench.follow = true;
    bench.report = CycleReport::default();
    let verdict = bench.run(1.0);
    assert_eq!(verdict.reaction, Reaction::GoOn);
    assert_eq!(bench.told, []);
}

#[test]
fn an_alert_is_a_fault_at_once_and_its_cause_is_learnt_when_it_is_read() {
    let mut bench = Bench::new(policy(OnServoFault::Stop, Rearm::Operator));
    bench.run(1.0);
    bench.report.alert_mask = 0b100;
    let verdict = bench.cycle();
    assert_eq!(verdict.reaction, Reaction::Ease);
    assert_eq!(bench.supervisor.servo(2), ServoState::Faulted);
    bench.run(0.1);
    bench.health[2].hardware_error = 0x24;
    bench.cycle();
    let cause = bench.supervisor.cause().copied().expect("a cause");
    assert_eq!((cause.kind, cause.joint), (FaultKind::Alert, Some(2)));
    let joints = ["hip".to_string(), "thigh".into(), "knee".into()];
    let crew = Crew {
        joints: &joints,
        ids: &[7, 8, 9],
    };
    let text = sentence(&cause, crew);
    for part in [
        "servo 9 (knee)",
        "overheating, overload",
        "0x24",
        "1.000 s",
        "reboot",
    ] {
        assert!(text.contains(part), "no {part:?} in: {text}");
    }
}

#[test]
fn with_continue_a_latched_servo_is_left_out_rebooted_and_rearmed_when_the_operator_asks() {
    let mut bench = Bench::new(policy(OnServoFault::Continue, Rearm::Operator));
    bench.run(1.0);
    bench.report.alert_mask = 0b1;
    let verdict = bench.run(5.0);
    assert_eq!((verdict.reaction, verdict.request), (Reaction::GoOn, None));
    assert!(bench.supervisor.left_out(0) && bench.supervisor.waits());
    assert!(!bench.supervisor.left_out(1));
    bench.rearm = true;
    let verdict = bench.cycle();
    assert_eq!(verdict.request, Some(Request::Reboot(0)));
    bench.supervisor.answered(Request::Reboot(0), true);
    // It boots, and comes back without torque.
    bench.report = CycleReport {
        silent_mask: 0b1,
        ..CycleReport::default()
    };
    bench.run(0.4);
    assert_eq!(bench.supervisor.servo(0), ServoState::Offline);
    bench.report = CycleReport {
        torqueless_mask: 0b1,
        ..CycleReport::default()
    };
    let asked = (0..10).find_map(|_| bench.cycle().request);
    assert_eq!(asked, Some(Request::Rearm(0)));
    assert_eq!(bench.supervisor.servo(0), ServoState::Present);
    bench.report = CycleReport::default();
    bench.supervisor.answered(Request::Rearm(0), true);
    assert_eq!(bench.supervisor.servo(0), ServoState::Armed);
    assert!(!bench.supervisor.left_out(0));
    let verdict = bench.run(1.0);
    assert_eq!((verdict.reaction, verdict.request), (Reaction::GoOn, None));
    assert_eq!(bench.supervisor.robot(), ServoState::Moving);
}

#[test]
fn with_auto_three_tries_are_made_and_no_more() {
    let mut bench = Bench::new(policy(OnServoFault::Continue, Rearm::Auto));
    bench.run(1.0);
    bench.report.torqueless_mask = 0b1;
    let mut tries = Vec::new();
    for _ in 0..6000 {
        if let Some(request) = bench.cycle().request {
            tries.push(bench.t_s());
            bench.supervisor.answered(request, false);
        }
    }
    assert_eq!(tries.len(), 3, "tried at {tries:?} s");
    assert!(
        tries[0] >= 2.0,
        "tried {} s after it fell out",
        tries[0] - 1.0
    );
    assert_eq!(bench.supervisor.servo(0), ServoState::Present);
    bench.rearm = true;
    assert_eq!(
        bench.cycle().request,
        Some(Request::Rearm(0)),
        "a person may"
    );
}

#[test]
fn a_joint_that_does_not_follow_is_a_following_error_and_one_that_pushes_a_stall() {
    for (effort, expected) in [(0.1, FaultKind::FollowingError), (0.9, FaultKind::Stall)] {
        let mut bench = Bench::new(policy(OnServoFault::Stop, Rearm::Operator));
        bench.run(1.0);
        bench.follow = false;
        let from = bench.t_s();
        for state in &mut bench.states {
            (state.effort, state.velocity) = (effort, 0.0);
        }
        let verdict = bench.run(3.0);
        assert_eq!(verdict.reaction, Reaction::Ease, "effort {effort}");
        let cause = bench.supervisor.cause().expect("a cause");
        assert_eq!(cause.kind, expected, "effort {effort}");
        let after = cause.t_s - from;
        assert!(after < 1.5, "effort {effort}: found after {after} s");
        println!("effort {effort}: {expected:?} after {after:.2} s");
    }
}

#[test]
fn heat_makes_motion_smaller_smoothly_before_it_ends_the_run_and_noise_does_not_flap() {
    let mut bench = Bench::new(policy(OnServoFault::Stop, Rearm::Operator));
    let mut chance = crate::base::random::SplitMix::new(3);
    let mut last = 1.0;
    let mut least = 1.0_f64;
    // Up to 66 of 72 degrees and back, read in whole degrees.
    for k in 0..24_000 {
        let t_s = f64::from(k) * DT_S;
        let mean = 55.0 + 11.0 * (t_s * std::f64::consts::PI / 120.0).sin();
        bench.health[1].temperature_c = Some((mean + 0.4 * chance.normal()).round());
        let verdict = bench.cycle();
        assert_eq!(verdict.reaction, Reaction::GoOn, "at {t_s} s");
        let step = (verdict.vigour - last).abs();
        assert!(
            step <= 0.5 * DT_S + 1e-12,
            "vigour jumped by {step} at {t_s} s"
        );
        last = verdict.vigour;
        least = least.min(last);
    }
    assert!((0.5..0.75).contains(&least), "least vigour {least}");
    assert_eq!(last, 1.0, "not back after it cooled");
    let flaps = bench.told.iter().filter(|(_, c)| c.kind == FaultKind::Warm);
    let flaps = flaps.count();
    assert!(flaps <= 4, "{flaps} changes of \"warm\"");
    bench.health[1].temperature_c = Some(70.0);
    assert_eq!(bench.cycle().reaction, Reaction::Ease);
    let cause = bench.supervisor.cause().expect("a cause");
    assert_eq!(
        (cause.kind, cause.value, cause.limit),
        (FaultKind::Hot, 70.0, 70.0)
    );
    println!("least vigour {least:.2}, {flaps} changes of \"warm\"");
}

#[test]
fn a_weak_supply_makes_motion_smaller_and_one_out_of_range_ends_the_run() {
    let mut bench = Bench::new(policy(OnServoFault::Stop, Rearm::Operator));
    let volts = |bench: &mut Bench, volts: f64| {
        for health in &mut bench.health {
            health.voltage_v = Some(volts);
        }
    };
    volts(&mut bench, 11.1);
    assert_eq!(bench.run(1.0).vigour, 1.0);
    volts(&mut bench, 6.2);
    let vigour = bench.run(3.0).vigour;
    assert!((0.5..0.7).contains(&vigour), "vigour {vigour} at 6.2 V");
    // A dip of a fifth of a second is none.
    volts(&mut bench, 5.0);
    assert_eq!(bench.run(0.2).reaction, Reaction::GoOn);
    volts(&mut bench, 11.1);
    assert_eq!(bench.run(10.0).vigour, 1.0);
    for bad in [5.4, 15.0] {
        let mut bench = Bench::new(policy(OnServoFault::Stop, Rearm::Operator));
        volts(&mut bench, bad);
        assert_eq!(bench.run(1.0).reaction, Reaction::Ease, "{bad} V");
        let cause = bench.supervisor.cause().expect("a cause");
        assert_eq!(cause.kind, FaultKind::Voltage, "{bad} V");
    }
}

#[test]
fn much_effort_over_seconds_makes_motion_smaller_then_ends_the_run() {
    let mut bench = Bench::new(policy(OnServoFault::Stop, Rearm::Operator));
    for state in &mut bench.states {
        state.effort = -0.75;
    }
    let verdict = bench.run(40.0);
    // 0.75 of 0.8: two thirds of the way from 85 % to all of the limit.
    assert_eq!(verdict.reaction, Reaction::GoOn);
    assert!(
        (0.5..0.8).contains(&verdict.vigour),
        "vigour {}",
        verdict.vigour
    );
    let strained = bench.began(FaultKind::Strained).expect("strained");
    assert!(strained > 2.0, "strained after {strained} s");
    for state in &mut bench.states {
        state.effort = 0.95;
    }
    assert_eq!(bench.run(10.0).reaction, Reaction::Ease);
    let cause = bench.supervisor.cause().expect("a cause");
    assert_eq!(cause.kind, FaultKind::Overload);
}

#[test]
fn with_continue_a_hot_servo_moves_as_little_as_is_declared_and_is_not_left_out() {
    let mut bench = Bench::new(policy(OnServoFault::Continue, Rearm::Operator));
    bench.health[1].temperature_c = Some(71.0);
    let verdict = bench.run(5.0);
    assert_eq!(verdict.reaction, Reaction::GoOn);
    assert_eq!(verdict.vigour, supervision().derate_least);
    assert!(!bench.supervisor.left_out(1));
    assert_eq!(bench.supervisor.servo(1), ServoState::Moving);
}

#[test]
fn late_cycles_hold_the_motion_until_they_are_over() {
    for (on_overrun, expected) in [
        (OnOverrun::Hold, Reaction::Hold),
        (OnOverrun::Stop, Reaction::Ease),
        (OnOverrun::Continue, Reaction::GoOn),
    ] {
        let mut bench = Bench::new(Policy {
            on_overrun,
            ..policy(OnServoFault::Stop, Rearm::Operator)
        });
        // One in four is borne.
        for k in 0..2000 {
            bench.late = k % 4 == 0;
            assert_eq!(bench.cycle().reaction, Reaction::GoOn, "{on_overrun:?}");
        }
        bench.late = true;
        assert_eq!(bench.run(1.5).reaction, expected, "{on_overrun:?}");
        bench.late = false;
        let after = bench.run(4.0).reaction;
        let lasting = on_overrun == OnOverrun::Stop;
        assert_eq!(after == Reaction::Ease, lasting, "{on_overrun:?}");
        assert_eq!(after == Reaction::GoOn, !lasting, "{on_overrun:?}");
    }
}

#[test]
fn no_numbers_from_the_motion_end_the_run_and_none_after_the_envelope_stop_it_at_once() {
    let mut bench = Bench::new(policy(OnServoFault::Continue, Rearm::Auto));
    bench.not_finite = 1;
    assert_eq!(bench.run(0.05).reaction, Reaction::GoOn);
    assert_eq!(bench.run(0.1).reaction, Reaction::Ease);
    let cause = bench.supervisor.cause().expect("a cause");
    assert_eq!(cause.kind, FaultKind::NotFinite);
    bench.targets[2] = f64::NAN;
    assert_eq!(bench.cycle().reaction, Reaction::AtOnce);
}

#[test]
fn the_stop_gesture_has_to_be_held_and_stops_once() {
    let mut bench = Bench::new(Policy {
        stop_gesture: Some(StopGesture {
            name: "halt".into(),
            level: 0.6,
            hold_s: 0.5,
        }),
        ..policy(OnServoFault::Stop, Rearm::Operator)
    });
    bench.gesture = 0.9;
    assert_eq!(bench.run(0.4).reaction, Reaction::GoOn);
    bench.gesture = 0.5;
    bench.cycle();
    bench.gesture = 0.7;
    let stops: Vec<f64> = (0..400)
        .filter(|_| bench.cycle().reaction == Reaction::OperatorStop)
        .map(f64::from)
        .collect();
    assert_eq!(stops.len(), 1);
    assert!(
        (95.0..105.0).contains(&stops[0]),
        "after {} cycles",
        stops[0]
    );
}

#[test]
fn a_lost_bus_is_offline_until_it_is_found_and_armed() {
    let mut bench = Bench::new(policy(OnServoFault::Stop, Rearm::Operator));
    bench.run(1.0);
    bench.supervisor.lost();
    assert_eq!(bench.supervisor.robot(), ServoState::Offline);
    assert!(!bench.supervisor.arms(false) && bench.supervisor.arms(true));
    bench.supervisor.found(&[]);
    assert_eq!(bench.supervisor.robot(), ServoState::Present);
    bench.supervisor.armed();
    assert_eq!(bench.supervisor.robot(), ServoState::Armed);
    bench.run(0.1);
    assert_eq!(bench.supervisor.robot(), ServoState::Moving);
}

#[test]
fn a_target_that_stands_still_is_holding() {
    let mut bench = Bench::new(policy(OnServoFault::Stop, Rearm::Operator));
    bench.run(0.5);
    let targets = bench.targets;
    for k in 0..40_u32 {
        let t_s = bench.t_s() + f64::from(k) * DT_S;
        bench.supervisor.step(&Seen {
            t_s,
            targets: &targets,
            states: &bench.states,
            report: &bench.report,
            health: &bench.health,
            late: false,
            not_finite: 0,
            rearm: false,
            stop_gesture: 0.0,
        });
    }
    assert_eq!(bench.supervisor.robot(), ServoState::Holding);
    bench.cycle();
    bench.cycle();
    assert_eq!(bench.supervisor.robot(), ServoState::Moving);
}
