//! Legs of skeletons found, feet placed: on made-up skeletons and random goals.

use super::*;
use crate::base::random::SplitMix as Random;
use crate::body::SkeletonJoint;
use proptest::prelude::*;

type Row = (&'static str, Option<usize>, [f64; 3]);

fn skeleton(rows: &[Row]) -> Arc<Skeleton> {
    let joints = (rows.iter())
        .map(|(name, parent, offset_m)| SkeletonJoint {
            name: (*name).into(),
            parent: *parent,
            offset_m: *offset_m,
            rest: [0.0, 0.0, 0.0, 1.0],
        })
        .collect();
    Arc::new(Skeleton::new(joints, UnitQuaternion::identity(), 1.0).expect("a good skeleton"))
}

/// A human: straight legs with toes, arms that hang to the thigh.
fn human() -> Arc<Skeleton> {
    skeleton(&[
        ("Hips", None, [0.0; 3]),
        ("Spine", Some(0), [0.0, 0.0, 0.3]),
        ("Head", Some(1), [0.0, 0.0, 0.4]),
        ("UpperArm_L", Some(1), [0.0, 0.2, 0.2]),
        ("LowerArm_L", Some(3), [0.0, 0.0, -0.3]),
        ("Hand_L", Some(4), [0.0, 0.0, -0.3]),
        ("UpperLeg_R", Some(0), [0.0, -0.1, 0.0]),
        ("LowerLeg_R", Some(6), [0.0, 0.0, -0.4]),
        ("Foot_R", Some(7), [0.0, 0.0, -0.4]),
        ("Toes_R", Some(8), [0.15, 0.0, -0.08]),
        ("UpperLeg_L", Some(0), [0.0, 0.1, 0.0]),
        ("LowerLeg_L", Some(10), [0.0, 0.0, -0.4]),
        ("Foot_L", Some(11), [0.0, 0.0, -0.4]),
        ("Toes_L", Some(12), [0.15, 0.0, -0.08]),
    ])
}

/// A dog without telling names: digitigrade hind legs, a shoulder blade, a tail that hangs low.
fn dog() -> Arc<Skeleton> {
    let mut rows: Vec<Row> = vec![("root", None, [0.0; 3])];
    let side = |rows: &mut Vec<Row>, names: [&'static str; 8], y: f64| {
        let at = rows.len();
        rows.push((names[0], Some(0), [-0.1, y, 0.0]));
        rows.push((names[1], Some(at), [0.05, 0.0, -0.2]));
        rows.push((names[2], Some(at + 1), [-0.12, 0.0, -0.15]));
        rows.push((names[3], Some(at + 2), [0.05, 0.0, -0.15]));
        rows.push((names[4], Some(0), [0.5, y, 0.05]));
        rows.push((names[5], Some(at + 4), [0.03, 0.0, -0.1]));
        rows.push((names[6], Some(at + 5), [-0.05, 0.0, -0.2]));
        rows.push((names[7], Some(at + 6), [0.02, 0.0, -0.25]));
    };
    side(
        &mut rows,
        ["a0", "a1", "a2", "a3", "a4", "a5", "a6", "a7"],
        0.08,
    );
    side(
        &mut rows,
        ["b0", "b1", "b2", "b3", "b4", "b5", "b6", "b7"],
        -0.08,
    );
    let at = rows.len();
    rows.push(("tail1", Some(0), [-0.2, 0.0, 0.0]));
    rows.push(("tail2", Some(at), [-0.1, 0.0, -0.2]));
    rows.push(("tail3", Some(at + 1), [-0.1, 0.0, -0.28]));
    skeleton(&rows)
}

#[test]
fn what_is_no_leg_is_refused_with_the_names_that_there_are() {
    let snake = skeleton(&[
        ("root", None, [0.0; 3]),
        ("tail1", Some(0), [-0.3, 0.0, 0.0]),
        ("tail2", Some(1), [-0.3, 0.0, 0.0]),
        ("tail3", Some(2), [-0.3, 0.0, 0.0]),
    ]);
    let message = SkeletonFeet::find(snake.clone(), &[])
        .expect_err("no legs")
        .to_string();
    assert!(
        message.contains("tail3") && message.contains("left="),
        "{message}"
    );
    let message = SkeletonLeg::to_foot(&human(), "left", "Toe_L")
        .expect_err("wrong name")
        .to_string();
    assert!(message.contains("did you mean Toes_L"), "{message}");
    let message = SkeletonLeg::to_foot(&snake, "left", "tail1")
        .expect_err("too short")
        .to_string();
    assert!(
        message.contains("hip, knee and foot are needed"),
        "{message}"
    );
    let leg = |hip, knee, ankle, foot| SkeletonLeg {
        name: "left".into(),
        hip,
        knee,
        ankle,
        foot,
    };
    for wrong in [
        leg(8, 7, 6, 9),
        leg(6, 6, 8, 9),
        leg(6, 7, 8, 13),
        leg(6, 7, 8, 99),
    ] {
        let refused = SkeletonFeet::with_legs(human(), vec![wrong.clone()], &[]);
        assert!(
            matches!(refused, Err(SkeletonFeetError::Leg { .. })),
            "{wrong:?}"
        );
    }
}

#[test]
fn legs_are_found_by_name_and_by_where_they_end_and_named_by_corner() {
    let named = |skeleton: &Arc<Skeleton>| -> Vec<(String, [String; 4])> {
        let feet = SkeletonFeet::find(skeleton.clone(), &[]).expect("legs");
        let name = |j: usize| skeleton.joints[j].name.clone();
        (feet.legs().iter())
            .map(|l| (l.name.clone(), [l.hip, l.knee, l.ankle, l.foot].map(name)))
            .collect()
    };
    let of = |leg: &str, joints: [&str; 4]| (leg.to_string(), joints.map(String::from));
    assert_eq!(
        named(&human()),
        [
            of("left", ["UpperLeg_L", "LowerLeg_L", "Foot_L", "Toes_L"]),
            of("right", ["UpperLeg_R", "LowerLeg_R", "Foot_R", "Toes_R"]),
        ]
    );
    assert_eq!(
        named(&dog()),
        [
            of("front_left", ["a5", "a6", "a7", "a7"]),
            of("front_right", ["b5", "b6", "b7", "b7"]),
            of("rear_left", ["a0", "a1", "a2", "a3"]),
            of("rear_right", ["b0", "b1", "b2", "b3"]),
        ]
    );
}

/// Skeletons with a random pose around rest.
fn random_pose(skeleton: &Skeleton, random: &mut Random, reach: f64) -> Vec<f64> {
    let mut pose = skeleton.rest_pose([0.1, -0.2, 0.9]);
    for joint in 0..skeleton.len() {
        let turn = [0; 3].map(|_| reach * (2.0 * random.unit() - 1.0));
        let turn = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
        Skeleton::set_rotation(&mut pose, joint, &turn);
    }
    pose
}

proptest! {
    #[test]
    fn a_foot_is_where_it_was_put_and_nothing_else_moves(seed in any::<u64>(), reach in 0.0..0.8f64) {
        let mut random = Random::new(seed);
        for skeleton in [human(), dog()] {
            let feet = SkeletonFeet::find(skeleton.clone(), &[]).expect("legs");
            for foot in 0..feet.count() {
                let mut pose = random_pose(&skeleton, &mut random, reach);
                let leg = feet.legs()[foot].clone();
                // Goals that the leg takes in another pose are within reach.
                let mut other = pose.clone();
                for joint in [leg.hip, leg.knee, leg.ankle] {
                    let turn = [0; 3].map(|_| 1.6 * (random.unit() - 0.5));
                    let turned = Skeleton::rotation(&other, joint)
                        * UnitQuaternion::from_scaled_axis(Vector3::from(turn));
                    Skeleton::set_rotation(&mut other, joint, &turned);
                }
                let goal = feet.position(&other, foot);
                let before = pose.clone();
                let left = feet.place(&mut pose, foot, goal);
                prop_assert!(left < 1e-6, "{}: {left} m off", leg.name);
                prop_assert!((feet.position(&pose, foot) - goal).norm() < 1e-6);
                let moved: Vec<usize> = (0..pose.len()).filter(|i| pose[*i] != before[*i]).collect();
                let own = [leg.hip, leg.knee, leg.ankle].map(|j| 3 + 4 * j..7 + 4 * j);
                prop_assert!(moved.iter().all(|i| own.iter().any(|r| r.contains(i))), "{moved:?} moved");
                for j in own {
                    let norm: f64 = pose[j].iter().map(|v| v * v).sum();
                    prop_assert!((norm - 1.0).abs() < 1e-12);
                }
                // Once more to the same place changes next to nothing.
                let mut again = pose.clone();
                feet.place(&mut again, foot, goal);
                let drift = pose.iter().zip(&again).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
                prop_assert!(drift < 1e-6, "placing again moves by {drift}");
            }
        }
    }

    #[test]
    fn a_goal_out_of_reach_is_approached_and_the_distance_told(x in -3.0..3.0f64, z in -3.0..3.0f64) {
        for skeleton in [human(), dog()] {
            let feet = SkeletonFeet::find(skeleton.clone(), &[]).expect("legs");
            for foot in 0..feet.count() {
                let mut pose = skeleton.rest_pose([0.0, 0.0, 0.9]);
                let hip = skeleton.position(&pose, feet.legs()[foot].hip);
                let goal = hip + Vector3::new(x, 0.4, z);
                let left = feet.place(&mut pose, foot, goal);
                prop_assert!(pose.iter().all(|v| v.is_finite()));
                let wanted = ((goal - hip).norm() - feet.reach_m(foot)).max(0.0);
                if wanted > 0.0 {
                    prop_assert!((left - wanted).abs() < 1e-6, "{left} m left, {wanted} m out of reach");
                }
            }
        }
    }
}

#[test]
fn knees_bend_forwards_and_hocks_backwards_as_the_foot_comes_up() {
    let human = human();
    let feet = SkeletonFeet::find(human.clone(), &[]).expect("legs");
    let mut pose = human.rest_pose([0.0, 0.0, 0.88]);
    let from = feet.position(&pose, 0);
    for k in 0..40 {
        let up = 0.01 * f64::from(k);
        let left = feet.place(&mut pose, 0, from + Vector3::new(0.0, 0.0, up));
        assert!(left < 1e-6, "{left} m off at {up} m");
        let knee = human.position(&pose, feet.legs()[0].knee);
        assert!(
            k == 0 || knee.x > 0.0,
            "the knee is at {} m, {up} m up",
            knee.x
        );
    }
    let dog = dog();
    let feet = SkeletonFeet::find(dog.clone(), &[]).expect("legs");
    let mut pose = dog.rest_pose([0.0, 0.0, 0.5]);
    let (leg, from) = (feet.legs()[2].clone(), feet.position(&pose, 2));
    let side = |pose: &[f64]| {
        let [h, k, a] = [leg.hip, leg.knee, leg.ankle].map(|j| dog.position(pose, j));
        (h - k).cross(&(a - k)).y
    };
    let before = side(&pose);
    for k in 0..30 {
        let up = 0.01 * f64::from(k);
        let left = feet.place(&mut pose, 2, from + Vector3::new(0.02, 0.0, up));
        assert!(left < 1e-6, "{left} m off at {up} m");
        assert!(
            side(&pose) * before > 0.0,
            "the knee changed its side {up} m up"
        );
    }
}

#[test]
fn a_foot_keeps_its_orientation_while_the_ankle_reaches() {
    let human = human();
    let feet = SkeletonFeet::find(human.clone(), &[]).expect("legs");
    let mut pose = human.rest_pose([0.0, 0.0, 0.8]);
    let ankle = feet.legs()[1].ankle;
    let goal = feet.position(&pose, 1) + Vector3::new(0.1, 0.02, 0.15);
    assert!(feet.place(&mut pose, 1, goal) < 1e-9);
    let turned = human.frame(&pose, ankle).rotation.angle();
    assert!(turned < 1e-9, "the foot turned by {turned} rad");
}
