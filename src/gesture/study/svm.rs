//! A support vector machine that says frame by frame whether a gesture is performed: a baseline.
//!
//! After Seol et al. 2013, as Rhodin 2016 compares with it (section 9.6.3, figure 9.15): position,
//! velocity and acceleration of every point, a Gaussian kernel, one machine per gesture against the
//! rest, decisions averaged over 30 frames.

use super::correlate::Poses;
use super::suite::StudyError;
use smartcore::linalg::basic::matrix::DenseMatrix;
use smartcore::svm::Kernels;
use smartcore::svm::svc::{SVC, SVCParameters};

/// Frames over which decisions are averaged.
const AVERAGED: usize = 30;
/// Penalty of a training frame on the wrong side.
const PENALTY: f64 = 10.0;

/// Poses in a row that belong together, and whether each gesture is performed in them.
#[derive(Clone, Debug)]
pub struct Lesson {
    /// What is seen.
    pub poses: Poses,
    /// Per gesture.
    pub performed: Vec<bool>,
}

/// Scales positions, velocities and accelerations to the same size.
#[derive(Clone, Debug)]
struct Scaling {
    mean: Vec<f64>,
    /// Reciprocal root mean square of each third, over all lessons.
    gain: [f64; 3],
}

/// Position, velocity and acceleration of every coordinate, by backward differences.
fn features(poses: &Poses) -> Vec<Vec<f64>> {
    let rows = &poses.rows;
    (2..rows.len())
        .map(|k| {
            let (now, one, two) = (&rows[k], &rows[k - 1], &rows[k - 2]);
            let mut feature = now.clone();
            let pairs = || now.iter().zip(one).zip(two);
            feature.extend(pairs().map(|((a, b), _)| (a - b) / poses.step_s));
            feature.extend(
                pairs().map(|((a, b), c)| (a - 2.0 * b + c) / (poses.step_s * poses.step_s)),
            );
            feature
        })
        .collect()
}

impl Scaling {
    fn of(rows: &[Vec<f64>]) -> Self {
        let length = rows.first().map_or(0, Vec::len);
        let count = rows.len().max(1) as f64;
        let mut mean = vec![0.0; length];
        for row in rows {
            for (sum, value) in mean.iter_mut().zip(row) {
                *sum += value / count;
            }
        }
        let third = (length / 3).max(1);
        let mut square = [0.0; 3];
        for row in rows {
            for (axis, (value, mean)) in row.iter().zip(&mean).enumerate() {
                square[(axis / third).min(2)] += (value - mean).powi(2) / (count * third as f64);
            }
        }
        Self {
            mean,
            gain: square.map(|s| 1.0 / s.sqrt().max(1e-12)),
        }
    }

    fn apply(&self, rows: &mut [Vec<f64>]) {
        let third = (self.mean.len() / 3).max(1);
        for row in rows {
            for (axis, (value, mean)) in row.iter_mut().zip(&self.mean).enumerate() {
                *value = (*value - mean) * self.gain[(axis / third).min(2)];
            }
        }
    }
}

/// Per gesture and pose of `live`: the share of the last 30 frames in which it was detected.
///
/// # Errors
/// Lessons of one class only.
pub fn activities(
    lessons: &[Lesson],
    live: &Poses,
    seed: u64,
) -> Result<Vec<Vec<f64>>, StudyError> {
    let failed = |error: &dyn std::fmt::Display| StudyError::Svm(error.to_string());
    let gestures = lessons.first().map_or(0, |lesson| lesson.performed.len());
    let mut training = Vec::new();
    let mut lesson_of = Vec::new();
    for (index, lesson) in lessons.iter().enumerate() {
        let rows = features(&lesson.poses);
        lesson_of.extend(std::iter::repeat_n(index, rows.len()));
        training.extend(rows);
    }
    let scaling = Scaling::of(&training);
    scaling.apply(&mut training);
    let mut seen = features(live);
    scaling.apply(&mut seen);
    let width = training.first().map_or(1, Vec::len).max(1);
    let training = DenseMatrix::from_2d_vec(&training).map_err(|e| failed(&e))?;
    let seen = DenseMatrix::from_2d_vec(&seen).map_err(|e| failed(&e))?;
    (0..gestures)
        .map(|gesture| {
            let labels: Vec<i32> = lesson_of
                .iter()
                .map(|lesson| {
                    if lessons[*lesson].performed[gesture] {
                        1
                    } else {
                        -1
                    }
                })
                .collect();
            let parameters = SVCParameters::default()
                .with_c(PENALTY)
                .with_kernel(Kernels::rbf().with_gamma(1.0 / width as f64))
                .with_seed(Some(seed));
            let machine = SVC::fit(&training, &labels, &parameters).map_err(|e| failed(&e))?;
            let decisions = machine.decision_function(&seen).map_err(|e| failed(&e))?;
            // The first two poses have no acceleration yet.
            let mut detected = vec![0.0; live.rows.len().min(2)];
            detected.extend(decisions.iter().map(|d| f64::from(u8::from(*d > 0.0))));
            Ok(running_mean(&detected, AVERAGED))
        })
        .collect()
}

/// Mean of the last `count` values (fewer at the start).
fn running_mean(values: &[f64], count: usize) -> Vec<f64> {
    (0..values.len())
        .map(|k| {
            let window = &values[(k + 1).saturating_sub(count)..=k];
            window.iter().sum::<f64>() / window.len() as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::SplitMix;
    use std::f64::consts::TAU;

    /// Two points; point `moving` circles.
    fn poses(moving: usize, phase: f64, frames: u32) -> Poses {
        let mut random = SplitMix::new(u64::from(frames) + moving as u64);
        let rows = (0..frames)
            .map(|k| {
                let mut row: Vec<f64> = (0..6).map(|_| 0.001 * random.normal()).collect();
                let u = TAU * f64::from(k) / 30.0 + phase;
                if moving < 2 {
                    row[3 * moving] += 0.05 * u.cos();
                    row[3 * moving + 1] += 0.05 * u.sin();
                }
                row
            })
            .collect();
        Poses {
            step_s: 1.0 / 30.0,
            rows,
        }
    }

    fn lesson(moving: usize) -> Lesson {
        Lesson {
            poses: poses(moving, 0.0, 120),
            performed: vec![moving == 0, moving == 1],
        }
    }

    #[test]
    fn movements_of_different_points_are_told_apart() {
        let lessons = [lesson(0), lesson(1), lesson(2)];
        for moving in 0..3 {
            let live = poses(moving, 1.0, 90);
            let found = activities(&lessons, &live, 1).expect("two classes each");
            for (gesture, activity) in found.iter().enumerate() {
                let last = activity[89];
                let right = if moving == gesture {
                    last > 0.9
                } else {
                    last < 0.1
                };
                assert!(right, "point {moving} moves, gesture {gesture}: {last:.2}");
            }
            let again = activities(&lessons, &live, 1).expect("two classes each");
            assert_eq!(found, again, "the same seed");
        }
    }

    #[test]
    fn a_single_class_is_an_error_and_no_panic() {
        let one = [lesson(0)];
        let error = activities(&one, &poses(0, 0.0, 40), 1).expect_err("one class");
        assert!(error.to_string().contains("classes"), "{error}");
    }
}
