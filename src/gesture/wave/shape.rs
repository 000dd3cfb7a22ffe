//! The figure a gesture's own reference draws on its plane: circle, line or something between.

use rustfft::num_complex::Complex;
use std::f64::consts::TAU;

pub(super) type C = Complex<f64>;

/// First harmonic of a reference on its plane: `z = forward exp(i phase) + backward exp(-i phase)`.
///
/// A loop that the pose tells completely is the unit circle, (1, 0). Of a movement along a line the
/// pose tells one component only, so `z` runs to and fro: (1/2, 1/2). A wave performed with amplitude
/// `a` draws `a` times its shape, so whoever knows the shape reads a line as well as a loop.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Shape {
    /// Coefficient of the counter-clockwise turn.
    pub forward: Complex<f64>,
    /// Coefficient of the clockwise turn.
    pub backward: Complex<f64>,
}

impl Shape {
    /// The unit circle.
    pub const LOOP: Self = Self {
        forward: Complex { re: 1.0, im: 0.0 },
        backward: Complex { re: 0.0, im: 0.0 },
    };

    /// The first harmonic of `places`, one period in even steps that starts at phase `origin_rad`.
    ///
    /// Too small a figure to be a shape (or none at all) counts as a loop.
    pub fn of_period(places: impl Iterator<Item = [f64; 2]>, origin_rad: f64) -> Self {
        let places: Vec<[f64; 2]> = places.collect();
        let n = places.len().max(1) as f64;
        let (mut forward, mut backward) = (C::default(), C::default());
        for (k, [x, y]) in places.iter().enumerate() {
            let turn = C::from_polar(1.0, origin_rad + TAU * k as f64 / n);
            let z = C::new(*x, *y);
            forward += z * turn.conj() / n;
            backward += z * turn / n;
        }
        let shape = Self { forward, backward };
        if shape.power() > 0.01 {
            shape
        } else {
            Self::LOOP
        }
    }

    /// `|forward|^2 + |backward|^2`: mean square modulus at amplitude 1.
    pub fn power(&self) -> f64 {
        self.forward.norm_sqr() + self.backward.norm_sqr()
    }

    /// How far from a line the figure is: 0 on a line, 1 on a circle.
    pub fn roundness(&self) -> f64 {
        let (p, q) = (self.forward.norm(), self.backward.norm());
        (p - q).abs() / (p + q).max(1e-12)
    }

    /// Coefficients of both turns for a wave `a` of this shape plus `b` of the shape orthogonal to it.
    ///
    /// The orthogonal shape of a circle is the circle run the other way; of a line, the line across.
    pub(super) fn turns(&self, a: C, b: C) -> (C, C) {
        (
            self.forward * a - self.backward * b,
            self.backward * a.conj() + self.forward * b.conj(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn circles_lines_and_ellipses_are_known_by_their_first_harmonic() {
        let figure = |x: f64, y: f64| {
            let places = (0..64).map(move |k| {
                let (sin, cos) = (0.7 + TAU * f64::from(k) / 64.0).sin_cos();
                [x * cos, y * sin]
            });
            Shape::of_period(places, 0.7)
        };
        let circle = figure(1.0, 1.0);
        assert!((circle.forward - 1.0).norm() < 1e-12 && circle.backward.norm() < 1e-12);
        let line = figure(1.0, 0.0);
        assert!((line.forward - 0.5).norm() < 1e-12 && (line.backward - 0.5).norm() < 1e-12);
        assert!(line.roundness() < 1e-12 && (circle.roundness() - 1.0).abs() < 1e-12);
        let ellipse = figure(1.0, 0.5);
        assert!((ellipse.roundness() - 0.5).abs() < 1e-12, "{ellipse:?}");
        assert_eq!(figure(0.0, 0.0), Shape::LOOP);
    }
}
