//! Processor time of a control cycle of twelve servos that answer at once, beside raw calls that move the same bytes.
//!
//! The servos are simulated on a pseudo-terminal by a thread of their own; only the time of the calling thread counts,
//! the kernel's work for it included. First both are measured in turn, so that a change of the machine's speed falls
//! on both, and the ratio is printed; then criterion measures each.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

use criterion::{Criterion, criterion_group, criterion_main};
use handwave::base::JointState;
use handwave::bus::ServoBus;
use handwave::bus::address::DynamixelBackend;
use handwave::bus::dynamixel::model::{STATE_BYTES, XL430_W250, address};
use handwave::bus::dynamixel::{
    self, ChainOptions, Client, DynamixelChain, Outcome, ServoSpec, Speaks,
};
use handwave::bus::port::bare;
use handwave::live::RealClock;
use handwave::live::clock::thread_cpu_time;
use handwave::sim::line::SharedLine;
use handwave::sim::{self, Line, LineOptions, PtyServer};
use handwave_dynamixel::instruction::{Instruction, SyncRead};
use handwave_dynamixel::{BROADCAST_ID, lists, wire};
use rustix::fs::{Mode, OFlags};
use std::io::{Read, Write};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

const SERVOS: u8 = 12;
const BAUD: u32 = 1_000_000;
const ROUNDS: usize = 41;
const CYCLES: u32 = 200;

/// Servos that answer at once, in a thread of their own.
struct Servos {
    link: PathBuf,
    stop: Option<UnixStream>,
    thread: Option<JoinHandle<()>>,
}

impl Servos {
    fn start(name: &str) -> Self {
        let options = LineOptions {
            paced: false,
            ..LineOptions::default()
        };
        let line = Line::commissioned(&sim::models::XL430_W250, 1..=SERVOS, BAUD, options);
        let line = SharedLine::new(line.expect("a known rate"));
        let link = std::env::temp_dir().join(format!("bus-bench-{}-{name}", std::process::id()));
        let clock = Arc::new(RealClock::new());
        let mut server = PtyServer::open(line, clock, &link, BAUD).expect("a pseudo-terminal");
        let (stop, stopped) = UnixStream::pair().expect("a socket pair");
        let thread = std::thread::spawn(move || {
            server.serve(stopped.as_fd()).expect("a server");
        });
        Self {
            link,
            stop: Some(stop),
            thread: Some(thread),
        }
    }

    fn path(&self) -> &str {
        self.link.to_str().expect("a plain path")
    }

    fn client(&self) -> Box<dyn Client> {
        let clock = Arc::new(RealClock::new());
        let backend = DynamixelBackend::Handwave;
        dynamixel::open(
            self.path(),
            BAUD,
            backend,
            Speaks::default(),
            clock,
            &mut bare,
        )
        .expect("the servos' port")
    }

    /// A chain with torque on.
    fn chain(&self) -> Chain {
        let specs = (1..=SERVOS).map(|id| ServoSpec::new(id, format!("joint{id}"), &XL430_W250));
        let options = ChainOptions {
            // Between two measurements nobody asks.
            watchdog: 0,
            ..ChainOptions::default()
        };
        let mut chain =
            DynamixelChain::new(self.client(), specs.collect(), options).expect("sensible servos");
        let mut states = vec![JointState::default(); usize::from(SERVOS)];
        chain.prepare(&mut states).expect("healthy servos");
        chain.arm().expect("healthy servos");
        let targets = states.iter().map(|state| state.position).collect();
        Chain {
            chain,
            targets,
            states,
        }
    }

    fn requests(&self) -> Requests {
        Requests {
            client: self.client(),
            ids: (1..=SERVOS).collect(),
            goals: goals().concat(),
            data: vec![0; usize::from(SERVOS) * STATE_BYTES],
            outcomes: vec![Outcome::NotReached; usize::from(SERVOS)],
        }
    }

    fn raw(&self) -> Raw {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
        let file = rustix::fs::open(&self.link, flags, Mode::empty()).expect("the servos' port");
        let mut buf = [0; 512];
        let items = (1..=SERVOS).zip(goals());
        let goals = lists::encode_sync_write(&mut buf, address::GOAL_POSITION, 4, items)
            .expect("room")
            .to_vec();
        let ids: Vec<u8> = (1..=SERVOS).collect();
        let request = Instruction::FastSyncRead(SyncRead {
            address: address::PRESENT_STATE,
            length: STATE_BYTES as u16,
            ids: &ids,
        });
        let request = request
            .encode(BROADCAST_ID, &mut buf)
            .expect("room")
            .to_vec();
        Raw {
            file: file.into(),
            goals,
            request,
        }
    }
}

