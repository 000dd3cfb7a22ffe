//! New gestures while a run goes on: built outside the control thread, handed over without lock or allocation.
//!
//! The control loop owns a [`Handover`], whoever builds gestures the [`Loader`] at the other end. The loop
//! sends copies of its samples, in boxes that come back to be filled again; the loader replays the last five
//! seconds of them into new gestures before it hands these over, so that what is being performed goes on with
//! its estimate. The loop makes up for the samples under way in between and sends the old gestures back, to be
//! freed where freeing may take its time.

use crate::config::GestureFiles;
use crate::pose::{PoseHeader, PoseSample};
use crate::puppet::{Gestures, Puppet};
use rtrb::{Consumer, Producer, RingBuffer};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Duration;

/// What new gestures are shown of the past, seconds: the longest history of an estimator.
const PAST_S: f64 = 5.0;
/// Samples under way to the loader.
const UNDER_WAY: usize = 256;
/// Samples the loop keeps for what was under way while gestures came over.
const RECENT: usize = 32;
/// Room for channels that turn up while the stream goes on.
const CHANNELS: usize = 64;
/// The files are looked at this often.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// History is taken this often, so that its queue does not fill.
const LISTEN_EVERY: Duration = Duration::from_millis(20);

/// The control loop's end.
pub struct Handover {
    fresh: Consumer<Box<Gestures>>,
    old: Producer<Box<Gestures>>,
    history: Producer<PoseSample>,
    spare: Consumer<PoseSample>,
    recent: Vec<PoseSample>,
    newest: usize,
    swaps: u64,
    /// Bits of the performer's measured scale; not a number before.
    scale: Arc<AtomicU64>,
}

/// The other end.
pub struct Loader {
    fresh: Producer<Box<Gestures>>,
    old: Consumer<Box<Gestures>>,
    history: Consumer<PoseSample>,
    spare: Producer<PoseSample>,
    past: VecDeque<PoseSample>,
    under_way: bool,
    scale: Arc<AtomicU64>,
}

/// Both ends, for a stream with `header`.
pub fn handover(header: &PoseHeader) -> (Handover, Loader) {
    let blank = || {
        let points = header.points.len();
        PoseSample {
            t: f64::NEG_INFINITY,
            points: Vec::with_capacity(points),
            confidence: Vec::with_capacity(points),
            channels: Vec::with_capacity(CHANNELS.max(header.channels.len())),
        }
    };
    let (fresh_in, fresh_out) = RingBuffer::new(1);
    let (old_in, old_out) = RingBuffer::new(1);
    let (history_in, history_out) = RingBuffer::new(UNDER_WAY);
    let (mut spare_in, spare_out) = RingBuffer::new(UNDER_WAY);
    while spare_in.push(blank()).is_ok() {}
    let scale = Arc::new(AtomicU64::new(f64::NAN.to_bits()));
    let ours = Handover {
        scale: Arc::clone(&scale),
        fresh: fresh_out,
        old: old_in,
        history: history_in,
        spare: spare_out,
        recent: (0..RECENT).map(|_| blank()).collect(),
        newest: 0,
        swaps: 0,
    };
    let theirs = Loader {
        scale,
        fresh: fresh_in,
        old: old_out,
        history: history_out,
        spare: spare_in,
        past: VecDeque::new(),
        under_way: false,
    };
    (ours, theirs)
}

/// Copies without allocation where `into` has room.
fn copy(from: &PoseSample, into: &mut PoseSample) {
    into.t = from.t;
    into.points.clone_from(&from.points);
    into.confidence.clone_from(&from.confidence);
    into.channels.clone_from(&from.channels);
}

impl Handover {
    /// Once per cycle, before the puppet is given `samples`: swaps gestures that have come over, and sends the
    /// samples. Takes no lock, allocates and frees nothing.
    pub fn cycle(&mut self, puppet: &mut Puppet, samples: &[PoseSample]) {
        // With room for the old ones, which must not be freed here.
        if !self.old.is_full()
            && let Ok(mut gestures) = self.fresh.pop()
        {
            for k in 1..=RECENT {
                let sample = &self.recent[(self.newest + k) % RECENT];
                if sample.t.is_finite() {
                    // Those that were replayed already are refused as not later than the last.
                    let _ = gestures.front.push(sample);
                }
            }
            self.swaps += u64::from(puppet.swap_gestures(&mut gestures));
            let _ = self.old.push(gestures);
        }
        let scale = puppet.front().performer_scale().unwrap_or(f64::NAN);
        self.scale.store(scale.to_bits(), Ordering::Relaxed);
        for sample in samples {
            self.newest = (self.newest + 1) % RECENT;
            copy(sample, &mut self.recent[self.newest]);
            // A loader that does not listen loses the past, never the present.
            if let Ok(mut spare) = self.spare.pop() {
                copy(sample, &mut spare);
                let _ = self.history.push(spare);
            }
        }
    }

