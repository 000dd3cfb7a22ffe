//! Several buses as one: the same motion as over one, in virtual time to the byte; one that fails leaves the
//! others driven; the configuration and the command line name them.

mod support;

use handwave::base::{Clock, JointState, VirtualClock};
use handwave::bus::dynamixel::model::Model;
use handwave::bus::dynamixel::{ChainOptions, DynamixelChain, Master, MasterOptions, ServoSpec};
use handwave::bus::parallel::BusPart;
use handwave::bus::{BusError, CycleReport, ParallelBus, ServoBus};
use handwave::live::RealClock;
use handwave::sim::line::SharedLine;
use handwave::sim::models::XL430_W250;
use handwave::sim::{Line, LineOptions, SimPort};
use std::sync::Arc;
use std::time::Duration;
use support::folder::Folder;
use support::program::run_virtual;

const PERIOD: Duration = Duration::from_millis(5);

/// Two lines of six servos: joints 1, 3, 5, ... on the first, 2, 4, 6, ... on the second, ids 1 to 6 on both.
struct Rig {
    clock: Arc<dyn Clock>,
    lines: [SharedLine; 2],
    bus: ParallelBus,
    states: [JointState; 12],
}

impl Rig {
    fn on(clock: Arc<dyn Clock>, line_options: LineOptions) -> Self {
        let model = Model::by_name("xl430-w250").expect("a known model");
        let lines = [(); 2].map(|()| {
            let line = Line::commissioned(&XL430_W250, 1..=6, 1_000_000, line_options);
            SharedLine::new(line.expect("a known rate"))
        });
        let parts = ["odd", "even"]
            .iter()
            .zip(&lines)
            .enumerate()
            .map(|(offset, (name, line))| {
                let branch = clock.branch();
                let own: Arc<dyn Clock> = match &branch {
                    Some(branch) => Arc::new(branch.clone()),
                    None => Arc::clone(&clock),
                };
                let port = SimPort::new(line.clone(), own, 1_000_000);
                let master = Master::new(Box::new(port), MasterOptions::default());
                let specs = (1..=6u8).map(|id| {
                    ServoSpec::new(id, format!("joint{}", 2 * id - 1 + offset as u8), model)
                });
                let chain =
                    DynamixelChain::new(Box::new(master), specs.collect(), ChainOptions::default());
                BusPart {
                    name: (*name).to_owned(),
                    bus: Box::new(chain.expect("sensible specs")),
                    branch,
                }
            });
        let joints = (1..=12).map(|joint| format!("joint{joint}")).collect();
        let bus = ParallelBus::new(joints, parts.collect(), Arc::clone(&clock), || {});
        let mut rig = Rig {
            bus: bus.expect("every joint on one bus"),
            clock,
            lines,
            states: Default::default(),
        };
        rig.bus.prepare(&mut rig.states).expect("healthy chains");
        rig.bus.arm().expect("healthy chains");
        rig
    }

    fn new() -> Self {
        Self::on(Arc::new(VirtualClock::new()), LineOptions::default())
    }

    fn cycle(&mut self, targets: &[f64]) -> Result<CycleReport, BusError> {
        let next = self.clock.now() + PERIOD;
        let report = self.bus.exchange(targets, &mut self.states);
        self.clock.sleep_until(next);
        report
    }

    fn run(&mut self, cycles: usize, targets: &[f64]) -> CycleReport {
        let last = (0..cycles)
            .map(|_| self.cycle(targets).expect("healthy chains"))
            .last();
        last.expect("at least one cycle")
    }

    fn fault(&self, line: usize, spec: &str) {
        let fault = spec.parse().expect("a good specification");
        self.lines[line]
            .lock()
            .inject(fault)
            .expect("a servo of the line");
    }

    fn position_rad(&self, joint: usize) -> f64 {
        let line = self.lines[joint % 2].lock();
        let servo = line.servo(joint as u8 / 2 + 1).expect("a servo");
        servo.angle_rad()
    }
}

fn wave() -> Vec<f64> {
    (0..12).map(|joint| 0.02 * f64::from(joint)).collect()
}

#[test]
fn targets_and_states_find_their_joints_in_the_time_of_one_bus() {
    let mut rig = Rig::new();
    let report = rig.run(200, &wave());
    assert_eq!((report.fresh, report.bytes), (12, 2 * 156), "{report:?}");
    // Six servos at 1 Mbaud: both at once take 1560 us.
    assert_eq!(report.cycle_us, 1560, "{report:?}");
    for (joint, target) in wave().iter().enumerate() {
        let (is, told) = (rig.position_rad(joint), rig.states[joint].position);
        assert!(
            (is - target).abs() < 0.01,
            "joint {joint} stands at {is}, target {target}"
        );
        assert!(
            (is - told).abs() < 0.01,
            "joint {joint} stands at {is}, told is {told}"
        );
    }
    let mut goals = [0.0; 12];
    rig.bus.goals(&mut goals);
    for (goal, target) in goals.iter().zip(wave()) {
        assert!((goal - target).abs() < 0.001, "{goals:?}");
    }
    assert_eq!(rig.bus.health().len(), 12);
    assert!(
        rig.bus
            .health()
            .iter()
            .all(|h| h.temperature_c == Some(32.0))
    );
    assert_eq!(
        rig.bus
            .torque_off()
            .expect("both are there")
            .confirmed_off
            .len(),
        12
    );
}

