//! Limb timelines: a walk blended into a gallop, with legs that keep their own time and without.

mod support;

use handwave::body::{Feet, JointSpace, PoseSpace, RobotFeet, RootPose};
use handwave::motion::analysis::{BodyModel, analyse, cut};
use handwave::motion::blending::{Blended, Pair};
use handwave::motion::class::{ClassOptions, Drive, Example, MotionClass};
use handwave::motion::clip::{Clip, ClipFile};
use handwave::motion::import::{ImportOptions, open};
use handwave::motion::metrics::{FootSlide, Hanging, foot_slide, hanging_share};
use handwave::motion::range::JointRange;
use handwave::robot::{Leg, RobotModel};
use nalgebra::Point3;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use support::data::shared_data;
use support::folder::Folder;
use support::program::{handwave, refused};

fn config(part: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("configs")
        .join(part)
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn pup_body() -> (JointSpace, RobotFeet) {
    let model = RobotModel::from_urdf(&read(&config("robots/pup.urdf"))).expect("pup");
    let (legs, _) = Leg::find_all_facing(&model, None).expect("legs");
    (
        JointSpace::of_robot(&model, true),
        RobotFeet::new(model, legs),
    )
}

fn shipped_clip(space: &dyn PoseSpace, name: &str) -> Clip {
    let file = ClipFile::from_json(&read(&config(&format!("clips/{name}.json")))).expect("a clip");
    file.for_space(space).expect("a clip of the body")
}

/// The blends at a quarter, half and three quarters (eighths where `fine`): with timelines, without.
fn study(pair: &Pair<'_>, fine: bool) -> Vec<[Blended; 2]> {
    let steps = pair.steps().expect("two gaits");
    let count = if fine { 8 } else { 4 };
    println!("{} to {}", pair.clips[0].name, pair.clips[1].name);
    (1..count)
        .map(|k| {
            let weight = f64::from(k) / f64::from(count);
            let row = [true, false].map(|t| pair.blend(weight, t, &steps).expect("a blend"));
            let [with, without] = &row;
            println!(
                "  {weight:.3}: slide {:.2} with, {:.2} mm without: {:.1} times, hanging {:.1} and {:.1} %",
                1e3 * with.slide_m,
                1e3 * without.slide_m,
                without.slide_m / with.slide_m,
                100.0 * with.hanging,
                100.0 * without.hanging,
            );
            row
        })
        .collect()
}

/// Fails unless timelines make the slide `times` lower at every weight, and legs hang no more.
#[track_caller]
fn expect_lower(rows: &[[Blended; 2]], times: f64) {
    for [with, without] in rows {
        assert!(
            without.slide_m > times * with.slide_m,
            "at {:.3}: {:.2} mm with timelines, {:.2} mm without: not {times} times",
            with.weight,
            1e3 * with.slide_m,
            1e3 * without.slide_m
        );
        assert!(
            with.hanging < without.hanging + 0.02,
            "at {:.3}: legs hang {:.3} of the time with timelines, {:.3} without",
            with.weight,
            with.hanging,
            without.hanging
        );
    }
}

#[test]
fn without_timelines_clips_blend_at_the_common_phase() {
    let (space, _) = pup_body();
    let clips = ["walk_long", "gallop"].map(|name| shipped_clip(&space, name));
    let mut class = class_of(&space, &clips, 0.0);
    let (mut pose, mut phase, dt_s) = (vec![0.0; space.len()], 0.0, 0.005);
    let mut farthest: f64 = 0.0;
    for k in 0..2000 {
        phase = (phase + TAU * 1.3 * dt_s).rem_euclid(TAU);
        let drive = Drive {
            amplitude: 1.0,
            frequency_hz: 1.3,
            phase_rad: phase,
            ..Drive::default()
        };
        let played = class.step(&space, drive, dt_s, &mut pose);
        if k < 1000 {
            continue;
        }
        let mut poses = vec![0.0; 2 * space.len()];
        for (clip, pose) in clips.iter().zip(poses.chunks_mut(space.len())) {
            clip.pose(played.phase_rad / TAU, pose);
        }
        let weights = &class.weights()[1..];
        let mut wanted = vec![0.0; space.len()];
        space.blend(&poses, weights, &mut wanted);
        let apart = |(a, b): (&f64, &f64)| (a - b).abs();
        farthest = pose.iter().zip(&wanted).map(apart).fold(farthest, f64::max);
    }
    assert!(
        farthest < 1e-9,
        "{farthest} rad from the blend at one phase"
    );
}

#[test]
fn clips_that_stand_as_long_slide_five_times_less_with_timelines() {
    let (space, feet) = pup_body();
    // Duties of 0.5 and 0.45; walk and gallop of one duty, the gallop authored anew for it.
    let folder = Folder::empty();
    let file = folder.text("gallop.json");
    let urdf = config("robots/pup.urdf");
    handwave(&[
        "clip",
        "gait",
        "--urdf",
        urdf.to_str().expect("a plain path"),
        "--gait",
        "gallop",
        "--duty",
        "0.65",
        "--stride",
        "0.07",
        "--frequency",
        "1.2",
        "--lift",
        "0.014",
        "--height",
        "0.15",
        "--out",
        &file,
    ])
    .expect(0);
    let long = ClipFile::from_json(&read(Path::new(&file))).expect("a clip");
    let long = long.for_space(&space).expect("a clip of the pup");
    let [walk, trot, gallop] =
        ["walk_long", "trot_long", "gallop"].map(|c| shipped_clip(&space, c));
    for clips in [[&walk, &long], [&trot, &gallop]] {
        let pair = Pair {
            space: &space,
            feet: &feet,
            clips,
        };
        expect_lower(&study(&pair, true), 5.0);
    }
}

#[test]
fn walk_and_gallop_as_shipped() {
    let (space, feet) = pup_body();
    let clips = ["walk_long", "gallop"].map(|name| shipped_clip(&space, name));
    let pair = Pair {
        space: &space,
        feet: &feet,
        clips: [&clips[0], &clips[1]],
    };
    let rows = study(&pair, true);
    // The walk has a foot on the ground for 0.65 of the cycle, the gallop for 0.45. Timelines make them
    // touch down together; while the walk's share is the larger, the gallop lifts the foot early, and it
    // slides by its share of that fifth of the cycle.
    expect_lower(&rows, 2.0);
    expect_lower(&rows[3..], 5.0);
    let mean = |way: usize| rows.iter().map(|r| r[way].slide_m).sum::<f64>() / rows.len() as f64;
    let times = mean(1) / mean(0);
    println!(
        "over all weights {:.2} and {:.2} mm: {times:.1} times",
        1e3 * mean(0),
        1e3 * mean(1)
    );
    assert!(times > 4.0, "{times:.2} times over all weights");
}

/// Rest and two gaits as a class, at the tempi of a walk and a gallop; its joints without limits.
fn class_of(space: &dyn PoseSpace, clips: &[Clip; 2], limb_advance: f64) -> MotionClass {
    let examples = [
        (shipped_clip(space, "stand"), [0.0, 0.0]),
        (clips[0].clone(), [1.0, 0.8]),
        (clips[1].clone(), [1.0, 1.8]),
    ];
    let examples = examples.map(|(clip, parameters)| Example {
        clip,
        parameters: parameters.into(),
    });
    let options = ClassOptions {
        limb_advance,
        ..ClassOptions::default()
    };
    let unlimited = JointRange {
        velocity: 1e9,
        acceleration: 1e9,
    };
    MotionClass::new(
        "gaits",
        examples.into(),
        vec![unlimited; space.len()],
        options,
    )
    .expect("a class")
}

/// Walks for 3 s, speeds up in 6 s to the tempo in the middle, holds it for 6 s and speeds up to the
/// gallop in 6 s: slide of all feet and share of the time in which legs hang, held and over all.
fn sweep(limb_advance: f64) -> [(f64, f64); 2] {
    let (space, feet) = pup_body();
    let clips = ["walk_long", "gallop"].map(|name| shipped_clip(&space, name));
    let mut class = class_of(&space, &clips, limb_advance);
    let limbs: Vec<usize> = (0..feet.count())
        .map(|f| {
            class
                .limbs()
                .iter()
                .position(|l| l == feet.name(f))
                .expect("a leg")
        })
        .collect();
    let (dt_s, mut phase) = (0.0025, 0.0);
    let (mut root, mut pose) = (RootPose::default(), vec![0.0; space.len()]);
    let mut samples: Vec<Vec<(Point3<f64>, bool)>> = vec![Vec::new(); feet.count()];
    let mut speed_m_s = Vec::new();
    for k in 0..(24.0 / dt_s) as usize {
        let t = k as f64 * dt_s;
        let ramp = |from: f64| ((t - from) / 6.0).clamp(0.0, 1.0);
        let frequency_hz = 0.8 + 0.5 * ramp(3.0) + 0.5 * ramp(15.0);
        phase = (phase + TAU * frequency_hz * dt_s).rem_euclid(TAU);
        let drive = Drive {
            amplitude: 1.0,
            frequency_hz,
            phase_rad: phase,
            ..Drive::default()
        };
        let played = class.step(&space, drive, dt_s, &mut pose);
        root.travel(played.root_velocity.scaled(dt_s));
        speed_m_s.push(played.root_velocity.forward_m);
        for (foot, samples) in samples.iter_mut().enumerate() {
            let on = class.contact(limbs[foot]) >= 0.499;
            samples.push((root.to_world(feet.position(&pose, foot)), on));
        }
    }
    [(9.0, 15.0), (3.0, 24.0)].map(|(from, to)| {
        let rows = (from / dt_s) as usize..(to / dt_s) as usize;
        let speed = speed_m_s[rows.clone()].iter().sum::<f64>() / rows.len() as f64;
        let hanging = Hanging::of_step(0.0, 0.014, speed);
        let (mut slide, mut stances, mut share) = (0.0, 0, 0.0);
        for samples in &samples {
            let FootSlide {
                stances: n, mean_m, ..
            } = foot_slide(samples[rows.clone()].iter().copied());
            slide += mean_m * n as f64;
            stances += n;
            let points: Vec<_> = samples[rows.clone()].iter().map(|s| s.0).collect();
            share += hanging_share(&points, dt_s, &hanging) / feet.count() as f64;
        }
        (slide / stances as f64, share)
    })
}

#[test]
fn a_tempo_that_sweeps_from_walk_to_gallop() {
    let with = sweep(ClassOptions::default().limb_advance);
    let without = sweep(0.0);
    // Held, a foot slides five times less; over the whole way the walk's longer stance takes its part, see
    // `walk_and_gallop_as_shipped`.
    for ((what, least), (with, without)) in
        [("held in the middle", 5.0), ("from walk to gallop", 4.0)]
            .into_iter()
            .zip(with.iter().zip(&without))
    {
        let times = without.0 / with.0;
        println!(
            "{what}: slide {:.2} mm a stance with timelines, {:.2} mm without: {times:.1} times; hanging {:.1} and {:.1} %",
            1e3 * with.0,
            1e3 * without.0,
            100.0 * with.1,
            100.0 * without.1
        );
        assert!(times > least, "{what}: {times:.2} times, not {least}");
        assert!(
            with.1 < without.1,
            "{what}: legs hang {:.3} and {:.3}",
            with.1,
            without.1
        );
    }
}

fn recorded(file: &str, urdf: Option<&str>) -> Option<(BodyModel, ClipFile)> {
    let path = shared_data(file)?;
    let model = match urdf {
        Some(urdf) => Some(RobotModel::from_urdf(&read(&shared_data(urdf)?)).expect("a robot")),
        None => None,
    };
    let take = open(&path, &ImportOptions::default())
        .expect("a motion")
        .takes
        .remove(0);
    let body = BodyModel::of(&take, model.as_ref()).expect("its body");
    let found = analyse(&take, &body).expect("a motion");
    let cycle = found.cycle.expect("a cycle");
    let options = cut::CutOptions {
        most_seam: 1.0,
        ..cut::CutOptions::default()
    };
    let cut = cut::cycle(&take, &body, &cycle, &found.feet, &options);
    Some((body, cut.expect("a clip").clip))
}

#[test]
fn recorded_gaits_slide_less_with_timelines() {
    // Recorded feet slide by themselves (60 to 120 mm a stance, before anything is blended) and stand for unlike
    // parts of the cycle, so timelines cannot lower the slide by five; lower it is.
    let a1 = Some("robots/a1/a1.urdf");
    let (a1_, dog) = ("quadruped/a1/", "quadruped/dog3d/dog3d_");
    for (folder, a, b, urdf) in [
        (a1_, "pace0.txt", "trot0.txt", a1),
        (a1_, "trot0.txt", "gallop_forward0.json", a1),
        (a1_, "pace0.txt", "gallop_forward0.json", a1),
        (dog, "pace.txt", "trot.txt", None),
        (dog, "pace.txt", "canter.txt", None),
        (dog, "trot.txt", "canter.txt", None),
    ] {
        let file = |name: &str| recorded(&format!("{folder}{name}"), urdf);
        let (Some((body, a)), Some((_, b))) = (file(a), file(b)) else {
            return;
        };
        let clips = [&a, &b].map(|c| c.for_space(body.space()).expect("of the body"));
        let pair = Pair {
            space: body.space(),
            feet: body.feet().expect("feet"),
            clips: [&clips[0], &clips[1]],
        };
        expect_lower(&study(&pair, false), 1.0);
    }
}

#[test]
fn the_command_prints_a_table_and_draws() {
    let folder = Folder::empty();
    let plot = folder.text("blend.svg");
    let path = |part: &str| config(part).to_str().expect("a plain path").to_owned();
    let (walk, gallop) = (path("clips/walk_long.json"), path("clips/gallop.json"));
    let (bow, urdf) = (path("clips/bow.json"), path("robots/pup.urdf"));
    let blend = |args: &[&str]| handwave(&[&["clip", "blend"], args].concat());
    refused(
        blend(&[&walk, &bow, "--urdf", &urdf]),
        2,
        &["bow.json", "cycles"],
    );
    refused(blend(&[&walk, &gallop]), 2, &["walk_long.json", "--urdf"]);
    refused(
        blend(&[&walk, "nothing.json", "--urdf", &urdf]),
        2,
        &["nothing.json"],
    );
    let made = blend(&[
        &walk, &gallop, "--urdf", &urdf, "--steps", "3", "--out", &plot, "--json",
    ]);
    let json = made.expect(0).json();
    let middle = &json["rows"][1];
    assert!(
        (middle["weight"].as_f64().expect("a weight") - 0.5).abs() < 1e-6,
        "{json}"
    );
    let slide = |way: &str| middle[way]["slide_m"].as_f64().expect("a length");
    assert!(slide("no_timelines") > 5.0 * slide("timelines"), "{json}");
    assert!(folder.read("blend.svg").contains("without"));
    let table = blend(&[&walk, &gallop, "--urdf", &urdf, "--steps", "2"]).expect(0);
    assert!(table.out.contains("walk_long to gallop"), "{}", table.out);
}
