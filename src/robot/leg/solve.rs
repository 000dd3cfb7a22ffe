//! Inverse kinematics of a leg: closed form where thigh and knee axes are parallel, damped least squares else.

use super::chain::Chain;
use nalgebra::{Matrix3, Point3, Vector3};
use std::f64::consts::TAU;

/// Residual that counts as met, metres.
pub(super) const MET_M: f64 = 1e-9;
/// Axes this far from parallel (sine) are still taken for parallel; Newton steps mend the rest.
const PARALLEL: f64 = 0.02;
/// How far a limit may be overstepped by rounding, rad.
const LIMIT_ROUNDING: f64 = 1e-9;

/// What the closed form needs, fixed for a leg: hip axis, then two parallel axes (abduction, thigh,
/// knee of a dog; coxa, femur, tibia of an insect).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Planar {
    /// Axis of the second joint in the frame of the moved first one.
    normal: Vector3<f64>,
    /// Where the leg plane lies along `normal`, from the first joint's origin, metres.
    plane: f64,
    /// Second joint to third, in the leg plane, second joint's frame.
    thigh: Vector3<f64>,
    /// Third joint to foot at third position zero, in the leg plane, second joint's frame.
    shank: Vector3<f64>,
    /// +1 or -1: sense of the third axis along the second.
    sense: f64,
}

impl Planar {
    /// `None` when the leg is not of that build.
    pub fn of(chain: &Chain) -> Option<Self> {
        let [hip, thigh, knee] = chain.steps.as_slice() else {
            return None;
        };
        let own = chain
            .steps
            .iter()
            .enumerate()
            .all(|(i, s)| s.driver == i && !s.slides && s.scale == 1.0 && s.offset == 0.0);
        if !own {
            return None;
        }
        let axis = thigh.axis.into_inner();
        let knee_axis = knee.before.rotation * knee.axis.into_inner();
        let normal = thigh.before.rotation * axis;
        if axis.cross(&knee_axis).norm() > PARALLEL || hip.axis.cross(&normal).norm() < 0.1 {
            return None;
        }
        let flat = |v: Vector3<f64>| v - axis * axis.dot(&v);
        let to_knee = knee.before.translation.vector;
        let to_foot = knee.before.rotation * chain.tail.coords;
        Some(Self {
            normal,
            plane: normal.dot(&thigh.before.translation.vector)
                + axis.dot(&to_knee)
                + axis.dot(&to_foot),
            thigh: flat(to_knee),
            shank: flat(to_foot),
            sense: axis.dot(&knee_axis).signum(),
        })
    }

    /// Lengths of thigh and shank in the leg plane, metres.
    pub fn lengths(&self) -> (f64, f64) {
        (self.thigh.norm(), self.shank.norm())
    }

    /// Up to four solutions, angles not yet brought near a reference or into limits.
    ///
    /// The first angle turns the leg plane so that it holds the goal: with g the goal from the first
    /// joint, n . R(-q) g = plane is A cos q + B sin q = rest. In the plane the law of cosines gives
    /// the knee, the direction of the goal the thigh.
    fn candidates(&self, chain: &Chain, goal: Point3<f64>, out: &mut [[f64; 3]; 4]) -> usize {
        let [hip, thigh, _] = chain.steps.as_slice() else {
            return 0;
        };
        let g = hip.before.inverse_transform_point(&goal).coords;
        let a = hip.axis.into_inner();
        let along = a * a.dot(&g);
        let (cos_part, sin_part) = (
            self.normal.dot(&(g - along)),
            -self.normal.dot(&a.cross(&g)),
        );
        let size = cos_part.hypot(sin_part);
        let rest = self.plane - self.normal.dot(&along);
        if size < 1e-12 || rest.abs() > size {
            return 0;
        }
        let (middle, half) = (sin_part.atan2(cos_part), (rest / size).acos());
        let (l1, l2) = self.lengths();
        let axis = thigh.axis.into_inner();
        // Signed angle from v to w about the second axis.
        let angle = |v: &Vector3<f64>, w: &Vector3<f64>| axis.dot(&v.cross(w)).atan2(v.dot(w));
        let bent = angle(&self.thigh, &self.shank);
        let mut count = 0;
        for q0 in [middle + half, middle - half] {
            let turned = nalgebra::UnitQuaternion::from_axis_angle(&hip.axis, -q0) * g;
            let y = thigh
                .before
                .inverse_transform_point(&Point3::from(turned))
                .coords;
            let y = y - axis * axis.dot(&y);
            let k = (y.norm_squared() - l1 * l1 - l2 * l2) / (2.0 * l1 * l2);
            if !(k.abs() <= 1.0 + 1e-12) {
                continue;
            }
            let knee = k.clamp(-1.0, 1.0).acos();
            for beta in [knee - bent, -knee - bent] {
                let shank =
                    nalgebra::UnitQuaternion::from_axis_angle(&thigh.axis, beta) * self.shank;
                let q1 = angle(&(self.thigh + shank), &y);
                out[count] = [q0, q1, self.sense * beta];
                count += 1;
            }
        }
        count
    }

