//! Conformance of the motion graph: the same scenes on bolted-down joints, on joints that carry a body, on a skeleton.

use handwave::base::random::SplitMix;
use handwave::body::{
    BODY, JointSpace, PoseSpace, RootAdvance, Skeleton, SkeletonJoint, SkeletonSpace,
};
use handwave::motion::class::{ClassOptions, Drive, Example, MotionClass};
use handwave::motion::clip::{Clip, ClipFile, ClipKind};
use handwave::motion::edge::EdgeSearch;
use handwave::motion::graph::{Graph, GraphOptions};
use handwave::motion::layer::LayerInput;
use handwave::motion::search::clip_blend::ClipBlend;
use handwave::motion::search::{DistanceTables, Search, SearchOptions};
use handwave::motion::{Animator, node::Node};
use nalgebra::{Isometry3, UnitQuaternion};
use std::f64::consts::TAU;
use std::sync::Arc;

const DT_S: f64 = 0.005;
const FRAMES: usize = 32;
/// A jump of 15 mm in one cycle would change a point's speed by 3 m/s; a quick walk swings its legs at 10.
const MOST_KICK_M_S: f64 = 2.5;
const WALK: usize = 0;
const BOW: usize = 1;

/// A body under test.
struct Body {
    name: &'static str,
    space: Arc<dyn PoseSpace>,
    skeleton: Option<Skeleton>,
}

/// A trunk and two limbs of two joints each.
const JOINTS: [&str; 5] = ["trunk", "left_hip", "left_knee", "right_hip", "right_knee"];

fn bodies() -> [Body; 3] {
    let names: Vec<String> = JOINTS.iter().map(|j| (*j).into()).collect();
    let joint = |i: usize, parent, offset_m| SkeletonJoint {
        name: names[i].clone(),
        parent,
        offset_m,
        rest: [0.0, 0.0, 0.0, 1.0],
    };
    let joints = vec![
        joint(0, None, [0.0; 3]),
        joint(1, Some(0), [0.0, 0.1, 0.0]),
        joint(2, Some(1), [0.0, 0.0, -0.4]),
        joint(3, Some(0), [0.0, -0.1, 0.0]),
        joint(4, Some(3), [0.0, 0.0, -0.4]),
    ];
    let skeleton = Skeleton::new(joints, UnitQuaternion::identity(), 1.0).expect("a good tree");
    let fixed = Arc::new(JointSpace::fixed(&names));
    let floating = Arc::new(JointSpace::floating(&names));
    let avatar = Arc::new(SkeletonSpace::new(Arc::new(skeleton.clone())));
    let body = |name, space, skeleton| Body {
        name,
        space,
        skeleton,
    };
    [
        body("fixed joints", fixed, None),
        body("floating joints", floating, None),
        body("skeleton", avatar, Some(skeleton)),
    ]
}

impl Body {
    /// A clip whose joint `j` is at `angle(j, u)`, about its y axis.
    fn clip(
        &self,
        name: &str,
        kind: ClipKind,
        forward_m: f64,
        angle: impl Fn(usize, f64) -> f64,
    ) -> Clip {
        let steps = match kind {
            ClipKind::Cycle => FRAMES,
            ClipKind::Path => FRAMES - 1,
        };
        let at = |k: usize| k as f64 / steps as f64;
        let frames = (0..FRAMES).map(|k| {
            let angles = (0..JOINTS.len()).map(|j| angle(j, at(k)));
            if self.skeleton.is_none() {
                return angles.collect();
            }
            let mut pose = vec![0.0; self.space.len()];
            self.space.rest(&mut pose);
            for (j, a) in angles.enumerate() {
                let turn = UnitQuaternion::from_euler_angles(0.0, a, 0.0);
                Skeleton::set_rotation(&mut pose, j, &turn);
            }
            pose
        });
        let floats = self.space.parts().iter().any(|p| p.name == BODY);
        let height = |k: usize| [0.0, 0.0, 0.8 + 0.02 * (TAU * at(k)).sin(), 0.0, 0.0, 0.0];
        let file = ClipFile {
            handwave: "clip".into(),
            version: 1,
            name: name.into(),
            origin: String::new(),
            kind,
            joints: JOINTS.iter().map(|j| (*j).into()).collect(),
            frequency_hz: 0.0,
            duration_s: if kind == ClipKind::Path { 1.5 } else { 0.0 },
            root: RootAdvance {
                forward_m,
                ..RootAdvance::default()
            },
            segments: Vec::new(),
            skeleton: self.skeleton.clone(),
            body: if floats && kind == ClipKind::Cycle {
                (0..FRAMES).map(height).collect()
            } else if floats {
                vec![[0.0, 0.0, 0.8, 0.0, 0.0, 0.0]; FRAMES]
            } else {
                Vec::new()
            },
            way: Vec::new(),
            frames: frames.collect(),
        };
        file.for_space(self.space.as_ref())
            .unwrap_or_else(|e| panic!("{}: {e}", self.name))
    }

