//! The Dynamixel driver that ships against simulated servos, byte for byte, in virtual time.

use handwave::base::{Clock, JointState, Time, VirtualClock};
use handwave::bus::dynamixel::model::Model;
use handwave::bus::dynamixel::{
    ChainOptions, Client, DynamixelChain, Master, MasterOptions, Ping, ServoSpec,
};
use handwave::bus::{BusError, CycleReport, ServoBus};
use handwave::sim::line::SharedLine;
use handwave::sim::models::XL430_W250;
use handwave::sim::{AfterSilence, Line, LineOptions, Servo, SimPort};
use std::sync::Arc;
use std::time::Duration;

const SERVOS: u8 = 12;
const PERIOD: Duration = Duration::from_millis(5);

/// Twelve servos on a line, the driver at its other end, a control loop of 200 Hz.
struct Rig {
    clock: VirtualClock,
    line: SharedLine,
    chain: DynamixelChain,
    states: Vec<JointState>,
    targets: Vec<f64>,
}

fn master(line: &SharedLine, clock: &VirtualClock, baud: u32) -> Box<Master> {
    let port = SimPort::new(line.clone(), Arc::new(clock.clone()), baud);
    Box::new(Master::new(Box::new(port), MasterOptions::default()))
}

impl Rig {
    fn on(line: Line) -> Self {
        let clock = VirtualClock::new();
        let line = SharedLine::new(line);
        let model = Model::by_name("xl430-w250").expect("a known model");
        let specs = (1..=SERVOS)
            .map(|id| ServoSpec::new(id, format!("joint{id}"), model))
            .collect();
        let options = ChainOptions {
            bus: "sim".into(),
            ..ChainOptions::default()
        };
        let client = master(&line, &clock, 1_000_000);
        Rig {
            chain: DynamixelChain::new(client, specs, options).expect("sensible specs"),
            clock,
            line,
            states: vec![JointState::default(); usize::from(SERVOS)],
            targets: vec![0.0; usize::from(SERVOS)],
        }
    }

    fn with(options: LineOptions) -> Self {
        let line = Line::commissioned(&XL430_W250, 1..=SERVOS, 1_000_000, options);
        Rig::on(line.expect("a known rate"))
    }

    fn new() -> Self {
        Rig::with(LineOptions::default())
    }

    /// The same with one servo put together by hand.
    fn with_servo(id: u8, servo: Servo) -> Self {
        let mut line = Line::new(LineOptions::default());
        let mut servo = Some(servo);
        for label in 1..=SERVOS {
            let other = Servo::commissioned(&XL430_W250, label, 3);
            let this = if label == id { servo.take() } else { None };
            line.attach(label, this.unwrap_or(other));
        }
        Rig::on(line)
    }

    fn armed(mut self) -> Self {
        self.chain
            .prepare(&mut self.states)
            .expect("a healthy chain");
        self.chain.arm().expect("a healthy chain");
        self.run(0.5);
        self
    }

    fn cycle(&mut self) -> Result<CycleReport, BusError> {
        let next = self.clock.now() + PERIOD;
        let report = self.chain.exchange(&self.targets, &mut self.states);
        self.clock.sleep_until(next);
        report
    }

    /// Cycles for that long; the last report.
    fn run(&mut self, seconds: f64) -> CycleReport {
        let end = self.clock.now() + Duration::from_secs_f64(seconds);
        loop {
            let report = self.cycle().expect("the bus is there");
            if self.clock.now() >= end {
                return report;
            }
        }
    }

    fn fault(&self, spec: &str) {
        let fault = spec.parse().expect("a good specification");
        self.line.lock().inject(fault).expect("a servo of the line");
    }

    fn now_s(&self) -> f64 {
        self.clock.now().secs()
    }

    fn position(&self, id: u8) -> f64 {
        let line = self.line.lock();
        line.servo(id)
            .expect("a servo of the line")
            .position_pulses()
    }

    fn torque(&self, id: u8) -> bool {
        let line = self.line.lock();
        line.servo(id)
            .expect("a servo of the line")
            .torque_enabled()
    }
}

