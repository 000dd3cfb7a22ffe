//! What every body must hold, run on all of them.

use super::{JointSpace, PoseSpace, Skeleton, SkeletonJoint, SkeletonSpace};
use crate::base::random::SplitMix as Random;
use nalgebra::UnitQuaternion;
use std::sync::Arc;

/// A body with random poses: rotations up to `reach` radians from rest.
struct Body {
    name: &'static str,
    space: Box<dyn PoseSpace>,
    reach: f64,
}

fn skeleton() -> Skeleton {
    let joint = |name: &str, parent: Option<usize>, offset_m: [f64; 3]| SkeletonJoint {
        name: name.into(),
        parent,
        offset_m,
        rest: [0.0, 0.0, 0.0, 1.0],
    };
    let joints = vec![
        joint("hips", None, [0.0; 3]),
        joint("spine", Some(0), [0.0, 0.0, 0.2]),
        joint("head", Some(1), [0.05, 0.0, 0.4]),
        joint("leg", Some(0), [0.0, 0.1, -0.1]),
        joint("foot", Some(3), [0.0, 0.0, -0.8]),
    ];
    Skeleton::new(joints, UnitQuaternion::identity(), 1.0).expect("a good skeleton")
}

fn bodies() -> Vec<Body> {
    let names: Vec<String> = ["a", "b", "c"].map(String::from).to_vec();
    vec![
        Body {
            name: "fixed joints",
            space: Box::new(JointSpace::fixed(&names)),
            reach: 1.5,
        },
        Body {
            name: "floating joints",
            space: Box::new(JointSpace::floating(&names)),
            reach: 1.0,
        },
        Body {
            name: "skeleton",
            space: Box::new(SkeletonSpace::new(Arc::new(skeleton()))),
            reach: 1.2,
        },
    ]
}

impl Body {
    fn pose(&self, random: &mut Random) -> Vec<f64> {
        let mut pose = vec![0.0; self.space.len()];
        self.space.rest(&mut pose);
        let way: Vec<f64> = (0..self.space.tangent_len())
            .map(|_| self.reach / 3.0_f64.sqrt() * (2.0 * random.unit() - 1.0))
            .collect();
        self.space.add(&mut pose, &way, 1.0);
        pose
    }
}

#[test]
fn blending_is_exact_at_the_corners_and_independent_of_order() {
    for body in bodies() {
        let mut random = Random::new(3);
        let space = &body.space;
        let mut out = vec![0.0; space.len()];
        for _ in 0..200 {
            let poses: Vec<Vec<f64>> = (0..3).map(|_| body.pose(&mut random)).collect();
            let flat = poses.concat();
            for (i, pose) in poses.iter().enumerate() {
                let mut weights = [0.0; 3];
                weights[i] = 1.0;
                space.blend(&flat, &weights, &mut out);
                let off = largest(&out, pose);
                assert!(off < 1e-12, "{}: corner {i} off by {off}", body.name);
            }
            let weights = [0.5, 0.2, 0.3];
            space.blend(&flat, &weights, &mut out);
            let mut turned = vec![0.0; space.len()];
            let other = [&poses[2][..], &poses[0], &poses[1]].concat();
            space.blend(&other, &[0.3, 0.5, 0.2], &mut turned);
            let off = largest(&out, &turned);
            assert!(off < 1e-9, "{}: the order matters, {off}", body.name);
        }
    }
}

#[test]
fn a_pose_plus_the_way_to_another_is_that_other() {
    for body in bodies() {
        let mut random = Random::new(7);
        let space = &body.space;
        let mut way = vec![0.0; space.tangent_len()];
        for _ in 0..200 {
            let (a, b) = (body.pose(&mut random), body.pose(&mut random));
            space.diff(&a, &b, &mut way);
            let mut there = a.clone();
            space.add(&mut there, &way, 1.0);
            let off = space.distance(&there, &b);
            assert!(off < 1e-9, "{}: {off} m from the goal", body.name);
            space.diff(&a, &a, &mut way);
            let nothing = way.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            assert!(nothing < 1e-12, "{}: a to a is {nothing}", body.name);
            for scale in [1.0, -1.0, 0.4] {
                let (mut once, mut twice) = (b.clone(), b.clone());
                space.diff(&a, &b, &mut way);
                space.add(&mut twice, &way, scale);
                space.add_way(&mut once, &a, &b, scale, &mut way);
                let off = space.distance(&once, &twice);
                assert!(off < 1e-9, "{}: {off} m off at scale {scale}", body.name);
            }
            // Half the way is as far from one as from the other, along the way.
            space.diff(&a, &b, &mut way);
            let mut half = a.clone();
            space.add(&mut half, &way, 0.5);
            let (mut first, mut second) = (way.clone(), way.clone());
            space.diff(&a, &half, &mut first);
            space.diff(&half, &b, &mut second);
            let off = largest(&first, &second);
            assert!(off < 1e-9, "{}: halves differ by {off}", body.name);
        }
    }
}

#[test]
fn distances_are_those_of_a_metric_and_parts_cover_the_pose() {
    for body in bodies() {
        let mut random = Random::new(11);
        let space = &body.space;
        for _ in 0..100 {
            let [a, b, c] = [0; 3].map(|_| body.pose(&mut random));
            let (ab, bc, ac) = (
                space.distance(&a, &b),
                space.distance(&b, &c),
                space.distance(&a, &c),
            );
            assert!(
                space.distance(&a, &a) < 1e-12,
                "{}: a pose is itself",
                body.name
            );
            assert!(
                (space.distance(&b, &a) - ab).abs() < 1e-12,
                "{}: symmetry",
                body.name
            );
            assert!(ac <= ab + bc + 1e-12, "{}: {ac} > {ab} + {bc}", body.name);
        }
        let parts = space.parts();
        let mut at = (0, 0);
        for part in parts {
            assert_eq!(
                (part.coordinates.start, part.tangent.start),
                at,
                "{}",
                body.name
            );
            at = (part.coordinates.end, part.tangent.end);
        }
        assert_eq!(at, (space.len(), space.tangent_len()), "{}", body.name);
    }
}

fn largest(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}
