//! The confusion matrix by playing: gestures read themselves, twins read each other, and the words say so.

mod gesture_support;

use gesture_support::{Path, header, pose, sample, times, wave_set};
use handwave::gesture::{
    CyclicMarks, FrontEndError, FrontEndOptions, GestureSet, confusion, define_cyclic,
    define_non_cyclic,
};
use handwave::gesture::{NonCyclicMarks, STARTS};
use handwave::pose::Recording;
use std::f64::consts::TAU;

/// Adds to `set` a gesture in which `change` moves the resting figure by the cosine and sine of the phase.
fn add(set: &mut GestureSet, name: &str, change: impl Fn(&mut Vec<[f64; 3]>, f64, f64)) {
    let samples = times(60.0, 3.2, 0.0, 1)
        .into_iter()
        .map(|t| {
            let mut figure = pose(Path::Loop, 0.0, 0.0);
            change(&mut figure, (TAU * t).cos(), (TAU * t).sin());
            sample(t, &figure)
        })
        .collect();
    let recording = Recording {
        header: header(),
        samples,
    };
    let marks = CyclicMarks {
        start_s: 0.1,
        end_s: None,
    };
    let found = define_cyclic(set, &recording, name, "test", marks).expect("periodic");
    set.put(found.gesture);
}

#[test]
fn an_empty_set_has_no_matrix() {
    let set = GestureSet::new(&header(), Vec::new());
    let refused = confusion(&set, FrontEndOptions::default());
    assert_eq!(refused, Err(FrontEndError::NoGestures));
}

#[test]
fn a_lone_wave_reads_itself_at_every_speed_in_proportion_to_its_size() {
    let matrix = confusion(&wave_set(Path::Loop), FrontEndOptions::default()).expect("a set");
    assert_eq!(matrix.readings.len(), 6);
    for reading in &matrix.readings {
        println!("{reading:?}");
        let error = (reading.mean - reading.size).abs();
        assert!(error < 0.08, "{reading:?}");
    }
    let verdicts = matrix.verdicts();
    assert!(
        verdicts[0].works && verdicts[0].words.contains("is good"),
        "{verdicts:?}"
    );
}

#[test]
fn gestures_of_different_limbs_are_good_and_twins_are_told_apart_by_words() {
    let mut set = wave_set(Path::Loop);
    add(&mut set, "nod", |figure, cos, sin| {
        figure[2][1] += 0.1 * cos;
        figure[2][2] += 0.1 * sin;
    });
    let apart = confusion(&set, FrontEndOptions::default()).expect("a set");
    for verdict in apart.verdicts() {
        println!("{}", verdict.words);
        assert!(verdict.works && verdict.confused.is_empty(), "{verdict:?}");
    }
    // Nearly the wave: a little flatter.
    add(&mut set, "twin", |figure, cos, sin| {
        figure[5][1] += 0.2 * cos;
        figure[5][2] += 0.16 * sin;
        figure[4][1] += 0.1 * cos;
        figure[4][2] += 0.08 * sin;
    });
    let close = confusion(&set, FrontEndOptions::default()).expect("a set");
    let verdicts = close.verdicts();
    for verdict in &verdicts {
        println!("{}", verdict.words);
    }
    let named = |g: usize| verdicts[g].confused.iter().any(|c| c.0 == 2 - g);
    assert!(named(0) && named(2), "{verdicts:?}");
    assert!(
        verdicts[0].words.contains("`twin`") && verdicts[0].words.contains("differ more"),
        "{}",
        verdicts[0].words
    );
    assert!(close.largest(1, 0) < STARTS, "the nod moves nothing");
}

#[test]
fn a_progression_reads_to_its_extreme_and_leaves_a_wave_alone() {
    let mut set = wave_set(Path::Loop);
    let samples = times(60.0, 2.0, 0.0, 1)
        .into_iter()
        .map(|t| {
            let mut figure = pose(Path::Loop, 0.0, 0.0);
            figure[3][1] += (t - 0.5).clamp(0.0, 0.5);
            sample(t, &figure)
        })
        .collect();
    let recording = Recording {
        header: header(),
        samples,
    };
    let marks = NonCyclicMarks {
        rest_s: 0.5,
        extreme_s: 1.0,
    };
    let found = define_non_cyclic(&set, &recording, "raise", "test", marks).expect("moves");
    set.put(found.gesture);
    let matrix = confusion(&set, FrontEndOptions::default()).expect("a set");
    let own = matrix.largest(1, 1);
    println!(
        "raise reads {own:.3} of itself, wave {:.3} of raise",
        matrix.largest(1, 0)
    );
    assert!((own - 1.0).abs() < 0.1, "{own}");
    assert!(matrix.largest(1, 0) < STARTS, "{}", matrix.largest(1, 0));
}
