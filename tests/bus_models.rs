//! Every servo model on the simulated line, led by the driver that ships, in virtual time: found, checked, armed, moved, let go;
//! alone and mixed, in every operating mode.

use handwave::base::{Clock, JointState, VirtualClock};
use handwave::bus::dynamixel::model::{Effort, MODELS};
use handwave::bus::dynamixel::{
    ChainOptions, Client, DynamixelChain, Follow, Gains, Master, MasterOptions, Mode, Model,
    Outcome, Profile, Protocol, ServoSpec, Settings,
};
use handwave::bus::{BusError, CycleReport, ServoBus};
use handwave::sim::line::SharedLine;
use handwave::sim::{Line, LineOptions, Servo, SimPort, models};
use proptest::prelude::*;
use std::f64::consts::TAU;
use std::sync::Arc;
use std::time::Duration;

const PERIOD: Duration = Duration::from_millis(5);

/// Servos as declared on a line, the driver at its other end, a control loop of 200 Hz.
struct Rig {
    clock: VirtualClock,
    line: SharedLine,
    chain: DynamixelChain,
    states: Vec<JointState>,
    targets: Vec<f64>,
}

/// A simulated servo as `spec` wants it.
fn commissioned(spec: &ServoSpec) -> Servo {
    let device = models::model(spec.model.name).expect("a device for every model");
    Servo::commissioned(device, spec.id, 3).with_mode(spec.mode)
}

impl Rig {
    fn on(servos: Vec<Servo>, specs: Vec<ServoSpec>) -> Self {
        let clock = VirtualClock::new();
        let mut line = Line::new(LineOptions::default());
        for (spec, servo) in specs.iter().zip(servos) {
            line.attach(spec.id, servo);
        }
        let line = SharedLine::new(line);
        let port = SimPort::new(line.clone(), Arc::new(clock.clone()), 1_000_000);
        let client = Master::new(Box::new(port), MasterOptions::default());
        let options = ChainOptions {
            bus: "sim".into(),
            ..ChainOptions::default()
        };
        let count = specs.len();
        let chain = DynamixelChain::new(Box::new(client), specs, options);
        Rig {
            chain: chain.expect("sensible specs"),
            clock,
            line,
            states: vec![JointState::default(); count],
            targets: vec![0.0; count],
        }
    }

    fn of(specs: Vec<ServoSpec>) -> Self {
        let servos = specs.iter().map(commissioned).collect();
        Rig::on(servos, specs)
    }

    fn prepare(&mut self) -> Result<(), BusError> {
        self.chain.prepare(&mut self.states)
    }

    fn armed(mut self) -> Self {
        self.prepare().expect("a healthy chain");
        self.chain.arm().expect("a healthy chain");
        self
    }

    fn cycle(&mut self) -> CycleReport {
        let next = self.clock.now() + PERIOD;
        let report = self.chain.exchange(&self.targets, &mut self.states);
        self.clock.sleep_until(next);
        report.expect("the bus is there")
    }

    /// Leads joint `index` to `target` with a speed of `rad_s`, then lets it settle for half a second.
    fn lead(&mut self, index: usize, target: f64, rad_s: f64) {
        let step = rad_s * PERIOD.as_secs_f64();
        while (target - self.targets[index]).abs() > step {
            self.targets[index] += step.copysign(target - self.targets[index]);
            self.cycle();
        }
        self.targets[index] = target;
        self.settle(0.5);
    }

    fn settle(&mut self, seconds: f64) {
        for _ in 0..(seconds / PERIOD.as_secs_f64()) as usize {
            self.cycle();
        }
    }

    /// A register of a servo on the line, by name, as a signed number.
    fn register(&self, id: u8, name: &str) -> i64 {
        let line = self.line.lock();
        let servo = line.servo(id).expect("a servo of the line");
        let index = self.chain.facts().iter().position(|f| f.id == id);
        let model = &self.chain.facts()[index.expect("a servo of the chain")].model;
        let model = Model::by_name(model).expect("a known model");
        let register = model.register(name).expect("a register of the model");
        let x_series = model.layout.x_series(register.address);
        let bytes = servo.register(x_series).to_le_bytes();
        register.decode(&bytes[..usize::from(register.size)])
    }