#[test]
fn a_scan_finds_every_servo_once() {
    let rig = Rig::new();
    let mut client = master(&rig.line, &rig.clock, 1_000_000);
    let mut found: Vec<Ping> = Vec::new();
    client
        .ping_all(&mut |ping| found.push(ping))
        .expect("the port works");
    let ids: Vec<u8> = found.iter().map(|ping| ping.id).collect();
    assert_eq!(ids, (1..=SERVOS).collect::<Vec<_>>());
    assert!(
        found.iter().all(|ping| ping.model == 1060 && !ping.alert),
        "{found:?}"
    );
    // At the wrong rate nobody hears it.
    client.set_baud(57_600).expect("the port works");
    found.clear();
    client
        .ping_all(&mut |ping| found.push(ping))
        .expect("the port works");
    assert_eq!(found, [], "servos of 1 Mbaud answered at 57600");
}

#[test]
fn a_cycle_takes_the_time_of_its_bytes() {
    // Bytes of 12 servos times 10 us: 276 with fast reads, 352 without.
    for (firmware, expected_us) in [(46, 2760.0), (44, 3520.0)] {
        let servo = Servo::commissioned(&XL430_W250, 1, 3).with_firmware(firmware);
        let mut rig = Rig::with_servo(1, servo).armed();
        for _ in 0..100 {
            let report = rig.cycle().expect("a healthy chain");
            assert_eq!(report.fresh, u16::from(SERVOS), "{report:?}");
            let error = f64::from(report.cycle_us) / expected_us - 1.0;
            assert!(
                error.abs() < 0.01,
                "firmware {firmware}: {} us",
                report.cycle_us
            );
        }
        assert_eq!(rig.chain.uses_fast_reads(), firmware >= 45);
    }
}

#[test]
fn nothing_moves_until_told_and_then_the_joints_follow() {
    let mut rig = Rig::new();
    for id in 1..=SERVOS {
        let angle = 0.02 * f64::from(id);
        let mut line = rig.line.lock();
        *line.servo_mut(id).expect("a servo") =
            Servo::commissioned(&XL430_W250, id, 3).with_angle(angle);
    }
    rig.chain.prepare(&mut rig.states).expect("a healthy chain");
    assert!(
        (1..=SERVOS).all(|id| !rig.torque(id)),
        "preparing turned torque on"
    );
    let found: Vec<f64> = rig.states.iter().map(|state| state.position).collect();
    rig.chain.arm().expect("a healthy chain");
    assert!(
        (1..=SERVOS).all(|id| rig.torque(id)),
        "torque is off after arming"
    );
    rig.targets.copy_from_slice(&found);
    rig.run(0.3);
    for (state, found) in rig.states.iter().zip(&found) {
        let moved = (state.position - found).abs();
        assert!(moved < 0.005, "a joint moved by {moved} rad on arming");
    }
    // A slow wave of 0.3 rad, followed within 0.1 rad.
    for cycle in 0..400 {
        let wave = 0.3 * (f64::from(cycle) * 0.005 * 2.0).sin();
        for (target, found) in rig.targets.iter_mut().zip(&found) {
            *target = found + wave;
        }
        rig.cycle().expect("a healthy chain");
        for (index, state) in rig.states.iter().enumerate() {
            let lag = (state.position - rig.targets[index]).abs();
            assert!(
                lag < 0.1,
                "joint {} lags by {lag} rad in cycle {cycle}",
                index + 1
            );
        }
    }
}

#[test]
fn a_silent_servo_mid_chain_leaves_eleven_fresh() {
    for after_silence in [AfterSilence::Answer, AfterSilence::Wait] {
        let mut rig = Rig::with(LineOptions {
            after_silence,
            ..LineOptions::default()
        })
        .armed();
        let from = rig.now_s() + 0.1;
        rig.fault(&format!("5:silent@{from}s..{}s", from + 1.0));
        let mut worst_us = 0;
        while rig.now_s() < from + 0.99 {
            let silent = rig.clock.now() >= Time::from_secs(from);
            let report = rig.cycle().expect("eleven answer");
            let expected = if silent { (11, 1 << 4) } else { (12, 0) };
            assert_eq!(
                (report.fresh, report.silent_mask),
                expected,
                "{report:?} {after_silence:?}"
            );
            worst_us = worst_us.max(report.cycle_us);
        }
        assert!(worst_us < 5000, "a cycle took {worst_us} us");
        let report = rig.run(0.6);
        assert_eq!(
            (report.fresh, report.torqueless_mask),
            (12, 0),
            "{report:?}"
        );
        assert!(rig.chain.uses_fast_reads(), "fast reads were given up");
    }
}

