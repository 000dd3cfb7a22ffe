//! The whole performance through the program in virtual time: what comes out, and how it bears disturbance.

mod support;

use handwave::config::Character;
use std::sync::OnceLock;
use support::character::built_in;
use support::folder::Folder;
use support::limits::LimitWatch;
use support::program::{AT_MOST, Ended, Running, handwave};
use support::recipe;
use support::spectrum::dominant_hz;
use support::targets::Targets;

const VIRTUAL: [&str; 5] = ["run", "--headless", "--speed", "max", "--json"];

/// A run in virtual time and its targets.
struct Run {
    ended: Ended,
    summary: serde_json::Value,
    targets: Targets,
    file: Vec<u8>,
}

/// Runs with extra arguments, expecting exit code 0.
#[track_caller]
fn run(more: &[&str]) -> Run {
    run_for(more, &[0])
}

#[track_caller]
fn run_for(more: &[&str], codes: &[i32]) -> Run {
    let folder = Folder::empty();
    let file = folder.path("a.csv");
    let mut args = VIRTUAL.to_vec();
    args.extend(["--targets", "a.csv"]);
    args.extend(more);
    let ended = Running::start_in(&folder.path(""), &args).wait(AT_MOST);
    let code = ended.code.unwrap_or_else(|| panic!("{more:?}: {ended:?}"));
    assert!(codes.contains(&code), "{more:?}: {ended:?}");
    assert!(!ended.err.contains("panicked"), "{more:?}: {ended:?}");
    Run {
        summary: ended.json(),
        targets: Targets::read(&file),
        file: std::fs::read(&file).expect("the targets"),
        ended,
    }
}

/// The whole performance, run once.
fn whole() -> &'static Run {
    static WHOLE: OnceLock<Run> = OnceLock::new();
    WHOLE.get_or_init(|| run(&[]))
}

fn character() -> &'static Character {
    static CHARACTER: OnceLock<Character> = OnceLock::new();
    CHARACTER.get_or_init(built_in)
}

/// Rows of the run while the stream's clock is in `from_s..to_s`.
fn rows_at(targets: &Targets, from_s: f64, to_s: f64) -> &[Vec<f64>] {
    // Playing begins after the ramp, the stream one cycle later.
    let begins_s = character().safety.ramp_s + 0.005;
    let row = |t: f64| (((t + begins_s) / 0.005).round() as usize).min(targets.rows.len());
    &targets.rows[row(from_s)..row(to_s)]
}

#[track_caller]
fn inside(targets: &Targets, rate_hz: f64) -> LimitWatch {
    targets.expect_inside(&character().limits, rate_hz)
}

fn moving_joints_of_urdf() -> Vec<String> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/robots/pup.urdf");
    let text = std::fs::read_to_string(path).expect("the URDF");
    let joints = text.split("<joint name=\"").skip(1);
    joints
        .filter(|joint| {
            joint.contains("type=\"revolute\"") && joint.find("type=") < joint.find('>')
        })
        .filter_map(|joint| joint.split_once('"'))
        .filter(|(_, rest)| rest.trim_start().starts_with("type=\"revolute\""))
        .map(|(name, _)| name.to_owned())
        .collect()
}

fn assert_times(targets: &Targets, dt_s: f64) {
    for (row, text) in targets.times.iter().enumerate() {
        let decimals = text.split_once('.').map_or(0, |(_, d)| d.len());
        assert!(decimals >= 4, "row {row}: {text} has {decimals} decimals");
        let t: f64 = text.parse().expect("a time");
        let due = row as f64 * dt_s;
        assert!((t - due).abs() < 1e-9, "row {row}: t = {t}, due {due}");
    }
}

#[test]
fn one_row_per_cycle_with_joints_named_as_in_the_urdf() {
    let targets = &whole().targets;
    assert_eq!(targets.joints, moving_joints_of_urdf());
    assert_eq!(targets.joints.len(), 12);
    assert_times(targets, 0.005);
    let cycles = whole().summary["cycles"].as_u64();
    assert_eq!(cycles, Some(targets.rows.len() as u64));
    let seconds = targets.rows.len() as f64 * 0.005;
    let performed = recipe::segments().last().map_or(0.0, |s| s.to_s);
    assert!(
        seconds > performed && performed >= 40.0,
        "{seconds} s run of {performed} s performed"
    );
}

