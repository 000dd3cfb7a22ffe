//! Analysis on motions of which everything is known.

use super::*;
use crate::body::{RootPose, Skeleton, SkeletonJoint};
use crate::motion::clip::ClipFile;
use crate::motion::take::TakeBody;
use crate::robot::RobotModel;
use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;
use std::f64::consts::TAU;
use std::sync::Arc;

fn pup() -> RobotModel {
    RobotModel::from_urdf(include_str!("../../../configs/robots/pup.urdf")).expect("shipped URDF")
}

/// The shipped trot, over the ground: its body is level where the clip does not tell it.
fn trot() -> Take {
    Take::of_clip(&trot_clip())
}

fn trot_clip() -> ClipFile {
    let text = include_str!("../../../configs/clips/trot_long.json");
    let mut clip = ClipFile::from_json(text).expect("a shipped clip");
    if clip.body.is_empty() {
        let model = pup();
        let legs = crate::robot::Leg::find_all(&model).expect("legs");
        let lowest = (clip.frames.iter())
            .flat_map(|frame| legs.iter().map(|l| l.foot_position(&model, frame).z))
            .fold(f64::INFINITY, f64::min);
        clip.body = vec![[0.0, 0.0, -lowest, 0.0, 0.0, 0.0]; clip.frames.len()];
    }
    clip
}

/// Two hinges that swing at `hz`, sampled for `seconds`; `drift` per second moves the first one away.
fn swinging(hz: f64, seconds: f64, dt_s: f64, drift: f64) -> Take {
    let n = (seconds / dt_s).round() as usize + 1;
    let poses = (0..n)
        .map(|k| {
            let t = k as f64 * dt_s;
            let u = TAU * hz * t;
            vec![u.sin() + drift * t, 0.6 * u.cos() + 0.3 * (2.0 * u).sin()]
        })
        .collect();
    Take {
        name: "swing".into(),
        origin: String::new(),
        dt_s,
        body: TakeBody::Joints(vec!["a".into(), "b".into()]),
        poses,
        roots: vec![RootPose::default(); n],
        wraps: false,
    }
}

fn body(take: &Take) -> BodyModel {
    BodyModel::of(take, None).expect("a body")
}

