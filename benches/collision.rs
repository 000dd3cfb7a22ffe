//! What self-collision costs on the quadruped: one comparison of all pairs, and one guarded step of the envelope.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

use criterion::{Criterion, criterion_group, criterion_main};
use handwave::base::random::SplitMix;
use handwave::robot::collision::{CollisionGuard, CollisionModel, CollisionOptions};
use handwave::robot::{Envelope, Guard, JointEnvelope, RobotModel};
use std::hint::black_box;
use std::sync::Arc;

const PUP: &str = include_str!("../configs/robots/pup.urdf");
const JOINTS: usize = 12;

fn collision(criterion: &mut Criterion) {
    let robot = RobotModel::from_urdf(PUP).expect("a shipped URDF");
    let options = CollisionOptions {
        margin_m: 0.01,
        ..CollisionOptions::default()
    };
    let model = CollisionModel::new(&robot, PUP, None, &options, &[]).expect("sensible options");
    let model = Arc::new(model);
    let mut random = SplitMix::new(3);
    let poses: Vec<Vec<f64>> = (0..64)
        .map(|_| (0..JOINTS).map(|_| 1.2 * (random.unit() - 0.5)).collect())
        .collect();
    let mut group = criterion.benchmark_group("collision_of_12_joints");
    let mut scratch = model.scratch();
    let mut next = poses.iter().cycle();
    group.bench_function("nearest_pair", |b| {
        b.iter(|| {
            model.nearest(
                black_box(next.next().map_or(&[], Vec::as_slice)),
                &mut scratch,
            )
        });
    });
    let mut out = vec![0.0; model.pairs()];
    group.bench_function("pairs_within_the_margin", |b| {
        b.iter(|| {
            let pose = next.next().map_or(&[][..], Vec::as_slice);
            model.distances(black_box(pose), 0.01, &mut scratch, &mut out);
        });
    });
    let limit = JointEnvelope {
        lower: -0.7,
        upper: 0.7,
        velocity: 4.77,
        acceleration: 80.0,
        jerk: f64::INFINITY,
    };
    let mut envelope = Envelope::new(vec![limit; JOINTS], 0.005);
    let mut guard = CollisionGuard::new(model.clone());
    let mut out = [0.0; JOINTS];
    envelope.start(&out);
    guard.start(&envelope, &out);
    let mut step = 0_u32;
    group.bench_function("guarded_step_in_motion", |b| {
        b.iter(|| {
            step += 1;
            let swing = 0.6 * (f64::from(step) * 0.03).sin();
            guard.pass(&mut envelope, black_box(&[swing; JOINTS]), &mut out)
        });
    });
    group.finish();
}

criterion_group!(benches, collision);
criterion_main!(benches);
