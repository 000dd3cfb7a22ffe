//! Random runs: poses as no tracker should send them, a clock that jumps, faults on the line, an operator who presses
//! anything; through the whole program but its command line. The envelope is never left, every run ends as declared.
//!
//! `HANDWAVE_CYCLES=1000000` makes it a million cycles, `HANDWAVE_SEED=N` begins at that seed.

mod support;

use handwave::base::{Clock, Time, VirtualClock};
use handwave::bus::port::bare;
use handwave::config::Character;
use handwave::config::file::{OnBusLost, OnLost, OnOverrun, OnServoFault, Rearm};
use handwave::live::control::{self, Ending, Parts};
use handwave::live::feed::Feed;
use handwave::live::record::Recorder;
use handwave::live::safety::ServoState;
use handwave::live::{CycleRecord, StopSwitch, session, wire};
use handwave::pose::{PoseHeader, PoseSample};
use handwave::sim::FaultSpec;
use handwave::sim::fault::{Chance, FAULTS, Scope};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;
use support::character::{RATE_HZ, built_in, performance};
use support::limits::LimitWatch;

fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| {
        text.parse()
            .unwrap_or_else(|e| panic!("{name}={text}: {e}"))
    })
}

/// Poses as they should not come.
struct Mischief {
    chance: Chance,
    good: Vec<PoseSample>,
    next: usize,
    /// No poses until then.
    gap_until_s: f64,
    ends_s: f64,
    now_s: f64,
}

impl Mischief {
    fn odd(&mut self) -> f64 {
        match self.chance.below(5) {
            0 => f64::NAN,
            1 => f64::INFINITY,
            2 => -1e300,
            3 => 1e-310,
            _ => f64::from(self.chance.bits()) / 4e9 - 0.5,
        }
    }
}

impl Feed for Mischief {
    fn begin(&mut self, _: f64) {}

    fn take(&mut self, now_s: f64, out: &mut Vec<PoseSample>) {
        self.now_s = now_s;
        if now_s < self.gap_until_s {
            return;
        }
        if self.chance.happens(0.001) {
            self.gap_until_s = now_s + self.chance.below(300) as f64 * 0.01;
        }
        while self.chance.happens(0.4) && out.len() < 6 {
            let mut sample = self.good[self.next].clone();
            let step = if self.chance.happens(0.01) { 400 } else { 1 };
            self.next = (self.next + step) % self.good.len();
            sample.t = now_s - 0.001;
            match self.chance.below(50) {
                0 => sample.t = self.odd(),
                1 => sample.t -= 3.0,
                2 => out.push(sample.clone()),
                3 => {
                    let point = self.chance.below(sample.points.len());
                    sample.points[point] = Some([self.odd(), self.odd(), self.odd()]);
                }
                4 => sample.points.fill(None),
                5 => sample.points.truncate(1),
                _ => {}
            }
            out.push(sample);
        }
    }

    fn give_back(&mut self, samples: &mut Vec<PoseSample>) {
        samples.clear();
    }

    fn ended(&self) -> bool {
        self.now_s >= self.ends_s
    }
}

/// Judges every cycle, lets time jump, presses keys.
struct Judge {
    seed: u64,
    record: CycleRecord,
    character: Character,
    watch: LimitWatch,
    before: ServoState,
    seen: BTreeMap<&'static str, u64>,
    cycles: u64,
    most: u64,
    chance: Chance,
    clock: VirtualClock,
    stop: StopSwitch,
    wrong: Option<String>,
}

impl Recorder for Judge {
    fn slot(&mut self) -> Option<&mut CycleRecord> {
        Some(&mut self.record)
    }

    fn commit(&mut self) {
        let record = &self.record;
        let anew = record.robot == ServoState::Armed && self.before == ServoState::Present;
        if anew || self.cycles == 0 {
            self.watch = LimitWatch::new(&self.character.limits, 1.0 / RATE_HZ);
        }
        self.before = record.robot;
        let told =
            |what: String| format!("HANDWAVE_SEED={}, cycle {}: {what}", self.seed, self.cycles);
        let finite = record.targets.iter().all(|t| t.is_finite());
        if !finite {
            (self.wrong).get_or_insert(told(format!("targets {:?}", record.targets)));
        } else if let Err(problem) = self.watch.see(&record.targets) {
            (self.wrong).get_or_insert(told(format!("{problem}; robot {:?}", record.robot)));
        }
        if !(0.0..=1.0).contains(&record.vigour) {
            (self.wrong).get_or_insert(told(format!("vigour {}", record.vigour)));
        }
        *self.seen.entry(record.robot.as_str()).or_insert(0) += 1;
        self.cycles += 1;
        if self.chance.happens(0.0008) {
            let pause = Duration::from_millis(self.chance.below(900) as u64);
            self.clock.sleep_until(self.clock.now() + pause);
        }
        if self.chance.happens(0.004) {
            self.stop.ask_rearm();
        }
        if self.chance.happens(0.0001) {
            self.stop.press();
        }
        if self.cycles >= self.most || self.wrong.is_some() {
            self.stop.press();
            self.stop.press();
        }
    }
}

