//! The control loop allocates nothing, whatever happens to the servos: they fall silent, latch errors, are taken back.

mod support;

use handwave::base::{JointState, Time, VirtualClock};
use handwave::bus::{BusError, CycleReport, ServoBus, ServoHealth, TorqueReport};
use handwave::config::file::{OnServoFault, Rearm};
use handwave::live::control::{self, Ending, Parts};
use handwave::live::feed::Feed;
use handwave::live::record::Recorder;
use handwave::live::{CycleRecord, StopSwitch, session};
use handwave::pose::PoseSample;
use support::character::{RATE_HZ, built_in, performance};
use support::counting::{Counting, calls};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Servos that are where they are told to be, and fall out as a script says.
struct Scripted {
    joints: Vec<String>,
    positions: Vec<f64>,
    health: Vec<ServoHealth>,
    cycle: u64,
    limp: bool,
}

impl ServoBus for Scripted {
    fn joints(&self) -> &[String] {
        &self.joints
    }
    fn prepare(&mut self, states: &mut [JointState]) -> Result<(), BusError> {
        states.fill(JointState::default());
        Ok(())
    }
    fn arm(&mut self) -> Result<(), BusError> {
        Ok(())
    }
    fn goals(&self, out_rad: &mut [f64]) {
        out_rad.copy_from_slice(&self.positions);
    }
    fn exchange(
        &mut self,
        targets_rad: &[f64],
        states: &mut [JointState],
    ) -> Result<CycleReport, BusError> {
        self.cycle += 1;
        let now = Time::from_secs(self.cycle as f64 / RATE_HZ);
        self.positions.copy_from_slice(targets_rad);
        for (state, position) in states.iter_mut().zip(&self.positions) {
            state.position = *position;
            state.measured_at = Some(now);
        }
        for health in &mut self.health {
            health.measured_at = Some(now);
        }
        let mut report = CycleReport::default();
        match self.cycle {
            300..400 => report.silent_mask = 0b10,
            500 => self.limp = true,
            700..1200 => self.health[3].temperature_c = Some(self.cycle as f64 / 20.0),
            1300..1800 => states[4].position += 1.0,
            _ => {}
        }
        report.torqueless_mask = u64::from(self.limp) << 2;
        report.alert_mask = u64::from((600..650).contains(&self.cycle)) << 5;
        Ok(report)
    }
    fn torque_off(&mut self) -> Result<TorqueReport, BusError> {
        Ok(TorqueReport::default())
    }
    fn rearm(&mut self, _: usize) -> Result<(), BusError> {
        self.limp = false;
        Ok(())
    }
    fn reboot(&mut self, _: usize) -> Result<(), BusError> {
        Ok(())
    }
    fn health(&self) -> &[ServoHealth] {
        &self.health
    }
}

struct Silence(f64);

impl Feed for Silence {
    fn begin(&mut self, _: f64) {}
    fn take(&mut self, now_s: f64, _: &mut Vec<PoseSample>) {
        self.0 = now_s;
    }
    fn give_back(&mut self, _: &mut Vec<PoseSample>) {}
    fn ended(&self) -> bool {
        self.0 > 12.0
    }
}

/// Counts what was allocated or freed from one cycle to the next.
struct Counter {
    record: CycleRecord,
    before: u64,
    cycles: u64,
    late: Vec<(u64, u64)>,
}

impl Recorder for Counter {
    fn slot(&mut self) -> Option<&mut CycleRecord> {
        Some(&mut self.record)
    }
    fn commit(&mut self) {
        let made = calls() - self.before;
        if made > 0 && self.cycles > 10 && self.late.len() < 8 {
            self.late.push((self.cycles, made));
        }
        self.cycles += 1;
        self.before = calls();
    }
}

#[test]
fn the_loop_allocates_nothing_while_servos_fall_out_and_are_taken_back() {
    let mut character = built_in();
    character.safety.on_servo_fault = OnServoFault::Continue;
    character.safety.rearm = Rearm::Auto;
    character.safety.supervision.temperature_limit_c = Some(60.0);
    let (header, _) = performance(&character);
    let mut puppet = session::puppet(&character, &header, RATE_HZ).expect("a puppet");
    let joints = character.joints.len();
    let mut bus = Scripted {
        joints: character.joints.clone(),
        positions: vec![0.0; joints],
        health: vec![ServoHealth::default(); joints],
        cycle: 0,
        limp: false,
    };
    let mut counter = Counter {
        record: CycleRecord::for_puppet(&puppet),
        before: 0,
        cycles: 0,
        late: Vec::with_capacity(8),
    };
    counter.record.health.reserve(joints);
    let outcome = control::run(
        Parts {
            puppet: &mut puppet,
            bus: &mut bus,
            feed: &mut Silence(0.0),
            clock: &VirtualClock::new(),
            stop: &StopSwitch::new(),
            handover: None,
            recorder: &mut counter,
            on_start: &mut |_| {},
        },
        &session::control_options(&character, RATE_HZ, None),
    );
    assert!(
        matches!(outcome.ending, Ending::Complete),
        "{:?}",
        outcome.ending
    );
    assert_eq!(counter.late, [], "(cycle, allocator calls) after the tenth");
    let kinds: Vec<&str> = outcome
        .stats
        .faults
        .iter()
        .map(|f| f.kind.as_str())
        .collect();
    assert!(kinds.len() >= 6, "little happened: {kinds:?}");
    println!("{} cycles without allocation; {kinds:?}", counter.cycles);
}
