//! Taps on what the control thread asks: clock, poses, stop requests; and on the ports as they are opened.

use super::pose;
use crate::base::{Clock, Time};
use crate::bus::tap::{Event, Log, TapPort};
use crate::bus::{Port, ServoBus};
use crate::live::control::{self, ControlOptions, Outcome, Parts};
use crate::live::feed::Feed;
use crate::live::stop::Witness;
use crate::pose::PoseSample;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Memory of the control thread's log, and of each port's: at 12 servos and 200 Hz about a minute.
const CONTROL_BYTES: usize = 2 << 20;
const PORT_BYTES: usize = 4 << 20;
/// Values that others set while a run goes on and that the control thread has to see again in a replay.
pub const SEEN_KINDS: usize = 16;

/// The kind of value that the time of cycle 0 is, nanoseconds on the bus clock.
pub const CYCLE_0: u8 = 2;

/// Runs the control loop, with taps on all that it asks where there are some.
pub fn run(taps: Option<&Taps>, parts: Parts<'_>, options: &ControlOptions) -> Outcome {
    let Some(taps) = taps else {
        return control::run(parts, options);
    };
    let clock = taps.clock(parts.clock);
    let mut feed = taps.feed(parts.feed);
    let stop = parts.stop.witnessed(taps.witness());
    let on_start = parts.on_start;
    let parts = Parts {
        puppet: parts.puppet,
        bus: parts.bus,
        feed: &mut feed,
        clock: &clock,
        stop: &stop,
        handover: parts.handover,
        recorder: parts.recorder,
        on_start: &mut |start| {
            taps.control.see(CYCLE_0, start.nanos() as u64);
            on_start(start);
        },
    };
    control::run(parts, options)
}

/// The logs of a run.
#[derive(Clone, Debug)]
pub struct Taps {
    control: Arc<Control>,
    ports: Vec<Arc<Log>>,
    port_bytes: usize,
}

/// The control thread's log and what stood in it last.
#[derive(Debug)]
struct Control {
    log: Log,
    seen: [AtomicU64; SEEN_KINDS],
}

impl Default for Taps {
    fn default() -> Self {
        Self::new(CONTROL_BYTES, PORT_BYTES)
    }
}

impl Taps {
    /// Logs with room for so many bytes that nobody has taken yet: the control thread's, and each port's.
    pub fn new(control_bytes: usize, port_bytes: usize) -> Self {
        Self {
            control: Arc::new(Control {
                log: Log::new("control", control_bytes),
                seen: [const { AtomicU64::new(0) }; SEEN_KINDS],
            }),
            ports: Vec::new(),
            port_bytes,
        }
    }

    /// A tap on a port of bus `name`, for [`crate::bus::port::WrapPort`].
    pub fn wrap(&mut self, name: &str, port: Box<dyn Port>) -> Box<dyn Port> {
        let log = Arc::new(Log::new(name, self.port_bytes));
        self.ports.push(Arc::clone(&log));
        Box::new(TapPort::new(port, log))
    }

    /// A bus without ports (an avatar) that logs its targets; another as it is.
    pub fn wrap_bus(&mut self, bus: Box<dyn ServoBus>) -> Box<dyn ServoBus> {
        if !self.ports.is_empty() {
            return bus;
        }
        let log = Arc::new(Log::new("avatar", self.port_bytes));
        self.ports.push(Arc::clone(&log));
        Box::new(super::avatar::TapBus::new(bus, log))
    }

    /// Names of the logs: `control`, then the buses in the order in which their ports were opened.
    pub fn names(&self) -> Vec<String> {
        self.logs().map(|log| log.name().to_owned()).collect()
    }

    fn logs(&self) -> impl Iterator<Item = &Log> {
        let control = std::iter::once(&self.control.log);
        control.chain(self.ports.iter().map(Arc::as_ref))
    }

    /// Takes what has been logged since the last time: calls `each` with the log's index and new bytes.
    pub fn take(&self, buffer: &mut Vec<u8>, mut each: impl FnMut(usize, &[u8])) {
        for (index, log) in self.logs().enumerate() {
            buffer.clear();
            log.take(buffer);
            if !buffer.is_empty() {
                each(index, buffer);
            }
        }
    }

    /// Entries lost so far because they were not taken in time.
    pub fn lost(&self) -> u64 {
        self.logs().map(Log::lost).sum()
    }

    /// What the control thread sees of requests from outside, for [`crate::live::StopSwitch::witnessed`].
    pub fn witness(&self) -> Arc<dyn Witness> {
        Arc::clone(&self.control) as Arc<dyn Witness>
    }

    /// The control thread's clock.
    pub fn clock<'a>(&'a self, clock: &'a dyn Clock) -> TapClock<'a> {
        TapClock { clock, taps: self }
    }

    /// The control thread's poses.
    pub fn feed<'a>(&'a self, feed: &'a mut dyn Feed) -> TapFeed<'a> {
        TapFeed {
            feed,
            taps: self,
            over: std::cell::Cell::new(false),
        }
    }

    fn note(&self, event: Event<'_>) {
        self.control.log.write(|entry| event.write(entry));
    }
}

impl Witness for Control {
    fn see(&self, what: u8, value: u64) -> u64 {
        let last = &self.seen[usize::from(what) % SEEN_KINDS];
        if last.swap(value, Ordering::Relaxed) != value {
            self.log
                .write(|entry| Event::Seen(what, value).write(entry));
        }
        value
    }
}

/// A clock that logs what it says.
pub struct TapClock<'a> {
    clock: &'a dyn Clock,
    taps: &'a Taps,
}

impl Clock for TapClock<'_> {
    fn now(&self) -> Time {
        let now = self.clock.now();
        self.taps.note(Event::Now(now));
        now
    }

    fn sleep_until(&self, time: Time) {
        self.clock.sleep_until(time);
    }
}

/// A feed that logs its samples.
pub struct TapFeed<'a> {
    feed: &'a mut dyn Feed,
    taps: &'a Taps,
    over: std::cell::Cell<bool>,
}

impl Feed for TapFeed<'_> {
    fn begin(&mut self, at_s: f64) {
        self.feed.begin(at_s);
    }

    fn take(&mut self, now_s: f64, out: &mut Vec<PoseSample>) {
        let before = out.len();
        self.feed.take(now_s, out);
        for sample in &out[before..] {
            self.taps
                .control
                .log
                .write(|entry| pose::write(sample, entry));
        }
    }

    fn give_back(&mut self, used: &mut Vec<PoseSample>) {
        self.feed.give_back(used);
    }

    fn ended(&self) -> bool {
        let ended = self.feed.ended();
        if ended && !self.over.replace(true) {
            self.taps.note(Event::Ended);
        }
        ended
    }
}
