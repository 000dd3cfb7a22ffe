//! What `handwave clip info` and the analysis behind it find in recordings whose figures are known.
//!
//! Figures are those of the recordings' own notes, measured by Fourier transform or exact from the length
//! of clips that hold one cycle.

mod support;

use handwave::body::{Feet, SkeletonFeet};
use handwave::motion::analysis::cut::{self, CutOptions};
use handwave::motion::analysis::gait::{Gait, apart};
use handwave::motion::analysis::mirror::{Mirror, farthest, symmetry};
use handwave::motion::analysis::{Analysis, BodyModel, analyse};
use handwave::motion::clip::ClipFile;
use handwave::motion::import::{ImportOptions, open};
use handwave::motion::take::{Take, TakeBody};
use handwave::robot::RobotModel;
use std::path::Path;
use support::data::shared_data;
use support::program::handwave;

/// A recording with all that was found in it; `None` where it lies on no disk.
fn found(file: &str, urdf: Option<&str>) -> Option<(Take, BodyModel, Analysis)> {
    let path = shared_data(file)?;
    let model = match urdf {
        Some(urdf) => {
            let text = std::fs::read_to_string(shared_data(urdf)?).expect("a readable URDF");
            Some(RobotModel::from_urdf(&text).expect("a good URDF"))
        }
        None => None,
    };
    let mut takes = open(&path, &ImportOptions::default()).expect(file).takes;
    let take = takes.remove(0);
    let body = BodyModel::of(&take, model.as_ref()).expect(file);
    let analysis = analyse(&take, &body).expect(file);
    Some((take, body, analysis))
}

const A1: Option<&str> = Some("robots/a1/a1.urdf");
const LAIKAGO: Option<&str> = Some("robots/laikago/laikago.urdf");

/// File, URDF, cycles per second, bound as a share, speed in m/s, gait.
type Row = (
    &'static str,
    Option<&'static str>,
    f64,
    f64,
    f64,
    Option<Gait>,
);

fn hold(rows: &[Row]) {
    for (file, urdf, hz, bound, speed, gait) in rows {
        let Some((_, _, found)) = found(file, *urdf) else {
            continue;
        };
        let Some(cycle) = found.cycle else {
            panic!("{file}: no cycle found, {hz} Hz expected");
        };
        let off = (cycle.frequency_hz / hz - 1.0).abs();
        assert!(
            off <= *bound,
            "{file}: {:.4} Hz, {hz} Hz expected, off by {:.1} %",
            cycle.frequency_hz,
            100.0 * off
        );
        let travel = found.travel.forward_m_s;
        // Within 3 %, and half a unit of the last digit that is told.
        let wrong = (found.travel.speed_m_s() - speed.abs()).abs();
        assert!(
            wrong < 0.03 * speed.abs() + 0.005 && travel * speed > 0.0,
            "{file}: {travel:.3} m/s forwards, {speed} m/s expected"
        );
        if gait.is_some() {
            assert_eq!(found.gait, *gait, "{file}: {:?}", phases(&found));
        }
    }
}

fn phases(found: &Analysis) -> Vec<(&str, Option<f64>, f64)> {
    (found.feet.iter())
        .map(|f| (f.name.as_str(), f.phase, f.duty))
        .collect()
}

#[test]
#[rustfmt::skip]
fn robots_that_walk_as_dogs_did_have_the_cycles_speeds_and_gaits_of_their_notes() {
    hold(&[
        ("quadruped/a1/trot0.txt", A1, 1.488, 0.001, 1.17, Some(Gait::Trot)),
        ("quadruped/a1/trot1.txt", A1, 1.488, 0.001, 1.15, Some(Gait::Trot)),
        ("quadruped/a1/pace0.txt", A1, 1.253, 0.001, 0.71, Some(Gait::Pace)),
        ("quadruped/a1/gallop_forward0.json", A1, 2.19, 0.02, 1.99, Some(Gait::Gallop)),
        ("quadruped/a1/trot_forward0.json", A1, 1.61, 0.02, 0.66, None),
        ("quadruped/laikago/dog_pace.txt", LAIKAGO, 1.579, 0.001, 1.09, Some(Gait::Pace)),
        ("quadruped/laikago/dog_trot.txt", LAIKAGO, 1.875, 0.001, 1.75, Some(Gait::Trot)),
        ("quadruped/laikago/dog_backwards_pace.txt", LAIKAGO, 1.579, 0.001, -1.09, Some(Gait::Pace)),
        ("quadruped/laikago/dog_backwards_trot.txt", LAIKAGO, 1.875, 0.001, -1.75, Some(Gait::Trot)),
    ]);
}

