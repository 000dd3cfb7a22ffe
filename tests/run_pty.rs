//! A run and its servos as two processes on a pseudo-terminal, in real time: the orderly end and the violent ones.

mod support;

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use support::folder::Folder;
use support::program::{Running, handwave, wait_for};
use support::simulator::Simulator;

const SOON: Duration = Duration::from_secs(30);

fn run_on(sim: &Simulator, more: &[&str]) -> Running {
    let args = ["run", "--headless", "--json", "--bus", &sim.bus];
    Running::start(&[&args[..], more].concat())
}

/// Plays a scenario, one at a time: two processes live in real time and need the machine.
///
/// On a machine that is busy otherwise a simulator in a process of its own may be starved for longer
/// than a driver can bear; then the scenario is played again, twice at most.
fn play(scenario: fn()) {
    static ALONE: Mutex<()> = Mutex::new(());
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    for attempt in 1..=2 {
        match std::panic::catch_unwind(scenario) {
            Ok(()) => return,
            Err(_) => println!("attempt {attempt} failed, see above"),
        }
    }
    scenario();
}

/// A run that has written `rows` rows of targets: only then is there something to interrupt.
///
/// The port has one client at a time, so this looks at what the run writes.
#[track_caller]
fn run_until(sim: &Simulator, folder: &Folder, rows: usize) -> Running {
    let mut run = run_on(sim, &["--targets", &folder.text("a.csv")]);
    let deadline = Instant::now() + SOON;
    while rows_in(folder) < rows {
        if run.has_ended() || Instant::now() > deadline {
            let ended = run.wait(Duration::ZERO);
            panic!("ended early, or too slow: {ended:#?}");
        }
        std::thread::park_timeout(Duration::from_millis(5));
    }
    run
}

fn rows_in(folder: &Folder) -> usize {
    std::fs::read_to_string(folder.path("a.csv")).map_or(0, |text| text.lines().count())
}

/// Torque of all servos, once the simulator serves the next client.
fn torque(sim: &Simulator) -> Vec<i64> {
    wait_for("the servos' torque", SOON, || {
        sim.registers("torque_enable")
    })
}

#[test]
fn a_short_run_through_a_separate_process() {
    play(|| {
        let sim = Simulator::start("1-12");
        let ended = run_on(&sim, &["--duration", "3"]).wait(SOON).expect(0);
        let s = ended.json();
        assert_eq!(s["torque_off"].as_array().map(Vec::len), Some(12), "{s}");
        let cycles = s["cycles"].as_f64().unwrap_or(0.0);
        assert!(cycles > 600.0, "{s}");
        println!(
            "{cycles} cycles, overruns {}, bus late {}, replies missing {}, bus cycle {}, step {}",
            s["overruns"],
            s["missed_cycles"],
            s["replies_missing"],
            s["bus_cycle_us"],
            s["step_us"]
        );
        assert_eq!(torque(&sim), [0; 12]);
    });
}

#[test]
fn a_servo_that_is_absent_is_named_with_its_joint() {
    play(|| {
        let sim = Simulator::start("1-11");
        let ended = run_on(&sim, &[]).wait(SOON).expect(3);
        for part in ["12", "rear_right_knee"] {
            assert!(ended.err.contains(part), "no {part} in: {}", ended.err);
        }
    });
}

#[test]
fn a_killed_simulator_ends_the_run_within_two_seconds() {
    play(|| {
        let mut sim = Simulator::start("1-12");
        let folder = Folder::empty();
        let run = run_until(&sim, &folder, 200);
        let killed = Instant::now();
        sim.process.kill();
        let ended = run.wait(SOON).expect(3);
        let took = killed.elapsed();
        println!("exit 3 after {took:?}: {}", ended.err.trim());
        assert!(took < Duration::from_secs(2), "exit 3 after {took:?}");
        assert!(ended.err.starts_with("handwave: "), "{}", ended.err);
        let port = sim.bus.trim_start_matches("dynamixel:").split('@').next();
        assert!(
            ended.err.contains(port.unwrap_or("servos")),
            "the message names no port: {}",
            ended.err
        );
    });
}

#[test]
fn one_interrupt_lies_down_and_two_do_not_wait_for_it() {
    play(|| {
        let mut took = Vec::new();
        for interrupts in [1, 2] {
            let sim = Simulator::start("1-12");
            let folder = Folder::empty();
            let run = run_until(&sim, &folder, 300);
            let began = Instant::now();
            run.interrupt();
            if interrupts == 2 {
                // Signals of a kind do not queue: the second is sent when the first has had its effect.
                let before = rows_in(&folder);
                wait_for("more targets", SOON, || {
                    (rows_in(&folder) > before).then_some(())
                });
                run.interrupt();
            }
            let ended = run.wait(SOON).expect(130);
            took.push(began.elapsed());
            let s = ended.json();
            assert_eq!(s["ending"], "interrupted", "{s}");
            assert_eq!(s["torque_off"].as_array().map(Vec::len), Some(12), "{s}");
            assert_eq!(torque(&sim), [0; 12], "{interrupts} interrupts");
        }
        println!(
            "one interrupt: ended after {:?}, two: after {:?}",
            took[0], took[1]
        );
        assert!(
            took[0] > Duration::from_millis(1500),
            "no lying down: {took:?}"
        );
        assert!(
            took[1] < Duration::from_millis(1000),
            "two interrupts waited: {took:?}"
        );
    });
}

#[test]
fn servos_stop_by_themselves_when_the_run_is_killed() {
    play(|| {
        let sim = Simulator::start("1-12");
        let folder = Folder::empty();
        let mut run = run_until(&sim, &folder, 300);
        run.kill();
        // The watchdog trips 200 ms after the last packet; looking at it earlier would feed it.
        let quiet = Instant::now();
        wait_for("200 ms without a packet", SOON, || {
            (quiet.elapsed() > Duration::from_millis(400)).then_some(())
        });
        let watchdogs = wait_for("the watchdogs", SOON, || sim.registers("bus_watchdog"));
        assert!(
            watchdogs.iter().all(|w| matches!(w, -1 | 255)),
            "{watchdogs:?}"
        );
    });
}

#[test]
fn the_port_is_free_again_after_each_end() {
    play(|| {
        let sim = Simulator::start("1-12");
        for _ in 0..2 {
            let args = ["bus", "scan", &sim.bus, "--json"];
            let ended = handwave(&args).expect(0);
            assert!(ended.out.contains("12"), "{}", ended.out);
        }
    });
}
