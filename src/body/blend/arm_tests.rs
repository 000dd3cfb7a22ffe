//! Blending on an arm: its end follows its own blend.

use super::tests::{BONE_M, BONES, error_over_weights};
use super::{Hybrid, NonLinear, Refine};
use crate::body::{Feet, JointSpace, PoseSpace, RobotEnds};
use crate::robot::RobotModel;
use nalgebra::Point3;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// The same chain as a robot: hinges about y, with room to move.
fn hinged() -> RobotModel {
    let mut urdf = String::from(r#"<robot name="chain"><link name="l0"/>"#);
    for i in 1..=BONES {
        let x = if i == 1 { 0.0 } else { BONE_M };
        urdf += &format!(
            r#"<link name="l{i}"/><joint name="q{i}" type="revolute"><parent link="l{}"/><child link="l{i}"/>
            <origin xyz="{x} 0 0"/><axis xyz="0 1 0"/><limit lower="-2.8" upper="2.8" effort="1" velocity="5"/></joint>"#,
            i - 1
        );
    }
    urdf += &format!(
        r#"<link name="tip"/><joint name="end" type="fixed"><parent link="l{BONES}"/><child link="tip"/><origin xyz="{BONE_M} 0 0"/></joint></robot>"#
    );
    RobotModel::from_urdf(&urdf).expect("a good chain")
}

/// Errors of the end effector against its own blend: linear, hybrid with one reference, with three.
fn arm_errors(from: &[f64], to: &[f64]) -> [f64; 3] {
    let model = hinged();
    let space = JointSpace::of_robot(&model, false);
    let ends = Arc::new(RobotEnds::new(model, &["tip"]).expect("a tip"));
    let mean = NonLinear::new().with_ends(ends.clone());
    let frame = [from, to].concat();
    let mut out = vec![0.0; space.len()];
    let goal = |w: &[f64]| {
        let (a, b) = (ends.position(from, 0), ends.position(to, 0));
        vec![Point3::from(a.coords * w[0] + b.coords * w[1])]
    };
    let linear = error_over_weights(
        &frame,
        goal,
        |w| {
            space.blend(&frame, w, &mut out);
            vec![ends.position(&out, 0)]
        },
        2,
    );
    let hybrid = |times: u32| {
        let mut hybrid = Hybrid::new(
            &space,
            &mean,
            std::slice::from_ref(&frame),
            true,
            Refine::Times(times),
        );
        let mut out = vec![0.0; space.len()];
        error_over_weights(
            &frame,
            goal,
            |w| {
                hybrid.blend(&space, 0.0, &frame, w, &mut out);
                vec![ends.position(&out, 0)]
            },
            2,
        )
    };
    [linear, hybrid(1), hybrid(2)]
}

#[test]
fn the_end_of_an_arm_follows_its_own_blend() {
    // From a curled chain to one bent by a right angle more; a joint takes its even share.
    let pose = |angle: f64| vec![angle / BONES as f64; BONES];
    let [linear, one, three] = arm_errors(&pose(1.6), &pose(1.6 + FRAC_PI_2));
    let figures = format!(
        "end effector off by {:.1} mm linear, {:.2} mm with one reference, {:.2} mm with three",
        linear * 1e3,
        one * 1e3,
        three * 1e3
    );
    println!("{figures}");
    assert!(linear > 0.02, "{figures}");
    assert!(one <= linear / 3.0, "{figures}");
    assert!(three <= linear / 6.0, "{figures}");
    // From dead straight the way back is a square root: one reference does less, three still help.
    let [linear, one, three] = arm_errors(&pose(0.0), &pose(FRAC_PI_2));
    println!(
        "from straight: {:.1} mm linear, {:.2} mm, {:.2} mm",
        linear * 1e3,
        one * 1e3,
        three * 1e3
    );
    assert!(
        three < one && one < linear,
        "from straight: {linear} m, {one} m, {three} m"
    );
}
