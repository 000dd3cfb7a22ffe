//! Self-collision and keep-out on the quadruped: distances against sampled shapes, crossing legs stopped within the
//! limits, the shipped performance left alone, and nothing allocated. Feature `collision`.

mod support;

use handwave::base::random::SplitMix;
use handwave::config::files::BUILT_IN;
use handwave::config::{self, Files};
use handwave::robot::collision::{
    CollisionError, CollisionGuard, CollisionModel, CollisionOptions, KeepOut,
};
use handwave::robot::{Envelope, Guard, JointEnvelope, RobotModel};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use std::sync::Arc;
use support::counting::{Counting, allocations};
use support::folder::Folder;
use support::limits::LimitWatch;
use support::program::handwave;
use support::targets::Targets;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const PUP: &str = include_str!("../configs/robots/pup.urdf");
const RATE_HZ: f64 = 200.0;
const MARGIN_M: f64 = 0.01;

fn pup() -> RobotModel {
    RobotModel::from_urdf(PUP).expect("a shipped URDF")
}

fn options() -> CollisionOptions {
    CollisionOptions {
        margin_m: MARGIN_M,
        ..CollisionOptions::default()
    }
}

fn collisions(options: &CollisionOptions, resting: &[&[f64]]) -> CollisionModel {
    CollisionModel::new(&pup(), PUP, None, options, resting).expect("sensible options")
}

/// Limits of the shipped quadruped.
fn limits() -> Vec<JointEnvelope> {
    let character = config::load(Files::Embedded, BUILT_IN).expect("the built-in character");
    character.limits
}

#[test]
fn nonsense_is_refused_and_says_what_is_allowed() {
    let build = |options: &CollisionOptions, urdf: &str| {
        CollisionModel::new(&pup(), urdf, None, options, &[]).map(|_| ())
    };
    for margin_m in [-0.01, f64::NAN, f64::INFINITY, 2.0] {
        let options = CollisionOptions {
            margin_m,
            ..options()
        };
        let error = build(&options, PUP).expect_err("a bad margin");
        assert!(matches!(error, CollisionError::Margin { .. }), "{error}");
    }
    let ignore = CollisionOptions {
        ignore: vec![["body".into(), "front_left_shank_lnk".into()]],
        ..options()
    };
    let message = build(&ignore, PUP).expect_err("a bad name").to_string();
    assert!(
        message.contains("did you mean \"front_left_shank_link\"?"),
        "{message}"
    );
    for (least, greatest) in [
        (Point3::new(0.0, 0.0, 0.0), Point3::new(1.0, 1.0, 0.0)),
        (Point3::new(0.0, 0.0, 0.0), Point3::new(1.0, -1.0, 1.0)),
        (Point3::new(0.0, f64::NAN, 0.0), Point3::new(1.0, 1.0, 1.0)),
    ] {
        let options = CollisionOptions {
            keep_out: vec![KeepOut { least, greatest }],
            ..options()
        };
        let error = build(&options, PUP).expect_err("a box without inside");
        assert!(
            matches!(error, CollisionError::KeepOut { index: 1, .. }),
            "{error}"
        );
    }
    for (from, to) in [
        ("<sphere radius=\"0.01\"/>", "<sphere radius=\"0\"/>"),
        (
            "<box size=\"0.27 0.11 0.06\"/>",
            "<box size=\"0.27 -0.11 0.06\"/>",
        ),
    ] {
        let error = build(&options(), &PUP.replace(from, to)).expect_err("a shape without size");
        assert!(matches!(error, CollisionError::Shape { .. }), "{error}");
    }
    let bare = PUP.replace("collision>", "comment>");
    let error = build(&options(), &bare).expect_err("a robot without shapes");
    assert_eq!(error, CollisionError::NoPairs);
}

#[test]
fn links_near_each_other_at_rest_are_named_and_left_out() {
    let all = collisions(&options(), &[]);
    // The left legs crossed.
    let rest = legs(
        &pup(),
        &[("front_left_thigh", 1.0), ("rear_left_thigh", -1.0)],
    );
    let some = collisions(&options(), &[&rest]);
    assert!(
        some.pairs() < all.pairs(),
        "{} of {} pairs",
        some.pairs(),
        all.pairs()
    );
    assert!(
        !some.notes().is_empty() && all.notes().is_empty(),
        "{:?}",
        some.notes()
    );
    for note in some.notes() {
        assert!(
            note.contains(" mm apart at rest and are not compared"),
            "{note}"
        );
    }
    // Parent and child, also across a rigid joint, are never compared.
    for pair in 0..all.pairs() {
        let (a, b) = all.names(pair);
        for (x, y) in [
            ("body", "front_left_hip_link"),
            ("front_left_thigh_link", "front_left_foot"),
            ("front_left_shank_link", "front_left_foot"),
        ] {
            assert!(
                (a.as_str(), b.as_str()) != (x, y) && (b.as_str(), a.as_str()) != (x, y),
                "{a}, {b}"
            );
        }
    }
}

