//! What one sample costs the front end: the bundled performance, 108 Hz, one cyclic gesture and one
//! non-cyclic, and the same with two cyclic ones; eight cyclic gestures of a hand of 21 points at 120 Hz,
//! one or two of them performed, with every estimator.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

use criterion::{Criterion, criterion_group, criterion_main};
use handwave::gesture::{
    EstimatorKind, FrontEnd, FrontEndOptions, Gesture, GestureKind, GestureSet,
};
use handwave::pose::{PoseHeader, PoseSample, Recording};
use std::f64::consts::TAU;
use std::hint::black_box;
use std::path::Path;

fn push(criterion: &mut Criterion) {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let set = GestureSet::load(&configs.join("gestures/hand.toml")).expect("bundled");
    let performance = Recording::read(&configs.join("performances/drum_and_splay.jsonl"));
    let (performance, _) = performance.expect("bundled");
    let mut two = set.clone();
    let mut again = two.gestures[0].clone();
    again.name = "again".into();
    two.put(again);
    for (name, set) in [("push, one cyclic", &set), ("push, two cyclic", &two)] {
        let options = FrontEndOptions::default();
        let mut front = FrontEnd::new(set, &performance.header, options).expect("same points");
        let span = performance.span_s().1 + 0.01;
        let mut round = 0;
        let mut index = 0;
        let mut sample = performance.samples[0].clone();
        criterion.bench_function(name, |bencher| {
            bencher.iter(|| {
                sample.clone_from(&performance.samples[index]);
                sample.t += f64::from(round) * span;
                front.push(black_box(&sample)).expect("good sample");
                index += 1;
                if index == performance.samples.len() {
                    index = 0;
                    round += 1;
                }
                front.estimates()[0].amplitude
            });
        });
    }
}

/// A hand of 21 points of which the gestures with a share above zero circle, each at its own points.
fn hand(t: f64, shares: &[(usize, f64)]) -> Vec<[f64; 3]> {
    let mut points: Vec<[f64; 3]> = (0..21)
        .map(|k| {
            let (finger, joint) = ((k + 3) / 4, (k + 3) % 4);
            let spread = 0.02 * finger as f64 - 0.05;
            [spread, 0.1 + 0.002 * k as f64, -0.03 * joint as f64]
        })
        .collect();
    for (gesture, hz) in shares {
        let (sin, cos) = (TAU * hz * t).sin_cos();
        for point in [2 * gesture + 3, 2 * gesture + 4, (5 * gesture) % 19 + 1] {
            points[point][0] += 0.03 * cos;
            points[point][1] += 0.03 * sin;
        }
    }
    points
}

fn eight(criterion: &mut Criterion) {
    let header = PoseHeader {
        points: (0..21)
            .map(|k| {
                if k == 0 {
                    "wrist".into()
                } else {
                    format!("p{k}")
                }
            })
            .collect(),
        dim: 3,
        channels: Vec::new(),
    };
    let mut set = GestureSet::new(&header, hand(0.0, &[]));
    for gesture in 0..8 {
        let times_s: Vec<f64> = (0..60).map(|k| f64::from(k) / 60.0).collect();
        set.put(Gesture {
            name: format!("g{gesture}"),
            kind: GestureKind::Cyclic,
            duration_s: 1.0,
            source: "bench".into(),
            frames: times_s
                .iter()
                .map(|t| hand(*t, &[(gesture, 1.0)]))
                .collect(),
            times_s,
        });
    }
    for (performed, shares) in [
        ("none", &[][..]),
        ("one", &[(2, 1.3)][..]),
        ("two", &[(2, 1.3), (6, 0.8)][..]),
    ] {
        for kind in EstimatorKind::ALL {
            let options = FrontEndOptions {
                estimator: kind,
                ..FrontEndOptions::default()
            };
            let mut front = FrontEnd::new(&set, &header, options).expect("same points");
            let mut k = 0_u32;
            let mut push = |front: &mut FrontEnd| {
                let t = f64::from(k) / 120.0;
                k += 1;
                let points = hand(t, shares).into_iter().map(Some).collect();
                let sample = PoseSample {
                    t,
                    points,
                    ..PoseSample::default()
                };
                front.push(black_box(&sample)).expect("good sample");
            };
            // Five seconds of history first.
            for _ in 0..600 {
                push(&mut front);
            }
            let name = format!(
                "eight gestures, 21 points, 120 Hz, {performed} performed, {}",
                kind.name()
            );
            criterion.bench_function(&name, |bencher| bencher.iter(|| push(&mut front)));
        }
    }
}

criterion_group!(benches, push, eight);
criterion_main!(benches);