#[test]
#[rustfmt::skip]
fn skeletons_of_dogs_and_humans_have_the_cycles_and_speeds_of_their_notes() {
    hold(&[
        ("quadruped/dog3d/dog3d_pace.txt", None, 1.579, 0.001, 1.41, Some(Gait::Pace)),
        ("quadruped/dog3d/dog3d_trot.txt", None, 1.935, 0.001, 2.40, Some(Gait::Trot)),
        ("quadruped/dog3d/dog3d_canter.txt", None, 2.222, 0.001, 5.05, None),
        ("human_joint/humanoid3d_walk.txt", None, 0.789, 0.002, 0.98, Some(Gait::Walk)),
        ("human_joint/humanoid3d_jog.txt", None, 1.20, 0.002, 2.80, Some(Gait::Run)),
        ("human_joint/humanoid3d_run.txt", None, 1.25, 0.002, 3.56, Some(Gait::Run)),
    ]);
}

#[test]
#[rustfmt::skip]
fn recorded_walkers_have_the_stride_frequencies_of_their_notes() {
    // Short runs: the notes themselves are uncertain by about 0.1 Hz.
    hold(&[
        ("human_bvh/dataset-1_walk_normal_001.bvh", None, 0.930, 0.02, 1.25, Some(Gait::Walk)),
        ("human_bvh/dataset-2_walk_normal_001.bvh", None, 0.908, 0.02, 1.11, Some(Gait::Walk)),
        ("human_bvh/dataset-2_walk_active_001.bvh", None, 0.989, 0.02, 1.43, Some(Gait::Walk)),
        ("human_bvh/dataset-2_walk_exhausted_001.bvh", None, 0.886, 0.02, 1.00, Some(Gait::Walk)),
        ("human_bvh/dataset-2_walk_elderly_001.bvh", None, 0.941, 0.02, 0.74, Some(Gait::Walk)),
        ("human_bvh/dataset-2_run_exhausted_001.bvh", None, 1.230, 0.02, 1.90, Some(Gait::Run)),
        ("human_bvh/dataset-2_run_elderly_001.bvh", None, 1.157, 0.02, 1.18, None),
        ("human_bvh/dataset-1_dash_happy_001.bvh", None, 1.553, 0.02, 2.45, Some(Gait::Run)),
        ("human_bvh/dataset-2_run_active_001.bvh", None, 1.07, 0.1, 3.42, Some(Gait::Run)),
        ("human_bvh/dataset-1_run_active_001.bvh", None, 1.06, 0.1, 2.51, Some(Gait::Run)),
        ("human_bvh/dataset-2_run_normal_001.bvh", None, 1.318, 0.03, 3.60, Some(Gait::Run)),
        ("human_cmu/02_01.amc", None, 0.908, 0.02, 1.18, Some(Gait::Walk)),
        ("human_cmu/02_02.amc", None, 1.025, 0.02, 1.63, Some(Gait::Walk)),
        ("human_cmu/02_03.amc", None, 1.26, 0.08, 2.58, Some(Gait::Run)),
    ]);
}

#[test]
fn jumps_spins_and_raised_hands_are_no_cycles() {
    for (file, urdf) in [
        ("quadruped/a1/jump0.json", A1),
        ("quadruped/laikago/hopturn.txt", LAIKAGO),
        ("quadruped/laikago/turn.txt", LAIKAGO),
        ("human_joint/humanoid3d_jump.txt", None),
        ("human_joint/humanoid3d_spin.txt", None),
        (
            "human_bvh/dataset-2_raise-up-right-hand_normal_001.bvh",
            None,
        ),
        ("human_cmu/02_04.amc", None),
    ] {
        if let Some((_, _, found)) = found(file, urdf) {
            assert_eq!(found.cycle, None, "{file}");
        }
    }
}

