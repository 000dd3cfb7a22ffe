//! A whole run in virtual time with what a test does to it: faults on the line, servos that say they are ill,
//! an operator, a machine that is slow. Every cycle is kept.

use super::character::{RATE_HZ, built_in};
use super::limits::LimitWatch;
use handwave::base::{Clock, JointState, Time, VirtualClock};
use handwave::bus::port::bare;
use handwave::bus::{BusError, CycleReport, ServoBus, ServoFacts, ServoHealth, TorqueReport};
use handwave::config::Character;
use handwave::live::safety::{FaultKind, ServoState};
use handwave::live::session::{self, Observer, Report, Session};
use handwave::live::stats::Fault;
use handwave::live::{CycleRecord, StopSwitch, source, wire};
use handwave::puppet::Stage;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

/// What servos are made to say, given the time of the run.
pub type Illness = Box<dyn FnMut(f64, &mut [JointState], &mut [ServoHealth]) + Send>;
/// What somebody does after a cycle.
pub type Meddler = Box<dyn FnMut(&CycleRecord, &VirtualClock, &StopSwitch)>;

/// A run to be.
pub struct Rig {
    pub character: Character,
    /// The run is brought to its end after this long.
    pub seconds: f64,
    pub faults: Vec<String>,
    pub illness: Option<Illness>,
    pub meddler: Option<Meddler>,
}

/// One cycle.
pub struct Row {
    pub t_s: f64,
    pub robot: ServoState,
    pub vigour: f64,
    pub waits: bool,
    pub stage: Stage,
    pub targets: Vec<f64>,
    pub states: Vec<f64>,
    pub bus: CycleReport,
}

/// A run that was.
pub struct Ran {
    pub report: Report,
    pub rows: Vec<Row>,
    pub character: Character,
}

impl Rig {
    /// The built-in quadruped, drumming from about 6 s on.
    pub fn new(seconds: f64, faults: &[&str]) -> Self {
        Self {
            character: built_in(),
            seconds,
            faults: faults.iter().map(ToString::to_string).collect(),
            illness: None,
            meddler: None,
        }
    }

    pub fn with(mut self, edit: impl FnOnce(&mut Character)) -> Self {
        edit(&mut self.character);
        self
    }

    pub fn ill(
        mut self,
        illness: impl FnMut(f64, &mut [JointState], &mut [ServoHealth]) + Send + 'static,
    ) -> Self {
        self.illness = Some(Box::new(illness));
        self
    }

    pub fn meddle(
        mut self,
        meddler: impl FnMut(&CycleRecord, &VirtualClock, &StopSwitch) + 'static,
    ) -> Self {
        self.meddler = Some(Box::new(meddler));
        self
    }

    pub fn run(self) -> Ran {
        let character = self.character;
        let clock = VirtualClock::new();
        let shared: Arc<dyn Clock> = Arc::new(clock.clone());
        let wire = wire::open(&character, &character.bus, shared, RATE_HZ, &mut bare);
        let wire = wire.expect("a wire");
        let lines = wire.line.clone().expect("simulated");
        let start = Arc::new(AtomicI64::new(0));
        let bus: Box<dyn ServoBus> = match self.illness {
            None => wire.bus,
            Some(illness) => Box::new(Sick {
                inner: wire.bus,
                illness,
                clock: clock.clone(),
                start: Arc::clone(&start),
                health: vec![ServoHealth::default(); character.joints.len()],
            }),
        };
        let mut reader = source::open(&character.source, &character.files).expect("the poses");
        let first = source::first_sample(&mut reader).expect("a sample");
        let puppet = session::puppet(&character, reader.header(), RATE_HZ).expect("a puppet");
        let stop = StopSwitch::new();
        let faults: Vec<_> = (self.faults.iter())
            .map(|text| text.parse().expect("a fault"))
            .collect();
        let session = Session {
            puppet,
            bus,
            reader,
            first,
            live: None,
            reload: None,
            stop: stop.clone(),
            options: session::control_options(&character, RATE_HZ, Some(self.seconds)),
            taps: None,
            on_start: Box::new(move |time| {
                start.store(time.nanos(), Ordering::SeqCst);
                wire::inject(&lines, &faults, time);
            }),
        };
        let mut onlooker = Onlooker {
            rows: Vec::new(),
            meddler: self.meddler,
            clock: clock.clone(),
            stop,
        };
        let report = session::run_virtual(session, &clock, &mut onlooker);
        Ran {
            report,
            rows: onlooker.rows,
            character,
        }
    }
}

