//! Legs of a legged robot: finding them in the tree, and placing a foot by inverse kinematics.

use super::model::{JointKind, RobotModel};
use crate::base::suggest::nearest;
use nalgebra::{Matrix3, Point3, Vector3};

/// A leg: three joints in a row that carry a foot.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg {
    /// Name by position: `front_left`, `rear_right`, ... or as declared.
    pub name: String,
    /// Link that touches the ground.
    pub foot: usize,
    /// The three moving joints, from the body outwards, as indices into the joint vector.
    pub joints: [usize; 3],
}

/// Why legs could not be found or solved.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum LegError {
    /// The tree does not tell the legs.
    #[error(
        "cannot find four legs in {robot}: {found}. \
         Name the feet, for example `--legs front_left=LINK,front_right=LINK,rear_left=LINK,rear_right=LINK`; links: {links}"
    )]
    NotFound {
        /// Robot name.
        robot: String,
        /// What was found instead.
        found: String,
        /// Links at the ends of the tree.
        links: String,
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

impl Leg {
    /// The leg that ends in link `foot`.
    pub fn to_foot(model: &RobotModel, name: &str, foot: &str) -> Result<Self, LegError> {
        let link = model.link(foot).ok_or_else(|| LegError::UnknownLink {
            leg: name.into(),
            link: foot.into(),
            hint: nearest(foot, model.links.iter().map(String::as_str))
                .map(|n| format!("; did you mean {n}?"))
                .unwrap_or_default(),
        })?;
        let joints = moving_joints_above(model, link);
        let joints: [usize; 3] =
            joints
                .as_slice()
                .try_into()
                .map_err(|_| LegError::JointCount {
                    leg: name.into(),
                    link: foot.into(),
                    count: joints.len(),
                })?;
        Ok(Self {
            name: name.into(),
            foot: link,
            joints,
        })
    }

    /// Finds four legs: ends of the tree below three revolute joints, named by where they stand at
    /// joint position zero (x forward, y left).
    pub fn find_all(model: &RobotModel) -> Result<Vec<Self>, LegError> {
        let is_parent = |link: usize| model.joints.iter().any(|j| j.parent == link);
        let ends: Vec<usize> = (0..model.links.len()).filter(|l| !is_parent(*l)).collect();
        let zero = vec![0.0; model.actuated.len()];
        let mut legs: Vec<Leg> = Vec::new();
        for end in &ends {
            let Ok(joints) = <[usize; 3]>::try_from(moving_joints_above(model, *end).as_slice())
            else {
                continue;
            };
            let foot = Leg {
                name: String::new(),
                foot: *end,
                joints,
            };
            // Rotors and covers hang on the same joints; the foot is the farthest end.
            let reach = |leg: &Leg| {
                let knee =
                    model.link_pose(model.joints[model.actuated[leg.joints[2]]].child, &zero);
                let end = model.link_pose(leg.foot, &zero);
                (end.translation.vector - knee.translation.vector).norm()
            };
            match legs.iter_mut().find(|l| l.joints == joints) {
                Some(known) if reach(known) < reach(&foot) => *known = foot,
                Some(_) => {}
                None => legs.push(foot),
            }
        }
        let not_found = |found: String| LegError::NotFound {
            robot: model.name.clone(),
            found,
            links: ends
                .iter()
                .map(|l| model.links[*l].as_str())
                .collect::<Vec<_>>()
                .join(", "),
        };
        if legs.len() != 4 {
            return Err(not_found(format!(
                "{} ends of the tree lie below exactly three moving joints",
                legs.len()
            )));
        }
        for leg in &mut legs {
            // The first joint sits on the body: its place tells the corner, whatever the leg does.
            let first = model.joints[model.actuated[leg.joints[0]]].child;
            let at = model.link_pose(first, &zero).translation.vector;
            let end = if at.x >= 0.0 { "front" } else { "rear" };
            let side = if at.y >= 0.0 { "left" } else { "right" };
            leg.name = format!("{end}_{side}");
        }
        legs.sort_by(|a, b| a.name.cmp(&b.name));
        legs.dedup_by(|a, b| a.name == b.name);
        if legs.len() != 4 {
            return Err(not_found(
                "two legs stand in the same corner of the body".into(),
            ));
        }
        Ok(legs)
    }

    /// Foot position in the root link's frame.
    pub fn foot_position(&self, model: &RobotModel, positions: &[f64]) -> Point3<f64> {
        Point3::from(model.link_pose(self.foot, positions).translation.vector)
    }

    /// Longest stretch of the leg: from its second joint (where thigh meets hip) to the foot,
    /// along the links, metres.
    pub fn length(&self, model: &RobotModel) -> f64 {
        let zero = vec![0.0; model.actuated.len()];
        let at = |i: usize| {
            let joint = &model.joints[model.actuated[self.joints[i]]];
            model.link_pose(joint.child, &zero).translation.vector
        };
        let foot = model.link_pose(self.foot, &zero).translation.vector;
        (at(2) - at(1)).norm() + (foot - at(2)).norm()
    }

    /// Where the foot hangs when the leg is straight down: below the second joint at position zero.
    pub fn below_hip(&self, model: &RobotModel) -> Point3<f64> {
        let zero = vec![0.0; model.actuated.len()];
        let joint = &model.joints[model.actuated[self.joints[1]]];
        let mut at = Point3::from(model.link_pose(joint.child, &zero).translation.vector);
        // Some models offset the leg plane further out, between the thigh joint and the shank.
        at.y = self.foot_position(model, &zero).y;
        at
    }

    /// Moves the leg's joints in `positions` so that the foot is at `goal` (root link's frame).
    ///
    /// Damped least squares from the given positions, clamped to the joint limits in each round;
    /// at most 200 rounds, no allocation. `Err` leaves `positions` at the nearest found.
    pub fn place_foot(
        &self,
        model: &RobotModel,
        goal: Point3<f64>,
        positions: &mut [f64],
    ) -> Result<(), LegError> {
        const TOLERANCE_M: f64 = 1e-7;
        let mut damping = 1e-6;
        let mut error = goal - self.foot_position(model, positions);
        for _ in 0..200 {
            if error.norm() < TOLERANCE_M {
                return Ok(());
            }
            let jacobian = self.jacobian(model, positions);
            let normal = jacobian.transpose() * jacobian + Matrix3::identity() * damping;
            let Some(step) = normal
                .cholesky()
                .map(|c| c.solve(&(jacobian.transpose() * error)))
            else {
                break;
            };
            let before = self.joints.map(|j| positions[j]);
            for (i, j) in self.joints.iter().enumerate() {
                let (lower, upper) = model.joints[model.actuated[*j]]
                    .limits
                    .map_or((f64::NEG_INFINITY, f64::INFINITY), |l| (l.lower, l.upper));
                positions[*j] = (positions[*j] + step[i].clamp(-0.5, 0.5)).clamp(lower, upper);
            }
            let new_error = goal - self.foot_position(model, positions);
            if new_error.norm() < error.norm() {
                damping = (damping * 0.3).max(1e-9);
                error = new_error;
            } else {
                self.put(before, positions);
                damping *= 10.0;
                if damping > 1e3 {
                    break;
                }
            }
        }
        if error.norm() < 1e-5 {
            return Ok(());
        }
        Err(LegError::OutOfReach {
            leg: self.name.clone(),
            x: goal.x,
            y: goal.y,
            z: goal.z,
            error_mm: error.norm() * 1e3,
        })
    }

    /// Solves the foot from several starting poses, for the first pose of a motion, where no neighbour
    /// tells the knee's side. Keeps the solution nearest the middle of the ranges; where both sides are
    /// alike, the knee points backwards, so that all legs and all clips of a robot agree.
    pub fn place_foot_from_scratch(
        &self,
        model: &RobotModel,
        goal: Point3<f64>,
        positions: &mut [f64],
    ) -> Result<(), LegError> {
        let limits = self.joints.map(|j| {
            let l = model.joints[model.actuated[j]].limits;
            l.map_or((-1.5, 1.5), |l| (l.lower.max(-3.2), l.upper.min(3.2)))
        });
        let middle = limits.map(|(lo, hi)| 0.5 * (lo + hi));
        let mut best: Option<(f64, [f64; 3])> = None;
        let mut failure = None;
        for thigh in [0.25, 0.5, 0.75] {
            for knee in [0.2, 0.5, 0.8] {
                let start = [
                    middle[0],
                    limits[1].0 + thigh * (limits[1].1 - limits[1].0),
                    limits[2].0 + knee * (limits[2].1 - limits[2].0),
                ];
                self.put(start, positions);
                match self.place_foot(model, goal, positions) {
                    Ok(()) => {
                        let solved = self.joints.map(|j| positions[j]);
                        let side = if self.knee_points_back(model, positions) {
                            0.0
                        } else {
                            KNEE_TIE
                        };
                        let spread: f64 = (0..3)
                            .map(|i| {
                                ((solved[i] - middle[i]) / (limits[i].1 - limits[i].0)).powi(2)
                            })
                            .sum();
                        let cost = spread + side;
                        if best.is_none_or(|(c, _)| cost < c - 1e-9) {
                            best = Some((cost, solved));
                        }
                    }
                    Err(e) => failure = Some(e),
                }
            }
        }
        match (best, failure) {
            (Some((_, solved)), _) => {
                self.put(solved, positions);
                Ok(())
            }
            (None, Some(e)) => Err(e),
            (None, None) => Ok(()),
        }
    }

    /// Sets the leg's three joints in `positions`.
    fn put(&self, values: [f64; 3], positions: &mut [f64]) {
        for (j, value) in self.joints.iter().zip(values) {
            positions[*j] = value;
        }
    }

    /// Whether the knee lies behind the straight line from hip to foot (x is forward).
    fn knee_points_back(&self, model: &RobotModel, positions: &[f64]) -> bool {
        let at = |i: usize| {
            let joint = &model.joints[model.actuated[self.joints[i]]];
            model.link_pose(joint.child, positions).translation.vector
        };
        let (hip, knee) = (at(1), at(2));
        let foot = self.foot_position(model, positions).coords;
        let line = foot - hip;
        let along = ((knee - hip).dot(&line) / line.norm_squared().max(1e-12)).clamp(0.0, 1.0);
        knee.x <= (hip + line * along).x + 1e-9
    }

    /// Columns: velocity of the foot per unit speed of each joint, in the root link's frame.
    fn jacobian(&self, model: &RobotModel, positions: &[f64]) -> Matrix3<f64> {
        let foot = self.foot_position(model, positions);
        let columns = self.joints.map(|i| {
            let joint = &model.joints[model.actuated[i]];
            let frame = model.link_pose(joint.child, positions);
            let axis = frame.rotation * joint.axis.into_inner();
            match joint.kind {
                JointKind::Prismatic => axis,
                _ => axis.cross(&(foot - Point3::from(frame.translation.vector))),
            }
        });
        Matrix3::from_columns(&columns.map(|c: Vector3<f64>| c))
    }
}

/// Moving joints between the root and `link`, from the root outwards, as indices into the joint vector.
fn moving_joints_above(model: &RobotModel, link: usize) -> Vec<usize> {
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