/// Distances of touch-downs: of diagonal pairs and of pairs of one side, the larger of either.
fn pairs(found: &Analysis) -> (f64, f64) {
    let phase = |name: &str| {
        let foot = found.feet.iter().find(|f| f.name == name).expect(name);
        foot.phase.expect("it touches down")
    };
    let [fl, fr, rl, rr] = ["front_left", "front_right", "rear_left", "rear_right"].map(phase);
    (
        apart(fl, rr).max(apart(fr, rl)),
        apart(fl, rl).max(apart(fr, rr)),
    )
}

#[test]
fn a_trot_moves_diagonal_legs_together_and_a_pace_those_of_one_side() {
    for (file, urdf) in [
        ("quadruped/dog3d/dog3d_trot.txt", None),
        ("quadruped/a1/trot0.txt", A1),
        ("quadruped/a1/trot1.txt", A1),
        ("quadruped/laikago/dog_trot.txt", LAIKAGO),
    ] {
        let Some((_, _, found)) = found(file, urdf) else {
            continue;
        };
        let (diagonal, side) = pairs(&found);
        // The retargeted dog sets its hind feet down a tenth of a cycle late.
        assert!(
            diagonal <= 0.14 && side > 0.3,
            "{file}: diagonals {diagonal:.2}, sides {side:.2} apart"
        );
    }
    for (file, urdf) in [
        ("quadruped/dog3d/dog3d_pace.txt", None),
        ("quadruped/a1/pace0.txt", A1),
        ("quadruped/laikago/dog_pace.txt", LAIKAGO),
    ] {
        let Some((_, _, found)) = found(file, urdf) else {
            continue;
        };
        let (diagonal, side) = pairs(&found);
        assert!(
            side <= 0.12 && diagonal > 0.35,
            "{file}: sides {side:.2}, diagonals {diagonal:.2} apart"
        );
    }
}

/// Phase of the first harmonic of a coordinate, as a fraction of the cycle.
fn harmonic(take: &Take, coordinate: usize, hz: f64) -> f64 {
    let mean = take.poses.iter().map(|p| p[coordinate]).sum::<f64>() / take.len() as f64;
    let (mut sin, mut cos) = (0.0, 0.0);
    for (k, pose) in take.poses.iter().enumerate() {
        let turn = std::f64::consts::TAU * hz * k as f64 * take.dt_s;
        sin += (pose[coordinate] - mean) * turn.sin();
        cos += (pose[coordinate] - mean) * turn.cos();
    }
    sin.atan2(cos) / std::f64::consts::TAU
}

#[test]
fn the_clip_named_trot_forward_swings_the_legs_of_one_side_together_and_trot1_does_not() {
    // Its origin remarks that what it calls a trot is a pace. Its thighs say so; its front feet come down
    // so softly that contacts alone leave it between a pace and a walk.
    for (file, paces) in [
        ("quadruped/a1/trot_forward0.json", true),
        ("quadruped/a1/trot1.txt", false),
    ] {
        let Some((take, _, found)) = found(file, A1) else {
            return;
        };
        let hz = found.cycle.expect(file).frequency_hz;
        let [fr, fl, rr, rl] = [1, 4, 7, 10].map(|thigh| harmonic(&take, thigh, hz));
        let side = apart(fl, rl).max(apart(fr, rr));
        let diagonal = apart(fl, rr).max(apart(fr, rl));
        let (near, far) = if paces {
            (side, diagonal)
        } else {
            (diagonal, side)
        };
        assert!(
            near < 0.12 && far > 0.35,
            "{file}: sides {side:.2}, diagonals {diagonal:.2} of a cycle apart"
        );
        let (touching_diagonal, touching_side) = pairs(&found);
        assert_eq!(
            touching_side < touching_diagonal,
            paces,
            "{file}: {:?}",
            phases(&found)
        );
    }
}

