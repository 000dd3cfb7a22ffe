//! Gestures defined again while a run goes on: no jump, no allocation, and a bad file changes nothing.

mod support;

use handwave::gesture::{CyclicMarks, FrontEnd, GestureSet, define_cyclic};
use handwave::live::reload::handover;
use handwave::pose::Recording;
use handwave::puppet::{Gestures, Stage};
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Stdio};
use support::character::{Player, RATE_HZ, built_in, performance};
use support::counting::{Counting, calls};
use support::folder::Folder;
use support::limits::LimitWatch;
use support::program::{handwave, refused, run_virtual};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn configs(part: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("configs")
        .join(part)
}

/// The bundled gestures with the drum shown again: its next period, so another phase zero and other frames,
/// and a gesture more.
fn shown_again() -> GestureSet {
    let mut set = GestureSet::load(&configs("gestures/hand.toml")).expect("bundled");
    let (recording, _) = Recording::read(&configs("performances/waiting.csv")).expect("bundled");
    for (name, start_s) in [("drum", 1.3), ("another", 0.9)] {
        let marks = CyclicMarks {
            start_s,
            end_s: None,
        };
        let found = define_cyclic(&set, &recording, name, "again", marks).expect("periodic");
        set.put(found.gesture);
    }
    // The extra gesture moves the thumb sideways, which the drum hardly does.
    let mut extra = set.gestures.pop().expect("three gestures");
    let home = extra.frames[0].clone();
    for (frame, t) in extra.frames.iter_mut().zip(&extra.times_s) {
        frame.clone_from(&home);
        frame[1][0] += 0.03 * (std::f64::consts::TAU * t / extra.duration_s).sin();
    }
    set.gestures.push(extra);
    set
}

#[test]
fn gestures_swapped_in_full_motion_make_no_jump_and_touch_no_memory() {
    let character = built_in();
    let (header, _) = performance(&character);
    let begins_s = character.safety.ramp_s + 0.005;
    let dt_s = 1.0 / RATE_HZ;
    // Where the hand drums at full size, and where it is just about to.
    for swap_s in [9.0, 14.0, 14.317, 16.5] {
        let mut player = Player::new(&character, begins_s);
        let mut always =
            FrontEnd::new(&shown_again(), &header, character.front_options).expect("fits");
        let mut heard: Vec<handwave::pose::PoseSample> = Vec::new();
        let (mut ours, mut loader) = handover(&header);
        let mut watch = LimitWatch::new(&character.limits, dt_s);
        let (mut offered, mut swapped_at) = (false, None);
        let mut touched = Vec::new();
        let (mut worst_step, mut usual_step) = (0.0_f64, 0.0_f64);
        let mut last = player.positions().to_vec();
        let mut last_phase = 0.0;
        let mut last_turned = 0.0;
        let (mut worst_change, mut usual_change) = (0.0_f64, 0.0_f64);
        let mut held_back = 0;
        while player.t_s() < 24.0 {
            let before = calls();
            player.step_after(true, |puppet, samples| ours.cycle(puppet, samples));
            let made = calls() - before;
            // What this cycle was given, for the one that was always there.
            player.due(&mut heard);
            for sample in &heard {
                // One that was given before is refused as not later.
                let _ = always.push(sample);
            }
            if made > 0 && player.cycle > 10 && touched.len() < 5 {
                touched.push((player.cycle, made));
            }
            // The other thread's turn.
            let taken = loader.listen();
            if taken && swapped_at.is_none() {
                swapped_at = Some(player.t_s());
            }
            if !offered && player.t_s() >= swap_s {
                let set = shown_again();
                let front = FrontEnd::new(&set, &header, character.front_options).expect("fits");
                let classes = character.classes.iter().map(|c| c.gesture).collect();
                loader
                    .offer(Box::new(Gestures::new(front, classes)))
                    .expect("nothing under way");
                offered = true;
            }
            watch
                .see(player.positions())
                .unwrap_or_else(|e| panic!("swap at {swap_s} s: {e}"));
            let step = |a: &[f64], b: &[f64]| {
                let pairs = a.iter().zip(b);
                pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
            };
            let now = step(player.positions(), &last);
            let near_swap = swapped_at.is_some_and(|at| player.t_s() - at < 2.0);
            if near_swap {
                worst_step = worst_step.max(now);
            } else {
                usual_step = usual_step.max(now);
            }
            last.copy_from_slice(player.positions());
            let played = player.puppet.animator().played()[0];
            let turned = (played.phase_rad - last_phase + std::f64::consts::PI)
                .rem_euclid(std::f64::consts::TAU)
                - std::f64::consts::PI;
            // How much faster or slower than in the cycle before.
            let change = (turned - last_turned).abs();
            if played.amplitude > 0.1 {
                assert!(turned > 0.0, "the phase ran back at {} s", player.t_s());
                let worst = if near_swap {
                    &mut worst_change
                } else {
                    &mut usual_change
                };
                *worst = worst.max(change);
            }
            last_turned = turned;
            last_phase = played.phase_rad;
            held_back += player.puppet.targets().held_back;
        }
        assert_eq!(ours.swaps(), 1, "swap at {swap_s} s");
        let late = swapped_at.expect("taken over") - swap_s;
        assert!(late < 3.0 * dt_s, "swapped {late} s late");
        assert_eq!(
            touched,
            [],
            "(cycle, calls) to the allocator, swap at {swap_s} s"
        );
        assert_eq!(held_back, 0, "the envelope had to act, swap at {swap_s} s");
        println!(
            "swap at {swap_s} s: joint step {worst_step:.4} rad (elsewhere {usual_step:.4}), change of the phase's advance {worst_change:.5} rad (elsewhere {usual_change:.5})"
        );
        assert!(
            worst_step < 1.25 * usual_step,
            "{worst_step} against {usual_step}"
        );
        assert!(
            worst_change < 1.5 * usual_change,
            "{worst_change} against {usual_change}"
        );
        // Seven seconds on, the new gestures read as if they had always been there.
        assert_eq!(player.puppet.estimates().len(), 3);
        let (new, old) = (player.puppet.front().estimates()[0], always.estimates()[0]);
        let (amplitude, frequency) = (
            (new.amplitude - old.amplitude).abs(),
            (new.frequency_hz - old.frequency_hz).abs(),
        );
        println!("  differs from what was always there by {amplitude:.4}, {frequency:.4} Hz");
        assert!(
            amplitude < 0.05 && frequency < 0.05,
            "{new:?} against {old:?}"
        );
        assert_eq!(player.puppet.stage(), Stage::Playing);
    }
}