    /// A class that walks (rest, slow, quick) and one that bows.
    fn examples(&self) -> [Vec<Example>; 2] {
        let still = self.clip("still", ClipKind::Cycle, 0.0, |_, _| 0.0);
        let walk = |name: &str, size: f64| {
            self.clip(name, ClipKind::Cycle, size, move |j, u| {
                let side = if j > 2 { 0.5 } else { 0.0 };
                let part = [0.1, 1.0, 0.6, 1.0, 0.6][j];
                size * part * (TAU * (u + side)).sin()
            })
        };
        let bow = self.clip("bow", ClipKind::Path, 0.0, |j, u| {
            0.9 * [1.0, -0.5, 0.7, -0.5, 0.7][j] * (0.5 - 0.5 * (0.5 * TAU * u).cos())
        });
        let example = |clip: Clip, amplitude: f64, frequency_hz: f64| Example {
            clip,
            parameters: [amplitude, frequency_hz].into(),
        };
        [
            vec![
                example(still, 0.0, 0.0),
                example(walk("slow", 0.5), 1.0, 0.8),
                example(walk("quick", 0.9), 1.0, 1.8),
            ],
            vec![example(bow, 1.0, 0.0)],
        ]
    }

    fn boxed(&self) -> Box<dyn PoseSpace> {
        let names: Vec<String> = JOINTS.iter().map(|j| (*j).into()).collect();
        match &self.skeleton {
            Some(skeleton) => Box::new(SkeletonSpace::new(Arc::new(skeleton.clone()))),
            None if self.space.len() > JOINTS.len() => Box::new(JointSpace::floating(&names)),
            None => Box::new(JointSpace::fixed(&names)),
        }
    }

    /// Both classes with edges either way; with `searched` walk to bow is chosen by likeness.
    fn animator(&self, searched: bool) -> Animator {
        let examples = self.examples();
        let names = ["walk", "bow"];
        let classes: Vec<Node> = (examples.iter().zip(names))
            .map(|(examples, name)| {
                let options = ClassOptions::default();
                MotionClass::new(name, examples.clone(), Vec::new(), options)
                    .expect("a good class")
                    .into()
            })
            .collect();
        let edges = [(WALK, BOW, 1.0), (BOW, WALK, 1.0)];
        let graph = Graph::new(2, WALK, &edges, GraphOptions::default());
        let animator = Animator::new(self.boxed(), classes, graph, Vec::new(), &[]);
        if !searched {
            return animator;
        }
        let blend = |class: usize| {
            ClipBlend::new(names[class], &examples[class], &self.space).expect("clips that move")
        };
        let (from, to) = (blend(WALK), blend(BOW));
        let class = |blend: &ClipBlend| Arc::new(blend.search_class(24, blend.steps()).expect("f"));
        let (a, b) = (class(&from), class(&to));
        let tables = Arc::new(DistanceTables::new(&a, &b).expect("one body"));
        let options = SearchOptions {
            max_latency_s: Some(0.6),
            ..SearchOptions::default()
        };
        let search = Search::new(a, b, tables, options).expect("good options");
        animator.with_search(WALK, BOW, EdgeSearch::new(search, from, to, [0.0, 0.2]))
    }