    fn angle(&self, id: u8) -> f64 {
        let line = self.line.lock();
        line.servo(id).expect("a servo of the line").angle_rad()
    }

    fn torque(&self, id: u8) -> bool {
        let line = self.line.lock();
        line.servo(id)
            .expect("a servo of the line")
            .torque_enabled()
    }

    fn fault(&self, spec: &str) {
        let fault = spec.parse().expect("a good specification");
        self.line.lock().inject(fault).expect("a servo of the line");
    }

    fn notes(&self) -> String {
        self.chain.notes().join("\n")
    }
}

fn spec(id: u8, name: &str) -> ServoSpec {
    let model = Model::by_name(name).expect("a known model");
    ServoSpec::new(id, format!("joint{id}"), model)
}

fn two() -> impl Iterator<Item = &'static &'static Model> {
    MODELS
        .iter()
        .filter(|model| model.protocol == Protocol::Two)
}

/// How far a joint may stand from its target when it rests: friction and gain leave some counts.
const AT_REST_RAD: f64 = 0.03;

#[test]
fn every_model_is_found_armed_moved_and_let_go() {
    let mut count = 0;
    for model in two() {
        let name = model.name;
        let mut rig = Rig::of(vec![spec(1, name)]).armed();
        assert!(rig.torque(1), "{name}: torque stays off");
        assert!(rig.angle(1).abs() < 1e-3, "{name} moved when it was armed");
        rig.lead(0, 0.5, 1.0);
        let (state, angle) = (rig.states[0], rig.angle(1));
        assert!(
            (state.position - 0.5).abs() < AT_REST_RAD && (angle - 0.5).abs() < AT_REST_RAD,
            "{name}: told {:.4} rad, stands at {angle:.4}, target 0.5",
            state.position
        );
        // On the way its velocity is told in rad/s, whatever a count is.
        rig.targets[0] = 0.5;
        let mut fastest: f64 = 0.0;
        for _ in 0..100 {
            rig.targets[0] -= 0.005;
            rig.cycle();
            fastest = fastest.max(-rig.states[0].velocity);
        }
        assert!(
            (0.9..1.3).contains(&fastest),
            "{name}: led at 1 rad/s, told {fastest:.3}"
        );
        let facts = &rig.chain.facts()[0];
        assert_eq!((facts.id, facts.model.as_str()), (1, name));
        let limit = facts.effort_limit.expect("every model has one");
        let expected = match model.effort {
            Effort::Load => 1.0..=1.0,
            Effort::Current => 0.8..=7.0,
        };
        assert!(expected.contains(&limit), "{name}: effort limit {limit}");
        let report = rig.chain.torque_off().expect("the bus is there");
        assert_eq!(report.confirmed_off, ["joint1"], "{name}: {report:?}");
        assert!(!rig.torque(1), "{name}: torque stays on");
        count += 1;
    }
    assert!(count >= 18, "{count} models");
}

#[test]
fn effort_is_a_share_of_load_or_ampere() {
    for (name, expected_stall) in [
        ("xl430-w250", 1.0),
        ("xm430-w350", 2.3),
        ("xl330-m288", 1.47),
    ] {
        let mut rig = Rig::of(vec![spec(1, name)]).armed();
        rig.fault("1:stuck@0s..100s");
        rig.targets[0] = 1.5;
        rig.settle(0.5);
        let effort = rig.states[0].effort;
        assert!(
            // The stalled motor itself pulls the supply down by a little.
            (effort / expected_stall - 1.0).abs() < 0.04,
            "{name} blocked: effort {effort:.3}, at standstill {expected_stall}"
        );
    }
}

