//! The pose space of a skeleton: the root's place over the ground and one rotation per joint.

use super::{Part, PoseSpace, Skeleton};
use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use std::sync::Arc;

/// Poses of a skeleton: the root joint's place in the travelling frame (m), then per joint its rotation
/// in the parent's frame as a unit quaternion (x, y, z, w).
///
/// `blend` is the normalised sum of quaternions brought to one hemisphere: exact at the corners,
/// independent of order, within a degree of the logarithmic mean for rotations up to a right angle apart.
/// Differences are rotation vectors in the parent's frame. The embedding is the place of every joint.
#[derive(Clone, Debug)]
pub struct SkeletonSpace {
    skeleton: Arc<Skeleton>,
    parts: Vec<Part>,
    rest: Vec<f64>,
}

/// Name of the part that holds the root joint's place.
const ROOT: &str = "root";

impl SkeletonSpace {
    /// The space of `skeleton`. At rest the root stands so that the lowest joint touches the ground.
    pub fn new(skeleton: Arc<Skeleton>) -> Self {
        let mut parts = vec![Part {
            name: ROOT.into(),
            coordinates: 0..3,
            tangent: 0..3,
        }];
        for (i, joint) in skeleton.joints.iter().enumerate() {
            parts.push(Part {
                name: joint.name.clone(),
                coordinates: 3 + 4 * i..7 + 4 * i,
                tangent: 3 + 3 * i..6 + 3 * i,
            });
        }
        let mut rest = skeleton.rest_pose([0.0; 3]);
        let mut frames = vec![Isometry3::identity(); skeleton.len()];
        skeleton.frames(&rest, &mut frames);
        let lowest = frames
            .iter()
            .map(|f| f.translation.z)
            .fold(f64::INFINITY, f64::min);
        rest[2] = -lowest;
        Self {
            skeleton,
            parts,
            rest,
        }
    }

    /// The skeleton.
    pub fn skeleton(&self) -> &Arc<Skeleton> {
        &self.skeleton
    }
}

impl PoseSpace for SkeletonSpace {
    fn len(&self) -> usize {
        self.skeleton.coordinates()
    }

    fn tangent_len(&self) -> usize {
        3 + 3 * self.skeleton.len()
    }

    fn features(&self) -> usize {
        3 * self.skeleton.len()
    }

    fn parts(&self) -> &[Part] {
        &self.parts
    }

    fn rest(&self, out: &mut [f64]) {
        out.copy_from_slice(&self.rest);
    }

    fn blend(&self, poses: &[f64], weights: &[f64], out: &mut [f64]) {
        let len = self.len();
        // The heaviest pose decides the hemisphere, so that the order does not matter.
        let heaviest = (weights.iter().enumerate())
            .max_by(|a, b| a.1.total_cmp(b.1))
            .map_or(0, |(i, _)| i);
        let reference = &poses[heaviest * len..(heaviest + 1) * len];
        out[..3].fill(0.0);
        for (pose, weight) in poses.chunks_exact(len).zip(weights) {
            if *weight != 0.0 {
                for (out, place) in out[..3].iter_mut().zip(pose) {
                    *out += weight * place;
                }
            }
        }
        // Joint by joint: the sum stays in registers.
        for (at, out) in (3..).step_by(4).zip(out[3..].chunks_exact_mut(4)) {
            let r = &reference[at..at + 4];
            let mut sum = [0.0; 4];
            for (pose, weight) in poses.chunks_exact(len).zip(weights) {
                if *weight == 0.0 {
                    continue;
                }
                let q = &pose[at..at + 4];
                let dot = q[0] * r[0] + q[1] * r[1] + q[2] * r[2] + q[3] * r[3];
                let weight = weight.copysign(dot);
                for i in 0..4 {
                    sum[i] += weight * q[i];
                }
            }
            let squared = sum.iter().map(|v| v * v).sum::<f64>();
            if squared > 1e-18 {
                let scale = 1.0 / squared.sqrt();
                for (out, v) in out.iter_mut().zip(sum) {
                    *out = scale * v;
                }
            } else {
                // They cancel out.
                out.copy_from_slice(r);
            }
        }
    }

    fn diff(&self, a: &[f64], b: &[f64], out: &mut [f64]) {
        for i in 0..3 {
            out[i] = b[i] - a[i];
        }
        for joint in 0..self.skeleton.len() {
            let turn = Skeleton::rotation(a, joint).inverse() * Skeleton::rotation(b, joint);
            out[3 + 3 * joint..6 + 3 * joint].copy_from_slice(turn.scaled_axis().as_slice());
        }
    }

    fn add(&self, pose: &mut [f64], difference: &[f64], scale: f64) {
        for i in 0..3 {
            pose[i] += scale * difference[i];
        }
        for joint in 0..self.skeleton.len() {
            let v = &difference[3 + 3 * joint..6 + 3 * joint];
            if v == [0.0; 3] {
                continue;
            }
            let turn = UnitQuaternion::from_scaled_axis(scale * Vector3::new(v[0], v[1], v[2]));
            let mut turned = Skeleton::rotation(pose, joint) * turn;
            turned.renormalize();
            Skeleton::set_rotation(pose, joint, &turned);
        }
    }

    /// Without logarithms where the whole way or its opposite is added, as layers do.
    fn add_way(
        &self,
        pose: &mut [f64],
        from: &[f64],
        to: &[f64],
        scale: f64,
        difference: &mut [f64],
    ) {
        if scale.abs() != 1.0 {
            self.diff(from, to, difference);
            self.add(pose, difference, scale);
            return;
        }
        for i in 0..3 {
            pose[i] += scale * (to[i] - from[i]);
        }
        let quaternion = |q: &[f64]| Quaternion::new(q[3], q[0], q[1], q[2]);
        let joints = pose[3..].chunks_exact_mut(4);
        let ways = from[3..].chunks_exact(4).zip(to[3..].chunks_exact(4));
        for (out, (from, to)) in joints.zip(ways) {
            let way = quaternion(from).conjugate() * quaternion(to);
            let way = if scale > 0.0 { way } else { way.conjugate() };
            let turned = quaternion(out) * way;
            // Splines leave quaternions a little off length one.
            let length = 1.0 / turned.norm().max(1e-9);
            for (out, v) in out.iter_mut().zip(turned.coords.iter()) {
                *out = length * v;
            }
        }
    }

    fn embed(&self, pose: &[f64], out: &mut [f64]) {
        // Frames of parents are needed below them; walking up for each joint needs no memory.
        for joint in 0..self.skeleton.len() {
            let at = self.skeleton.position(pose, joint);
            out[3 * joint..3 * joint + 3].copy_from_slice(at.coords.as_slice());
        }
    }

    fn points(&self) -> usize {
        self.skeleton.len()
    }

    /// How high it stands at rest.
    fn size_m(&self) -> f64 {
        let height = |joint| self.skeleton.position(&self.rest, joint).z;
        (0..self.skeleton.len()).map(height).fold(0.0, f64::max)
    }
}
