//! The weighted least-squares fit of one wave to the recent past of a plane.
//!
//! Model: `z(t) = p exp(i w t) + q exp(-i w t) + c`, with (p, q) = a times the gesture's own shape plus b
//! times the orthogonal one ([`Shape::turns`]), both complex, c a constant, and w corrected in the same
//! step (Gauss-Newton). Weights: a one-sided Gaussian of lambda periods, and nothing before `since`. It is
//! a windowed, generalised Lomb-Scargle fit: irregular stamps are taken as they are.

use super::history::Block;
use super::shape::{C, Shape};
use nalgebra::{SMatrix, SVector};
use std::f64::consts::TAU;

/// Unknowns: a, b, c (two each) and the correction of the angular frequency.
const UNKNOWNS: usize = 7;
/// The Gaussian is cut at this many deviations.
const CUT: f64 = 3.0;

/// A wave with its constant, as of now.
#[derive(Copy, Clone, Debug, Default)]
pub(super) struct Wave {
    /// Signed angular frequency, rad/s.
    pub omega: f64,
    /// Amplitude and phase in units of the shape.
    pub a: C,
    /// The same for the orthogonal shape: how the figure departs from the one that was shown.
    pub b: C,
    /// The constant.
    pub c: C,
}

impl Wave {
    /// The same wave `dt` seconds later.
    pub fn ahead(&self, dt: f64) -> Self {
        let turn = C::from_polar(1.0, self.omega * dt);
        Self {
            a: self.a * turn,
            b: self.b * turn,
            ..*self
        }
    }

    /// Where it was `lag_s` ago.
    pub fn at(&self, shape: &Shape, lag_s: f64) -> C {
        let (p, q) = shape.turns(self.a, self.b);
        let turn = C::from_polar(1.0, -self.omega * lag_s);
        p * turn + q * turn.conj() + self.c
    }
}

/// Deviations of what is believed before the window was seen.
#[derive(Copy, Clone, Debug)]
pub(super) struct Prior {
    /// Of amplitude and phase about zero.
    pub a: f64,
    /// Of the orthogonal shape about zero.
    pub b: f64,
    /// Of the constant about that of the wave one starts from; `None`: nothing is known.
    pub c: Option<f64>,
    /// Of the angular frequency about that of the wave one starts from, as a share of it.
    pub omega: f64,
}

/// What is fitted, and to what.
#[derive(Copy, Clone, Debug)]
pub(super) struct Task<'a> {
    /// The past, newest first.
    pub blocks: &'a [Block],
    /// The figure.
    pub shape: &'a Shape,
    /// Deviation of the window in periods.
    pub lambda: f64,
    /// Shortest deviation of the window in seconds: some samples must lie in it.
    pub least_s: f64,
    /// The window ends here, seconds before now.
    pub since_s: f64,
    /// Variance of the noise per component.
    pub variance: f64,
    /// What is believed beforehand.
    pub prior: Prior,
}

/// A fit with its evidence.
#[derive(Copy, Clone, Debug, Default)]
pub(super) struct Fit {
    /// The wave.
    pub wave: Wave,
    /// Samples in the window, by weight.
    pub count: f64,
    /// Mean square of what is left, per sample, both components.
    pub residual: f64,
    /// Mean square about the mean.
    pub energy: f64,
    /// Standard deviation of the amplitude.
    pub deviation: f64,
    /// Components in which the figure moves: 1 for a line, 2 for a circle.
    pub components: f64,
    /// What data and beliefs together hold against this fit, in variances: smaller is likelier.
    pub cost: f64,
}

impl Fit {
    /// Share of the motion that the wave explains, 0..1.
    pub fn explained(&self) -> f64 {
        if self.energy > 0.0 {
            (1.0 - self.residual / self.energy).clamp(0.0, 1.0)
        } else {
            0.0
        }
    }

    /// How much likelier wave and constant are than a constant alone: the logarithm of the ratio, for
    /// Gaussian noise of unknown size.
    pub fn evidence(&self) -> f64 {
        let free = self.components * (self.count - 0.5 * UNKNOWNS as f64);
        -0.5 * free.max(0.0) * (1.0 - self.explained()).max(1e-12).ln()
    }
}

