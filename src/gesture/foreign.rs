//! Movements that nobody defined: how much of what a gesture's points do is none of the gestures.
//!
//! A plane answers to whatever has a share in its direction: an arm that is raised by a metre moves it
//! as much as the small wave it was trained on. What gives such a movement away is what the plane does
//! not see. So the pose is split into the part that the references of all gestures span and the rest; the
//! rest's recent motion, at the points that take part in a gesture, is held against the motion on the
//! gesture's own plane. Measurement noise does not count: it is told from motion by its changes from
//! sample to sample. What other gestures of the set do lies in the span and does not count either, nor
//! do points at rest in the gesture (legs that walk under a waving hand).

use super::{Gesture, GestureKind, GestureSet, Plane, References};
use nalgebra::DVector;
use std::f64::consts::TAU;

/// A direction of which the others leave less than this share is not kept.
const LEAST_DIRECTION: f64 = 0.1;
/// Window in periods of the gesture as shown, and its bounds in seconds.
const WINDOW: (f64, f64, f64) = (0.6, 0.25, 0.8);
/// Share of own motion below which nothing is believed, and from which all is.
const OWN: (f64, f64) = (0.2, 0.45);
/// Noise counts so many times against the motion it might explain.
const NOISE: f64 = 1.5;

/// The span of all references, and the part of a pose outside.
#[derive(Clone, Debug)]
pub(super) struct Span {
    mean: DVector<f64>,
    directions: Vec<DVector<f64>>,
    outside: Vec<f64>,
}

impl Span {
    /// Two directions per cyclic gesture, those of its first harmonic, and one per non-cyclic gesture, from
    /// rest to extreme, made orthonormal.
    pub fn new(set: &GestureSet, references: &References) -> Self {
        let dim = references.mean.first().map_or(0, DVector::len);
        let mut mean = DVector::zeros(dim);
        let mut directions: Vec<DVector<f64>> = Vec::new();
        for ((gesture, frames), own) in
            (set.gestures.iter().zip(&references.local)).zip(&references.mean)
        {
            mean += own / references.local.len().max(1) as f64;
            for direction in movements(gesture, frames, own) {
                let least = LEAST_DIRECTION * direction.norm().max(1e-9);
                add_direction(&mut directions, direction, least);
            }
        }
        Self {
            mean,
            directions,
            outside: vec![0.0; dim],
        }
    }

    /// The part of the flat pose outside the span, metres. Allocates nothing.
    pub fn outside(&mut self, flat: &[f64]) -> &[f64] {
        for ((out, value), mean) in self.outside.iter_mut().zip(flat).zip(self.mean.iter()) {
            *out = value - mean;
        }
        for direction in &self.directions {
            let along: f64 = (self.outside.iter().zip(direction.iter()))
                .map(|(a, b)| a * b)
                .sum();
            for (out, part) in self.outside.iter_mut().zip(direction.iter()) {
                *out -= along * part;
            }
        }
        &self.outside
    }
}

/// Adds what of `direction` the orthonormal `directions` do not hold yet, where it is longer than `least`.
pub(super) fn add_direction(
    directions: &mut Vec<DVector<f64>>,
    mut direction: DVector<f64>,
    least: f64,
) {
    for other in directions.iter() {
        let along = direction.dot(other);
        direction -= other * along;
    }
    let length = direction.norm();
    if length > least {
        directions.push(direction / length);
    }
}

/// The directions in which a gesture moves the flat pose.
fn movements(gesture: &Gesture, frames: &[DVector<f64>], mean: &DVector<f64>) -> Vec<DVector<f64>> {
    if gesture.kind == GestureKind::NonCyclic {
        return match (frames.first(), frames.last()) {
            (Some(rest), Some(extreme)) => vec![extreme - rest],
            _ => Vec::new(),
        };
    }
    let mut harmonic = [DVector::zeros(mean.len()), DVector::zeros(mean.len())];
    for (t, frame) in gesture.times_s.iter().zip(frames) {
        let (sin, cos) = (TAU * t / gesture.duration_s.max(1e-9)).sin_cos();
        harmonic[0] += (frame - mean) * cos;
        harmonic[1] += (frame - mean) * sin;
    }
    if harmonic[0].norm() < harmonic[1].norm() {
        harmonic.swap(0, 1);
    }
    harmonic.to_vec()
}