#[test]
fn takes_that_are_no_motion_are_refused_with_their_place() {
    let good = swinging(1.0, 2.0, 0.02, 0.0);
    let body = body(&good);
    type Break = (&'static str, fn(&mut Take));
    let broken: [Break; 5] = [
        ("2 are needed", |t| {
            t.poses.truncate(1);
            t.roots.truncate(1);
        }),
        ("time step 0 s", |t| t.dt_s = 0.0),
        ("roots for", |t| t.roots.truncate(3)),
        ("frame 4 has 1 numbers, 2 are needed", |t| {
            t.poses[4].truncate(1);
        }),
        ("frame 7 holds NaN", |t| t.poses[7][1] = f64::NAN),
    ];
    for (words, break_it) in broken {
        let mut take = good.clone();
        break_it(&mut take);
        let message = analyse(&take, &body).expect_err(words).to_string();
        assert!(message.contains(words), "{message}");
    }
    let model = pup();
    let strange = BodyModel::of(&good, Some(&model))
        .err()
        .expect("another robot")
        .to_string();
    assert!(strange.contains("its joints are a b"), "{strange}");
    let found = analyse(&good, &body).expect("a good take");
    let cycle = found.cycle.expect("a cycle");
    for frames in [0, 7, 1_000_000] {
        let options = cut::CutOptions {
            frames,
            ..Default::default()
        };
        let refused = cut::cycle(&good, &body, &cycle, &[], &options).expect_err("frames");
        assert!(refused.to_string().contains("8 to 100000"), "{refused}");
    }
    let outside = Cycle { start: 90, ..cycle };
    let refused = cut::cycle(&good, &body, &outside, &[], &cut::CutOptions::default());
    assert!(
        refused
            .expect_err("outside")
            .to_string()
            .contains("is not inside")
    );
}

#[test]
fn stillness_and_a_single_move_are_no_cycle() {
    let mut still = swinging(1.0, 3.0, 0.02, 0.0);
    let first = still.poses[0].clone();
    still.poses.iter_mut().for_each(|p| p.clone_from(&first));
    let mut once = swinging(1.0, 3.0, 0.02, 0.0);
    for (k, pose) in once.poses.iter_mut().enumerate() {
        let u = (k as f64 * 0.02 - 1.5) / 0.3;
        *pose = vec![(-u * u).exp(), 0.5 * u.clamp(-1.0, 1.0)];
    }
    for take in [still, once] {
        let found = analyse(&take, &body(&take)).expect("a take");
        assert_eq!(found.cycle, None);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn the_frequency_of_a_swing_is_found_between_frames(hz in 0.5..3.0f64, cycles in 2.2..6.0f64, noise in 0.0..0.02f64) {
        let mut take = swinging(hz, cycles / hz, 1.0 / 60.0, 0.0);
        let mut random = crate::base::random::SplitMix::new(5);
        take.poses.iter_mut().flatten().for_each(|v| *v += noise * (2.0 * random.unit() - 1.0));
        let found = analyse(&take, &body(&take)).expect("a take").cycle.expect("a cycle");
        let off = (found.frequency_hz / hz - 1.0).abs();
        prop_assert!(off < 0.02, "{} Hz found, {hz} Hz was it", found.frequency_hz);
    }

    #[test]
    fn a_closed_seam_is_closed_in_place_and_slope_and_moved_as_little_as_told(drift in -0.15..0.15f64) {
        let take = swinging(1.0, 3.0, 0.01, drift);
        let body = body(&take);
        let cycle = analyse(&take, &body).expect("a take").cycle.expect("a cycle");
        let options = cut::CutOptions { frames: 100, ..Default::default() };
        let cut = cut::cycle(&take, &body, &cycle, &[], &options).expect("a small seam");
        let frames = &cut.clip.frames;
        // The seam is the drift of one cycle, of one of two joints.
        let wanted = (drift / cycle.frequency_hz).abs() / 2.0_f64.sqrt();
        prop_assert!((cut.seam.distance_m - wanted).abs() < 0.02, "{:?}, {wanted} m expected", cut.seam);
        let step = |a: usize, b: usize, c: usize| frames[b % 100][c] - frames[a % 100][c];
        for c in 0..2 {
            let usual = (0..99).map(|k| (step(k + 1, k + 2, c) - step(k, k + 1, c)).abs()).fold(0.0, f64::max);
            for k in 97..100 {
                let kink = (step(k + 1, k + 2, c) - step(k, k + 1, c)).abs();
                prop_assert!(kink < 1.5 * usual + 1e-4, "joint {c} bends by {kink} at the seam, {usual} elsewhere");
            }
        }
        // Nothing was moved farther than reported.
        for (k, frame) in frames.iter().enumerate() {
            let (pose, _) = take.at((cycle.start as f64 + cycle.frames * k as f64 / 100.0) * take.dt_s);
            let moved = pose.iter().zip(frame).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            prop_assert!(moved <= cut.seam.moved + 1e-9, "frame {k} moved {moved}, {} told", cut.seam.moved);
        }
    }
}

#[test]
fn ends_too_far_apart_are_refused_with_their_distance() {
    let take = swinging(1.0, 3.0, 0.01, 0.0);
    let body = body(&take);
    let half = Cycle {
        start: 0,
        frames: 50.0,
        frequency_hz: 2.0,
        likeness: 1.0,
        closed: false,
    };
    let refused = cut::cycle(&take, &body, &half, &[], &cut::CutOptions::default());
    let message = refused.expect_err("half a cycle").to_string();
    assert!(message.contains("% of its motion"), "{message}");
}

#[test]
fn an_authored_trot_is_found_to_be_what_it_was_authored_as() {
    let model = pup();
    let clip = trot_clip();
    for take in [trot(), trot().repeated(3.3)] {
        let body = BodyModel::of(&take, Some(&model)).expect("its robot");
        let found = analyse(&take, &body).expect("a take");
        let cycle = found.cycle.expect("a cycle");
        let off = (cycle.frequency_hz / clip.frequency_hz - 1.0).abs();
        assert!(
            off < 0.005,
            "{} Hz, {} Hz authored",
            cycle.frequency_hz,
            clip.frequency_hz
        );
        let speed = clip.root.forward_m * clip.frequency_hz;
        let off = (found.travel.forward_m_s / speed - 1.0).abs();
        assert!(
            off < 0.01,
            "{} m/s, {speed} m/s authored",
            found.travel.forward_m_s
        );
        assert_eq!(found.feet.len(), 4);
        assert_eq!(found.gait, Some(Gait::Trot));
        for (foot, segment) in found.feet.iter().map(|f| {
            let segment = clip.segments.iter().find(|s| s.name == f.name);
            (f, segment.expect("its limb"))
        }) {
            let phase = foot.phase.expect("it touches down");
            let start = cycle.start as f64 / cycle.frames;
            let off = gait::apart(phase + start, segment.phase);
            assert!(
                off < 0.06,
                "{} touches down at {phase:.2}, {:.2} authored",
                foot.name,
                segment.phase
            );
            // Authored feet leave and meet the ground slowly: they stand a little longer than told.
            let off = (foot.duty - segment.duty).abs();
            assert!(
                off < 0.15,
                "{}: duty {:.2}, {:.2} authored",
                foot.name,
                foot.duty,
                segment.duty
            );
        }
    }
}

#[test]
fn a_trot_is_its_own_mirror_image_half_a_cycle_later_and_mirroring_twice_is_nothing() {
    let (model, take) = (pup(), trot());
    let body = BodyModel::of(&take, Some(&model)).expect("its robot");
    let mirror = mirror::Mirror::of(&take, &body).expect("legs are mirror images");
    let twice = mirror.take(&mirror.take(&take));
    for (a, b) in take.poses.iter().zip(&twice.poses) {
        let off = mirror::farthest(body.space(), a, b);
        assert!(off < 1e-12, "{off} rad from itself");
    }
    let cycle = analyse(&take, &body)
        .expect("a take")
        .cycle
        .expect("a cycle");
    let pairs = mirror::symmetry(&take, &body, &mirror, &cycle);
    assert_eq!(pairs.len(), 2, "front and rear legs: {pairs:?}");
    for pair in pairs {
        assert!(pair.likeness > 0.99, "{pair:?}");
        assert!((pair.shift - 0.5).abs() < 0.03, "{pair:?}");
    }
    let feet = body.feet().expect("four");
    {
        let other = mirror.take(&take);
        for (a, b) in take.poses.iter().zip(&other.poses).step_by(7) {
            for (left, right) in [(0, 1), (2, 3)] {
                let (p, q) = (feet.position(a, left), feet.position(b, right));
                let off = (p - nalgebra::Point3::new(q.x, -q.y, q.z)).norm();
                assert!(
                    off < 1e-9,
                    "{} is {off} m from the image of {}",
                    feet.name(right),
                    feet.name(left)
                );
            }
        }
    }
}

/// A skeleton whose right side has its axes turned round, as some tools write them.
fn biped() -> Arc<Skeleton> {
    let joint = |name: &str,
                 parent: Option<usize>,
                 offset_m: [f64; 3],
                 rest: UnitQuaternion<f64>| SkeletonJoint {
        name: name.into(),
        parent,
        offset_m,
        rest: rest.into_inner().coords.into(),
    };
    let none = UnitQuaternion::identity();
    let round = UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI);
    let joints = vec![
        joint("hips", None, [0.0; 3], none),
        joint("head", Some(0), [0.0, 0.0, 0.5], none),
        joint("leg_L", Some(0), [0.0, 0.1, 0.0], none),
        joint("shin_L", Some(2), [0.0, 0.0, -0.4], none),
        joint("foot_L", Some(3), [0.02, 0.0, -0.4], none),
        joint("leg_R", Some(0), [0.0, -0.1, 0.0], round),
        joint("shin_R", Some(5), [0.0, 0.0, 0.4], none),
        joint("foot_R", Some(6), [0.02, 0.0, 0.4], none),
    ];
    Arc::new(Skeleton::new(joints, none, 1.0).expect("a good skeleton"))
}

#[test]
fn mirroring_a_skeleton_mirrors_every_joint_whatever_its_axes() {
    let skeleton = biped();
    let rest = skeleton.rest_pose([0.0, 0.0, 0.8]);
    let poses: Vec<Vec<f64>> = (0..40)
        .map(|k| {
            let u = TAU * f64::from(k) / 40.0;
            let mut pose = rest.clone();
            let mut turn = |joint: usize, by: Vector3<f64>| {
                let turned =
                    Skeleton::rotation(&rest, joint) * UnitQuaternion::from_scaled_axis(by);
                Skeleton::set_rotation(&mut pose, joint, &turned);
            };
            turn(0, Vector3::new(0.1 * u.sin(), 0.05, 0.2 * u.cos()));
            turn(2, Vector3::new(0.1, 0.5 * u.sin(), 0.0));
            turn(3, Vector3::new(0.0, 0.3 + 0.3 * u.cos(), 0.0));
            // The right side's y axis points the other way.
            turn(5, Vector3::new(-0.1, 0.5 * u.sin(), 0.0));
            turn(6, Vector3::new(0.0, -0.3 + 0.3 * u.cos(), 0.0));
            pose[1] = 0.03 * u.sin();
            pose
        })
        .collect();
    let take = Take {
        name: "walk".into(),
        origin: String::new(),
        dt_s: 0.025,
        body: TakeBody::Skeleton(skeleton.clone()),
        roots: (0..40)
            .map(|k| RootPose {
                x_m: 0.02 * f64::from(k),
                y_m: 0.001 * f64::from(k),
                yaw_rad: 0.01 * f64::from(k),
            })
            .collect(),
        poses,
        wraps: false,
    };
    let body = body(&take);
    let mirror = mirror::Mirror::of(&take, &body).expect("a skeleton");
    assert_eq!(mirror.partners, [0, 1, 5, 6, 7, 2, 3, 4]);
    let other = mirror.take(&take);
    let twice = mirror.take(&other);
    for k in 0..take.len() {
        let off = mirror::farthest(body.space(), &take.poses[k], &twice.poses[k]);
        assert!(off < 1e-9, "frame {k}: mirrored twice is {off} rad off");
        for joint in 0..skeleton.len() {
            let seen = skeleton.position(&take.poses[k], joint);
            let image = skeleton.position(&other.poses[k], mirror.partners[joint]);
            let off = (seen - nalgebra::Point3::new(image.x, -image.y, image.z)).norm();
            assert!(
                off < 1e-9,
                "frame {k}, {}: {off} m from its image",
                skeleton.joints[joint].name
            );
        }
        assert_eq!(other.roots[k].yaw_rad, -take.roots[k].yaw_rad);
    }
}

#[test]
fn a_reversed_take_ends_where_it_began() {
    let take = trot();
    let back = cut::reversed(&take);
    assert_eq!(back.poses.last(), take.poses.first());
    assert_eq!(back.roots.first(), take.roots.last());
    let forward = |t: &Take| travel::of(t).forward_m_s;
    assert!((forward(&take) + forward(&back)).abs() < 1e-9);
}

#[test]
fn one_cycle_cut_of_many_plays_as_the_one_that_was_repeated() {
    let model = pup();
    let take = trot().repeated(2.9);
    let body = BodyModel::of(&take, Some(&model)).expect("its robot");
    let found = analyse(&take, &body).expect("a take");
    let cycle = found.cycle.expect("a cycle");
    let cut = cut::cycle(
        &take,
        &body,
        &cycle,
        &found.feet,
        &cut::CutOptions::default(),
    )
    .expect("a seam of nothing");
    assert!(cut.seam.share < 0.03, "{:?}", cut.seam);
    let back = ClipFile::from_json(&cut.clip.to_json()).expect("its own output");
    assert_eq!(back.frames.len(), 64);
    assert!((back.frequency_hz / trot_hz() - 1.0).abs() < 0.005);
    assert_eq!(back.segments.len(), 4);
    for segment in &back.segments {
        assert_eq!(segment.joints.len(), 3, "{segment:?}");
    }
}

fn trot_hz() -> f64 {
    let take = trot();
    1.0 / take.duration_s()
}
