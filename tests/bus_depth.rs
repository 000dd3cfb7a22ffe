//! What the driver does beside its cycle, and what faults cost it: health, checks at the start, a silent servo,
//! adapters that hold answers back. Against simulated servos, in virtual time.

use handwave::base::{Clock, JointState, VirtualClock};
use handwave::bus::dynamixel::model::{Model, address};
use handwave::bus::dynamixel::{ChainOptions, DynamixelChain, Master, MasterOptions, ServoSpec};
use handwave::bus::{BusError, CycleReport, ServoBus};
use handwave::sim::line::SharedLine;
use handwave::sim::models::XL430_W250;
use handwave::sim::{AfterSilence, Line, LineOptions, Servo, SimPort};
use std::sync::Arc;
use std::time::Duration;

const SERVOS: u8 = 12;
/// Register value of 1 Mbaud.
const MEGABAUD: u8 = 3;
/// Wire time of a cycle of twelve servos at 1 Mbaud, us: 276 bytes with fast reads, 352 with ordinary ones.
const FAST_US: u32 = 2760;
const ORDINARY_US: u32 = 3520;
/// Bytes of one servo's goal, place in the request and block or status, in us.
const FAST_SLOT_US: u32 = 10 * 14;
const ORDINARY_SLOT_US: u32 = 10 * 21;

struct Rig {
    clock: VirtualClock,
    line: SharedLine,
    chain: DynamixelChain,
    states: Vec<JointState>,
    period: Duration,
}

impl Rig {
    fn on(line: Line, period: Duration) -> Self {
        let clock = VirtualClock::new();
        let line = SharedLine::new(line);
        let port = SimPort::new(line.clone(), Arc::new(clock.clone()), 1_000_000);
        let master = Master::new(Box::new(port), MasterOptions::default());
        let model = Model::by_name("xl430-w250").expect("a known model");
        let specs = (1..=SERVOS).map(|id| ServoSpec::new(id, format!("joint{id}"), model));
        let options = ChainOptions {
            bus: "dynamixel:/dev/ttyUSB0@1000000".into(),
            cycle_budget: period,
            // Ten cycles: a watchdog shorter than a few of them would be looked after in each.
            watchdog: (period.as_millis() / 2).clamp(5, 100) as u8,
            ..ChainOptions::default()
        };
        Rig {
            chain: DynamixelChain::new(Box::new(master), specs.collect(), options)
                .expect("sensible specs"),
            clock,
            line,
            states: vec![JointState::default(); SERVOS.into()],
            period,
        }
    }

    fn of_firmware(firmware: u8, options: LineOptions, period: Duration) -> Self {
        let mut line = Line::new(options);
        for id in 1..=SERVOS {
            let servo = Servo::commissioned(&XL430_W250, id, MEGABAUD).with_firmware(firmware);
            line.attach(id, servo);
        }
        Rig::on(line, period)
    }

    fn new() -> Self {
        Rig::of_firmware(46, LineOptions::default(), Duration::from_millis(5))
    }

    fn armed(mut self) -> Self {
        self.chain
            .prepare(&mut self.states)
            .expect("a healthy chain");
        self.chain.arm().expect("a healthy chain");
        self.run(1.0);
        self
    }

    fn complaint(&mut self) -> String {
        let outcome = self.chain.prepare(&mut self.states);
        outcome.expect_err("it should be refused").to_string()
    }

    fn cycle(&mut self) -> Result<CycleReport, BusError> {
        let next = self.clock.now() + self.period;
        let report = self.chain.exchange(&[0.0; 12], &mut self.states);
        assert!(
            self.clock.now() <= next || report.as_ref().is_ok_and(|r| r.silent > 0),
            "a healthy cycle ended {:?} late",
            self.clock.now().saturating_since(next)
        );
        self.clock.sleep_until(next);
        report
    }

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
}

#[test]
fn temperature_and_voltage_of_each_servo_are_never_older_than_a_second() {
    let mut rig = Rig::new().armed();
    rig.fault(&format!(
        "4:overheat=66@{}s..{}s",
        rig.now_s() + 1.0,
        rig.now_s() + 2.0
    ));
    let mut oldest_s: f64 = 0.0;
    for _ in 0..190 {
        let report = rig.cycle().expect("a healthy chain");
        assert_eq!(
            (report.bytes, report.cycle_us),
            (276, FAST_US),
            "the cycle itself is as ever"
        );
        for health in rig.chain.health() {
            let at = health.measured_at.expect("read at the start");
            oldest_s = oldest_s.max(rig.clock.now().secs_since(at));
            // The moving servos draw on the supply.
            assert!(
                health.voltage_v.is_some_and(|v| (10.9..=11.1).contains(&v)),
                "{health:?}"
            );
            assert_eq!(health.temperature_c, Some(32.0));
            assert_eq!(health.hardware_error, 0);
        }
    }
    assert!(oldest_s < 1.0, "the oldest was {oldest_s} s old");
    // It gets hot and shuts down: three cycles later everybody knows why.
    while rig.cycle().expect("all answer").alert_mask == 0 {}
    rig.cycle().expect("all answer");
    rig.cycle().expect("all answer");
    let health = rig.chain.health()[3];
    assert_eq!(health.hardware_error, 0x04, "overheating: {health:?}");
    assert!(rig.chain.health()[2].hardware_error == 0);
}