#[test]
fn a_chain_of_six_models_moves_as_one() {
    let names = [
        "xl430-w250",
        "xm430-w350",
        "xl330-m288",
        "mx-64-2",
        "ph42-020-s300",
        "xm540-w270",
    ];
    let specs = (1..).zip(names).map(|(id, name)| spec(id, name)).collect();
    let mut rig = Rig::of(specs).armed();
    for target in [0.4, -0.3] {
        for _ in 0..200 {
            for goal in &mut rig.targets {
                *goal += (target - *goal).clamp(-0.005, 0.005);
            }
            let report = rig.cycle();
            assert_eq!((report.fresh, report.silent), (6, 0), "{report:?}");
        }
        rig.settle(0.5);
        for (index, name) in names.iter().enumerate() {
            let position = rig.states[index].position;
            assert!(
                (position - target).abs() < AT_REST_RAD,
                "{name}: {position:.4} rad, target {target}"
            );
        }
    }
    // The MX keeps the X series from fast reads, and that is said once.
    let notes = rig.notes();
    assert!(
        notes.contains("servo 4 is an mx-64-2, which knows no fast reads"),
        "{notes}"
    );
    assert!(
        notes.contains("servo 3 (xl330-m288, joint joint3) is not protected"),
        "{notes}"
    );
    // One of either group falls silent: the others go on.
    let now = rig.clock.now().secs();
    for id in [1, 5] {
        rig.fault(&format!("{id}:silent@{}s..{}s", now + 0.1, now + 0.6));
    }
    for cycle in 0..100 {
        let report = rig.cycle();
        assert!(
            report.silent_mask & !0b1_0001 == 0 || cycle < 25 && report.silent <= 6,
            "cycle {cycle}: {report:?}"
        );
    }
    rig.settle(1.0);
    assert_eq!(rig.cycle().fresh, 6, "all are back");
    let report = rig.chain.torque_off().expect("the bus is there");
    assert_eq!(report.confirmed_off.len(), 6, "{report:?}");
}

#[test]
fn servos_of_other_layouts_share_a_cycle_without_taking_time_from_each_other() {
    // Six of each: a silent one of the first group may not eat the time of the second.
    let mut specs: Vec<ServoSpec> = (1..=6).map(|id| spec(id, "xl430-w250")).collect();
    specs.extend((7..=12).map(|id| spec(id, "ph42-020-s300")));
    let mut rig = Rig::of(specs).armed();
    rig.settle(0.5);
    let now = rig.clock.now().secs();
    rig.fault(&format!("6:silent@{}s..{}s", now + 0.1, now + 1.0));
    let mut lost = 0;
    for cycle in 0..150 {
        let report = rig.cycle();
        let ph42 = report.silent_mask >> 6;
        lost += u32::from(ph42 != 0);
        assert!(
            report.cycle_us <= 5000,
            "cycle {cycle} takes {} us: {report:?}",
            report.cycle_us
        );
    }
    assert_eq!(
        lost, 0,
        "cycles in which a servo of the other group was lost"
    );
}

#[test]
fn an_extended_joint_turns_three_times_and_back() {
    for name in ["xl430-w250", "xm430-w350", "xl330-m288", "ph42-020-s300"] {
        let model = Model::by_name(name).expect("a known model");
        let turn = model.pulses_per_turn as i32;
        let centre = model.centre_pulse;
        let wide =
            spec(1, name).in_mode(Mode::ExtendedPosition, centre - turn / 2, centre + 4 * turn);
        let mut rig = Rig::of(vec![wide]).armed();
        for target in [3.0 * TAU, 0.0] {
            rig.lead(0, target, 2.0);
            let (told, angle) = (rig.states[0].position, rig.angle(1));
            assert!(
                (told - target).abs() < AT_REST_RAD && (angle - target).abs() < AT_REST_RAD,
                "{name}: told {told:.3} rad, stands at {angle:.3}, target {target:.3}"
            );
        }
    }
}

#[test]
fn a_joint_of_several_turns_that_lost_count_of_them_is_not_armed_again() {
    let wide = spec(1, "xl430-w250").in_mode(Mode::ExtendedPosition, -4096, 5 * 4096);
    let mut rig = Rig::of(vec![wide]).armed();
    rig.lead(0, 2.0 * TAU, 4.0);
    rig.chain.reboot(0).expect("it answers");
    rig.settle(1.0);
    assert_eq!(
        rig.cycle().torqueless_mask,
        1,
        "it came back without torque"
    );
    let error = rig
        .chain
        .rearm(0)
        .expect_err("its turns are lost")
        .to_string();
    assert!(error.contains("lost count of them"), "{error}");
    assert!(!rig.torque(1));
}