#[test]
fn the_same_bytes_again_from_another_folder() {
    // Every run has a temporary folder of its own, so nothing but the program itself is read.
    let again = run(&[]);
    assert_eq!(again.file.len(), whole().file.len(), "file sizes differ");
    let first = again
        .file
        .iter()
        .zip(&whole().file)
        .position(|(a, b)| a != b);
    assert_eq!(first, None, "first differing byte");
}

#[test]
fn targets_keep_inside_position_speed_and_acceleration() {
    let watch = inside(&whole().targets, 200.0);
    println!("extremes: {}", watch.extremes());
    // A robot that hardly moves would be inside too.
    assert!(watch.speed.share > 0.2, "{}", watch.extremes());
}

#[test]
fn the_summary_is_clean() {
    let s = &whole().summary;
    for quiet in [
        "envelope_cycles",
        "overruns",
        "bus_errors",
        "missed_cycles",
        "samples_refused",
        "poses_lost_cycles",
        "records_lost",
    ] {
        assert_eq!(s[quiet], 0, "{quiet}: {s}");
    }
    assert_eq!(s["ending"], "performance complete");
    assert!(s["transitions"].as_u64() >= Some(2), "{s}");
    assert_eq!(s["faults"].as_array().map(Vec::len), Some(0), "{s}");
    let off = s["torque_off"].as_array().map(Vec::len);
    assert_eq!(off, Some(12), "torque confirmed off: {s}");
    assert_eq!(
        s["torque_unconfirmed"].as_array().map(Vec::len),
        Some(0),
        "{s}"
    );
}

#[test]
fn legs_move_at_the_frequency_of_the_drumming() {
    const EVERY: usize = 5;
    let mut report = String::new();
    let mut off = Vec::new();
    for segment in recipe::drumming() {
        // A period or two until the wave is known, as much until the legs are in step with it.
        let from_s = segment.joined_s + 2.5;
        let rows = rows_at(&whole().targets, from_s, segment.to_s);
        let signals: Vec<Vec<f64>> = (0..12)
            .map(|joint| rows.iter().step_by(EVERY).map(|r| r[joint]).collect())
            .collect();
        let drummed = segment.frequency_hz;
        let played = dominant_hz(&signals, 200.0 / EVERY as f64, (0.3, 4.0));
        let error = 100.0 * (played / drummed - 1.0);
        report += &format!(
            "{from_s:.1}..{:.1} s: drummed {drummed:.3} Hz, legs {played:.3} Hz, {error:+.2} %\n",
            segment.to_s
        );
        if error.abs() > 3.0 {
            off.push(drummed);
        }
    }
    println!("{report}");
    assert!(recipe::drumming().len() >= 4, "{report}");
    assert!(off.is_empty(), "beyond 3 %:\n{report}");
}

#[test]
fn it_bows_while_the_hand_is_splayed_and_ends_lying() {
    let targets = &whole().targets;
    let held = recipe::segments()
        .into_iter()
        .rfind(|s| s.kind == "hold" && s.source == "splay")
        .expect("a held splay");
    let bowed = rows_at(targets, held.to_s - 0.5, held.to_s)
        .last()
        .expect("rows");
    let stand = &rows_at(targets, 0.0, 0.1)[0];
    let difference = |a: &[f64], b: &[f64]| {
        a.iter()
            .zip(b)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max)
    };
    let front_and_rear = (bowed[2] - bowed[8]).abs();
    let way = difference(bowed, stand);
    assert!(
        way > 0.25 && front_and_rear > 0.2,
        "splay held: {way:.3} rad from standing, front and rear knee {front_and_rear:.3} rad apart"
    );
    let last = targets.rows.last().expect("rows");
    let lie = character().end_pose.as_ref().expect("an end pose");
    let left = difference(last, lie);
    assert!(left < 1e-6, "the end is {left} rad from lying");
    println!(
        "bow {way:.3} rad from standing, knees {front_and_rear:.3} rad apart; end {left:.1e} rad from lying"
    );
}

#[test]
fn a_set_duration_ends_the_run_lying_with_torque_off() {
    let folder = Folder::of_configs();
    folder.edit("quadruped.toml", "baud = 1000000", "baud = 3000000");
    let fast_line = folder.text("quadruped.toml");
    for (rate, config) in [(100.0, None), (400.0, Some(&fast_line))] {
        let rate_text = rate.to_string();
        let mut args = vec!["--duration", "4", "--rate", &rate_text];
        args.extend(config.map(String::as_str));
        let run = run(&args);
        assert_times(&run.targets, 1.0 / rate);
        let watch = inside(&run.targets, rate);
        let seconds = run.targets.rows.len() as f64 / rate;
        // Settling, 1.5 s down, 0.3 s at rest.
        assert!(
            (5.5..10.0).contains(&seconds),
            "{rate} Hz: {seconds} s, {}",
            watch.extremes()
        );
        let s = &run.summary;
        let off = s["torque_off"].as_array().map(Vec::len);
        assert_eq!(off, Some(12), "{rate} Hz: {s}");
        assert_eq!(s["overruns"], 0, "{rate} Hz: {s}");
        assert_eq!(s["bus_errors"], 0, "{rate} Hz: {s}");
    }
}

