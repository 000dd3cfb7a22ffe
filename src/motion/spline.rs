//! Cubic splines through the frames of a clip: twice continuously differentiable in phase, so that
//! joint accelerations have no steps.

use nalgebra::DMatrix;

/// Where the frames lie and what happens at the ends.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Ends {
    /// Frame n follows the last one; u = 1 is u = 0.
    Periodic,
    /// First and last frame at u = 0 and u = 1, with zero slope there.
    AtRest,
}

/// A vector-valued cubic spline over u in [0, 1].
#[derive(Clone, Debug)]
pub struct Spline {
    ends: Ends,
    /// Frames x coordinates, row-major.
    values: Vec<f64>,
    /// Second derivatives with respect to u, same shape.
    curvatures: Vec<f64>,
    frames: usize,
    coordinates: usize,
}

impl Spline {
    /// Through `frames` (all of the same length, at least 4 of them).
    pub fn new(frames: &[Vec<f64>], ends: Ends) -> Self {
        let n = frames.len();
        let coordinates = frames.first().map_or(0, Vec::len);
        let intervals = match ends {
            Ends::Periodic => n,
            Ends::AtRest => n - 1,
        };
        let h = 1.0 / intervals as f64;
        let mut system = DMatrix::<f64>::zeros(n, n);
        let mut right = DMatrix::<f64>::zeros(n, coordinates);
        for i in 0..n {
            let (before, after) = match ends {
                Ends::Periodic => (Some((i + n - 1) % n), Some((i + 1) % n)),
                Ends::AtRest => (i.checked_sub(1), (i + 1 < n).then_some(i + 1)),
            };
            // One-sided at the ends: the mirrored neighbour makes the slope there zero.
            let neighbours = [before.or(after), after.or(before)];
            system[(i, i)] += 4.0;
            for j in neighbours.into_iter().flatten() {
                system[(i, j)] += 1.0;
                for c in 0..coordinates {
                    right[(i, c)] += 6.0 * (frames[j][c] - frames[i][c]) / (h * h);
                }
            }
        }
        // Diagonally dominant, so it always has a solution.
        let solved = system.lu().solve(&right).unwrap_or(right);
        let mut curvatures = Vec::with_capacity(n * coordinates);
        for i in 0..n {
            for c in 0..coordinates {
                curvatures.push(solved[(i, c)]);
            }
        }
        Self {
            ends,
            values: frames.iter().flatten().copied().collect(),
            curvatures,
            frames: n,
            coordinates,
        }
    }

    /// Coordinates of each value.
    pub fn coordinates(&self) -> usize {
        self.coordinates
    }

    /// Value of coordinate `c` at `u` (wrapped or clamped to [0, 1], as the ends say). No allocation.
    pub fn value(&self, u: f64, c: usize) -> f64 {
        let (a, b, w, h) = self.locate(u);
        let (ya, yb, ma, mb) = self.knots(a, b, c);
        let v = 1.0 - w;
        v * ya + w * yb + h * h / 6.0 * ((v * v * v - v) * ma + (w * w * w - w) * mb)
    }

    /// Values of the coordinates `range` at `u` into `out`, as long as the range. No allocation.
    pub fn values(&self, u: f64, range: std::ops::Range<usize>, out: &mut [f64]) {
        let (a, b, w, h) = self.locate(u);
        let v = 1.0 - w;
        let bend = h * h / 6.0;
        let (ca, cb) = (bend * (v * v * v - v), bend * (w * w * w - w));
        let (a, b) = (a * self.coordinates, b * self.coordinates);
        let of = |from: usize| from + range.start..from + range.end;
        let knots = (self.values[of(a)].iter().zip(&self.values[of(b)]))
            .zip(self.curvatures[of(a)].iter().zip(&self.curvatures[of(b)]));
        for (out, ((ya, yb), (ma, mb))) in out.iter_mut().zip(knots) {
            *out = v * ya + w * yb + ca * ma + cb * mb;
        }
    }

    /// First and second derivative of coordinate `c` with respect to u.
    pub fn derivatives(&self, u: f64, c: usize) -> (f64, f64) {
        let (a, b, w, h) = self.locate(u);
        let (ya, yb, ma, mb) = self.knots(a, b, c);
        let v = 1.0 - w;
        let first = (yb - ya) / h + h / 6.0 * ((1.0 - 3.0 * v * v) * ma + (3.0 * w * w - 1.0) * mb);
        (first, v * ma + w * mb)
    }

    /// Largest absolute first and second derivative of coordinate `c` over [0, 1].
    pub fn steepest(&self, c: usize) -> (f64, f64) {
        let samples = self.frames * 8;
        (0..=samples).fold((0.0, 0.0), |(first, second): (f64, f64), k| {
            let (d1, d2) = self.derivatives(k as f64 / samples as f64, c);
            (first.max(d1.abs()), second.max(d2.abs()))
        })
    }

    fn knots(&self, a: usize, b: usize, c: usize) -> (f64, f64, f64, f64) {
        let (a, b) = (a * self.coordinates + c, b * self.coordinates + c);
        (
            self.values[a],
            self.values[b],
            self.curvatures[a],
            self.curvatures[b],
        )
    }

    fn locate(&self, u: f64) -> (usize, usize, f64, f64) {
        match self.ends {
            Ends::Periodic => {
                // As rem_euclid, without its division; u just below a whole number may round to one.
                let x = (u - u.floor()) * self.frames as f64;
                let a = (x as usize).min(self.frames - 1);
                (
                    a,
                    (a + 1) % self.frames,
                    x - a as f64,
                    1.0 / self.frames as f64,
                )
            }
            Ends::AtRest => {
                let intervals = self.frames - 1;
                let x = u.clamp(0.0, 1.0) * intervals as f64;
                let a = (x as usize).min(intervals - 1);
                (a, a + 1, x - a as f64, 1.0 / intervals as f64)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_sine_through_32_frames_is_followed_with_its_derivatives() {
        let frames: Vec<Vec<f64>> = (0..32)
            .map(|k| vec![(TAU * f64::from(k) / 32.0).sin()])
            .collect();
        let spline = Spline::new(&frames, Ends::Periodic);
        for k in 0..100 {
            let u = f64::from(k) * 0.0137;
            let error = spline.value(u, 0) - (TAU * u).sin();
            assert!(error.abs() < 1e-5, "value off by {error} at {u}");
            let (d1, d2) = spline.derivatives(u, 0);
            assert!(
                (d1 - TAU * (TAU * u).cos()).abs() < 2e-3,
                "slope {d1} at {u}"
            );
            assert!(
                (d2 + TAU * TAU * (TAU * u).sin()).abs() < 0.2,
                "curvature {d2} at {u}"
            );
        }
    }

    #[test]
    fn a_path_meets_its_frames_and_rests_at_its_ends() {
        let frames = vec![vec![0.0], vec![0.2], vec![0.9], vec![1.0], vec![1.0]];
        let spline = Spline::new(&frames, Ends::AtRest);
        for (k, frame) in frames.iter().enumerate() {
            let value = spline.value(k as f64 / 4.0, 0);
            assert!((value - frame[0]).abs() < 1e-12, "frame {k}: {value}");
        }
        assert!(spline.derivatives(0.0, 0).0.abs() < 1e-9);
        assert!(spline.derivatives(1.0, 0).0.abs() < 1e-9);
        assert_eq!(spline.value(-3.0, 0), 0.0);
    }
}