#[test]
fn an_extended_goal_never_leaves_the_declared_range_though_the_servo_would_go_there() {
    let wide = spec(1, "xm430-w350").in_mode(Mode::ExtendedPosition, -2000, 6000);
    let mut rig = Rig::of(vec![wide]).armed();
    for target in [
        f64::NAN,
        1e300,
        f64::INFINITY,
        -40.0,
        f64::NEG_INFINITY,
        f64::NAN,
    ] {
        rig.targets[0] = target;
        for _ in 0..40 {
            rig.cycle();
            let goal = rig.register(1, "goal_position");
            assert!(
                (-2000..=6000).contains(&goal),
                "target {target}: goal {goal}"
            );
        }
    }
    // The servo's own limits are at one turn still; in this mode it does not look at them.
    assert_eq!(rig.register(1, "max_position_limit"), 4095);
    assert_eq!(rig.register(1, "goal_position"), -2000);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn whatever_is_asked_the_shaft_stays_in_its_range(
        mode in prop::sample::select(vec![
            Mode::ExtendedPosition, Mode::CurrentBasedPosition, Mode::Velocity, Mode::Current,
        ]),
        targets in prop::collection::vec(
            prop_oneof![
                Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY), Just(1e300),
                -1e6..1e6f64, -3.0..3.0f64,
            ],
            1..30,
        ),
        min in -6000..1000i32,
        max in 3000..9000i32,
    ) {
        let mut one = spec(1, "xm430-w350").in_mode(mode, min, max);
        one.settings.follow = match mode {
            Mode::Current => Follow { p: 2.0, d: 0.3 },
            _ => Follow::default(),
        };
        let mut rig = Rig::of(vec![one.clone()]).armed();
        for target in targets {
            rig.targets[0] = target;
            for _ in 0..20 {
                rig.cycle();
                let (goal, at) = (rig.register(1, "goal_position"), rig.angle(1) * 4096.0 / TAU + 2048.0);
                if mode.holds_position() {
                    prop_assert!((min..=max).contains(&(goal as i32)), "{target}: goal {goal}");
                }
                // A jump of the target to the end of the range overshoots by what a control loop overshoots.
                let slack = 400.0;
                prop_assert!(
                    (f64::from(min) - slack..=f64::from(max) + slack).contains(&at),
                    "{mode:?} target {target}: stands at {at:.0} of {min}..{max}"
                );
            }
        }
    }
}

#[test]
fn a_current_based_joint_pushes_no_harder_than_its_limit() {
    let mut soft = spec(1, "xm430-w350").in_mode(Mode::CurrentBasedPosition, 0, 4095);
    soft.settings.current_limit_a = Some(0.5);
    let mut rig = Rig::of(vec![soft]).armed();
    // 0.5 A are 185 counts of 2.69 mA.
    assert_eq!(rig.register(1, "goal_current"), 185);
    rig.lead(0, 0.5, 1.0);
    assert!(
        (rig.angle(1) - 0.5).abs() < AT_REST_RAD,
        "{:.3} rad",
        rig.angle(1)
    );
    rig.fault("1:stuck@0s..100s");
    rig.targets[0] = -1.0;
    rig.settle(0.5);
    let effort = rig.states[0].effort;
    assert!(
        (-0.505..=-0.49).contains(&effort),
        "blocked: {effort:.3} A of 0.5"
    );
    assert_eq!(rig.chain.facts()[0].effort_limit, Some(0.5));
}

#[test]
fn more_current_than_the_servo_allows_is_refused_with_the_command() {
    let mut soft = spec(1, "xm430-w350").in_mode(Mode::CurrentBasedPosition, 0, 4095);
    soft.settings.current_limit_a = Some(2.0);
    let servo = commissioned(&soft).with_register("current_limit", 500);
    let mut rig = Rig::on(vec![servo], vec![soft]);
    let error = rig.prepare().expect_err("its limit is lower").to_string();
    for part in [
        "1.345 A",
        "wants 2 A",
        "handwave bus write sim 1 current_limit 744",
    ] {
        assert!(error.contains(part), "no {part:?} in: {error}");
    }
}

