//! What a control cycle takes on the wire, driver included, against the formulae of the protocol: byte times, return
//! delays, turnaround and hops, on a simulated line in virtual time.

use handwave::base::{Clock, JointState, VirtualClock};
use handwave::bus::dynamixel::model::Model;
use handwave::bus::dynamixel::{
    ChainOptions, Client, DynamixelChain, Master, MasterOptions, ServoSpec,
};
use handwave::bus::{CycleReport, ServoBus};
use handwave::live::bus_bench::{Bench, BenchOptions, BenchReport, Found, Reads, wire_time};
use handwave::sim::line::{AfterSilence, SharedLine};
use handwave::sim::models::XL430_W250;
use handwave::sim::{Line, LineOptions, SimPort};
use std::cell::Cell;
use std::sync::Arc;
use std::time::Duration;

const MICROSECOND: Duration = Duration::from_micros(1);

/// Servos on a line, a driver at its other end, and the clock of both.
struct Rig {
    clock: VirtualClock,
    line: SharedLine,
    master: Master,
    servos: u8,
}

fn rig(servos: u8, baud: u32, options: LineOptions) -> Rig {
    let clock = VirtualClock::new();
    let line = Line::commissioned(&XL430_W250, 1..=servos, baud, options);
    let line = SharedLine::new(line.expect("a rate that servos have"));
    let port = SimPort::new(line.clone(), Arc::new(clock.clone()), baud);
    Rig {
        clock,
        line,
        master: Master::new(Box::new(port), MasterOptions::default()),
        servos,
    }
}

/// A chain with torque on, called at a fixed rate.
struct Driven {
    clock: VirtualClock,
    line: SharedLine,
    chain: DynamixelChain,
    period: Duration,
    targets: Vec<f64>,
    states: Vec<JointState>,
}

impl Rig {
    fn driven(self, rate_hz: f64) -> Driven {
        let model = Model::by_name("xl430-w250").expect("a known model");
        let specs = (1..=self.servos).map(|id| ServoSpec::new(id, format!("joint{id}"), model));
        let period = Duration::from_secs_f64(1.0 / rate_hz);
        let options = ChainOptions {
            cycle_budget: period,
            ..ChainOptions::default()
        };
        let mut chain = DynamixelChain::new(Box::new(self.master), specs.collect(), options)
            .expect("sensible specs");
        let mut states = vec![JointState::default(); usize::from(self.servos)];
        chain.prepare(&mut states).expect("a healthy chain");
        chain.arm().expect("a healthy chain");
        let targets = states.iter().map(|state| state.position).collect();
        Driven {
            clock: self.clock,
            line: self.line,
            chain,
            period,
            targets,
            states,
        }
    }

    fn bench(mut self, reads: Reads, seconds: f64) -> BenchReport {
        let mut found = Vec::new();
        let asked = self
            .master
            .ping_all(&mut |ping| found.push(Found::Servo(ping)));
        asked.expect("a port that is there");
        assert_eq!(found.len(), usize::from(self.servos), "servos found");
        let mut bench = Bench::inspect(&mut self.master, &found).expect("healthy servos");
        let options = BenchOptions {
            reads,
            span: Duration::from_secs_f64(seconds),
            period: None,
        };
        let clock = &self.clock;
        bench
            .run(
                &mut self.master,
                &options,
                &|span| clock.sleep_until(clock.now() + span),
                &|| Duration::ZERO,
                &|| false,
            )
            .expect("a port that is there")
    }
}

impl Driven {
    /// One cycle, and the wait for the next: whether it kept its time.
    fn cycle(&mut self) -> (CycleReport, bool) {
        let next = self.clock.now() + self.period;
        let report = self
            .chain
            .exchange(&self.targets, &mut self.states)
            .expect("the bus is there");
        let kept = self.clock.now() <= next;
        self.clock.sleep_until(next);
        (report, kept)
    }

