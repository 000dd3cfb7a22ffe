//! Legs of a legged robot: finding them in the tree, and placing a foot by inverse kinematics.

mod chain;
mod facing;
mod find;
mod solve;
mod stand;

pub use facing::{AXES, Facing};
pub use stand::Standing;

use super::model::RobotModel;
use crate::base::suggest::nearest;
use chain::Chain;
use nalgebra::Point3;
use solve::Planar;

/// A leg: three joints in a row that carry a foot.
///
/// It holds what it needs of the model it was made from: change limits before, not after.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg {
    /// Name by position: `front_left`, `rear_right`, ... or as declared.
    pub name: String,
    /// Link that touches the ground.
    pub foot: usize,
    /// Where on the foot link, in its frame, metres.
    pub tip: Point3<f64>,
    /// The three moving joints, from the body outwards, as indices into the joint vector.
    pub joints: [usize; 3],
    chain: Chain,
    planar: Option<Planar>,
}

/// Why legs could not be found or solved.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum LegError {
    /// The tree does not tell the legs.
    #[error(
        "cannot find four or six legs in {robot}: {found}. A leg is a foot below three moving joints of its own. \
         Name the feet, for example `--legs front_left=LINK,front_right=LINK,rear_left=LINK,rear_right=LINK`; ends of the tree (moving joints above): {links}"
    )]
    NotFound {
        /// Robot name.
        robot: String,
        /// What was found instead.
        found: String,
        /// Links at the ends of the tree.
        links: String,
    },
    /// The URDF does not say where the ground is touched.
    #[error(
        "link {link} ends a leg, but its origin lies in its last joint and no shape of it can be read: say where it touches the ground, in metres in its frame, for example `--legs {leg}={link}@0:0:-0.1,...`"
    )]
    NoFoot {
        /// The link.
        link: String,
        /// Name of the leg.
        leg: String,
    },
    /// A foot was not understood.
    #[error("leg {leg}: {spec:?} is not LINK or LINK@X:Y:Z (metres in the frame of the link)")]
    Spec {
        /// Leg name.
        leg: String,
        /// What was given.
        spec: String,
    },
    /// A foot link is not in the URDF.
    #[error("leg {leg}: link {link} is not in the URDF{hint}")]
    UnknownLink {
        /// Leg name.
        leg: String,
        /// The link named.
        link: String,
        /// A near name, if there is one.
        hint: String,
    },
    /// A leg has too few or too many joints.
    #[error("leg {leg}: {count} moving joints between body and foot link {link}, three are needed")]
    JointCount {
        /// Leg name.
        leg: String,
        /// Foot link.
        link: String,
        /// Moving joints found.
        count: usize,
    },
    /// The foot cannot get there.
    #[error(
        "leg {leg} cannot reach ({x:.3}, {y:.3}, {z:.3}) m in the body frame inside its joint limits (nearest {error_mm:.1} mm away)"
    )]
    OutOfReach {
        /// Leg name.
        leg: String,
        /// Wanted foot position in the root link's frame, metres.
        x: f64,
        /// See `x`.
        y: f64,
        /// See `x`.
        z: f64,
        /// Distance left, millimetres.
        error_mm: f64,
    },
}

/// Solutions whose costs differ by less are alike: then the knee's side decides.
const KNEE_TIE: f64 = 1e-2;
/// A foot this near to its goal is there, metres.
const THERE_M: f64 = 1e-6;

impl Leg {
    pub(super) fn new(
        model: &RobotModel,
        name: String,
        foot: usize,
        tip: Point3<f64>,
        joints: [usize; 3],
    ) -> Self {
        let chain = Chain::new(model, foot, tip, joints);
        Self {
            name,
            foot,
            tip,
            joints,
            planar: Planar::of(&chain),
            chain,
        }
    }

    /// The leg that ends in `foot`: a link, or a point of a link as `LINK@X:Y:Z` (metres in its frame).
    pub fn to_foot(model: &RobotModel, name: &str, foot: &str) -> Result<Self, LegError> {
        let (link_name, point) = match foot.split_once('@') {
            None => (foot, None),
            Some((link, at)) => {
                let numbers: Vec<f64> = at.split(':').filter_map(|v| v.parse().ok()).collect();
                let point = match numbers.as_slice() {
                    [x, y, z] if numbers.iter().all(|v| v.is_finite()) => Point3::new(*x, *y, *z),
                    _ => {
                        return Err(LegError::Spec {
                            leg: name.into(),
                            spec: foot.into(),
                        });
                    }
                };
                (link, Some(point))
            }
        };
        let link = model.link(link_name).ok_or_else(|| LegError::UnknownLink {
            leg: name.into(),
            link: link_name.into(),
            hint: nearest(link_name, model.links.iter().map(String::as_str))
                .map(|n| format!("; did you mean {n}?"))
                .unwrap_or_default(),
        })?;
        let joints = find::moving_joints_above(model, link);
        let joints: [usize; 3] =
            joints
                .as_slice()
                .try_into()
                .map_err(|_| LegError::JointCount {
                    leg: name.into(),
                    link: link_name.into(),
                    count: joints.len(),
                })?;
        let leg = Self::new(
            model,
            name.into(),
            link,
            point.unwrap_or_else(Point3::origin),
            joints,
        );
        match point {
            Some(_) => Ok(leg),
            None => leg.with_tip(model),
        }
    }

