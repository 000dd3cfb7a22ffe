//! `handwave map` as users call it: refusals, suggestions, learning, applying, the study's ordering.

mod support;

use std::collections::BTreeMap;
use std::path::Path;
use support::folder::Folder;
use support::program::{AT_MOST, Running, handwave, refused};
use support::targets::Targets;

const CLIPS: [&str; 6] = ["keys", "sweep", "reach", "raise", "grip", "stir"];

/// `handwave map learn` for the shipped arm, with the pairs given.
fn learn(folder: &Folder, pairs: &[&str], out: &str) -> Vec<String> {
    let mut args: Vec<String> = ["map", "learn", "--poses"].map(String::from).to_vec();
    args.push(folder.text("performances/vr_dance.csv"));
    args.extend(["--anchor", "head", "--yaw", "false", "--urdf"].map(String::from));
    args.push(folder.text("robots/open_manipulator_x.urdf"));
    for clip in CLIPS {
        args.extend([
            "--clip".into(),
            folder.text(&format!("clips/arm_{clip}.json")),
        ]);
    }
    args.extend(pairs.iter().map(ToString::to_string));
    args.extend(["--out".into(), folder.text(out)]);
    args
}

fn run(args: &[String]) -> support::program::Ended {
    handwave(&args.iter().map(String::as_str).collect::<Vec<_>>())
}

#[test]
fn what_cannot_be_learned_is_refused_by_pair() {
    let folder = Folder::of_configs();
    let no = |pairs: &[&str], parts: &[&str]| {
        refused(run(&learn(&folder, pairs, "no.toml")), 2, parts);
        assert!(!folder.path("no.toml").exists(), "{pairs:?} wrote a map");
    };
    no(&[], &["0 pairs are given"]);
    no(
        &["--pair", "3=arm_keys@0"],
        &["1 pair is given", "map suggest"],
    );
    no(
        &[
            "--pair",
            "3=arm_keys@0",
            "--pair",
            "5=arm_keys@1",
            "--pair",
            "3.001=arm_keys@0.5",
        ],
        &[
            "pair 1 (3 s = arm_keys@0)",
            "pair 3 (3.001 s = arm_keys@0.5)",
            "same source pose",
        ],
    );
    no(
        &["--pair", "99=arm_keys@0", "--pair", "3=arm_keys@1"],
        &["99 s = arm_keys@0", "not in the recording"],
    );
    no(&["--pair", "3:arm_keys@0"], &["write T=CLIP@PHASE"]);
    no(&["--pair", "3=arm_keys"], &["write CLIP@PHASE"]);
    no(&["--pair", "3=arm_keys@1.5"], &["0..1"]);
    no(&["--pair", "3=arm_kees@0"], &["arm_kees", "cannot be read"]);
    no(
        &[
            "--pair",
            "3=arm_keys@0",
            "--pair",
            "5=arm_keys@1",
            "--noise=-1",
        ],
        &["noise_variance", "-1"],
    );
    no(
        &["--pair", "3=arm_keys@0", "--velocity-weight", "-1"],
        &["--velocity-weight"],
    );
    let pairs = folder.write("pairs.txt", "# two\n3 = arm_keys@0\nfive = arm_keys@1\n");
    no(&["--pairs", &pairs], &["pairs.txt:3", "five = arm_keys@1"]);
    // A performer who stands still.
    let still: String = (0..50)
        .map(|k| format!("{},0,1.7,0,0.2,1,0,-0.2,1,0\n", f64::from(k) * 0.02))
        .collect();
    let header = "t,head.x,head.y,head.z,left.x,left.y,left.z,right.x,right.y,right.z\n";
    folder.write("performances/vr_dance.csv", &format!("{header}{still}"));
    no(
        &["--pair", "0.1=arm_keys@0", "--pair", "0.9=arm_keys@1"],
        &["vr_dance.csv", "does not change"],
    );
}

#[test]
fn the_shipped_map_is_what_learn_makes() {
    let folder = Folder::of_configs();
    let shipped = folder.read("maps/arm.toml");
    let pairs = folder.text("maps/arm_pairs.txt");
    let mut args = learn(&folder, &["--pairs", &pairs], "maps/again.toml");
    args.push("--json".into());
    let report = run(&args).expect(0).json();
    assert_eq!(
        folder.read("maps/again.toml"),
        shipped,
        "configs/maps/arm.toml is out of date"
    );
    let kept = report["variance_kept"].as_f64().expect("a number");
    assert!(kept > 0.99, "{kept} of the variance kept");
    let pairs = report["pairs"].as_array().expect("pairs");
    assert!((4..=8).contains(&pairs.len()), "{} pairs", pairs.len());
    for pair in pairs {
        let worst = pair["residual_worst_rad"].as_f64().expect("a number");
        assert!(worst < 0.02, "a pair is missed by {worst} rad: {pair}");
    }
}

