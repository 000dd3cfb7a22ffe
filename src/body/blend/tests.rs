//! Blending on a skeleton and on an arm: corners, references, the bent chain, epsilon, order.

use super::{Hybrid, NonLinear, Refine, antipodal};
use crate::base::random::SplitMix;
use crate::body::{Feet, PoseSpace, Skeleton, SkeletonEnds, SkeletonJoint, SkeletonSpace};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

pub(super) const BONES: usize = 8;
pub(super) const BONE_M: f64 = 0.1;

/// A chain of ball joints along x, `BONES` bones of 10 cm.
fn chain() -> Arc<Skeleton> {
    let joint = |i: usize| SkeletonJoint {
        name: format!("j{i}"),
        parent: i.checked_sub(1),
        offset_m: [if i == 0 { 0.0 } else { BONE_M }, 0.0, 0.0],
        rest: [0.0, 0.0, 0.0, 1.0],
    };
    let joints = (0..=BONES).map(joint).collect();
    Arc::new(Skeleton::new(joints, UnitQuaternion::identity(), 1.0).expect("a good chain"))
}

/// The chain bent by `angle` about `axis` in all, evenly.
fn bent(skeleton: &Skeleton, axis: Vector3<f64>, angle: f64) -> Vec<f64> {
    let mut pose = skeleton.rest_pose([0.0, 0.0, 1.0]);
    for joint in 1..BONES {
        let turn = axis.normalize() * (angle / (BONES - 1) as f64);
        Skeleton::set_rotation(&mut pose, joint, &UnitQuaternion::from_scaled_axis(turn));
    }
    pose
}

/// A limb whose three joints turn by `angles` about different axes: large turns, so that ways differ.
fn thrown(skeleton: &Skeleton, turns: [[f64; 3]; 3]) -> Vec<f64> {
    let mut pose = skeleton.rest_pose([0.0, 0.0, 1.0]);
    for (joint, turn) in [0, 3, 6].into_iter().zip(turns) {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
        Skeleton::set_rotation(&mut pose, joint, &turn);
    }
    pose
}

fn places(skeleton: &Skeleton, pose: &[f64]) -> Vec<Point3<f64>> {
    let mut frames = vec![Isometry3::identity(); skeleton.len()];
    skeleton.frames(pose, &mut frames);
    frames
        .iter()
        .map(|f| Point3::from(f.translation.vector))
        .collect()
}

fn length(places: &[Point3<f64>]) -> f64 {
    places.windows(2).map(|p| (p[1] - p[0]).norm()).sum()
}

fn farthest(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).norm())
        .fold(0.0, f64::max)
}

/// Poses of one frame, and the largest distance of a blend to the non-linear one over 101 weights.
pub(super) fn error_over_weights(
    frame: &[f64],
    mut truth: impl FnMut(&[f64]) -> Vec<Point3<f64>>,
    mut blend: impl FnMut(&[f64]) -> Vec<Point3<f64>>,
    poses: usize,
) -> f64 {
    assert!(!frame.is_empty());
    (0..=100)
        .map(|k| {
            let w = f64::from(k) / 100.0;
            let mut weights = vec![0.0; poses];
            // Over all poses: along the first edge, with the others in a fixed share for three and more.
            let rest = if poses > 2 { 0.3 } else { 0.0 };
            weights[0] = (1.0 - w) * (1.0 - rest);
            weights[1] = w * (1.0 - rest);
            for weight in &mut weights[2..] {
                *weight = rest / (poses - 2) as f64;
            }
            farthest(&truth(&weights), &blend(&weights))
        })
        .fold(0.0, f64::max)
}

fn large_turns(skeleton: &Skeleton) -> [Vec<f64>; 3] {
    [
        thrown(
            skeleton,
            [[0.0, 1.2, 0.0], [0.0, 0.0, 1.3], [1.0, 0.0, 0.9]],
        ),
        thrown(
            skeleton,
            [[0.0, -1.2, 0.4], [0.9, 0.0, -1.2], [-1.0, 1.1, 0.0]],
        ),
        thrown(
            skeleton,
            [[1.2, 0.0, -0.8], [-1.0, 1.0, 0.0], [0.0, -1.0, -1.1]],
        ),
    ]
}

