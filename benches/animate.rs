//! What animation costs on one core: sampling clips, blending, layers, model space.
//!
//! Time moves forward (a character that plays) or jumps (a search that looks anywhere). Clips have 32 frames,
//! poses are f64. Reference: ozz-animation 0.16 (C++, SIMD, f32, keyframes compressed), built with -O3 and run on a
//! machine like this one: 60 joints, 4 clips to model space 3.2 to 5.1 us; 6 clips and 3 additive layers 7 to
//! 11 us; 850 to 1260 such characters at 60 Hz on one core. Run alone, or compare medians of several runs: beside
//! other work on the same cores the figures here doubled and more.
//!
//! Here, medians of three quiet runs, time forward or random: 12 hinges of 4 clips 0.09 us, with all links 0.35 us; 60
//! joints of 4 clips to model space 2.2 us; of 6 clips and 3 layers 4.3 us, 3,900 characters at 60 Hz.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

use criterion::{Criterion, criterion_group, criterion_main};
use handwave::base::random::SplitMix;
use handwave::body::{JointSpace, PoseSpace, Skeleton, SkeletonJoint, SkeletonSpace};
use handwave::motion::clip::{Clip, ClipFile, ClipKind, RootAdvance};
use handwave::robot::RobotModel;
use nalgebra::{Isometry3, UnitQuaternion};
use std::f64::consts::TAU;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

const FRAMES: usize = 32;
const JOINTS: usize = 60;
/// A step of a second and a third per cycle at 200 Hz.
const STEP: f64 = 0.005 / 1.33;

fn skeleton() -> Arc<Skeleton> {
    // A spine with limbs: every eighth joint starts a new limb at the spine.
    let joint = |i: usize| SkeletonJoint {
        name: format!("j{i}"),
        parent: match i {
            0 => None,
            i if i % 8 == 0 => Some(i / 8),
            i => Some(i - 1),
        },
        offset_m: if i == 0 {
            [0.0; 3]
        } else {
            [0.02, 0.01 * (i % 3) as f64, 0.1]
        },
        rest: [0.0, 0.0, 0.0, 1.0],
    };
    let joints = (0..JOINTS).map(joint).collect();
    Arc::new(Skeleton::new(joints, UnitQuaternion::identity(), 1.0).expect("a good skeleton"))
}

/// A clip whose joints swing by up to `reach` rad around random ways.
fn clip(space: &dyn PoseSpace, skeleton: Option<&Skeleton>, seed: u64, kind: ClipKind) -> Clip {
    let mut random = SplitMix::new(seed);
    let tangent = space.tangent_len();
    let ways: Vec<f64> = (0..tangent)
        .map(|_| 0.6 * (2.0 * random.unit() - 1.0))
        .collect();
    let shifts: Vec<f64> = (0..tangent).map(|_| TAU * random.unit()).collect();
    let frames = (0..FRAMES)
        .map(|k| {
            let mut pose = vec![0.0; space.len()];
            space.rest(&mut pose);
            let phase = TAU * k as f64 / FRAMES as f64;
            let way: Vec<f64> = ways
                .iter()
                .zip(&shifts)
                .map(|(w, s)| w * (phase + s).sin())
                .collect();
            space.add(&mut pose, &way, 1.0);
            pose
        })
        .collect();
    let joints = match skeleton {
        Some(skeleton) => skeleton.joints.iter().map(|j| j.name.clone()).collect(),
        None => space.parts().iter().map(|p| p.name.clone()).collect(),
    };
    let file = ClipFile {
        handwave: "clip".into(),
        version: 1,
        name: format!("clip{seed}"),
        origin: String::new(),
        kind,
        joints,
        frequency_hz: 1.0,
        duration_s: 0.0,
        root: RootAdvance::default(),
        segments: vec![],
        skeleton: skeleton.cloned(),
        body: vec![],
        way: vec![],
        frames,
    };
    file.for_space(space).expect("a clip of this body")
}

/// Clips of a body, with room for their poses.
struct Blend {
    space: Box<dyn PoseSpace>,
    clips: Vec<Clip>,
    layers: Vec<Clip>,
    weights: Vec<f64>,
    poses: Vec<f64>,
    rest: Vec<f64>,
    layer: Vec<f64>,
    difference: Vec<f64>,
    out: Vec<f64>,
}

impl Blend {
    fn new(
        space: Box<dyn PoseSpace>,
        skeleton: Option<&Skeleton>,
        clips: usize,
        layers: usize,
    ) -> Self {
        let (len, tangent) = (space.len(), space.tangent_len());
        let mut rest = vec![0.0; len];
        space.rest(&mut rest);
        let of = |seed: usize, kind| clip(space.as_ref(), skeleton, seed as u64, kind);
        Self {
            clips: (0..clips).map(|k| of(k, ClipKind::Cycle)).collect(),
            layers: (0..layers).map(|k| of(100 + k, ClipKind::Path)).collect(),
            weights: vec![1.0 / clips as f64; clips],
            poses: vec![0.0; clips * len],
            rest,
            layer: vec![0.0; len],
            difference: vec![0.0; tangent],
            out: vec![0.0; len],
            space,
        }
    }

