//! Runs the control loop again on what was recorded: the same answers in, and what it sends compared.

use super::avatar::TapBus;
use super::pose;
use crate::base::{Clock, Time};
use crate::bus::tap::{Difference, Event, ReplayPort, Script, Verdict};
use crate::bus::{BusAddress, Port};
use crate::config::Character;
use crate::live::control::{self, ControlOptions, Parts};
use crate::live::feed::Feed;
use crate::live::record::{CycleRecord, Inline};
use crate::live::session::{self, SessionError};
use crate::live::stats::Stats;
use crate::live::stop::{STOP_PRESSES, StopSwitch, Witness};
use crate::live::wire::{self, WireError};
use crate::pose::{PoseHeader, PoseSample};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// One log of a recording: its name, and its pieces with the time that each follows.
pub type RecordedLog = (String, Vec<(Time, Vec<u8>)>);

/// A recording, ready to be run again.
#[derive(Debug)]
pub struct Recorded {
    /// Who was played, as it was configured for the run.
    pub character: Character,
    /// What the poses consisted of.
    pub header: PoseHeader,
    /// How the run was driven.
    pub options: ControlOptions,
    /// The control thread's log first, then one per port in the order of their opening.
    pub logs: Vec<RecordedLog>,
}

/// What became of a replay.
#[derive(Debug)]
pub struct Replayed {
    /// What the loop measured; its times are those of the recording.
    pub stats: Stats,
    /// Frames that were sent as recorded, and their bytes.
    pub frames: u64,
    /// Bytes in them.
    pub bytes: u64,
    /// Where it parts from the recording, and in which cycle.
    pub difference: Option<(Difference, u64)>,
    /// Why it could not go on to the end of the run.
    pub ended: Option<String>,
    /// Time of cycle 0 on the recording's clock.
    pub start: Time,
}

/// Why a recording cannot be run again.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The puppet cannot be built.
    #[error("{0}")]
    Session(#[from] SessionError),
    /// The bus cannot be built.
    #[error("{0}")]
    Wire(#[from] WireError),
    /// There is nothing to go by.
    #[error(
        "the recording has {found} of its logs, the character has {wanted} buses: it was cut before the servos were found, or made by another build"
    )]
    Logs {
        /// Logs of buses in the recording.
        found: usize,
        /// Buses of the character.
        wanted: usize,
    },
}

/// The control thread's log, handed out to clock, feed and stop switch.
#[derive(Debug)]
struct Control {
    script: Mutex<Script>,
    verdict: Arc<Verdict>,
    /// Where time stands when the log is over: loops that wait for something come to an end.
    beyond: Mutex<Time>,
    seen: Mutex<[u64; super::tap::SEEN_KINDS]>,
}

impl Control {
    fn script(&self) -> MutexGuard<'_, Script> {
        self.script.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Clock for Control {
    fn now(&self) -> Time {
        let now = self.script().expect(
            || "a look at the clock".into(),
            |event| match event {
                Event::Now(time) => Some(*time),
                _ => None,
            },
        );
        let mut beyond = self.beyond.lock().unwrap_or_else(PoisonError::into_inner);
        *beyond = now.unwrap_or(*beyond);
        *beyond
    }

    fn sleep_until(&self, time: Time) {
        if self.verdict.is_over() {
            let mut beyond = self.beyond.lock().unwrap_or_else(PoisonError::into_inner);
            *beyond = (*beyond).max(time);
        }
    }
}

/// Presses of the stop switch when there is nothing more to go by: torque off at once.
const STOP_AT_ONCE: u64 = 2;

impl Witness for Control {
    fn see(&self, what: u8, _: u64) -> u64 {
        if self.verdict.is_over() && what == STOP_PRESSES {
            return STOP_AT_ONCE;
        }
        let changed = self.script().offer(|event| match event {
            Event::Seen(kind, value) if *kind == what => Some(*value),
            _ => None,
        });
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        let last = &mut seen[usize::from(what) % super::tap::SEEN_KINDS];
        *last = changed.unwrap_or(*last);
        *last
    }
}

/// The recorded samples.
struct ReplayFeed {
    until_s: f64,
    control: Arc<Control>,
    over: std::cell::Cell<bool>,
}

impl Feed for ReplayFeed {
    fn begin(&mut self, _: f64) {}

