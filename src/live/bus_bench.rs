//! Bus bench: the control cycle over and over, to see what the wire, the adapter and this machine can do.
//!
//! A cycle is that of [`DynamixelChain`](crate::bus::dynamixel::DynamixelChain): one sync write of all goals, one
//! read of all states. It needs no configuration and moves nothing: see [`servos`] for what is written.

pub mod servos;

use super::stats::{Microseconds, Percentiles};
use crate::base::Time;
use crate::bus::dynamixel::{Client, ClientError, Outcome};
use handwave_dynamixel::wire;
pub use servos::{Bench, BenchServo, Found, InspectError};
use std::time::Duration;

/// A servo that was silent in so many cycles in a row is left out.
const SILENT_CYCLES: u32 = 3;
/// How often one that is left out is asked again.
const RETRY_EVERY: Duration = Duration::from_millis(250);
/// Without a period: an answer that comes later than this counts as lost. Until then the cycle is a long one.
const LATEST: Duration = Duration::from_millis(20);

/// Which instruction reads the states.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Reads {
    /// Fast sync read: one combined status.
    Fast,
    /// Sync read: one status per servo.
    Ordinary,
}

impl Reads {
    /// For messages.
    pub const fn as_str(self) -> &'static str {
        match self {
            Reads::Fast => "fast",
            Reads::Ordinary => "ordinary",
        }
    }
}

/// How to measure.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct BenchOptions {
    /// Which reads; see [`Bench::reads`] for the choice of the driver.
    pub reads: Reads,
    /// For how long.
    pub span: Duration,
    /// Time from the beginning of one cycle to that of the next; `None`: as fast as the wire allows.
    pub period: Option<Duration>,
}

/// What went wrong, counted per servo and cycle.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Errors {
    /// It was asked and nothing came.
    pub silent: u64,
    /// Its answer was damaged.
    pub damaged: u64,
    /// It answered with an error.
    pub refused: u64,
    /// The read ended before its turn, because of another servo.
    pub not_reached: u64,
}

impl Errors {
    /// All of them.
    pub fn total(&self) -> u64 {
        self.silent + self.damaged + self.refused + self.not_reached
    }

    fn count(&mut self, outcome: Outcome) {
        match outcome {
            Outcome::Fresh(_) => {}
            Outcome::Silent => self.silent += 1,
            Outcome::Damaged => self.damaged += 1,
            Outcome::Refused(_) => self.refused += 1,
            Outcome::NotReached => self.not_reached += 1,
        }
    }

    fn add(&mut self, other: &Errors) {
        self.silent += other.silent;
        self.damaged += other.damaged;
        self.refused += other.refused;
        self.not_reached += other.not_reached;
    }
}

/// What one servo did.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub struct ServoCount {
    /// Its id.
    pub id: u8,
    /// Cycles in which its state was read.
    pub fresh: u64,
    /// Answers with the alert flag: a hardware error is latched.
    pub alerts: u64,
    /// Cycles in which it was left out, because it had been silent.
    pub left_out: u64,
    /// What went wrong.
    pub errors: Errors,
}

/// What was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct BenchReport {
    /// Which reads.
    pub reads: Reads,
    /// Cycles done.
    pub cycles: u64,
    /// How long they took, waits between them included.
    pub span: Duration,
    /// Time of a cycle from its first byte handed out to its last reply, microseconds.
    pub cycle_us: Percentiles,
    /// Processor time of this thread per cycle, microseconds.
    pub cpu_us: f64,
    /// Paced: cycles that began late because the one before had not ended.
    pub late: u64,
    /// Received bytes and frames that were of no use: noise, echoes of others, wrong checksums.
    pub noise: u64,
    /// The least that a cycle takes on the wire (protocols.md 2): byte times and return delays.
    pub wire: Duration,
    /// Per servo, in the order asked.
    pub servos: Vec<ServoCount>,
    /// Somebody asked for a stop before the time was over.
    pub interrupted: bool,
}

