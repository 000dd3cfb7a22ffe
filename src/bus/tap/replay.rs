//! The other way round: a port that answers as a log says, and notices what is asked or sent differently.

use super::event::{Event, Events};
use super::trace::describe;
use crate::base::Time;
use crate::bus::{Port, PortError};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Where a replay parts from its recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// Whose log: `control`, or the bus.
    pub log: String,
    /// The log's time there.
    pub at: Time,
    /// What the recording has.
    pub recorded: String,
    /// What the replay did.
    pub replayed: String,
}

/// What the parts of a replay have found out together.
#[derive(Debug, Default)]
pub struct Verdict {
    over: AtomicBool,
    frames: AtomicU64,
    bytes: AtomicU64,
    first: Mutex<Option<Difference>>,
    ended: Mutex<Option<String>>,
}

impl Verdict {
    /// Nothing goes on: a log came to its end, or a difference was found.
    pub fn is_over(&self) -> bool {
        self.over.load(Ordering::SeqCst)
    }

    /// The first difference, if there was one.
    pub fn difference(&self) -> Option<Difference> {
        self.first
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Why the replay could not go on to the end of the run; `None` when it did.
    pub fn ended(&self) -> Option<String> {
        self.ended
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Frames sent and bytes in them, as recorded.
    pub fn sent(&self) -> (u64, u64) {
        (
            self.frames.load(Ordering::Relaxed),
            self.bytes.load(Ordering::Relaxed),
        )
    }

    /// Ends the replay, though the logs go on.
    pub fn stop(&self) {
        self.over.store(true, Ordering::SeqCst);
    }

    fn differ(&self, difference: Difference) {
        let mut first = self.first.lock().unwrap_or_else(PoisonError::into_inner);
        // What follows the end or a difference is no news.
        if !self.over.swap(true, Ordering::SeqCst) {
            *first = Some(difference);
        }
    }

    fn end(&self, why: String) {
        let mut ended = self.ended.lock().unwrap_or_else(PoisonError::into_inner);
        if !self.over.swap(true, Ordering::SeqCst) {
            *ended = Some(why);
        }
    }
}

/// The events of one log, handed out one by one.
#[derive(Debug)]
pub struct Script {
    name: String,
    segments: VecDeque<(Time, Vec<u8>)>,
    /// Place in the first segment, and the time there.
    at: usize,
    time: Time,
    verdict: Arc<Verdict>,
}

impl Script {
    /// The log `name` in pieces, each with the time that its first entry follows.
    pub fn new(name: &str, segments: Vec<(Time, Vec<u8>)>, verdict: &Arc<Verdict>) -> Self {
        let segments: VecDeque<_> = segments.into();
        Self {
            name: name.into(),
            time: segments.front().map_or(Time::ZERO, |(base, _)| *base),
            segments,
            at: 0,
            verdict: Arc::clone(verdict),
        }
    }

    /// Whose log it is.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The time of the last event handed out that had one.
    pub fn time(&self) -> Time {
        self.time
    }

    /// What it has found out together with the others.
    pub fn verdict(&self) -> &Arc<Verdict> {
        &self.verdict
    }

    /// Shows the next event to `take`; where that gives something, the event is used up. `None` at the end.
    pub fn offer<T>(&mut self, take: impl FnOnce(&Event<'_>) -> Option<T>) -> Option<T> {
        while self
            .segments
            .front()
            .is_some_and(|(_, bytes)| bytes.len() == self.at)
        {
            self.segments.pop_front();
            self.at = 0;
            if let Some((base, _)) = self.segments.front() {
                self.time = *base;
            }
        }
        let (_, bytes) = self.segments.front()?;
        let mut events = Events::new(bytes.get(self.at..)?, self.time);
        let event = events.next()?;
        let taken = take(&event)?;
        self.at = bytes.len() - events.remaining();
        self.time = events.time();
        Some(taken)
    }

    /// The next event must be what `take` accepts; if not, it is the end of the log, a gap, or a difference to
    /// what the program `does`.
    pub fn expect<T>(
        &mut self,
        does: impl FnOnce() -> String,
        take: impl FnOnce(&Event<'_>) -> Option<T>,
    ) -> Option<T> {
        if self.verdict.is_over() {
            return None;
        }
        if let Some(taken) = self.offer(take) {
            return Some(taken);
        }
        let seen = self.offer(|event| {
            Some(match event {
                Event::Gap(count) => Err(*count),
                other => Ok(describe(other)),
            })
        });
        let name = &self.name;
        match seen {
            None => self.verdict.end(format!("the log of {name} ends here")),
            Some(Err(count)) => self.verdict.end(format!(
                "{count} entries of the log of {name} are missing here: the disk was too slow for the recorder"
            )),
            Some(Ok(recorded)) => self.verdict.differ(Difference {
                log: self.name.clone(),
                at: self.time,
                recorded,
                replayed: does(),
            }),
        }
        None
    }

    /// Notes a difference that the next event is not to blame for.
    pub fn differ(&self, recorded: String, replayed: String) {
        self.verdict.differ(Difference {
            log: self.name.clone(),
            at: self.time,
            recorded,
            replayed,
        });
    }
}

/// Answers as a port did, and compares what is sent.
#[derive(Debug)]
pub struct ReplayPort {
    name: String,
    baud: u32,
    latency: Duration,
    script: Mutex<Script>,
}

impl ReplayPort {
    /// A port that goes by `script`, which begins with the port's opening.
    pub fn new(mut script: Script) -> Self {
        let open = script.expect(
            || "opening the port".into(),
            |event| match event {
                Event::Open(name, baud, latency) => {
                    Some((String::from_utf8_lossy(name).into_owned(), *baud, *latency))
                }
                _ => None,
            },
        );
        let (name, baud, latency) = open.unwrap_or_default();
        Self {
            name,
            baud,
            latency,
            script: Mutex::new(script),
        }
    }

    fn expect<T>(
        &self,
        does: impl FnOnce() -> String,
        take: impl FnOnce(&Event<'_>) -> Option<T>,
    ) -> Option<T> {
        let mut script = self.script.lock().unwrap_or_else(PoisonError::into_inner);
        script.expect(does, take)
    }

    fn gone(&self) -> PortError {
        PortError::Gone {
            port: self.name.clone(),
            reason: "the recording goes no further".into(),
        }
    }

    /// The answer to a call: what `take` makes of the event, or the failure that was recorded.
    fn answer<T>(
        &self,
        does: impl FnOnce() -> String,
        take: impl FnOnce(&Event<'_>) -> Option<T>,
    ) -> Result<T, PortError> {
        let outcome = self.expect(does, |event| match event {
            Event::Fault(fault) => Some(Err(fault.error(&self.name))),
            other => take(other).map(Ok),
        });
        outcome.unwrap_or_else(|| Err(self.gone()))
    }
}

impl Port for ReplayPort {
    fn name(&self) -> &str {
        &self.name
    }

    fn baud(&self) -> u32 {
        self.baud
    }

    fn latency_timer(&self) -> Option<Duration> {
        (self.latency > Duration::ZERO).then_some(self.latency)
    }

    fn set_baud(&mut self, baud: u32) -> Result<(), PortError> {
        self.answer(
            || format!("setting {baud} baud"),
            |event| (*event == Event::Baud(baud)).then_some(()),
        )?;
        self.baud = baud;
        Ok(())
    }

    fn now(&self) -> Time {
        let now = self.expect(
            || "a look at the clock".into(),
            |event| match event {
                Event::Now(time) => Some(*time),
                _ => None,
            },
        );
        now.unwrap_or_else(|| {
            let script = self.script.lock().unwrap_or_else(PoisonError::into_inner);
            script.time()
        })
    }

    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let same = self.expect(
            || describe(&Event::Write(Time::ZERO, bytes)),
            |event| match event {
                Event::Write(_, recorded) => (*recorded == bytes).then_some(()),
                _ => None,
            },
        );
        same.ok_or_else(|| self.gone())?;
        let mut script = self.script.lock().unwrap_or_else(PoisonError::into_inner);
        let failed = script.offer(|event| match event {
            Event::Fault(fault) => Some(fault.error(&self.name)),
            _ => None,
        });
        let verdict = script.verdict();
        verdict.frames.fetch_add(1, Ordering::Relaxed);
        verdict
            .bytes
            .fetch_add(bytes.len() as u64, Ordering::Relaxed);
        failed.map_or(Ok(()), Err)
    }

    fn read(&mut self, buf: &mut [u8], want: usize, _: Time) -> Result<usize, PortError> {
        let room = buf.len();
        self.answer(
            || format!("waiting for {want} bytes"),
            |event| match event {
                Event::Read(_, bytes) if bytes.len() <= room => {
                    buf[..bytes.len()].copy_from_slice(bytes);
                    Some(bytes.len())
                }
                _ => None,
            },
        )
    }

    fn discard_input(&mut self) -> Result<(), PortError> {
        self.answer(
            || "discarding input".into(),
            |event| (*event == Event::Discard).then_some(()),
        )
    }
}
