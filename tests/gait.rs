//! Gaits for any legged robot: where feet are, what joints may do, and which legs are found.
//!
//! Pup and PhantomX are bundled; five quadrupeds of others are tested where they lie beside the
//! repository.

mod gait_support;
mod support;

use gait_support::{Robot, bundled, feet, foot_points, robots, strain, stranger};
use handwave::motion::clip::ClipFile;
use handwave::motion::gait::{GaitDescription, GaitName};
use handwave::motion::gait_frames::author;
use handwave::robot::{Leg, RobotModel};
use proptest::prelude::*;
use std::path::Path;
use support::counting::{Counting, calls};
use support::folder::Folder;
use support::program::{handwave, refused};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Ways to go: straight on, along a curve, in place, sideways, backwards around a curve.
fn ways(robot: &Robot) -> Vec<(&'static str, [f64; 3])> {
    let leg = robot.legs[0].length(&robot.model);
    vec![
        ("straight", [0.4 * leg, 0.0, 0.0]),
        ("curve", [0.25 * leg, 0.0, 0.25]),
        ("in place", [0.0, 0.0, -0.3]),
        ("sideways", [0.0, 0.15 * leg, 0.0]),
        ("curve backwards", [-0.2 * leg, 0.05 * leg, 0.2]),
    ]
}

fn way(gait: GaitName, [forward, left, turn]: [f64; 3]) -> GaitDescription {
    let mut description = GaitDescription::preset(gait.name(), gait);
    description.stride_m = Some(forward);
    description.left_m = left;
    description.turn_rad = turn;
    description
}

#[test]
fn feet_in_stance_stay_on_their_spot_in_the_world_on_every_robot() {
    for robot in robots() {
        for gait in robot.gaits() {
            for (name, advance) in ways(&robot) {
                let authored = robot.author(&way(gait, advance));
                let found = feet(&robot, &authored.file);
                let what = format!("{} {gait:?} {name}: {found:?}", robot.name);
                assert!(found.slip_m < 2e-4, "{what}");
                assert!(found.off_ground_m < 2e-4, "{what}");
                assert!(found.scuff_m < 2e-4, "{what}");
                let lift = 0.12 * robot.legs[0].length(&robot.model);
                assert!(
                    (found.clearance_m - lift).abs() < 0.05 * lift,
                    "{what}, {lift} asked"
                );
            }
        }
    }
}

#[test]
fn limits_are_kept_at_the_frequency_said_and_the_seam_is_smooth() {
    for robot in robots() {
        for gait in robot.gaits() {
            for (name, advance) in ways(&robot) {
                let authored = robot.author(&way(gait, advance));
                let file = &authored.file;
                let clip = file.for_body(&file.joints).expect("own joints");
                let what = format!("{} {gait:?} {name}", robot.name);
                let (speed, outside) = strain(&robot, file, &clip);
                assert!(file.frequency_hz > 0.1, "{what}: {} Hz", file.frequency_hz);
                assert!(
                    speed < 0.9,
                    "{what}: {speed} of the speed limit at its tempo"
                );
                assert!(outside < 1e-6, "{what}: {outside} rad outside");
                for joint in 0..file.joints.len() {
                    let q = |u: f64| clip.sample(u, joint);
                    let jump = (q(1.0 - 1e-9) - q(0.0)).abs();
                    let bend = (q(1e-4) - 2.0 * q(0.0) + q(-1e-4)).abs() / 1e-8;
                    let most = clip.steepest(joint).1.max(1.0);
                    assert!(jump < 1e-6, "{what}: joint {joint} jumps by {jump} rad");
                    assert!(bend < 1.5 * most, "{what}: joint {joint} bends by {bend}");
                }
            }
        }
    }
}

