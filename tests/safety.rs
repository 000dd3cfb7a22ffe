//! What keeps people and robots whole: no jump at the start or after a pause, declared ends, torque off.

mod support;

use handwave::base::{Clock, JointState, VirtualClock};
use handwave::bus::port::bare;
use handwave::live::control::Ending;
use handwave::live::session::{self, Observer, Session};
use handwave::live::{CycleRecord, StopSwitch, source, wire};
use std::sync::Arc;
use std::time::Duration;
use support::character::{RATE_HZ, built_in};
use support::folder::Folder;
use support::program::{Running, run_virtual, wait_for};

#[test]
fn a_servo_that_latches_an_error_ends_the_run_lying_down_and_is_named() {
    let ended = run_virtual(&["--json", "--duration", "12", "--fault", "7:overload@8s"]).expect(4);
    assert!(
        ended.err.contains("rear_left_hip") && ended.err.contains("hardware error"),
        "{}",
        ended.err
    );
    let s = ended.json();
    assert_eq!(s["ending"], "safety stop", "{s}");
    assert_eq!(s["torque_off"].as_array().map(Vec::len), Some(12), "{s}");
    // Cycle 1600 is the fault; settling and lying down take some seconds, not the rest of the run.
    let cycles = s["cycles"].as_u64().expect("a count");
    assert!(
        (1600..2600).contains(&cycles),
        "ended after {cycles} cycles"
    );
}

#[test]
fn with_on_servo_fault_continue_the_others_play_on() {
    let folder = Folder::of_configs();
    folder.edit(
        "quadruped.toml",
        "on_servo_fault = \"stop\"",
        "on_servo_fault = \"continue\"",
    );
    let config = folder.text("quadruped.toml");
    let fault = ["--json", "--duration", "12", "--fault", "7:overload@8s"];
    let args = [&[config.as_str()][..], &fault].concat();
    let s = run_virtual(&args).expect(0).json();
    assert_eq!(s["ending"], "performance complete", "{s}");
    assert_eq!(s["faults"][0]["servo"], 7, "{s}");
}

#[test]
fn a_servo_whose_torque_is_not_read_back_is_no_success() {
    let ended = run_virtual(&["--duration", "10", "--fault", "7:silent@8s"]).expect(3);
    assert!(
        ended
            .err
            .contains("torque is not confirmed off: rear_left_hip"),
        "{}",
        ended.err
    );
}

#[test]
fn the_ramp_begins_where_the_servos_were_armed_not_where_they_were_first_seen() {
    let character = built_in();
    let clock = VirtualClock::new();
    let shared: Arc<dyn Clock> = Arc::new(clock.clone());
    let mut wire =
        wire::open(&character, &character.bus, shared, RATE_HZ, &mut bare).expect("a wire");
    let line = wire.line.clone().expect("simulated");
    let mut states = vec![JointState::default(); 12];
    wire.bus.prepare(&mut states).expect("a healthy chain");
    // Somebody pushes a limp thigh before its torque comes on.
    line.lock()
        .servo_mut(2)
        .expect("servo 2")
        .set_external_torque(0.3);
    clock.sleep_until(clock.now() + Duration::from_millis(150));
    {
        let mut line = line.lock();
        line.advance(clock.now());
        line.servo_mut(2).expect("servo 2").set_external_torque(0.0);
    }
    wire.bus.arm().expect("a healthy chain");
    let mut goals = [0.0; 12];
    wire.bus.goals(&mut goals);
    let moved = goals[1] - states[1].position;
    assert!(
        moved.abs() > 0.1,
        "the push moved the thigh by {moved} rad only"
    );
    wire.bus.exchange(&goals, &mut states).expect("a cycle");
    let jump = goals[1] - states[1].position;
    assert!(
        jump.abs() < 0.1,
        "goal and servo are {jump} rad apart after cycle 0"
    );
}

/// Lets the machine stand still once, in mid-walk.
struct Pause {
    clock: VirtualClock,
    seconds: f64,
    sent: Vec<Vec<f64>>,
}

