//! Ways of blending in a class: what a configuration may ask for, and that a table keeps what it promises.

mod support;

use handwave::body::blend::{BlendingKind, NonLinear};
use handwave::body::{Feet, JointSpace, PoseSpace, RobotEnds};
use handwave::motion::class::{BlendSpec, ClassError, ClassOptions, Drive, Example, MotionClass};
use handwave::motion::clip::ClipFile;
use handwave::robot::RobotModel;
use nalgebra::Point3;
use std::sync::Arc;
use support::folder::Folder;
use support::program::{refused, run_virtual};

const LINKS: usize = 4;
const TOLERANCE_M: f64 = 0.002;

/// An arm of four links of 0.2 m, all hinges about y.
fn arm() -> RobotModel {
    let mut urdf = String::from(r#"<robot name="arm"><link name="l0"/>"#);
    for i in 1..=LINKS {
        let x = if i == 1 { 0.0 } else { 0.2 };
        urdf += &format!(
            r#"<link name="l{i}"/><joint name="q{i}" type="revolute"><parent link="l{}"/><child link="l{i}"/>
            <origin xyz="{x} 0 0"/><axis xyz="0 1 0"/><limit lower="-2.8" upper="2.8" effort="1" velocity="5"/></joint>"#,
            i - 1
        );
    }
    urdf += &format!(
        r#"<link name="tip"/><joint name="end" type="fixed"><parent link="l{LINKS}"/><child link="tip"/><origin xyz="0.2 0 0"/></joint></robot>"#
    );
    RobotModel::from_urdf(&urdf).expect("a good arm")
}

struct Arm {
    space: JointSpace,
    ends: Arc<RobotEnds>,
}

impl Arm {
    fn new() -> Self {
        let model = arm();
        Self {
            space: JointSpace::of_robot(&model, false),
            ends: Arc::new(RobotEnds::new(model, &["tip"]).expect("a tip")),
        }
    }

    /// A path whose joints go from `from` to `to`, with parameter `turn`.
    fn example(&self, name: &str, from: f64, to: f64, turn: f64) -> Example {
        let frames: Vec<String> = (0..16)
            .map(|k| {
                let angle = from + (to - from) * f64::from(k) / 15.0;
                format!("{:?}", vec![angle; LINKS])
            })
            .collect();
        let names: Vec<String> = (1..=LINKS).map(|i| format!("\"q{i}\"")).collect();
        let json = format!(
            r#"{{"handwave": "clip", "version": 1, "name": "{name}", "kind": "path", "joints": [{}], "frames": [{}]}}"#,
            names.join(", "),
            frames.join(", ")
        );
        let file = ClipFile::from_json(&json).expect("a clip");
        Example {
            clip: file.for_space(&self.space).expect("of the arm"),
            parameters: [1.0, 0.0, turn].into(),
        }
    }

    fn class(&self, kind: BlendingKind, tolerance_m: f64) -> Result<MotionClass, ClassError> {
        let examples = vec![
            self.example("curled", 0.3, 0.5, -1.0),
            self.example("bent", 0.6, 1.0, 1.0),
        ];
        let options = ClassOptions {
            extra: vec!["turn".into()],
            ..ClassOptions::default()
        };
        let class = MotionClass::new("reach", examples, Vec::new(), options)?;
        let spec = BlendSpec {
            kind,
            mean: NonLinear::new().with_ends(self.ends.clone()),
            tolerance_m,
        };
        let blending = class.blending(&self.space, &spec)?;
        Ok(class.blended(blending))
    }

    /// How far the end is from the mean of its places, and from that of `other`, over all turns.
    fn errors(&self, class: &mut MotionClass, other: &mut MotionClass) -> (f64, f64) {
        let (mut pose, mut reference) = (vec![0.0; LINKS], vec![0.0; LINKS]);
        let mut clip = vec![0.0; LINKS];
        let (mut from_mean, mut from_other) = (0.0_f64, 0.0_f64);
        for k in 0..4000 {
            let drive = Drive {
                amplitude: 0.5 + 0.5 * (f64::from(k) * 0.004).sin(),
                extra: [(f64::from(k) * 0.0031).sin() * 1.2, 0.0],
                ..Drive::default()
            };
            let played = class.step(&self.space, drive, 0.005, &mut pose);
            other.step(&self.space, drive, 0.005, &mut reference);
            let end = self.ends.position(&pose, 0);
            let mut goal = Point3::origin();
            for (example, weight) in class.examples().iter().zip(class.weights()) {
                example.clip.pose(played.amplitude, &mut clip);
                goal += self.ends.position(&clip, 0).coords * *weight;
            }
            from_mean = from_mean.max((end - goal).norm());
            from_other = from_other.max((end - self.ends.position(&reference, 0)).norm());
        }
        (from_mean, from_other)
    }
}

#[test]
fn a_table_keeps_the_end_of_an_arm_within_its_tolerance() {
    let arm = Arm::new();
    let class = |kind| arm.class(kind, TOLERANCE_M).expect("a good class");
    let (linear, _) = arm.errors(
        &mut class(BlendingKind::Linear),
        &mut class(BlendingKind::NonLinear),
    );
    let (hybrid, apart) = arm.errors(
        &mut class(BlendingKind::Hybrid),
        &mut class(BlendingKind::NonLinear),
    );
    let (correct, _) = arm.errors(
        &mut class(BlendingKind::NonLinear),
        &mut class(BlendingKind::Linear),
    );
    let figures = format!(
        "end off its own blend by {:.2} mm linear, {:.3} mm hybrid, {:.4} mm non-linear; hybrid to non-linear {:.3} mm",
        1e3 * linear,
        1e3 * hybrid,
        1e3 * correct,
        1e3 * apart
    );
    println!("{figures}");
    assert!(linear > 2.0 * TOLERANCE_M, "{figures}");
    assert!(hybrid <= TOLERANCE_M && apart <= TOLERANCE_M, "{figures}");
    assert!(correct < 1e-4, "{figures}");
}

#[test]
fn at_its_references_a_table_is_the_non_linear_blend() {
    let arm = Arm::new();
    let spec = |kind| BlendSpec {
        kind,
        mean: NonLinear::new().with_ends(arm.ends.clone()),
        tolerance_m: TOLERANCE_M,
    };
    let class = arm.class(BlendingKind::Linear, 1.0).expect("good");
    let made = |kind| class.blending(&arm.space, &spec(kind)).expect("good");
    let (mut hybrid, mut correct) = (made(BlendingKind::Hybrid), made(BlendingKind::NonLinear));
    let (mut a, mut b) = (vec![0.0; LINKS], vec![0.0; LINKS]);
    let mut poses = vec![0.0; 2 * LINKS];
    // The corners, and the middle, where the first reference is; at frames of the table.
    for weights in [[1.0, 0.0], [0.5, 0.5], [0.0, 1.0]] {
        for k in 0..32 {
            let u = f64::from(k) / 31.0;
            for (example, pose) in class.examples().iter().zip(poses.chunks_exact_mut(LINKS)) {
                example.clip.pose(u, pose);
            }
            hybrid.blend(&arm.space, u, &poses, &weights, &mut a);
            correct.blend(&arm.space, u, &poses, &weights, &mut b);
            let off = arm.space.distance(&a, &b);
            assert!(off < 1e-9, "{off} m at {weights:?}, frame {k}");
        }
    }
}

#[test]
fn without_a_wish_a_class_blends_as_ever() {
    let arm = Arm::new();
    let mut class = arm.class(BlendingKind::Linear, 1.0).expect("good");
    let drive = Drive {
        amplitude: 0.7,
        extra: [0.3, 0.0],
        ..Drive::default()
    };
    let mut pose = vec![0.0; LINKS];
    for _ in 0..300 {
        let played = class.step(&arm.space, drive, 0.005, &mut pose);
        let mut poses = vec![0.0; 2 * LINKS];
        for (example, pose) in class.examples().iter().zip(poses.chunks_exact_mut(LINKS)) {
            let u = played.phase_rad / std::f64::consts::TAU;
            example.clip.pose(u, pose);
        }
        let mut expected = vec![0.0; LINKS];
        arm.space.blend(&poses, class.weights(), &mut expected);
        assert_eq!(pose, expected);
    }
}

#[test]
fn a_table_that_cannot_be_made_says_why() {
    let arm = Arm::new();
    let error = arm
        .class(BlendingKind::Hybrid, 1e-12)
        .expect_err("too fine");
    assert!(error.to_string().contains("tolerance_m"), "{error}");
    let examples: Vec<Example> = (0..7)
        .map(|k| {
            arm.example(
                &format!("c{k}"),
                0.1,
                0.2 + 0.1 * f64::from(k),
                f64::from(k),
            )
        })
        .collect();
    let options = ClassOptions {
        extra: vec!["turn".into()],
        ..ClassOptions::default()
    };
    let class = MotionClass::new("many", examples, Vec::new(), options).expect("good");
    let spec = BlendSpec {
        kind: BlendingKind::Hybrid,
        mean: NonLinear::new(),
        tolerance_m: TOLERANCE_M,
    };
    let error = class.blending(&arm.space, &spec).expect_err("seven clips");
    assert!(error.to_string().contains("at most 6 clips"), "{error}");
}

#[test]
fn bad_values_are_refused_with_file_line_and_key() {
    let folder = Folder::of_configs();
    let check = |file: &str, from: &str, to: &str, parts: &[&str]| {
        let before = folder.read(file);
        folder.edit(file, from, to);
        refused(run_virtual(&[&folder.text(file)]), 2, parts);
        folder.write(file, &before);
    };
    let class = "gesture = \"drum\"\n";
    let with = |keys: &str| format!("gesture = \"drum\"\n{keys}\n");
    let fox = |keys: &str, parts: &[&str]| check("fox.toml", class, &with(keys), parts);
    fox(
        "blending = \"quick\"",
        &["fox.toml:", "class.blending", "linear, non_linear, hybrid"],
    );
    fox(
        "blending = \"hybrid\"\ntolerance_m = -1.0",
        &["fox.toml:", "class.tolerance_m", "-1"],
    );
    fox(
        "tolerance_m = 0.01",
        &["fox.toml:", "class.tolerance_m", "hybrid"],
    );
    fox(
        "blending = \"non_linear\"\nends = [\"front_lef\"]",
        &["fox.toml:", "class.ends", "front_left"],
    );
    check(
        "quadruped.toml",
        class,
        &with("blending = \"hybrid\""),
        &["quadruped.toml:", "class.blending", "avatars and arms"],
    );
}

#[test]
fn the_fox_plays_with_every_blend() {
    let folder = Folder::of_configs();
    let before = folder.read("fox.toml");
    for keys in [
        "blending = \"non_linear\"",
        "blending = \"hybrid\"\ntolerance_m = 0.005",
        "blending = \"non_linear\"\nends = [\"front_left\", \"front_right\"]",
    ] {
        let to = format!("gesture = \"drum\"\n{keys}\n");
        folder.edit("fox.toml", "gesture = \"drum\"\n", &to);
        run_virtual(&[&folder.text("fox.toml")]).expect(0);
        folder.write("fox.toml", &before);
    }
}