#[test]
fn a_silent_servo_is_told_by_its_place_in_the_whole() {
    let mut rig = Rig::new();
    rig.run(100, &wave());
    rig.fault(1, &format!("3:silent@{}s", rig.clock.now().secs()));
    let report = rig.run(20, &wave());
    assert_eq!(
        (report.fresh, report.silent_mask),
        (11, 1 << 5),
        "joint6: {report:?}"
    );
    rig.bus.reboot(2).expect("joint3 is servo 2 of the first");
    let report = rig.run(200, &wave());
    assert_eq!(report.torqueless_mask, 1 << 2, "{report:?}");
    rig.bus.rearm(2).expect("it is back");
    assert_eq!(rig.run(100, &wave()).torqueless_mask, 0);
}

#[test]
fn a_lost_bus_is_named_and_the_joints_of_the_other_stay_driven() {
    let mut rig = Rig::new();
    rig.run(100, &[0.0; 12]);
    let now_s = rig.clock.now().secs();
    rig.fault(0, &format!("bus:unplugged@{now_s}s..{}s", now_s + 1.0));
    let error = rig.cycle(&wave()).expect_err("the first bus is unplugged");
    let text = error.to_string();
    assert!(text.contains("bus odd (joints joint1, joint3,"), "{text}");
    assert!(matches!(error, BusError::OnBus { .. }), "{text}");
    for _ in 0..150 {
        let report = rig.cycle(&wave()).expect("the second bus is there");
        assert_eq!(
            (report.fresh, report.silent_mask),
            (6, 0b0101_0101_0101),
            "{report:?}"
        );
    }
    let (lost, driven) = (rig.position_rad(10), rig.position_rad(11));
    assert!(lost.abs() < 0.01, "joint11 of the lost bus went to {lost}");
    assert!(
        (driven - 0.22).abs() < 0.01,
        "joint12 stands at {driven}, target 0.22"
    );
    // It is not there yet: the search says so, and the others go on.
    let still = rig.bus.reopen().expect_err("unplugged");
    assert!(still.to_string().contains("bus odd"), "{still}");
    rig.cycle(&wave()).expect("the second bus is there");
    assert!(rig.bus.reopen().is_err(), "still unplugged");
    while rig.clock.now().secs() < now_s + 1.1 {
        rig.cycle(&wave()).expect("the second bus is there");
    }
    let mut searches = 0;
    while rig.bus.reopen().is_err() {
        searches += 1;
        let report = rig.cycle(&wave()).expect("the second bus is there");
        assert_eq!(report.fresh, 6, "while it is looked for: {report:?}");
        assert!(searches < 600, "it is not found again");
    }
    let goal = rig.lines[0].lock().servo(6).expect("a servo").register(116);
    assert!(
        goal.abs_diff(2048) < 4,
        "joint11 was sent to {goal} before it was armed"
    );
    rig.bus.prepare(&mut rig.states).expect("it is back");
    rig.bus.arm().expect("it is back");
    assert_eq!(rig.run(200, &wave()).fresh, 12);
    let back = rig.position_rad(10);
    assert!(
        (back - 0.2).abs() < 0.01,
        "joint11 stands at {back}, target 0.2"
    );
}

#[test]
fn when_all_are_lost_every_exchange_fails() {
    let mut rig = Rig::new();
    let now_s = rig.clock.now().secs();
    for line in 0..2 {
        rig.fault(line, &format!("bus:unplugged@{now_s}s"));
    }
    let first = rig.cycle(&wave()).expect_err("both are gone").to_string();
    let second = rig.cycle(&wave()).expect_err("both are gone").to_string();
    assert!(
        first.contains("bus odd") && second.contains("bus even"),
        "{first}; {second}"
    );
    rig.cycle(&wave()).expect_err("both are gone");
    rig.bus.torque_off().expect_err("nobody is reached");
}

#[test]
fn threads_do_what_virtual_time_does() {
    let options = LineOptions {
        paced: false,
        ..LineOptions::default()
    };
    let mut rig = Rig::on(Arc::new(RealClock::new()), options);
    for _ in 0..100 {
        let report = rig.cycle(&wave()).expect("healthy chains");
        assert_eq!(report.fresh, 12, "{report:?}");
    }
    rig.fault(0, &format!("bus:unplugged@{}s", rig.clock.now().secs()));
    while rig.cycle(&wave()).is_ok() {}
    let report = rig.cycle(&wave()).expect("the second bus is there");
    assert_eq!(report.fresh, 6, "{report:?}");
    let torque = rig.bus.torque_off().expect("one is there");
    assert_eq!(
        (torque.confirmed_off.len(), torque.unconfirmed.len()),
        (6, 6),
        "{torque:?}"
    );
}