#[test]
fn a_body_that_sways_leaves_its_feet_where_they_are() {
    let robot = Robot::from_text("pup", &bundled("pup.urdf"));
    let mut description = way(GaitName::Walk, [0.06, 0.0, 0.1]);
    description.sway_m = 0.01;
    description.sway_roll_rad = 0.05;
    description.bob_m = 0.004;
    let file = robot.author(&description).file;
    let lefts: Vec<f64> = file.body.iter().map(|row| row[1]).collect();
    let most = lefts.iter().fold(f64::NEG_INFINITY, |m, v| v.max(m));
    assert!((most - 0.01).abs() < 1e-4, "sways {most} m");
    // Farthest left while the left legs carry most: the middle of the right legs' swings.
    let k = lefts.iter().position(|v| *v == most).expect("a row") as f64;
    let u = k / lefts.len() as f64;
    let right_swing = |limb: &&handwave::motion::clip::Segment| {
        let since = (u - limb.phase).rem_euclid(1.0);
        limb.name.ends_with("right") && since >= limb.duty
    };
    let swinging = file.segments.iter().filter(right_swing).count();
    let left_down = file
        .segments
        .iter()
        .filter(|s| s.name.ends_with("left") && (u - s.phase).rem_euclid(1.0) < s.duty)
        .count();
    assert!(
        left_down == 2 && swinging >= 1,
        "at {u}: {left_down} left feet down, {swinging} right in the air"
    );
    // Rows are sampled at the frames, so only there the body is known.
    for (k, frame) in file.frames.iter().enumerate() {
        let u = k as f64 / file.frames.len() as f64;
        for (leg, limb) in robot.legs.iter().zip(&file.segments) {
            let foot = gait_support::root_at(&file, k) * leg.foot_position(&robot.model, frame);
            if (u - limb.phase).rem_euclid(1.0) < limb.duty {
                assert!(foot.z.abs() < 1e-6, "{} at {u}: {} m", leg.name, foot.z);
            }
        }
    }
}

#[test]
fn random_goals_within_reach_are_met_within_a_micrometre_inside_the_limits() {
    let robots = robots();
    let mut runner = proptest::test_runner::TestRunner::new(ProptestConfig::with_cases(200));
    let shares = prop::collection::vec(0.0..1.0_f64, 24);
    for robot in &robots {
        let limits = robot.model.limits();
        let from = |shares: &[f64]| -> Vec<f64> {
            limits
                .iter()
                .zip(shares)
                .map(|(l, s)| l.lower.max(-3.0) + s * (l.upper.min(3.0) - l.lower.max(-3.0)))
                .collect()
        };
        runner
            .run(&(shares.clone(), shares.clone()), |(goal, start)| {
                let goals = foot_points(robot, &from(&goal));
                let mut pose = from(&start);
                for (leg, goal) in robot.legs.iter().zip(goals) {
                    let left = leg.reach(goal, &mut pose);
                    let is = (leg.foot_position(&robot.model, &pose) - goal).norm();
                    prop_assert!(
                        left < 1e-6 && is < 1e-6,
                        "{} {}: {left} m",
                        robot.name,
                        leg.name
                    );
                }
                for (q, l) in pose.iter().zip(&limits) {
                    prop_assert!(*q >= l.lower && *q <= l.upper, "{} {q} {l:?}", robot.name);
                }
                Ok(())
            })
            .unwrap_or_else(|e| panic!("{e}"));
    }
}

#[test]
fn a_leg_of_another_build_is_solved_from_nearby() {
    // Knee and thigh axes far from parallel: no closed form.
    let skew = bundled("pup.urdf").replace(
        r#"<origin xyz="0 0 -0.1"/><axis xyz="0 1 0"/>"#,
        r#"<origin xyz="0 0 -0.1"/><axis xyz="0.4 1 0.2"/>"#,
    );
    let robot = Robot::from_text("skew", &skew);
    let mut pose = vec![0.1, 0.7, -1.3].repeat(4);
    let goals: Vec<_> = foot_points(&robot, &vec![0.0, 0.6, -1.1].repeat(4));
    for (leg, goal) in robot.legs.iter().zip(goals) {
        let left = leg.reach(goal, &mut pose);
        assert!(left < 1e-6, "{}: {left} m left", leg.name);
    }
    let file = robot.author(&way(GaitName::Trot, [0.05, 0.0, 0.0])).file;
    let found = feet(&robot, &file);
    assert!(
        found.slip_m < 2e-4 && found.off_ground_m < 2e-4,
        "{found:?}"
    );
}

