//! The pose space of a robot: joint positions.

use super::PoseSpace;

/// Joint positions in radians (metres for prismatic joints).
///
/// Joints have limits and do not wrap, so the weighted mean of angles is the exact geodesic mean.
#[derive(Copy, Clone, Debug)]
pub struct JointSpace {
    joints: usize,
}

impl JointSpace {
    /// The space of `joints` joints.
    pub fn new(joints: usize) -> Self {
        Self { joints }
    }
}

impl PoseSpace for JointSpace {
    fn len(&self) -> usize {
        self.joints
    }

    fn blend(&self, poses: &[f64], weights: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (pose, weight) in poses.chunks_exact(self.joints.max(1)).zip(weights) {
            for (out, q) in out.iter_mut().zip(pose) {
                *out += weight * q;
            }
        }
    }

    fn diff(&self, a: &[f64], b: &[f64], out: &mut [f64]) {
        for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
            *out = b - a;
        }
    }

    fn add(&self, pose: &mut [f64], difference: &[f64], scale: f64) {
        for (q, d) in pose.iter_mut().zip(difference) {
            *q += scale * d;
        }
    }

    fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
        (sum / self.joints.max(1) as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blend_is_exact_at_the_corners_and_diff_undoes_add() {
        let space = JointSpace::new(2);
        let poses = [0.1, -0.4, 0.9, 0.3];
        let mut out = [0.0; 2];
        space.blend(&poses, &[0.0, 1.0], &mut out);
        assert_eq!(out, [0.9, 0.3]);
        let mut difference = [0.0; 2];
        space.diff(&poses[..2], &poses[2..], &mut difference);
        let mut pose = [0.1, -0.4];
        space.add(&mut pose, &difference, 1.0);
        assert!(space.distance(&pose, &poses[2..]) < 1e-15);
    }
}
