//! How new a pose is against all gestures already defined: the uncertainty of a Bayesian regression.
//!
//! Rhodin 2016, section 8.3 and eq. 8.3: with the known frames as the columns of X, noise sigma^2 and a
//! unit prior, `q(x) = x^T A^-1 x` with `A = sigma^-2 X X^T + I` is how little the known frames say about
//! pose x. In the dual form, `q(x) = |x|^2 - |L^-1 X^T x|^2` where `L L^T = X^T X + sigma^2 I`, a sample
//! costs one product with a matrix of (frames) x (coordinates), because `L^-1 X^T` is kept.
//!
//! Poses are centred and divided by the size of the known gestures, so q reads as a squared distance: 0 is
//! a mixture of what is known (a plane answers to it: confusable), 1 is as far from every such mixture as
//! the known gestures are large.

use super::{GestureSet, References};
use crate::pose::GlobalFit;
use nalgebra::{DMatrix, DVector};

/// Noise of the regression (the thesis's sigma^2).
const NOISE: f64 = 0.05;
/// Frames kept of all gestures together.
const FRAMES: usize = 96;
/// A gesture gives at least this many frames, however many gestures there are.
const LEAST_FRAMES: usize = 8;

/// How new a pose is.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Novelty {
    /// 0: known, will be confused with a gesture that is there; 1: new. Always 1 for an empty set.
    pub value: f64,
    /// Index of the gesture with the frame most like the pose.
    pub nearest: Option<usize>,
}

/// Judges poses against the frames of a set.
#[derive(Clone, Debug)]
pub struct Guidance {
    known: Option<Known>,
}

#[derive(Clone, Debug)]
struct Known {
    fit: GlobalFit,
    mean: DVector<f64>,
    scale_m: f64,
    /// One column per known frame, bias last.
    frames: DMatrix<f64>,
    gesture_of_frame: Vec<usize>,
    /// `L^-1 X^T`.
    whitened: DMatrix<f64>,
    local: Vec<[f64; 3]>,
    x: DVector<f64>,
    answers: DVector<f64>,
}

impl Guidance {
    /// Prepares the judgement; the set may be empty.
    ///
    /// # Errors
    /// The name of an anchor that the set does not have.
    pub fn new(set: &GestureSet) -> Result<Self, String> {
        if set.gestures.is_empty() {
            return Ok(Self { known: None });
        }
        let references = References::new(set)?;
        let dim = set.header.points.len() * 3;
        let count = references.mean.len() as f64;
        let sum = |sum: DVector<f64>, mean: &DVector<f64>| sum + mean;
        let mean = references.mean.iter().fold(DVector::zeros(dim), sum) / count;
        let each = (FRAMES / set.gestures.len()).max(LEAST_FRAMES);
        let mut columns = Vec::new();
        let mut gesture_of_frame = Vec::new();
        for (gesture, rows) in references.local.iter().enumerate() {
            let step = rows.len().div_ceil(each).max(1);
            for row in rows.iter().step_by(step) {
                let mut x = (row - &mean) / references.scale_m;
                x = x.push(1.0);
                columns.push(x);
                gesture_of_frame.push(gesture);
            }
        }
        let frames = DMatrix::from_columns(&columns);
        let n = frames.ncols();
        let gram = frames.transpose() * &frames + DMatrix::identity(n, n) * NOISE;
        let whitened = gram
            .cholesky()
            .and_then(|c| c.l().solve_lower_triangular(&frames.transpose()))
            // The matrix is positive definite for finite frames, which the gesture file promises.
            .unwrap_or_else(|| DMatrix::zeros(n, dim + 1));
        Ok(Self {
            known: Some(Known {
                fit: references.fit,
                mean,
                scale_m: references.scale_m,
                frames,
                gesture_of_frame,
                whitened,
                local: vec![[0.0; 3]; set.header.points.len()],
                x: DVector::zeros(dim + 1),
                answers: DVector::zeros(n),
            }),
        })
    }

    /// How new the pose is: one place per point of the set, metres, with its global motion.
    ///
    /// Allocates nothing. A pose of another number of points is as new as can be.
    pub fn judge(&mut self, pose: &[[f64; 3]]) -> Novelty {
        let new = Novelty {
            value: 1.0,
            nearest: None,
        };
        let Some(known) = &mut self.known else {
            return new;
        };
        if pose.len() != known.local.len() {
            return new;
        }
        known.fit.remove(pose, None, &mut known.local);
        let flat = known.local.as_flattened();
        for (axis, value) in flat.iter().enumerate() {
            known.x[axis] = (value - known.mean[axis]) / known.scale_m;
        }
        known.x[flat.len()] = 1.0;
        known.answers.gemv(1.0, &known.whitened, &known.x, 0.0);
        let q = known.x.norm_squared() - known.answers.norm_squared();
        let mut nearest = (f64::INFINITY, 0);
        for (column, gesture) in known.frames.column_iter().zip(&known.gesture_of_frame) {
            let pairs = column.iter().zip(known.x.iter());
            let distance: f64 = pairs.map(|(a, b)| (a - b) * (a - b)).sum();
            if distance < nearest.0 {
                nearest = (distance, *gesture);
            }
        }
        Novelty {
            value: if q.is_finite() {
                q.clamp(0.0, 1.0)
            } else {
                1.0
            },
            nearest: Some(nearest.1),
        }
    }
}
