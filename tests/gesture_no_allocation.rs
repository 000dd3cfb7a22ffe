//! After construction the front end allocates nothing, proved by a counting allocator.

mod gesture_support;
mod support;

use gesture_support::{Path, Random, header, pose, sample, times, wave_set};
use handwave::gesture::{
    DerivedChannel, EstimatorKind, FrontEnd, FrontEndOptions, Gesture, GestureKind, GestureSet,
    PerformerScale,
};
use handwave::pose::{PoseHeader, PoseSample};
use std::f64::consts::TAU;
use support::counting::{Counting, allocations};

#[global_allocator]
static COUNTING: Counting = Counting;

/// A stream in which everything goes wrong that is mended: points missing, jumping and doubted,
/// hands exchanged, after a second of rest.
fn troubled(until_s: f64) -> Vec<PoseSample> {
    let mut random = Random(3);
    let mut samples = Vec::new();
    for t in times(120.0, until_s, 0.3, 1) {
        let size = if t < 1.5 { 0.0 } else { 1.0 };
        let mut shown = sample(t, &pose(Path::Line, size, 6.0 * t));
        shown.confidence = vec![1.0; 6];
        if t > 2.0 {
            match (20.0 * random.unit()) as usize {
                0 => shown.points[5] = None,
                1 => shown.points[2] = shown.points[2].map(|[x, y, z]| [x + 0.8, y, z]),
                2 => shown.points.swap(3, 5),
                3 => shown.confidence[4] = 0.5,
                _ => {}
            }
        }
        samples.push(shown);
    }
    samples
}

#[test]
fn push_estimate_and_predict_allocate_nothing() {
    let set = wave_set(Path::Line);
    let mood = DerivedChannel {
        name: "mood".into(),
        weights: vec![("height".into(), 0.5), ("yaw".into(), -1.0)],
        offset: 0.1,
        range: Some([-1.0, 1.0]),
        smoothing_s: 2.0,
    };
    let mut front = FrontEnd::new(&set, &header(), FrontEndOptions::default())
        .expect("match")
        .with_channel(&mood)
        .expect("a good mix");
    // 500 Hz overfills every window, so the wrap of the buffers is passed too.
    let samples: Vec<_> = times(500.0, 10.0, 0.3, 1)
        .into_iter()
        // And a long gap, after which the estimators begin anew.
        .map(|t| if t < 8.0 { t } else { t + 2.0 })
        .map(|t| sample(t, &pose(Path::Line, 1.0, 6.0 * t)))
        .collect();
    let before = allocations();
    let mut sum = 0.0;
    for sample in &samples {
        front.push(sample).expect("good sample");
        front.push(sample).expect_err("the same time again");
        sum += front.predict(0, sample.t + 0.01).amplitude + front.channel(0);
    }
    let after = allocations();
    assert!(sum > 0.0);
    assert_eq!(after - before, 0, "allocations in {} pushes", samples.len());

    let mut stream = header();
    stream.points[4] = "elbow".into();
    let mut set = set;
    set.header.points[4] = "elbow".into();
    let options = FrontEndOptions {
        scale: PerformerScale::Rest,
        ..FrontEndOptions::default()
    };
    let nodes = [vec![0], vec![]];
    let mut front = FrontEnd::with_neighbourhoods(&set, &stream, options, &nodes).expect("match");
    let samples = troubled(6.0);
    let before = allocations();
    for (k, sample) in samples.iter().enumerate() {
        front.push(sample).ok();
        front.set_active(k / 100 % 2);
    }
    let after = allocations();
    let mended = front.tracking();
    assert!(
        mended.outliers > 10 && mended.swapped > 10 && mended.filled > mended.outliers,
        "{mended:?}"
    );
    assert!(front.performer_scale().is_some(), "never measured");
    assert_eq!(
        after - before,
        0,
        "allocations in {} troubled pushes",
        samples.len()
    );
}

#[test]
fn eight_gestures_of_a_hand_of_21_points_allocate_nothing_with_any_estimator() {
    let header = PoseHeader {
        points: (0..21).map(|k| format!("p{k}")).collect(),
        dim: 3,
        channels: Vec::new(),
    };
    let hand = |t: f64, gesture: usize| -> Vec<[f64; 3]> {
        let (sin, cos) = (TAU * t).sin_cos();
        (0..21)
            .map(|k| {
                let share = if k / 2 == gesture { 0.03 } else { 0.0 };
                let x = k as f64;
                [
                    0.01 * x + share * cos,
                    0.1 + share * sin,
                    0.02 * (x * x).sin(),
                ]
            })
            .collect()
    };
    let mut set = GestureSet::new(&header, hand(0.0, 99));
    for gesture in 0..8 {
        let times_s: Vec<f64> = (0..60).map(|k| f64::from(k) / 60.0).collect();
        set.put(Gesture {
            name: format!("g{gesture}"),
            kind: GestureKind::Cyclic,
            duration_s: 1.0,
            source: "test".into(),
            frames: times_s.iter().map(|t| hand(*t, gesture)).collect(),
            times_s,
        });
    }
    for kind in EstimatorKind::ALL {
        let options = FrontEndOptions {
            estimator: kind,
            ..FrontEndOptions::default()
        };
        let mut front = FrontEnd::new(&set, &header, options).expect("match");
        // Performed, changed, stopped: every path of the estimators.
        let samples: Vec<PoseSample> = (0..720)
            .map(|k| {
                let t = f64::from(k) / 120.0;
                let places = match t {
                    t if t < 3.0 => hand(t, 2),
                    t if t < 4.0 => hand(2.0 * t, 2),
                    t if t < 5.0 => hand(1.4 * t, 6),
                    _ => hand(0.0, 99),
                };
                sample(t, &places)
            })
            .collect();
        let before = allocations();
        let mut largest = 0.0_f64;
        for sample in &samples {
            front.push(sample).expect("good sample");
            largest = largest.max(front.estimates()[2].amplitude);
        }
        let after = allocations();
        assert_eq!(after - before, 0, "allocations with {}", kind.name());
        assert!(largest > 0.5, "{}: {largest}", kind.name());
    }
}
