//! Pose mapping by the numbers: what is refused, eq. 8.1 and 8.3, recovery, and what can never be left.

use handwave::motion::mapping::{
    LatentVolume, MapOptions, MappingError, Pair, PoseMap, ROOT_RIDGE, Regression, RootMap,
    Uncertainty, spread_m,
};
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

/// Numbers in -1..1 from a simple generator: the same every time.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn row(&mut self, len: usize) -> Vec<f64> {
        (0..len).map(|_| self.next()).collect()
    }
}

const JOINTS: usize = 5;

/// Target motion in two directions and a little of a third.
fn frames() -> Vec<Vec<f64>> {
    (0..200)
        .map(|k| {
            let u = f64::from(k) * 0.0314;
            let (a, b, c) = (u.sin(), (1.7 * u).cos(), 0.1 * (5.0 * u).sin());
            vec![a, 0.5 * b, 0.3 * a - 0.2 * b, c, 0.4 * a + c]
        })
        .collect()
}

fn volume() -> LatentVolume {
    LatentVolume::learn(&frames(), 50).expect("frames that move")
}

fn pair(label: &str, source: Vec<f64>, frame: usize) -> Pair {
    Pair {
        label: label.into(),
        source,
        target: frames()[frame].clone(),
    }
}

fn learn(pairs: &[Pair]) -> Result<PoseMap, MappingError> {
    PoseMap::learn(
        pairs,
        0.1,
        volume(),
        RootMap::default(),
        MapOptions::default(),
    )
}

#[track_caller]
fn refused(pairs: &[Pair], parts: &[&str]) {
    let message = learn(pairs).expect_err("must be refused").to_string();
    for part in parts {
        assert!(message.contains(part), "no {part:?} in: {message}");
    }
}

#[test]
fn degenerate_pairs_are_refused_by_name() {
    let mut n = Numbers(3);
    let pairs: Vec<Pair> = (0..4)
        .map(|k| pair(&format!("pair {k} (at {k} s)"), n.row(12), 40 * k))
        .collect();
    learn(&pairs).expect("good pairs");
    refused(&[], &["0 pairs are given", "at least 2"]);
    refused(&pairs[..1], &["1 pair is given", "map suggest"]);

    let mut twice = pairs.clone();
    twice[3].source = twice[1].source.clone();
    refused(
        &twice,
        &["pair 1 (at 1 s)", "pair 3 (at 3 s)", "same source pose"],
    );

    let mut constant = pairs.clone();
    for pair in &mut constant {
        pair.source = vec![0.2; 12];
    }
    refused(
        &constant,
        &["pair 0 (at 0 s) to pair 3 (at 3 s)", "does not change"],
    );

    let mut broken = pairs.clone();
    broken[2].source[5] = f64::NAN;
    refused(
        &broken,
        &["pair 2 (at 2 s): source pose", "number 5 is NaN"],
    );
    broken = pairs.clone();
    broken[2].target[4] = f64::INFINITY;
    refused(
        &broken,
        &["pair 2 (at 2 s): target pose", "number 4 is inf"],
    );
    broken = pairs.clone();
    broken[1].source.pop();
    refused(
        &broken,
        &["pair 1 (at 1 s): source pose", "found 11", "expected 12"],
    );
    broken = pairs.clone();
    broken[3].target.push(0.0);
    refused(
        &broken,
        &["pair 3 (at 3 s): target pose", "found 6", "expected 5"],
    );

    let still = vec![vec![0.0; 12]; 30];
    let message = spread_m("take.csv", &still)
        .expect_err("stands still")
        .to_string();
    assert!(
        message.contains("take.csv") && message.contains("does not change"),
        "{message}"
    );
    for (frames, part) in [
        (vec![], "0 target frames"),
        (vec![vec![0.3; 5]; 10], "do not move"),
        (vec![vec![0.3; 5], vec![0.1; 4]], "target frame 1: found 4"),
        (
            vec![vec![0.3; 5], vec![f64::NAN; 5]],
            "target frame 1: number 0",
        ),
    ] {
        let message = LatentVolume::learn(&frames, 50)
            .expect_err(part)
            .to_string();
        assert!(message.contains(part), "{message}");
    }
    let narrow = volume()
        .within(&[0.5; JOINTS], &[0.6; JOINTS])
        .expect_err("mean outside");
    assert!(
        narrow.to_string().contains("outside its limits"),
        "{narrow}"
    );
}

