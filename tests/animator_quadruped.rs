//! The shipped quadruped's animator under hard changes: searched transitions, interruptions, turns, another start.

mod support;

use handwave::body::{Feet, RootPose};
use handwave::config::{self, Character, Files};
use handwave::live::session;
use handwave::motion::Animator;
use handwave::motion::class::Drive;
use handwave::motion::layer::LayerInput;
use std::f64::consts::TAU;
use std::time::Instant;
use support::character::{RATE_HZ, built_in, performance};
use support::counting::{Counting, allocations};
use support::folder::Folder;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const DT_S: f64 = 1.0 / RATE_HZ;
const LATENCY_S: f64 = 1.0;
/// As the shipped quadruped has it.
const SHIPPED_SEARCH: &str = "search = { kappa = 180.0, latency_s = 0.6 }";

/// The quadruped with transitions searched, `more` in `[graph.search]`.
fn searching(more: &str) -> (Folder, Character) {
    let folder = Folder::of_configs();
    let section = format!("[graph.search]\nlatency_s = {LATENCY_S:?}\n{more}\n\n");
    folder.edit("quadruped.toml", SHIPPED_SEARCH, &section);
    let (files, name) = Files::of(&folder.path("quadruped.toml"));
    let character = config::load(files, &name).unwrap_or_else(|e| panic!("{e}"));
    (folder, character)
}

struct Walk<'a> {
    character: &'a Character,
    animator: Animator,
    channels: Vec<f64>,
    drives: Vec<Drive>,
    /// Per class the amplitude its gesture goes to, and its frequency.
    gestures: Vec<(f64, f64)>,
    pose: Vec<f64>,
    last: Vec<f64>,
    velocity: Vec<f64>,
    /// Largest share of the joints' speed and acceleration.
    shares: (f64, f64),
    t_s: f64,
    /// Steps in which the raw pose broke a limit.
    broken: u32,
}

impl<'a> Walk<'a> {
    fn new(character: &'a Character) -> Self {
        Self::starting(character, RootPose::default())
    }

    fn starting(character: &'a Character, root: RootPose) -> Self {
        let (header, _) = performance(character);
        let front = session::front_end(character, &header).expect("a front end");
        let mut animator = character
            .animator(&front)
            .expect("an animator")
            .with_root(root);
        let mut pose = vec![0.0; animator.coordinates()];
        animator.rest_pose(&mut pose);
        let n = character.classes.len();
        Self {
            channels: vec![f64::NAN; front.channel_names().len()],
            drives: vec![Drive::default(); n],
            gestures: vec![(0.0, 1.2); n],
            velocity: vec![0.0; character.joints.len()],
            shares: (0.0, 0.0),
            character,
            animator,
            last: pose.clone(),
            pose,
            t_s: 0.0,
            broken: 0,
        }
    }

    fn node(&self, name: &str) -> usize {
        let found = self.character.classes.iter().position(|c| c.name == name);
        found.unwrap_or_else(|| panic!("no class {name}"))
    }

    /// Performs the gesture of `name` alone at `amplitude`.
    fn wish(&mut self, name: &str, amplitude: f64, frequency_hz: f64) {
        self.gestures.iter_mut().for_each(|g| g.0 = 0.0);
        let node = self.node(name);
        self.gestures[node] = (amplitude, frequency_hz);
    }

    fn step(&mut self) {
        self.t_s += DT_S;
        for (drive, (amplitude, frequency_hz)) in self.drives.iter_mut().zip(&self.gestures) {
            drive.amplitude += (amplitude - drive.amplitude) * (DT_S / 0.1);
            drive.frequency_hz = *frequency_hz;
            drive.phase_rad = (TAU * frequency_hz * self.t_s).rem_euclid(TAU);
        }
        let input = LayerInput {
            channels: &self.channels,
            gestures: &[],
        };
        self.last.copy_from_slice(&self.pose);
        self.animator
            .step(&self.drives, &input, DT_S, &mut self.pose);
        let mut over = false;
        for (joint, limit) in self.character.limits.iter().enumerate() {
            let velocity = (self.pose[joint] - self.last[joint]) / DT_S;
            let acceleration = (velocity - self.velocity[joint]) / DT_S;
            self.velocity[joint] = velocity;
            let (v, a) = (
                velocity.abs() / limit.velocity,
                acceleration.abs() / limit.acceleration,
            );
            self.shares = (self.shares.0.max(v), self.shares.1.max(a));
            if v.max(a) > 1.0 {
                over = true;
            }
        }
        self.broken += u32::from(over);
    }

    fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds / DT_S).round() as usize {
            self.step();
        }
    }
}

