//! The ladder of lost poses: on in phase, eased to a hold, then rest, hold or stop; and the way back, without a jump.

mod support;

use handwave::base::{JointState, Time};
use handwave::config::Character;
use handwave::config::file::OnLost;
use handwave::gesture::Gesture;
use handwave::live::session;
use handwave::pose::{PoseHeader, PoseSample};
use handwave::puppet::{Inputs, Puppet, Stage};
use std::f64::consts::TAU;
use support::character::{Player, RATE_HZ, built_in};
use support::limits::LimitWatch;
use support::recipe;

/// A player under watch.
struct Watched {
    player: Player,
    watch: LimitWatch,
    held_back: u64,
}

impl Watched {
    /// Plays on until `until_s`; returns the fastest joint speed, rad/s.
    fn play(&mut self, until_s: f64, heard: bool) -> f64 {
        let mut fastest = 0.0_f64;
        while self.player.t_s() < until_s && self.player.step(heard) {
            self.watch
                .see(self.player.positions())
                .unwrap_or_else(|e| panic!("{e}"));
            self.held_back += u64::from(self.player.puppet.targets().held_back > 0);
            fastest = fastest.max(self.watch.fastest_rad_s());
        }
        fastest
    }
}

/// A puppet in the middle of the second drumming segment, and the time.
fn drumming(on_lost: OnLost) -> (Watched, f64, f64) {
    let mut character = built_in();
    character.safety.on_lost = on_lost;
    let begins_s = character.safety.ramp_s + 0.005;
    let segment = recipe::drumming().swap_remove(1);
    let lost_at_s = begins_s + segment.from_s + 3.0;
    let mut watched = Watched {
        player: Player::new(&character, begins_s),
        watch: LimitWatch::new(&character.limits, 1.0 / RATE_HZ),
        held_back: 0,
    };
    let fastest = watched.play(lost_at_s, true);
    assert!(fastest > 0.5, "not walking: {fastest} rad/s");
    (watched, lost_at_s, character.safety.lost_s)
}

#[test]
fn with_on_lost_idle_motion_is_held_then_comes_to_rest_and_resumes_with_the_poses() {
    let (mut watched, lost_at_s, lost_s) = drumming(OnLost::Idle);
    let coasting = watched.play(lost_at_s + 0.3, false);
    assert!(coasting > 0.5, "stopped within 0.3 s: {coasting} rad/s");
    let easing = watched.play(lost_at_s + 0.9, false);
    watched.play(lost_at_s + lost_s - 0.02, false);
    assert!(
        !watched.player.puppet.targets().poses_lost,
        "lost too early"
    );
    let held = watched.play(lost_at_s + lost_s + 0.01, false);
    // A fiftieth of a second before the end of the easing it still shows a trace of the walk.
    assert!(
        held < 0.04 * coasting,
        "not held when lost: {held} rad/s of {coasting}"
    );
    watched.play(lost_at_s + lost_s + 0.05, false);
    assert!(
        watched.player.puppet.targets().poses_lost,
        "not lost after {lost_s} s"
    );
    watched.play(lost_at_s + lost_s + 1.5, false);
    let resting = watched.play(lost_at_s + lost_s + 2.0, false);
    assert!(resting < 0.02, "still moving at {resting} rad/s");
    let resumed = watched.play(lost_at_s + lost_s + 4.0, true);
    assert!(resumed > 0.5, "poses are back, legs at {resumed} rad/s");
    assert!(!watched.player.puppet.targets().poses_lost);
    let held_back = watched.held_back;
    assert_eq!(held_back, 0, "cycles in which the envelope acted");
    println!(
        "coasting {coasting:.2}, easing {easing:.2}, held {held:.4}, resting {resting:.4}, resumed {resumed:.2} rad/s; {}",
        watched.watch.extremes()
    );
}

