//! How long blend weights take for one wish, and a way back from parameters to weights.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

use criterion::{Criterion, criterion_group, criterion_main};
use handwave::motion::inverse::{InverseMap, InverseOptions};
use handwave::motion::weights::{WeightKind, Weights};
use std::hint::black_box;

/// Walks and trots of the shipped quadruped, and a canter.
const FIVE: [[f64; 2]; 5] = [[0.5, 0.8], [1.0, 0.8], [0.5, 1.7], [1.0, 1.7], [1.0, 2.4]];

/// Seven examples in four dimensions.
const SEVEN: [[f64; 4]; 7] = [
    [0.4, 0.8, 0.0, 0.0],
    [1.0, 0.9, 0.0, 0.0],
    [1.0, 2.0, 0.0, 0.0],
    [0.7, 0.9, -0.5, 0.0],
    [0.7, 0.9, 0.5, 0.0],
    [0.6, 0.7, 0.0, -1.0],
    [0.8, 1.1, 0.0, 1.0],
];

fn weights(criterion: &mut Criterion) {
    for (kind, name) in [
        (WeightKind::Rose, "rose"),
        (WeightKind::InverseDistance, "inverse_distance"),
    ] {
        let five = Weights::named(&FIVE, kind, &[]).expect("distinct");
        let seven = Weights::named(&SEVEN, kind, &[]).expect("distinct");
        let mut out = [0.0; 7];
        criterion.bench_function(&format!("weights_of_5_in_2d_{name}"), |bencher| {
            bencher.iter(|| {
                five.at(black_box([0.8, 1.3]), &mut out);
                black_box(out[0])
            });
        });
        criterion.bench_function(&format!("weights_of_7_in_4d_{name}"), |bencher| {
            bencher.iter(|| {
                seven.at(black_box([0.8, 1.3, 0.2, 0.1]), &mut out);
                black_box(out[0])
            });
        });
    }
}

fn inverse(criterion: &mut Criterion) {
    let clips = [[0.5, 0.0], [2.0, 0.0], [1.0, -0.8], [1.0, 0.8], [2.0, 0.5]];
    let forward = |dimensions: usize| {
        move |w: &[f64], p: &mut [f64]| {
            for d in 0..dimensions {
                p[d] = clips.iter().zip(w).map(|(c, w)| w * c[d]).sum();
            }
            p[0] += 0.1 * p[dimensions - 1] * p[dimensions - 1];
        }
    };
    for dimensions in [1, 2] {
        let map = InverseMap::new(
            5,
            dimensions,
            InverseOptions::default(),
            forward(dimensions),
        )
        .expect("it varies");
        let mut out = [0.0; 5];
        criterion.bench_function(&format!("inverse_of_5_clips_in_{dimensions}d"), |bencher| {
            bencher.iter(|| {
                map.weights(black_box([1.3, 0.2]), &mut out);
                black_box(out[0])
            });
        });
    }
}

criterion_group!(benches, weights, inverse);
criterion_main!(benches);
