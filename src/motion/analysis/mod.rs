//! What a motion is: its cycle, travel, contacts, gait and symmetry; and how clips are cut from takes.
//!
//! [`analyse`] looks at a [`Take`]; [`cut`] makes clips of it; [`mirror`] swaps left and right.

mod body;
pub mod contact;
pub mod cut;
pub mod cycle;
pub mod gait;
pub mod mirror;
pub mod travel;

pub use body::BodyModel;
pub use contact::{FootContact, Stance};
pub use cycle::Cycle;
pub use gait::Gait;
pub use travel::Travel;

use super::metrics::{Smoothness, rates, smoothness};
use super::take::Take;

/// What was found in a take.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// Its cycle; `None` where it does not repeat.
    pub cycle: Option<Cycle>,
    /// How the root travels.
    pub travel: Travel,
    /// One entry per foot; empty for a body without known feet.
    pub feet: Vec<FootContact>,
    /// What a person would call it; `None` without a cycle or with other than two or four feet.
    pub gait: Option<Gait>,
    /// How smoothly every coordinate of a difference moves, see [`crate::body::PoseSpace`].
    pub smoothness: Vec<Smoothness>,
    /// Root mean square way of a feature from its mean, metres: the scale of seams.
    pub extent_m: f64,
}

/// Why a take cannot be analysed or cut.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum AnalysisError {
    /// A take that is no motion.
    #[error("take {take}: {problem}")]
    Take {
        /// Name of the take.
        take: String,
        /// What was found and what is allowed.
        problem: String,
    },
    /// Nothing in it repeats.
    #[error(
        "take {take}: no cycle found (best likeness {likeness:.2}, {least:.2} needed); cut it as a path, or name the range that repeats"
    )]
    NotCyclic {
        /// Name of the take.
        take: String,
        /// How much it resembles itself at best, 1 is the same.
        likeness: f64,
        /// What is asked for.
        least: f64,
    },
    /// The ends of the cycle do not meet.
    #[error(
        "take {take}: the ends of the cycle are {seam_m:.3} m apart, {share:.0} % of its motion; at most {most:.0} % can be closed without being seen"
    )]
    Seam {
        /// Name of the take.
        take: String,
        /// Root mean square distance of the ends, metres.
        seam_m: f64,
        /// As percentage of the motion's extent.
        share: f64,
        /// Allowed percentage.
        most: f64,
    },
    /// Options that cannot be.
    #[error("{0}")]
    Options(String),
}

impl Take {
    /// Checks that frames are of one length and finite, and that time runs.
    ///
    /// # Errors
    /// Names the frame and what was found.
    pub fn check(&self, body: &BodyModel) -> Result<(), AnalysisError> {
        let bad = |problem: String| {
            Err(AnalysisError::Take {
                take: self.name.clone(),
                problem,
            })
        };
        if self.len() < 2 {
            return bad(format!("{} frames, at least 2 are needed", self.len()));
        }
        if !(self.dt_s > 0.0 && self.dt_s.is_finite()) {
            return bad(format!("time step {} s, above 0 is needed", self.dt_s));
        }
        if self.roots.len() != self.len() {
            return bad(format!(
                "{} roots for {} poses",
                self.roots.len(),
                self.len()
            ));
        }
        let wanted = body.space().len();
        for (k, (pose, root)) in self.poses.iter().zip(&self.roots).enumerate() {
            if pose.len() != wanted {
                return bad(format!(
                    "frame {k} has {} numbers, {wanted} are needed",
                    pose.len()
                ));
            }
            let root = [root.x_m, root.y_m, root.yaw_rad];
            if let Some(v) = pose.iter().chain(&root).find(|v| !v.is_finite()) {
                return bad(format!("frame {k} holds {v}, which is not finite"));
            }
        }
        Ok(())
    }
}

/// Finds out what a take is. See [`cycle::find`], [`travel::of`], [`contact::find`], [`gait::guess`].
///
/// # Errors
/// A take whose frames do not fit its body, or are not finite.
pub fn analyse(take: &Take, body: &BodyModel) -> Result<Analysis, AnalysisError> {
    take.check(body)?;
    let features = cycle::Features::of(take, body.space());
    let cycle = cycle::find(&features, take).ok();
    let mut travel = travel::of(take);
    let feet = match body.feet() {
        Some(feet) => contact::find(take, feet, cycle.as_ref(), &mut travel),
        None => Vec::new(),
    };
    let gait = cycle.and_then(|_| gait::guess(&feet));
    let rates = rates(body.space(), &take.poses, take.dt_s);
    let closed = cycle.is_some_and(|c| c.closed);
    Ok(Analysis {
        cycle,
        travel,
        feet,
        gait,
        smoothness: smoothness(&rates, take.dt_s, closed),
        extent_m: features.extent_m(),
    })
}

#[cfg(test)]
mod tests;
