//! Does the recording: takes the logs away, hands them with the messages to file and ring; at the end says what is where.

use super::channel::Channel;
use super::file::{About, McapFile, Piece};
use super::ring::Ring;
use super::telemetry::Telemetry;
use crate::base::Time;
use crate::bus::tap::Events;
use crate::config::Character;
use crate::live::CycleRecord;
use crate::live::clock::{calendar, unix_now};
use crate::live::recording::Taps;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::thread::JoinHandle;
use std::time::Duration;

/// What is to be kept of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The whole run, in this file.
    pub file: Option<PathBuf>,
    /// The latest past in memory: the folder that it is written to when something went wrong, and how many
    /// bytes of logs are kept.
    pub ring: Option<(PathBuf, usize)>,
    /// Messages a second of gestures, graph, joints and bus.
    pub telemetry_hz: f64,
}

/// What became of it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Kept {
    /// Files written, and what they are.
    pub files: Vec<(PathBuf, String)>,
    /// What went wrong.
    pub problems: Vec<String>,
    /// Entries of logs and messages lost because the disk was too slow.
    pub lost: u64,
}

/// The logs are taken this often.
const EVERY: Duration = Duration::from_millis(20);
/// In virtual time they are taken after so many cycles.
const CYCLES: u64 = 8;
/// Messages under way to the thread: seconds of them.
const UNDER_WAY: usize = 4096;
/// After a fault the run is recorded on for so long before the ring is written.
const AFTER_S: f64 = 5.0;
/// Faults in a run that are written to files of their own.
const DUMPS: u32 = 3;

enum Order {
    Say(Channel, f64, String),
    Dump(String),
}

/// Told every cycle of a run.
pub struct Recorder {
    telemetry: Telemetry,
    work: Work,
    lost: u64,
    cycles: u64,
    /// Joints that have had a fault.
    fallen: u64,
    /// When the ring is written, and why.
    pending: Option<(f64, String)>,
}

enum Work {
    Inline(Box<Keeper>),
    Thread(SyncSender<Order>, JoinHandle<Keeper>),
}

/// Holds the file and the ring.
struct Keeper {
    taps: Taps,
    about: About,
    bases: Vec<Time>,
    buffer: Vec<u8>,
    file: Option<(PathBuf, McapFile)>,
    ring: Option<(PathBuf, Ring)>,
    dumps: u32,
    kept: Kept,
}

impl Recorder {
    /// Begins to record as `plan` says; `own_thread` in real time.
    ///
    /// # Errors
    /// The file cannot be created, in words for the user.
    pub fn start(
        plan: &Plan,
        character: &Character,
        about: About,
        taps: Taps,
        own_thread: bool,
    ) -> Result<Self, String> {
        let file = match &plan.file {
            None => None,
            Some(path) => {
                let file = McapFile::create(path, &about, true);
                let file = file.map_err(|e| {
                    format!(
                        "{}: cannot be written: {e}; choose another place for --record",
                        path.display()
                    )
                })?;
                Some((path.clone(), file))
            }
        };
        let mut keeper = Keeper {
            bases: vec![Time::ZERO; about.logs.len()],
            taps,
            about,
            buffer: Vec::new(),
            file,
            ring: (plan.ring.clone()).map(|(folder, bytes)| (folder, Ring::new(bytes))),
            dumps: 0,
            kept: Kept::default(),
        };
        let work = if own_thread {
            let (orders, received) = mpsc::sync_channel(UNDER_WAY);
            let thread = std::thread::Builder::new().name("recorder".into());
            let thread = thread.spawn(move || {
                keeper.work(&received);
                keeper
            });
            Work::Thread(
                orders,
                thread.map_err(|e| format!("cannot start a thread for the recording: {e}"))?,
            )
        } else {
            Work::Inline(Box::new(keeper))
        };
        Ok(Self {
            telemetry: Telemetry::new(character, plan.telemetry_hz),
            work,
            lost: 0,
            cycles: 0,
            fallen: 0,
            pending: None,
        })
    }

    /// Sees every cycle, in order. Never waits.
    pub fn see(&mut self, record: &CycleRecord) {
        if let Work::Inline(keeper) = &mut self.work
            && self.cycles.is_multiple_of(CYCLES)
        {
            keeper.pump();
        }
        self.cycles += 1;
        let (work, lost) = (&mut self.work, &mut self.lost);
        let t_s = record.t_s;
        self.telemetry
            .see(record, |channel, text| match &mut *work {
                Work::Inline(keeper) => keeper.message(channel, t_s, text),
                Work::Thread(orders, _) => {
                    let sent = orders.try_send(Order::Say(channel, t_s, text));
                    *lost += u64::from(sent.is_err());
                }
            });
        let down = record.bus.alert_mask | record.bus.torqueless_mask;
        if down & !self.fallen != 0 && self.pending.is_none() {
            self.pending = Some((t_s + AFTER_S, format!("a servo fell out at {t_s:.3} s")));
        }
        self.fallen |= down;
        if self.pending.as_ref().is_some_and(|(at_s, _)| t_s >= *at_s)
            && let Some((_, why)) = self.pending.take()
        {
            self.dump(why);
        }
    }