#[test]
fn reaching_allocates_nothing_within_and_out_of_reach() {
    for robot in robots() {
        let mut pose = robot.model.rest();
        let goals = foot_points(&robot, &pose);
        let before = calls();
        let mut left = 0.0;
        for (leg, goal) in robot.legs.iter().zip(&goals) {
            let mut near = *goal;
            near.z += 0.02;
            left += leg.reach(near, &mut pose);
            let mut far = *goal;
            far.z -= 5.0;
            left += leg.reach(far, &mut pose);
        }
        assert_eq!(calls() - before, 0, "{}: {left}", robot.name);
        assert!(
            left > 1.0,
            "{}: a goal five metres away is out of reach",
            robot.name
        );
    }
}

#[test]
fn a_turned_root_link_is_noticed_and_changes_nothing_but_the_body() {
    let straight = Robot::from_text("pup", &bundled("pup.urdf"));
    let description = way(GaitName::Walk, [0.06, 0.0, 0.1]);
    let expected = straight.author(&description).file;
    // A link above the body, turned against it.
    for (rpy, forward, up) in [
        ("0 0 1.5707963267948966", "y", "z"),
        ("0 0 3.141592653589793", "-x", "z"),
        ("1.5707963267948966 0 0", "x", "-y"),
        ("-1.5707963267948966 0 -1.5707963267948966", "-y", "x"),
    ] {
        let above = format!(
            r#"<link name="above"/><joint name="turned" type="fixed"><parent link="above"/><child link="body"/><origin rpy="{rpy}"/></joint></robot>"#
        );
        let text = bundled("pup.urdf").replace("</robot>", &above);
        let robot = Robot::from_text("turned pup", &text);
        let facing = (robot.facing.forward(), robot.facing.up());
        assert_eq!(facing, (forward, up), "{rpy}");
        let names: Vec<_> = robot.legs.iter().map(|l| &l.name).collect();
        let feet_of = |r: &Robot| -> Vec<String> {
            r.legs
                .iter()
                .map(|l| r.model.links[l.foot].clone())
                .collect()
        };
        assert_eq!(feet_of(&robot), feet_of(&straight), "{rpy}: {names:?}");
        let file = robot.author(&description).file;
        for (a, b) in file
            .frames
            .iter()
            .flatten()
            .zip(expected.frames.iter().flatten())
        {
            assert!((a - b).abs() < 1e-6, "{rpy}: joint {a} instead of {b}");
        }
        let found = feet(&robot, &file);
        assert!(
            found.slip_m < 2e-4 && found.off_ground_m < 2e-4,
            "{rpy}: {found:?}"
        );
    }
}

#[test]
fn arms_heads_and_rotors_are_no_legs() {
    let joint = |name: &str, parent: &str, kind: &str, xyz: &str| {
        format!(
            r#"<link name="{name}"/><joint name="{name}_joint" type="{kind}"><parent link="{parent}"/><child link="{name}"/><origin xyz="{xyz}"/><axis xyz="0 1 0"/><limit lower="0.2" upper="1" effort="1" velocity="4"/></joint>"#
        )
    };
    let more = [
        joint("neck", "body", "revolute", "0.1 0 0.05"),
        joint("head", "neck", "revolute", "0 0 0.03"),
        joint("jaw", "head", "revolute", "0.05 0 0"),
        joint("arm1", "body", "revolute", "0 0 0.05"),
        joint("arm2", "arm1", "revolute", "0 0 0.1"),
        joint("arm3", "arm2", "revolute", "0 0 0.1"),
        joint("arm4", "arm3", "revolute", "0 0 0.1"),
        joint("rotor", "front_left_shank_link", "fixed", "0 0.01 0"),
    ]
    .concat();
    let text = bundled("pup.urdf").replace("</robot>", &format!("{more}</robot>"));
    let robot = Robot::from_text("pup with arm and head", &text);
    let names: Vec<&str> = robot.legs.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(
        names,
        ["front_left", "front_right", "rear_left", "rear_right"]
    );
    let file = robot
        .author(&GaitDescription::preset("walk", GaitName::Walk))
        .file;
    let clip = file.for_body(&file.joints).expect("own joints");
    let (_, outside) = strain(&robot, &file, &clip);
    assert!(
        outside <= 0.0,
        "the arm rests {outside} rad outside its limits"
    );
}