#[test]
fn without_fast_reads_a_silent_servo_costs_the_others_nothing_either() {
    for after_silence in [AfterSilence::Answer, AfterSilence::Wait] {
        let mut line = Line::new(LineOptions {
            after_silence,
            ..LineOptions::default()
        });
        for id in 1..=SERVOS {
            line.attach(
                id,
                Servo::commissioned(&XL430_W250, id, 3).with_firmware(44),
            );
        }
        let mut rig = Rig::on(line).armed();
        let from = rig.now_s();
        rig.fault(&format!("5:silent@{from}s..{}s", from + 1.0));
        // In the first cycle there may be no time to ask the later ones again.
        let first = rig.cycle().expect("some answer");
        assert!(first.fresh >= 4, "{first:?} {after_silence:?}");
        while rig.now_s() < from + 0.98 {
            let report = rig.cycle().expect("eleven answer");
            assert_eq!(
                (report.fresh, report.silent_mask),
                (11, 1 << 4),
                "{report:?}"
            );
        }
        assert_eq!(rig.run(0.6).fresh, 12);
    }
}

#[test]
fn a_servo_that_was_cut_off_comes_back_without_a_jump() {
    let mut rig = Rig::new().armed();
    let from = rig.now_s();
    // The data wire is off for long enough that the servo's watchdog trips.
    rig.fault(&format!("3:disconnected@{from}s..{}s", from + 0.5));
    rig.targets.fill(0.6);
    while rig.now_s() < from + 0.5 {
        rig.cycle().expect("eleven answer");
    }
    assert!(
        (rig.position(3) - 2048.0).abs() < 20.0,
        "it moved to {}",
        rig.position(3)
    );
    let mut before = rig.position(3);
    let mut fastest: f64 = 0.0;
    while rig.now_s() < from + 2.5 {
        rig.cycle().expect("all answer");
        fastest = fastest.max((rig.position(3) - before).abs());
        before = rig.position(3);
    }
    // 1 rad/s is 3.3 counts in 5 ms; the servo overshoots a little.
    assert!(fastest < 7.0, "it moved by {fastest} counts within 5 ms");
    assert!(
        (before - 2439.0).abs() < 20.0,
        "it ends at {before}, target 2439"
    );
}

#[test]
fn a_brown_out_is_reported_and_waits_for_rearming() {
    let mut rig = Rig::new().armed();
    rig.fault(&format!("7:reboot@{}s", rig.now_s() + 0.02));
    let report = rig.run(1.2);
    assert_eq!(report.torqueless_mask, 1 << 6, "{report:?}");
    assert_eq!(
        (report.fresh, report.silent_mask),
        (12, 0),
        "it is read all the same"
    );
    rig.targets.fill(0.4);
    rig.run(0.5);
    assert!(!rig.torque(7), "its torque came back by itself");
    assert!(
        (rig.position(7) - 2048.0).abs() < 20.0,
        "it was driven to {}",
        rig.position(7)
    );
    rig.chain.rearm(6).expect("it can be rearmed");
    let report = rig.run(1.5);
    assert_eq!(report.torqueless_mask, 0, "{report:?}");
    assert!(
        (rig.states[6].position - 0.4).abs() < 0.05,
        "it ends at {}",
        rig.states[6].position
    );
}

#[test]
fn a_latched_error_shows_as_alert_and_is_named() {
    let mut rig = Rig::new().armed();
    rig.fault(&format!(
        "4:overheat@{}s..{}s",
        rig.now_s(),
        rig.now_s() + 0.1
    ));
    let report = rig.run(0.5);
    assert_eq!(report.alert_mask, 1 << 3, "{report:?}");
    let message = rig.chain.rearm(3).expect_err("it is latched").to_string();
    assert!(
        message.contains("servo 4 (joint joint4): hardware error latched: overheating"),
        "{message}"
    );
    rig.chain.reboot(3).expect("the port works");
    let report = rig.run(1.0);
    assert_eq!(
        (report.alert_mask, report.torqueless_mask),
        (0, 1 << 3),
        "{report:?}"
    );
    rig.chain.rearm(3).expect("the latch is gone");
    assert_eq!(rig.run(0.5).fresh, 12);
}

