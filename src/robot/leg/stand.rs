//! Where a leg's foot stands when nothing is asked: below the hip, or out to the side.

use super::Leg;
use super::facing::Facing;
use nalgebra::{Point3, Vector3};

/// A foot's place in the body's frame: x forward, y left, z up, origin at the root link.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Standing {
    /// The foot on the ground, metres.
    pub foot: Point3<f64>,
    /// Body height that suits the leg, metres from foot to root link.
    pub body_height_m: f64,
}

/// Body height over hip to foot stretched, for legs below the body.
const HEIGHT_OF_LEG: f64 = 0.78;
/// Legs that sprawl: hip height over shank, and how far out the foot is beyond a level thigh, over
/// shank. The thigh then rises a little, as an insect's does.
const HEIGHT_OF_SHANK: f64 = 0.7;
/// See [`HEIGHT_OF_SHANK`].
const BEYOND_THIGH: f64 = 0.4;

impl Leg {
    /// Whether the first joint turns about the vertical (an insect's leg), not about the way ahead.
    pub fn sprawls(&self, facing: Facing) -> bool {
        let rest = self.chain.rest();
        let Some(step) = self.chain.steps.first() else {
            return false;
        };
        let axis = self.chain.joint_frame(0, &rest).rotation * step.axis.into_inner();
        (facing.rotation() * axis).z.abs() > 0.7
    }

    /// Where this foot stands by itself.
    pub fn standing(&self, facing: Facing) -> Standing {
        let rest = self.chain.rest();
        let turn = facing.rotation();
        let at = |i: usize| turn * self.chain.joint_frame(i, &rest).translation.vector;
        let (hip, thigh) = (at(0), at(1));
        let foot = turn * self.chain.foot(&rest).coords;
        if !self.sprawls(facing) {
            let body_height_m = HEIGHT_OF_LEG * self.length_m() - thigh.z;
            // Some models offset the leg plane further out, between the thigh joint and the shank.
            return Standing {
                foot: Point3::new(thigh.x, foot.y, -body_height_m),
                body_height_m,
            };
        }
        let (l1, l2) = self
            .planar
            .as_ref()
            .map_or((0.4 * self.length_m(), 0.6 * self.length_m()), |p| {
                p.lengths()
            });
        let axis = self
            .chain
            .steps
            .get(1)
            .map_or(Vector3::y(), |s| s.axis.into_inner());
        let across = turn * (self.chain.joint_frame(1, &rest).rotation * axis);
        let mut out = across.cross(&Vector3::z());
        out.z = 0.0;
        let away = thigh - hip;
        let sense = if away.xy().norm() > 1e-3 {
            out.dot(&away)
        } else {
            out.dot(&hip)
        };
        out *= sense.signum() / out.norm().max(1e-9);
        // The leg plane may lie beside the hip.
        let beside = across * across.dot(&(foot - thigh));
        let place = thigh + out * (l1 + BEYOND_THIGH * l2) + beside;
        let body_height_m = HEIGHT_OF_SHANK * l2 - thigh.z;
        Standing {
            foot: Point3::new(place.x, place.y, -body_height_m),
            body_height_m,
        }
    }

    /// How unlike the usual bend of the knee this solution is: 0 for a knee that points back (legs below
    /// the body) or up (legs that sprawl), 1 else.
    pub(super) fn odd_knee(&self, q: &[f64; 3], facing: Facing) -> f64 {
        let turn = facing.rotation();
        let at = |i: usize| turn * self.chain.joint_frame(i, q).translation.vector;
        let (hip, knee) = (at(1), at(2));
        let line = turn * self.chain.foot(q).coords - hip;
        let along = ((knee - hip).dot(&line) / line.norm_squared().max(1e-12)).clamp(0.0, 1.0);
        let off = knee - (hip + line * along);
        let usual = if self.sprawls(facing) {
            off.z >= -1e-9
        } else {
            off.x <= 1e-9
        };
        f64::from(u8::from(!usual))
    }
}