    /// One pose at `u` of the cycle.
    fn step(&mut self, u: f64) {
        let len = self.out.len();
        for (clip, pose) in self.clips.iter().zip(self.poses.chunks_exact_mut(len)) {
            clip.pose(u, pose);
        }
        self.space.blend(&self.poses, &self.weights, &mut self.out);
        for layer in &self.layers {
            layer.pose(0.5, &mut self.layer);
            let room = &mut self.difference;
            self.space
                .add_way(&mut self.out, &self.rest, &self.layer, 1.0, room);
        }
    }
}

/// Where in the cycle the next step is.
#[derive(Clone)]
enum Times {
    Forward(f64),
    Random(SplitMix),
}

impl Times {
    fn next(&mut self) -> f64 {
        match self {
            Times::Forward(u) => {
                *u += STEP;
                *u
            }
            Times::Random(random) => random.unit(),
        }
    }
}

fn times() -> [(&'static str, Times); 2] {
    [
        ("forward", Times::Forward(0.0)),
        ("random", Times::Random(SplitMix::new(3))),
    ]
}

/// Prints the median cost of `step` per call and per joint, and how many such characters fit at 60 Hz.
fn figure(name: &str, joints: usize, mut step: impl FnMut()) {
    const CALLS: u32 = 2000;
    let mut runs: Vec<f64> = (0..31)
        .map(|_| {
            let start = Instant::now();
            (0..CALLS).for_each(|_| step());
            start.elapsed().as_secs_f64() * 1e9 / f64::from(CALLS)
        })
        .collect();
    runs.sort_by(f64::total_cmp);
    let ns = runs[runs.len() / 2];
    println!(
        "{name:<44} {ns:8.0} ns, {:5.1} ns a joint, {:6.0} characters at 60 Hz",
        ns / joints as f64,
        1e9 / 60.0 / ns
    );
}

/// Name, joints, and one step of it.
type Scene = (String, usize, Box<dyn FnMut()>);

fn animate(c: &mut Criterion) {
    let urdf = include_str!("../configs/robots/pup.urdf");
    let model = RobotModel::from_urdf(urdf).expect("shipped URDF");
    let joints = model.actuated.len();
    let mut links = vec![Isometry3::identity(); model.links.len()];
    let skeleton = skeleton();
    let mut frames = vec![Isometry3::identity(); JOINTS];
    let mut scenes: Vec<Scene> = Vec::new();
    for (way, time) in times() {
        let mut add = |name: &str, joints: usize, step: Box<dyn FnMut()>| {
            scenes.push((format!("{name}, {way}"), joints, step));
        };
        let space = || Box::new(JointSpace::of_robot(&model, false));
        let (mut blend, mut at) = (Blend::new(space(), None, 4, 0), time.clone());
        add(
            "12 hinges, 4 clips",
            joints,
            Box::new(move || blend.step(black_box(at.next()))),
        );
        let (mut blend, mut at, robot) =
            (Blend::new(space(), None, 4, 0), time.clone(), model.clone());
        let mut links =
            std::mem::replace(&mut links, vec![Isometry3::identity(); model.links.len()]);
        add(
            "12 hinges, 4 clips, links",
            joints,
            Box::new(move || {
                blend.step(black_box(at.next()));
                robot.link_poses(&blend.out, &mut links);
                black_box(&links);
            }),
        );
        for (name, clips, layers) in [
            ("60 joints, 4 clips, model space", 4, 0),
            ("60 joints, 6 clips, 3 layers, model space", 6, 3),
        ] {
            let space = Box::new(SkeletonSpace::new(Arc::clone(&skeleton)));
            let (mut blend, mut at) = (
                Blend::new(space, Some(&skeleton), clips, layers),
                time.clone(),
            );
            let body = Arc::clone(&skeleton);
            let mut frames = std::mem::replace(&mut frames, vec![Isometry3::identity(); JOINTS]);
            add(
                name,
                JOINTS,
                Box::new(move || {
                    blend.step(black_box(at.next()));
                    body.frames(&blend.out, &mut frames);
                    black_box(&frames);
                }),
            );
        }
    }
    for (name, joints, step) in &mut scenes {
        figure(name, *joints, step);
    }
    for (name, _, step) in &mut scenes {
        c.bench_function(name, |b| b.iter(&mut *step));
    }
}

criterion_group!(benches, animate);
criterion_main!(benches);
