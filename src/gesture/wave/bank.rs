//! A bank of recursive wave fits: every frequency's least-squares fit, updated sample by sample.
//!
//! Each line keeps, over a fading window, the sums a fit of `{exp(i w t), exp(-i w t), 1}` needs. The
//! window is the Erlang survival function of order 3, `exp(-u) (1 + u + u^2 / 2)` with `u = alpha lag`:
//! close to half a Gaussian, and the sum over it obeys a recursion, so a sample costs the same whatever
//! the rate and the length of the window. A line forgets exponentially; rounding never piles up.

use super::history::LONGEST_STEP_S;
use super::shape::{C, Shape};
use std::f64::consts::TAU;

/// Order of the window.
const ORDER: usize = 3;

/// Sums of one order: with weights `(alpha lag)^j / j! exp(-alpha lag)`.
#[derive(Copy, Clone, Debug, Default)]
struct Sums {
    /// Weights.
    w: f64,
    /// Weights times exp(i w t), t from now (negative).
    s1: C,
    /// Weights times exp(2 i w t).
    s2: C,
    /// Weights times z exp(-i w t).
    zp: C,
    /// Weights times z exp(i w t).
    zm: C,
    /// Weights times z.
    z0: C,
    /// Weights times |z|^2.
    e: f64,
}

impl Sums {
    fn add(&mut self, other: &Sums, share: f64) {
        self.w += share * other.w;
        self.s1 += other.s1 * share;
        self.s2 += other.s2 * share;
        self.zp += other.zp * share;
        self.zm += other.zm * share;
        self.z0 += other.z0 * share;
        self.e += share * other.e;
    }

    /// Lets `angle` of phase pass and everything fade by `fade`.
    fn pass(&mut self, turn: C, fade: f64) {
        let back = turn.conj();
        self.w *= fade;
        self.s1 *= back * fade;
        self.s2 *= back * back * fade;
        self.zp *= turn * fade;
        self.zm *= back * fade;
        self.z0 *= fade;
        self.e *= fade;
    }

    /// The newest sample, of lag zero.
    fn put(&mut self, z: C, weight: f64) {
        self.w += weight;
        self.s1 += weight;
        self.s2 += weight;
        self.zp += z * weight;
        self.zm += z * weight;
        self.z0 += z * weight;
        self.e += weight * z.norm_sqr();
    }
}

/// One frequency of the bank.
#[derive(Copy, Clone, Debug)]
struct Line {
    frequency_hz: f64,
    /// Decay of the window, 1/s.
    alpha: f64,
    sums: [Sums; ORDER],
}

/// What a line found.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub(super) struct Candidate {
    /// Signed: negative when performed in the opposite sense.
    pub frequency_hz: f64,
    /// Amplitude, in units of the shape.
    pub amplitude: f64,
    /// Share of the motion (about its mean) that the wave explains, 0..1.
    pub explained: f64,
    /// Power the wave explains, mean square modulus.
    pub power: f64,
    /// Time the window has seen, in periods of this line, weighted: full at about 0.8 lambda.
    pub periods: f64,
}

/// Ridge of the fit, as a share of the window's weight: a window that has not seen enough to tell a
/// wave from a constant finds a small wave rather than a large one.
const RIDGE: f64 = 0.03;

/// Recursive fits of one shape at log-spaced frequencies.
#[derive(Clone, Debug)]
pub(super) struct Bank {
    lines: Vec<Line>,
    shape: Shape,
    last: Option<(f64, C)>,
}

impl Bank {
    /// `count` lines from `low_hz` to `high_hz`, each with a window like a Gaussian of deviation
    /// `lambda` periods.
    pub fn new(count: usize, low_hz: f64, high_hz: f64, lambda: f64, shape: Shape) -> Self {
        let ratio = (high_hz / low_hz).ln() / (count.max(2) - 1) as f64;
        Self {
            lines: (0..count)
                .map(|k| {
                    let frequency_hz = low_hz * (ratio * k as f64).exp();
                    Line {
                        frequency_hz,
                        // Mean lags agree: 2 / alpha against sqrt(2 / pi) lambda / f.
                        alpha: 2.507 * frequency_hz / lambda,
                        sums: [Sums::default(); ORDER],
                    }
                })
                .collect(),
            shape,
            last: None,
        }
    }

    /// Takes the next sample. Times rise; a step of over 0.1 s counts as 0.1 s of weight.
    pub fn push(&mut self, t: f64, z: C) {
        let step = self.last.map_or(0.0, |(then, _)| t - then);
        // Trapezoidal rule: half the step weighs with the last sample, half with this one.
        let half = 0.5 * step.min(LONGEST_STEP_S);
        let before = self.last.map(|(_, z)| z);
        for line in &mut self.lines {
            if let Some(before) = before {
                line.sums[0].put(before, half);
            }
            let d = line.alpha * step;
            let fade = (-d).exp();
            let turn = C::from_polar(1.0, TAU * line.frequency_hz * step);
            let [first, second, third] = &mut line.sums;
            third.add(second, d);
            third.add(first, 0.5 * d * d);
            second.add(first, d);
            for sums in [first, second, third] {
                sums.pass(turn, fade);
            }
            line.sums[0].put(z, half);
        }
        self.last = Some((t, z));
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        for line in &mut self.lines {
            line.sums = [Sums::default(); ORDER];
        }
        self.last = None;
    }