#[test]
fn a_velocity_joint_follows_a_position_and_stops_when_nobody_leads_it() {
    let wheel = spec(1, "xl430-w250").in_mode(Mode::Velocity, -100 * 4096, 100 * 4096);
    let mut rig = Rig::of(vec![wheel, spec(2, "xl430-w250")]).armed();
    let mut worst: f64 = 0.0;
    for _ in 0..600 {
        rig.targets[0] += 0.01;
        rig.cycle();
        worst = worst.max((rig.angle(1) - rig.targets[0]).abs());
    }
    // 2 rad/s for three seconds, close to a turn.
    assert!(worst < 0.1, "led at 2 rad/s it is {worst:.3} rad behind");
    rig.settle(0.5);
    let (angle, target) = (rig.angle(1), rig.targets[0]);
    assert!(
        (angle - target).abs() < 0.02,
        "stands at {angle:.3}, target {target:.3}"
    );
    // Its answers are lost while it turns: it may hear still, and is told to stop.
    let now = rig.clock.now().secs();
    rig.fault(&format!("1:silent@{}s..{}s", now + 0.2, now + 1.2));
    for _ in 0..80 {
        rig.targets[0] += 0.01;
        rig.cycle();
    }
    // Silent it takes nothing in either, so that its watchdog has stopped it.
    let speed = rig.line.lock().servo(1).expect("on the line").speed_rad_s();
    assert!(speed.abs() < 0.01, "{speed:.3} rad/s while it was silent");
    let before = rig.angle(1);
    rig.settle(0.3);
    assert!((rig.angle(1) - before).abs() < 1e-3, "it crept on");
    rig.settle(2.5);
    let (angle, target) = (rig.angle(1), rig.targets[0]);
    assert!(
        (angle - target).abs() < 0.02,
        "back: stands at {angle:.3}, target {target:.3}"
    );
}

#[test]
fn a_velocity_joint_does_not_run_on_when_it_is_armed_or_let_go() {
    let wheel = spec(1, "xm430-w350").in_mode(Mode::Velocity, -100 * 4096, 100 * 4096);
    // Somebody left a goal of 100 counts in it.
    let servo = commissioned(&wheel).with_register("goal_velocity", 100);
    let mut rig = Rig::on(vec![servo], vec![wheel]).armed();
    rig.settle(0.5);
    assert!(
        rig.angle(1).abs() < 0.01,
        "armed, it turned {:.3} rad",
        rig.angle(1)
    );
    // The host dies while it turns: the watchdog of 100 ms stops it.
    for _ in 0..100 {
        rig.targets[0] += 0.01;
        rig.cycle();
    }
    let dead_at = rig.angle(1);
    rig.clock
        .sleep_until(rig.clock.now() + Duration::from_secs(2));
    rig.line.lock().advance(rig.clock.now());
    let on = rig.angle(1) - dead_at;
    assert!(on < 2.0 * 0.2, "it turned on by {on:.3} rad");
    assert_eq!(rig.register(1, "bus_watchdog"), -1);
}

#[test]
fn a_current_joint_is_a_spring_and_a_damper() {
    let mut spring = spec(1, "xm430-w350").in_mode(Mode::Current, 0, 4095);
    spring.settings = Settings {
        current_limit_a: Some(1.0),
        follow: Follow { p: 2.0, d: 0.3 },
        ..Settings::default()
    };
    let mut rig = Rig::of(vec![spring]).armed();
    assert!(rig.torque(1));
    rig.settle(0.3);
    assert!(
        rig.angle(1).abs() < 0.01,
        "armed, it turned {:.3} rad",
        rig.angle(1)
    );
    rig.lead(0, 0.6, 1.0);
    rig.settle(0.5);
    assert!(
        (rig.angle(1) - 0.6).abs() < 0.05,
        "stands at {:.3}",
        rig.angle(1)
    );
    // A hand pushes with 0.5 N m: 1.78 N m/A and 2 A/rad make 3.57 N m/rad.
    rig.line
        .lock()
        .servo_mut(1)
        .expect("on the line")
        .set_external_torque(0.5);
    rig.settle(1.0);
    let gave = rig.angle(1) - 0.6;
    assert!(
        (0.09..0.19).contains(&gave),
        "pushed with 0.5 N m it gave {gave:.3} rad"
    );
    let effort = rig.states[0].effort;
    assert!(effort.abs() <= 1.0, "{effort} A");
}

