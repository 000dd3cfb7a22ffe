//! What one sample costs the front end: the bundled performance, 108 Hz, one cyclic gesture and one
//! non-cyclic, and the same with two cyclic ones.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

use criterion::{Criterion, criterion_group, criterion_main};
use handwave::gesture::{FrontEnd, FrontEndOptions, GestureSet};
use handwave::pose::Recording;
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

criterion_group!(benches, push);
criterion_main!(benches);