impl BenchReport {
    /// Cycles per second reached.
    pub fn cycles_per_s(&self) -> f64 {
        self.cycles as f64 / self.span.as_secs_f64().max(f64::MIN_POSITIVE)
    }

    /// Cycles per second that the wire allows at most.
    pub fn wire_limit_hz(&self) -> f64 {
        1.0 / self.wire.as_secs_f64().max(f64::MIN_POSITIVE)
    }

    /// What went wrong with all servos.
    pub fn errors(&self) -> Errors {
        let mut all = Errors::default();
        for servo in &self.servos {
            all.add(&servo.errors);
        }
        all
    }
}

/// The least time of a cycle at `baud` bits per second: `T_sync` or `T_fast` of protocols.md 2, without turnaround.
///
/// `written` and `read` are numbers of servos, `write_len` and `read_len` the data bytes of each; `return_delay` is
/// paid once by a fast read and once a servo by an ordinary one.
pub fn wire_time(
    reads: Reads,
    baud: u32,
    (written, write_len): (usize, usize),
    (read, read_len): (usize, usize),
    return_delay: Duration,
) -> Duration {
    let goals = match written {
        0 => 0,
        _ => wire::sync_write(written, write_len),
    };
    let (answer, delays) = match reads {
        Reads::Fast => (wire::fast_status(read, read_len), 1),
        Reads::Ordinary => (read * wire::status(read_len), read),
    };
    let bytes = goals + wire::sync_read(read) + answer;
    wire::duration(bytes, baud) + return_delay * u32::try_from(delays).unwrap_or(u32::MAX)
}

/// The servos of the present cycle, and buffers, made once.
struct Cycle {
    asked: Vec<u8>,
    places: Vec<usize>,
    data: Vec<u8>,
    outcomes: Vec<Outcome>,
    driven: Vec<u8>,
    goals: Vec<u8>,
    silence: Vec<Silence>,
}

/// How long a servo has been silent.
#[derive(Copy, Clone, Debug, Default)]
struct Silence {
    /// Cycles in a row in which it was asked in vain.
    cycles: u32,
    /// When it was asked last.
    asked_at: Time,
}

impl Silence {
    fn leaves_out(&self, now: Time) -> bool {
        self.cycles >= SILENT_CYCLES && now.saturating_since(self.asked_at) < RETRY_EVERY
    }
}

impl Cycle {
    fn new(bench: &Bench) -> Self {
        let count = bench.servos.len();
        Self {
            asked: Vec::with_capacity(count),
            places: Vec::with_capacity(count),
            data: vec![0; count * bench.layout.state_len],
            outcomes: vec![Outcome::NotReached; count],
            driven: Vec::with_capacity(count),
            goals: Vec::with_capacity(count * bench.layout.goal_len),
            silence: vec![Silence::default(); count],
        }
    }
}