struct Onlooker {
    rows: Vec<Row>,
    meddler: Option<Meddler>,
    clock: VirtualClock,
    stop: StopSwitch,
}

impl Observer for Onlooker {
    fn cycle(&mut self, record: &CycleRecord) {
        self.rows.push(Row {
            t_s: record.t_s,
            robot: record.robot,
            vigour: record.vigour,
            waits: record.waits,
            stage: record.stage,
            targets: record.targets.clone(),
            states: record.states.iter().map(|s| s.position).collect(),
            bus: record.bus,
        });
        if let Some(meddler) = &mut self.meddler {
            meddler(record, &self.clock, &self.stop);
        }
    }
    fn tick(&mut self) {}
}

impl Ran {
    /// Faults of this kind.
    pub fn faults(&self, kind: FaultKind) -> Vec<&Fault> {
        let all = self.report.stats.faults.iter();
        all.filter(|fault| fault.kind == kind).collect()
    }

    /// The row of this time.
    pub fn at(&self, t_s: f64) -> &Row {
        let found = self.rows.iter().find(|row| row.t_s >= t_s - 1e-9);
        found.unwrap_or_else(|| panic!("the run ended before {t_s} s"))
    }

    /// Rows of a span of time.
    pub fn between(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = &Row> {
        let inside = move |row: &&Row| (from_s..to_s).contains(&row.t_s);
        self.rows.iter().filter(inside)
    }

    /// How far the targets of a joint go to and fro in a span of time, rad.
    pub fn sweep(&self, joint: usize, from_s: f64, to_s: f64) -> f64 {
        let values: Vec<f64> = self
            .between(from_s, to_s)
            .map(|r| r.targets[joint])
            .collect();
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        most - least
    }

    /// Fails where a target left the envelope. Where servos are armed anew it begins anew, at rest where they stand.
    #[track_caller]
    pub fn expect_inside(&self) {
        let mut watch = LimitWatch::new(&self.character.limits, 1.0 / RATE_HZ);
        let mut before = ServoState::Offline;
        for row in &self.rows {
            // All servos from `present` to `armed` at once: the whole robot was armed anew.
            let anew = row.robot == ServoState::Armed && before == ServoState::Present;
            before = row.robot;
            if anew {
                watch = LimitWatch::new(&self.character.limits, 1.0 / RATE_HZ);
            }
            watch
                .see(&row.targets)
                .unwrap_or_else(|e| panic!("at {} s: {e}", row.t_s));
        }
    }
}

/// Servos that say what a test wants them to say.
struct Sick {
    inner: Box<dyn ServoBus>,
    illness: Illness,
    clock: VirtualClock,
    start: Arc<AtomicI64>,
    health: Vec<ServoHealth>,
}

impl ServoBus for Sick {
    fn joints(&self) -> &[String] {
        self.inner.joints()
    }
    fn prepare(&mut self, states: &mut [JointState]) -> Result<(), BusError> {
        self.inner.prepare(states)
    }
    fn arm(&mut self) -> Result<(), BusError> {
        self.inner.arm()
    }
    fn goals(&self, out_rad: &mut [f64]) {
        self.inner.goals(out_rad);
    }
    fn exchange(
        &mut self,
        targets_rad: &[f64],
        states: &mut [JointState],
    ) -> Result<CycleReport, BusError> {
        let report = self.inner.exchange(targets_rad, states)?;
        let now = self.clock.now();
        let start = Time::from_nanos(self.start.load(Ordering::SeqCst));
        let known = self.inner.health();
        for (mine, known) in self.health.iter_mut().zip(known) {
            *mine = *known;
        }
        for health in &mut self.health {
            health.measured_at = Some(now);
        }
        (self.illness)(now.secs_since(start), states, &mut self.health);
        Ok(report)
    }
    fn torque_off(&mut self) -> Result<TorqueReport, BusError> {
        self.inner.torque_off()
    }
    fn rearm(&mut self, joint: usize) -> Result<(), BusError> {
        self.inner.rearm(joint)
    }
    fn reboot(&mut self, joint: usize) -> Result<(), BusError> {
        self.inner.reboot(joint)
    }
    fn facts(&self) -> &[ServoFacts] {
        self.inner.facts()
    }
    fn health(&self) -> &[ServoHealth] {
        &self.health
    }
    fn reopen(&mut self) -> Result<(), BusError> {
        self.inner.reopen()
    }
    fn notes(&self) -> &[String] {
        self.inner.notes()
    }
}
