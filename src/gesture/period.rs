//! The period of a motion, from the autocorrelation of its mean-removed pose.

use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// A period and how sure it is.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct PeriodEstimate {
    /// The period in seconds.
    pub period_s: f64,
    /// Normalised autocorrelation there: 1 repeats exactly, 0 not at all.
    pub periodicity: f64,
}

/// Shortest and longest period that is looked for, in seconds: what the estimators can follow.
const PERIODS_S: (f64, f64) = (0.15, 5.5);
/// A lag longer than this share of the stretch has too little overlap to be judged.
const LONGEST_SHARE: f64 = 0.8;
/// Of a part of the whole two periods must be seen.
const TWICE: f64 = 0.5;
/// A part must repeat at least this well: short movements look alike by chance.
const SURE: f64 = 0.6;
/// Stretches that repeat this nearly as well as the best are as good.
const ABOUT: f64 = 0.03;
/// Shortest stretch that is looked at by itself, seconds.
const SHORTEST_STRETCH_S: f64 = 0.5;
/// A multiple of the period repeats as well as the period itself: the shortest lag that comes this
/// close to the highest peak is taken. A second harmonic's peak is lower than that.
const AS_GOOD: f64 = 0.9;

/// The most prominent period of a motion; `None` where the autocorrelation has no peak.
///
/// `poses` holds one row per sample of uniform step `step_s`. The highest peak counts, not the
/// first: real hands have strong second harmonics. Autocorrelation by FFT, normalised by the energy
/// of the overlapping parts, so that its height does not fall with the lag.
///
/// Performers stop: what comes after the last period (an arm that goes down) outweighs it. So growing
/// stretches from the first row on are looked at, and the longest that repeats about as well as the best
/// one decides.
pub fn find_period(poses: &[Vec<f64>], step_s: f64) -> Option<PeriodEstimate> {
    let whole = period_of(poses, step_s, LONGEST_SHARE);
    let mut stretches = Vec::new();
    let mut length = (SHORTEST_STRETCH_S / step_s) as usize;
    while length < poses.len() {
        stretches.push(length);
        length += (length / 4).max(1);
    }
    let parts: Vec<PeriodEstimate> = (stretches.into_iter())
        .filter_map(|length| period_of(&poses[..length], step_s, TWICE))
        .filter(|part| part.periodicity >= SURE)
        .collect();
    let best = (parts.iter().chain(&whole))
        .map(|found| found.periodicity)
        .fold(f64::NEG_INFINITY, f64::max);
    (parts.into_iter().chain(whole)).rfind(|found| found.periodicity >= best - ABOUT)
}

/// The most prominent period of one stretch, at lags of up to `share` of it.
fn period_of(poses: &[Vec<f64>], step_s: f64, share: f64) -> Option<PeriodEstimate> {
    let n = poses.len();
    let dim = poses.first().map_or(0, Vec::len);
    if n < 8 || dim == 0 || step_s <= 0.0 || !step_s.is_finite() {
        return None;
    }
    let size = (2 * n).next_power_of_two();
    let mut planner = FftPlanner::<f64>::new();
    let forward = planner.plan_fft_forward(size);
    let inverse = planner.plan_fft_inverse(size);
    let mut power = vec![Complex::new(0.0, 0.0); size];
    let mut square = vec![0.0; n];
    for axis in 0..dim {
        let mean = poses.iter().map(|row| row[axis]).sum::<f64>() / n as f64;
        let mut column = vec![Complex::new(0.0, 0.0); size];
        for (k, row) in poses.iter().enumerate() {
            let value = row[axis] - mean;
            column[k].re = value;
            square[k] += value * value;
        }
        forward.process(&mut column);
        for (sum, value) in power.iter_mut().zip(&column) {
            sum.re += value.norm_sqr();
        }
    }
    inverse.process(&mut power);
    let energy: f64 = square.iter().sum();
    if energy <= 1e-18 {
        return None;
    }
    // 2 sum x_k x_(k+l) / sum (x_k^2 + x_(k+l)^2), the sums over the overlap.
    let mut overlap = 2.0 * energy;
    let mut normalised = Vec::with_capacity(n);
    for lag in 0..n {
        let product = power[lag].re / size as f64;
        normalised.push(if overlap > 1e-9 * energy {
            2.0 * product / overlap
        } else {
            0.0
        });
        overlap -= square[lag] + square[n - 1 - lag];
    }
    let shortest = ((PERIODS_S.0 / step_s) as usize).max(2);
    let longest = ((PERIODS_S.1 / step_s) as usize)
        .min((share * n as f64) as usize)
        .min(n - 2);
    let peaks: Vec<usize> = (shortest..=longest)
        .filter(|lag| {
            normalised[*lag] >= normalised[lag - 1] && normalised[*lag] > normalised[lag + 1]
        })
        .collect();
    let highest = peaks
        .iter()
        .map(|lag| normalised[*lag])
        .fold(f64::NEG_INFINITY, f64::max);
    let lag = *peaks
        .iter()
        .find(|lag| normalised[**lag] >= AS_GOOD * highest)?;
    let (a, b, c) = (normalised[lag - 1], normalised[lag], normalised[lag + 1]);
    let bend = a - 2.0 * b + c;
    let offset = if bend < 0.0 {
        (0.5 * (a - c) / bend).clamp(-0.5, 0.5)
    } else {
        0.0
    };
    Some(PeriodEstimate {
        period_s: (lag as f64 + offset) * step_s,
        periodicity: b,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_strong_second_harmonic_does_not_halve_the_period() {
        let step = 1.0 / 110.0;
        let poses: Vec<Vec<f64>> = (0..330)
            .map(|k| {
                let u = std::f64::consts::TAU * k as f64 * step / 1.08;
                vec![u.cos(), 1.5 * (2.0 * u).cos(), u.sin() + (2.0 * u).sin()]
            })
            .collect();
        let found = find_period(&poses, step).expect("periodic");
        assert!((found.period_s - 1.08).abs() < 0.01, "{found:?}");
        assert!(found.periodicity > 0.98, "{found:?}");
    }

    #[test]
    fn a_hand_that_goes_down_after_waving_does_not_hide_the_wave() {
        let step = 1.0 / 30.0;
        let poses: Vec<Vec<f64>> = (0..180)
            .map(|k| {
                let t = f64::from(k) * step;
                let down = ((t - 3.5) / 1.0).clamp(0.0, 1.0);
                let wave = if t < 3.5 { 0.1 } else { 0.0 };
                vec![wave * (std::f64::consts::TAU * 1.25 * t).sin(), 1.5 - down]
            })
            .collect();
        let found = find_period(&poses, step).expect("periodic at first");
        assert!((found.period_s - 0.8).abs() < 0.02, "{found:?}");
    }

    #[test]
    fn stillness_and_short_scraps_have_no_period() {
        assert_eq!(find_period(&vec![vec![1.0, 2.0]; 100], 0.01), None);
        assert_eq!(find_period(&[], 0.01), None);
        assert_eq!(find_period(&vec![vec![0.0]; 5], 0.01), None);
        assert_eq!(find_period(&vec![vec![0.0]; 50], f64::NAN), None);
    }
}