#[test]
fn when_all_are_silent_the_bus_is_lost_after_half_a_second() {
    let mut rig = Rig::new().armed();
    let from = rig.now_s();
    for id in 1..=SERVOS {
        rig.fault(&format!("{id}:silent@{from}s"));
    }
    let error = loop {
        if let Err(error) = rig.cycle() {
            break error;
        }
    };
    let after_s = rig.now_s() - from;
    assert!(matches!(error, BusError::Lost { .. }), "{error}");
    assert!((0.45..0.6).contains(&after_s), "lost after {after_s} s");
}

#[test]
fn an_unplugged_adapter_is_told_at_once() {
    let mut rig = Rig::new().armed();
    rig.fault(&format!("bus:unplugged@{}s", rig.now_s()));
    let error = rig.cycle().expect_err("the adapter is gone");
    assert!(matches!(error, BusError::Port(_)), "{error}");
}

#[test]
fn torque_off_is_read_back_even_on_a_bad_line() {
    let mut rig = Rig::new().armed();
    let report = rig.chain.torque_off().expect("the port works");
    assert_eq!(
        (report.confirmed_off.len(), report.unconfirmed.len()),
        (12, 0)
    );
    assert!((1..=SERVOS).all(|id| !rig.torque(id)));

    let mut rig = Rig::new().armed();
    rig.fault(&format!("bus:corrupt=0.05@{}s", rig.now_s()));
    rig.fault(&format!("9:silent@{}s", rig.now_s()));
    let begin = rig.now_s();
    let report = rig.chain.torque_off().expect("the port works");
    let took_s = rig.now_s() - begin;
    assert!(report.confirmed_off.len() >= 10, "{report:?}");
    assert!(
        report
            .unconfirmed
            .iter()
            .any(|(joint, _)| joint == "joint9"),
        "{report:?}"
    );
    assert!(
        (1..=SERVOS).all(|id| !rig.torque(id)),
        "a torque is still on"
    );
    assert!(took_s < 0.3, "torque off took {took_s} s");
}

#[test]
fn noise_on_the_line_costs_cycles_and_never_a_wrong_value() {
    for fault in [
        "corrupt=0.05",
        "truncated=0.05",
        "duplicated=0.1",
        "foreign=0.1",
        "noise=4",
        "echo",
    ] {
        let mut rig = Rig::new().armed();
        rig.fault(&format!("bus:{fault}@{}s", rig.now_s()));
        let mut fresh = 0u32;
        for cycle in 0..1000 {
            let report = rig.cycle().expect("the bus is there");
            fresh += u32::from(report.fresh);
            for state in &rig.states {
                assert!(
                    state.position.abs() < 0.02 && state.velocity.abs() < 1.0,
                    "{fault}: {state:?} in cycle {cycle}, nothing moves"
                );
            }
        }
        let share = f64::from(fresh) / 12_000.0;
        assert!(
            share > 0.9,
            "{fault}: only {:.1} % of the states were fresh",
            100.0 * share
        );
    }
}

#[test]
fn a_slow_adapter_is_waited_for() {
    let mut rig = Rig::with(LineOptions {
        latency: Duration::from_millis(1),
        ..LineOptions::default()
    })
    .armed();
    for _ in 0..200 {
        let report = rig.cycle().expect("all answer");
        assert_eq!(report.fresh, 12, "{report:?}");
        assert!(
            report.cycle_us < 4000,
            "a cycle took {} us",
            report.cycle_us
        );
    }
}

#[test]
fn a_host_that_paused_finds_its_servos_again() {
    let mut rig = Rig::new().armed();
    rig.clock
        .sleep_until(rig.clock.now() + Duration::from_millis(400));
    rig.targets.fill(0.3);
    let report = rig.run(1.0);
    assert_eq!((report.fresh, report.ramping_mask), (12, 0), "{report:?}");
    for state in &rig.states {
        assert!(
            (state.position - 0.3).abs() < 0.05,
            "after the watchdog tripped: {state:?}"
        );
    }
}
