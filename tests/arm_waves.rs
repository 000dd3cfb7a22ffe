//! The shipped arm that waves, nods and reaches: what its performance shows, and that the height of its
//! hand is the height that is asked for.

mod support;

use handwave::body::{JointSpace, PoseSpace};
use handwave::config::Character;
use handwave::motion::clip::{Clip, ClipFile};
use handwave::motion::inverse::{InverseMap, InverseOptions};
use handwave::puppet::Stage;
use std::path::Path;
use support::character::{Player, RATE_HZ, performance, shipped};
use support::folder::Folder;
use support::program::run_virtual;
use support::targets::Targets;

const CONFIG: &str = "configs/arm_waves.toml";
/// The loop of the drumming lasts 1.05 s at speed 1.
const LOOP_S: f64 = 1.05;
/// Height of the hand at the end of the middle one of the reaches, and from the lowest to the highest, metres.
const MIDDLE_M: f64 = 0.14;
const RANGE_M: f64 = 0.18;

fn character() -> Character {
    let mut all = shipped();
    let at = all.iter().position(|(name, _)| name == "arm_waves.toml");
    all.swap_remove(at.expect(CONFIG)).1
}

/// Height of the hand over the base, metres.
fn hand_m(character: &Character, positions: &[f64]) -> f64 {
    let link = character
        .robot()
        .expect("a robot")
        .link("end_effector_link")
        .expect("a hand");
    character
        .robot()
        .expect("a robot")
        .link_pose(link, positions)
        .translation
        .z
}

/// Frequency of a signal by its first and last rise through its mean, Hz.
fn crossing_hz(signal: &[f64]) -> f64 {
    let mean = signal.iter().sum::<f64>() / signal.len() as f64;
    let rises: Vec<f64> = (signal.windows(2).enumerate())
        .filter(|(_, w)| w[0] < mean && w[1] >= mean)
        .map(|(k, w)| k as f64 + (mean - w[0]) / (w[1] - w[0]))
        .collect();
    assert!(rises.len() > 2, "{} rises", rises.len());
    (rises.len() - 1) as f64 * RATE_HZ / (rises[rises.len() - 1] - rises[0])
}

#[test]
fn it_waves_nods_and_reaches_in_time_with_the_hand() {
    let character = character();
    let folder = Folder::empty();
    let play = |name: &str| {
        let file = folder.text(name);
        let ended = run_virtual(&[CONFIG, "--targets", &file, "--json"]).expect(0);
        let summary = ended.json();
        for quiet in [
            "envelope_cycles",
            "overruns",
            "bus_errors",
            "poses_lost_cycles",
        ] {
            assert_eq!(summary[quiet], 0, "{quiet}: {summary}");
        }
        file
    };
    let (once, again) = (play("once.csv"), play("again.csv"));
    let bytes = |file: &str| std::fs::read(file).expect("just written");
    assert!(bytes(&once) == bytes(&again), "two runs differ");

    let targets = Targets::read(Path::new(&once));
    println!(
        "{}",
        targets.expect_inside(&character.limits, RATE_HZ).extremes()
    );
    let begins_s = character.safety.ramp_s;
    let window = |joint: usize, from_s: f64, to_s: f64| -> Vec<f64> {
        let row = |s: f64| ((begins_s + s) * RATE_HZ) as usize;
        let all: Vec<f64> = targets.joint(joint).collect();
        all[row(from_s)..row(to_s)].to_vec()
    };
    let span = |v: &[f64]| {
        let low = v.iter().copied().fold(f64::INFINITY, f64::min);
        v.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low
    };
    // What is drummed, at which speed of the loop, in which joint it shows, and how far that goes at least
    // and at most, peak to peak.
    for (what, from_s, to_s, speed, joint, other, least, most) in [
        ("slow wave", 6.5, 11.3, 0.735, 0, 3, 0.5, 1.1),
        ("wave", 14.0, 19.3, 1.0, 0, 3, 0.5, 1.1),
        ("fast wave", 22.0, 27.3, 1.575, 0, 3, 0.35, 0.8),
        ("faster, smaller wave", 29.5, 33.3, 1.995, 0, 3, 0.2, 0.6),
        ("nod", 58.0, 62.5, 1.1, 3, 0, 0.5, 0.9),
        ("fast nod", 65.0, 69.5, 1.8, 3, 0, 0.25, 0.6),
    ] {
        let moved = window(joint, from_s, to_s);
        let (hz, drummed_hz) = (crossing_hz(&moved), speed / LOOP_S);
        let (shown, beside) = (span(&moved), span(&window(other, from_s, to_s)));
        println!(
            "{what}: {hz:.4} Hz at {drummed_hz:.4} Hz drummed ({:+.2} %), {shown:.2} rad peak to peak, the other {beside:.2}",
            100.0 * (hz / drummed_hz - 1.0)
        );
        assert!(
            (hz / drummed_hz - 1.0).abs() < 0.01,
            "{what}: {hz:.4} Hz, drummed at {drummed_hz:.4} Hz"
        );
        assert!((least..most).contains(&shown), "{what}: {shown:.3} rad");
        assert!(
            beside < shown,
            "{what}: the other joint moves {beside:.3} rad"
        );
    }
    // A wave is from the side to the side, a nod is not.
    let aside = span(&window(0, 58.0, 69.5));
    assert!(aside < 0.01, "the nod goes {aside:.3} rad to the side");
    // At rest it breathes, a little.
    let breath = span(&window(1, 0.5, 3.5));
    assert!(
        (0.03..0.1).contains(&breath),
        "breathing by {breath:.4} rad"
    );
    // The reach opens the gripper and stretches the upper arm.
    let (upper, gripper) = (span(&window(1, 37.0, 43.0)), span(&window(4, 37.0, 43.0)));
    println!(
        "breathing {breath:.3} rad, reach: upper arm {upper:.2} rad, gripper {gripper:.2} rad"
    );
    assert!(
        upper > 0.5 && gripper > 0.5,
        "reach: {upper:.3} and {gripper:.3} rad"
    );
}