/// How far one gesture's plane is to be trusted, from the recent motion in and outside the span.
#[derive(Clone, Debug)]
pub(super) struct Trust {
    /// Per coordinate how much its point takes part in the gesture, 0..1.
    weights: Vec<f64>,
    /// Weighted motion of the gesture at amplitude 1, square metres, over its shape's power.
    own: f64,
    window_s: f64,
    last_t: Option<f64>,
    mean: Vec<f64>,
    before: Vec<f64>,
    foreign: f64,
    noise: f64,
    centre: [f64; 2],
    motion: f64,
}

impl Trust {
    /// For gesture `index`, read on `plane`.
    pub fn new(references: &References, index: usize, duration_s: f64, plane: &Plane) -> Self {
        let (frames, mean) = (&references.local[index], &references.mean[index]);
        let mut motion = vec![0.0; mean.len()];
        for frame in frames {
            for (sum, (value, mean)) in motion.iter_mut().zip(frame.iter().zip(mean.iter())) {
                *sum += (value - mean).powi(2) / frames.len().max(1) as f64;
            }
        }
        let point = |k: usize| -> f64 { motion[k - k % 3..].iter().take(3).sum() };
        let most = (0..motion.len()).map(point).fold(0.0, f64::max).max(1e-18);
        let weights: Vec<f64> = (0..motion.len()).map(|k| point(k) / most).collect();
        let own: f64 = weights.iter().zip(&motion).map(|(w, m)| w * m).sum();
        let (periods, least, longest) = WINDOW;
        Self {
            own: own / plane.shape().power(),
            window_s: (periods * duration_s).clamp(least, longest),
            last_t: None,
            mean: vec![0.0; mean.len()],
            before: vec![0.0; mean.len()],
            weights,
            foreign: 0.0,
            noise: 0.0,
            centre: [0.0; 2],
            motion: 0.0,
        }
    }

    /// Takes the pose's part outside the span and its place on the plane; returns the trust, 0..1.
    ///
    /// Allocates nothing.
    pub fn push(&mut self, t: f64, outside: &[f64], z: [f64; 2]) -> f64 {
        let Some(last) = self.last_t.replace(t) else {
            self.mean.copy_from_slice(outside);
            self.before.copy_from_slice(outside);
            self.centre = z;
            return 1.0;
        };
        let share = 1.0 - (-(t - last) / self.window_s).exp();
        let (mut foreign, mut noise) = (0.0, 0.0);
        let state = self.mean.iter_mut().zip(&mut self.before);
        for ((value, weight), (mean, before)) in outside.iter().zip(&self.weights).zip(state) {
            foreign += weight * (value - *mean).powi(2);
            noise += weight * 0.5 * (value - *before).powi(2);
            *mean += share * (value - *mean);
            *before = *value;
        }
        let motion = (z[0] - self.centre[0]).powi(2) + (z[1] - self.centre[1]).powi(2);
        for (centre, value) in self.centre.iter_mut().zip(z) {
            *centre += share * (value - *centre);
        }
        self.foreign += share * (foreign - self.foreign);
        self.noise += share * (noise - self.noise);
        self.motion += share * (motion - self.motion);
        let foreign = (self.foreign - NOISE * self.noise).max(0.0);
        let own = self.own * self.motion;
        let ratio = own / (own + foreign).max(1e-18);
        ((ratio - OWN.0) / (OWN.1 - OWN.0)).clamp(0.0, 1.0)
    }

    /// Forgets all samples.
    pub fn reset(&mut self) {
        self.last_t = None;
        self.foreign = 0.0;
        self.noise = 0.0;
        self.motion = 0.0;
    }
}