    /// Places of the body's points, metres (lever arms of one metre on joints).
    fn places(&self, pose: &[f64]) -> Vec<f64> {
        let mut places = vec![0.0; self.space.features()];
        self.space.embed(pose, &mut places);
        places
    }
}

fn walking(k: usize) -> Drive {
    Drive {
        amplitude: 1.0,
        frequency_hz: 1.2,
        phase_rad: TAU * 1.2 * k as f64 * DT_S,
        ..Drive::default()
    }
}

fn bowing(progression: f64) -> Drive {
    Drive {
        amplitude: progression,
        ..Drive::default()
    }
}

/// Steps an animator and watches that nothing jumps.
struct Scene<'a> {
    body: &'a Body,
    animator: Animator,
    pose: Vec<f64>,
    shown: Vec<f64>,
    /// Fastest a point went, m/s, and the largest change of its speed in a cycle, m/s.
    speed: f64,
    kick: f64,
    way: Vec<f64>,
    cycles: usize,
}

impl<'a> Scene<'a> {
    fn new(body: &'a Body, searched: bool) -> Self {
        let mut animator = body.animator(searched);
        let mut pose = vec![0.0; animator.coordinates()];
        animator.rest_pose(&mut pose);
        let shown = body.places(&pose);
        Self {
            way: vec![0.0; shown.len()],
            body,
            animator,
            pose,
            shown,
            speed: 0.0,
            kick: 0.0,
            cycles: 0,
        }
    }

    fn step(&mut self, walk: Drive, bow: Drive) {
        let before = self.animator.root();
        let input = LayerInput {
            channels: &[],
            gestures: &[],
        };
        self.animator
            .step(&[walk, bow], &input, DT_S, &mut self.pose);
        let (name, cycle) = (self.body.name, self.cycles);
        assert!(
            self.pose.iter().all(|v| v.is_finite()),
            "{name}: not a number in cycle {cycle}: {:?}",
            self.pose
        );
        if self.body.skeleton.is_some() {
            for q in self.pose[3..].chunks_exact(4) {
                let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
                assert!(
                    (length - 1.0).abs() < 1e-9,
                    "{name}: quaternion of {length}"
                );
            }
        }
        let places = self.body.places(&self.pose);
        for ((now, was), way) in places.iter().zip(&self.shown).zip(&mut self.way) {
            let speed = (now - was) / DT_S;
            self.speed = self.speed.max(speed.abs());
            if cycle > 0 {
                self.kick = self.kick.max((speed - *way).abs());
            }
            *way = speed;
        }
        self.shown = places;
        let moved = before.advance_to(&self.animator.root());
        let step_m = moved.forward_m.hypot(moved.left_m);
        // 0.9 m a cycle of the walk, at most 2.5 of them a second.
        assert!(
            step_m < 2.5 * 0.9 * DT_S && moved.yaw_rad.abs() < 1e-9,
            "{name}: the root moved {step_m} m in cycle {cycle}"
        );
        self.cycles += 1;
    }

    fn smooth(&self, what: &str) {
        let figures = format!(
            "{}, {what}: fastest point {:.2} m/s, largest change of speed in a cycle {:.3} m/s",
            self.body.name, self.speed, self.kick
        );
        println!("{figures}");
        assert!(self.speed < 16.0 && self.kick < MOST_KICK_M_S, "{figures}");
        assert!(self.speed > 0.2, "nothing moves: {figures}");
    }
}