#[test]
fn apply_keeps_inside_the_limits_and_meets_the_pairs() {
    let folder = Folder::of_configs();
    let out = folder.text("joints.csv");
    let (map, poses) = (
        folder.text("maps/arm.toml"),
        folder.text("performances/vr_dance.csv"),
    );
    let urdf = folder.text("robots/open_manipulator_x.urdf");
    let args = [
        "map", "apply", "--map", &map, "--poses", &poses, "--out", &out,
    ];
    handwave(&[&args[..], &["--urdf", &urdf]].concat()).expect(0);
    let joints = Targets::read(Path::new(&out));
    assert_eq!(
        joints.joints,
        ["joint1", "joint2", "joint3", "joint4", "gripper"]
    );
    assert_eq!(joints.rows.len(), 1744, "one row per sample");
    // The pair at 5.003 s stands for arm_keys@0.285714.
    let at = joints
        .times
        .iter()
        .position(|t| t.parse::<f64>().expect("a time") >= 5.003);
    let row = &joints.rows[at.expect("a row")];
    for (q, key) in row.iter().zip([-1.1, -0.9, 0.5, 0.5, 0.0]) {
        assert!(
            (q - key).abs() < 0.03,
            "{row:?} at the pair's time, {key} expected"
        );
    }
    handwave(&args).expect(0);
    let without = std::fs::read(&out).expect("written");
    handwave(&args).expect(0);
    assert_eq!(
        std::fs::read(&out).expect("written"),
        without,
        "not the same again"
    );
    refused(
        handwave(&[
            "map", "apply", "--map", &poses, "--poses", &poses, "--out", &out,
        ]),
        2,
        &["vr_dance.csv", "TOML"],
    );
}

#[test]
fn suggestions_move_on_when_a_pair_is_accepted() {
    let folder = Folder::of_configs();
    let (poses, clip) = (
        folder.text("performances/vr_dance.csv"),
        folder.text("clips/arm_keys.json"),
    );
    let base = [
        "map", "suggest", "--poses", &poses, "--anchor", "head", "--yaw", "false", "--clip", &clip,
        "--json",
    ];
    let rows = |more: &[&str]| -> Vec<serde_json::Value> {
        let ended = handwave(&[&base[..], more].concat()).expect(0);
        ended
            .out
            .lines()
            .map(|l| serde_json::from_str(l).expect("JSON"))
            .collect()
    };
    let time = |row: &serde_json::Value| row["t_s"].as_f64().expect("a time");
    let q = |row: &serde_json::Value| row["q"].as_f64().expect("q");
    let first = rows(&["--target", "arm_keys@0"]);
    assert_eq!(first.len(), 5, "{first:?}");
    assert!(
        first.windows(2).all(|pair| q(&pair[0]) >= q(&pair[1])),
        "{first:?}"
    );
    let pair = format!("{}=arm_keys@0", time(&first[0]));
    let second = rows(&["--pair", &pair, "--target", "arm_keys@1"]);
    assert!(
        second
            .iter()
            .all(|row| (time(row) - time(&first[0])).abs() > 0.05),
        "{second:?}"
    );
    assert!(
        q(&second[0]) < q(&first[0]),
        "one pair taught nothing: {second:?}"
    );
    // By itself: the best of each target in turn, the same two.
    let auto = rows(&["--target", "arm_keys@0", "--target", "arm_keys@1", "--auto"]);
    let accepted: Vec<f64> = auto
        .iter()
        .filter(|row| row["accepted"] == true)
        .map(time)
        .collect();
    assert_eq!(accepted, [time(&first[0]), time(&second[0])]);
}

/// The study over the drumming hand, as a user runs it: variant -> pairs -> SNR.
fn study(folder: &Folder, seed: &str, more: &[&str]) -> BTreeMap<(String, u64), f64> {
    let (poses, pairs) = (
        folder.text("performances/drum_and_splay.jsonl"),
        folder.text("maps/drum_pairs.txt"),
    );
    let csv = folder.text("study.csv");
    let args = [
        "map", "study", "--poses", &poses, "--pairs", &pairs, "--csv", &csv, "--seed", seed,
        "--splits", "20",
    ];
    handwave(&[&args[..], more].concat()).expect(0);
    let text = folder.read("study.csv");
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some("variant,pairs,snr_db,deviation_db,splits")
    );
    lines
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let number = |k: usize| cells[k].parse::<f64>().expect("a number");
            assert_eq!(cells[4], "20", "{line}");
            ((cells[0].to_owned(), number(1) as u64), number(2))
        })
        .collect()
}

