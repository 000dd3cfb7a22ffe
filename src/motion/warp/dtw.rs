//! Dynamic time warp between two clips (Casas 2013, 3.2.1): exact, with key pairs and bounded slope.

use super::path::{CostTable, cheapest_path};
use super::{Frames, Warp, WarpError, check_pair, distance_sq};

/// How a warp is sought.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct DtwOptions {
    /// The path may end at any frame of the clip that ends last, not only where both end.
    pub open_end: bool,
    /// Least and largest slope of the warp, of normalised times.
    pub slope: (f64, f64),
    /// Move each pair of the path to where the poses agree best, by at most 1.5 frames: a path steps
    /// by whole frames and keeps to the diagonal while that costs little.
    pub refine: bool,
}

impl Default for DtwOptions {
    fn default() -> Self {
        Self {
            open_end: false,
            slope: (1.0 / 3.0, 3.0),
            refine: true,
        }
    }
}

/// The warp from times of `a` to times of `b`: `a(s)` corresponds to `b(warp.at(s))`.
///
/// Cost of a pair is `1 - similarity` = squared feature distance over the largest one in the table.
/// `keys` are pairs of frames that must coincide. Both clips are taken as going from start to end; for
/// cycles see [`super::align`]. With `open_end` the end of the path decides the slope of the whole, and
/// what lies beyond is reached at that slope, up to the end.
pub fn dtw(
    a: &Frames,
    b: &Frames,
    keys: &[(usize, usize)],
    options: DtwOptions,
) -> Result<Warp, WarpError> {
    check_pair(a, b)?;
    let (last_a, last_b) = (a.len() - 1, b.len() - 1);
    let distances = CostTable::from_fn(a.len(), b.len(), |i, j| distance_sq(&a[i], &b[j]));
    let mut most = 0.0;
    let mut sum = 0.0;
    for i in 0..a.len() {
        for j in 0..b.len() {
            most = f64::max(most, distances.at(i, j));
            sum += distances.at(i, j);
        }
    }
    let random = sum / (a.len() * b.len()) as f64;
    let scale = if most > 0.0 { 1.0 / most } else { 0.0 };
    let costs = CostTable::from_fn(a.len(), b.len(), |i, j| distances.at(i, j) * scale);
    let path = cheapest_path(&costs, keys, options.open_end)?;

    // Frames of `b` that each frame of `a` meets, as their mean; normalised times.
    let mut met = vec![(0.0, 0u32); a.len()];
    for (i, j) in &path.pairs {
        met[*i].0 += *j as f64 / last_b as f64;
        met[*i].1 += 1;
    }
    let end = path.pairs[path.pairs.len() - 1];
    let mut wanted: Vec<f64> = met
        .iter()
        .take(end.0 + 1)
        .map(|(sum, count)| sum / f64::from((*count).max(1)))
        .collect();
    if options.refine {
        refine(a, b, &mut wanted);
    }
    let mut pins = vec![(0, 0.0)];
    pins.extend(
        keys.iter()
            .filter(|k| **k != (0, 0))
            .map(|(i, j)| (*i, *j as f64 / last_b as f64)),
    );
    if options.open_end {
        // `b` ended first: hold; `a` ended first: that is where the warp ends.
        wanted.resize(a.len(), end.1 as f64 / last_b as f64);
    } else if pins[pins.len() - 1].0 != last_a {
        pins.push((last_a, 1.0));
    }
    let (low, high) = options.slope;
    for w in pins.windows(2) {
        let slope = (w[1].1 - w[0].1) / ((w[1].0 - w[0].0) as f64 / last_a as f64);
        if !(slope >= low - 1e-9 && slope <= high + 1e-9) {
            let frame = |t: f64| (t * last_b as f64).round() as usize;
            return Err(WarpError::KeySlope {
                a: w[1].0,
                b: frame(w[1].1),
                before_a: w[0].0,
                before_b: frame(w[0].1),
                slope,
                low,
                high,
            });
        }
    }
    let mut warp = Warp::bounded(&wanted, &pins, options.slope);
    warp.cost = if random > 0.0 {
        paired(a, b, &warp) / random
    } else {
        0.0
    };
    Ok(warp)
}

/// Two Gauss-Newton steps of every knot towards the nearest pose of `b`.
fn refine(a: &Frames, b: &Frames, wanted: &mut [f64]) {
    let last = (b.len() - 1) as f64;
    // Where `b` hardly moves, a step has no direction: there the path's own pairing stays.
    let moved: f64 = b.windows(2).map(|w| distance_sq(&w[0], &w[1])).sum();
    let floor = 0.05 * moved / last;
    let (mut here, mut before, mut after) = (Vec::new(), Vec::new(), Vec::new());
    for (frame, knot) in a.iter().zip(wanted) {
        let from = *knot;
        for _ in 0..2 {
            super::sampled(b, false, *knot, &mut here);
            super::sampled(b, false, *knot - 0.5 / last, &mut before);
            super::sampled(b, false, *knot + 0.5 / last, &mut after);
            let (mut along, mut slope) = (0.0, 0.0);
            for c in 0..here.len() {
                let d = after[c] - before[c];
                along += d * (frame[c] - here[c]);
                slope += d * d;
            }
            let step = along / (slope + floor).max(f64::MIN_POSITIVE);
            *knot = (*knot + step / last)
                .clamp(from - 1.5 / last, from + 1.5 / last)
                .clamp(0.0, 1.0);
        }
    }
}