/// A shape of the URDF, for an independent judge.
struct Shape {
    link: usize,
    place: Isometry3<f64>,
    geometry: urdf_rs::Geometry,
}

fn shapes(model: &RobotModel) -> Vec<Shape> {
    let urdf = urdf_rs::read_from_string(PUP).expect("a shipped URDF");
    let mut shapes = Vec::new();
    for link in urdf.links {
        for collision in link.collision {
            let [roll, pitch, yaw] = collision.origin.rpy.0;
            let xyz = Vector3::from(collision.origin.xyz.0);
            let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            shapes.push(Shape {
                link: model.link(&link.name).expect("a link"),
                place: Isometry3::from_parts(Translation3::from(xyz), turn),
                geometry: collision.geometry,
            });
        }
    }
    shapes
}

impl Shape {
    /// Distance of a point in the shape's frame from the shape; 0 inside.
    fn distance(&self, p: &Point3<f64>) -> f64 {
        match &self.geometry {
            urdf_rs::Geometry::Box { size } => {
                let over = |i: usize| (p[i].abs() - 0.5 * size.0[i]).max(0.0);
                Vector3::new(over(0), over(1), over(2)).norm()
            }
            urdf_rs::Geometry::Cylinder { radius, length } => {
                let across = (p.x.hypot(p.y) - radius).max(0.0);
                across.hypot((p.z.abs() - 0.5 * length).max(0.0))
            }
            urdf_rs::Geometry::Sphere { radius } => (p.coords.norm() - radius).max(0.0),
            other => panic!("no such shape in this robot: {other:?}"),
        }
    }

    /// Points of its surface, none of which is further than 3 mm from the next, in its frame.
    fn surface(&self) -> Vec<Point3<f64>> {
        let mut points = Vec::new();
        let steps = |length: f64| (length / 0.003).ceil().max(1.0) as usize;
        let along = |i: usize, n: usize, length: f64| length * (i as f64 / n as f64 - 0.5);
        match &self.geometry {
            urdf_rs::Geometry::Box { size } => {
                for axis in 0..3 {
                    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                    let (nu, nv) = (steps(size.0[u]), steps(size.0[v]));
                    for (i, j) in (0..=nu).flat_map(|i| (0..=nv).map(move |j| (i, j))) {
                        for side in [-0.5, 0.5] {
                            let mut p = Point3::origin();
                            p[axis] = side * size.0[axis];
                            p[u] = along(i, nu, size.0[u]);
                            p[v] = along(j, nv, size.0[v]);
                            points.push(p);
                        }
                    }
                }
            }
            urdf_rs::Geometry::Cylinder { radius, length } => {
                let (round, up, out) = (steps(6.3 * radius), steps(*length), steps(*radius));
                for i in 0..round {
                    let (sin, cos) = (std::f64::consts::TAU * i as f64 / round as f64).sin_cos();
                    for j in 0..=up {
                        points.push(Point3::new(
                            radius * cos,
                            radius * sin,
                            along(j, up, *length),
                        ));
                    }
                    for (j, end) in (0..=out).flat_map(|j| [(j, -0.5), (j, 0.5)]) {
                        let r = radius * j as f64 / out as f64;
                        points.push(Point3::new(r * cos, r * sin, end * length));
                    }
                }
            }
            urdf_rs::Geometry::Sphere { radius } => {
                let n = steps(6.3 * radius);
                for (i, j) in (0..=n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                    let up = std::f64::consts::PI * i as f64 / n as f64;
                    let round = std::f64::consts::TAU * j as f64 / n as f64;
                    points.push(Point3::new(
                        radius * up.sin() * round.cos(),
                        radius * up.sin() * round.sin(),
                        radius * up.cos(),
                    ));
                }
            }
            other => panic!("no such shape in this robot: {other:?}"),
        }
        points
    }
}