#[test]
fn every_class_is_played_for_seconds() {
    let character = character();
    let mut player = Player::new(&character, character.safety.ramp_s + 0.005);
    let mut moved_s = [0.0; 3];
    let mut held_back = 0;
    while player.step(true) {
        let animator = player.puppet.animator();
        let active = animator.active();
        let played = animator.played()[active];
        held_back += player.puppet.targets().held_back;
        if player.puppet.stage() == Stage::Playing && played.amplitude > 0.2 {
            moved_s[active] += 1.0 / RATE_HZ;
        }
    }
    let names: Vec<&str> = character.classes.iter().map(|c| c.name.as_str()).collect();
    println!("{names:?} moving for {moved_s:.2?} s");
    assert_eq!(names, ["wave", "nod", "reach"]);
    assert!(
        moved_s.iter().all(|s| *s > 2.0),
        "{names:?}: {moved_s:.2?} s"
    );
    assert_eq!(held_back, 0, "the envelope acted");
}

/// The reaches as clips of the arm.
fn reaches(character: &Character, space: &dyn PoseSpace) -> Vec<Clip> {
    assert_eq!(character.joints.len(), space.len());
    (["low", "lower", "mid", "higher", "high"].iter())
        .map(|name| {
            let path = Path::new(env!("CARGO_MANIFEST_DIR"))
                .join(format!("configs/clips/arm_reach_{name}.json"));
            let text = std::fs::read_to_string(path).expect("a clip that ships");
            let file = ClipFile::from_json(&text).expect("a good clip");
            file.for_space(space).expect("a clip of the arm")
        })
        .collect()
}

#[test]
fn the_height_of_the_hand_has_an_inverse_at_every_point_of_the_reach() {
    let character = character();
    let space = JointSpace::of_robot(character.robot().expect("a robot"), false);
    let clips = reaches(&character, &space);
    for progression in [0.25, 0.5, 1.0] {
        let n = space.len();
        let mut poses = vec![0.0; clips.len() * n];
        for (clip, pose) in clips.iter().zip(poses.chunks_mut(n)) {
            clip.pose(progression, pose);
        }
        let mut blended = vec![0.0; n];
        let map = InverseMap::new(clips.len(), 1, InverseOptions::default(), |w, p| {
            space.blend(&poses, w, &mut blended);
            p[0] = hand_m(&character, &blended);
        })
        .expect("heights differ");
        let (low, high) = map.range(0);
        let round = map.round_trip();
        println!(
            "at {progression}: {low:.3} to {high:.3} m, {:?}, round trip {:.4} % of the range on average, {:.4} % at most",
            map.monotone(),
            100.0 * round.mean,
            100.0 * round.max
        );
        assert!(
            (high - low - progression * RANGE_M).abs() < 1e-3,
            "at {progression}: {low} to {high} m"
        );
        assert!(round.max < 0.005, "at {progression}: {round:?}");
    }
}