    fn take(&mut self, now_s: f64, out: &mut Vec<PoseSample>) {
        if now_s > self.until_s {
            self.control.verdict.stop();
            return;
        }
        let mut script = self.control.script();
        let sample = |event: &Event<'_>| match event {
            Event::Pose(bytes) => pose::read(bytes),
            _ => None,
        };
        while let Some(sample) = script.offer(sample) {
            out.push(sample);
        }
    }

    fn give_back(&mut self, used: &mut Vec<PoseSample>) {
        used.clear();
    }

    fn ended(&self) -> bool {
        let ends = |event: &Event<'_>| (*event == Event::Ended).then_some(());
        if !self.over.get() && self.control.script().offer(ends).is_some() {
            self.over.set(true);
        }
        self.over.get()
    }
}

/// Runs a recording again in this thread, until `until_s` after cycle 0 or its end; `each` sees every cycle.
/// Stops at the first difference.
///
/// # Errors
/// The character cannot be built, or the recording lacks logs of its buses.
pub fn replay(
    recorded: Recorded,
    until_s: Option<f64>,
    mut each: impl FnMut(&CycleRecord),
) -> Result<Replayed, ReplayError> {
    let mut character = recorded.character;
    let verdict = Arc::new(Verdict::default());
    let found = recorded.logs.len().saturating_sub(1);
    let mut scripts = recorded
        .logs
        .into_iter()
        .map(|(name, pieces)| Script::new(&name, pieces, &verdict));
    let Some(control) = scripts.next() else {
        return Err(ReplayError::Logs {
            found: 0,
            wanted: 1,
        });
    };
    let control = Arc::new(Control {
        script: Mutex::new(control),
        verdict: Arc::clone(&verdict),
        beyond: Mutex::new(Time::ZERO),
        seen: Mutex::default(),
    });
    // The simulated line is only a stand-in that `wrap` replaces: nothing real is opened.
    character.bus = BusAddress::Sim;
    let clock: Arc<dyn Clock> = Arc::clone(&control) as Arc<dyn Clock>;
    let mut wanted = 0;
    let mut wrap = |_: &str, port: Box<dyn Port>| -> Box<dyn Port> {
        wanted += 1;
        match scripts.next() {
            Some(script) => Box::new(ReplayPort::new(script)),
            None => port,
        }
    };
    let rate_hz = recorded.options.rate_hz;
    let wire = wire::open(&character, &character.bus, clock, rate_hz, &mut wrap)?;
    let mut bus = wire.bus;
    if wanted == 0 {
        wanted = 1;
        if let Some(script) = scripts.next() {
            bus = Box::new(TapBus::replaying(bus, script));
        }
    }
    if found < wanted {
        return Err(ReplayError::Logs { found, wanted });
    }
    let mut puppet = session::puppet(&character, &recorded.header, rate_hz)?;
    let mut feed = ReplayFeed {
        until_s: until_s.unwrap_or(f64::INFINITY),
        control: Arc::clone(&control),
        over: std::cell::Cell::new(false),
    };
    let stop = StopSwitch::new().witnessed(Arc::clone(&control) as Arc<dyn Witness>);
    let mut cycles = 0;
    let mut recorder = Inline::new(&puppet, |record| {
        // What is computed after the end of the log was never asked for.
        if !verdict.is_over() {
            cycles += 1;
            each(record);
        }
    });
    let mut start = Time::ZERO;
    let outcome = control::run(
        Parts {
            puppet: &mut puppet,
            bus: bus.as_mut(),
            feed: &mut feed,
            clock: control.as_ref(),
            stop: &stop,
            handover: None,
            recorder: &mut recorder,
            on_start: &mut |time| {
                control.see(super::tap::CYCLE_0, 0);
                start = time;
            },
        },
        &recorded.options,
    );
    drop(recorder);
    let (frames, bytes) = verdict.sent();
    let mut stats = outcome.stats;
    stats.cycles = cycles;
    Ok(Replayed {
        stats,
        frames,
        bytes,
        difference: verdict.difference().map(|difference| (difference, cycles)),
        ended: verdict.ended(),
        start,
    })
}