    /// Every solution inside the limits, each angle by whole turns as near to `near` as the limits allow.
    pub fn solutions(
        &self,
        chain: &Chain,
        goal: Point3<f64>,
        near: &[f64; 3],
        out: &mut [[f64; 3]; 4],
    ) -> usize {
        let mut raw = [[0.0; 3]; 4];
        let found = self.candidates(chain, goal, &mut raw);
        let mut count = 0;
        for mut q in raw.into_iter().take(found) {
            // Axes that are parallel only nearly: mend before the limits are judged.
            polish(chain, goal, &mut q);
            let fits = (0..3).all(|i| {
                q[i] = nearest_turn(q[i], near[i], chain.limits[i]);
                let (lower, upper) = chain.limits[i];
                let inside = q[i] >= lower - LIMIT_ROUNDING && q[i] <= upper + LIMIT_ROUNDING;
                q[i] = q[i].clamp(lower, upper);
                inside
            });
            if fits {
                out[count] = q;
                count += 1;
            }
        }
        count
    }
}

/// `q` plus whole turns, nearest to `near`, inside the limits if any such is.
fn nearest_turn(q: f64, near: f64, (lower, upper): (f64, f64)) -> f64 {
    let mut best = q + TAU * ((near - q) / TAU).round();
    if best > upper + LIMIT_ROUNDING {
        best -= TAU * ((best - upper) / TAU).ceil();
    } else if best < lower - LIMIT_ROUNDING {
        best += TAU * ((lower - best) / TAU).ceil();
    }
    best
}

/// A few Newton steps towards the goal, limits not minded.
fn polish(chain: &Chain, goal: Point3<f64>, q: &mut [f64; 3]) {
    for _ in 0..4 {
        if (goal - chain.foot(q)).norm() < MET_M {
            return;
        }
        let (foot, jacobian) = chain.jacobian(q);
        let Some(step) = jacobian.lu().solve(&(goal - foot)) else {
            return;
        };
        // Near a stretched leg a Newton step may be wild; what follows judges the result.
        if !(step.amax() < 0.1) {
            return;
        }
        for i in 0..3 {
            q[i] += step[i];
        }
    }
}

/// Damped least squares from `q`, clamped to the limits in each of at most 200 rounds. Residual, metres.
pub(super) fn descend(chain: &Chain, goal: Point3<f64>, q: &mut [f64; 3]) -> f64 {
    let mut damping = 1e-6;
    for (q, (lower, upper)) in q.iter_mut().zip(chain.limits) {
        *q = q.clamp(lower, upper);
    }
    let mut error = goal - chain.foot(q);
    for _ in 0..200 {
        if error.norm() < MET_M {
            break;
        }
        let (_, jacobian) = chain.jacobian(q);
        let normal = jacobian.transpose() * jacobian + Matrix3::identity() * damping;
        let Some(step) = normal
            .cholesky()
            .map(|c| c.solve(&(jacobian.transpose() * error)))
        else {
            break;
        };
        let mut next = *q;
        for i in 0..3 {
            let (lower, upper) = chain.limits[i];
            next[i] = (q[i] + step[i].clamp(-0.5, 0.5)).clamp(lower, upper);
        }
        let new_error = goal - chain.foot(&next);
        if new_error.norm() < error.norm() {
            damping = (damping * 0.3).max(1e-12);
            *q = next;
            error = new_error;
        } else {
            damping = damping.max(1e-9) * 10.0;
            if damping > 1e3 {
                break;
            }
        }
    }
    error.norm()
}