/// Mean squared distance of `a(s)` and `b(warp(s))`.
fn paired(a: &Frames, b: &Frames, warp: &Warp) -> f64 {
    let mut frame = Vec::new();
    let mut sum = 0.0;
    for (i, here) in a.iter().enumerate() {
        let t = warp.at(i as f64 / (a.len() - 1) as f64);
        super::sampled(b, false, t, &mut frame);
        sum += distance_sq(here, &frame);
    }
    sum / a.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A reach with a wave in it: three features that never repeat a pose.
    fn pose(t: f64) -> Vec<f64> {
        vec![t, (7.0 * t).sin() * 0.4, (4.0 * t).cos() * 0.3]
    }

    fn clip(frames: usize, time: impl Fn(f64) -> f64) -> Vec<Vec<f64>> {
        (0..frames)
            .map(|k| pose(time(k as f64 / (frames - 1) as f64)))
            .collect()
    }

    #[test]
    fn a_known_warp_is_recovered_within_one_frame() {
        // b is played fast, then slow: b(t) = a(t^2 mixed with t), so that a(s) is b(inverse of it).
        for (bend, frames) in [(0.3, 81), (0.5, 60), (-0.4, 100)] {
            let time = |t: f64| t + bend * t * (1.0 - t);
            let (a, b) = (clip(81, |t| t), clip(frames, time));
            let warp = dtw(&a, &b, &[], DtwOptions::default()).expect("two clips");
            let frame = 1.0 / (frames.min(81) - 1) as f64;
            let mut worst: f64 = 0.0;
            for k in 0..=200 {
                let t = f64::from(k) / 200.0;
                let error = (warp.at(time(t)) - t).abs() / frame;
                worst = worst.max(error);
            }
            println!("bend {bend}: {worst:.2} frames off");
            assert!(worst < 1.0, "bend {bend}: {worst:.2} frames off");
            assert!(warp.cost < 1e-3, "cost {}", warp.cost);
        }
    }

    #[test]
    fn key_pairs_are_honoured_to_the_digit() {
        let (a, b) = (clip(41, |t| t), clip(61, |t| t));
        let keys = [(10, 22), (30, 40)];
        let warp = dtw(&a, &b, &keys, DtwOptions::default()).expect("lawful keys");
        for (i, j) in keys {
            let t = warp.at(i as f64 / 40.0);
            assert!(
                (t * 60.0 - j as f64).abs() < 1e-9,
                "frame {i} meets {}",
                t * 60.0
            );
        }
        let (low, high) = warp.slopes();
        assert!(low > 0.333 && high < 3.001, "slopes {low}..{high}");
        let steep = dtw(&a, &b, &[(5, 40)], DtwOptions::default()).expect_err("5 to 40 of 60");
        assert!(
            matches!(steep, WarpError::KeySlope { a: 5, b: 40, .. }),
            "{steep}"
        );
    }

    #[test]
    fn with_an_open_end_a_clip_that_goes_on_does_not_stretch_the_other() {
        let a = clip(41, |t| 0.7 * t);
        let b = clip(41, |t| t);
        let open = DtwOptions {
            open_end: true,
            ..DtwOptions::default()
        };
        let warp = dtw(&a, &b, &[], open).expect("two clips");
        let end = warp.at(1.0);
        assert!((end - 0.7).abs() < 0.03, "ends at {end}");
    }

    #[test]
    fn clips_that_cannot_be_compared_are_refused() {
        let good = clip(5, |t| t);
        let options = DtwOptions::default();
        let short = dtw(&good[..1], &good, &[], options).expect_err("one frame");
        assert!(
            matches!(short, WarpError::TooShort { found: 1, .. }),
            "{short}"
        );
        let mut bad = good.clone();
        bad[3][1] = f64::NAN;
        let nan = dtw(&good, &bad, &[], options)
            .expect_err("not a number")
            .to_string();
        assert!(nan.contains("clip b, frame 3, feature 1: NaN"), "{nan}");
        bad[3] = vec![0.0; 2];
        let narrow = dtw(&good, &bad, &[], options).expect_err("two features");
        assert!(
            matches!(
                narrow,
                WarpError::Features {
                    frame: 3,
                    found: 2,
                    ..
                }
            ),
            "{narrow}"
        );
        let still = dtw(
            &[vec![1.0], vec![1.0]],
            &[vec![1.0], vec![1.0]],
            &[],
            options,
        )
        .expect("nothing moves");
        assert_eq!(still.cost, 0.0);
    }
}
