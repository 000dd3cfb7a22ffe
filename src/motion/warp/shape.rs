//! A warp as a function: monotone, piecewise linear, with bounded slope.

/// A monotone map from normalised time s of a reference clip to normalised time t of another one,
/// both 0..1.
#[derive(Clone, Debug, PartialEq)]
pub struct Warp {
    /// t at even steps of s from 0 to 1.
    knots: Vec<f64>,
    /// Mean squared feature distance of the paired frames over that of frames paired at random:
    /// 0 for the same motion, near 1 when pairing does not help. 0 where nothing moves and nothing differs.
    pub cost: f64,
}

impl Warp {
    /// The warp that changes nothing.
    pub fn identity() -> Self {
        Self {
            knots: vec![0.0, 1.0],
            cost: 0.0,
        }
    }

    /// Through the `wanted` knots as nearly (largest deviation) as slopes within `slope` allow,
    /// and exactly through the `pins` (index of the knot, t), which allow it.
    pub(super) fn bounded(wanted: &[f64], pins: &[(usize, f64)], slope: (f64, f64)) -> Self {
        let n = wanted.len();
        let ds = 1.0 / (n - 1) as f64;
        let (least, most) = (slope.0 * ds, slope.1 * ds);
        // The largest admissible function below a set of points and the smallest above it.
        let below = |mut f: Vec<f64>| {
            for i in 1..n {
                f[i] = f[i].min(f[i - 1] + most);
            }
            for i in (1..n).rev() {
                f[i - 1] = f[i - 1].min(f[i] - least);
            }
            f
        };
        let above = |mut f: Vec<f64>| {
            for i in 1..n {
                f[i] = f[i].max(f[i - 1] + least);
            }
            for i in (1..n).rev() {
                f[i - 1] = f[i - 1].max(f[i] - most);
            }
            f
        };
        let pinned = |elsewhere: f64| {
            let mut f = vec![elsewhere; n];
            for (i, t) in pins {
                f[*i] = *t;
            }
            f
        };
        let (low, high) = (below(wanted.to_vec()), above(wanted.to_vec()));
        let (ceiling, floor) = (
            below(pinned(f64::INFINITY)),
            above(pinned(f64::NEG_INFINITY)),
        );
        let mut knots: Vec<f64> = (0..n)
            .map(|i| (0.5 * (low[i] + high[i])).max(floor[i]).min(ceiling[i]))
            .collect();
        for (i, t) in pins {
            knots[*i] = *t;
        }
        Self { knots, cost: 0.0 }
    }

    /// t at `s` (clamped to 0..1; not-a-number is taken for 0). No allocation.
    pub fn at(&self, s: f64) -> f64 {
        let intervals = self.knots.len() - 1;
        // Written so that not-a-number fails it.
        let s = if s > 0.0 { s.min(1.0) } else { 0.0 };
        let x = s * intervals as f64;
        let i = (x as usize).min(intervals - 1);
        let w = x - i as f64;
        self.knots[i] + w * (self.knots[i + 1] - self.knots[i])
    }

    /// s at which [`Self::at`] is `t` (clamped to what is reached). No allocation.
    pub fn inverse(&self, t: f64) -> f64 {
        let intervals = self.knots.len() - 1;
        let i = self.knots[1..intervals].partition_point(|k| *k <= t);
        let (from, to) = (self.knots[i], self.knots[i + 1]);
        let w = ((t - from) / (to - from)).clamp(0.0, 1.0);
        (i as f64 + w) / intervals as f64
    }

    /// Least and largest slope.
    pub fn slopes(&self) -> (f64, f64) {
        let per_s = (self.knots.len() - 1) as f64;
        self.knots
            .windows(2)
            .map(|w| (w[1] - w[0]) * per_s)
            .fold((f64::INFINITY, 0.0), |(l, h), s| (l.min(s), h.max(s)))
    }

    /// The knots: t at even steps of s.
    pub fn knots(&self) -> &[f64] {
        &self.knots
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn slopes_stay_in_bounds_pins_hold_and_the_inverse_inverts(
            wanted in prop::collection::vec(0.0..1.0f64, 3..40),
            s in 0.0..1.0f64,
        ) {
            let last = wanted.len() - 1;
            let pins = [(0, 0.0), (last, 1.0)];
            let warp = Warp::bounded(&wanted, &pins, (1.0 / 3.0, 3.0));
            let (low, high) = warp.slopes();
            prop_assert!(low > 1.0 / 3.0 - 1e-9 && high < 3.0 + 1e-9, "{} {}", low, high);
            prop_assert_eq!((warp.at(0.0), warp.at(1.0)), (0.0, 1.0));
            prop_assert!((warp.inverse(warp.at(s)) - s).abs() < 1e-9);
        }
    }

    #[test]
    fn what_is_outside_is_clamped() {
        let warp = Warp::identity();
        assert_eq!(
            [-1.0, 0.25, 7.0, f64::NAN].map(|s| warp.at(s)),
            [0.0, 0.25, 1.0, 0.0]
        );
        assert_eq!([-1.0, 0.25, 7.0].map(|t| warp.inverse(t)), [0.0, 0.25, 1.0]);
    }
}