#[test]
fn distances_agree_with_shapes_sampled_point_by_point() {
    let model = pup();
    let collisions = collisions(&options(), &[]);
    let mut scratch = collisions.scratch();
    let shapes = shapes(&model);
    let surfaces: Vec<_> = shapes.iter().map(Shape::surface).collect();
    let mut exact = vec![0.0; collisions.pairs()];
    let mut random = SplitMix::new(5);
    let mut compared = 0;
    for pose in 0..40 {
        let q: Vec<f64> = model
            .limits()
            .iter()
            .map(|limit| limit.lower + random.unit() * (limit.upper - limit.lower))
            .collect();
        collisions.distances(&q, f64::INFINITY, &mut scratch, &mut exact);
        for (pair, &found_m) in exact.iter().enumerate() {
            if found_m > 0.06 {
                continue;
            }
            let (a, b) = collisions.names(pair);
            // Each link of this robot has one shape.
            let of = |name: &str| {
                let link = model.link(name).expect("a link");
                shapes.iter().position(|s| s.link == link).expect("a shape")
            };
            let (a, b) = (of(&a), of(&b));
            let place = |s: &Shape| model.link_pose(s.link, &q) * s.place;
            let to_b = place(&shapes[b]).inverse() * place(&shapes[a]);
            let sampled_m = surfaces[a]
                .iter()
                .map(|p| shapes[b].distance(&(to_b * p)))
                .fold(f64::INFINITY, f64::min);
            compared += 1;
            // A sample is never nearer than the shape, and at most half a diagonal of the grid further.
            assert!(
                found_m <= sampled_m + 1e-6 && sampled_m <= found_m + 0.0022,
                "pose {pose}, {:?}: {found_m} m, sampled {sampled_m} m",
                collisions.names(pair)
            );
        }
        let nearest = collisions.nearest(&q, &mut scratch).expect("pairs");
        let least = exact.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(
            (nearest.distance_m - least).abs() < 1e-12,
            "pose {pose}: nearest {nearest:?}, least of all {least}"
        );
    }
    assert!(compared > 200, "only {compared} pairs compared");
}

/// A robot that follows targets through envelope and guard.
struct Run {
    envelope: Envelope,
    guard: CollisionGuard,
    watch: LimitWatch,
    out: Vec<f64>,
}

impl Run {
    fn new(options: &CollisionOptions, start: &[f64]) -> Self {
        let limits = limits();
        let mut envelope = Envelope::new(limits.clone(), 1.0 / RATE_HZ);
        envelope.start(start);
        let mut guard = CollisionGuard::new(Arc::new(collisions(options, &[])));
        guard.start(&envelope, start);
        let mut watch = LimitWatch::new(&limits, 1.0 / RATE_HZ);
        watch.see(start).expect("a start within the limits");
        Self {
            envelope,
            guard,
            watch,
            out: start.to_vec(),
        }
    }

    #[track_caller]
    fn step(&mut self, targets: &[f64]) {
        self.guard.pass(&mut self.envelope, targets, &mut self.out);
        self.watch.see(&self.out).unwrap_or_else(|e| panic!("{e}"));
    }
}

/// Model order: front left, front right, rear left, rear right; hip, thigh, knee each.
fn legs(model: &RobotModel, joints: &[(&str, f64)]) -> Vec<f64> {
    let mut q = vec![0.0; 12];
    let names = model.joint_names();
    for (name, value) in joints {
        let at = names.iter().position(|n| n == name).expect("a joint");
        q[at] = *value;
    }
    q
}

#[test]
fn crossing_legs_are_stopped_in_time_and_led_out_again() {
    let model = pup();
    let stand = vec![0.0; 12];
    // The left legs swing towards each other, straight: the front one back, the rear one forward.
    let crossed = legs(
        &model,
        &[("front_left_thigh", 1.0), ("rear_left_thigh", -1.0)],
    );
    let judge = collisions(&options(), &[]);
    let mut scratch = judge.scratch();

    let mut free = Envelope::new(limits(), 1.0 / RATE_HZ);
    free.start(&stand);
    let mut out = stand.clone();
    let mut free_least = f64::INFINITY;
    for _ in 0..200 {
        free.pass(&crossed, &mut out);
        free_least = free_least.min(judge.nearest(&out, &mut scratch).expect("pairs").distance_m);
    }
    assert!(
        free_least == 0.0,
        "without a guard the legs pass at {free_least} m: no test"
    );

    let mut run = Run::new(&options(), &stand);
    let mut least = f64::INFINITY;
    for _ in 0..200 {
        run.step(&crossed);
        least = least.min(
            judge
                .nearest(&run.out, &mut scratch)
                .expect("pairs")
                .distance_m,
        );
    }
    assert!(
        (MARGIN_M - 1e-6..0.04).contains(&least),
        "the legs came as near as {:.2} mm, margin {:.0} mm",
        1e3 * least,
        1e3 * MARGIN_M
    );
    let held = run.guard.held_steps();
    assert!(held > 100, "held in {held} steps");
    let notes = run.guard.notes();
    let told = notes
        .iter()
        .any(|n| n.contains("front_left") && n.contains("rear_left"));
    assert!(told, "{notes:?}");
    let stopped = run.out.clone();
    for _ in 0..200 {
        run.step(&stand);
    }
    let left = run.out.iter().fold(0.0_f64, |most, q| most.max(q.abs()));
    assert!(left < 1e-6, "{left} rad off the way out, from {stopped:?}");
    assert_eq!(run.guard.held_steps(), held, "the way out was held up");
}

