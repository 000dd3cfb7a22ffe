//! A recording as a source of segments: its smooth motion and its noise, and mixtures of poses.

use super::Pose;
use crate::pose::{GlobalFit, GlobalOptions, PoseHeader, Recording};

/// Deviation of the Gaussian that splits a recording into motion and noise, seconds.
const SPLIT_SIGMA_S: f64 = 0.012;
/// Residuals beyond this many usual sizes (median of the modulus, per coordinate) are motion.
const NOISE_REACH: f64 = 4.0;
/// A recording split into motion and noise.
pub(super) struct Source {
    pub(super) times: Vec<f64>,
    pub(super) smooth: Vec<Pose>,
    pub(super) residual: Vec<Pose>,
}

impl Source {
    pub(super) fn new(recording: &Recording) -> Result<Self, String> {
        let rows = recording.filled()?;
        let times: Vec<f64> = recording.samples.iter().map(|s| s.t).collect();
        let mut smooth = Vec::with_capacity(rows.len());
        for t in &times {
            let reach = 4.0 * SPLIT_SIGMA_S;
            let first = times.partition_point(|other| *other < t - reach);
            let last = times.partition_point(|other| *other <= t + reach);
            let mut pose: Pose = vec![[0.0; 3]; recording.header.points.len()];
            let mut total = 0.0;
            for k in first..last {
                let u = (times[k] - t) / SPLIT_SIGMA_S;
                let weight = (-0.5 * u * u).exp();
                total += weight;
                add(&mut pose, &rows[k], weight);
            }
            scale(&mut pose, 1.0 / total);
            smooth.push(pose);
        }
        let mut residual: Vec<Pose> = rows
            .iter()
            .zip(&smooth)
            .map(|(row, smooth)| {
                let mut rest = row.clone();
                add(&mut rest, smooth, -1.0);
                rest
            })
            .collect();
        for point in 0..recording.header.points.len() {
            for axis in 0..3 {
                let mut sizes: Vec<f64> = residual.iter().map(|r| r[point][axis].abs()).collect();
                sizes.sort_by(f64::total_cmp);
                let reach = NOISE_REACH * sizes[sizes.len() / 2];
                for row in &mut residual {
                    row[point][axis] = row[point][axis].clamp(-reach, reach);
                }
            }
        }
        Ok(Self {
            times,
            smooth,
            residual,
        })
    }

    pub(super) fn span(&self) -> (f64, f64) {
        (
            self.times.first().copied().unwrap_or(0.0),
            self.times.last().copied().unwrap_or(0.0),
        )
    }

    /// The smooth part at `t`, held beyond the ends.
    pub(super) fn at(&self, t: f64) -> Pose {
        let after = self.times.partition_point(|time| *time <= t);
        if after == 0 || after == self.times.len() {
            return self.smooth[after.saturating_sub(1)].clone();
        }
        let span = self.times[after] - self.times[after - 1];
        let u = (t - self.times[after - 1]) / span;
        mix(&self.smooth[after - 1], &self.smooth[after], u)
    }

    pub(super) fn mean(&self, from: f64, to: f64) -> Pose {
        let mut pose = vec![[0.0; 3]; self.smooth[0].len()];
        const STEPS: usize = 200;
        for k in 0..STEPS {
            let t = from + (to - from) * (k as f64 + 0.5) / STEPS as f64;
            add(&mut pose, &self.at(t), 1.0 / STEPS as f64);
        }
        pose
    }
}

pub(super) fn add(pose: &mut [[f64; 3]], other: &[[f64; 3]], weight: f64) {
    for (a, b) in pose.iter_mut().zip(other) {
        for axis in 0..3 {
            a[axis] += weight * b[axis];
        }
    }
}

pub(super) fn scale(pose: &mut [[f64; 3]], factor: f64) {
    for value in pose.as_flattened_mut() {
        *value *= factor;
    }
}

pub(super) fn mix(a: &[[f64; 3]], b: &[[f64; 3]], u: f64) -> Pose {
    let mut pose = a.to_vec();
    scale(&mut pose, 1.0 - u);
    add(&mut pose, b, u);
    pose
}

/// The pose a share `u` of the way from `a` to `b`: place, yaw and shape each go their own way.
pub(super) fn blend(header: &PoseHeader, a: &[[f64; 3]], b: &[[f64; 3]], u: f64) -> Pose {
    let fit = match GlobalFit::new(header, a, &GlobalOptions::default()) {
        Ok(fit) if header.points.len() >= 3 => fit,
        // One or two points are no body that could turn.
        _ => return mix(a, b, u),
    };
    let mut turned = b.to_vec();
    let motion = fit.remove(b, None, &mut turned);
    // `turned` lies on `a` but for its shape; where b's height was kept it still has it.
    let mut pose = mix(a, &turned, u);
    let body = fit.body(&pose);
    let (sin, cos) = (u * motion.yaw_rad).sin_cos();
    let rise = u * fit.removed_rise(b);
    for place in &mut pose {
        let (x, z) = (place[0] - body[0], place[2] - body[2]);
        *place = [
            x * cos + z * sin + body[0] + u * motion.x_m,
            place[1] + rise,
            z * cos - x * sin + body[2] + u * motion.z_m,
        ];
    }
    pose
}

pub(super) fn smooth_step(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}
