//! What the limits of a URDF are worth, and other ones in their place.

use super::model::{ABSURD_VELOCITY_RAD_S, Joint, JointKind, ModelError, RobotModel};

/// A revolute joint with more room than this is not kept off anything by its limits: one turn.
const ODD_SPAN_RAD: f64 = 6.3;

impl RobotModel {
    /// Joints that move whose velocity limit is a placeholder.
    pub fn placeholder_velocities(&self) -> Vec<&Joint> {
        self.actuated
            .iter()
            .map(|j| &self.joints[*j])
            .filter(|j| j.limits.is_some_and(|l| l.velocity > ABSURD_VELOCITY_RAD_S))
            .collect()
    }

    /// Turning joints whose position limits leave more than a turn, so that they keep it off nothing.
    pub fn wide_ranges(&self) -> Vec<&Joint> {
        self.actuated
            .iter()
            .map(|j| &self.joints[*j])
            .filter(|j| {
                let span = j.limits.map_or(0.0, |l| l.upper - l.lower);
                j.kind == JointKind::Revolute && span > ODD_SPAN_RAD
            })
            .collect()
    }

    /// No joint may be faster than `velocity` (rad/s, above 0).
    pub fn cap_velocity(&mut self, velocity: f64) {
        for limits in self.joints.iter_mut().filter_map(|j| j.limits.as_mut()) {
            limits.velocity = limits.velocity.min(velocity);
        }
    }

    /// Gives joint `name` other position limits. Legs found before keep the old ones.
    pub fn set_range(&mut self, name: &str, lower: f64, upper: f64) -> Result<(), ModelError> {
        let bad = |problem: String| ModelError::Joint {
            joint: name.into(),
            problem,
        };
        // Written so that NaN fails.
        if !(lower < upper) {
            return Err(bad(format!(
                "limits {lower}..{upper} leave no room to move"
            )));
        }
        let moving = self.joint_names();
        let limits = self
            .joints
            .iter_mut()
            .find(|j| j.name == name)
            .and_then(|j| j.limits.as_mut());
        let limits = limits.ok_or_else(|| {
            bad(format!(
                "is not a joint that moves; those are {}",
                moving.join(", ")
            ))
        })?;
        (limits.lower, limits.upper) = (lower, upper);
        Ok(())
    }

    /// Positions nearest to zero that the limits allow, in joint order.
    pub fn rest(&self) -> Vec<f64> {
        self.limits()
            .iter()
            .map(|l| 0.0_f64.clamp(l.lower, l.upper))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pup() -> RobotModel {
        RobotModel::from_urdf(include_str!("../../configs/robots/pup.urdf")).expect("shipped URDF")
    }

    #[test]
    fn wrong_ranges_are_refused_with_the_joints_to_choose_from() {
        let mut model = pup();
        for (joint, lower, upper, said) in [
            ("front_left_hipp", -1.0, 1.0, "front_left_hip,"),
            ("front_left_ankle", -1.0, 1.0, "not a joint that moves"),
            ("front_left_hip", 1.0, -1.0, "no room"),
            ("front_left_hip", f64::NAN, 1.0, "no room"),
        ] {
            let message = model
                .set_range(joint, lower, upper)
                .expect_err("wrong on purpose")
                .to_string();
            assert!(message.contains(said), "{joint}: {message}");
        }
    }

    #[test]
    fn limits_are_narrowed_and_rest_lies_inside() {
        let mut model = pup();
        model
            .set_range("front_left_knee", -2.0, -0.5)
            .expect("a knee");
        model.cap_velocity(3.0);
        let limits = model.limits();
        assert!(limits.iter().all(|l| l.velocity <= 3.0));
        assert_eq!(model.rest()[2], -0.5);
        assert!(model.wide_ranges().is_empty() && model.placeholder_velocities().is_empty());
        model.set_range("rear_left_hip", -4.0, 4.0).expect("a hip");
        assert_eq!(model.wide_ranges().len(), 1);
    }
}