fn random_policies(character: &mut Character, chance: &mut Chance) {
    let safety = &mut character.safety;
    safety.on_lost = [OnLost::Idle, OnLost::Hold, OnLost::Stop][chance.below(3)];
    safety.on_servo_fault = match chance.below(4) {
        0 => OnServoFault::Stop,
        _ => OnServoFault::Continue,
    };
    safety.rearm = [Rearm::Operator, Rearm::Auto][chance.below(2)];
    safety.on_bus_lost = match chance.below(4) {
        0 => Some(OnBusLost::Exit),
        _ => Some(OnBusLost::Wait),
    };
    safety.on_overrun = [OnOverrun::Hold, OnOverrun::Stop, OnOverrun::Continue][chance.below(3)];
    if chance.happens(0.5) {
        for limit in &mut character.limits {
            limit.jerk = 20_000.0;
        }
    }
}

fn random_faults(chance: &mut Chance, seconds: f64) -> Vec<FaultSpec> {
    let count = 1 + chance.below(5);
    (0..count)
        .map(|_| {
            let fault = &FAULTS[chance.below(FAULTS.len())];
            let target = match fault.scope {
                Scope::Servo => (1 + chance.below(12)).to_string(),
                Scope::Bus => "bus".into(),
            };
            let from = seconds * chance.below(900) as f64 / 1000.0;
            let until = from + 0.05 + chance.below(200) as f64 * 0.01;
            let spec = format!("{target}:{}@{from:.3}s..{until:.3}s", fault.name);
            spec.parse().expect("a fault of the list")
        })
        .collect()
}

/// One run of at most `most` cycles; returns how many there were.
fn run(
    seed: u64,
    most: u64,
    performance: &(PoseHeader, Vec<PoseSample>),
    seen: &mut BTreeMap<&'static str, u64>,
    endings: &mut BTreeMap<&'static str, u64>,
) -> u64 {
    let mut chance = Chance::new(seed);
    let mut character = built_in();
    random_policies(&mut character, &mut chance);
    let seconds = most as f64 / RATE_HZ;
    let clock = VirtualClock::new();
    let shared: Arc<dyn Clock> = Arc::new(clock.clone());
    let wire = wire::open(&character, &character.bus, shared, RATE_HZ, &mut bare);
    let mut wire = wire.expect("a wire");
    let lines = wire.line.clone().expect("simulated");
    let (header, good) = performance;
    let mut puppet = session::puppet(&character, header, RATE_HZ).expect("a puppet");
    let stop = StopSwitch::new();
    let mut feed = Mischief {
        next: chance.below(good.len()),
        good: good.clone(),
        gap_until_s: 0.0,
        ends_s: seconds * (0.5 + 0.001 * chance.below(600) as f64),
        now_s: 0.0,
        chance: Chance::new(seed + 1_000_000),
    };
    let mut judge = Judge {
        seed,
        record: CycleRecord::for_puppet(&puppet),
        watch: LimitWatch::new(&character.limits, 1.0 / RATE_HZ),
        before: ServoState::Offline,
        seen: BTreeMap::new(),
        cycles: 0,
        most,
        chance: Chance::new(seed + 2_000_000),
        clock: clock.clone(),
        stop: stop.clone(),
        wrong: None,
        character: built_in(),
    };
    judge.character.limits.clone_from(&character.limits);
    let faults = random_faults(&mut chance, seconds);
    let outcome = control::run(
        Parts {
            puppet: &mut puppet,
            bus: wire.bus.as_mut(),
            feed: &mut feed,
            clock: &clock,
            stop: &stop,
            handover: None,
            recorder: &mut judge,
            on_start: &mut |time: Time| wire::inject(&lines, &faults, time),
        },
        &session::control_options(&character, RATE_HZ, None),
    );
    if let Some(wrong) = &judge.wrong {
        panic!("{wrong}; faults {faults:?}");
    }
    let word = match &outcome.ending {
        Ending::Complete => "complete",
        Ending::Interrupted => "interrupted",
        Ending::Bus(_) => "bus failure",
        Ending::SafetyStop(reason) => {
            assert!(
                !reason.contains("internal error"),
                "HANDWAVE_SEED={seed}, cycle {}: the loop panicked",
                judge.cycles
            );
            "safety stop"
        }
    };
    *endings.entry(word).or_insert(0) += 1;
    assert!(
        outcome.torque.is_some(),
        "HANDWAVE_SEED={seed}: torque was not switched off"
    );
    for (state, count) in judge.seen {
        *seen.entry(state).or_insert(0) += count;
    }
    judge.cycles
}

#[test]
fn random_runs_stay_in_the_envelope_and_end_as_declared() {
    const MOST: u64 = 3_000;
    let wanted = number("HANDWAVE_CYCLES", 20_000);
    let first = number("HANDWAVE_SEED", 51_000);
    let performance = performance(&built_in());
    let (mut seen, mut endings) = (BTreeMap::new(), BTreeMap::new());
    let (mut cycles, mut seed) = (0, first);
    while cycles < wanted {
        cycles += run(seed, MOST, &performance, &mut seen, &mut endings);
        seed += 1;
    }
    println!(
        "{cycles} cycles in {} runs: states {seen:?}, endings {endings:?}",
        seed - first
    );
    if std::env::var("HANDWAVE_SEED").is_err() {
        for state in ServoState::ALL {
            assert!(
                seen.contains_key(state.as_str()),
                "{} was never reached: {seen:?}",
                state.as_str()
            );
        }
    }
}
