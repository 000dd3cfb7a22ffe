//! The root of a body: where it is on the ground, and how far it travels.

use nalgebra::{Point2, Point3};
use serde::{Deserialize, Serialize};

/// How far the body travels, in its own frame: a constant twist, so that a turn makes an arc.
#[derive(Copy, Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RootAdvance {
    /// Metres forwards.
    pub forward_m: f64,
    /// Metres to the left.
    pub left_m: f64,
    /// Radians counter-clockwise seen from above.
    pub yaw_rad: f64,
}

impl RootAdvance {
    /// The part `share` of the advance, along the same arc.
    pub fn scaled(self, share: f64) -> Self {
        Self {
            forward_m: share * self.forward_m,
            left_m: share * self.left_m,
            yaw_rad: share * self.yaw_rad,
        }
    }

    /// Adds `weight` times `other`: root motion is blended in the body's frame.
    pub fn add(&mut self, other: Self, weight: f64) {
        self.forward_m += weight * other.forward_m;
        self.left_m += weight * other.left_m;
        self.yaw_rad += weight * other.yaw_rad;
    }
}

/// A place on the ground and a heading: the travelling frame (x forward, y left, z up, on the ground).
#[derive(Copy, Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RootPose {
    /// Metres, in the direction the body first faced.
    pub x_m: f64,
    /// Metres to the left of it.
    pub y_m: f64,
    /// Heading, rad, counter-clockwise; not wrapped.
    pub yaw_rad: f64,
}

impl RootPose {
    /// Travels along `advance`, exactly: the exponential of its twist in SE(2).
    pub fn travel(&mut self, advance: RootAdvance) {
        let angle = advance.yaw_rad;
        // sin(a)/a and (1-cos(a))/a, by their series where the quotients lose digits.
        let (s, c) = if angle.abs() < 1e-4 {
            (1.0 - angle * angle / 6.0, 0.5 * angle)
        } else {
            (angle.sin() / angle, (1.0 - angle.cos()) / angle)
        };
        let forward = s * advance.forward_m - c * advance.left_m;
        let left = c * advance.forward_m + s * advance.left_m;
        let (sin, cos) = self.yaw_rad.sin_cos();
        self.x_m += cos * forward - sin * left;
        self.y_m += sin * forward + cos * left;
        self.yaw_rad += angle;
    }

    /// The twist that leads from `self` to `to`: `self.travel(self.advance_to(to)) = to`.
    pub fn advance_to(&self, to: &Self) -> RootAdvance {
        let angle = to.yaw_rad - self.yaw_rad;
        let way = self.to_local(Point3::new(to.x_m, to.y_m, 0.0));
        let (s, c) = if angle.abs() < 1e-4 {
            (1.0 - angle * angle / 6.0, 0.5 * angle)
        } else {
            (angle.sin() / angle, (1.0 - angle.cos()) / angle)
        };
        // The inverse of the 2x2 matrix in `travel`.
        let d = (s * s + c * c).max(1e-12);
        RootAdvance {
            forward_m: (s * way.x + c * way.y) / d,
            left_m: (s * way.y - c * way.x) / d,
            yaw_rad: angle,
        }
    }

    /// A point of the travelling frame in the world.
    pub fn to_world(&self, p: Point3<f64>) -> Point3<f64> {
        let (sin, cos) = self.yaw_rad.sin_cos();
        Point3::new(
            self.x_m + cos * p.x - sin * p.y,
            self.y_m + sin * p.x + cos * p.y,
            p.z,
        )
    }

    /// A point of the world in the travelling frame.
    pub fn to_local(&self, p: Point3<f64>) -> Point3<f64> {
        let (sin, cos) = self.yaw_rad.sin_cos();
        let way = Point2::new(p.x - self.x_m, p.y - self.y_m);
        Point3::new(cos * way.x + sin * way.y, cos * way.y - sin * way.x, p.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_quarter_arc_ends_where_the_circle_says() {
        let mut root = RootPose::default();
        let quarter = std::f64::consts::FRAC_PI_2;
        root.travel(RootAdvance {
            forward_m: quarter,
            left_m: 0.0,
            yaw_rad: quarter,
        });
        let error = (root.x_m - 1.0).abs().max((root.y_m - 1.0).abs());
        assert!(
            error < 1e-12,
            "{root:?} is {error} m off a circle of radius 1"
        );
    }

    proptest! {
        #[test]
        fn ways_add_up_and_can_be_taken_back(
            f in -1.0..1.0f64, l in -1.0..1.0f64, a in -3.0..3.0f64, x in -5.0..5.0f64, yaw in -9.0..9.0f64,
        ) {
            let start = RootPose { x_m: x, y_m: -0.3 * x, yaw_rad: yaw };
            let advance = RootAdvance { forward_m: f, left_m: l, yaw_rad: a };
            let mut whole = start;
            whole.travel(advance);
            let mut parts = start;
            for _ in 0..10 {
                parts.travel(advance.scaled(0.1));
            }
            let off = (whole.x_m - parts.x_m).hypot(whole.y_m - parts.y_m);
            prop_assert!(off < 1e-9, "ten parts end {} m from the whole", off);
            let back = start.advance_to(&whole);
            let wrong = (back.forward_m - f).abs().max((back.left_m - l).abs());
            prop_assert!(wrong < 1e-9, "advance {} m off", wrong);
            let p = Point3::new(0.3, -0.7, 0.2);
            prop_assert!((whole.to_local(whole.to_world(p)) - p).norm() < 1e-12);
        }
    }
}