#[test]
fn a_searched_transition_goes_the_way_that_was_chosen_and_keeps_the_limits() {
    let (_folder, character) = searching("depth = 4\nkappa = 1000.0");
    let mut broken = 0;
    let mut find_us: Vec<f64> = Vec::new();
    let (mut worst_exit, mut worst_entry, mut longest_s): (f64, f64, f64) = (0.0, 0.0, 0.0);
    let edges = [
        ("locomotion", "sit"),
        ("locomotion", "shake"),
        ("locomotion", "bow"),
        ("locomotion", "prance"),
        ("prance", "locomotion"),
    ];
    for (from, to) in edges {
        for k in 0..2 {
            let mut walk = Walk::new(&character);
            let hz = 0.8 + 0.4 * f64::from(k);
            walk.wish(from, 0.9, hz);
            walk.run(4.0 + 0.11 * f64::from(k));
            let (source, target) = (walk.node(from), walk.node(to));
            assert_eq!(walk.animator.active(), source, "{from} is played");
            walk.broken = 0;
            walk.wish(to, 1.0, 1.0);
            let mut chosen = None;
            let mut jumped = false;
            for _ in 0..800 {
                let (before, started) = (allocations(), Instant::now());
                walk.step();
                let (took, made) = (started.elapsed(), allocations() - before);
                match (chosen, walk.animator.choice()) {
                    (None, Some(choice)) => {
                        find_us.push(1e6 * took.as_secs_f64());
                        assert_eq!(made, 0, "allocations in the step that searches");
                        chosen = Some((choice, walk.t_s));
                    }
                    (Some((choice, at_s)), _) if walk.animator.active() == target && !jumped => {
                        jumped = true;
                        let entered = walk.animator.played()[target].phase_rad / TAU;
                        let ahead = (entered - choice.entry).rem_euclid(1.0);
                        worst_entry = worst_entry.max(ahead.min(1.0 - ahead));
                        // The source has gone on to this step.
                        let left = walk.animator.played()[source].phase_rad / TAU;
                        let off = (left - choice.exit).rem_euclid(1.0);
                        worst_exit = worst_exit.max(off.min(1.0 - off));
                        longest_s = longest_s.max(walk.t_s - at_s);
                        let late = (walk.t_s - at_s) - choice.wait_s;
                        assert!(late.abs() < 1.5 * DT_S, "{late} s late");
                    }
                    _ => {}
                }
            }
            assert!(jumped, "{from} to {to}, {hz:.1} Hz: never entered");
            if walk.broken > 0 {
                println!(
                    "{from} to {to}, {hz:.1} Hz: {} steps over limits",
                    walk.broken
                );
            }
            broken += walk.broken;
        }
    }
    find_us.sort_by(f64::total_cmp);
    println!(
        "step with a search: median {:.0} us, longest {:.0} us; exit at most {worst_exit:.3} of a cycle off, entry {worst_entry:.3}; way at most {longest_s:.2} s; {broken} steps over limits",
        find_us[find_us.len() / 2],
        find_us[find_us.len() - 1]
    );
    assert!(
        worst_exit < 0.1,
        "exit {worst_exit:.3} of a cycle off the chosen one"
    );
    assert!(
        worst_entry < 0.03,
        "entry {worst_entry:.3} off the chosen one"
    );
    assert!(longest_s < LATENCY_S + 2.0 * DT_S, "way of {longest_s} s");
    assert!(broken <= 8, "{broken} steps over limits");
}

#[test]
fn a_wish_withdrawn_on_the_way_goes_back_to_the_gesture_without_a_jump() {
    let (_folder, character) = searching("depth = 4\nkappa = 1000.0");
    let (mut withdrawn, mut broken) = (0, 0);
    for k in 0..4 {
        let mut walk = Walk::new(&character);
        walk.wish("locomotion", 0.9, 1.1);
        walk.run(4.0 + 0.13 * f64::from(k));
        let locomotion = walk.node("locomotion");
        walk.broken = 0;
        walk.wish("prance", 0.3, 1.0);
        while walk.animator.transition().is_none() {
            walk.step();
        }
        walk.wish("locomotion", 0.9, 1.1);
        walk.run(4.0);
        withdrawn += walk.animator.counts().aborted;
        let played = walk.animator.played()[locomotion];
        assert_eq!(walk.animator.choice(), None, "a choice is left over");
        if walk.animator.active() == locomotion {
            let lag = (played.phase_rad - walk.drives[locomotion].phase_rad)
                .sin()
                .abs();
            assert!((played.frequency_hz - 1.1).abs() < 0.05, "{played:?}");
            assert!((played.amplitude - 0.9).abs() < 0.02, "{played:?}");
            assert!(lag < 0.2, "{lag} rad behind the gesture");
        }
        broken += walk.broken;
    }
    println!("{withdrawn} of 4 withdrawn, {broken} steps over limits");
    assert!(broken <= 8, "{broken} steps over limits");
}

