//! Gestures compete only where both can be performed: planes per neighbourhood of the motion graph.

mod gesture_support;

use gesture_support::{Path, Random, header, pose, sample, times};
use handwave::base::wrap_pi;
use handwave::gesture::{
    CyclicMarks, FrontEnd, FrontEndOptions, GestureEstimate, GestureSet, define_cyclic,
};
use handwave::pose::Recording;
use std::f64::consts::TAU;

/// What is performed: right hand, left hand, head, or the right hand with the chest along.
#[derive(Copy, Clone, Default)]
struct Sizes {
    right: f64,
    left: f64,
    head: f64,
    right_and_chest: f64,
}

fn figure(sizes: Sizes, t: f64) -> Vec<[f64; 3]> {
    let mut places = pose(Path::Loop, sizes.right + sizes.right_and_chest, TAU * t);
    let mut turn = |point: usize, reach: f64, hz: f64| {
        places[point][1] += reach * (TAU * hz * t).cos();
        places[point][2] += reach * (TAU * hz * t).sin();
    };
    turn(3, 0.2 * sizes.left, 1.7);
    turn(2, 0.1 * sizes.head, 0.8);
    turn(1, 0.005 * sizes.right_and_chest, 1.0);
    places
}

/// A chain of four nodes, each with its gesture; the first and the last are hard to tell apart.
const CHAIN: [[usize; 4]; 4] = [[0, 1, 2, 2], [0, 1, 2, 3], [0, 1, 2, 3], [1, 2, 3, 3]];

fn set() -> GestureSet {
    let mut set = GestureSet::new(&header(), Vec::new());
    let none = Sizes::default();
    for (name, sizes) in [
        ("right", Sizes { right: 1.0, ..none }),
        ("left", Sizes { left: 1.0, ..none }),
        ("nod", Sizes { head: 1.0, ..none }),
        (
            "right with chest",
            Sizes {
                right_and_chest: 1.0,
                ..none
            },
        ),
    ] {
        let recording = Recording {
            header: header(),
            samples: times(60.0, 4.0, 0.2, 4)
                .into_iter()
                .map(|t| sample(t, &figure(sizes, t)))
                .collect(),
        };
        let marks = CyclicMarks {
            start_s: 0.3,
            end_s: None,
        };
        let found = define_cyclic(&set, &recording, name, "test", marks).expect("periodic");
        set.put(found.gesture);
    }
    set
}

fn chain(set: &GestureSet) -> FrontEnd {
    let nodes = CHAIN.map(|node| node.to_vec());
    FrontEnd::with_neighbourhoods(set, &header(), FrontEndOptions::default(), &nodes)
        .expect("points match")
}

/// The mean amplitudes from 3 s to 8 s while `sizes` is performed, with tracker noise of 3 mm.
fn read(front: &mut FrontEnd, sizes: Sizes) -> Vec<f64> {
    let mut random = Random(12);
    let mut sums = vec![0.0; front.estimates().len()];
    let mut count = 0.0;
    for t in times(60.0, 8.0, 0.3, 5) {
        let mut places = figure(sizes, t);
        for value in places.iter_mut().flatten() {
            *value += 0.003 * random.normal();
        }
        front.push(&sample(t, &places)).expect("good sample");
        if t > 3.0 {
            count += 1.0;
            for (sum, estimate) in sums.iter_mut().zip(front.estimates()) {
                *sum += estimate.amplitude;
            }
        }
    }
    sums.iter().map(|sum| sum / count).collect()
}

