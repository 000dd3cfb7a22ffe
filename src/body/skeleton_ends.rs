//! Feet and hands of a skeleton: chains of ball joints, and how to put their ends somewhere.

use super::{Feet, Skeleton};
use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
use std::sync::Arc;

/// Limbs of a skeleton as [`Feet`]: the end of a limb is a joint, its leg the joints above it.
#[derive(Clone, Debug)]
pub struct SkeletonEnds {
    skeleton: Arc<Skeleton>,
    limbs: Vec<Limb>,
}

#[derive(Clone, Debug)]
struct Limb {
    name: String,
    /// The joint that stands on the ground.
    end: usize,
    /// Joints that are turned, from the end towards the root.
    joints: Vec<usize>,
    reach_m: f64,
}

/// Rounds at most, and the distance that counts as there, metres.
const ROUNDS: usize = 50;
const TOLERANCE_M: f64 = 1e-7;
/// Damping as a part of the squared reach. It stays: near a stretched limb an exact way there would swing the joints,
/// a damped one stops a little short.
const DAMPING: f64 = 3e-3;

impl SkeletonEnds {
    /// No limb yet.
    pub fn new(skeleton: Arc<Skeleton>) -> Self {
        Self {
            skeleton,
            limbs: Vec::new(),
        }
    }

    /// Adds the limb `name` that ends in joint `end` and is moved by the `joints` joints above it.
    ///
    /// `None` when the skeleton has no such joint or not so many above it.
    #[must_use]
    pub fn with_limb(mut self, name: &str, end: &str, joints: usize) -> Option<Self> {
        let end = self.skeleton.joint(end)?;
        let mut at = end;
        let mut moved = Vec::new();
        let mut reach_m = 0.0;
        for _ in 0..joints {
            reach_m += Vector3::from(self.skeleton.joints[at].offset_m).norm();
            at = self.skeleton.joints[at].parent?;
            moved.push(at);
        }
        if moved.is_empty() {
            return None;
        }
        self.limbs.push(Limb {
            name: name.into(),
            end,
            joints: moved,
            reach_m,
        });
        Some(self)
    }
}

impl SkeletonEnds {
    /// The limbs called `names` alone.
    #[must_use]
    pub fn only(&self, names: &[&str]) -> Self {
        let mut limbs = self.limbs.clone();
        limbs.retain(|l| names.contains(&l.name.as_str()));
        Self {
            skeleton: Arc::clone(&self.skeleton),
            limbs,
        }
    }
}

impl Feet for SkeletonEnds {
    fn count(&self) -> usize {
        self.limbs.len()
    }

    fn name(&self, foot: usize) -> &str {
        &self.limbs[foot].name
    }

    fn position(&self, pose: &[f64], foot: usize) -> Point3<f64> {
        self.skeleton.position(pose, self.limbs[foot].end)
    }

    /// Damped least squares over ball joints: with lever `r` of the end about a joint, `J J^T` is
    /// `|r|^2 - r r^T` and the turn `r x y`. The shortest way, so a small correction bends all joints a
    /// little; hinges are not known to a skeleton.
    fn place(&self, pose: &mut [f64], foot: usize, goal: Point3<f64>) -> f64 {
        let limb = &self.limbs[foot];
        let mut damping = DAMPING * limb.reach_m * limb.reach_m;
        let mut left = (goal - self.position(pose, foot)).norm();
        for _ in 0..ROUNDS {
            if left < TOLERANCE_M {
                break;
            }
            let end = self.position(pose, foot);
            let mut normal = Matrix3::identity() * damping;
            for joint in &limb.joints {
                let r = end - self.skeleton.position(pose, *joint);
                normal += Matrix3::identity() * r.norm_squared() - r * r.transpose();
            }
            let Some(factor) = normal.cholesky() else {
                break;
            };
            let y = factor.solve(&(goal - end));
            self.turn(limb, pose, end, y, 1.0);
            let now = (goal - self.position(pose, foot)).norm();
            if now < left {
                left = now;
            } else {
                // Too far: back, and shorter.
                self.turn(limb, pose, end, y, -1.0);
                damping *= 10.0;
                if damping > 1e3 * limb.reach_m * limb.reach_m {
                    break;
                }
            }
        }
        left
    }

    fn shift(&self, pose: &mut [f64], way: Vector3<f64>) {
        for (coordinate, way) in pose[..3].iter_mut().zip(way.iter()) {
            *coordinate += way;
        }
    }

    fn reach_m(&self, foot: usize) -> f64 {
        self.limbs[foot].reach_m
    }
}

impl SkeletonEnds {
    /// Turns every joint of a limb by `sign * (r x y)`, from the end upwards, `r` from before any turn.
    fn turn(&self, limb: &Limb, pose: &mut [f64], end: Point3<f64>, y: Vector3<f64>, sign: f64) {
        // Going up, nothing above has turned yet, so places and frames of what is above are still those
        // of before; going back runs the other way.
        let apply = |joint: usize, pose: &mut [f64]| {
            let frame = self.skeleton.frame(pose, joint);
            let local = Skeleton::rotation(pose, joint);
            let parent = frame.rotation * local.inverse();
            let r = end - Point3::from(frame.translation.vector);
            let about = parent.inverse_transform_vector(&r.cross(&y).cap_magnitude(0.5));
            let mut turned = UnitQuaternion::from_scaled_axis(about * sign) * local;
            turned.renormalize();
            Skeleton::set_rotation(pose, joint, &turned);
        };
        if sign > 0.0 {
            limb.joints.iter().for_each(|j| apply(*j, pose));
        } else {
            limb.joints.iter().rev().for_each(|j| apply(*j, pose));
        }
    }
}
