//! Two-bone inverse kinematics in closed form, with a foot that turns when the ankle does not reach.

use super::STRAIGHT;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Turns of a leg, in the travelling frame.
pub(super) struct Bend {
    /// Of everything below the hip, after the knee was bent.
    pub hip: UnitQuaternion<f64>,
    /// Of everything below the knee, before the hip turns.
    pub knee: UnitQuaternion<f64>,
    /// Of the foot, from how it stood.
    pub foot: UnitQuaternion<f64>,
}

/// Two-bone inverse kinematics in closed form. `chain`: hip, knee, ankle; `straight`: the knee's axis
/// where the leg is straight.
///
/// The law of cosines gives the angle at the knee; the hip then turns the ankle into its direction by the
/// shortest way, so the plane of the leg is kept as far as can be.
pub(super) fn reach(
    [hip, knee, ankle]: [Vector3<f64>; 3],
    toe: Vector3<f64>,
    goal: Vector3<f64>,
    straight: Vector3<f64>,
) -> Bend {
    let (u, v, sole) = (hip - knee, ankle - knee, toe - ankle);
    let (thigh, shank) = (u.norm(), v.norm());
    let (near, far) = ((thigh - shank).abs(), thigh + shank);
    let mut target = goal - sole;
    let apart = (target - hip).norm();
    let mut foot = UnitQuaternion::identity();
    if !(near..=far).contains(&apart) && sole.norm() > 1e-9 {
        target = turn_foot(hip, apart.clamp(near, far), target, sole.norm(), goal);
        foot = shortest(sole, goal - target);
    }
    let cross = u.cross(&v);
    let axis = if cross.norm() > STRAIGHT * thigh * shank {
        cross.normalize()
    } else {
        straight
    };
    let apart = (target - hip).norm().clamp(near, far);
    let cosine = (thigh * thigh + shank * shank - apart * apart) / (2.0 * thigh * shank);
    let wanted = cosine.clamp(-1.0, 1.0).acos();
    let present = cross.dot(&axis).atan2(u.dot(&v));
    let bend = UnitQuaternion::from_scaled_axis(axis * (wanted - present));
    let bent = knee + bend * v - hip;
    Bend {
        hip: shortest(bent, target - hip),
        knee: bend,
        foot,
    }
}

/// Where the ankle goes so that it is `apart` from the hip and `sole` from the goal, on the side of
/// `wish`; as near as can be where the two spheres do not meet.
fn turn_foot(
    hip: Vector3<f64>,
    apart: f64,
    wish: Vector3<f64>,
    sole: f64,
    goal: Vector3<f64>,
) -> Vector3<f64> {
    let way = goal - hip;
    let distance = way.norm().max(1e-9);
    let along = way / distance;
    let cosine = (apart * apart + distance * distance - sole * sole) / (2.0 * apart * distance);
    let cosine = if cosine.is_finite() {
        cosine.clamp(-1.0, 1.0)
    } else {
        1.0
    };
    let aside = (wish - hip) - along * (wish - hip).dot(&along);
    let aside = aside.try_normalize(1e-9).unwrap_or_else(|| across(along));
    hip + apart * (along * cosine + aside * (1.0 - cosine * cosine).sqrt())
}

/// Any unit vector across `v`.
fn across(v: Vector3<f64>) -> Vector3<f64> {
    let other = if v.x.abs() < 0.7 * v.norm() {
        Vector3::x()
    } else {
        Vector3::y()
    };
    v.cross(&other).normalize()
}

/// The shortest rotation from the direction of `a` to that of `b`, exact for small angles too.
fn shortest(a: Vector3<f64>, b: Vector3<f64>) -> UnitQuaternion<f64> {
    let size = a.norm() * b.norm();
    if !(size > 1e-18) {
        return UnitQuaternion::identity();
    }
    let real = size + a.dot(&b);
    if real < 1e-9 * size {
        return UnitQuaternion::from_axis_angle(
            &nalgebra::Unit::new_normalize(across(a)),
            std::f64::consts::PI,
        );
    }
    UnitQuaternion::new_normalize(Quaternion::from_parts(real, a.cross(&b)))
}