#[test]
fn with_on_lost_hold_the_pose_stays_as_it_is_until_the_end() {
    let (mut watched, lost_at_s, lost_s) = drumming(OnLost::Hold);
    let coasting = watched.play(lost_at_s + 0.3, false);
    assert!(coasting > 0.5, "stopped within 0.3 s: {coasting} rad/s");
    watched.play(lost_at_s + lost_s + 0.01, false);
    let at_lost = watched.player.positions().to_vec();
    watched.play(lost_at_s + lost_s + 5.0, false);
    assert!(watched.player.puppet.targets().poses_lost);
    let moved = (watched.player.positions().iter().zip(&at_lost))
        .fold(0.0_f64, |most, (now, then)| most.max((now - then).abs()));
    assert!(moved < 1e-6, "moved by {moved} rad while held");
    let mut rest = vec![0.0; at_lost.len()];
    let character = built_in();
    let (header, _) = support::character::performance(&character);
    let front =
        handwave::gesture::FrontEnd::new(&character.gestures, &header, character.front_options);
    (character
        .animator(&front.expect("a front end"))
        .expect("an animator"))
    .rest_pose(&mut rest);
    let away = (at_lost.iter().zip(&rest)).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
    assert!(
        away > 0.05,
        "held {away} rad from rest: this is the rest pose"
    );
    // The end of the performance ends a hold as it ends everything.
    while watched.player.step(false) {
        watched
            .watch
            .see(watched.player.positions())
            .unwrap_or_else(|e| panic!("{e}"));
        watched.held_back += u64::from(watched.player.puppet.targets().held_back > 0);
    }
    assert_eq!(watched.player.puppet.stage(), Stage::Done);
    let held_back = watched.held_back;
    assert_eq!(held_back, 0, "cycles in which the envelope acted");
    println!("held {away:.3} rad from rest, moved by {moved:.1e}");
}

#[test]
fn with_on_lost_stop_the_run_lies_down() {
    let (mut watched, lost_at_s, lost_s) = drumming(OnLost::Stop);
    watched.play(lost_at_s + lost_s + 0.1, false);
    assert_eq!(watched.player.puppet.stage(), Stage::Settling);
    watched.play(lost_at_s + lost_s + 8.0, false);
    let took = watched.player.t_s() - lost_at_s;
    assert_eq!(watched.player.puppet.stage(), Stage::Done, "after {took} s");
    let lie = built_in().end_pose.expect("an end pose");
    for (joint, (at, lie)) in watched.player.positions().iter().zip(&lie).enumerate() {
        assert!(
            (at - lie).abs() < 1e-6,
            "joint {joint} at {at}, lying is {lie}"
        );
    }
    let held_back = watched.held_back;
    assert_eq!(held_back, 0, "cycles in which the envelope acted");
    println!(
        "envelope acted in {held_back} cycles; lying {took:.2} s after the last pose; {}",
        watched.watch.extremes()
    );
}

/// A hand that drums as in its gesture, at any phase and place.
struct Hand {
    gesture: Gesture,
    spread: Gesture,
    header: PoseHeader,
}

impl Hand {
    fn of(character: &Character) -> Self {
        let gesture = |name| {
            let index = character
                .gestures
                .index_of(name)
                .expect("a bundled gesture");
            character.gestures.gestures[index].clone()
        };
        Self {
            gesture: gesture("drum"),
            spread: gesture("splay"),
            header: character.gestures.header.clone(),
        }
    }

    /// With fingers spread.
    fn spread(&self, t: f64) -> PoseSample {
        let mut shown = self.sample(t, 0.0, 1.0, 0.0, 0.0);
        let widest = self.spread.frames.last().expect("frames");
        shown.points = widest.iter().map(|place| Some(*place)).collect();
        shown
    }

    /// At `phase`, drumming at `size`, turned by `yaw` about the vertical and raised by `rise`.
    fn sample(&self, t: f64, phase: f64, size: f64, yaw: f64, rise: f64) -> PoseSample {
        let Gesture {
            frames,
            times_s,
            duration_s,
            ..
        } = &self.gesture;
        let at = duration_s * (phase / TAU).rem_euclid(1.0);
        let before = times_s.partition_point(|time| *time <= at).max(1) - 1;
        let after = (before + 1) % frames.len();
        let next = if after == 0 {
            *duration_s
        } else {
            times_s[after]
        };
        let u = ((at - times_s[before]) / (next - times_s[before]).max(1e-9)).clamp(0.0, 1.0);
        let (sin, cos) = yaw.sin_cos();
        let mean = |point: usize, axis: usize| {
            frames.iter().map(|frame| frame[point][axis]).sum::<f64>() / frames.len() as f64
        };
        let place = |point: usize| {
            let [x, y, z] = [0, 1, 2].map(|axis| {
                let shown =
                    frames[before][point][axis] * (1.0 - u) + frames[after][point][axis] * u;
                mean(point, axis) + size * (shown - mean(point, axis))
            });
            Some([x * cos + z * sin, y + rise, z * cos - x * sin])
        };
        PoseSample {
            t,
            points: (0..self.header.points.len()).map(place).collect(),
            confidence: Vec::new(),
            channels: Vec::new(),
        }
    }
}

