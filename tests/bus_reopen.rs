//! A port that goes and comes back, perhaps under another name, over pseudo-terminals in real time.

use handwave::base::{Clock, JointState};
use handwave::bus::address::DynamixelBackend;
use handwave::bus::dynamixel::model::Model;
use handwave::bus::dynamixel::{self, ChainOptions, DynamixelChain, ServoSpec, Speaks};
use handwave::bus::port::bare;
use handwave::bus::{BusError, ServoBus};
use handwave::live::RealClock;
use handwave::sim::line::SharedLine;
use handwave::sim::models::XL430_W250;
use handwave::sim::{Line, LineOptions, PtyServer};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// Real time is shared: one test at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// A line behind a pseudo-terminal; unplugged when dropped.
struct Plug {
    stop: Option<UnixStream>,
    thread: Option<JoinHandle<()>>,
}

impl Plug {
    fn in_at(line: &SharedLine, clock: &Arc<dyn Clock>, link: &Path) -> Self {
        let opened = PtyServer::open(line.clone(), Arc::clone(clock), link, 1_000_000);
        let mut server = opened.expect("a pseudo-terminal");
        let (stop, stopped) = UnixStream::pair().expect("a pair of sockets");
        let thread = std::thread::spawn(move || {
            server.serve(stopped.as_fd()).expect("served to the end");
        });
        Plug {
            stop: Some(stop),
            thread: Some(thread),
        }
    }
}

impl Drop for Plug {
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            thread.join().expect("the server did not panic");
        }
    }
}

struct Bench {
    clock: Arc<dyn Clock>,
    line: SharedLine,
    folder: tempfile::TempDir,
    plug: Option<Plug>,
    chain: DynamixelChain,
    states: [JointState; 3],
}

fn line(ids: impl IntoIterator<Item = u8>) -> SharedLine {
    let line = Line::commissioned(&XL430_W250, ids, 1_000_000, LineOptions::default());
    SharedLine::new(line.expect("a known rate"))
}

impl Bench {
    /// Three servos at `servos0`, armed and in motion.
    fn new() -> Self {
        let clock: Arc<dyn Clock> = Arc::new(RealClock::new());
        let folder = tempfile::tempdir().expect("a folder");
        let line = line(1..=3);
        let link = folder.path().join("servos0");
        let plug = Plug::in_at(&line, &clock, &link);
        let path = link.to_str().expect("a path in UTF-8");
        let backend = DynamixelBackend::Handwave;
        let client = dynamixel::open(
            path,
            1_000_000,
            backend,
            Speaks::default(),
            Arc::clone(&clock),
            &mut bare,
        );
        let model = Model::by_name("xl430-w250").expect("a known model");
        let specs = (1..=3).map(|id| ServoSpec::new(id, format!("joint{id}"), model));
        let options = ChainOptions {
            bus: format!("dynamixel:{path}@1000000"),
            ..ChainOptions::default()
        };
        let mut bench = Bench {
            chain: DynamixelChain::new(client.expect("the link opens"), specs.collect(), options)
                .expect("sensible specs"),
            clock,
            line,
            plug: Some(plug),
            states: Default::default(),
            folder,
        };
        bench
            .chain
            .prepare(&mut bench.states)
            .expect("a healthy chain");
        bench.chain.arm().expect("a healthy chain");
        for _ in 0..20 {
            bench.cycle(0.3).expect("a healthy chain");
        }
        bench
    }

    fn link(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn cycle(&mut self, target_rad: f64) -> Result<u16, BusError> {
        let next = self.clock.now() + std::time::Duration::from_millis(5);
        let report = self.chain.exchange(&[target_rad; 3], &mut self.states);
        self.clock.sleep_until(next);
        report.map(|report| report.fresh)
    }

    /// Pulls the plug and waits until the driver has noticed.
    fn unplug(&mut self) {
        self.plug = None;
        while self.cycle(0.3).is_ok() {}
    }

    fn goal(&self, id: u8) -> u32 {
        let mut line = self.line.lock();
        // Watchdogs that have run out meanwhile act when time moves on.
        line.advance(self.clock.now());
        line.servo(id).expect("a servo").register(116)
    }
}

#[test]
fn a_chain_is_found_under_another_name_and_nothing_moves_until_it_is_armed() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let mut bench = Bench::new();
    bench.unplug();
    let text = bench
        .chain
        .reopen()
        .expect_err("nothing is plugged in")
        .to_string();
    for part in ["is not back", "/servos* with servos 1,2,3", "there is none"] {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
    let plug = Plug::in_at(&bench.line, &bench.clock, &bench.link("servos1"));
    bench.plug = Some(plug);
    bench.chain.reopen().expect("it is back under another name");
    assert!(bench.chain.client().port_name().ends_with("servos1"));
    // Their watchdogs have stopped them where they were.
    let goals: Vec<u32> = (1..=3).map(|id| bench.goal(id)).collect();
    assert!(
        goals.iter().all(|goal| goal.abs_diff(2244) < 10),
        "{goals:?}"
    );
    let read: Vec<u16> = (0..20)
        .map(|_| bench.cycle(-0.5).expect("the port is there"))
        .collect();
    // A busy machine may lose an answer.
    let whole = read.iter().filter(|fresh| **fresh == 3).count();
    assert!(whole >= 10, "servos read in each cycle: {read:?}");
    let found: Vec<u32> = (1..=3).map(|id| bench.goal(id)).collect();
    assert_eq!(found, goals, "a goal was sent before it was armed again");
    bench
        .chain
        .prepare(&mut bench.states)
        .expect("a healthy chain");
    bench.chain.arm().expect("a healthy chain");
    let whole = (0..20).filter(|_| bench.cycle(0.0).is_ok_and(|fresh| fresh == 3));
    assert!(whole.count() >= 10, "it is not driven again");
}

#[test]
fn another_chain_is_not_taken_for_ours() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let mut bench = Bench::new();
    bench.unplug();
    // Servo 3 is missing; one too many; another program's port.
    let others = [line(1..=2), line(1..=4), line(1..=3)];
    let plugs: Vec<Plug> = (1..=3)
        .zip(&others)
        .map(|(number, other)| {
            Plug::in_at(other, &bench.clock, &bench.link(&format!("servos{number}")))
        })
        .collect();
    let taken = serialport::new(bench.link("servos3").display().to_string(), 1_000_000)
        .open_native()
        .expect("another program has it");
    let text = bench
        .chain
        .reopen()
        .expect_err("none of them is ours")
        .to_string();
    for part in [
        "servos1: servo 3 is not there",
        "servos2: all our servos answer, but also 4",
        "Another program has it open",
    ] {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
    for other in &others {
        let line = other.lock();
        let limp = line
            .labels()
            .all(|id| line.servo(id).is_some_and(|s| !s.torque_enabled()));
        assert!(limp, "torque came on in a chain that is not ours");
    }
    drop(taken);
    drop(plugs);
    // Only the right one is.
    let plug = Plug::in_at(&bench.line, &bench.clock, &bench.link("servos0"));
    bench.chain.reopen().expect("it is back under its own name");
    drop(plug);
}
