//! Legs of any robot: which are found, what is said when they are not, and where their feet get.

mod gait_support;
mod support;

use gait_support::{Robot, bundled, feet, foot_points, robots, strain, stranger, way};
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
    let mut pose = [0.1, 0.7, -1.3].repeat(4);
    let goals: Vec<_> = foot_points(&robot, &[0.0, 0.6, -1.1].repeat(4));
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
