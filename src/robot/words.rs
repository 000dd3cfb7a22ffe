//! Which way a joint moves, in words for a person who stands before the robot.

use super::model::{JointKind, RobotModel};
use nalgebra::Vector3;

/// The axes of a robot (x forward, y left, z up), and the words for both ways along each.
const WAYS: [(&str, &str); 3] = [("forward", "back"), ("left", "right"), ("up", "down")];
/// A way along an axis smaller than this share of the largest is not mentioned.
const WORTH_SAYING: f64 = 0.5;
/// What is nearer than a centimetre to a joint's axis is not seen to turn about it, metres.
const WORTH_SEEING_M: f64 = 0.01;

impl RobotModel {
    /// What the positive direction of moving joint number `index` (model order) does, seen from the robot (x
    /// forward, y left, z up) with all joints at `positions`: `its far end (link "foot") goes back and up`, or for
    /// a joint that turns on the spot `it turns about the robot's forward axis, like a right hand's screw`.
    ///
    /// Empty for an index without joint.
    pub fn positive_way(&self, index: usize, positions: &[f64]) -> String {
        let Some(&j) = self.actuated.get(index) else {
            return String::new();
        };
        let joint = &self.joints[j];
        let frame = self.link_pose(joint.parent, positions) * joint.origin;
        let axis = frame.rotation * joint.axis.into_inner();
        if joint.kind == JointKind::Prismatic {
            return format!("it slides {}", words(&axis));
        }
        let centre = frame.translation.vector;
        let furthest = self.furthest(j, &centre, &axis, positions);
        let (length, way, link) = furthest;
        if length < WORTH_SEEING_M {
            return format!(
                "it turns as a screw does that goes {} into a nut, clockwise when seen along that way",
                words(&axis)
            );
        }
        format!("its far end ({}) goes {}", self.links[link], words(&way))
    }

    /// Where the far end of moving joint number `index` is from that joint, seen from the robot with all joints at
    /// `positions`: `its far end (end_effector_link) is 34 cm forward and 13 cm up from it`.
    ///
    /// Empty for an index without joint, and where nothing hangs on it that one could see turn.
    pub fn far_end(&self, index: usize, positions: &[f64]) -> String {
        let Some(&j) = self.actuated.get(index) else {
            return String::new();
        };
        let frame = self.link_pose(self.joints[j].parent, positions) * self.joints[j].origin;
        let centre = frame.translation.vector;
        let axis = frame.rotation * self.joints[j].axis.into_inner();
        let (length, way, link) = self.furthest(j, &centre, &axis, positions);
        if length < WORTH_SEEING_M || self.joints[j].kind == JointKind::Prismatic {
            return String::new();
        }
        // The way is across the arm from the joint; the arm itself is where the link is.
        let arm = self.link_pose(link, positions).translation.vector - centre;
        let arm = match arm.norm() > WORTH_SEEING_M {
            true => arm,
            false => way.cross(&axis),
        };
        let parts: Vec<String> = arm
            .iter()
            .zip(WAYS)
            .filter(|(x, _)| x.abs() >= WORTH_SEEING_M)
            .map(|(x, (plus, minus))| {
                let word = if *x > 0.0 { plus } else { minus };
                format!("{:.0} cm {word}", 100.0 * x.abs())
            })
            .collect();
        format!(
            "its far end ({}) is {} from it",
            self.links[link],
            parts.join(" and ")
        )
    }

    /// The point of what hangs on joint `j` that goes furthest when it turns about `axis` through `centre`: how far a
    /// radian, which way, on which link.
    fn furthest(
        &self,
        j: usize,
        centre: &Vector3<f64>,
        axis: &Vector3<f64>,
        positions: &[f64],
    ) -> (f64, Vector3<f64>, usize) {
        let mut furthest = (0.0, Vector3::zeros(), self.joints[j].child);
        for link in 0..self.links.len() {
            if !self.hangs_on(link, j) {
                continue;
            }
            let pose = self.link_pose(link, positions);
            let tip = self.tips.get(link).copied().flatten();
            let points = [
                Some(pose.translation.vector),
                tip.map(|t| (pose * t).coords),
            ];
            for point in points.into_iter().flatten() {
                let way = axis.cross(&(point - centre));
                if way.norm() > furthest.0 + 1e-6 {
                    furthest = (way.norm(), way, link);
                }
            }
        }
        furthest
    }

    /// Whether `link` moves when joint `j` does.
    fn hangs_on(&self, link: usize, j: usize) -> bool {
        let mut at = link;
        while let Some(above) = self.parent_joint[at] {
            if above == j {
                return true;
            }
            at = self.joints[above].parent;
        }
        false
    }
}

/// The way along `v` in words, the largest first: `forward and up`.
fn words(v: &Vector3<f64>) -> String {
    let largest = v.amax();
    let mut parts: Vec<(f64, &str)> = v
        .iter()
        .zip(WAYS)
        .filter(|(x, _)| x.abs() > WORTH_SAYING * largest)
        .map(|(x, (plus, minus))| (x.abs(), if *x > 0.0 { plus } else { minus }))
        .collect();
    parts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let parts: Vec<&str> = parts.into_iter().map(|(_, word)| word).collect();
    parts.join(" and ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arm_is_described_as_one_sees_it() {
        let urdf = include_str!("../../configs/robots/open_manipulator_x.urdf");
        let model = RobotModel::from_urdf(urdf).expect("shipped URDF");
        let rest = vec![0.0; model.actuated.len()];
        let ways: Vec<String> = (0..5).map(|j| model.positive_way(j, &rest)).collect();
        // The arm lies forward at zero; joint 1 turns about the vertical, joints 2 to 4 pitch it down.
        assert!(ways[0].ends_with("goes left"), "{ways:?}");
        for way in &ways[1..4] {
            assert!(way.contains("goes") && way.contains("down"), "{ways:?}");
        }
        assert!(
            ways[4].contains("screw") && ways[4].contains("forward"),
            "{ways:?}"
        );
        assert_eq!(model.positive_way(9, &rest), "");
        let place = model.far_end(1, &rest);
        assert!(
            place.contains("cm forward") && place.contains("end_effector_link"),
            "{place}"
        );
        assert_eq!(model.far_end(4, &rest), "", "a crank shows nothing");
    }
}