#[test]
fn a_cycle_without_room_reads_no_health_and_a_lost_answer_is_no_silence() {
    // 2.8 ms for 2.76 ms of bytes.
    let mut rig = Rig::of_firmware(46, LineOptions::default(), Duration::from_micros(2800)).armed();
    let before = rig.chain.health().to_vec();
    assert!(
        before.iter().all(|health| health.measured_at.is_some()),
        "read at the start"
    );
    rig.run(2.0);
    assert_eq!(
        rig.chain.health(),
        before,
        "it was read without room for it"
    );

    let mut rig = Rig::new().armed();
    // Every tenth answer of servo 3 is damaged, those to health readings too.
    rig.fault(&format!("3:corrupt=0.1@{}s", rig.now_s()));
    let mut silent = 0;
    for _ in 0..2000 {
        let report = rig.cycle().expect("a chain");
        silent += u32::from(report.silent_mask & !(1 << 2) != 0);
        assert_eq!(
            report.ramping_mask, 0,
            "somebody was taken for silent: {report:?}"
        );
    }
    assert_eq!(silent, 0, "cycles without one of the healthy");
}

#[test]
fn a_servo_at_another_rate_is_found_and_the_command_that_mends_it_is_told() {
    let mut line = Line::new(LineOptions::default());
    for id in 1..=SERVOS {
        let code = if [5, 9].contains(&id) { 1 } else { MEGABAUD };
        line.attach(id, Servo::commissioned(&XL430_W250, id, code));
    }
    let mut rig = Rig::on(line, Duration::from_millis(5));
    let text = rig.complaint();
    for part in [
        "servo 5 (joint joint5): it answers at 57600 baud, the bus runs at 1000000",
        "handwave bus write dynamixel:/dev/ttyUSB0@57600 5,9 baud_rate 3",
    ] {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
    assert_eq!(
        rig.chain.client().baud(),
        1_000_000,
        "back at the bus's rate"
    );
}

#[test]
fn two_servos_with_one_id_are_suspected() {
    let mut line = Line::new(LineOptions::default());
    for id in 1..=SERVOS {
        line.attach(id, Servo::commissioned(&XL430_W250, id, MEGABAUD));
    }
    line.attach(
        100,
        Servo::commissioned(&XL430_W250, 7, MEGABAUD).with_angle(0.3),
    );
    let text = Rig::on(line, Duration::from_millis(5)).complaint();
    for part in [
        "servo 7 (joint joint7)",
        "two servos have this id",
        "handwave bus write dynamixel:/dev/ttyUSB0@1000000 7 id 13",
    ] {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
    // One that is simply not there is not called a twin.
    let mut rig = Rig::new();
    rig.fault("7:disconnected@0s");
    let text = rig.complaint();
    assert!(
        text.contains("servo 7 (joint joint7) does not answer"),
        "{text}"
    );
}

#[test]
fn what_costs_time_is_noted_with_the_command_that_mends_it() {
    let mut line = Line::new(LineOptions::default());
    for id in 1..=SERVOS {
        let mut servo = Servo::commissioned(&XL430_W250, id, MEGABAUD);
        if id == 2 {
            // As out of the box.
            servo = Servo::factory(&XL430_W250);
            let mut data = Vec::new();
            for (register, value) in [(address::ID, 2), (address::BAUD_RATE, MEGABAUD)] {
                let write = handwave_dynamixel::Instruction::Write {
                    address: register,
                    data: &[value],
                };
                servo.execute(&write, false, Default::default(), &mut data);
            }
        }
        line.attach(id, servo);
    }
    let mut rig = Rig::on(line, Duration::from_millis(5));
    rig.chain.prepare(&mut rig.states).expect("slow, but fit");
    let notes = rig.chain.notes().join("\n");
    assert!(notes.contains("return_delay_time 0"), "{notes}");
}

/// One servo of twelve falls silent. In both kinds of read, whatever the servos behind it do, the eleven
/// others are fresh in every cycle; it costs the wait for its slot in the first cycle, and its retries later.
#[test]
fn a_silent_servo_costs_its_slot_once() {
    for (firmware, healthy_us, slot_us) in [
        (46, FAST_US, FAST_SLOT_US),
        (44, ORDINARY_US, ORDINARY_SLOT_US),
    ] {
        for after_silence in [AfterSilence::Answer, AfterSilence::Wait] {
            // 100 Hz: an ordinary read of the seven behind it has room in the same cycle too.
            let period = Duration::from_millis(10);
            let options = LineOptions {
                after_silence,
                ..LineOptions::default()
            };
            let mut rig = Rig::of_firmware(firmware, options, period).armed();
            let case = format!("firmware {firmware}, {after_silence:?}");
            let from = rig.now_s();
            rig.fault(&format!("6:silent@{from}s..{}s", from + 2.0));
            let mut costs_us = Vec::new();
            while rig.now_s() < from + 1.99 {
                let report = rig.cycle().expect("eleven answer");
                assert_eq!(
                    (report.fresh, report.silent_mask),
                    (11, 1 << 5),
                    "{case}, cycle {}: {report:?}",
                    costs_us.len()
                );
                costs_us.push(report.cycle_us);
            }
            let retries = costs_us[1..].iter().filter(|us| **us > healthy_us).count();
            let without = costs_us[1..].iter().min().expect("cycles");
            let worst = costs_us[1..].iter().max().expect("cycles");
            let costs = format!(
                "{case}: healthy {healthy_us} us; first silent cycle {} us; then {without} us, {retries} retries in \
                 {} cycles, the dearest {worst} us",
                costs_us[0],
                costs_us.len() - 1
            );
            println!("{costs}");
            assert_eq!(*without, healthy_us - slot_us - goal_us(), "{costs}");
            assert!(retries <= 14, "{costs}");
            assert!(*worst < 10_000, "{costs}");
            assert!(costs_us[0] < 10_000, "{costs}");
            let report = rig.run(0.6);
            assert_eq!(
                (report.fresh, report.torqueless_mask),
                (12, 0),
                "{case}: {report:?}"
            );
        }
    }
}

/// A goal of five bytes and a place in the request.
fn goal_us() -> u32 {
    10 * 6
}

/// A bit flips in the answer of servo 6: what stands before it in the combined answer is used, the rest is
/// asked for again in the same cycle.
#[test]
fn a_damaged_fast_answer_is_used_as_far_as_it_is_good() {
    let mut rig = Rig::of_firmware(46, LineOptions::default(), Duration::from_millis(10)).armed();
    let from = rig.now_s();
    rig.fault(&format!("6:corrupt=1@{from}s"));
    let mut worst_us = 0;
    for cycle in 0..100 {
        let report = rig.cycle().expect("all answer");
        assert_eq!(
            report.silent_mask & !(1 << 5),
            0,
            "cycle {cycle}: {report:?}"
        );
        assert!(report.damaged > 0, "cycle {cycle}: {report:?}");
        worst_us = worst_us.max(report.cycle_us);
    }
    assert!(worst_us < 10_000, "the dearest cycle took {worst_us} us");
}

/// Adapters that hold answers back: nothing for 0 ms, nothing to set for 16 ms. Both work; the wait for
/// a silent servo follows what was measured.
#[test]
fn deadlines_follow_the_adapter() {
    for (latency_ms, period_ms, most_lost_us) in [(0, 10, 1_000), (1, 10, 4_000), (16, 100, 36_000)]
    {
        let options = LineOptions {
            latency: Duration::from_millis(latency_ms),
            ..LineOptions::default()
        };
        let period = Duration::from_millis(period_ms);
        let mut rig = Rig::of_firmware(46, options, period);
        rig.chain
            .prepare(&mut rig.states)
            .unwrap_or_else(|error| panic!("{latency_ms} ms: {error}"));
        let noted = rig
            .chain
            .notes()
            .iter()
            .any(|note| note.contains("latency timer"));
        assert_eq!(
            noted,
            latency_ms > 4,
            "{latency_ms} ms: {:?}",
            rig.chain.notes()
        );
        rig.chain.arm().expect("a healthy chain");
        let report = rig.run(20.0);
        let healthy_us = report.cycle_us;
        let expected_us = FAST_US + 1000 * latency_ms as u32;
        assert_eq!(
            (report.fresh, healthy_us),
            (12, expected_us),
            "{latency_ms} ms: {report:?}"
        );
        rig.fault(&format!("12:silent@{}s", rig.now_s()));
        let report = rig.cycle().expect("eleven answer");
        let lost_us = report.cycle_us - healthy_us;
        println!(
            "latency {latency_ms} ms: healthy {healthy_us} us, silent {} us",
            report.cycle_us
        );
        assert_eq!(report.fresh, 11, "{latency_ms} ms: {report:?}");
        assert!(
            report.cycle_us <= healthy_us + most_lost_us
                || report.cycle_us <= period_ms as u32 * 1000,
            "{latency_ms} ms: a silent servo costs {lost_us} us"
        );
    }
}