    /// Which way a robot with these legs faces.
    pub fn facing(model: &RobotModel, legs: &[Self]) -> Facing {
        Facing::of_legs(model, legs)
    }

    /// Foot position in the root link's frame.
    pub fn foot_position(&self, _model: &RobotModel, positions: &[f64]) -> Point3<f64> {
        self.chain.foot(&self.take(positions))
    }

    /// Longest stretch of the leg: from its second joint (where thigh meets hip) to the foot,
    /// along the links, metres.
    pub fn length(&self, _model: &RobotModel) -> f64 {
        self.length_m()
    }

    fn length_m(&self) -> f64 {
        let rest = self.chain.rest();
        let at = |i: usize| self.chain.joint_frame(i, &rest).translation.vector;
        (at(2) - at(1)).norm() + (self.chain.foot(&rest).coords - at(2)).norm()
    }

    /// Moves the leg's joints in `positions` so that the foot is at `goal` (root link's frame), or as
    /// near as it gets inside the limits. Returns the distance left, metres. Allocates nothing.
    ///
    /// Of several solutions the one nearest to the given positions is taken. Legs with parallel thigh
    /// and knee axes are solved in closed form; others, and goals out of reach, by damped least squares.
    pub fn reach(&self, goal: Point3<f64>, positions: &mut [f64]) -> f64 {
        let near = self.take(positions);
        let mut best: Option<([f64; 3], f64)> = None;
        if let Some(planar) = &self.planar {
            let mut found = [[0.0; 3]; 4];
            let count = planar.solutions(&self.chain, goal, &near, &mut found);
            for q in found.into_iter().take(count) {
                let way: f64 = q.iter().zip(near).map(|(q, n)| (q - n).powi(2)).sum();
                if best.is_none_or(|(_, least)| way < least) {
                    best = Some((q, way));
                }
            }
        }
        if let Some((q, _)) = best {
            let left = (goal - self.chain.foot(&q)).norm();
            if left < THERE_M {
                self.put(q, positions);
                return left;
            }
        }
        let mut q = best.map_or(near, |(q, _)| q);
        let left = solve::descend(&self.chain, goal, &mut q);
        self.put(q, positions);
        left
    }

    /// [`Leg::reach`], with an error that says what could not be reached.
    ///
    /// `Err` leaves `positions` at the nearest found.
    pub fn place_foot(
        &self,
        _model: &RobotModel,
        goal: Point3<f64>,
        positions: &mut [f64],
    ) -> Result<(), LegError> {
        let left = self.reach(goal, positions);
        if left < THERE_M {
            return Ok(());
        }
        Err(LegError::OutOfReach {
            leg: self.name.clone(),
            x: goal.x,
            y: goal.y,
            z: goal.z,
            error_mm: left * 1e3,
        })
    }

    /// Solves the foot for the first pose of a motion, where no neighbour tells the knee's side.
    ///
    /// Keeps the solution nearest the middle of the ranges; where both sides are alike, the knee points
    /// backwards (upwards on legs that sprawl), so that all legs and all clips of a robot agree.
    pub fn place_foot_from_scratch(
        &self,
        model: &RobotModel,
        goal: Point3<f64>,
        facing: Facing,
        positions: &mut [f64],
    ) -> Result<(), LegError> {
        let limits = self
            .chain
            .limits
            .map(|(lower, upper)| (lower.max(-3.2), upper.min(3.2)));
        let middle = limits.map(|(lower, upper)| 0.5 * (lower + upper));
        let cost = |q: &[f64; 3]| {
            let spread: f64 = (0..3)
                .map(|i| ((q[i] - middle[i]) / (limits[i].1 - limits[i].0)).powi(2))
                .sum();
            let tie = if self.sprawls(facing) { 1.0 } else { KNEE_TIE };
            spread + tie * self.odd_knee(q, facing)
        };
        let mut best: Option<(f64, [f64; 3])> = None;
        let mut offer = |q: [f64; 3]| {
            let cost = cost(&q);
            if best.is_none_or(|(least, _)| cost < least - 1e-9) {
                best = Some((cost, q));
            }
        };
        if let Some(planar) = &self.planar {
            let mut found = [[0.0; 3]; 4];
            let count = planar.solutions(&self.chain, goal, &middle, &mut found);
            for q in found.into_iter().take(count) {
                if (goal - self.chain.foot(&q)).norm() < THERE_M {
                    offer(q);
                }
            }
        } else {
            for thigh in [0.25, 0.5, 0.75] {
                for knee in [0.2, 0.5, 0.8] {
                    let at = |i: usize, w: f64| limits[i].0 + w * (limits[i].1 - limits[i].0);
                    let mut q = [middle[0], at(1, thigh), at(2, knee)];
                    if solve::descend(&self.chain, goal, &mut q) < THERE_M {
                        offer(q);
                    }
                }
            }
        }
        match best {
            Some((_, q)) => {
                self.put(q, positions);
                Ok(())
            }
            None => {
                self.put(middle, positions);
                self.place_foot(model, goal, positions)
            }
        }
    }

    /// The leg's three joint positions.
    fn take(&self, positions: &[f64]) -> [f64; 3] {
        self.joints
            .map(|j| positions.get(j).copied().unwrap_or(0.0))
    }

    /// Sets the leg's three joints in `positions`.
    fn put(&self, values: [f64; 3], positions: &mut [f64]) {
        for (j, value) in self.joints.iter().zip(values) {
            positions[*j] = value;
        }
    }
}
