//! Feeds: pose samples at the time they are due, on the control clock.

use crate::pose::{FaultCounts, PoseError, PoseReader, PoseSample};
use rtrb::{Consumer, Producer, RingBuffer};
use std::io::BufRead;
use std::thread::JoinHandle;
use std::time::Duration;

/// Gives the control loop its pose samples. Called once per cycle: must not block or allocate.
pub trait Feed {
    /// The stream's first sample is due at `at_s` on the control clock.
    fn begin(&mut self, at_s: f64);
    /// Appends the samples due by `now_s` to `out`, with `t` on the control clock.
    fn take(&mut self, now_s: f64, out: &mut Vec<PoseSample>);
    /// Takes used samples back for re-use.
    fn give_back(&mut self, used: &mut Vec<PoseSample>);
    /// The stream is over and all its samples were taken.
    fn ended(&self) -> bool;
}

/// Maps the stream's time to the control clock.
#[derive(Copy, Clone, Debug)]
enum Schedule {
    /// A recording begins when it is told to and keeps its own time.
    Recorded {
        begins_at_s: Option<f64>,
        first_t: Option<f64>,
    },
    /// A live source's samples are due on arrival.
    Live(SenderClock),
}

impl Schedule {
    fn recorded() -> Self {
        Self::Recorded {
            begins_at_s: None,
            first_t: None,
        }
    }

    fn begin(&mut self, at_s: f64) {
        if let Self::Recorded { begins_at_s, .. } = self {
            *begins_at_s = Some(at_s);
        }
    }

    /// The sample with its time on the control clock if it is due by `now_s`; else itself.
    fn release(&mut self, mut sample: PoseSample, now_s: f64) -> Result<PoseSample, PoseSample> {
        let Self::Recorded {
            begins_at_s,
            first_t,
        } = self
        else {
            return Ok(sample);
        };
        let Some(begins) = *begins_at_s else {
            return Err(sample);
        };
        let first = *first_t.get_or_insert(sample.t);
        let due = begins + (sample.t - first);
        if due > now_s {
            return Err(sample);
        }
        sample.t = due;
        Ok(sample)
    }

    /// What arrived together by `now_s`, brought to the control clock.
    fn arrived(&mut self, now_s: f64, samples: &mut [PoseSample]) {
        if let Self::Live(clock) = self {
            clock.map(now_s, samples);
        }
    }
}

/// A sender's clock against ours, known only by when its samples arrive.
///
/// Samples arrive late by different times, never early: the smallest difference seen between arrival and
/// stamp is the best. It may rise by a millisecond per second, so that clocks of different speed and a way
/// that became longer are followed. Stamps that run backwards are another sender (or the same one started
/// again) and begin anew.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct SenderClock {
    offset_s: Option<f64>,
    last_t: f64,
    last_now_s: f64,
}

/// How fast the offset to a sender's clock may rise, seconds per second.
const OFFSET_RISE: f64 = 1e-3;

impl SenderClock {
    /// Puts samples that arrived together by `now_s`, in their order, on our clock.
    ///
    /// Their times are then at most `now_s`. Allocates nothing.
    pub fn map(&mut self, now_s: f64, samples: &mut [PoseSample]) {
        if samples.is_empty() {
            return;
        }
        if let Some(offset) = &mut self.offset_s {
            *offset += OFFSET_RISE * (now_s - self.last_now_s).max(0.0);
        }
        self.last_now_s = now_s;
        let mut from = 0;
        while from < samples.len() {
            if self.offset_s.is_some() && samples[from].t <= self.last_t {
                self.offset_s = None;
            }
            // The last of those whose stamps rise was on its way for the shortest time.
            let mut to = from + 1;
            while to < samples.len() && samples[to].t > samples[to - 1].t {
                to += 1;
            }
            self.last_t = samples[to - 1].t;
            let seen = now_s - self.last_t;
            let offset = self.offset_s.map_or(seen, |known| known.min(seen));
            self.offset_s = Some(offset);
            for sample in &mut samples[from..to] {
                sample.t = (sample.t + offset).min(now_s);
            }
            from = to;
        }
    }
}

/// Reads a recording in the caller's thread: for virtual time.
pub struct ReaderFeed<R> {
    reader: PoseReader<R>,
    schedule: Schedule,
    next: Option<PoseSample>,
    spare: Vec<PoseSample>,
    over: bool,
    error: Option<PoseError>,
}

impl<R: BufRead> ReaderFeed<R> {
    /// A feed of `first`, then of what is left in `reader`.
    pub fn new(reader: PoseReader<R>, first: PoseSample) -> Self {
        Self {
            reader,
            schedule: Schedule::recorded(),
            next: Some(first),
            spare: Vec::new(),
            over: false,
            error: None,
        }
    }

    /// Samples dropped by reason, and the error that ended the stream, if one did.
    pub fn finish(self) -> (FaultCounts, Option<PoseError>) {
        (*self.reader.counts(), self.error)
    }

