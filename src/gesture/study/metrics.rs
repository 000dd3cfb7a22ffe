//! What is measured on a trace: settling, steady errors, delay, activations.

use crate::base::angle::wrap_pi;

/// Settled is within this share of the new value.
const SETTLED_SHARE: f64 = 0.1;
/// A gesture starts above the first and is given up below the second (Rhodin 2016, section 9.5.1).
pub const START_AMPLITUDE: f64 = 0.2;
/// See [`START_AMPLITUDE`].
pub const ABORT_AMPLITUDE: f64 = 0.1;

/// Time from `step_s` to the last sample that is more than 10 % away from `target`.
///
/// Zero when none is, infinite when the last sample still is. `t` and `values` run in parallel.
pub fn settling_s(t: &[f64], values: &[f64], step_s: f64, target: f64) -> f64 {
    let outside = |value: f64| !((value - target).abs() <= SETTLED_SHARE * target.abs());
    let last = t
        .iter()
        .zip(values)
        .rposition(|(t, value)| *t >= step_s && outside(*value));
    match last {
        None => 0.0,
        Some(index) if index + 1 == t.len() => f64::INFINITY,
        Some(index) => t[index] - step_s,
    }
}

/// Time from `step_s` until the values reach `level` for the first time, from below when `rising`,
/// else from above; infinite when they never do.
pub fn reaching_s(t: &[f64], values: &[f64], step_s: f64, level: f64, rising: bool) -> f64 {
    t.iter()
        .zip(values)
        .find(|(t, value)| {
            **t >= step_s
                && if rising {
                    **value >= level
                } else {
                    **value <= level
                }
        })
        .map_or(f64::INFINITY, |(t, _)| t - step_s)
}

/// Root mean square of the errors; NaN for none.
pub fn rms(errors: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0_f64, 0.0);
    for error in errors {
        sum += error * error;
        count += 1.0;
    }
    f64::sqrt(sum / count)
}

/// Root mean square difference of two phases in degrees.
pub fn rms_phase_deg(estimates: &[f64], truths: &[f64]) -> f64 {
    rms(estimates
        .iter()
        .zip(truths)
        .map(|(e, t)| wrap_pi(e - t).to_degrees()))
}

/// The delay by which `estimates` follow `truths` best, and the root mean square error that is left.
///
/// Both run in parallel at a uniform step of `step_s`; lags from 0 to `longest_s` are tried, all
/// judged on the same samples.
pub fn best_lag(estimates: &[f64], truths: &[f64], step_s: f64, longest_s: f64) -> (f64, f64) {
    let most = ((longest_s / step_s).round() as usize).min(truths.len().saturating_sub(1));
    (0..=most)
        .map(|lag| {
            let pairs = estimates[most..].iter().zip(&truths[most - lag..]);
            (lag as f64 * step_s, rms(pairs.map(|(e, t)| e - t)))
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((0.0, f64::NAN))
}

/// Share of the values above `threshold`.
pub fn share_above(values: &[f64], threshold: f64) -> f64 {
    let above = values.iter().filter(|value| **value > threshold).count();
    above as f64 / values.len() as f64
}

/// How often a gesture starts: the amplitude rises above 0.2, having been below 0.1 since it last did.
pub fn activations(amplitudes: &[f64]) -> usize {
    let (mut count, mut active) = (0, false);
    for amplitude in amplitudes {
        if !active && *amplitude > START_AMPLITUDE {
            count += 1;
            active = true;
        } else if *amplitude < ABORT_AMPLITUDE {
            active = false;
        }
    }
    count
}

/// The middle value; the mean of the middle two for an even count, NaN for none.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    match n {
        0 => f64::NAN,
        _ if n % 2 == 1 => sorted[n / 2],
        _ => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(n: usize, step: f64) -> Vec<f64> {
        (0..n).map(|k| k as f64 * step).collect()
    }

    #[test]
    fn nothing_to_measure_gives_no_panic_and_no_number() {
        assert_eq!(settling_s(&[], &[], 0.0, 1.0), 0.0);
        assert!(settling_s(&[0.0], &[f64::NAN], 0.0, 1.0).is_infinite());
        assert!(reaching_s(&[], &[], 0.0, 1.0, true).is_infinite());
        assert!(rms(std::iter::empty()).is_nan());
        assert!(median(&[]).is_nan());
        assert!(best_lag(&[], &[], 0.1, 1.0).1.is_nan());
        assert_eq!(activations(&[]), 0);
    }

    #[test]
    fn an_exponential_settles_after_its_time_constant_times_the_logarithm() {
        // From 1 to 2 with time constant 0.3 s: within 10 % of 2 once exp(-t / 0.3) = 0.2.
        let t = times(6000, 0.001);
        let values: Vec<f64> = t
            .iter()
            .map(|t| {
                if *t < 1.0 {
                    1.0
                } else {
                    2.0 - (-(t - 1.0) / 0.3_f64).exp()
                }
            })
            .collect();
        let expected = 0.3 * 5.0_f64.ln();
        let found = settling_s(&t, &values, 1.0, 2.0);
        assert!((found - expected).abs() < 0.002, "{found} not {expected}");
        let found = reaching_s(&t, &values, 1.0, 1.5, true);
        let expected = 0.3 * 2.0_f64.ln();
        assert!((found - expected).abs() < 0.002, "{found} not {expected}");
    }

    #[test]
    fn a_value_that_leaves_again_has_not_settled_and_one_that_stays_out_never_does() {
        let t = times(100, 0.1);
        let mut values = vec![1.0; 100];
        values[70] = 1.2;
        assert!((settling_s(&t, &values, 1.0, 1.0) - 6.0).abs() < 1e-9);
        values[99] = 0.5;
        assert!(settling_s(&t, &values, 1.0, 1.0).is_infinite());
        assert_eq!(settling_s(&t, &[1.05; 100], 1.0, 1.0), 0.0);
    }

    #[test]
    fn a_delayed_copy_is_found_with_its_delay() {
        let truth: Vec<f64> = (0..600)
            .map(|k| (f64::from(k) * 0.01).sin() + 0.01 * f64::from(k))
            .collect();
        let mut late = vec![truth[0]; 25];
        late.extend(&truth[..575]);
        let (lag, error) = best_lag(&late, &truth, 1.0 / 60.0, 1.0);
        assert!((lag - 25.0 / 60.0).abs() < 1e-9, "lag {lag}");
        assert!(error < 1e-12, "error {error}");
    }

    #[test]
    fn shares_medians_and_activations_of_small_lists() {
        assert_eq!(share_above(&[0.1, 0.3, 0.2, 0.5], 0.2), 0.5);
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[1.0, f64::INFINITY, 2.0, 3.0]), 2.5);
        // Up, wobble around the threshold without falling below 0.1, down, up again.
        assert_eq!(
            activations(&[0.0, 0.3, 0.15, 0.25, 0.05, 0.15, 0.21, 0.0]),
            2
        );
        let phases = rms_phase_deg(&[0.1, 6.2], &[0.0, 0.0]);
        assert!((phases - 5.27).abs() < 0.05, "{phases}");
    }
}