    /// The gestures are others now.
    pub fn rename_gestures(&mut self, names: &[String]) {
        self.telemetry.rename_gestures(names);
    }

    /// Writes what the ring holds, because of `why`: for whoever notices that something went wrong.
    pub fn dump(&mut self, why: String) {
        match &mut self.work {
            Work::Inline(keeper) => keeper.dump(&why),
            Work::Thread(orders, _) => {
                let sent = orders.try_send(Order::Dump(why));
                self.lost += u64::from(sent.is_err());
            }
        }
    }

    /// Ends the recording; the ring is written first where the run ended badly, for the reason given.
    pub fn finish(mut self, bad_end: Option<String>) -> Kept {
        let why = bad_end.or(self.pending.take().map(|(_, why)| why));
        let mut keeper = match self.work {
            Work::Inline(keeper) => *keeper,
            Work::Thread(orders, thread) => {
                drop(orders);
                match thread.join() {
                    Ok(keeper) => keeper,
                    Err(_) => {
                        return Kept {
                            problems: vec!["the recorder failed; its message is above".into()],
                            ..Kept::default()
                        };
                    }
                }
            }
        };
        keeper.pump();
        if let Some(why) = why {
            keeper.dump(&why);
        }
        keeper.close(self.lost)
    }
}

impl Keeper {
    /// The thread's work, until the other end is gone.
    fn work(&mut self, orders: &Receiver<Order>) {
        let mut flushes = 0u32;
        loop {
            let first = orders.recv_timeout(EVERY);
            let over = matches!(first, Err(RecvTimeoutError::Disconnected));
            // The logs first: the time of cycle 0 is in them.
            self.pump();
            for order in first.into_iter().chain(orders.try_iter()) {
                match order {
                    Order::Say(channel, t_s, text) => self.message(channel, t_s, text),
                    Order::Dump(why) => self.dump(&why),
                }
            }
            if let Some((_, file)) = &mut self.file
                && file.flush_if_due()
            {
                flushes += 1;
                if flushes.is_multiple_of(2) {
                    file.sync();
                }
            }
            if over {
                return;
            }
        }
    }

    /// Takes what was logged since the last time.
    fn pump(&mut self) {
        let Self {
            taps,
            bases,
            buffer,
            file,
            ring,
            ..
        } = self;
        taps.take(buffer, |log, bytes| {
            let Some(base) = bases.get_mut(log) else {
                return;
            };
            let mut events = Events::new(bytes, *base);
            while events.next().is_some() {}
            let piece = Piece {
                log,
                base: *base,
                end: events.time(),
                bytes: bytes.to_vec(),
            };
            *base = piece.end;
            if let Some((_, file)) = file {
                file.piece(&piece, true);
            }
            if let Some((_, ring)) = ring {
                ring.piece(piece);
            }
        });
    }

    fn message(&mut self, channel: Channel, t_s: f64, text: String) {
        if !self.about.channels.contains(&channel) {
            return;
        }
        if let Some((_, file)) = &mut self.file {
            file.message(channel, t_s, &text);
            file.flush_if_due();
        }
        if let Some((_, ring)) = &mut self.ring {
            ring.message(channel, t_s, text);
        }
    }

    fn dump(&mut self, why: &str) {
        let Some((folder, ring)) = &self.ring else {
            return;
        };
        if self.dumps == DUMPS {
            return;
        }
        self.dumps += 1;
        let path = free_name(folder);
        match ring.dump(&path, &self.about) {
            Ok(whole) => {
                let what = if whole {
                    format!("{why}; the run so far")
                } else {
                    format!("{why}; its last part, to be looked at: the beginning did not fit")
                };
                self.kept.files.push((path, what));
            }
            Err(error) => self.kept.problems.push(format!(
                "{}: the recording of the fault cannot be written: {error}",
                path.display()
            )),
        }
    }

    fn close(mut self, lost: u64) -> Kept {
        self.kept.lost = lost + self.taps.lost();
        if let Some((path, file)) = self.file.take() {
            match file.finish() {
                Ok(()) => self.kept.files.push((path, "the whole run".into())),
                Err(error) => self.kept.problems.push(format!(
                    "{}: cannot be written: {error}; what is before is kept",
                    path.display()
                )),
            }
        }
        self.kept
    }
}

/// A name in `folder` that is not taken.
fn free_name(folder: &Path) -> PathBuf {
    let time = calendar(unix_now());
    let name = |more: &str| folder.join(format!("handwave-fault-{time}{more}.mcap"));
    let mut path = name("");
    for number in 2..100 {
        if !path.exists() {
            break;
        }
        path = name(&format!("-{number}"));
    }
    path
}
