//! The whole way in real time: `handwave bus` and the driver on a pseudo-terminal, `handwave sim` behind it.

use handwave::base::{Clock, JointState};
use handwave::bus::address::DynamixelBackend;
use handwave::bus::dynamixel::model::Model;
use handwave::bus::dynamixel::{self, ChainOptions, DynamixelChain, ServoSpec, Speaks};
use handwave::bus::port::bare;
use handwave::bus::{BusError, ServoBus};
use handwave::live::RealClock;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// A running `handwave sim dynamixel`.
struct Simulator {
    child: Child,
    link: PathBuf,
    _dir: TempDir,
}

impl Simulator {
    fn start(servos: &str) -> Self {
        let dir = TempDir::new().expect("a temporary directory");
        let link = dir.path().join("servos");
        let mut child = Command::new(env!("CARGO_BIN_EXE_handwave"))
            .args(["sim", "dynamixel", "--servos", servos, "--link"])
            .arg(&link)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the simulator starts");
        let stdout = child.stdout.take().expect("its output is piped");
        let mut line = String::new();
        BufReader::new(stdout)
            .read_line(&mut line)
            .expect("it says when it is ready");
        assert!(line.starts_with("ready "), "the simulator says '{line}'");
        Simulator {
            child,
            link,
            _dir: dir,
        }
    }

    fn path(&self) -> &str {
        self.link.to_str().expect("a path in UTF-8")
    }

    /// Runs `handwave bus VERB BUS ARGS`.
    fn bus(&self, verb: &str, args: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_handwave"))
            .args(["bus", verb, &format!("dynamixel:{}", self.path())])
            .args(args)
            .output()
            .expect("the command runs")
    }

    fn chain(&self, servos: u8, backend: DynamixelBackend) -> (DynamixelChain, RealClock) {
        let clock = RealClock::new();
        let client = dynamixel::open(
            self.path(),
            1_000_000,
            backend,
            Speaks::default(),
            Arc::new(clock.clone()),
            &mut bare,
        )
        .expect("the port opens");
        let model = Model::by_name("xl430-w250").expect("a known model");
        let specs = (1..=servos)
            .map(|id| ServoSpec::new(id, format!("joint{id}"), model))
            .collect();
        let chain = DynamixelChain::new(client, specs, ChainOptions::default());
        (chain.expect("sensible specs"), clock)
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        // It may be dead already, which is what is wanted.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn commands_look_at_and_change_servos() {
    let simulator = Simulator::start("1-3,20");
    let scan = simulator.bus("scan", &["--json"]);
    assert_eq!(scan.status.code(), Some(0), "{}", stderr(&scan));
    let ids: Vec<u64> = stdout(&scan)
        .lines()
        .map(|line| serde_json::from_str(line).expect("one JSON object a line"))
        .filter_map(|row: serde_json::Value| row["id"].as_u64())
        .collect();
    assert_eq!(ids, [1, 2, 3, 20]);

    let read = simulator.bus("read", &["20", "present_position"]);
    assert!(stdout(&read).contains("2048"), "{}", stdout(&read));
    let write = simulator.bus("write", &["1-3", "torque_enable", "1"]);
    assert_eq!(write.status.code(), Some(0), "{}", stderr(&write));
    let locked = simulator.bus("write", &["2", "return_delay_time", "10"]);
    assert_eq!(locked.status.code(), Some(3));
    assert!(
        stderr(&locked).contains("servo 2 has its torque on"),
        "{}",
        stderr(&locked)
    );
    let reboot = simulator.bus("reboot", &["2"]);
    assert_eq!(reboot.status.code(), Some(0), "{}", stderr(&reboot));
    // It boots for a while; every unanswered question waits by itself.
    let deadline = Instant::now() + Duration::from_secs(5);
    let torque = loop {
        let torque = simulator.bus("read", &["2", "torque_enable", "--json"]);
        if torque.status.success() || Instant::now() > deadline {
            break torque;
        }
    };
    assert!(
        stdout(&torque).contains("\"value\":0"),
        "{}",
        stdout(&torque)
    );

    for (verb, args, code) in [
        ("ping", &["9"][..], 3),
        ("ping", &["253"], 2),
        ("read", &["1", "colour"], 2),
        ("read", &["1-", "torque_enable"], 2),
        ("write", &["1", "model_number", "5"], 2),
        ("write", &["1", "torque_enable", "2"], 2),
        ("scan", &["--ids", "9"], 3),
        ("scan", &["--baud", "fast"], 2),
    ] {
        let output = simulator.bus(verb, args);
        assert_eq!(
            output.status.code(),
            Some(code),
            "{verb} {args:?}: {}",
            stderr(&output)
        );
        assert!(!output.stderr.is_empty(), "{verb} {args:?} says nothing");
    }
}

/// Half a second of control at 200 Hz; the share of fresh states.
fn drive(chain: &mut DynamixelChain, clock: &RealClock, servos: u8) -> f64 {
    let mut states = vec![JointState::default(); usize::from(servos)];
    chain.prepare(&mut states).expect("a healthy chain");
    chain.arm().expect("a healthy chain");
    let targets = vec![0.0; usize::from(servos)];
    let mut fresh = 0u32;
    let mut next = clock.now();
    for _ in 0..100 {
        next = next + Duration::from_millis(5);
        clock.sleep_until(next);
        fresh += u32::from(
            chain
                .exchange(&targets, &mut states)
                .expect("the bus is there")
                .fresh,
        );
    }
    let report = chain.torque_off().expect("the port works");
    assert_eq!(
        report.confirmed_off.len(),
        usize::from(servos),
        "{report:?}"
    );
    f64::from(fresh) / (100.0 * f64::from(servos))
}

#[test]
fn a_chain_runs_in_real_time_and_its_end_is_told_at_once() {
    let mut simulator = Simulator::start("1-12");
    let (mut chain, clock) = simulator.chain(12, DynamixelBackend::Handwave);
    let share = drive(&mut chain, &clock, 12);
    // A busy machine may stall either end for longer than a servo is waited for.
    assert!(
        share > 0.5,
        "only {:.1} % of the states were fresh",
        100.0 * share
    );

    simulator.child.kill().expect("the simulator ends");
    simulator.child.wait().expect("the simulator ends");
    let begin = Instant::now();
    let mut states = vec![JointState::default(); 12];
    let error = loop {
        if let Err(error) = chain.exchange(&[0.0; 12], &mut states) {
            break error;
        }
    };
    let told = begin.elapsed();
    assert!(matches!(error, BusError::Port(_)), "{error}");
    assert!(told < Duration::from_millis(500), "told after {told:?}");
}

#[cfg(feature = "dxl-serial2")]
#[test]
fn the_dynamixel2_crate_drives_the_same_chain() {
    let simulator = Simulator::start("1-4");
    let (mut chain, clock) = simulator.chain(4, DynamixelBackend::Dynamixel2);
    let share = drive(&mut chain, &clock, 4);
    assert!(
        share > 0.5,
        "only {:.1} % of the states were fresh",
        100.0 * share
    );
}