    /// `seconds` of cycles, of which none may come late or miss a servo; returns their mean in microseconds.
    #[track_caller]
    fn healthy_mean_us(&mut self, seconds: f64) -> f64 {
        let cycles = (seconds / self.period.as_secs_f64()).round() as u32;
        let mut sum = 0.0;
        for cycle in 0..cycles {
            let (report, kept) = self.cycle();
            assert!(kept, "cycle {cycle} took {} us", report.cycle_us);
            assert_eq!(
                usize::from(report.fresh),
                self.targets.len(),
                "cycle {cycle}: {report:?}"
            );
            sum += f64::from(report.cycle_us);
        }
        sum / f64::from(cycles)
    }
}

#[track_caller]
fn near(found_us: f64, expected_us: f64, part: f64, what: &str) {
    let off = found_us / expected_us - 1.0;
    assert!(
        off.abs() < part,
        "{what}: {found_us:.1} us a cycle, the formula says {expected_us} ({:+.2} %)",
        100.0 * off
    );
}

#[test]
fn twelve_servos_at_1_mbaud_take_2760_us() {
    let mut driven = rig(12, 1_000_000, LineOptions::default()).driven(200.0);
    let mean_us = driven.healthy_mean_us(2.0);
    near(mean_us, 2760.0, 0.01, "12 servos, 1 Mbaud");
    // What the driver adds to the wire: waits beyond the last byte.
    let share = mean_us / 2760.0 - 1.0;
    assert!(share < 0.03, "the driver adds {:.2} %", 100.0 * share);
}

#[test]
fn twelve_servos_with_hops_of_50_us_take_3360_us() {
    let hop = 50 * MICROSECOND;
    let options = LineOptions {
        turnaround: hop,
        hop,
        ..LineOptions::default()
    };
    let mut driven = rig(12, 1_000_000, options).driven(200.0);
    let mean_us = driven.healthy_mean_us(2.0);
    near(mean_us, 3360.0, 0.01, "12 servos, 1 Mbaud, hops of 50 us");
}

#[test]
fn twenty_four_servos_at_3_mbaud_keep_200_hz() {
    let mut driven = rig(24, 3_000_000, LineOptions::default()).driven(200.0);
    let mean_us = driven.healthy_mean_us(5.0);
    near(mean_us, 1720.0, 0.01, "24 servos, 3 Mbaud");
}

#[test]
fn six_servos_at_4_mbaud_keep_1_khz() {
    let mut driven = rig(6, 4_000_000, LineOptions::default()).driven(1000.0);
    let mean_us = driven.healthy_mean_us(5.0);
    near(mean_us, 390.0, 0.01, "6 servos, 4 Mbaud");
}

/// Microseconds of a cycle, fast and ordinary, at 57,600, 1 M, 2 M, 3 M and 4 Mbaud: goal 4 bytes, state 10 bytes.
const BUDGET_US: [(u8, [(f64, f64); 5]); 4] = [
    (
        1,
        [
            (9722.0, 9549.0),
            (560.0, 550.0),
            (280.0, 275.0),
            (187.0, 183.0),
            (140.0, 138.0),
        ],
    ),
    (
        6,
        [
            (27083.0, 32986.0),
            (1560.0, 1900.0),
            (780.0, 950.0),
            (520.0, 633.0),
            (390.0, 475.0),
        ],
    ),
    (
        12,
        [
            (47917.0, 61111.0),
            (2760.0, 3520.0),
            (1380.0, 1760.0),
            (920.0, 1173.0),
            (690.0, 880.0),
        ],
    ),
    (
        24,
        [
            (89583.0, 117_361.0),
            (5160.0, 6760.0),
            (2580.0, 3380.0),
            (1720.0, 2253.0),
            (1290.0, 1690.0),
        ],
    ),
];