#[test]
fn six_legs_are_found_named_and_walk() {
    let robot = Robot::from_text("phantomx", &bundled("phantomx.urdf"));
    let found: Vec<String> = robot
        .legs
        .iter()
        .map(|l| format!("{}={}", l.name, robot.model.links[l.foot]))
        .collect();
    assert_eq!(
        found.join(","),
        "front_left=foot_lf,front_right=foot_rf,middle_left=foot_lm,middle_right=foot_rm,rear_left=foot_lr,rear_right=foot_rr"
    );
    let message = author(
        &GaitDescription::preset("trot", GaitName::Trot),
        robot.walker(),
        false,
    )
    .expect_err("a trot has four legs")
    .to_string();
    assert!(message.contains("tripod, ripple, wave"), "{message}");
}

#[test]
fn legs_that_cannot_be_found_are_explained_with_the_links_to_choose_from() {
    let arm = format!(
        "{}/configs/robots/open_manipulator_x.urdf",
        env!("CARGO_MANIFEST_DIR")
    );
    let folder = Folder::empty();
    let out = folder.text("x.json");
    let gait = |urdf: &str, more: &[&str]| {
        let all = [
            "clip", "gait", "--urdf", urdf, "--gait", "walk", "--out", &out,
        ];
        handwave(&[&all, more].concat())
    };
    refused(
        gait(&arm, &[]),
        2,
        &["cannot find", "end_effector_link (4)", "--legs front_left="],
    );
    if let Some(so101) = support::data::shared_data("robots/so101/so101_new_calib.urdf") {
        let so101 = so101.to_str().expect("a plain path");
        refused(
            gait(so101, &[]),
            2,
            &["cannot find", "gripper_frame_link (5)"],
        );
    }
    if let Some(op3) = support::data::shared_data("robots/op3/robotis_op3.urdf.xacro") {
        refused(
            gait(op3.to_str().expect("a plain path"), &[]),
            2,
            &["xacro", "expand it first"],
        );
    }
    let pup = format!("{}/configs/robots/pup.urdf", env!("CARGO_MANIFEST_DIR"));
    refused(
        gait(&pup, &["--legs", "front_left=front_left_feet"]),
        2,
        &["did you mean front_left_foot?"],
    );
    refused(
        gait(&pup, &["--legs", "front_left=front_left_foot@1:2"]),
        2,
        &["LINK@X:Y:Z"],
    );
    refused(gait(&pup, &["--forward", "z"]), 2, &["right angles"]);
    refused(
        gait(&pup, &["--limits", "kneee=0..1"]),
        2,
        &["no joint", "front_left_knee"],
    );
    refused(gait(&pup, &["--max-velocity", "0"]), 2, &["above 0"]);
    // A humanoid's leg has six joints.
    let legs = bundled("pup.urdf").replace(
        r#"name="front_left_ankle" type="fixed""#,
        r#"name="front_left_ankle" type="continuous""#,
    );
    let legs = legs.replace(
        r#"<child link="front_left_foot"/>"#,
        r#"<child link="front_left_foot"/><axis xyz="0 1 0"/><limit effort="1" velocity="1"/>"#,
    );
    let odd = folder.write("odd.urdf", &legs);
    refused(
        gait(&odd, &[]),
        2,
        &["3 ends of the tree", "front_left_foot (4)"],
    );
    refused(
        gait(&odd, &["--legs", "front_left=front_left_foot"]),
        2,
        &["4 moving joints", "three are needed"],
    );
}

#[test]
fn a_foot_without_a_link_is_told_by_its_shape_or_asked_for() {
    let mut text = bundled("pup.urdf");
    for leg in ["front_left", "front_right", "rear_left", "rear_right"] {
        let at = text
            .find(&format!("  <joint name=\"{leg}_ankle\""))
            .expect("an ankle");
        let end = at + text[at..].find("</link>").expect("a foot") + "</link>".len();
        text.replace_range(at..end, "");
    }
    // The shank's shape ends at 0.09 m; the foot was another centimetre down.
    let robot = Robot::from_text("pup without feet", &text);
    for leg in &robot.legs {
        assert!(
            (leg.tip.z + 0.09).abs() < 1e-9,
            "{}: tip {}",
            leg.name,
            leg.tip
        );
    }
    let shapeless = text.replace(
        "<cylinder radius=\"0.008\" length=\"0.09\"/>",
        "<mesh filename=\"shank.stl\"/>",
    );
    let model = RobotModel::from_urdf(&shapeless).expect("a URDF");
    let message = Leg::find_all(&model).expect_err("no shape").to_string();
    assert!(message.contains("where it touches the ground"), "{message}");
    assert!(
        message.contains("front_left=front_left_shank_link@0:0:-0.1"),
        "{message}"
    );
    let said =
        Leg::to_foot(&model, "front_left", "front_left_shank_link@0:0:-0.1").expect("a point");
    assert!(
        (said.length(&model) - 0.2).abs() < 1e-9,
        "{} m",
        said.length(&model)
    );
}