#[test]
fn a_threshold_starts_a_transition_and_release_completes_it() {
    for body in &bodies() {
        let mut scene = Scene::new(body, false);
        for k in 0..400 {
            scene.step(walking(k), bowing(0.19));
        }
        assert_eq!(scene.animator.transition(), None, "{}: 0.19", body.name);
        for k in 400..800 {
            let fading = Drive {
                amplitude: 1.0 - ((k - 400) as f64 / 100.0).min(1.0),
                ..walking(k)
            };
            scene.step(fading, bowing((0.19 + (k - 400) as f64 / 200.0).min(1.0)));
        }
        let counts = scene.animator.counts();
        assert_eq!(scene.animator.active(), BOW, "{}: {counts:?}", body.name);
        assert_eq!(counts.completed, 1, "{}: {counts:?}", body.name);
        // The corner of the blend is the clip itself.
        for k in 800..1600 {
            scene.step(
                Drive {
                    amplitude: 0.0,
                    ..walking(k)
                },
                bowing(1.0),
            );
        }
        let mut end = vec![0.0; body.space.len()];
        body.examples()[BOW][0].clip.pose(1.0, &mut end);
        let off_m = body.space.distance(&end, &scene.pose);
        assert!(off_m < 1e-6, "{}: {off_m} m from the clip's end", body.name);
        scene.smooth("one transition");
    }
}

#[test]
fn a_transition_that_is_given_up_leads_back_without_a_jump() {
    for body in &bodies() {
        let mut scene = Scene::new(body, false);
        for k in 0..1200 {
            // The bow is begun for a quarter of a second, three times, and given up.
            let begun = k >= 300 && k % 300 < 50;
            scene.step(walking(k), bowing(if begun { 1.3 } else { 0.0 }));
        }
        let counts = scene.animator.counts();
        assert_eq!(scene.animator.active(), WALK, "{}: {counts:?}", body.name);
        assert_eq!(counts.completed, 0, "{}: {counts:?}", body.name);
        assert!(counts.aborted >= 3, "{}: {counts:?}", body.name);
        scene.smooth("three given up");
    }
}

#[test]
fn a_searched_transition_enters_the_target_like_what_was_shown() {
    for body in &bodies() {
        let mut similarities = Vec::new();
        for start in [200, 230, 260, 290] {
            let mut scene = Scene::new(body, true);
            let mut chosen = None;
            for k in 0..start + 400 {
                let bow = ((k as f64 - start as f64) / 60.0).clamp(0.0, 1.0);
                let walk = Drive {
                    amplitude: 1.0 - bow,
                    ..walking(k)
                };
                scene.step(walk, bowing(bow));
                chosen = chosen.or(scene.animator.choice());
            }
            let choice = chosen.unwrap_or_else(|| panic!("{}: nothing chosen", body.name));
            assert_eq!(scene.animator.active(), BOW, "{}", body.name);
            assert!(
                (0.0..=0.2).contains(&choice.entry) && (0.0..=0.6).contains(&choice.wait_s),
                "{}: {choice:?}",
                body.name
            );
            similarities.push(choice.similarity);
            scene.smooth("searched");
        }
        println!("{}: similarities {similarities:.3?}", body.name);
        assert!(
            similarities.iter().all(|s| *s > 0.6),
            "{}: similarities {similarities:.3?}",
            body.name
        );
    }
}

#[test]
fn the_search_compares_poses_as_the_body_embeds_them() {
    for body in &bodies() {
        let [walk, _] = body.examples();
        let blend = ClipBlend::new("walk", &walk, &body.space).expect("moves");
        let class = blend.search_class(24, blend.steps()).expect("features");
        // Positions, velocities, three of the root; a reference is a clip of its own.
        assert_eq!(
            class.width(),
            2 * body.space.features() + 3,
            "{}",
            body.name
        );
        let quick = class.clips.iter().position(|c| c == "quick").expect("own");
        let mut pose = vec![0.0; body.space.len()];
        walk[2].clip.pose(class.time_of(5), &mut pose);
        let scale = (body.space.points() as f64).sqrt();
        let places = body.places(&pose);
        let off = (class.feature(quick, 5).iter().zip(&places))
            .map(|(f, p)| (f * scale - p).abs())
            .fold(0.0, f64::max);
        // Splines leave quaternions a little off length one; blending mends that.
        assert!(off < 1e-5, "{}: features off by {off} m", body.name);
    }
}