impl Observer for Pause {
    fn cycle(&mut self, record: &CycleRecord) {
        if record.bus.bytes > 0 {
            self.sent.push(record.targets.clone());
        }
        if (record.t_s - 16.0).abs() < 1e-6 {
            self.clock
                .advance_to(self.clock.now() + Duration::from_secs_f64(self.seconds));
        }
    }
    fn tick(&mut self) {}
}

#[test]
fn after_a_pause_of_the_machine_no_goal_jumps() {
    let character = built_in();
    let fastest = character
        .limits
        .iter()
        .map(|l| l.velocity)
        .fold(0.0, f64::max);
    for seconds in [0.05, 0.15, 0.4, 3.0] {
        let clock = VirtualClock::new();
        let shared: Arc<dyn Clock> = Arc::new(clock.clone());
        let wire =
            wire::open(&character, &character.bus, shared, RATE_HZ, &mut bare).expect("a wire");
        let mut reader = source::open(&character.source, &character.files).expect("the poses");
        let first = source::first_sample(&mut reader).expect("a sample");
        let puppet = session::puppet(&character, reader.header(), RATE_HZ).expect("a puppet");
        let session = Session {
            puppet,
            bus: wire.bus,
            reader,
            first,
            live: None,
            reload: None,
            stop: StopSwitch::new(),
            options: session::control_options(&character, RATE_HZ, Some(18.0)),
            taps: None,
            on_start: Box::new(|_| {}),
        };
        let mut pause = Pause {
            clock: clock.clone(),
            seconds,
            sent: Vec::new(),
        };
        let report = session::run_virtual(session, &clock, &mut pause);
        assert!(
            matches!(report.ending, Ending::Complete),
            "{:?}",
            report.ending
        );
        assert!(
            report.stats.overruns > 0,
            "no pause of {seconds} s was seen"
        );
        let step = |pair: &[Vec<f64>]| {
            let ways = pair[0].iter().zip(&pair[1]).map(|(a, b)| (a - b).abs());
            ways.fold(0.0, f64::max)
        };
        let largest = pause.sent.windows(2).map(step).fold(0.0, f64::max);
        // At most 20 ms are caught up: five cycles at the joints' highest speed.
        let bound = 5.0 * fastest / RATE_HZ;
        assert!(
            largest <= bound,
            "pause {seconds} s: a goal moved by {largest} rad, bound {bound}"
        );
    }
}

#[test]
fn a_closed_terminal_ends_the_run_like_an_interrupt() {
    let folder = Folder::empty();
    let targets = folder.text("targets.csv");
    let run = Running::start(&["run", "--headless", "--json", "--targets", &targets]);
    wait_for("the first targets", Duration::from_secs(20), || {
        let text = std::fs::read_to_string(&targets).ok()?;
        (text.lines().count() > 100).then_some(())
    });
    run.signal(libc::SIGHUP);
    let s = run.wait(Duration::from_secs(20)).expect(130).json();
    assert_eq!(s["ending"], "interrupted", "{s}");
    assert_eq!(s["torque_off"].as_array().map(Vec::len), Some(12), "{s}");
}

#[test]
fn a_stream_without_a_good_sample_moves_nothing() {
    let folder = Folder::empty();
    let header = "t,palm.x,palm.y,palm.z,thumb_tip.x,thumb_tip.y,thumb_tip.z,index_tip.x,index_tip.y,index_tip.z,middle_tip.x,middle_tip.y,middle_tip.z,ring_tip.x,ring_tip.y,ring_tip.z,pinky_tip.x,pinky_tip.y,pinky_tip.z\n";
    let input = format!("file:{}", folder.write("empty.csv", header));
    let ended = run_virtual(&["--input", &input]).expect(2);
    assert!(ended.err.contains("no good sample"), "{}", ended.err);
    assert_eq!(ended.out, "", "a run was begun");
}

#[test]
fn a_wire_too_slow_for_the_rate_is_said_before_the_run() {
    let ended = run_virtual(&["--rate", "400", "--duration", "1"]).expect(0);
    // 12 servos at 1 Mbaud: 276 bytes of 10 us.
    assert!(
        ended.err.contains("need 2.8 ms") && ended.err.contains("at most 362 Hz"),
        "{}",
        ended.err
    );
    let fits = run_virtual(&["--duration", "1"]).expect(0);
    assert_eq!(fits.err, "", "a warning at 200 Hz");
}