#[test]
fn blends_and_interruptions_between_all_classes_keep_the_limits() {
    let character = built_in();
    let mut walk = Walk::new(&character);
    let names: Vec<String> = character.classes.iter().map(|c| c.name.clone()).collect();
    let mut random = handwave::base::random::SplitMix::new(3);
    for _ in 0..120 {
        let name = &names[(random.unit() * names.len() as f64) as usize % names.len()];
        walk.wish(name, 0.9, 0.6 + 1.4 * random.unit());
        walk.run(0.15 + 1.5 * random.unit());
    }
    let counts = walk.animator.counts();
    println!(
        "{counts:?}; {} steps over limits, shares {:?}",
        walk.broken, walk.shares
    );
    assert!(
        counts.interrupted > 5 && counts.completed > 20,
        "{counts:?}"
    );
    let steps = (walk.t_s / DT_S) as u32;
    assert!(
        walk.broken < steps / 500,
        "{} of {steps} steps over limits",
        walk.broken
    );
}

#[test]
fn the_turn_parameter_turns_the_body_its_way_and_feet_keep() {
    let character = built_in();
    let feet = character.body.feet.clone().expect("a quadruped has feet");
    for (turn, sign) in [(1.0, 1.0), (-1.0, -1.0), (f64::NAN, 0.0), (0.0, 0.0)] {
        let mut walk = Walk::new(&character);
        walk.wish("locomotion", 0.9, 1.0);
        let node = walk.node("locomotion");
        walk.drives[node].extra = [turn, 0.0];
        let mut began = vec![None; feet.count()];
        let mut slid_m: f64 = 0.0;
        for _ in 0..6000 {
            walk.step();
            let pins = walk.animator.pins().expect("pinned feet");
            for (foot, from) in began.iter_mut().enumerate() {
                let at = walk
                    .animator
                    .root()
                    .to_world(feet.position(&walk.pose, foot));
                if pins.on_ground(foot) {
                    slid_m = slid_m.max((at.xy() - from.get_or_insert(at).xy()).norm());
                } else {
                    *from = None;
                }
            }
        }
        let yaw = walk.animator.root().yaw_rad;
        println!(
            "turn {turn}: yaw {yaw:.2} rad in 30 s, slide {:.2} mm",
            1e3 * slid_m
        );
        assert!(
            slid_m < 2e-3,
            "turn {turn}: a foot slid {:.2} mm",
            1e3 * slid_m
        );
        if sign == 0.0 {
            assert!(yaw.abs() < 1e-6, "turn {turn}: yaw {yaw} rad");
        } else {
            assert!(sign * yaw > 3.0, "turn {turn}: yaw {yaw} rad");
        }
        assert_eq!(walk.broken, 0, "turn {turn}: steps over limits");
    }
}

#[test]
fn a_start_elsewhere_gives_the_same_poses() {
    let character = built_in();
    let elsewhere = RootPose {
        x_m: -3.0,
        y_m: 7.0,
        yaw_rad: 40.0,
    };
    let mut here = Walk::new(&character);
    let mut there = Walk::starting(&character, elsewhere);
    let (mut off, mut walking): (f64, f64) = (0.0, 0.0);
    for (name, seconds) in [
        ("locomotion", 3.0),
        ("bow", 1.0),
        ("prance", 2.0),
        ("sit", 2.0),
        ("shake", 4.0),
        ("locomotion", 2.0),
    ] {
        for walk in [&mut here, &mut there] {
            walk.wish(name, 0.9, 1.2);
        }
        for _ in 0..(seconds / DT_S) as usize {
            here.step();
            there.step();
            for (a, b) in here.pose.iter().zip(&there.pose) {
                off = off.max((a - b).abs());
            }
        }
        if here.t_s < 4.0 {
            walking = off;
        }
    }
    println!("poses differ by at most {walking:.1e} walking, {off:.1e} over all");
    assert!(walking < 1e-9, "walking poses differ by {walking:e}");
    assert!(off < 1e-9, "poses differ by {off:e}");
}

#[test]
fn time_that_stands_still_changes_nothing_at_any_point_of_a_step() {
    let character = built_in();
    let mut walk = Walk::new(&character);
    walk.wish("locomotion", 0.9, 1.2);
    for k in 0..80 {
        walk.run(0.05 + 0.001 * f64::from(k));
        let (pose, root) = (walk.pose.clone(), walk.animator.root());
        let input = LayerInput {
            channels: &walk.channels,
            gestures: &[],
        };
        for _ in 0..3 {
            walk.animator
                .step(&walk.drives, &input, 0.0, &mut walk.pose);
        }
        let off = pose.iter().zip(&walk.pose).map(|(a, b)| (a - b).abs());
        let off = off.fold(0.0, f64::max);
        assert!(off < 1e-9, "hold {k}: the pose moves by {off:e}");
        assert_eq!(root, walk.animator.root(), "hold {k}");
    }
    assert_eq!(walk.broken, 0, "steps over limits");
}