impl Drop for Servos {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            thread.join().expect("a server that ended");
        }
    }
}

fn goals() -> [[u8; 4]; SERVOS as usize] {
    [2048i32.to_le_bytes(); SERVOS as usize]
}

/// The driver that ships: joint angles in, joint states out.
struct Chain {
    chain: DynamixelChain,
    targets: Vec<f64>,
    states: Vec<JointState>,
}

impl Chain {
    fn cycle(&mut self) {
        let report = self.chain.exchange(&self.targets, &mut self.states);
        assert_eq!(
            report.expect("a bus").fresh,
            u16::from(SERVOS),
            "servos answered"
        );
    }
}

/// The master below it: registers in, registers out.
struct Requests {
    client: Box<dyn Client>,
    ids: Vec<u8>,
    goals: Vec<u8>,
    data: Vec<u8>,
    outcomes: Vec<Outcome>,
}

impl Requests {
    fn cycle(&mut self, fast: bool) {
        let (client, ids) = (&mut self.client, &self.ids);
        client
            .sync_write(address::GOAL_POSITION, 4, ids, &self.goals)
            .expect("a bus");
        let (state, length) = (address::PRESENT_STATE, STATE_BYTES as u16);
        let (data, outcomes) = (&mut self.data, &mut self.outcomes);
        if fast {
            client.fast_sync_read(state, length, ids, data, outcomes)
        } else {
            client.sync_read(state, length, ids, data, outcomes)
        }
        .expect("a bus");
        let fresh = |outcome: &Outcome| matches!(outcome, Outcome::Fresh(_));
        assert!(self.outcomes.iter().all(fresh), "{:?}", self.outcomes);
    }
}

/// Two writes and as many reads as it takes, of bytes made beforehand.
struct Raw {
    file: std::fs::File,
    goals: Vec<u8>,
    request: Vec<u8>,
}

impl Raw {
    fn cycle(&mut self) {
        self.file.write_all(&self.goals).expect("a port");
        self.file.write_all(&self.request).expect("a port");
        let mut answer = [0; wire::fast_status(SERVOS as usize, STATE_BYTES)];
        self.file.read_exact(&mut answer).expect("an answer");
    }
}

/// Processor time of `count` cycles.
fn cpu_of(count: u64, mut cycle: impl FnMut()) -> Duration {
    let before = thread_cpu_time();
    for _ in 0..count {
        cycle();
    }
    thread_cpu_time() - before
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// All in turn, round by round; the medians, and the medians of the ratios to raw calls.
fn in_turn() {
    let servos: Vec<Servos> = ["a", "b", "c"]
        .iter()
        .map(|name| Servos::start(name))
        .collect();
    let mut raw = servos[0].raw();
    let mut chain = servos[1].chain();
    let mut requests = servos[2].requests();
    let mut rounds = Vec::new();
    for _ in 0..ROUNDS {
        let us = |span: Duration| span.as_secs_f64() * 1e6 / f64::from(CYCLES);
        let count = u64::from(CYCLES);
        rounds.push([
            us(cpu_of(count, || raw.cycle())),
            us(cpu_of(count, || chain.cycle())),
            us(cpu_of(count, || requests.cycle(true))),
            us(cpu_of(count, || requests.cycle(false))),
        ]);
    }
    println!("Processor time of a cycle of {SERVOS} servos, us, and times raw calls:");
    for (index, name) in ["raw calls", "chain", "requests, fast", "requests, ordinary"]
        .iter()
        .enumerate()
    {
        let us = median(rounds.iter().map(|round| round[index]).collect());
        let times = median(rounds.iter().map(|round| round[index] / round[0]).collect());
        println!("  {name:<20} {us:6.1}  {times:5.2}");
    }
}

fn cycle(criterion: &mut Criterion) {
    in_turn();
    let mut group = criterion.benchmark_group("processor_time_of_a_cycle_of_12");
    let servos = Servos::start("raw");
    let mut raw = servos.raw();
    group.bench_function("raw_calls", |b| {
        b.iter_custom(|count| cpu_of(count, || raw.cycle()));
    });
    let servos = Servos::start("chain");
    let mut chain = servos.chain();
    group.bench_function("chain", |b| {
        b.iter_custom(|count| cpu_of(count, || chain.cycle()));
    });
    group.finish();
}

criterion_group!(benches, cycle);
criterion_main!(benches);