#[test]
fn gains_and_profile_are_written_at_arming_and_again_after_a_reboot() {
    let mut tuned = spec(1, "xl430-w250");
    tuned.settings = Settings {
        gains: Gains {
            p: Some(900),
            i: Some(10),
            d: None,
            feedforward_1: Some(50),
            feedforward_2: Some(5),
        },
        profile: Some(Profile {
            acceleration_rad_s2: 20.0,
            velocity_rad_s: 3.0,
        }),
        ..Settings::default()
    };
    let mut rig = Rig::of(vec![tuned, spec(2, "xl430-w250")]).armed();
    let expected = [
        ("position_p_gain", 900),
        ("position_i_gain", 10),
        ("position_d_gain", 4000),
        ("feedforward_1st_gain", 50),
        ("feedforward_2nd_gain", 5),
        ("profile_acceleration", 53),
        ("profile_velocity", 125),
    ];
    let all = |rig: &Rig, when: &str| {
        for (name, value) in expected {
            assert_eq!(rig.register(1, name), value, "{name} {when}");
        }
        assert_eq!(rig.register(2, "position_p_gain"), 640, "{when}");
        assert_eq!(rig.register(2, "profile_velocity"), 0, "{when}");
    };
    all(&rig, "after arming");
    rig.settle(0.5);
    rig.chain.reboot(0).expect("it answers");
    rig.settle(1.0);
    assert_eq!(rig.register(1, "position_p_gain"), 640, "a reboot forgets");
    rig.chain.rearm(0).expect("it is back");
    all(&rig, "after the reboot");
}

#[test]
fn a_mode_that_the_servo_is_not_in_is_refused_with_the_command() {
    let wanted = spec(1, "xm430-w350").in_mode(Mode::ExtendedPosition, -4096, 8192);
    let servo = commissioned(&spec(1, "xm430-w350"));
    let mut rig = Rig::on(vec![servo], vec![wanted]);
    let error = rig.prepare().expect_err("another mode").to_string();
    for part in [
        "operating mode is 3 (position), needed is 4 (extended_position)",
        "handwave bus write sim 1 operating_mode 4",
    ] {
        assert!(error.contains(part), "no {part:?} in: {error}");
    }
}

#[test]
fn a_watchdog_that_does_not_protect_is_said_and_not_counted_upon() {
    // A sound one: 5 counts of 20 ms.
    let mut rig = Rig::of(vec![spec(1, "xl430-w250"), spec(2, "xc330-t288")]);
    rig.prepare().expect("a healthy chain");
    let facts: Vec<_> = rig.chain.facts().iter().map(|f| f.watchdog_s).collect();
    assert_eq!(facts, [Some(0.1), None]);
    let notes = rig.notes();
    assert!(
        notes.contains("servo 2 (xc330-t288, joint joint2) is not protected"),
        "{notes}"
    );
    assert!(notes.contains("keep turning"), "{notes}");

    // In modes of several turns a tripped one runs off to a goal of its own with a homing offset: it stays off.
    let wide = spec(1, "xm430-w350").in_mode(Mode::ExtendedPosition, -8192, 8192);
    let servo = commissioned(&wide).with_register("homing_offset", 1000);
    let mut rig = Rig::on(vec![servo], vec![wide]).armed();
    assert_eq!(rig.chain.facts()[0].watchdog_s, None);
    assert_eq!(rig.register(1, "bus_watchdog"), 0);
    assert!(
        rig.notes().contains("homing offset of 1000"),
        "{}",
        rig.notes()
    );
    rig.settle(0.1);

    let old = commissioned(&spec(1, "xl430-w250")).with_firmware(37);
    let mut rig = Rig::on(vec![old], vec![spec(1, "xl430-w250")]);
    rig.prepare().expect("a healthy chain");
    assert!(
        rig.notes().contains("firmware 37 has none, it needs 38"),
        "{}",
        rig.notes()
    );
}