/// Eq. 8.3 as it is written, with the big matrix.
fn by_the_book(xs: &[Vec<f64>], ys: &[Vec<f64>], x: &[f64], noise: f64) -> (Vec<f64>, f64) {
    let column = |x: &[f64]| x.iter().copied().chain([1.0]).collect::<Vec<f64>>();
    let d = x.len() + 1;
    let big_x = DMatrix::from_fn(d, xs.len(), |r, c| column(&xs[c])[r]);
    let big_y = DMatrix::from_fn(ys[0].len(), ys.len(), |r, c| ys[c][r]);
    let a = &big_x * big_x.transpose() / noise + DMatrix::identity(d, d);
    let inverse = a.try_inverse().expect("positive definite");
    let star = DVector::from_vec(column(x));
    let mean = &big_y * big_x.transpose() * &inverse * &star / noise;
    let q = (star.transpose() * inverse * &star)[(0, 0)];
    (mean.as_slice().to_vec(), q)
}

#[test]
fn dual_and_primal_form_are_eq_8_3() {
    let mut n = Numbers(11);
    // Few pairs of long inputs (dual), many pairs of short ones (primal).
    for (inputs, pairs) in [(36, 8), (6, 60), (7, 8)] {
        let xs: Vec<Vec<f64>> = (0..pairs).map(|_| n.row(inputs)).collect();
        let ys: Vec<Vec<f64>> = (0..pairs).map(|_| n.row(3)).collect();
        let map = Regression::fit(&xs, &ys, &[], 0.05).expect("good pairs");
        let uncertainty = map.uncertainty();
        let mut scratch = vec![0.0; uncertainty.scratch_len()];
        for _ in 0..20 {
            let x = n.row(inputs);
            let (mean, q) = by_the_book(&xs, &ys, &x, 0.05);
            let mut found = [0.0; 3];
            map.predict(&x, &mut found);
            for (found, mean) in found.iter().zip(&mean) {
                let error = (found - mean).abs();
                assert!(
                    error < 1e-9,
                    "{inputs} inputs, {pairs} pairs: mean off by {error}"
                );
            }
            let error = (uncertainty.q(&x, &mut scratch) - q).abs();
            assert!(
                error < 1e-9 * (1.0 + q),
                "{inputs} inputs, {pairs} pairs: q off by {error}"
            );
        }
    }
    let blank = Uncertainty::new(4, &[], 0.05);
    assert_eq!(
        blank.q(&[1.0, 2.0, 0.0, 0.0], &mut []),
        6.0,
        "the prior: x^T x and the bias"
    );
}

/// A source that moves in `modes` ways, its feature (places and velocities) and a target linear in it.
struct Linear {
    ways: Vec<Vec<f64>>,
    to_target: Vec<Vec<f64>>,
}

impl Linear {
    fn new(points: usize, modes: usize) -> Self {
        let mut n = Numbers(29);
        Self {
            ways: (0..modes).map(|_| n.row(3 * points)).collect(),
            to_target: (0..modes).map(|_| n.row(JOINTS)).collect(),
        }
    }

    fn at(&self, t: f64) -> (Vec<f64>, Vec<f64>) {
        let width = self.ways[0].len();
        let (mut feature, mut target) = (vec![0.0; 2 * width], vec![0.2; JOINTS]);
        for (mode, (way, to)) in self.ways.iter().zip(&self.to_target).enumerate() {
            let speed = [1.0, 1.6, 2.3][mode % 3] * 2.0;
            let phase = speed * t + mode as f64;
            for (c, way) in way.iter().enumerate() {
                feature[c] += 0.05 * way * phase.sin();
                feature[width + c] += 0.1 * 0.05 * way * speed * phase.cos();
            }
            for (target, to) in target.iter_mut().zip(to) {
                *target += 0.6 * to * phase.sin();
            }
        }
        (feature, target)
    }
}

