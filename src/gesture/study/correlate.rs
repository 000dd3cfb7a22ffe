//! Windowed cross-correlation of a motion with a gesture's template, without planes: a baseline.
//!
//! After Shiratori and Hodgins 2008, as Rhodin 2016 compares with it (section 9.6.3, figure 9.15):
//! the pose itself is correlated, over a discrete set of phases and time scales.

/// Poses at a uniform step, flat (x, y, z per point), global motion removed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Poses {
    /// Time between two poses in seconds.
    pub step_s: f64,
    /// One row per pose.
    pub rows: Vec<Vec<f64>>,
}

/// Frames of a template, and phases that are tried.
const FRAMES: usize = 10;
/// Time scales that are tried: window length over the template's.
const SCALES: [f64; 5] = [0.5, 0.62, 0.77, 1.0, 1.3];
/// A motion smaller than this share of the template is no motion: its correlation means nothing.
const LEAST_SIZE: f64 = 0.2;

/// A gesture's reference, mean removed.
#[derive(Clone, Debug)]
pub struct Template {
    frames: Vec<Vec<f64>>,
    duration_s: f64,
    energy: f64,
    cyclic: bool,
}

/// What a template finds in the recent past.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Match {
    /// Size of the template in the motion, 1 = as shown, at the best phase and scale.
    pub amplitude: f64,
    /// Normalised correlation coefficient there, 0..1.
    pub coefficient: f64,
}

impl Template {
    /// From one period, or from rest to extreme, of `duration_s`. `reference(u)` gives the pose at
    /// the share `u` of it, 0..1.
    pub fn new(duration_s: f64, cyclic: bool, reference: impl Fn(f64) -> Vec<f64>) -> Self {
        let span = if cyclic { FRAMES } else { FRAMES - 1 } as f64;
        let mut frames: Vec<_> = (0..FRAMES).map(|k| reference(k as f64 / span)).collect();
        let energy = remove_mean(&mut frames);
        Self {
            frames,
            duration_s,
            energy,
            cyclic,
        }
    }

    /// The best match that ends at every pose.
    pub fn matches(&self, poses: &Poses) -> Vec<Match> {
        (0..poses.rows.len()).map(|k| self.at(poses, k)).collect()
    }

    fn at(&self, poses: &Poses, newest: usize) -> Match {
        let mut best = Match::default();
        for scale in SCALES {
            let span_s = self.duration_s * scale;
            let step = span_s / poses.step_s / FRAMES as f64;
            let mut window: Vec<Vec<f64>> = (0..FRAMES)
                .map(|k| between(&poses.rows, newest as f64 - step * (FRAMES - 1 - k) as f64))
                .collect();
            let energy = remove_mean(&mut window);
            if energy <= LEAST_SIZE * LEAST_SIZE * self.energy || self.energy <= 0.0 {
                continue;
            }
            let products: Vec<Vec<f64>> = window
                .iter()
                .map(|row| self.frames.iter().map(|frame| dot(row, frame)).collect())
                .collect();
            let shifts = if self.cyclic { FRAMES } else { 1 };
            for shift in 0..shifts {
                let sum: f64 = (0..FRAMES).map(|k| products[k][(k + shift) % FRAMES]).sum();
                let coefficient = sum / (energy * self.energy).sqrt();
                if coefficient > best.coefficient {
                    best = Match {
                        amplitude: sum / self.energy,
                        coefficient,
                    };
                }
            }
        }
        best
    }
}

/// Takes the mean over the rows away; returns the energy that is left.
fn remove_mean(rows: &mut [Vec<f64>]) -> f64 {
    let count = rows.len().max(1) as f64;
    let mut energy = 0.0;
    for axis in 0..rows.first().map_or(0, Vec::len) {
        let mean = rows.iter().map(|row| row[axis]).sum::<f64>() / count;
        for row in rows.iter_mut() {
            row[axis] -= mean;
            energy += row[axis] * row[axis];
        }
    }
    energy
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The row at a fractional index, linear between neighbours, held at the ends.
pub fn between(rows: &[Vec<f64>], index: f64) -> Vec<f64> {
    let last = rows.len().saturating_sub(1);
    let index = index.clamp(0.0, last as f64);
    let before = index.floor() as usize;
    let u = index - before as f64;
    let (Some(a), Some(b)) = (rows.get(before), rows.get((before + 1).min(last))) else {
        return Vec::new();
    };
    a.iter().zip(b).map(|(a, b)| a + u * (b - a)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn circle(phase: f64, size: f64) -> Vec<f64> {
        vec![size * phase.cos(), size * phase.sin(), 3.0]
    }

    #[test]
    fn the_same_motion_at_another_speed_and_size_is_found() {
        let template = Template::new(1.0, true, |u| circle(TAU * u, 0.1));
        for hz in [0.8, 1.0, 1.25] {
            let rows = (0..90)
                .map(|k| circle(TAU * hz * f64::from(k) / 30.0, 0.07))
                .collect();
            let poses = Poses {
                step_s: 1.0 / 30.0,
                rows,
            };
            let found = template.matches(&poses)[89];
            assert!(found.coefficient > 0.95, "{hz} Hz: {found:?}");
            assert!((found.amplitude - 0.7).abs() < 0.07, "{hz} Hz: {found:?}");
        }
    }

    #[test]
    fn stillness_and_nothing_match_nothing() {
        let template = Template::new(1.0, true, |u| circle(TAU * u, 0.1));
        let poses = Poses {
            step_s: 1.0 / 30.0,
            rows: vec![vec![0.0; 3]; 60],
        };
        assert_eq!(template.matches(&poses)[59], Match::default());
        assert!(template.matches(&Poses::default()).is_empty());
        assert!(between(&[], 0.5).is_empty());
    }
}
