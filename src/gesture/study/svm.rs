//! A support vector machine that says frame by frame whether a gesture is performed: a baseline.
//!
//! After Seol et al. 2013, as Rhodin 2016 compares with it (section 9.6.3, figure 9.15): position,
//! velocity and acceleration of every point, a Gaussian kernel, one machine per gesture against the
//! rest, decisions averaged over 30 frames.
//!
//! The machine is trained by sequential minimal optimisation on the pair that violates the
//! conditions of optimality most (Keerthi et al. 2001; what LIBSVM began with): exact to a
//! tolerance, without chance. Of the crates, `linfa-svm` brings 50 others; `smartcore` cuts training
//! rows to as many features as there are rows, and took half a minute where this takes a second.

use super::correlate::Poses;
use super::suite::StudyError;

/// Frames over which decisions are averaged.
const AVERAGED: usize = 30;
/// Penalty of a training frame on the wrong side.
const PENALTY: f64 = 10.0;
/// Conditions of optimality may be violated by this much.
const TOLERANCE: f64 = 1e-3;
/// Steps after which training stops however far it got; tens of thousands are usual.
const MOST_STEPS: usize = 1_000_000;

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

/// A trained machine: the decision is sum beta_k exp(-gamma |x_k - x|^2) + bias, above 0 = yes.
#[derive(Clone, Debug)]
struct Machine {
    /// Support vectors with their signed weights.
    support: Vec<(Vec<f64>, f64)>,
    gamma: f64,
    bias: f64,
}

fn kernel(a: &[f64], b: &[f64], gamma: f64) -> f64 {
    let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (-gamma * square).exp()
}

/// All kernel values between the rows, row by row.
fn kernels(rows: &[Vec<f64>], gamma: f64) -> Vec<Vec<f64>> {
    let mut all = vec![vec![1.0; rows.len()]; rows.len()];
    for i in 0..rows.len() {
        for j in 0..i {
            let value = kernel(&rows[i], &rows[j], gamma);
            all[i][j] = value;
            all[j][i] = value;
        }
    }
    all
}

impl Machine {
    /// Trains on `rows`, of which `yes` are of the class; `kernels` are those of the rows.
    fn train(
        rows: &[Vec<f64>],
        yes: &[bool],
        kernels: &[Vec<f64>],
        gamma: f64,
    ) -> Result<Self, StudyError> {
        let count = yes.iter().filter(|yes| **yes).count();
        if count == 0 || count == yes.len() {
            return Err(StudyError::OneClass {
                samples: yes.len(),
                of_class: count,
            });
        }
        // beta_k = y_k alpha_k lies in 0..C for yes and in -C..0 for no; they sum to zero.
        let bounds = |k: usize| {
            if yes[k] {
                (0.0, PENALTY)
            } else {
                (-PENALTY, 0.0)
            }
        };
        let mut beta = vec![0.0; rows.len()];
        // y_k - sum_l beta_l K(k, l): the bias at which row k would sit on its margin.
        let mut margin: Vec<f64> = yes
            .iter()
            .map(|yes| if *yes { 1.0 } else { -1.0 })
            .collect();
        let mut bias = 0.0;
        for _ in 0..MOST_STEPS {
            let (mut up, mut down) = (None::<usize>, None::<usize>);
            for k in 0..rows.len() {
                let (low, high) = bounds(k);
                if beta[k] < high && up.is_none_or(|best| margin[k] > margin[best]) {
                    up = Some(k);
                }
                if beta[k] > low && down.is_none_or(|best| margin[k] < margin[best]) {
                    down = Some(k);
                }
            }
            // With both classes there is always one that may rise and one that may fall.
            let (Some(i), Some(j)) = (up, down) else {
                break;
            };
            bias = 0.5 * (margin[i] + margin[j]);
            let gap = margin[i] - margin[j];
            if gap < TOLERANCE {
                break;
            }
            let bend = (kernels[i][i] + kernels[j][j] - 2.0 * kernels[i][j]).max(1e-12);
            let room = (bounds(i).1 - beta[i]).min(beta[j] - bounds(j).0);
            let step = (gap / bend).min(room);
            beta[i] += step;
            beta[j] -= step;
            for ((margin, a), b) in margin.iter_mut().zip(&kernels[i]).zip(&kernels[j]) {
                *margin -= step * (a - b);
            }
        }
        let support = rows.iter().cloned().zip(beta);
        Ok(Self {
            support: support.filter(|(_, beta)| *beta != 0.0).collect(),
            gamma,
            bias,
        })
    }

