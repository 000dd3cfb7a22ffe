//! Which clips belong in one class: real gaits of three bodies, the project's own clips, strangers.
//!
//! These figures set the thresholds of `src/motion/suggest.rs`.

mod support;

use handwave::body::JointSpace;
use handwave::config::{self, Files};
use handwave::motion::clip::ClipFile;
use handwave::motion::suggest::{ClassMismatch, UNRELATED_FROM, check_class, compare, group};
use handwave::motion::warp::{FeatureClip, WarpError, align};
use handwave::robot::RobotModel;
use std::f64::consts::TAU;
use std::path::Path;
use support::data::shared_data;
use support::folder::Folder;
use support::program::{AT_MOST, Ended, Running, refused};

/// A cycle of the DeepMimic family: JSON with "Frames"; after `skip` numbers (time, root) come
/// `columns` joint numbers (quaternions and hinge angles). Twelve of them are four legs.
fn mimic(file: &Path, skip: usize, columns: usize) -> FeatureClip {
    let text = std::fs::read_to_string(file).expect("a motion file");
    let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let mut frames: Vec<Vec<f64>> = (json["Frames"].as_array().expect("frames").iter())
        .map(|row| {
            let row = row.as_array().expect("a row");
            let joints = row[skip..skip + columns].iter();
            joints.map(|v| v.as_f64().expect("a number")).collect()
        })
        .collect();
    // The last frame of a cycle is its first one again.
    frames.pop();
    let name = file.file_stem().expect("a name").to_string_lossy();
    FeatureClip {
        name: name.into_owned(),
        cyclic: true,
        frames,
        duration_s: 1.0,
        limbs: match columns {
            12 => (0..4).map(|l| (3 * l..3 * l + 3).collect()).collect(),
            _ => Vec::new(),
        },
    }
}

/// The clips of `configs/clips` with these names, on the shipped quadruped.
fn shipped(names: &[&str]) -> Vec<FeatureClip> {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let read = |name: String| std::fs::read_to_string(configs.join(name)).expect("shipped");
    let model = RobotModel::from_urdf(&read("robots/pup.urdf".into())).expect("the quadruped");
    let space = JointSpace::of_robot(&model, false);
    (names.iter())
        .map(|name| {
            let file = ClipFile::from_json(&read(format!("clips/{name}.json"))).expect("a clip");
            FeatureClip::from_clip(&file.for_space(&space).expect("its robot"), &space)
        })
        .collect()
}

/// Largest cost within `related` and least cost between those and `strangers`.
fn costs(related: &[FeatureClip], strangers: &[FeatureClip]) -> (f64, f64) {
    let (mut most, mut least): (f64, f64) = (0.0, f64::INFINITY);
    for (i, a) in related.iter().enumerate() {
        for b in &related[i + 1..] {
            let found = compare(a, b).expect("one body");
            println!("  {found}");
            most = most.max(found.cost.expect("both move"));
        }
        for b in strangers {
            let found = compare(a, b).expect("one body");
            println!("  apart: {found}");
            least = least.min(found.cost.expect("both move"));
        }
    }
    (most, least)
}

/// The threshold must part `related` from `strangers` with room on both sides.
#[track_caller]
fn parted(related: &[FeatureClip], strangers: &[FeatureClip]) {
    let (most, least) = costs(related, strangers);
    println!("related up to {most:.3}, strangers from {least:.3}");
    assert!(most < 0.85 * UNRELATED_FROM, "related clips cost {most:.3}");
    assert!(
        least > 1.15 * UNRELATED_FROM,
        "strangers cost only {least:.3}"
    );
    check_class(related).unwrap_or_else(|e| panic!("{e}"));
    let all = [related, strangers].concat();
    let error = check_class(&all)
        .expect_err("strangers among them")
        .to_string();
    assert!(error.contains("do not make one class"), "{error}");
    assert!(error.contains(&strangers[0].name), "{error}");
}

#[test]
fn walk_jog_and_run_of_a_person_are_one_class_jump_and_spin_are_not() {
    let Some(folder) = shared_data("human_joint") else {
        return;
    };
    let clip = |name: &str| mimic(&folder.join(format!("humanoid3d_{name}.txt")), 8, 36);
    parted(
        &["walk", "jog", "run"].map(clip),
        &["jump", "spin"].map(clip),
    );
}

#[test]
fn trot_and_pace_of_a_robot_dog_are_one_class_when_each_leg_is_aligned_on_its_own() {
    let Some(folder) = shared_data("quadruped/a1") else {
        return;
    };
    let clip = |name: &str| mimic(&folder.join(name), 7, 12);
    let gaits = ["trot0.txt", "trot1.txt", "pace0.txt"].map(clip);
    parted(&gaits, &["leftturn0.txt", "jump0.json"].map(clip));
    // As one body they are not: that is what limb timelines are for.
    let whole = compare(&gaits[0], &gaits[2]).expect("one body").whole_cost;
    assert!(whole > Some(1.8 * UNRELATED_FROM), "{whole:?}");
}