    /// The candidate that explains most power, of those for which `admit` holds.
    pub fn best(&self, admit: impl Fn(&Candidate) -> bool) -> Option<Candidate> {
        let mut best: Option<Candidate> = None;
        for line in &self.lines {
            let [forward, backward] = self.fit(line);
            for candidate in [forward, backward] {
                let better = best.is_none_or(|best| candidate.power > best.power);
                if better && admit(&candidate) {
                    best = Some(candidate);
                }
            }
        }
        best
    }

    /// The fit of one line in both senses; on a line (no sense) only the forward one counts.
    fn fit(&self, line: &Line) -> [Candidate; 2] {
        let mut s = line.sums[0];
        s.add(&line.sums[1], 1.0);
        s.add(&line.sums[2], 1.0);
        let mut found = [Candidate::default(); 2];
        if s.w <= 0.0 {
            return found;
        }
        // Everything about the weighted mean: the constant is eliminated.
        let mean = s.z0 / s.w;
        let g = s.w - s.s1.norm_sqr() / s.w;
        let h = s.s2 - s.s1 * s.s1 / s.w;
        let zp = s.zp - s.s1.conj() * mean;
        let zm = s.zm - s.s1 * mean;
        let energy = (s.e - s.z0.norm_sqr() / s.w).max(0.0);
        let (p0, q0) = (self.shape.forward, self.shape.backward);
        let power = self.shape.power();
        let ridge = RIDGE * s.w * power;
        for (sense, found) in [1.0, -1.0].into_iter().zip(&mut found) {
            let (zp, zm, h) = if sense > 0.0 {
                (zp, zm, h.conj())
            } else {
                (zm, zp, h)
            };
            // Normal equations of z = p0 a e+ + q0 a* e- for a = (x, y).
            let cross = p0.conj() * q0 * h;
            let m00 = power * g + 2.0 * cross.re + ridge;
            let m11 = power * g - 2.0 * cross.re + ridge;
            let m01 = 2.0 * cross.im;
            let (u, v) = (p0.conj() * zp, q0.conj() * zm);
            let (r0, r1) = (u.re + v.re, u.im - v.im);
            let det = m00 * m11 - m01 * m01;
            if det <= 1e-12 * s.w * s.w {
                continue;
            }
            let x = (m11 * r0 - m01 * r1) / det;
            let y = (m00 * r1 - m01 * r0) / det;
            // What the fit takes off the energy, ridge included: 2 r a - a M a.
            let gain = (r0 * x + r1 * y - ridge * (x * x + y * y)).max(0.0);
            *found = Candidate {
                frequency_hz: sense * line.frequency_hz,
                amplitude: x.hypot(y),
                explained: if energy > 0.0 {
                    (gain / energy).min(1.0)
                } else {
                    0.0
                },
                power: gain / s.w,
                periods: s.w * line.frequency_hz,
            };
        }
        // The other sense must be clearly better: a figure near a line hardly has one.
        if found[1].power < SENSE_BIAS * found[0].power {
            found[1] = Candidate::default();
        }
        found
    }
}

/// Power by which the opposite sense must be better to be believed.
pub(super) const SENSE_BIAS: f64 = 2.0;

#[cfg(test)]
mod tests {
    use super::*;

    /// The recursion against sums over the window written out.
    #[test]
    fn recursive_sums_equal_the_window_written_out_on_irregular_samples() {
        let shape = Shape::LOOP;
        let mut bank = Bank::new(3, 0.5, 2.0, 2.0 / 3.0, shape);
        let mut samples: Vec<(f64, C)> = Vec::new();
        let mut t = 3.0;
        for k in 0..200_u32 {
            let u = f64::from(k);
            t += 0.008 + 0.02 * (0.5 + 0.5 * (12.9 * u).sin());
            let z = C::new((7.0 * t).cos() + 0.3, (5.0 * t).sin());
            bank.push(t, z);
            samples.push((t, z));
        }
        for line in &bank.lines {
            let mut expected = (0.0, C::default());
            for (k, (then, z)) in samples.iter().enumerate() {
                let before = if k > 0 { then - samples[k - 1].0 } else { 0.0 };
                let after = samples.get(k + 1).map_or(0.0, |next| next.0 - then);
                let u = line.alpha * (t - then);
                let w = 0.5 * (before + after) * (-u).exp() * (1.0 + u + 0.5 * u * u);
                expected.0 += w;
                expected.1 += z * C::from_polar(w, TAU * line.frequency_hz * (t - then));
            }
            let w: f64 = line.sums.iter().map(|s| s.w).sum();
            let zp: C = line.sums.iter().map(|s| s.zp).sum();
            assert!((w - expected.0).abs() < 1e-12, "{w} {}", expected.0);
            assert!((zp - expected.1).norm() < 1e-12, "{zp} {}", expected.1);
        }
    }
}