    fn fetch(&mut self) {
        if self.next.is_some() || self.over {
            return;
        }
        let mut sample = self.spare.pop().unwrap_or_default();
        match self.reader.read_into(&mut sample) {
            Ok(true) => self.next = Some(sample),
            Ok(false) => self.over = true,
            Err(error) => {
                self.over = true;
                self.error = Some(error);
            }
        }
    }
}

impl<R: BufRead> Feed for ReaderFeed<R> {
    fn begin(&mut self, at_s: f64) {
        self.schedule.begin(at_s);
    }

    fn take(&mut self, now_s: f64, out: &mut Vec<PoseSample>) {
        loop {
            self.fetch();
            let Some(sample) = self.next.take() else {
                return;
            };
            match self.schedule.release(sample, now_s) {
                Ok(sample) => out.push(sample),
                Err(sample) => {
                    self.next = Some(sample);
                    return;
                }
            }
        }
    }

    fn give_back(&mut self, used: &mut Vec<PoseSample>) {
        self.spare.append(used);
    }

    fn ended(&self) -> bool {
        self.over && self.next.is_none()
    }
}

/// What travels from the reading thread to the control thread.
enum Item {
    Sample(PoseSample),
    End,
}

/// The control thread's end of a recording that another thread reads ahead.
pub struct QueueFeed {
    items: Consumer<Item>,
    used: Producer<PoseSample>,
    schedule: Schedule,
    next: Option<PoseSample>,
    over: bool,
}

/// The reading thread; ends when the stream does or the feed is dropped.
pub type ReaderThread = JoinHandle<(FaultCounts, Option<PoseError>)>;

/// Samples read ahead.
const AHEAD: usize = 512;

/// Gives `first`, then what is left in `reader`, which a thread of its own reads ahead. The samples of a
/// `live` source are due on arrival, others by their stamps.
pub fn read_ahead<R: BufRead + Send + 'static>(
    mut reader: PoseReader<R>,
    first: PoseSample,
    live: bool,
) -> std::io::Result<(QueueFeed, ReaderThread)> {
    let (mut items_in, items_out) = RingBuffer::new(AHEAD);
    let (used_in, mut used_out) = RingBuffer::<PoseSample>::new(AHEAD);
    let thread = std::thread::Builder::new()
        .name("poses".into())
        .spawn(move || {
            let mut error = None;
            loop {
                let mut sample = used_out.pop().unwrap_or_default();
                let item = match reader.read_into(&mut sample) {
                    Ok(true) => Item::Sample(sample),
                    Ok(false) => Item::End,
                    Err(e) => {
                        error = Some(e);
                        Item::End
                    }
                };
                let end = matches!(item, Item::End);
                let mut waiting = Some(item);
                while let Some(item) = waiting.take() {
                    if items_in.is_abandoned() {
                        return (*reader.counts(), error);
                    }
                    if let Err(rtrb::PushError::Full(item)) = items_in.push(item) {
                        waiting = Some(item);
                        std::thread::sleep(Duration::from_millis(5));
                    }
                }
                if end {
                    return (*reader.counts(), error);
                }
            }
        })?;
    Ok((
        QueueFeed {
            items: items_out,
            used: used_in,
            schedule: if live {
                Schedule::Live(SenderClock::default())
            } else {
                Schedule::recorded()
            },
            next: Some(first),
            over: false,
        },
        thread,
    ))
}

impl QueueFeed {
    /// Appends what is due, as much as `out` has room for without growing.
    fn take_due(&mut self, now_s: f64, out: &mut Vec<PoseSample>) {
        loop {
            if self.next.is_none() && !self.over {
                match self.items.pop() {
                    Ok(Item::Sample(sample)) => self.next = Some(sample),
                    Ok(Item::End) => self.over = true,
                    Err(_) => {}
                }
            }
            // `out` has room for what one cycle can bring; the rest waits for the next cycle.
            if out.len() == out.capacity() {
                return;
            }
            let Some(sample) = self.next.take() else {
                return;
            };
            match self.schedule.release(sample, now_s) {
                Ok(sample) => out.push(sample),
                Err(sample) => {
                    self.next = Some(sample);
                    return;
                }
            }
        }
    }
}

impl Feed for QueueFeed {
    fn begin(&mut self, at_s: f64) {
        self.schedule.begin(at_s);
    }

    fn take(&mut self, now_s: f64, out: &mut Vec<PoseSample>) {
        let before = out.len();
        self.take_due(now_s, out);
        self.schedule.arrived(now_s, &mut out[before..]);
    }

    fn give_back(&mut self, used: &mut Vec<PoseSample>) {
        for sample in used.drain(..) {
            // Never full: it has as many places as there are samples under way.
            let _ = self.used.push(sample);
        }
    }

    fn ended(&self) -> bool {
        self.over && self.next.is_none()
    }
}