#[test]
fn a_corner_is_that_pose_bit_for_bit_and_a_reference_is_the_non_linear_blend() {
    let skeleton = chain();
    let space = SkeletonSpace::new(Arc::clone(&skeleton));
    let frame = large_turns(&skeleton).concat();
    let mut mean = NonLinear::new();
    let mut hybrid = Hybrid::new(
        &space,
        &mean,
        std::slice::from_ref(&frame),
        true,
        Refine::Times(3),
    );
    let len = space.len();
    let (mut a, mut b) = (vec![0.0; len], vec![0.0; len]);
    for corner in 0..3 {
        let mut weights = [0.0; 3];
        weights[corner] = 1.0;
        mean.blend(&space, &frame, &weights, &mut a);
        assert_eq!(
            a,
            frame[corner * len..(corner + 1) * len],
            "corner {corner}"
        );
        hybrid.blend(&space, 0.0, &frame, &weights, &mut b);
        let off = farthest(&places(&skeleton, &a), &places(&skeleton, &b));
        assert!(off < 1e-12, "hybrid corner {corner} is {off} m off");
    }
    let references = hybrid.references().to_vec();
    assert!(references.len() > 6, "{} references", references.len());
    for weights in references {
        mean.blend(&space, &frame, &weights, &mut a);
        hybrid.blend(&space, 0.0, &frame, &weights, &mut b);
        let off = farthest(&places(&skeleton, &a), &places(&skeleton, &b));
        assert!(off < 1e-9, "reference {weights:?}: {off} m off");
    }
}

#[test]
fn a_chain_bent_to_a_right_angle_keeps_its_length() {
    let skeleton = chain();
    let space = SkeletonSpace::new(Arc::clone(&skeleton));
    let straight = bent(&skeleton, Vector3::y(), 0.0);
    let curled = bent(&skeleton, Vector3::y(), FRAC_PI_2);
    let full = BONES as f64 * BONE_M;
    let (a, b) = (places(&skeleton, &straight), places(&skeleton, &curled));
    let halves: Vec<Point3<f64>> = a
        .iter()
        .zip(&b)
        .map(|(a, b)| nalgebra::center(a, b))
        .collect();
    let shortened = 1.0 - length(&halves) / full;
    assert!(
        shortened > 0.05,
        "places blended linearly lose {:.1} %",
        100.0 * shortened
    );
    let frame = [straight, curled].concat();
    let mut out = vec![0.0; space.len()];
    NonLinear::new().blend(&space, &frame, &[0.5, 0.5], &mut out);
    let kept = length(&places(&skeleton, &out));
    assert!(
        (kept / full - 1.0).abs() < 1e-9,
        "non-linear: {kept} m of {full} m"
    );
    space.blend(&frame, &[0.5, 0.5], &mut out);
    let kept = length(&places(&skeleton, &out));
    assert!(
        (kept / full - 1.0).abs() < 1e-9,
        "bones have one length: {kept} m of {full} m"
    );
}

#[test]
fn on_a_skeleton_three_references_take_what_the_quick_mean_gets_wrong() {
    let skeleton = chain();
    let space = SkeletonSpace::new(Arc::clone(&skeleton));
    for poses in [2, 3] {
        let frame = large_turns(&skeleton)[..poses].concat();
        let mut mean = NonLinear::new();
        let mut run = |hybrid: Option<&mut Hybrid>| {
            let (mut x, mut y) = (vec![0.0; space.len()], vec![0.0; space.len()]);
            let mut hybrid = hybrid;
            error_over_weights(
                &frame,
                |w| {
                    mean.blend(&space, &frame, w, &mut x);
                    places(&skeleton, &x)
                },
                |w| {
                    match &mut hybrid {
                        Some(h) => h.blend(&space, 0.0, &frame, w, &mut y),
                        None => space.blend(&frame, w, &mut y),
                    }
                    places(&skeleton, &y)
                },
                poses,
            )
        };
        let linear = run(None);
        let mut of = |times: u32| {
            let frames = std::slice::from_ref(&frame);
            let mut h = Hybrid::new(
                &space,
                &NonLinear::new(),
                frames,
                true,
                Refine::Times(times),
            );
            (h.report().references, run(Some(&mut h)))
        };
        let (first, second, fourth) = (of(1), of(2), of(4));
        let figures = format!(
            "{poses} poses: {:.1} mm linear, {:.2} mm with {} references, {:.2} mm with {}, {:.2} mm with {}",
            linear * 1e3,
            first.1 * 1e3,
            first.0,
            second.1 * 1e3,
            second.0,
            fourth.1 * 1e3,
            fourth.0
        );
        println!("{figures}");
        assert!(linear > 5e-3, "{figures}");
        if poses == 2 {
            // Half-way both means are the same by symmetry: one reference there is worth nothing.
            assert!((first.1 / linear - 1.0).abs() < 1e-6, "{figures}");
            assert!(
                second.1 < 0.7 * linear && fourth.1 <= linear / 6.0,
                "{figures}"
            );
        } else {
            assert!(fourth.1 <= linear / 2.0, "{figures}");
        }
    }
}

