//! Made-up classes for tests and benches of the transition search: smooth random motions.
#![allow(dead_code, reason = "every test file uses its own part")]

use handwave::base::random::SplitMix;
use handwave::motion::search::{
    ClassSpec, ClipFeatures, DistanceTables, Hat, Search, SearchClass, SearchOptions, State,
};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Frames x width of a smooth random motion: two harmonics about an offset, metres.
pub fn motion(random: &mut SplitMix, frames: usize, width: usize, cyclic: bool) -> Vec<f64> {
    let turns = if cyclic { 1.0 } else { 0.4 };
    let waves: Vec<[f64; 5]> = (0..width)
        .map(|_| std::array::from_fn(|_| random.unit()))
        .collect();
    let steps = if cyclic { frames } else { frames - 1 };
    let value = |k: usize, [offset, a, b, p, q]: &[f64; 5]| {
        let phase = TAU * turns * k as f64 / steps as f64;
        0.1 * offset + 0.1 * a * (phase + TAU * p).sin() + 0.04 * b * (2.0 * phase + TAU * q).sin()
    };
    (0..frames)
        .flat_map(|k| waves.iter().map(move |w| value(k, w)))
        .collect()
}

/// A class of 2^P random corner clips.
pub fn class(seed: u64, name: &str, parameters: usize, cyclic: bool, width: usize) -> SearchClass {
    let mut random = SplitMix::new(seed);
    let frames = 20;
    let hat = Hat::corners(parameters);
    let made: Vec<(f64, Vec<f64>)> = (0..1 << parameters)
        .map(|_| {
            let duration_s = 0.6 + 0.8 * random.unit();
            (duration_s, motion(&mut random, frames, width, cyclic))
        })
        .collect();
    let clips: Vec<ClipFeatures<'_>> = made
        .iter()
        .map(|(duration_s, positions)| ClipFeatures {
            name,
            duration_s: *duration_s,
            width,
            positions,
            root: &[],
            penalty: &[],
        })
        .collect();
    let spec = ClassSpec {
        frames,
        ..ClassSpec::new(name, cyclic, width)
    };
    SearchClass::new(&spec, &clips, Arc::new(hat)).expect("good clips")
}

/// A search between two random classes of P parameters; the target is open when `open`.
pub fn search(parameters: usize, open: bool, width: usize, options: SearchOptions) -> Search {
    let source = Arc::new(class(11, "source", parameters, true, width));
    let target = Arc::new(class(12, "target", parameters, !open, width));
    over(&source, &target, options)
}

/// A search over one edge.
pub fn over(
    source: &Arc<SearchClass>,
    target: &Arc<SearchClass>,
    options: SearchOptions,
) -> Search {
    let tables = Arc::new(DistanceTables::new(source, target).expect("same features"));
    Search::new(source.clone(), target.clone(), tables, options).expect("good options")
}

/// A random state.
pub fn state(random: &mut SplitMix) -> State {
    State {
        t: random.unit(),
        parameters: std::array::from_fn(|_| random.unit()),
    }
}

/// A state on the grid of tenths.
pub fn tenths(random: &mut SplitMix) -> State {
    let mut tenth = || (random.unit() * 10.0).floor() / 10.0;
    State {
        t: tenth(),
        parameters: std::array::from_fn(|_| tenth()),
    }
}