#[test]
fn a_foot_without_a_link_is_found_at_the_tip_of_its_mesh() {
    let Some(path) = support::data::shared_data("robots/phantomx/phantomx.urdf") else {
        return;
    };
    let text = std::fs::read_to_string(&path).expect("a readable URDF");
    let mut model = RobotModel::from_urdf(&text).expect("a URDF");
    model.read_mesh_tips(path.parent().expect("a folder"));
    for leg in Leg::find_all(&model).expect("tips of the meshes") {
        let off = (leg.tip - nalgebra::Point3::new(0.0015, 0.1604, 0.0288)).norm();
        assert!(off < 1e-3, "{}: tip {} is {off} m off", leg.name, leg.tip);
    }
}

#[test]
fn placeholder_limits_are_refused_and_an_override_is_enough() {
    let Some(path) = stranger("solo12") else {
        return;
    };
    let urdf = path.to_str().expect("a plain path");
    let folder = Folder::empty();
    let out = folder.text("trot.json");
    let args = [
        "clip", "gait", "--urdf", urdf, "--gait", "trot", "--out", &out,
    ];
    refused(
        handwave(&args),
        2,
        &["1000 rad/s", "placeholders", "`--max-velocity 4.7`"],
    );
    assert!(!Path::new(&out).exists(), "nothing is written");
    let more = ["--max-velocity", "8", "--limits", "*_KFE=-2.8..-0.2"];
    let ended = handwave(&[&args[..], &more].concat()).expect(0);
    assert!(
        ended.err.contains("8 joints may turn further"),
        "{}",
        ended.err
    );
    let file = ClipFile::from_json(&folder.read("trot.json")).expect("a clip");
    let knee = file
        .joints
        .iter()
        .position(|j| j == "FL_KFE")
        .expect("a knee");
    for frame in &file.frames {
        assert!(
            (-2.8..=-0.2).contains(&frame[knee]),
            "knee at {}",
            frame[knee]
        );
    }
}

#[test]
fn shipped_clips_are_what_their_descriptions_make() {
    let clips = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/clips");
    let pup = Robot::from_text("pup", &bundled("pup.urdf"));
    let phantomx = Robot::from_text("phantomx", &bundled("phantomx.urdf"));
    let mut seen = 0;
    for entry in std::fs::read_dir(&clips).expect("clips") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|e| e != "toml") {
            continue;
        }
        let name = path.file_stem().and_then(|n| n.to_str()).expect("a name");
        let text = std::fs::read_to_string(&path).expect("a description");
        let description =
            GaitDescription::from_toml(&text).unwrap_or_else(|e| panic!("{name}: {e}"));
        let robot = if name.starts_with("hexapod") {
            &phantomx
        } else {
            &pup
        };
        let made = robot.author(&description);
        assert!(
            made.stride_kept >= 1.0,
            "{name} is shortened to {}",
            made.stride_kept
        );
        let json = std::fs::read_to_string(path.with_extension("json")).expect("its clip");
        let shipped = ClipFile::from_json(&json).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(made.file.frames.len(), shipped.frames.len(), "{name}");
        assert_eq!(
            (made.file.root, &made.file.segments),
            (shipped.root, &shipped.segments),
            "{name}"
        );
        let rows = |f: &ClipFile| -> Vec<f64> {
            let body = f.body.iter().flatten();
            f.frames.iter().flatten().chain(body).copied().collect()
        };
        for (a, b) in rows(&made.file).iter().zip(rows(&shipped)) {
            assert!(
                (a - b).abs() < 3e-6,
                "{name}: {b} in the file, {a} when made again"
            );
        }
        seen += 1;
    }
    assert!(seen >= 30, "{seen} descriptions");
}