#[test]
fn epsilon_is_kept_and_memory_falls_as_it_grows() {
    let skeleton = chain();
    let space = SkeletonSpace::new(Arc::clone(&skeleton));
    let frame = large_turns(&skeleton).concat();
    let mut mean = NonLinear::new();
    let mut before = usize::MAX;
    for epsilon_m in [3e-3, 6e-3, 12e-3, 0.05, 1.0] {
        let refine = Refine::Until {
            epsilon_m,
            most: 2000,
        };
        let mut hybrid = Hybrid::new(&space, &mean, std::slice::from_ref(&frame), true, refine);
        let report = hybrid.report();
        let (mut x, mut y) = (vec![0.0; space.len()], vec![0.0; space.len()]);
        let mut worst = error_over_weights(
            &frame,
            |w| {
                mean.blend(&space, &frame, w, &mut x);
                places(&skeleton, &x)
            },
            |w| {
                hybrid.blend(&space, 0.0, &frame, w, &mut y);
                places(&skeleton, &y)
            },
            3,
        );
        let mut random = SplitMix::new(9);
        for _ in 0..300 {
            let mut w = [random.unit(), random.unit(), random.unit()];
            let sum: f64 = w.iter().sum();
            w.iter_mut().for_each(|v| *v /= sum);
            mean.blend(&space, &frame, &w, &mut x);
            hybrid.blend(&space, 0.0, &frame, &w, &mut y);
            worst = worst.max(farthest(&places(&skeleton, &x), &places(&skeleton, &y)));
        }
        println!("epsilon {epsilon_m} m: worst {worst:.5} m, {report:?}");
        assert!(
            report.reached && worst <= epsilon_m,
            "epsilon {epsilon_m}: {worst} m, {report:?}"
        );
        assert!(
            report.bytes < before || report.bytes == 0,
            "epsilon {epsilon_m}: {report:?}"
        );
        before = report.bytes;
    }
    assert_eq!(before, 0, "an epsilon of a metre needs no table");
}

#[test]
fn the_mean_does_not_depend_on_order_or_signs_and_halves_the_way_between_two() {
    let skeleton = chain();
    let space = SkeletonSpace::new(Arc::clone(&skeleton));
    let mut random = SplitMix::new(21);
    let mut mean = NonLinear::new();
    let len = space.len();
    let mut worst = 0.0_f64;
    for _ in 0..100 {
        let mut pose = || {
            let mut pose = skeleton.rest_pose([random.unit(), 0.0, 1.0]);
            let way: Vec<f64> = (0..space.tangent_len())
                .map(|_| 0.8 * (2.0 * random.unit() - 1.0))
                .collect();
            space.add(&mut pose, &way, 1.0);
            pose
        };
        let [a, b, c] = [pose(), pose(), pose()];
        let (mut x, mut y) = (vec![0.0; len], vec![0.0; len]);
        mean.blend(&space, &[&a[..], &b, &c].concat(), &[0.2, 0.5, 0.3], &mut x);
        let negative: Vec<f64> = a[..3]
            .iter()
            .copied()
            .chain(a[3..].iter().map(|v| -v))
            .collect();
        mean.blend(
            &space,
            &[&c[..], &negative, &b].concat(),
            &[0.3, 0.2, 0.5],
            &mut y,
        );
        worst = worst.max(farthest(&places(&skeleton, &x), &places(&skeleton, &y)));
        mean.blend(&space, &[&a[..], &b].concat(), &[0.5, 0.5], &mut x);
        let (mut first, mut second) = (
            vec![0.0; space.tangent_len()],
            vec![0.0; space.tangent_len()],
        );
        space.diff(&a, &x, &mut first);
        space.diff(&x, &b, &mut second);
        let off = first
            .iter()
            .zip(&second)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(off < 1e-9, "halves differ by {off}");
        assert_eq!(mean.ambiguous(), 0);
    }
    assert!(worst < 1e-9, "order or sign moves a joint by {worst} m");
}

