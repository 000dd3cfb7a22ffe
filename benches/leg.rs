//! How long it takes to place a foot: on its way along a step, and where it cannot get.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

use criterion::{Criterion, criterion_group, criterion_main};
use handwave::robot::{Leg, RobotModel};
use std::hint::black_box;

fn place(c: &mut Criterion) {
    for name in ["pup", "phantomx"] {
        let path = format!("{}/configs/robots/{name}.urdf", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(path).expect("a bundled URDF");
        let model = RobotModel::from_urdf(&text).expect("a good URDF");
        let legs = Leg::find_all(&model).expect("legs");
        let leg = &legs[0];
        let mut pose = model.rest();
        let (hip, thigh, knee) = (leg.joints[0], leg.joints[1], leg.joints[2]);
        (pose[hip], pose[thigh], pose[knee]) = (0.1, 0.5, -0.9);
        let stand = leg.foot_position(&model, &pose);
        let mut step = 0_u32;
        c.bench_function(&format!("leg/{name}/along a step"), |b| {
            b.iter(|| {
                step = (step + 1) % 64;
                let mut goal = stand;
                goal.x += 1e-3 * (f64::from(step) - 32.0).abs() - 0.016;
                goal.z += 2e-4 * f64::from(step % 16);
                black_box(leg.reach(black_box(goal), &mut pose))
            });
        });
        let mut far = stand;
        far.z -= 1.0;
        c.bench_function(&format!("leg/{name}/out of reach"), |b| {
            b.iter(|| black_box(leg.reach(black_box(far), &mut pose)));
        });
    }
}

criterion_group!(benches, place);
criterion_main!(benches);
