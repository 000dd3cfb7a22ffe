//! Finding the legs in the tree of a URDF.

use super::facing::Facing;
use super::{Leg, LegError};
use crate::robot::model::RobotModel;
use nalgebra::Point3;

/// A foot link nearer than this to its last joint does not tell where the ground is touched, metres.
const FOOT_AT_JOINT_M: f64 = 0.005;
/// Legs are alike when thigh and shank differ by less than this part.
const ALIKE: f64 = 0.05;

impl Leg {
    /// Finds four or six legs and which way the robot faces, as [`Leg::find_all_facing`] does.
    pub fn find_all(model: &RobotModel) -> Result<Vec<Self>, LegError> {
        Ok(Self::find_all_facing(model, None)?.0)
    }

    /// Finds four or six legs: ends of the tree below three moving joints of their own, all of one
    /// build, named by where their hips stand (`front_left`, `middle_left`, `rear_left`, ...).
    ///
    /// `facing`: when it is known; else it is read off the legs. Arms, heads and rotors do not
    /// disturb: they hang on other numbers of joints, or are not built like the legs.
    pub fn find_all_facing(
        model: &RobotModel,
        facing: Option<Facing>,
    ) -> Result<(Vec<Self>, Facing), LegError> {
        let is_parent = |link: usize| model.joints.iter().any(|j| j.parent == link);
        let ends: Vec<usize> = (0..model.links.len()).filter(|l| !is_parent(*l)).collect();
        let not_found = |found: String| LegError::NotFound {
            robot: model.name.clone(),
            found,
            links: ends
                .iter()
                .map(|l| {
                    let count = moving_joints_above(model, *l).len();
                    format!("{} ({count})", model.links[*l])
                })
                .collect::<Vec<_>>()
                .join(", "),
        };
        let mut legs: Vec<Leg> = Vec::new();
        for end in &ends {
            let Ok(joints) = <[usize; 3]>::try_from(moving_joints_above(model, *end).as_slice())
            else {
                continue;
            };
            let leg = Leg::new(model, String::new(), *end, Point3::origin(), joints);
            // Rotors and covers hang on the same joints; the foot is the farthest end.
            match legs.iter_mut().find(|l| l.joints == joints) {
                Some(known) if known.shank_m() < leg.shank_m() => *known = leg,
                Some(_) => {}
                None => legs.push(leg),
            }
        }
        let found = legs.len();
        let legs = alike(legs);
        if legs.len() != 4 && legs.len() != 6 {
            return Err(not_found(match found {
                0 => "no end of the tree lies below exactly three moving joints".into(),
                1 => "one end of the tree lies below exactly three moving joints".into(),
                n => format!(
                    "{n} ends of the tree lie below exactly three moving joints, {} of them alike",
                    legs.len()
                ),
            }));
        }
        let mut legs = legs
            .into_iter()
            .map(|leg| leg.with_tip(model))
            .collect::<Result<Vec<_>, _>>()?;
        let facing = facing.unwrap_or_else(|| Facing::of_legs(model, &legs));
        name_by_place(&mut legs, facing)
            .ok_or_else(|| not_found("they do not stand in two rows, left and right".into()))?;
        Ok((legs, facing))
    }

    /// Where the foot touches: the link's origin if that marks it, else the far end of its shape.
    pub(super) fn with_tip(self, model: &RobotModel) -> Result<Self, LegError> {
        if self.shank_m() > FOOT_AT_JOINT_M {
            return Ok(self);
        }
        let tip = model.tips.get(self.foot).copied().flatten();
        let tip = tip.ok_or_else(|| LegError::NoFoot {
            link: model.links[self.foot].clone(),
            leg: if self.name.is_empty() {
                "front_left".into()
            } else {
                self.name.clone()
            },
        })?;
        Ok(Leg::new(model, self.name, self.foot, tip, self.joints))
    }

    /// Third joint to foot, metres.
    fn shank_m(&self) -> f64 {
        self.chain.tail.coords.norm()
    }
}

/// The largest group of legs of one build that has four or six; all when there is none.
fn alike(legs: Vec<Leg>) -> Vec<Leg> {
    let build = |leg: &Leg| {
        let rest = leg.chain.rest();
        let at = |i| leg.chain.joint_frame(i, &rest).translation.vector;
        [(at(2) - at(1)).norm(), leg.shank_m()]
    };
    let near = |a: &Leg, b: &Leg| {
        build(a)
            .iter()
            .zip(build(b))
            .all(|(a, b)| (a - b).abs() <= ALIKE * a.max(b) + 1e-4)
    };
    let best = legs
        .iter()
        .map(|a| {
            legs.iter()
                .filter(|b| near(a, b))
                .cloned()
                .collect::<Vec<_>>()
        })
        .filter(|group| group.len() == 4 || group.len() == 6)
        .max_by_key(Vec::len);
    best.unwrap_or(legs)
}

/// Names the legs of each side from front to rear; `None` when the sides are not equal.
fn name_by_place(legs: &mut [Leg], facing: Facing) -> Option<()> {
    let turn = facing.rotation();
    let place = |leg: &Leg| {
        turn * leg
            .chain
            .joint_frame(0, &leg.chain.rest())
            .translation
            .vector
    };
    let rows: &[&str] = match legs.len() {
        4 => &["front", "rear"],
        _ => &["front", "middle", "rear"],
    };
    let middle = legs.iter().map(|l| place(l).y).sum::<f64>() / legs.len() as f64;
    legs.sort_by(|a, b| place(b).x.total_cmp(&place(a).x));
    for (side, left) in [("left", true), ("right", false)] {
        let mut count = 0;
        for leg in legs.iter_mut() {
            if (place(leg).y > middle) == left {
                leg.name = format!("{}_{side}", rows.get(count)?);
                count += 1;
            }
        }
        (count == rows.len()).then_some(())?;
    }
    let order = |leg: &Leg| {
        let row = rows.iter().position(|r| leg.name.starts_with(r));
        (row, leg.name.ends_with("right"))
    };
    legs.sort_by_key(order);
    Some(())
}

/// Moving joints between the root and `link` that have a drive of their own, from the root outwards,
/// as indices into the joint vector.
pub(super) fn moving_joints_above(model: &RobotModel, link: usize) -> Vec<usize> {
    let mut found = Vec::new();
    let mut at = link;
    while let Some(j) = model.parent_joint[at] {
        if let Some(i) = model.actuated_index(j) {
            found.push(i);
        }
        at = model.joints[j].parent;
    }
    found.reverse();
    found
}