#[test]
fn an_offer_waits_for_the_one_before_and_other_classes_are_refused() {
    let character = built_in();
    let (header, _) = performance(&character);
    let mut player = Player::new(&character, 2.005);
    let (mut ours, mut loader) = handover(&header);
    let gestures = |classes: &[Option<usize>]| {
        let classes = classes.to_vec();
        let front = FrontEnd::new(&character.gestures, &header, character.front_options);
        Box::new(Gestures::new(front.expect("fits"), classes))
    };
    // Drumming, drumming in the opposite sense, the splayed hand, and two classes that channels drive.
    let all = [Some(0), Some(0), Some(1), None, None];
    loader.offer(gestures(&all[..1])).expect("the first");
    assert!(loader.offer(gestures(&all)).is_err(), "one is under way");
    player.step_after(true, |puppet, samples| ours.cycle(puppet, samples));
    assert_eq!(ours.swaps(), 0, "one class of five");
    assert!(loader.listen() && !loader.is_busy());
    loader.offer(gestures(&all)).expect("room again");
    player.step_after(true, |puppet, samples| ours.cycle(puppet, samples));
    assert_eq!(ours.swaps(), 1);
}

#[test]
fn watching_what_cannot_change_is_refused() {
    refused(
        handwave(&["run", "--watch", "--headless"]),
        2,
        &["--watch", "copy configs/quadruped.toml"],
    );
    let folder = Folder::of_configs();
    let config = folder.text("quadruped.toml");
    refused(
        run_virtual(&[&config, "--watch"]),
        2,
        &["--watch", "--speed max"],
    );
}

#[test]
fn a_run_loads_changed_gestures_and_keeps_the_old_ones_over_bad_files() {
    let folder = Folder::of_configs();
    let hand = folder.read("gestures/hand.toml");
    let mut child = Command::new(env!("CARGO_BIN_EXE_handwave"))
        .args(["run", &folder.text("quadruped.toml"), "--watch", "--json"])
        .args(["--duration", "100"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut out = BufReader::new(child.stdout.take().expect("piped"));
    let mut err = BufReader::new(child.stderr.take().expect("piped"));
    let mut line = String::new();
    // It runs once it prints its first line; from then on every edit is answered, and the answer waited for.
    out.read_line(&mut line).expect("text");
    assert!(line.contains("rising"), "{line}");
    let mut answered = |expected: &str, edit: &dyn Fn()| {
        edit();
        let mut said = String::new();
        while !said.contains(expected) {
            let before = said.len();
            err.read_line(&mut said).expect("text");
            assert!(said.len() > before, "it ended without {expected:?}: {said}");
        }
        println!("{}", said.trim());
    };
    let changed = |from: &str, to: &str| {
        folder.write("gestures/hand.toml", &hand.replacen(from, to, 1));
    };
    answered("stay as they were", &|| {
        changed("kind = \"cyclic\"", "kind = \"round\"");
    });
    answered("gesture `splay` is gone", &|| {
        changed("name = \"splay\"", "name = \"wink\"");
    });
    answered("gestures reloaded: drum, splay, another", &|| {
        let saved = shown_again().save(&folder.path("gestures/hand.toml"));
        saved.expect("writable");
    });
    let pid = i32::try_from(child.id()).expect("a process id");
    // SAFETY: sends a signal to a child of this process that was not waited for yet.
    #[allow(unsafe_code)]
    let sent = unsafe { libc::kill(pid, libc::SIGINT) };
    assert_eq!(sent, 0);
    let (mut said, mut printed) = (String::new(), String::new());
    err.read_to_string(&mut said).expect("text");
    out.read_to_string(&mut printed).expect("text");
    assert_eq!(child.wait().expect("a child").code(), Some(130), "{said}");
    let last = printed.lines().last().expect("a summary");
    let summary: serde_json::Value = serde_json::from_str(last).expect("one object");
    assert_eq!(summary["ending"], "interrupted", "{summary}");
}