impl Task<'_> {
    /// One Gauss-Newton step from `start` (a wave as of now). With `tune` false the frequency stays.
    ///
    /// `None` where the window is empty or tells nothing.
    pub fn step(&self, start: &Wave, tune: bool) -> Option<Fit> {
        let omega = start.omega;
        let (p, q) = self.shape.turns(start.a, start.b);
        let (p0, q0) = (self.shape.forward, self.shape.backward);
        let i = C::new(0.0, 1.0);
        let deviation_s = (self.lambda * TAU / omega.abs().max(1e-6)).max(self.least_s);
        let reach = (CUT * deviation_s).min(self.since_s);
        let mut normal = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
        let mut right = SVector::<f64, UNKNOWNS>::zeros();
        let (mut count, mut squares, mut mean) = (0.0, 0.0, C::default());
        for block in self.blocks {
            if block.lag_s > reach + 1e-9 {
                break;
            }
            let u = block.lag_s / deviation_s;
            let w = block.count * (-0.5 * u * u).exp();
            let turn = C::from_polar(1.0, -omega * block.lag_s);
            let back = turn.conj();
            let (pt, qt) = (p0 * turn, q0 * back);
            let (pb, qb) = (q0 * turn, p0 * back);
            // Rows of the Jacobian, one complex number per unknown.
            let row = [
                pt + qt,
                i * (pt - qt),
                qb - pb,
                -i * (qb + pb),
                C::new(1.0, 0.0),
                i,
                if tune {
                    i * (p * turn - q * back) * -block.lag_s
                } else {
                    C::default()
                },
            ];
            let z = C::new(block.z[0], block.z[1]);
            count += w;
            squares += w * z.norm_sqr();
            mean += z * w;
            for m in 0..UNKNOWNS {
                right[m] += w * (row[m].re * z.re + row[m].im * z.im);
                for n in 0..=m {
                    normal[(m, n)] += w * (row[m].re * row[n].re + row[m].im * row[n].im);
                }
            }
        }
        if count <= 0.0 {
            return None;
        }
        let (data, data_right) = (normal, right);
        // Beliefs, in units of one sample's variance.
        let variance = self.variance.max(1e-12);
        let believe = |deviation: f64| variance / (deviation * deviation).max(1e-12);
        let size = believe(self.prior.a);
        normal[(0, 0)] += size;
        normal[(1, 1)] += size;
        let shape = believe(self.prior.b);
        normal[(2, 2)] += shape;
        normal[(3, 3)] += shape;
        if let Some(deviation) = self.prior.c {
            let constant = believe(deviation);
            normal[(4, 4)] += constant;
            normal[(5, 5)] += constant;
            right[4] += constant * start.c.re;
            right[5] += constant * start.c.im;
        }
        normal[(6, 6)] += if tune {
            believe(self.prior.omega * omega)
        } else {
            1.0
        };
        // A trace of belief in nothing keeps the matrix positive where the window tells too little.
        for m in 0..6 {
            normal[(m, m)] += 1e-9 * count + 1e-12;
        }
        for m in 0..UNKNOWNS {
            for n in 0..m {
                normal[(n, m)] = normal[(m, n)];
            }
        }
        let cholesky = normal.cholesky()?;
        let found = cholesky.solve(&right);
        let mut fitted = squares;
        for m in 0..UNKNOWNS {
            fitted -= 2.0 * data_right[m] * found[m];
            for n in 0..=m {
                let twice = if n == m { 1.0 } else { 2.0 };
                fitted += twice * data[(m, n)] * found[m] * found[n];
            }
        }
        let residual = (fitted / count).max(0.0);
        let energy = (squares / count - (mean / count).norm_sqr()).max(0.0);
        let change = if tune {
            found[6].clamp(-0.3 * omega.abs(), 0.3 * omega.abs())
        } else {
            0.0
        };
        // Variance of a along its own direction; noise is what is left, or at least what is believed.
        let a = C::new(found[0], found[1]);
        let along = a / a.norm().max(1e-12);
        let mut unit = SVector::<f64, UNKNOWNS>::zeros();
        unit[0] = along.re;
        unit[1] = along.im;
        let spread = cholesky.solve(&unit).dot(&unit).max(0.0);
        let deviation = (spread * f64::max(variance, 0.5 * residual)).sqrt();
        let mut cost = fitted.max(0.0)
            + size * (found[0] * found[0] + found[1] * found[1])
            + shape * (found[2] * found[2] + found[3] * found[3]);
        if let Some(deviation) = self.prior.c {
            let off = C::new(found[4], found[5]) - start.c;
            cost += believe(deviation) * off.norm_sqr();
        }
        Some(Fit {
            cost: cost / variance,
            wave: Wave {
                omega: omega + change,
                a,
                b: C::new(found[2], found[3]),
                c: C::new(found[4], found[5]),
            },
            count,
            residual,
            energy,
            deviation,
            components: 1.0 + self.shape.roundness(),
        })
    }

    /// Steps from a frequency alone: first the wave, then `steps` corrections of its frequency.
    pub fn from_frequency(&self, omega: f64, constant: C, steps: usize) -> Option<Fit> {
        let start = Wave {
            omega,
            c: constant,
            ..Wave::default()
        };
        let mut fit = self.step(&start, false)?;
        for _ in 0..steps {
            fit = self.step(&fit.wave, true)?;
        }
        Some(fit)
    }
}
