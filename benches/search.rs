//! What a transition request costs: 1, 2 and 3 free parameters at depth 10, the search beside all pairs
//! of nodes (all pairs of three parameters are 8.5e7: seconds, so they are left to `graph study`).
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

#[path = "../tests/search_support/mod.rs"]
mod search_support;

use criterion::{Criterion, criterion_group, criterion_main};
use handwave::motion::search::{SearchOptions, Target, calibrate, calibrate::random_requests};
use search_support::search;
use std::hint::black_box;

fn find(criterion: &mut Criterion) {
    for parameters in 1..=3 {
        // Features of twelve joints, as of a quadruped.
        let mut search = search(parameters, false, 12, SearchOptions::default());
        let requests = random_requests(&search, 50, 7);
        calibrate(&mut search, &requests[..10]).expect("good options");
        let mut next = 0;
        criterion.bench_function(&format!("transition, P={parameters}"), |bencher| {
            bencher.iter(|| {
                next = (next + 1) % requests.len();
                let (from, to) = requests[next];
                search.find(black_box(&from), &Target::State(to)).is_ok()
            });
        });
        if parameters < 3 {
            let name = format!("transition, all pairs, P={parameters}");
            criterion.bench_function(&name, |bencher| {
                bencher.iter(|| {
                    next = (next + 1) % requests.len();
                    let (from, to) = requests[next];
                    search
                        .exhaustive(black_box(&from), &Target::State(to))
                        .is_ok()
                });
            });
        }
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = find
}
criterion_main!(benches);