#[test]
fn four_gaits_of_another_dog_group_without_its_dances() {
    let Some(folder) = shared_data("quadruped/laikago") else {
        return;
    };
    let clip = |name: &str| mimic(&folder.join(format!("{name}.txt")), 7, 12);
    let gaits = [
        "dog_pace",
        "dog_trot",
        "dog_backwards_pace",
        "dog_backwards_trot",
    ]
    .map(clip);
    let others = ["dog_spin", "runningman", "sidesteps", "turn", "hopturn"].map(clip);
    parted(&gaits, &others);
    let found = group(&[&gaits[..], &others[..]].concat()).expect("one body");
    assert_eq!(found.groups[0], [0, 1, 2, 3], "{:?}", found.groups);
    assert_eq!(found.groups.len(), 6, "{:?}", found.groups);
}

#[test]
fn gaits_of_a_dog_without_named_limbs_are_refused_with_what_to_do() {
    let Some(folder) = shared_data("quadruped/dog3d") else {
        return;
    };
    let clips = ["pace", "canter"].map(|n| mimic(&folder.join(format!("dog3d_{n}.txt")), 8, 76));
    let error = check_class(&clips)
        .expect_err("legs out of step")
        .to_string();
    println!("{error}");
    assert!(
        error.contains("\"segments\"") && error.contains("warp cost 0."),
        "{error}"
    );
}

#[test]
fn the_shipped_gaits_are_one_class_with_the_stand_and_others_are_not() {
    let gaits = shipped(&[
        "stand",
        "walk_short",
        "walk_long",
        "trot_short",
        "trot_long",
    ]);
    let report = check_class(&gaits).expect("the shipped class");
    println!("worst {:.3}", report.worst);
    assert!(report.worst < 0.05, "worst pair costs {:.3}", report.worst);
    let mixed = shipped(&["trot_long", "bow", "heading"]);
    let Err(ClassMismatch::Unrelated { groups, .. }) = check_class(&mixed) else {
        panic!("three kinds of motion made one class");
    };
    assert_eq!(groups.len(), 3, "{groups:?}");
}

#[test]
fn legs_of_the_shipped_trot_are_where_the_gait_says_against_the_walk() {
    let clips = shipped(&["walk_long", "trot_long"]);
    let found = align(&clips).expect("two gaits");
    assert_eq!(found.limb_reference, 0, "the walk is slower");
    // Touch-down against the walk's: front legs 1/4 later, hind legs at the same phase. Derivatives
    // align the middles of the swings, which lie half the difference of the duties (0.15) earlier.
    let offsets: Vec<f64> = found.clips[1]
        .limb_offsets
        .iter()
        .flatten()
        .copied()
        .collect();
    println!("{offsets:.3?}");
    for (offset, truth) in offsets.iter().zip([0.25, 0.25, 0.0, 0.0]) {
        let error = offset - (truth - 0.075);
        assert!(error.abs() < 0.02, "{offset:.3} for {truth} - 0.075");
    }
    assert_eq!(offsets.len(), 4);
}

#[test]
fn a_rotated_and_bent_cycle_comes_back_within_one_frame() {
    // A cycle with two harmonics; the second clip starts elsewhere and hurries in mid-cycle.
    let frames = |time: &dyn Fn(f64) -> f64, size: f64| -> Vec<Vec<f64>> {
        (0..64)
            .map(|k| {
                let p = TAU * time(f64::from(k) / 64.0);
                vec![
                    size * p.sin(),
                    size * p.cos(),
                    0.5 * size * (2.0 * p + 0.4).sin(),
                ]
            })
            .collect()
    };
    let clip = |name: &str, frames| FeatureClip {
        name: name.into(),
        cyclic: true,
        frames,
        duration_s: 1.0,
        limbs: Vec::new(),
    };
    let bent = |t: f64| t + 0.3 + 0.04 * (TAU * t).sin();
    let clips = [
        clip("even", frames(&|t| t, 1.0)),
        clip("bent", frames(&bent, 0.6)),
    ];
    let found = align(&clips).expect("two cycles");
    let (from, to) = (found.reference, 1 - found.reference);
    let aligned = &found.clips[to];
    let mut worst: f64 = 0.0;
    for k in 0..64 {
        let s = f64::from(k) / 64.0;
        let t = aligned.offset_cycles + aligned.warp.at(s);
        let (a, b) = if from == 0 {
            (s, bent(t))
        } else {
            (bent(s), t)
        };
        let error = (a - b + 0.5).rem_euclid(1.0) - 0.5;
        worst = worst.max(64.0 * error.abs());
    }
    println!("{worst:.2} frames off");
    assert!(worst < 1.0, "{worst:.2} frames off");
    assert!(aligned.cost < 0.01, "cost {}", aligned.cost);
}