/// Poses stop and come back, over and over: what the joints do on the way back.
struct Sweep {
    puppet: Puppet,
    watch: LimitWatch,
    states: Vec<JointState>,
    cycle: u64,
    next_sample_s: f64,
    held_back: u64,
    largest_step_rad: f64,
}

/// Samples per second of the hand.
const HAND_HZ: f64 = 60.0;

impl Sweep {
    fn new(character: &Character, hand: &Hand) -> Self {
        let mut puppet = session::puppet(character, &hand.header, RATE_HZ).expect("a puppet");
        let joints = character.joints.len();
        puppet.begin(Time::ZERO, &vec![0.0; joints]);
        Self {
            puppet,
            watch: LimitWatch::new(&character.limits, 1.0 / RATE_HZ),
            states: vec![JointState::default(); joints],
            cycle: 0,
            next_sample_s: 0.0,
            held_back: 0,
            largest_step_rad: 0.0,
        }
    }

    fn t_s(&self) -> f64 {
        self.cycle as f64 / RATE_HZ
    }

    /// Goes on for `seconds` with poses from `pose` of the time, or with none.
    fn go_on(&mut self, seconds: f64, pose: Option<&dyn Fn(f64) -> PoseSample>) {
        let until = self.t_s() + seconds;
        let mut last = self.puppet.targets().positions.clone();
        while self.t_s() < until {
            let t_s = self.t_s();
            let mut samples = Vec::new();
            while self.next_sample_s <= t_s {
                samples.extend(pose.map(|pose| pose(self.next_sample_s)));
                self.next_sample_s += 1.0 / HAND_HZ;
            }
            let inputs = Inputs {
                samples: &samples,
                states: &self.states,
                finish: false,
            };
            let targets = self.puppet.step(Time::from_secs(t_s), &inputs);
            self.held_back += u64::from(targets.held_back > 0);
            self.watch
                .see(&targets.positions)
                .unwrap_or_else(|e| panic!("at {t_s} s: {e}"));
            for (now, then) in targets.positions.iter().zip(&last) {
                self.largest_step_rad = self.largest_step_rad.max((now - then).abs());
            }
            last.copy_from_slice(&targets.positions);
            self.cycle += 1;
        }
    }
}

/// Every gap at several phases; after it the hand is elsewhere, at another phase, at another tempo.
fn poses_come_back(on_lost: OnLost) {
    let mut character = built_in();
    character.safety.on_lost = on_lost;
    let hand = Hand::of(&character);
    let mut sweep = Sweep::new(&character, &hand);
    let still = |t: f64| hand.sample(t, 0.0, 0.0, 0.0, 0.0);
    sweep.go_on(character.safety.ramp_s + 1.0, Some(&still));
    let (mut offset, mut hz) = (0.0, 0.9);
    let fastest = (character.limits.iter())
        .map(|l| l.velocity)
        .fold(0.0, f64::max);
    let mut case = 0;
    for gap_s in [0.1, 0.25, 0.4, 0.5, 0.6, 0.8, 1.0, 1.3, 2.0, 10.0] {
        for _ in 0..3 {
            case += 1;
            let wave = |t: f64| {
                let (yaw, rise) = (0.25 * f64::from(case % 3 - 1), -0.02 * f64::from(case % 2));
                hand.sample(t, TAU * hz * t + offset, 1.0, yaw, rise)
            };
            sweep.go_on(3.0 + 0.37 * f64::from(case % 3), Some(&wave));
            let walking = sweep.puppet.animator().played()[0].amplitude;
            assert!(
                walking > 0.5,
                "gap {gap_s} s, case {case}: {walking:.2} before"
            );
            let before = sweep.held_back;
            assert_eq!(before, 0, "gap {gap_s} s, case {case}: while drumming");
            sweep.go_on(gap_s, None);
            assert_eq!(
                sweep.held_back, 0,
                "gap {gap_s} s, case {case}: while missing"
            );
            if case % 4 == 0 {
                // Another gesture altogether, and again a gap before the drumming.
                sweep.go_on(2.0, Some(&|t| hand.spread(t)));
                sweep.go_on(gap_s, None);
                assert_eq!(sweep.held_back, 0, "gap {gap_s} s, case {case}: spread");
            }
            // Two fifths of a turn on: three gaps of a length see three phase differences.
            offset += 0.4 * TAU;
            hz = [0.9, 1.4, 1.1][case as usize % 3];
        }
        println!(
            "gap {gap_s} s, on_lost {on_lost:?}: envelope acted {} times; largest step {:.4} rad; {}",
            sweep.held_back,
            sweep.largest_step_rad,
            sweep.watch.extremes()
        );
    }
    let refused = sweep.puppet.rejected_samples();
    println!("samples refused because the whole hand had jumped: {refused}");
    let bound = fastest / RATE_HZ;
    let largest = sweep.largest_step_rad;
    assert!(largest < bound, "largest step {largest} rad, bound {bound}");
    assert_eq!(sweep.held_back, 0, "cycles in which the envelope acted");
}