#[test]
fn the_table_of_cycle_times_is_kept_at_every_rate() {
    for (servos, row) in BUDGET_US {
        for (baud, (fast_us, ordinary_us)) in [57_600, 1_000_000, 2_000_000, 3_000_000, 4_000_000]
            .into_iter()
            .zip(row)
        {
            for (reads, expected_us) in [(Reads::Fast, fast_us), (Reads::Ordinary, ordinary_us)] {
                let what = format!("{servos} servos, {baud} baud, {}", reads.as_str());
                let seconds = 50.0 * expected_us * 1e-6;
                let report = rig(servos, baud, LineOptions::default()).bench(reads, seconds);
                let mean_us = 1e6 / report.cycles_per_s();
                near(mean_us, expected_us, 0.01, &what);
                near(report.cycle_us.p50 as f64, expected_us, 0.01, &what);
                near(report.wire.as_secs_f64() * 1e6, expected_us, 0.01, &what);
                assert_eq!(report.errors().total(), 0, "{what}: {report:?}");
            }
        }
    }
}

#[test]
fn the_return_delay_is_paid_once_a_servo_or_once_in_all() {
    // Twelve servos with the delay they come with, 500 us, at 4 Mbaud.
    let delay = Duration::from_micros(500);
    for (reads, expected_us) in [(Reads::Ordinary, 6880.0), (Reads::Fast, 1190.0)] {
        let time = wire_time(reads, 4_000_000, (12, 4), (12, 10), delay);
        near(time.as_secs_f64() * 1e6, expected_us, 0.01, reads.as_str());
        let mut rig = rig(12, 4_000_000, LineOptions::default());
        for id in 1..=12 {
            rig.master.write(id, 9, &[250]).expect("a healthy servo");
        }
        let report = rig.bench(reads, 0.5);
        let mean_us = 1e6 / report.cycles_per_s();
        near(mean_us, expected_us, 0.01, reads.as_str());
    }
}

#[test]
fn a_silent_servo_costs_its_slot_and_no_other_value() {
    for after_silence in [AfterSilence::Answer, AfterSilence::Wait] {
        let options = LineOptions {
            after_silence,
            ..LineOptions::default()
        };
        let mut driven = rig(12, 1_000_000, options).driven(200.0);
        driven.healthy_mean_us(1.0);
        let now_s = driven.clock.now().secs();
        let fault = format!("6:silent@{}s", now_s + 0.0001);
        let fault = fault.parse().expect("a good specification");
        driven
            .line
            .lock()
            .inject(fault)
            .expect("a servo of the line");
        let (mut kept, mut longest_us, mut late, mut sum) = (12, 0, 0, 0.0);
        for cycle in 0..400 {
            let (report, in_time) = driven.cycle();
            if cycle > 0 {
                // The cycle before had begun when the servo fell silent.
                kept = kept.min(report.fresh);
            }
            late += u32::from(!in_time);
            longest_us = longest_us.max(report.cycle_us);
            sum += f64::from(report.cycle_us);
        }
        let mean_us = sum / 400.0;
        assert_eq!(kept, 11, "{after_silence:?}: healthy values kept at least");
        assert_eq!(late, 0, "{after_silence:?}: longest cycle {longest_us} us");
        // Without its 14 + 5 + 1 bytes a cycle is 200 us shorter; asking it again costs a little now and then.
        assert!(
            (2560.0..2780.0).contains(&mean_us),
            "{after_silence:?}: {mean_us:.0} us a cycle"
        );
    }
}