#[test]
fn clips_that_cannot_be_compared_are_refused_by_name() {
    let good = shipped(&["trot_long", "walk_long", "bow"]);
    let mut bad = good[..2].to_vec();
    bad[1].frames[5][2] = f64::NAN;
    let nan = check_class(&bad).expect_err("not a number").to_string();
    assert!(nan.contains("walk_long, frame 5, feature 2"), "{nan}");
    bad[1].frames.truncate(1);
    let short = check_class(&bad).expect_err("one frame").to_string();
    assert!(short.contains("walk_long has 1 frames"), "{short}");
    let mut narrow = good[..2].to_vec();
    narrow[1].frames[0].pop();
    let narrow = check_class(&narrow).expect_err("another body").to_string();
    assert!(narrow.contains("all clips need the same body"), "{narrow}");
    assert_eq!(align(&[]), Err(WarpError::Empty));
    let kinds = align(&[good[0].clone(), good[2].clone()]).expect_err("cycle and path");
    assert!(matches!(kinds, WarpError::MixedKinds { .. }), "{kinds}");
    println!("{kinds}");
}

const GAITS: [&str; 7] = [
    "stand",
    "walk_short",
    "walk_long",
    "trot_short",
    "trot_long",
    "bow",
    "heading",
];

/// `handwave graph build` on clips of a copy of `configs`, run from there.
fn build(folder: &Folder, clips: &[&str], more: &[&str]) -> Ended {
    let files: Vec<String> = clips.iter().map(|c| format!("clips/{c}.json")).collect();
    let mut args = vec!["graph", "build", "--clips"];
    args.extend(files.iter().map(String::as_str));
    args.extend(["--urdf", "robots/pup.urdf"]);
    args.extend(more);
    Running::start_in(&folder.path("."), &args).wait(AT_MOST)
}

#[test]
fn graph_build_prints_classes_that_a_character_can_be_given() {
    let folder = Folder::of_configs();
    let json = build(&folder, &GAITS, &["--json"]).expect(0).json();
    let classes = json["classes"].as_array().expect("classes");
    assert_eq!(classes.len(), 3, "gaits, bow, heading: {json:#}");
    let gaits = &classes[0];
    assert_eq!(gaits["clips"].as_array().map(Vec::len), Some(5));
    assert_eq!(gaits["problem"], serde_json::Value::Null);
    let trot = &gaits["clips"][4];
    let turn = trot["limb_offsets_cycles"]["front_left"]
        .as_f64()
        .expect("it moves");
    assert!(
        (turn - 0.175).abs() < 0.02,
        "front legs {turn} cycles later"
    );
    // Pasted in the place of the shipped class, with a gesture and the name that edges use.
    let pasted = gaits["toml"].as_str().expect("text");
    let pasted = pasted.replace("\"NAME\"", "\"drum\"");
    let own = format!("name = {}", gaits["name"]);
    let pasted = pasted.replacen(&own, "name = \"locomotion\"", 1);
    let text = folder.read("quadruped.toml");
    let from = text.find("[[class]]").expect("a class");
    let to = from + text[from..].find("\n]\n").expect("its end") + 3;
    folder.write(
        "quadruped.toml",
        &format!("{}{pasted}{}", &text[..from], &text[to..]),
    );
    config::load(Files::Folder(folder.path(".")), "quadruped.toml")
        .unwrap_or_else(|e| panic!("{e}\n{pasted}"));
}

#[test]
fn graph_build_shows_groups_figures_and_plots() {
    let folder = Folder::of_configs();
    let shown = build(&folder, &GAITS, &["--out", "plots"]).expect(0).out;
    for part in [
        "(cycles, 5 clips)",
        "bow and heading: warp cost",
        "[[class]]",
        ".svg",
    ] {
        assert!(shown.contains(part), "no {part:?} in {shown}");
    }
    let plots = std::fs::read_dir(folder.path("plots")).expect("a folder of plots");
    let plot = plots.flatten().next().expect("one class has several clips");
    let svg = std::fs::read_to_string(plot.path()).expect("text");
    assert!(
        svg.starts_with("<svg") && svg.contains("walk_long"),
        "{svg:.200}"
    );
}

#[test]
fn graph_build_refuses_what_is_no_clip_of_this_body() {
    let folder = Folder::of_configs();
    let strange = build(&folder, &["trot_long", "arm_fold"], &[]);
    refused(strange, 2, &["clips/arm_fold.json", "front_left_hip"]);
    refused(
        build(&folder, &["nothing"], &[]),
        2,
        &["cannot read clips/nothing.json"],
    );
    folder.write("clips/broken.json", "{}");
    refused(
        build(&folder, &["broken"], &[]),
        2,
        &["clips/broken.json", "not a clip"],
    );
    let text = folder
        .read("clips/trot_long.json")
        .replace("\"version\": 1", "\"version\": 9");
    folder.write("clips/newer.json", &text);
    refused(
        build(&folder, &["newer"], &[]),
        2,
        &["clips/newer.json", "version"],
    );
}