#[test]
fn poses_that_come_back_after_idling_move_no_joint_faster_than_it_may() {
    poses_come_back(OnLost::Idle);
}

#[test]
fn poses_that_come_back_after_a_hold_move_no_joint_faster_than_it_may() {
    poses_come_back(OnLost::Hold);
}

#[test]
fn poses_that_come_back_held_start_nothing() {
    let character = built_in();
    let hand = Hand::of(&character);
    for gap_s in [0.6, 1.0, 2.0, 10.0] {
        let mut sweep = Sweep::new(&character, &hand);
        let wave = |t: f64| hand.sample(t, TAU * 0.95 * t, 1.0, 0.0, 0.0);
        sweep.go_on(6.0, Some(&wave));
        assert!(
            sweep.puppet.animator().played()[0].amplitude > 0.3,
            "not walking"
        );
        sweep.go_on(gap_s, None);
        let held = |t: f64| hand.sample(t, 1.0, 1.0, 0.0, 0.0);
        let mut most = 0.0_f64;
        for _ in 0..300 {
            sweep.go_on(0.01, Some(&held));
            most = most.max(sweep.puppet.estimates()[0].amplitude);
        }
        println!("gap {gap_s} s, then a held hand: amplitude at most {most:.3}");
        assert!(most < 0.1, "gap {gap_s} s: amplitude {most:.3}");
        let walking = sweep.puppet.animator().played()[0].amplitude;
        assert!(
            walking < 0.01,
            "gap {gap_s} s: still walking at {walking:.3}"
        );
        assert_eq!(sweep.held_back, 0, "gap {gap_s} s");
    }
}

#[test]
fn drops_a_short_hole_and_changing_rates_start_no_transition() {
    let character = built_in();
    let begins_s = character.safety.ramp_s + 0.005;
    let play = |heard: &dyn Fn(u64, f64) -> bool| {
        let mut player = Player::new(&character, begins_s);
        let mut starts = Vec::new();
        while player.t_s() < begins_s + 50.0 {
            let before = player.puppet.animator().transition().is_some();
            let t_s = player.t_s() - begins_s;
            let hears = heard(player.cycle, t_s);
            player.step(hears);
            assert!(!player.puppet.targets().poses_lost, "lost at {t_s} s");
            if !before && player.puppet.animator().transition().is_some() {
                starts.push(t_s);
            }
        }
        (starts, player.puppet.animator().counts())
    };
    let whole = play(&|_, _| true);
    // Every tenth cycle's samples, and 300 ms in the middle of either drumming.
    let lossy = play(&|cycle, t_s| {
        cycle.wrapping_mul(2_654_435_761) % 10 != 3
            && !(8.0..8.3).contains(&t_s)
            && !(16.0..16.3).contains(&t_s)
    });
    // 108 Hz, then 22 Hz, then 54 Hz, all in mid-gesture.
    let uneven = play(&|cycle, t_s| match t_s {
        ..15.0 => true,
        15.0..31.0 => cycle % 5 == 0,
        _ => cycle % 2 == 0,
    });
    println!("at rates that change at {:.2?} s", uneven.0);
    assert_eq!(whole.1, uneven.1, "transitions differ");
    assert_eq!(uneven.0.len(), whole.0.len(), "a transition began");
    println!(
        "transitions begin at {:.2?} s, with drops at {:.2?} s",
        whole.0, lossy.0
    );
    assert!(whole.1.completed > 0, "no transition at all: {:?}", whole.1);
    assert_eq!(whole.1, lossy.1, "transitions differ");
    assert_eq!(lossy.0.len(), whole.0.len(), "a transition began");
}
