//! Limb timelines: a walk blended into a gallop, with legs that keep their own time and without.

mod support;

use handwave::body::{JointSpace, PoseSpace, RobotFeet};
use handwave::motion::analysis::{BodyModel, analyse, cut};
use handwave::motion::blending::{Blended, Pair};
use handwave::motion::clip::{Clip, ClipFile};
use handwave::motion::import::{ImportOptions, open};
use handwave::robot::{Leg, RobotModel};
use std::path::{Path, PathBuf};
use support::data::shared_data;

fn config(part: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(part)
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn pup_body() -> (JointSpace, RobotFeet) {
    let model = RobotModel::from_urdf(&read(&config("robots/pup.urdf"))).expect("pup");
    let (legs, facing) = Leg::find_all_facing(&model, None).expect("legs");
    (JointSpace::of_robot(&model, true), RobotFeet::new(model, legs, facing))
}

fn shipped_clip(space: &dyn PoseSpace, name: &str) -> Clip {
    let file = ClipFile::from_json(&read(&config(&format!("clips/{name}.json")))).expect("a clip");
    file.for_space(space).expect("a clip of the body")
}

/// The blends at all weights: with timelines, without.
fn study(pair: &Pair<'_>) -> Vec<[Blended; 2]> {
    let steps = pair.steps().expect("two gaits");
    println!("ground {:.4} m, lift {:.4} m", steps.ground_m, steps.lift_m);
    (0..=8)
        .map(|k| {
            let weight = f64::from(k) / 8.0;
            let row = [true, false].map(|t| pair.blend(weight, t, &steps).expect("a blend"));
            let [with, without] = &row;
            println!(
                "{weight:.3} ({:.3}): slide {:.2} / {:.2} mm, largest {:.2} / {:.2} mm, hanging {:.1} / {:.1} %, lift {:.1} / {:.1} mm",
                with.weight,
                1e3 * with.slide_m, 1e3 * without.slide_m,
                1e3 * with.largest_slide_m, 1e3 * without.largest_slide_m,
                100.0 * with.hanging, 100.0 * without.hanging,
                1e3 * with.lift_m, 1e3 * without.lift_m,
            );
            row
        })
        .collect()
}

#[test]
fn pup() {
    let (space, feet) = pup_body();
    for (a, b) in [("walk_long", "gallop"), ("walk_long", "trot_long"), ("trot_long", "gallop"), ("pace", "bound")] {
        let (a, b) = (shipped_clip(&space, a), shipped_clip(&space, b));
        println!("{} {}", a.name, b.name);
        study(&Pair { space: &space, feet: &feet, clips: [&a, &b] });
    }
}

fn recorded(file: &str, urdf: Option<&str>) -> Option<(BodyModel, ClipFile)> {
    let path = shared_data(file)?;
    let model = match urdf {
        Some(urdf) => Some(RobotModel::from_urdf(&read(&shared_data(urdf)?)).expect("a robot")),
        None => None,
    };
    let take = open(&path, &ImportOptions::default()).expect("a motion").takes.remove(0);
    let body = BodyModel::of(&take, model.as_ref()).expect("its body");
    let found = analyse(&take, &body).expect("a motion");
    let cycle = found.cycle.expect("a cycle");
    let options = cut::CutOptions { most_seam: 1.0, ..cut::CutOptions::default() };
    let cut = cut::cycle(&take, &body, &cycle, &found.feet, &options);
    Some((body, cut.expect("a clip").clip))
}

#[test]
fn recordings() {
    let a1 = Some("robots/a1/a1.urdf");
    for (a, b, urdf) in [
        ("quadruped/a1/trot0.txt", "quadruped/a1/gallop_forward0.json", a1),
        ("quadruped/a1/pace0.txt", "quadruped/a1/gallop_forward0.json", a1),
        ("quadruped/a1/pace0.txt", "quadruped/a1/trot0.txt", a1),
        ("quadruped/dog3d/dog3d_pace.txt", "quadruped/dog3d/dog3d_trot.txt", None),
        ("quadruped/dog3d/dog3d_pace.txt", "quadruped/dog3d/dog3d_canter.txt", None),
        ("quadruped/dog3d/dog3d_trot.txt", "quadruped/dog3d/dog3d_canter.txt", None),
    ] {
        let (Some((body, a)), Some((_, b))) = (recorded(a, urdf), recorded(b, urdf)) else {
            return;
        };
        println!("{} {}", a.name, b.name);
        let clips = [&a, &b].map(|c| c.for_space(body.space()).expect("of the body"));
        let feet = body.feet().expect("feet");
        study(&Pair { space: body.space(), feet, clips: [&clips[0], &clips[1]] });
    }
}