#[test]
fn random_targets_never_bring_links_nearer_than_the_margin() {
    let limits = limits();
    let judge = collisions(&options(), &[]);
    let mut scratch = judge.scratch();
    for seed in 0..3 {
        let mut random = SplitMix::new(seed);
        let mut run = Run::new(&options(), &[0.0; 12]);
        let mut targets = vec![0.0; 12];
        for step in 0..3000 {
            if step % 40 == 0 {
                for (target, limit) in targets.iter_mut().zip(&limits) {
                    *target = limit.lower + random.unit() * (limit.upper - limit.lower);
                }
            }
            run.step(&targets);
            let nearest = judge.nearest(&run.out, &mut scratch).expect("pairs");
            // Between two poses of rest that are apart the way may lead a little nearer, never to a touch.
            assert!(
                nearest.distance_m > 0.5 * MARGIN_M,
                "seed {seed}, step {step}: {:?} {:.2} mm apart",
                judge.names(nearest.pair),
                1e3 * nearest.distance_m
            );
        }
        let held = run.guard.held_steps();
        assert!(held > 0, "seed {seed}: nothing to hold, no test");
    }
}

#[test]
fn a_foot_stays_out_of_a_keep_out_box() {
    let model = pup();
    // A step in front of the robot.
    let options = CollisionOptions {
        keep_out: vec![KeepOut {
            least: Point3::new(0.2, -0.3, -0.3),
            greatest: Point3::new(0.5, 0.3, -0.1),
        }],
        ..options()
    };
    let kick = legs(
        &model,
        &[("front_left_thigh", -1.1), ("front_right_thigh", -1.1)],
    );
    let mut run = Run::new(&options, &[0.0; 12]);
    let judge = collisions(&options, &[]);
    let mut scratch = judge.scratch();
    for step in 0..200 {
        run.step(&kick);
        let nearest = judge.nearest(&run.out, &mut scratch).expect("pairs");
        assert!(
            nearest.distance_m >= MARGIN_M - 1e-6,
            "step {step}: {:?} {:.2} mm apart",
            judge.names(nearest.pair),
            1e3 * nearest.distance_m
        );
    }
    let notes = run.guard.notes();
    assert!(
        notes.iter().any(|n| n.contains("keep-out box 1")),
        "{notes:?}"
    );
}

#[test]
fn the_shipped_performance_is_left_alone() {
    let folder = Folder::empty();
    let file = folder.text("targets.csv");
    let args = ["run", "--headless", "--speed", "max", "--targets", &file];
    handwave(&args).expect(0);
    let targets = Targets::read(&folder.path("targets.csv"));
    let (first, last) = (&targets.rows[0], &targets.rows[targets.rows.len() - 1]);
    let mut envelope = Envelope::new(limits(), 1.0 / RATE_HZ);
    envelope.start(first);
    // The robot lies at both ends. The thighs hang 11 mm beside the body and lean against it in a turn: those pairs are named, all others keep 10 mm.
    let thigh = |leg: &str| ["body".to_owned(), format!("{leg}_thigh_link")];
    let options = CollisionOptions {
        ignore: ["front_left", "front_right", "rear_left", "rear_right"]
            .map(thigh)
            .into(),
        ..options()
    };
    let model = collisions(&options, &[first, last]);
    let mut guard = CollisionGuard::new(Arc::new(model));
    guard.start(&envelope, first);
    let mut out = first.clone();
    for row in &targets.rows {
        guard.pass(&mut envelope, row, &mut out);
    }
    assert_eq!(guard.held_steps(), 0, "{:?}", guard.notes());
}

#[test]
fn a_step_allocates_nothing() {
    let crossed = legs(
        &pup(),
        &[
            ("front_left_thigh", 1.0),
            ("rear_left_thigh", -1.0),
            ("front_left_hip", -0.6),
        ],
    );
    let mut run = Run::new(&options(), &[0.0; 12]);
    let before = allocations();
    for _ in 0..300 {
        run.guard.pass(&mut run.envelope, &crossed, &mut run.out);
    }
    assert_eq!(allocations() - before, 0, "allocations in 300 steps");
    assert!(run.guard.held_steps() > 0, "the guard had nothing to do");
}