#[test]
fn a_line_too_slow_for_the_rate_is_said_and_motion_keeps_its_time() {
    // Twelve servos take 2.76 ms at 1 Mbaud, a cycle 2.5 ms.
    let run = run(&["--duration", "4", "--rate", "400"]);
    assert_times(&run.targets, 0.0025);
    inside(&run.targets, 400.0);
    let late = run.summary["overruns"].as_u64();
    assert!(late > Some(100), "overruns: {}", run.summary);
}

#[test]
fn a_servo_that_is_silent_for_a_second_is_named_and_nothing_else_changes() {
    let run = run(&["--fault", "7:silent@8.0s..9.0s", "--duration", "11"]);
    let faults = run.summary["faults"].as_array().expect("faults");
    assert!(!faults.is_empty(), "{}", run.ended.out);
    let time = |fault: &serde_json::Value, key: &str| fault[key].as_f64().unwrap_or(f64::NAN);
    for fault in faults {
        assert_eq!(fault["servo"], 7, "{fault}");
        assert_eq!(fault["joint"], "rear_left_hip", "{fault}");
    }
    let from = time(&faults[0], "from_s");
    let to = time(&faults[faults.len() - 1], "to_s");
    assert!(
        (7.99..8.02).contains(&from),
        "silent at 8 s, seen at {from} s"
    );
    assert!((8.98..9.1).contains(&to), "back at 9 s, seen at {to} s");
    // Compared up to the set duration, from where this run goes its own way.
    let common = (11.0 / 0.005) as usize;
    for (row, (with, without)) in run
        .targets
        .rows
        .iter()
        .zip(&whole().targets.rows)
        .take(common)
        .enumerate()
    {
        for joint in (0..12).filter(|joint| *joint != 6) {
            assert_eq!(with[joint], without[joint], "row {row}, joint {joint}");
        }
    }
}

/// The legs walk from about 6 s on.
#[test]
fn every_servo_fault_is_borne() {
    let list = handwave(&["sim", "dynamixel", "--list-faults"]).expect(0);
    let of = |scope: &str| -> Vec<String> {
        let words = list.out.lines().map(|l| l.split(' ').collect::<Vec<_>>());
        words
            .filter(|w| w[1] == scope)
            .map(|w| w[0].to_owned())
            .collect()
    };
    let servo_faults = of("servo");
    assert!(servo_faults.len() >= 12, "{servo_faults:?}");
    let mut report = String::new();
    for name in servo_faults {
        let spec = format!("5:{name}@6.5s..7.2s");
        let run = run_for(&["--fault", &spec, "--duration", "8.5"], &[0, 3, 4]);
        let watch = inside(&run.targets, 200.0);
        report += &format!(
            "{spec}: exit {:?}, {} faults, {}\n",
            run.ended.code,
            run.summary["faults"].as_array().map_or(0, Vec::len),
            watch.extremes()
        );
    }
    println!("{report}");
}

#[test]
fn a_noisy_line_is_borne() {
    let noise = [
        "corrupt=0.02",
        "truncated",
        "duplicated",
        "foreign",
        "noise",
        "echo",
    ];
    for name in noise {
        let spec = format!("bus:{name}@6.5s..7.5s");
        let run = run_for(&["--fault", &spec, "--duration", "8.5"], &[0, 3, 4]);
        let watch = inside(&run.targets, 200.0);
        println!(
            "{spec}: exit {:?}, {} bus errors, {}",
            run.ended.code,
            run.summary["bus_errors"],
            watch.extremes()
        );
    }
}

#[test]
fn an_unplugged_adapter_ends_the_run_with_a_clear_message() {
    let run = run_for(&["--fault", "bus:unplugged@3s"], &[3]);
    let message = &run.ended.err;
    assert!(
        message.starts_with("handwave: ") && message.contains("unplugged"),
        "{message}"
    );
    let rows = run.targets.rows.len();
    assert!(
        (599..=602).contains(&rows),
        "{rows} cycles, unplugged at 600"
    );
    assert_eq!(run.summary["ending"], "bus failure");
}