#[test]
fn a_linear_relation_is_recovered_from_eight_pairs() {
    for points in [3, 6, 21, 67] {
        let relation = Linear::new(points, 3);
        let times: Vec<f64> = (0..600).map(|k| f64::from(k) * 0.033).collect();
        let (features, targets): (Vec<_>, Vec<_>) = times.iter().map(|t| relation.at(*t)).unzip();
        let spread = spread_m("the source", &features).expect("it moves");
        // As a user with `map suggest`: each pair where the map is least certain.
        let scale = |feature: &Vec<f64>| {
            let mut x = vec![0.0; feature.len()];
            handwave::motion::mapping::scaled(feature, spread, &mut x);
            x
        };
        let frames: Vec<Vec<f64>> = features.iter().map(scale).collect();
        let (mut taught, mut pairs) = (Vec::new(), Vec::new());
        for k in 0..8 {
            let q = Uncertainty::new(frames[0].len(), &taught, 0.05);
            let best = handwave::motion::mapping::candidates(&q, &times, &frames, 5)[0];
            taught.push(frames[best.frame].clone());
            pairs.push(Pair {
                label: format!("pair {k}"),
                source: features[best.frame].clone(),
                target: targets[best.frame].clone(),
            });
        }
        let volume = LatentVolume::learn(&targets, 50).expect("it moves");
        let options = MapOptions::default();
        let mut map = PoseMap::learn(&pairs, spread, volume, RootMap::default(), options)
            .expect("good pairs");
        let mut pose = vec![0.0; JOINTS];
        let (mut error, mut variance) = (0.0, 0.0);
        for (feature, target) in features.iter().zip(&targets) {
            map.apply(feature, &mut pose);
            error += pose
                .iter()
                .zip(target)
                .map(|(a, b)| (a - b).powi(2))
                .sum::<f64>();
            variance += target.iter().map(|b| (b - 0.2).powi(2)).sum::<f64>();
        }
        let share = (error / variance).sqrt();
        println!(
            "{points} points: error {:.3} % of the motion",
            100.0 * share
        );
        assert!(
            share < 0.01,
            "{points} points: error {:.2} %, bound 1 %",
            100.0 * share
        );
    }
}

#[test]
fn axes_are_orthonormal_ordered_and_hold_what_they_say() {
    let frames = frames();
    let volume = volume();
    assert_eq!(volume.dimensions(), 3, "three ways to move");
    assert!(volume.kept > 0.999_999, "kept {}", volume.kept);
    let short = LatentVolume::learn(&frames, 2).expect("frames that move");
    assert_eq!(short.dimensions(), 2);
    assert!(
        short.kept > 0.97 && short.kept < 0.9999,
        "two of three keep {}",
        short.kept
    );
    // A mesh: more coordinates than frames. The other Gram matrix gives the same.
    let wide: Vec<Vec<f64>> = frames[..4].to_vec();
    let wide = LatentVolume::learn(&wide, 50).expect("frames that move");
    for v in [&volume, &wide] {
        for (a, first) in v.axes.chunks(JOINTS).enumerate() {
            for (b, second) in v.axes.chunks(JOINTS).enumerate() {
                let product: f64 = first.iter().zip(second).map(|(x, y)| x * y).sum();
                let expected = if a == b { 1.0 } else { 0.0 };
                assert!(
                    (product - expected).abs() < 1e-6,
                    "axes {a} and {b}: {product}"
                );
            }
        }
    }
    let mut coefficients = vec![0.0; 3];
    let mut back = vec![0.0; JOINTS];
    for frame in &frames {
        volume.project(frame, &mut coefficients);
        let unclipped = coefficients.clone();
        volume.clip(&mut coefficients);
        for (c, u) in coefficients.iter().zip(&unclipped) {
            assert!(
                (c - u).abs() < 1e-12,
                "a target frame lies outside its own volume: {u}"
            );
        }
        volume.back(&coefficients, &mut back);
        for (a, b) in back.iter().zip(frame) {
            assert!((a - b).abs() < 1e-9, "{a} for {b}");
        }
    }
}