#[test]
fn opposite_rotations_are_flagged() {
    let skeleton = chain();
    let space = SkeletonSpace::new(Arc::clone(&skeleton));
    let a = skeleton.rest_pose([0.0; 3]);
    let mut b = a.clone();
    Skeleton::set_rotation(
        &mut b,
        2,
        &UnitQuaternion::from_scaled_axis(Vector3::z() * (PI - 0.02)),
    );
    let mut near = a.clone();
    Skeleton::set_rotation(
        &mut near,
        2,
        &UnitQuaternion::from_scaled_axis(Vector3::z() * 2.9),
    );
    let found = antipodal(&space, &[&a[..], &near, &b].concat());
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].joint == "j2" && (found[0].first, found[0].second) == (0, 2),
        "{found:?}"
    );
    assert!((found[0].angle_rad - (PI - 0.02)).abs() < 1e-6, "{found:?}");
    let mut mean = NonLinear::new();
    let mut out = vec![0.0; space.len()];
    mean.blend(&space, &[&a[..], &b].concat(), &[0.5, 0.5], &mut out);
    assert_eq!(mean.ambiguous(), 1);
    assert!(out.iter().all(|v| v.is_finite()), "{out:?}");
}

#[test]
fn the_end_of_a_limb_goes_where_the_mean_of_its_places_is() {
    let skeleton = chain();
    let space = SkeletonSpace::new(Arc::clone(&skeleton));
    let feet = SkeletonEnds::new(Arc::clone(&skeleton))
        .with_limb("hand", "j8", 6)
        .expect("a limb");
    assert!(
        SkeletonEnds::new(Arc::clone(&skeleton))
            .with_limb("hand", "j8", 9)
            .is_none()
    );
    let feet = Arc::new(feet);
    let [a, b, c] = large_turns(&skeleton);
    let frame = [&a[..], &b, &c].concat();
    let weights = [0.25, 0.35, 0.4];
    let mut mean = NonLinear::new().with_ends(feet.clone());
    let mut out = vec![0.0; space.len()];
    mean.blend(&space, &frame, &weights, &mut out);
    let goal: Vector3<f64> = [&a, &b, &c]
        .iter()
        .zip(weights)
        .map(|(p, w)| feet.position(p, 0).coords * w)
        .sum();
    let off = (feet.position(&out, 0).coords - goal).norm();
    assert!(
        off < 1e-6 && mean.end_error_m() < 1e-6,
        "{off} m from the mean of the places"
    );
    for joint in 0..skeleton.len() {
        let norm = Skeleton::rotation(&out, joint).norm();
        assert!((norm - 1.0).abs() < 1e-9, "joint {joint}: {norm}");
    }
}

#[test]
fn over_a_cycle_the_table_follows_between_its_frames() {
    let skeleton = chain();
    let space = SkeletonSpace::new(Arc::clone(&skeleton));
    let [a, b, _] = large_turns(&skeleton);
    let frame = |u: f64| {
        let swing = 0.4 * (2.0 * PI * u).sin();
        let mut moved = [a.clone(), b.clone()];
        for (k, pose) in moved.iter_mut().enumerate() {
            let way = vec![swing * (0.6 + 0.4 * k as f64); space.tangent_len()];
            space.add(pose, &way, 1.0);
        }
        moved.concat()
    };
    let frames: Vec<Vec<f64>> = (0..24).map(|k| frame(f64::from(k) / 24.0)).collect();
    let mut mean = NonLinear::new();
    let mut hybrid = Hybrid::new(&space, &mean, &frames, true, Refine::Times(2));
    let (mut x, mut y) = (vec![0.0; space.len()], vec![0.0; space.len()]);
    let mut worst = 0.0_f64;
    for k in 0..96 {
        let u = f64::from(k) / 96.0;
        let poses = frame(u);
        // A reference: there the only error is between frames.
        mean.blend(&space, &poses, &[0.75, 0.25], &mut x);
        hybrid.blend(&space, u, &poses, &[0.75, 0.25], &mut y);
        let off = farthest(&places(&skeleton, &x), &places(&skeleton, &y));
        assert!(k % 4 != 0 || off < 1e-9, "at frame {}: {off} m off", k / 4);
        worst = worst.max(off);
    }
    assert!(worst < 2e-4, "between frames {worst} m off");
}
