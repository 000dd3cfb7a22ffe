//! The figures of gestures that move the same points: which of them is it that is performed?
//!
//! A linear plane keeps gestures apart that move different points or in different directions. A circle, an
//! ellipse and a figure of eight drawn by one hand share their directions; what differs is the figure. So
//! every gesture knows the first two harmonics of its own movement, and what it reads (amplitude, phase)
//! foretells where its points are. Where one gesture alone foretells nearly all of the motion and a rival
//! leaves clearly more of it, the rival's amplitude is taken back. Several gestures performed at once are
//! foretold by none of them alone, and nothing is taken back.

use super::foreign::add_direction;
use super::{GestureSet, References, plane};
use nalgebra::DVector;

/// Harmonics that make a figure.
const HARMONICS: usize = 2;
/// Window in periods of the gesture as shown, and its bounds in seconds.
const WINDOW: (f64, f64, f64) = (1.5, 0.4, 2.0);
/// Share of the motion that the right figure leaves at most.
const LEFT: f64 = 0.15;
/// How much more a rival must leave to be the wrong one: times, and plus.
const CLEARLY: (f64, f64) = (2.0, 0.05);
/// Share of a gesture's directions that must lie in another's for the two to be rivals.
const SHARED: f64 = 0.5;
/// Below this amplitude a reading foretells nothing.
const LEAST_AMPLITUDE: f64 = 0.1;
/// Time constant with which an amplitude is taken back and given again, seconds.
const SETTLE_S: f64 = 0.15;

/// Movement of one cyclic gesture as its reading foretells it.
#[derive(Clone, Debug)]
pub(super) struct Figure {
    /// Per harmonic the cosine and the sine part of the flat pose about its mean, metres.
    parts: Vec<[DVector<f64>; 2]>,
    /// Orthonormal directions of the parts.
    span: Vec<DVector<f64>>,
    window_s: f64,
    last_t: Option<f64>,
    mean: DVector<f64>,
    energy: f64,
    left: f64,
    share: f64,
}

impl Figure {
    /// The figure of gesture `index`.
    pub fn new(set: &GestureSet, references: &References, index: usize) -> Self {
        let (frames, mean) = (&references.local[index], &references.mean[index]);
        let zero = DVector::zeros(mean.len());
        let mut parts = vec![[zero.clone(), zero.clone()]; HARMONICS];
        for (frame, [cos, sin]) in frames.iter().zip(plane::targets(set, references, index)) {
            let phase = sin.atan2(cos);
            let away = (frame - mean) * (2.0 / frames.len().max(1) as f64);
            for (harmonic, [c, s]) in parts.iter_mut().enumerate() {
                let (sin, cos) = ((harmonic + 1) as f64 * phase).sin_cos();
                *c += &away * cos;
                *s += &away * sin;
            }
        }
        let size = parts
            .iter()
            .flatten()
            .map(DVector::norm)
            .fold(0.0, f64::max);
        let mut span: Vec<DVector<f64>> = Vec::new();
        for part in parts.iter().flatten() {
            add_direction(&mut span, part.clone(), 0.1 * size.max(1e-9));
        }
        let (periods, least, longest) = WINDOW;
        Self {
            parts,
            span,
            window_s: (periods * set.gestures[index].duration_s).clamp(least, longest),
            last_t: None,
            mean: zero,
            energy: 0.0,
            left: 0.0,
            share: 1.0,
        }
    }

    /// Whether the two gestures move in the same directions.
    pub fn rivals(&self, other: &Self) -> bool {
        let within = |one: &Self, other: &Self| {
            let (mut inside, mut all) = (0.0, 0.0);
            for part in one.parts.iter().flatten() {
                all += part.norm_squared();
                inside += (other.span.iter())
                    .map(|direction| direction.dot(part).powi(2))
                    .sum::<f64>();
            }
            inside > SHARED * all
        };
        within(self, other) && within(other, self)
    }

    /// Takes the flat pose at `t` and what the gesture reads. Allocates nothing.
    pub fn push(&mut self, t: f64, flat: &[f64], amplitude: f64, phase_rad: f64) {
        let Some(last) = self.last_t.replace(t) else {
            self.mean.copy_from_slice(flat);
            return;
        };
        let share = 1.0 - (-(t - last) / self.window_s).exp();
        let turns: [(f64, f64); HARMONICS] =
            std::array::from_fn(|harmonic| ((harmonic + 1) as f64 * phase_rad).sin_cos());
        let (mut energy, mut left) = (0.0, 0.0);
        for (axis, value) in flat.iter().enumerate().take(self.mean.len()) {
            let away = value - self.mean[axis];
            let mut foretold = 0.0;
            for ([c, s], (sin, cos)) in self.parts.iter().zip(turns) {
                foretold += c[axis] * cos + s[axis] * sin;
            }
            energy += away * away;
            left += (away - amplitude * foretold).powi(2);
            self.mean[axis] += share * away;
        }
        self.energy += share * (energy - self.energy);
        self.left += share * (left - self.left);
    }

    /// Share of the recent motion that the reading does not foretell; `None` where it reads nothing.
    pub fn left(&self, amplitude: f64) -> Option<f64> {
        (amplitude > LEAST_AMPLITUDE && self.energy > 0.0).then(|| self.left / self.energy)
    }

    /// Share of the amplitude that stays, `dt` seconds later; `wrong`: a rival's figure it is.
    pub fn settle(&mut self, dt: f64, wrong: bool) -> f64 {
        let goal = if wrong { 0.0 } else { 1.0 };
        self.share += (1.0 - (-dt / SETTLE_S).exp()) * (goal - self.share);
        self.share
    }

    /// Forgets all samples.
    pub fn reset(&mut self) {
        self.last_t = None;
        self.energy = 0.0;
        self.left = 0.0;
        self.share = 1.0;
    }
}

/// Whether a gesture that leaves `left` of the motion is the wrong one beside one that leaves `best`.
pub(super) fn wrong(left: f64, best: f64) -> bool {
    best < LEFT && left > CLEARLY.0 * best + CLEARLY.1
}