    /// How often gestures were swapped.
    pub fn swaps(&self) -> u64 {
        self.swaps
    }
}

impl Loader {
    /// Takes what the loop has sent; true when gestures offered before have been taken over.
    pub fn listen(&mut self) -> bool {
        while let Ok(sample) = self.history.pop() {
            let mut kept = self
                .past
                .front()
                .is_some_and(|oldest| sample.t - oldest.t > PAST_S);
            let mut place = if kept {
                self.past.pop_front().unwrap_or_default()
            } else {
                PoseSample::default()
            };
            copy(&sample, &mut place);
            let newest = place.t;
            self.past.push_back(place);
            while kept {
                kept = self
                    .past
                    .front()
                    .is_some_and(|oldest| newest - oldest.t > PAST_S);
                if kept {
                    self.past.pop_front();
                }
            }
            let _ = self.spare.push(sample);
        }
        let back = self.old.pop().is_ok();
        self.under_way &= !back;
        back
    }

    /// The performer's scale as the puppet reads it; `None` before it is known.
    pub fn performer_scale(&self) -> Option<f64> {
        let scale = f64::from_bits(self.scale.load(Ordering::Relaxed));
        scale.is_finite().then_some(scale)
    }

    /// Whether gestures offered before are still under way.
    pub fn is_busy(&self) -> bool {
        self.under_way
    }

    /// Shows `gestures` the past and hands them over. While others are under way they come back.
    ///
    /// # Errors
    /// The gestures themselves, when others are still under way.
    pub fn offer(&mut self, mut gestures: Box<Gestures>) -> Result<(), Box<Gestures>> {
        if self.under_way {
            return Err(gestures);
        }
        let mut after = f64::NEG_INFINITY;
        // Again for what came in the meantime: the first pass may take a while.
        for _ in 0..3 {
            self.listen();
            for sample in self.past.iter().filter(|s| s.t > after) {
                let _ = gestures.front.push(sample);
            }
            after = self.past.back().map_or(after, |s| s.t);
        }
        match self.fresh.push(gestures) {
            Ok(()) => {
                self.under_way = true;
                Ok(())
            }
            Err(rtrb::PushError::Full(gestures)) => Err(gestures),
        }
    }
}

/// What became of changed gesture files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum News {
    /// The puppet goes by new gestures, with these names in the order of the estimates.
    Gestures(Vec<String>),
    /// The old ones stay, for this reason.
    Kept(String),
}

impl std::fmt::Display for News {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            News::Gestures(names) => write!(f, "gestures reloaded: {}", names.join(", ")),
            News::Kept(why) => write!(f, "the gestures stay as they were: {why}"),
        }
    }
}

/// Watches gesture files on a thread of its own until dropped.
pub struct Watcher {
    over: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
    news: mpsc::Receiver<News>,
}

impl Watcher {
    /// Starts to watch. Changed files are read, checked and offered to `loader`.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(
        mut files: GestureFiles,
        header: PoseHeader,
        mut loader: Loader,
    ) -> std::io::Result<Self> {
        let over = Arc::new(AtomicBool::new(false));
        let (tell, news) = mpsc::channel();
        let ends = Arc::clone(&over);
        let thread = std::thread::Builder::new()
            .name("gestures".into())
            .spawn(move || {
                let mut waiting: Option<Box<Gestures>> = None;
                let mut until_look = Duration::ZERO;
                while !ends.load(Ordering::Relaxed) {
                    if loader.listen() {
                        let _ = tell.send(News::Gestures(files.names().to_vec()));
                    }
                    if let Some(gestures) = waiting.take() {
                        waiting = loader.offer(gestures).err();
                    } else if until_look.is_zero() && !loader.is_busy() {
                        until_look = LOOK_EVERY;
                        match files.reload(&header, loader.performer_scale()) {
                            Ok(new) => {
                                waiting = new.map(|new| {
                                    Box::new(Gestures::new(new.front, new.gesture_of_class))
                                });
                            }
                            Err(why) => {
                                let _ = tell.send(News::Kept(why));
                            }
                        }
                        continue;
                    }
                    std::thread::sleep(LISTEN_EVERY);
                    until_look = until_look.saturating_sub(LISTEN_EVERY);
                }
            })?;
        Ok(Self {
            over,
            thread: Some(thread),
            news,
        })
    }

    /// The next piece of news, if there is one.
    pub fn news(&self) -> Option<News> {
        self.news.try_recv().ok()
    }
}

impl Drop for Watcher {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // It cannot fail but by a panic, whose message is printed already.
            let _ = thread.join();
        }
    }
}