#[test]
fn feet_stand_plausibly_long_and_slide_little() {
    for (file, urdf, duty, slide_m) in [
        ("quadruped/dog3d/dog3d_pace.txt", None, 0.45..0.70, 0.15),
        ("quadruped/dog3d/dog3d_trot.txt", None, 0.30..0.55, 0.20),
        ("quadruped/dog3d/dog3d_canter.txt", None, 0.15..0.45, 0.40),
        ("quadruped/a1/pace0.txt", A1, 0.45..0.75, 0.10),
        ("quadruped/a1/trot1.txt", A1, 0.30..0.60, 0.10),
        ("quadruped/a1/gallop_forward0.json", A1, 0.15..0.45, 0.35),
        ("human_cmu/02_01.amc", None, 0.55..0.70, 0.20),
        (
            "human_bvh/dataset-2_walk_normal_001.bvh",
            None,
            0.55..0.70,
            0.20,
        ),
    ] {
        let Some((_, _, found)) = found(file, urdf) else {
            continue;
        };
        for foot in &found.feet {
            assert!(
                duty.contains(&foot.duty),
                "{file}, {}: duty {:.2}",
                foot.name,
                foot.duty
            );
            let slide = foot.slide.mean_m;
            assert!(
                slide < slide_m,
                "{file}, {}: slides {slide:.3} m a stance",
                foot.name
            );
        }
    }
}

#[test]
fn walkers_are_symmetric_half_a_cycle_apart_and_mirrored_twice_they_are_themselves() {
    for (file, urdf, least) in [
        ("human_joint/humanoid3d_walk.txt", None, 0.95),
        ("human_bvh/dataset-2_walk_normal_001.bvh", None, 0.9),
        ("human_cmu/02_01.amc", None, 0.85),
        ("quadruped/a1/trot1.txt", A1, 0.9),
        ("quadruped/laikago/dog_pace.txt", LAIKAGO, 0.9),
    ] {
        let Some((take, body, found)) = found(file, urdf) else {
            continue;
        };
        let mirror = Mirror::of(&take, &body).expect(file);
        let twice = mirror.take(&mirror.take(&take));
        let off = (take.poses.iter().zip(&twice.poses))
            .map(|(a, b)| farthest(body.space(), a, b))
            .fold(0.0, f64::max);
        assert!(off < 1e-9, "{file}: {off} rad from itself");
        let cycle = found.cycle.expect(file);
        let pairs = symmetry(&take, &body, &mirror, &cycle);
        assert!(pairs.len() >= 2, "{file}: {pairs:?}");
        for pair in pairs {
            assert!(pair.likeness > least, "{file}: {pair:?}");
            assert!((pair.shift - 0.5).abs() < 0.08, "{file}: {pair:?}");
        }
    }
}

#[test]
fn a_walk_becomes_a_clip_whose_seam_moved_it_no_farther_than_told() {
    for (file, urdf) in [
        ("human_bvh/dataset-2_walk_normal_001.bvh", None),
        ("human_cmu/02_01.amc", None),
        ("quadruped/a1/pace0.txt", A1),
    ] {
        let Some((take, body, found)) = found(file, urdf) else {
            continue;
        };
        let cycle = found.cycle.expect(file);
        let cut =
            cut::cycle(&take, &body, &cycle, &found.feet, &CutOptions::default()).expect(file);
        assert!(cut.seam.share < 0.3, "{file}: {:?}", cut.seam);
        let clip = ClipFile::from_json(&cut.clip.to_json()).expect(file);
        assert_eq!(clip.segments.len(), found.feet.len(), "{file}");
        let back = Take::of_clip(&clip);
        let n = clip.frames.len();
        for k in 0..n {
            let t_s = (cycle.start as f64 + cycle.frames * k as f64 / n as f64) * take.dt_s;
            let off = farthest(body.space(), &take.at(t_s).0, &back.poses[k]);
            assert!(
                off <= cut.seam.moved * 1.05 + 1e-5,
                "{file}: frame {k} is {off} from the take, {} told",
                cut.seam.moved
            );
        }
        // Played round, it is still the motion it was.
        let again = analyse(&back.repeated(3.0 / clip.frequency_hz), &body).expect(file);
        let start_s = cycle.start as f64 * take.dt_s;
        let one = take.part(start_s, start_s + 1.0 / cycle.frequency_hz, n + 1);
        let recorded = handwave::motion::analysis::travel::of(&one).forward_m_s;
        let speed = again.travel.forward_m_s;
        assert!(
            (speed / recorded - 1.0).abs() < 0.03,
            "{file}: {speed:.2} m/s round, {recorded:.2} recorded"
        );
        assert_eq!(again.gait, found.gait, "{file}: {:?}", phases(&again));
    }
}