#[test]
fn the_blend_is_exact_at_its_corners() {
    for body in &bodies() {
        let examples = body.examples();
        let class = |e: &[Example]| {
            MotionClass::new("c", e.to_vec(), Vec::new(), ClassOptions::default()).expect("good")
        };
        let (mut pose, mut clip) = (vec![0.0; body.space.len()], vec![0.0; body.space.len()]);
        for (example, frequency_hz) in [(1, 0.8), (2, 1.8)] {
            let mut walk = class(&examples[WALK]);
            let mut worst = 0.0_f64;
            for k in 0..2000 {
                let drive = Drive {
                    amplitude: 1.0,
                    frequency_hz,
                    phase_rad: TAU * frequency_hz * k as f64 * DT_S,
                    ..Drive::default()
                };
                let played = walk.step(body.space.as_ref(), drive, DT_S, &mut pose);
                if k > 1500 {
                    let clips = &examples[WALK][example].clip;
                    clips.pose(played.phase_rad / TAU, &mut clip);
                    worst = worst.max(body.space.distance(&pose, &clip));
                }
            }
            assert!(
                worst < 1e-4,
                "{}: {worst} m from clip {example} at its own parameters",
                body.name
            );
        }
    }
}

#[test]
fn ten_seconds_of_random_drives_stay_continuous() {
    for body in &bodies() {
        for searched in [false, true] {
            for seed in 0..6 {
                let mut random = SplitMix::new(seed);
                let mut scene = Scene::new(body, searched);
                let (mut goals, mut values) = ([0.0; 3], [0.0, 0.0, 1.0]);
                let mut phase_rad = 0.0;
                for k in 0..2000 {
                    if k % 120 == 0 {
                        goals = [
                            (1.6 * random.unit() - 0.4).max(0.0),
                            (1.6 * random.unit() - 0.6).max(0.0),
                            0.5 + 1.5 * random.unit(),
                        ];
                    }
                    for (value, goal) in values.iter_mut().zip(goals) {
                        *value += (goal - *value) * DT_S / 0.15;
                    }
                    phase_rad = (phase_rad + TAU * values[2] * DT_S) % TAU;
                    let walk = Drive {
                        amplitude: values[0],
                        frequency_hz: values[2],
                        phase_rad,
                        ..Drive::default()
                    };
                    scene.step(walk, bowing(values[1]));
                }
                scene.smooth(&format!("random drives, seed {seed}, searched {searched}"));
            }
        }
    }
}

#[test]
fn drives_that_are_no_numbers_do_not_reach_the_pose() {
    for body in &bodies() {
        let mut scene = Scene::new(body, true);
        for k in 0..600 {
            let odd = if k % 3 == 0 { f64::NAN } else { f64::INFINITY };
            let walk = if k % 50 == 10 {
                Drive {
                    amplitude: odd,
                    frequency_hz: odd,
                    phase_rad: odd,
                    extra: [odd; 2],
                }
            } else {
                walking(k)
            };
            scene.step(walk, bowing(if k % 70 == 3 { odd } else { 0.3 }));
        }
    }
}

#[test]
fn frames_of_a_skeleton_come_from_its_pose() {
    // The scenes rest on places of joints; here is what they are made of.
    let [_, _, body] = bodies();
    let skeleton = body.skeleton.as_ref().expect("a skeleton");
    let mut pose = vec![0.0; body.space.len()];
    body.space.rest(&mut pose);
    let mut frames = vec![Isometry3::identity(); skeleton.len()];
    skeleton.frames(&pose, &mut frames);
    let places = body.places(&pose);
    for (frame, place) in frames.iter().zip(places.chunks_exact(3)) {
        assert!((frame.translation.vector.as_slice()[2] - place[2]).abs() < 1e-12);
    }
    assert!(body.space.size_m() > 0.3, "height {}", body.space.size_m());
}