    fn decision(&self, row: &[f64]) -> f64 {
        let parts = self.support.iter();
        parts
            .map(|(support, beta)| beta * kernel(support, row, self.gamma))
            .sum::<f64>()
            + self.bias
    }
}

/// Per gesture and pose of `live`: the share of the last 30 frames in which it was detected.
///
/// # Errors
/// Lessons of one class only.
pub fn activities(lessons: &[Lesson], live: &Poses) -> Result<Vec<Vec<f64>>, StudyError> {
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
    let gamma = 1.0 / training.first().map_or(1, Vec::len).max(1) as f64;
    let kernels = kernels(&training, gamma);
    (0..gestures)
        .map(|gesture| {
            let yes = (lesson_of.iter()).map(|lesson| lessons[*lesson].performed[gesture]);
            let yes: Vec<bool> = yes.collect();
            let machine = Machine::train(&training, &yes, &kernels, gamma)?;
            // The first two poses have no acceleration yet.
            let mut detected = vec![0.0; live.rows.len().min(2)];
            let decisions = seen.iter().map(|row| machine.decision(row));
            detected.extend(decisions.map(|d| f64::from(u8::from(d > 0.0))));
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
            let found = activities(&lessons, &live).expect("two classes each");
            for (gesture, activity) in found.iter().enumerate() {
                let last = activity[89];
                let right = if moving == gesture {
                    last > 0.9
                } else {
                    last < 0.1
                };
                assert!(right, "point {moving} moves, gesture {gesture}: {last:.2}");
            }
        }
    }

    #[test]
    fn a_single_class_is_an_error_and_no_panic() {
        let one = [lesson(0)];
        let error = activities(&one, &poses(0, 0.0, 40)).expect_err("one class");
        assert!(error.to_string().contains("118 of 118"), "{error}");
        assert!(activities(&[], &Poses::default()).is_ok_and(|none| none.is_empty()));
    }

    #[test]
    fn two_samples_have_the_solution_that_can_be_worked_out() {
        // One row each: alpha = 1 / (1 - K), both on their margins, no bias.
        let rows = [vec![1.0], vec![-1.0]];
        let gamma = 0.25;
        let k = (-gamma * 4.0_f64).exp();
        let machine = Machine::train(&rows, &[true, false], &kernels(&rows, gamma), gamma)
            .expect("two classes");
        let weights: Vec<f64> = machine.support.iter().map(|(_, beta)| *beta).collect();
        let expected = 1.0 / (1.0 - k);
        assert!(
            (weights[0] - expected).abs() < 1e-9,
            "{weights:?} {expected}"
        );
        assert!((weights[1] + expected).abs() < 1e-9, "{weights:?}");
        assert!(machine.bias.abs() < 1e-9, "bias {}", machine.bias);
        assert!((machine.decision(&[1.0]) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn what_no_line_separates_is_separated_and_optimal() {
        // A disc within a ring, with noise: the conditions of optimality hold on every row.
        let mut random = SplitMix::new(4);
        let mut rows = Vec::new();
        let mut yes = Vec::new();
        for k in 0..200 {
            let inside = k % 2 == 0;
            let radius = if inside { 0.6 } else { 1.6 } + 0.25 * random.normal();
            let angle = TAU * random.unit();
            rows.push(vec![radius * angle.cos(), radius * angle.sin()]);
            yes.push(inside);
        }
        let machine = Machine::train(&rows, &yes, &kernels(&rows, 1.0), 1.0).expect("two classes");
        let wrong = rows
            .iter()
            .zip(&yes)
            .filter(|(row, yes)| (machine.decision(row) > 0.0) != **yes)
            .count();
        assert!(wrong <= 6, "{wrong} of 200 on the wrong side");
        let sum: f64 = machine.support.iter().map(|(_, beta)| beta).sum();
        assert!(sum.abs() < 1e-6, "the weights sum to {sum:.2e}");
        for (row, yes) in rows.iter().zip(&yes) {
            let beta = (machine.support.iter().find(|(s, _)| s == row)).map_or(0.0, |s| s.1.abs());
            let side = machine.decision(row) * if *yes { 1.0 } else { -1.0 };
            let fits = if beta == 0.0 {
                side > 0.998
            } else if beta < PENALTY {
                (side - 1.0).abs() < 0.002
            } else {
                side < 1.002
            };
            assert!(fits, "weight {beta:.3} at margin {side:.4}");
        }
    }
}