#[test]
fn the_shipped_clips_are_told_as_a_table_as_json_and_as_a_plot() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let clip = root
        .join("configs/clips/trot_long.json")
        .display()
        .to_string();
    let urdf = root.join("configs/robots/pup.urdf").display().to_string();
    let plot = std::env::temp_dir().join(format!("clip_info_{}.svg", std::process::id()));
    let out = plot.display().to_string();
    let table = handwave(&["clip", "info", &clip, "--urdf", &urdf, "--plot", &out]).expect(0);
    for word in ["cycle", "travel", "limits", "jerk"] {
        assert!(
            table.out.contains(word),
            "{word} is missing in\n{}",
            table.out
        );
    }
    let svg = std::fs::read_to_string(&plot).expect("a plot");
    std::fs::remove_file(&plot).expect("removed");
    assert!(svg.starts_with("<svg") && svg.contains("speed of the root"));
    let json = handwave(&["clip", "info", &clip, "--urdf", &urdf, "--json"]).expect(0);
    let value: serde_json::Value = serde_json::from_str(&json.out).expect("JSON");
    assert_eq!(value["kind"], "cycle");
    let hz = value["cycle"]["frequency_hz"]
        .as_f64()
        .expect("a frequency");
    let told = value["clip"]["root"]["forward_m"]
        .as_f64()
        .expect("its travel")
        * hz;
    let speed = value["travel"]["forward_m_s"].as_f64().expect("a speed");
    assert!(
        (speed / told - 1.0).abs() < 0.01,
        "{speed} m/s, {told} m/s authored"
    );
}

#[test]
fn wrong_files_and_robots_end_with_their_name_and_what_is_allowed() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let clip = root
        .join("configs/clips/trot_long.json")
        .display()
        .to_string();
    let arm = root
        .join("configs/robots/open_manipulator_x.urdf")
        .display()
        .to_string();
    for (args, words) in [
        (vec!["no-such.bvh"], "no-such.bvh"),
        (vec![&clip, "--urdf", &arm], "its joints are"),
        (vec![&clip, "--urdf", &clip], "not a readable URDF"),
        (
            vec![&clip, "--plot", "/no-such-folder/p.svg"],
            "/no-such-folder/p.svg",
        ),
    ] {
        let mut all = vec!["clip", "info"];
        all.extend(args);
        let ended = handwave(&all).expect(2);
        assert!(ended.err.contains(words), "{words}: {}", ended.err);
    }
}

#[test]
fn feet_of_foxes_dogs_and_humans_are_found_and_go_where_they_are_put() {
    let fox = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/avatars/fox.glb");
    let mut files = vec![(fox.display().to_string() + "#Walk", 4)];
    for (file, count) in [
        ("quadruped/dog3d/dog3d_trot.txt", 4),
        ("human_joint/humanoid3d_run.txt", 2),
        ("human_bvh/dataset-2_walk_normal_001.bvh", 2),
        ("human_cmu/02_01.amc", 2),
    ] {
        files.extend(shared_data(file).map(|p| (p.display().to_string(), count)));
    }
    for (file, count) in files {
        let imported = open(Path::new(&file), &ImportOptions::default()).expect(&file);
        let take = &imported.takes[0];
        let TakeBody::Skeleton(skeleton) = &take.body else {
            panic!("{file}: no skeleton");
        };
        let shown: Vec<&[f64]> = take.poses.iter().map(Vec::as_slice).collect();
        let feet = SkeletonFeet::find(skeleton.clone(), &shown).expect(&file);
        assert_eq!(feet.count(), count, "{file}: {:?}", feet.legs());
        for (k, pose) in take.poses.iter().enumerate().step_by(3) {
            for foot in 0..count {
                // Where this foot is a few frames on, which its leg is known to reach from its own hip.
                let hip = feet.legs()[foot].hip;
                let other = &take.poses[(k + 5) % take.len()];
                let way = feet.position(other, foot) - skeleton.position(other, hip);
                let goal = skeleton.position(pose, hip) + way;
                let mut placed = pose.clone();
                let left = feet.place(&mut placed, foot, goal);
                let bound = 1e-6 * feet.reach_m(foot).max(1.0);
                assert!(
                    left < bound,
                    "{file}, frame {k}, {}: {left} m off",
                    feet.name(foot)
                );
            }
        }
    }
}