impl Bench {
    /// Runs cycles for `options.span`, or until `stop` says so.
    ///
    /// `wait` sleeps on the clock of the client's port, `cpu_time` is the processor time that this thread has used so far.
    /// Silent servos and damage are counted; only a lost port is an error.
    pub fn run(
        &mut self,
        client: &mut dyn Client,
        options: &BenchOptions,
        wait: &dyn Fn(Duration),
        cpu_time: &dyn Fn() -> Duration,
        stop: &dyn Fn() -> bool,
    ) -> Result<BenchReport, ClientError> {
        client.set_return_delay(self.return_delay);
        let driven = self.servos.iter().filter(|s| s.goal.is_some()).count();
        let limit = wire_time(
            options.reads,
            client.baud(),
            (driven, self.layout.goal_len),
            (self.servos.len(), self.layout.state_len),
            self.return_delay,
        );
        let mut cycle = Cycle::new(self);
        let mut counts: Vec<ServoCount> = self.servos.iter().map(ServoCount::of).collect();
        let mut times = Microseconds::default();
        let (mut cycles, mut late) = (0, 0);
        let noise = client.traffic().damaged;
        let cpu = cpu_time();
        let begin = client.now();
        let mut due = begin;
        let mut interrupted = false;
        while client.now().saturating_since(begin) < options.span {
            interrupted = stop();
            if interrupted {
                break;
            }
            if let Some(period) = options.period {
                if cycles > 0 && client.now() > due {
                    late += 1;
                    due = client.now();
                }
                wait(due.saturating_since(client.now()));
                due = due + period;
            }
            let started = client.now();
            let end = started + options.period.unwrap_or(limit + LATEST);
            client.set_cycle_end(Some(end));
            self.cycle(client, options.reads, &mut cycle, &mut counts)?;
            let took = client.now().saturating_since(started);
            times.add(u64::try_from(took.as_micros()).unwrap_or(u64::MAX));
            cycles += 1;
            if cycle.asked.is_empty() {
                // Nobody is left to wait for.
                wait(RETRY_EVERY / 10);
            }
        }
        let span = client.now().saturating_since(begin);
        let cpu = cpu_time().saturating_sub(cpu);
        client.set_cycle_end(None);
        Ok(BenchReport {
            reads: options.reads,
            cycles,
            span,
            cycle_us: times.percentiles(),
            cpu_us: cpu.as_secs_f64() * 1e6 / (cycles.max(1) as f64),
            late,
            noise: client.traffic().damaged.saturating_sub(noise),
            wire: limit,
            servos: counts,
            interrupted,
        })
    }

    fn cycle(
        &mut self,
        client: &mut dyn Client,
        reads: Reads,
        cycle: &mut Cycle,
        counts: &mut [ServoCount],
    ) -> Result<(), ClientError> {
        let (layout, now) = (self.layout, client.now());
        cycle.driven.clear();
        cycle.goals.clear();
        cycle.asked.clear();
        cycle.places.clear();
        for (place, servo) in self.servos.iter().enumerate() {
            if let Some(goal) = &servo.goal {
                cycle.driven.push(servo.id);
                cycle.goals.extend_from_slice(&goal[..layout.goal_len]);
            }
            if cycle.silence[place].leaves_out(now) {
                counts[place].left_out += 1;
            } else {
                cycle.asked.push(servo.id);
                cycle.places.push(place);
            }
        }
        if !cycle.driven.is_empty() {
            let length = layout.goal_len as u16;
            client.sync_write(layout.goal, length, &cycle.driven, &cycle.goals)?;
        }
        let count = cycle.asked.len();
        let data = &mut cycle.data[..count * layout.state_len];
        let outcomes = &mut cycle.outcomes[..count];
        let length = layout.state_len as u16;
        match reads {
            Reads::Fast => {
                client.fast_sync_read(layout.state, length, &cycle.asked, data, outcomes)?;
            }
            Reads::Ordinary => {
                client.sync_read(layout.state, length, &cycle.asked, data, outcomes)?;
            }
        }
        let answers = data.chunks_exact(layout.state_len).zip(&*outcomes);
        for ((bytes, &outcome), &place) in answers.zip(&cycle.places) {
            counts[place].errors.count(outcome);
            let silence = &mut cycle.silence[place];
            silence.asked_at = now;
            silence.cycles = match outcome {
                Outcome::Silent => silence.cycles + 1,
                // Its turn did not come: nothing is known.
                Outcome::NotReached => silence.cycles,
                _ => 0,
            };
            if let Outcome::Fresh(reply) = outcome {
                counts[place].fresh += 1;
                counts[place].alerts += u64::from(reply.alert);
                self.servos[place].follow(&bytes[layout.position_at..]);
            }
        }
        Ok(())
    }
}

impl ServoCount {
    fn of(servo: &BenchServo) -> Self {
        Self {
            id: servo.id,
            ..Self::default()
        }
    }
}