#[test]
fn confusable_gestures_more_than_two_edges_apart_are_read_cleanly() {
    let set = set();
    let right = Sizes {
        right: 1.0,
        ..Sizes::default()
    };
    let with_chest = Sizes {
        right_and_chest: 1.0,
        ..Sizes::default()
    };
    for (node, sizes, own, other) in [(0, right, 0, 3), (3, with_chest, 3, 0)] {
        let mut front = chain(&set);
        front.set_active(node);
        let apart = read(&mut front, sizes);
        let together = FrontEnd::new(&set, &header(), FrontEndOptions::default());
        let together = read(&mut together.expect("points match"), sizes);
        println!("node {node}: {apart:.3?}, where all compete {together:.3?}");
        assert!((apart[own] - 1.0).abs() < 0.05, "own gesture: {apart:.3?}");
        assert_eq!(apart[other], 0.0, "out of reach and not silent");
        let between = apart[1].max(apart[2]);
        assert!(between < 0.05, "others: {apart:.3?}");
        let confused = (together[own] - 1.0).abs().max(together[other]);
        assert!(confused > 0.2, "they are easily told apart: {together:.3?}");
    }
}

#[test]
fn going_to_another_node_jumps_nowhere_and_is_as_if_one_had_always_been_there() {
    let set = set();
    let sizes = Sizes {
        left: 0.8,
        head: 0.6,
        ..Sizes::default()
    };
    let mut walker = chain(&set);
    let mut stayers: Vec<FrontEnd> = (0..4).map(|_| chain(&set)).collect();
    for (node, stayer) in stayers.iter_mut().enumerate() {
        stayer.set_active(node);
    }
    let mut last: Option<Vec<GestureEstimate>> = None;
    let (mut jump, mut turn) = (0.0_f64, 0.0_f64);
    for (k, t) in times(60.0, 12.0, 0.2, 9).into_iter().enumerate() {
        let shown = sample(t, &figure(sizes, t));
        walker.push(&shown).expect("good sample");
        for stayer in &mut stayers {
            stayer.push(&shown).expect("good sample");
        }
        // To and fro along the chain, and to nodes that do not exist.
        let before = walker.estimates().to_vec();
        let node = [0, 1, 2, 3, 2, 1][k / 10 % 6];
        walker.set_active(node);
        walker.set_active(99);
        assert_eq!(
            walker.estimates(),
            stayers[node].estimates(),
            "node {node} at {t} s"
        );
        if t > 4.0 && last.is_some() {
            for gesture in [1, 2] {
                let (a, b) = (before[gesture], walker.estimates()[gesture]);
                jump = jump.max((a.amplitude - b.amplitude).abs());
                turn = turn.max(wrap_pi(a.phase_rad - b.phase_rad).abs());
            }
        }
        last = Some(before);
    }
    println!(
        "{} planes for 4 gestures; going elsewhere moves amplitude by {jump:.4}, phase by {turn:.4} rad",
        walker.planes()
    );
    assert!(jump < 0.03 && turn < 0.05, "{jump:.4}, {turn:.4} rad");
    // Left hand and nod tell the same with and without the rest. The right hand with and without the
    // chest move in the same directions: no plane keeps these two apart, wherever one is.
    assert_eq!(walker.planes(), 4, "planes that tell the same are shared");
}

#[test]
fn a_graph_in_which_all_is_near_has_one_set_of_planes() {
    let set = set();
    let all = vec![vec![3, 2, 1, 0, 0, 77]; 5];
    let options = FrontEndOptions::default();
    let mut near = FrontEnd::with_neighbourhoods(&set, &header(), options, &all).expect("match");
    let mut one = FrontEnd::new(&set, &header(), options).expect("match");
    let mut none = FrontEnd::with_neighbourhoods(&set, &header(), options, &[]).expect("match");
    assert_eq!([near.planes(), one.planes(), none.planes()], [4; 3]);
    let both = Sizes {
        right: 0.7,
        left: 1.0,
        ..Sizes::default()
    };
    for (k, t) in times(60.0, 4.0, 0.2, 9).into_iter().enumerate() {
        let shown = sample(t, &figure(both, t));
        near.set_active(k % 5);
        for front in [&mut near, &mut one, &mut none] {
            front.push(&shown).expect("good sample");
        }
        assert_eq!(near.estimates(), one.estimates());
        assert_eq!(none.estimates(), one.estimates());
    }
}