/// The built-in quadruped with its left and right legs on buses of their own, ids 1 to 6 on both.
fn two_buses() -> Folder {
    let folder = Folder::of_configs();
    let file = "quadruped.toml";
    for (joint, bus, old, id) in [
        ("front_left_hip\",    ", "left", 1, 1),
        ("front_left_thigh\",  ", "left", 2, 2),
        ("front_left_knee\",   ", "left", 3, 3),
        ("front_right_hip\",   ", "right", 4, 1),
        ("front_right_thigh\", ", "right", 5, 2),
        ("front_right_knee\",  ", "right", 6, 3),
        ("rear_left_hip\",     ", "left", 7, 4),
        ("rear_left_thigh\",   ", "left", 8, 5),
        ("rear_left_knee\",    ", "left", 9, 6),
        ("rear_right_hip\",    ", "right", 10, 4),
        ("rear_right_thigh\",  ", "right", 11, 5),
        ("rear_right_knee\",   ", "right", 12, 6),
    ] {
        folder.edit(
            file,
            &format!("{joint}servo = {old}"),
            &format!("{joint}bus = \"{bus}\", servo = {id}"),
        );
    }
    let second = "[[bus]]\nname = \"right\"\nbus = \"sim\"\n\n[[bus]]\nname = \"left\"\n";
    folder.edit(file, "[bus]\n", second);
    folder
}

#[test]
fn a_character_on_two_buses_plays_the_same_to_the_byte() {
    let folder = two_buses();
    let targets = |name: &str| folder.text(name);
    let (one, two) = (targets("one.csv"), targets("two.csv"));
    let common = ["--json", "--duration", "9", "--targets"];
    let args = |config: &str, out: &str| {
        let mut args: Vec<String> = Vec::new();
        args.extend((!config.is_empty()).then(|| config.to_owned()));
        args.extend(common.map(str::to_owned));
        args.push(out.to_owned());
        args
    };
    let run = |args: &[String]| {
        let args: Vec<&str> = args.iter().map(String::as_str).collect();
        run_virtual(&args)
    };
    run(&args("", &one)).expect(0);
    let config = folder.text("quadruped.toml");
    // One of the buses is noisy, too.
    let mut noisy = args(&config, &two);
    noisy.extend(["--fault".to_owned(), "5:corrupt=0.2@3s..5s".to_owned()]);
    let summary = run(&noisy).expect(0).json();
    assert_eq!(summary["ending"], "performance complete", "{summary}");
    let read = |path: &str| std::fs::read_to_string(path).expect("targets");
    assert!(read(&one) == read(&two), "targets over two buses differ");
}

#[test]
fn buses_are_named_on_the_command_line_and_errors_say_what_is_wrong() {
    let folder = two_buses();
    let config = folder.text("quadruped.toml");
    let fails = |args: &[&str], parts: &[&str]| {
        let ended = run_virtual(&[&[config.as_str()][..], args].concat()).expect(2);
        for part in parts {
            assert!(
                ended.err.contains(part),
                "{args:?}: {part} is not in: {}",
                ended.err
            );
        }
    };
    fails(
        &["--bus", "tail=sim"],
        &["no bus called 'tail'. Buses: right, left"],
    );
    fails(
        &["--bus", "left=dynamixel:/dev/null"],
        &["--speed max would drive the servos"],
    );
    folder.edit(
        "quadruped.toml",
        "front_left_hip\",    bus = \"left\"",
        "front_left_hip\",    bus = \"lft\"",
    );
    fails(
        &[],
        &[
            "quadruped.toml:",
            "there is no bus called \"lft\"",
            "did you mean",
            "Buses: right, left",
        ],
    );
    folder.edit(
        "quadruped.toml",
        "front_left_hip\",    bus = \"lft\", servo",
        "front_left_hip\",    servo",
    );
    fails(
        &[],
        &["say which bus joint front_left_hip hangs on: bus = one of right, left"],
    );
    folder.edit(
        "quadruped.toml",
        "front_left_hip\",    servo",
        "front_left_hip\",    bus = \"right\", servo",
    );
    fails(&[], &["servo 1 is already given to joint"]);
    folder.edit("quadruped.toml", "name = \"left\"\n", "name = \"right\"\n");
    fails(&[], &["two buses are called \"right\""]);
    folder.edit(
        "quadruped.toml",
        "name = \"right\"\nbus = \"sim\"\n\n",
        "bus = \"sim\"\nname = \"left\"\nrate_hz = 100\n\n",
    );
    fails(&[], &["bus.rate_hz", "all buses go in one control cycle"]);
}