#[test]
fn a_bench_moves_nothing_and_leaves_torque_alone() {
    // 1: torque off. 2: holds its goal, pulled aside by a load. 3: torque on, goal far away and blocked by nothing.
    // 4: torque off and a goal would turn it on. 5: torque on in extended position mode, three turns out.
    let mut rig = rig(5, 1_000_000, LineOptions::default());
    let (clock, line) = (rig.clock.clone(), rig.line.clone());
    let master = &mut rig.master;
    let four = |value: i32| value.to_le_bytes();
    master.write(1, 116, &four(1000)).expect("a goal");
    master.write(4, 10, &[0b1000]).expect("drive mode");
    master.write(5, 11, &[4]).expect("extended position mode");
    for id in [2, 3, 5] {
        master.write(id, 64, &[1]).expect("torque");
    }
    master.write(5, 116, &four(3 * 4096)).expect("a goal");
    clock.sleep_until(clock.now() + Duration::from_secs(8));
    master.write(2, 116, &four(2060)).expect("a goal");
    clock.sleep_until(clock.now() + Duration::from_secs(1));
    master
        .write(2, 116, &four(2100))
        .expect("a goal 40 counts on");

    let present_before: Vec<f64> = {
        let mut line = line.lock();
        line.advance(clock.now());
        (1..=5)
            .map(|id| line.servo(id).expect("on the line").position_pulses())
            .collect()
    };
    let report = rig.bench(Reads::Fast, 1.0);
    assert_eq!(report.errors().total(), 0, "{report:?}");
    let mut master = Master::new(
        Box::new(SimPort::new(
            line.clone(),
            Arc::new(clock.clone()),
            1_000_000,
        )),
        MasterOptions::default(),
    );
    let mut torque = [0; 5];
    let mut goals = [0; 5];
    for id in 1..=5u8 {
        let place = usize::from(id) - 1;
        let mut bytes = [0; 4];
        master.read(id, 116, &mut bytes).expect("an answer");
        goals[place] = i32::from_le_bytes(bytes);
        let mut on = [0];
        master.read(id, 64, &mut on).expect("an answer");
        torque[place] = on[0];
    }
    assert_eq!(torque, [0, 1, 1, 0, 1], "torque after the bench");
    assert_eq!(goals[0], 2048, "without torque: the present position");
    assert_eq!(goals[1], 2100, "held: the goal it had");
    let moved: Vec<f64> = (1..=5)
        .map(|id| {
            line.lock()
                .servo(id)
                .expect("on the line")
                .position_pulses()
        })
        .zip(&present_before)
        .map(|(after, before)| after - before)
        .collect();
    for (index, moved) in moved.iter().enumerate() {
        let allowed = if index == 1 { 60.0 } else { 3.0 };
        assert!(
            moved.abs() < allowed,
            "servo {} moved {moved:.1} counts",
            index + 1
        );
    }
}

#[test]
fn a_bench_counts_what_goes_wrong_by_kind_and_servo() {
    // Servo 6 is silent for a second in the middle, the line damages one frame in twenty in the fourth second.
    let mut rig = rig(12, 1_000_000, LineOptions::default());
    let mut found = Vec::new();
    rig.master
        .ping_all(&mut |ping| found.push(Found::Servo(ping)))
        .expect("a port that is there");
    let mut bench = Bench::inspect(&mut rig.master, &found).expect("healthy servos");
    let now_s = rig.clock.now().secs();
    for fault in [
        format!("6:silent@{}s..{}s", now_s + 1.0, now_s + 2.0),
        format!("bus:corrupt=0.05@{}s..{}s", now_s + 3.0, now_s + 4.0),
    ] {
        let fault = fault.parse().expect("a good specification");
        rig.line.lock().inject(fault).expect("on the line");
    }
    let options = BenchOptions {
        reads: Reads::Fast,
        span: Duration::from_secs(5),
        period: Some(Duration::from_millis(5)),
    };
    let polls = Cell::new(0);
    let clock = rig.clock.clone();
    let report = bench
        .run(
            &mut rig.master,
            &options,
            &|span| clock.sleep_until(clock.now() + span),
            &|| Duration::ZERO,
            &|| {
                polls.set(polls.get() + 1);
                false
            },
        )
        .expect("a port that is there");
    assert!(
        (998..=1001).contains(&report.cycles),
        "{} cycles of 5 ms in 5 s",
        report.cycles
    );
    assert!(
        polls.get() >= report.cycles,
        "asked {} times whether to stop",
        polls.get()
    );
    let six = report.servos[5];
    assert_eq!(six.id, 6);
    // Three cycles, then asked once every 250 ms while silent.
    assert!((6..=8).contains(&six.errors.silent), "{six:?}");
    assert!((150..=210).contains(&six.left_out), "{six:?}");
    let errors = report.errors();
    assert!(errors.damaged > 3, "{errors:?}");
    assert!(errors.not_reached >= 6 * six.errors.silent, "{errors:?}");
    for servo in &report.servos {
        let all = servo.fresh + servo.errors.total() + servo.left_out;
        assert_eq!(all, report.cycles, "every cycle counts once: {servo:?}");
    }
}