#[test]
fn limits_that_the_servo_bears_are_told() {
    let mut rig = Rig::of(vec![spec(1, "xl330-m288"), spec(2, "ph42-020-s300")]);
    rig.prepare().expect("a healthy chain");
    let facts = rig.chain.facts();
    assert_eq!(facts[0].temperature_limit_c, Some(70.0));
    let (least, most) = facts[0].voltage_range_v.expect("it has limits");
    assert!(
        (least - 3.5).abs() < 1e-9 && (most - 7.0).abs() < 1e-9,
        "{least} to {most} V"
    );
    assert_eq!(facts[0].effort_limit, Some(1.75));
    assert_eq!(facts[1].effort_limit, Some(4.5));
    assert_eq!(facts[1].bus, "sim");
}

#[test]
fn indirect_data_of_the_330_size_is_read_where_the_firmware_has_it() {
    let model = Model::by_name("xl330-m288").expect("a known model");
    let device = models::model("xl330-m288").expect("a known device");
    for (firmware, data, elsewhere) in [(47, 224, 208), (51, 224, 208), (52, 208, 224)] {
        let clock = VirtualClock::new();
        let mut line = Line::new(LineOptions::default());
        line.attach(1, Servo::commissioned(device, 1, 3).with_firmware(firmware));
        let line = SharedLine::new(line);
        let port = SimPort::new(line, Arc::new(clock), 1_000_000);
        let mut client = Master::new(Box::new(port), MasterOptions::default());
        let ping = client.ping(1).expect("it answers");
        assert_eq!((ping.model, ping.firmware), (1200, firmware));
        let block = model.indirect(ping.firmware).next().expect("a block");
        assert_eq!(block.data, data, "firmware {firmware}");
        // Hardware error, voltage and temperature in one read.
        for (slot, address) in (0u16..).zip([70u16, 144, 145, 146]) {
            let register = block.address + 2 * slot;
            let written = client.write(1, register, &address.to_le_bytes());
            written.unwrap_or_else(|e| panic!("firmware {firmware}, slot {slot}: {e}"));
        }
        let mut bytes = [9; 4];
        client.read(1, block.data, &mut bytes).expect("mapped");
        assert_eq!(
            bytes,
            [0, 50, 0, 32],
            "firmware {firmware}: no error, 5.0 V, 32 C"
        );
        let mut other = [9; 4];
        let found = client.read(1, elsewhere, &mut other);
        assert!(
            found.is_err() || other == [0; 4],
            "firmware {firmware}: {elsewhere} holds {other:?}"
        );
        // Fast reads came with firmware 46 there, so that all of these join in.
        let mut outcomes = [Outcome::NotReached];
        let read = client.fast_sync_read(132, 4, &[1], &mut [0; 4], &mut outcomes);
        read.expect("the port works");
        assert!(
            matches!(outcomes[0], Outcome::Fresh(_)),
            "firmware {firmware}: {outcomes:?}"
        );
    }
}

#[test]
fn fast_reads_are_used_where_all_that_are_read_together_know_them() {
    for (name, firmware, fast) in [
        ("xl330-m288", 46, true),
        ("xl330-m288", 45, false),
        ("xm430-w350", 45, true),
        ("xm430-w350", 44, false),
        ("mx-28-2", 46, false),
        ("ph42-020-s300", 15, false),
    ] {
        let specs = vec![spec(1, "xl430-w250"), spec(2, name)];
        let servos = vec![
            commissioned(&specs[0]),
            commissioned(&specs[1]).with_firmware(firmware),
        ];
        let mut rig = Rig::on(servos, specs).armed();
        assert_eq!(
            rig.chain.uses_fast_reads(),
            fast,
            "{name} with firmware {firmware}"
        );
        rig.settle(0.2);
        assert_eq!(rig.cycle().fresh, 2, "{name} with firmware {firmware}");
    }
}