#[test]
fn travel_follows_the_change_of_pose() {
    let mut n = Numbers(5);
    let speeds: Vec<Vec<f64>> = (0..300).map(|_| n.row(3)).collect();
    // Absolute values: a leg going back carries the body forwards as one going forth.
    let truth = [[0.3, 0.1, 0.05], [0.0, 0.02, -0.01]];
    let dot = |w: &[f64; 3], v: &[f64]| -> f64 { w.iter().zip(v).map(|(w, v)| w * v.abs()).sum() };
    let velocities: Vec<[f64; 2]> = speeds
        .iter()
        .map(|v| [dot(&truth[0], v), dot(&truth[1], v)])
        .collect();
    let map = RootMap::learn(&speeds, &velocities, ROOT_RIDGE).expect("good rows");
    for (found, truth) in map.weights.iter().zip(truth.iter().flatten()) {
        assert!(
            (found - truth).abs() < 10.0 * ROOT_RIDGE.powi(2),
            "{found} for {truth}"
        );
    }
    let [forward, left] = map.velocity(&[-1.0, 0.0, 0.0]);
    assert!(
        (forward - 0.3).abs() < 1e-5 && left.abs() < 1e-5,
        "{forward} {left}"
    );
    let still = RootMap::learn(&speeds, &vec![[0.0; 2]; 300], ROOT_RIDGE).expect("good rows");
    assert_eq!(still.velocity(&[1.0, 1.0, 1.0]), [0.0; 2]);
}

fn absurd() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => -0.5..0.5f64,
        2 => -50.0..50.0f64,
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
        1 => Just(-1e300),
        1 => Just(f64::MAX),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    /// Any pairs, any limits around the mean, any input: the pose is in the volume and in the limits.
    #[test]
    fn the_mapped_pose_never_leaves_the_volume_nor_the_limits(
        sources in prop::collection::vec(prop::collection::vec(-0.5..0.5f64, 12), 2..7),
        // Targets beyond what was ever shown.
        reach in 0.1..4.0f64,
        room in prop::collection::vec((0.02..1.5f64, 0.02..1.5f64), JOINTS),
        inputs in prop::collection::vec(prop::collection::vec(absurd(), 12), 1..20),
    ) {
        let open = volume();
        let lower: Vec<f64> = open.mean.iter().zip(&room).map(|(m, r)| m - r.0).collect();
        let upper: Vec<f64> = open.mean.iter().zip(&room).map(|(m, r)| m + r.1).collect();
        let volume = open.within(&lower, &upper).expect("the mean is inside");
        let pairs: Vec<Pair> = sources.iter().enumerate().map(|(k, source)| Pair {
            label: format!("pair {k}"),
            source: source.clone(),
            target: (0..JOINTS)
                .map(|j| (volume.mean[j] + reach * (frames()[31 * k][j] - volume.mean[j])).clamp(lower[j], upper[j]))
                .collect(),
        }).collect();
        let mut map = PoseMap::learn(&pairs, 0.1, volume.clone(), RootMap::default(), MapOptions::default())
            .expect("random pairs differ");
        let mut pose = vec![0.0; JOINTS];
        let mut coefficients = vec![0.0; volume.dimensions()];
        for input in inputs.iter().chain([&vec![], &vec![0.1; 3]]) {
            map.apply(input, &mut pose);
            volume.project(&pose, &mut coefficients);
            for (c, (low, high)) in coefficients.iter().zip(volume.low.iter().zip(&volume.high)) {
                prop_assert!(*c >= low - 1e-9 && *c <= high + 1e-9, "coefficient {c} not in {low}..{high} for {input:?}");
            }
            for (q, (low, high)) in pose.iter().zip(lower.iter().zip(&upper)) {
                prop_assert!(q >= low && q <= high, "joint {q} not in {low}..{high} for {input:?}");
            }
            // Inside the volume also means: nothing beside its axes.
            let mut back = vec![0.0; JOINTS];
            volume.back(&coefficients, &mut back);
            for (a, b) in pose.iter().zip(&back) {
                prop_assert!((a - b).abs() < 1e-9, "{a} lies {} beside the axes", a - b);
            }
            let (q, bar) = map.uncertainty(input);
            prop_assert!(!(q < 0.0) && !(bar > 1.0 + 1e-9), "q {q}, bar {bar}");
        }
    }
}