#[test]
fn the_variants_come_in_the_order_of_the_thesis() {
    let folder = Folder::of_configs();
    let svg = folder.text("study.svg");
    let snr = study(&folder, "1", &["--svg", &svg]);
    let of = |variant: &str, n: u64| snr[&(variant.to_owned(), n)];
    let counts: Vec<u64> = snr
        .keys()
        .filter(|(v, _)| v == "latent")
        .map(|(_, n)| *n)
        .collect();
    assert!(counts.len() >= 6, "{counts:?}");
    let mean =
        |variant: &str| counts.iter().map(|n| of(variant, *n)).sum::<f64>() / counts.len() as f64;
    for variant in [
        "latent",
        "no-velocity",
        "pca",
        "no-pca",
        "polynomial",
        "latent-1",
        "latent-2",
        "latent-4",
    ] {
        let curve: Vec<String> = counts
            .iter()
            .map(|n| format!("{n}: {:.1}", of(variant, *n)))
            .collect();
        println!("{variant:<12} {} dB", curve.join("  "));
    }
    // Figure 8.14: SNR rises with the pairs; velocities help throughout; a polynomial overfits.
    let (few, many) = (counts[0], counts[counts.len() - 1]);
    let gain = of("latent", many) - of("latent", few);
    assert!(
        gain > 6.0,
        "from {few} to {many} pairs only {gain:.2} dB are gained"
    );
    for n in &counts {
        let by = of("latent", *n) - of("no-velocity", *n);
        assert!(by > 0.0, "{n} pairs: velocities change SNR by {by:.2} dB");
    }
    let by = mean("latent") - mean("polynomial");
    assert!(
        by > 0.1,
        "over all numbers of pairs a polynomial costs {by:.2} dB"
    );
    for n in &counts {
        let by = of("latent", *n) - of("polynomial", *n);
        assert!(
            by > -0.3,
            "{n} pairs: a polynomial is better by {:.2} dB",
            -by
        );
    }
    // Figure 8.15: the volume beats plain PCA, most where pairs are few; few axes lose in the end.
    for n in &counts {
        let by = of("latent", *n) - of("pca", *n);
        let least = if *n <= 20 { 0.3 } else { 0.0 };
        assert!(
            by > least,
            "{n} pairs: the volume changes SNR by {by:.2} dB"
        );
    }
    assert!(
        mean("latent") > mean("no-pca") + 3.0,
        "{} dB without PCA",
        mean("no-pca")
    );
    let axes = ["latent-1", "latent-2", "latent-4", "latent"].map(|v| of(v, many));
    assert!(
        axes.windows(2).all(|pair| pair[0] < pair[1]),
        "1, 2, 4, all axes: {axes:?} dB"
    );
    if cfg!(feature = "plot") {
        let picture = folder.read("study.svg");
        assert!(
            picture.contains("<svg") && picture.contains("no-velocity"),
            "{picture:.200}"
        );
    }
}

#[test]
fn a_study_repeats_with_its_seed_and_says_what_it_cannot_do() {
    let folder = Folder::of_configs();
    let counts = ["--counts", "4,8"];
    let first = study(&folder, "5", &counts);
    assert_eq!(first, study(&folder, "5", &counts));
    assert_ne!(first, study(&folder, "6", &counts));
    let poses = folder.text("performances/drum_and_splay.jsonl");
    let pairs = folder.text("maps/drum_pairs.txt");
    let base = ["map", "study", "--poses", &poses];
    let no =
        |more: &[&str], parts: &[&str]| refused(handwave(&[&base[..], more].concat()), 2, parts);
    no(&[], &["0 pairs", "--pairs FILE"]);
    no(&["--pairs", &pairs, "--counts", "49"], &["counts", "49"]);
    no(&["--pairs", &pairs, "--splits", "1"], &["--splits 1"]);
}

#[test]
fn help_has_examples() {
    for command in ["suggest", "learn", "apply", "study"] {
        let ended = Running::start(&["map", command, "--help"])
            .wait(AT_MOST)
            .expect(0);
        assert!(ended.out.contains("Examples:"), "{command}: {}", ended.out);
    }
}