#[test]
fn the_hand_of_the_arm_is_as_high_as_the_performers() {
    // The splayed hand is held and lifted from 0.05 to 0.27 m, in eight times the time it is held.
    let character = character();
    let (holds_s, ends_s, slower) = (40.2, 42.6, 8.0);
    let held = |t: f64| ((t - holds_s) / (ends_s - holds_s)).clamp(0.0, 1.0);
    // The arm comes out first, then the hand is lifted.
    let lift = |t: f64| ((held(t) - 0.25) / 0.7).clamp(0.0, 1.0);
    let (_, samples) = performance(&character);
    let palm_m = (samples.iter())
        .find(|s| s.t >= holds_s)
        .and_then(|s| s.points[0])
        .expect("a palm")[1];
    let begins_s = character.safety.ramp_s + 0.005;
    let mut player = Player::with(&character, begins_s, |t, sample| {
        // From the waiting hand's height to the start of the lift, while the hand is still closed.
        let begun = ((t - 36.5) / 1.5).clamp(0.0, 1.0);
        let over = 1.0 - ((t - 43.0) / 1.0).clamp(0.0, 1.0);
        let up = begun * over * (0.05 - palm_m + 0.22 * lift(t));
        for point in sample.points.iter_mut().flatten() {
            point[1] += up;
        }
        sample.t += (slower - 1.0) * (ends_s - holds_s) * held(t);
    });
    let height = player
        .puppet
        .front()
        .channel_index("height")
        .expect("height");
    let start_m = hand_m(&character, &[0.0, -0.6, 0.3, 0.5, 0.3]);
    let expected_m = |channel: f64, progression: f64| {
        let parameter = (2.0 * (channel - 0.06) / 0.20 - 1.0).clamp(-1.0, 1.0);
        start_m + progression * (MIDDLE_M + 0.5 * RANGE_M * parameter - start_m)
    };
    let ends_s = begins_s + holds_s + slower * (ends_s - holds_s);
    let mut rows = Vec::new();
    while player.t_s() < ends_s {
        player.step(true);
        if player.t_s() < begins_s + holds_s + 4.5 {
            continue;
        }
        let puppet = &player.puppet;
        assert_eq!(puppet.animator().active(), 2, "at {} s", player.t_s());
        let channel = puppet.front().channel(height);
        let progression = puppet.animator().played()[2].amplitude;
        let at_m = hand_m(&character, player.positions());
        rows.push((channel, progression, at_m));
    }
    let (first, last) = (rows[0], rows[rows.len() - 1]);
    let fallen_m = (rows.windows(2)).fold(0.0, |worst: f64, w| worst.max(w[0].2 - w[1].2));
    // The parameter follows its channel smoothly, a moment late.
    let off_m = |late: usize| {
        (rows.iter().zip(&rows[late..]))
            .map(|(then, now)| (now.2 - expected_m(then.0, now.1)).abs())
            .fold(0.0, f64::max)
    };
    let (late, worst_m) =
        (0..200)
            .map(|late| (late, off_m(late)))
            .fold((0, f64::INFINITY), |best, next| {
                if next.1 < best.1 { next } else { best }
            });
    let (late_s, share) = (late as f64 / RATE_HZ, worst_m / RANGE_M);
    println!(
        "hand at {:.3} to {:.3} m (progression {:.3}), arm's at {:.4} to {:.4} m, {late_s:.2} s late, else at most {:.2} mm off ({:.2} % of the range; {:.2} mm with the delay), never lower by more than {:.4} mm a cycle",
        first.0,
        last.0,
        last.1,
        first.2,
        last.2,
        1e3 * worst_m,
        100.0 * share,
        1e3 * off_m(0),
        1e3 * fallen_m
    );
    assert!(
        last.2 - first.2 > 0.95 * RANGE_M,
        "{} to {} m",
        first.2,
        last.2
    );
    assert!(
        fallen_m < 5e-5,
        "the hand sank by {} mm in a cycle",
        1e3 * fallen_m
    );
    assert!(late_s < 0.5, "{late_s} s late");
    assert!(
        share < 0.04,
        "{:.2} mm off, {:.1} % of the range",
        1e3 * worst_m,
        100.0 * share
    );
}
