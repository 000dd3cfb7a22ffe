//! Feet of a skeleton: finding its legs, and placing a foot by closed-form inverse kinematics.

mod reach;

use self::reach::reach;
use super::side::Side;
use super::{Feet, Skeleton};
use crate::base::suggest::nearest;
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use std::sync::Arc;

/// A leg: two bones that bend at the knee, and what hangs on the ankle down to the foot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SkeletonLeg {
    /// Name by position: `left`, `right` of two legs, `front_left` ... of four, or as declared.
    pub name: String,
    /// Joint about which the whole leg turns.
    pub hip: usize,
    /// Joint that bends.
    pub knee: usize,
    /// End of the second bone: ankle, or hock of an animal that walks on its toes.
    pub ankle: usize,
    /// Joint that is put on the ground: toes where the skeleton has them, otherwise the ankle.
    pub foot: usize,
}

/// Why legs could not be found.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum SkeletonFeetError {
    /// The skeleton does not tell the legs.
    #[error(
        "cannot find legs in the skeleton: {found}. Name the feet, for example left=LeftToe,right=RightToe; joints at ends: {ends}"
    )]
    NotFound {
        /// What was found instead.
        found: String,
        /// Joints without children.
        ends: String,
    },
    /// A foot joint is not in the skeleton.
    #[error("leg {leg}: joint {joint} is not in the skeleton{hint}")]
    UnknownJoint {
        /// Leg name.
        leg: String,
        /// The joint named.
        joint: String,
        /// A near name, if there is one.
        hint: String,
    },
    /// A leg needs hip, knee and foot, in this order from the body outwards, with bones between.
    #[error("leg {leg}: {problem}")]
    Leg {
        /// Leg name.
        leg: String,
        /// What was found and what is needed.
        problem: String,
    },
}

/// Names of what stands on the ground, wherever it is at rest.
const FOOT_NAMES: [&str; 5] = ["foot", "ankle", "toe", "paw", "hoof"];
/// Names of what is no leg, however low it hangs.
const OTHER_NAMES: [&str; 6] = ["tail", "head", "neck", "hair", "ear", "jaw"];
/// Tips that some files add behind the last joint.
const TIP_NAMES: [&str; 3] = ["nub", "_end", "tip"];
/// An end of the tree this near the lowest one, as a share of the skeleton's height, is a foot.
const LOW_SHARE: f64 = 0.15;
/// Bones shorter than this share of their leg are joints in one place.
const SHORT_SHARE: f64 = 0.02;
/// Sine of the angle at the knee below which the leg is straight and does not tell where it bends.
const STRAIGHT: f64 = 1e-3;

impl SkeletonLeg {
    /// The leg that ends in `foot`, named by joint: hip and knee are those of its two longest neighbouring
    /// bones.
    pub fn to_foot(skeleton: &Skeleton, name: &str, foot: &str) -> Result<Self, SkeletonFeetError> {
        let joint = skeleton.joint(foot).ok_or_else(|| {
            let known = skeleton.joints.iter().map(|j| j.name.as_str());
            SkeletonFeetError::UnknownJoint {
                leg: name.into(),
                joint: foot.into(),
                hint: nearest(foot, known)
                    .map(|n| format!("; did you mean {n}?"))
                    .unwrap_or_default(),
            }
        })?;
        Self::above(skeleton, name, joint)
    }

    fn above(skeleton: &Skeleton, name: &str, foot: usize) -> Result<Self, SkeletonFeetError> {
        let children = |joint: usize| {
            (skeleton.joints.iter())
                .filter(|j| j.parent == Some(joint))
                .count()
        };
        // Up to where the body branches; toes of one foot may branch too, so the foot's own parent and
        // that one's may have several children.
        let mut chain = vec![foot];
        let mut at = foot;
        while let Some(parent) = skeleton.joints[at].parent {
            let body = skeleton.joints[parent].parent.is_none();
            if body || (children(parent) > 1 && chain.len() > 2) {
                break;
            }
            chain.push(parent);
            at = parent;
        }
        chain.reverse();
        let total: f64 = chain[1..].iter().map(|j| bone(skeleton, *j)).sum();
        // Joints in one place are one: the lower of them turns the bone.
        let mut joints: Vec<usize> = Vec::new();
        for joint in chain {
            let same = !joints.is_empty() && bone(skeleton, joint) < SHORT_SHARE * total;
            match joints.last_mut() {
                Some(last) if same && joint != foot => *last = joint,
                _ => joints.push(joint),
            }
        }
        let shorter = |i: usize| bone(skeleton, joints[i + 1]).min(bone(skeleton, joints[i + 2]));
        let best = (0..joints.len().saturating_sub(2))
            .max_by(|a, b| shorter(*a).total_cmp(&shorter(*b)).then(b.cmp(a)));
        let Some(i) = best.filter(|i| shorter(*i) > 0.0) else {
            return Err(SkeletonFeetError::Leg {
                leg: name.into(),
                problem: format!(
                    "only {} joints with bones between them lead from the body to {}; hip, knee and foot are needed",
                    joints.len(),
                    skeleton.joints[foot].name
                ),
            });
        };
        Ok(Self {
            name: name.into(),
            hip: joints[i],
            knee: joints[i + 1],
            ankle: joints[i + 2],
            foot,
        })
    }
}

fn bone(skeleton: &Skeleton, joint: usize) -> f64 {
    Vector3::from(skeleton.joints[joint].offset_m).norm()
}

/// Legs of a skeleton as [`Feet`]. Poses are those of a [`super::SkeletonSpace`].
#[derive(Clone, Debug)]
pub struct SkeletonFeet {
    skeleton: Arc<Skeleton>,
    legs: Vec<SkeletonLeg>,
    /// Axis of the knee in the frame above it, for a leg that is straight.
    axes: Vec<Vector3<f64>>,
    reach_m: Vec<f64>,
}

impl SkeletonFeet {
    /// Finds the legs: ends of the tree that are named as feet, or that come down to the ground.
    ///
    /// `poses` are some of the motion's; without any the pose at rest counts, which in many files is no
    /// pose that anybody could take. Sides follow from names where they tell, otherwise, like front and
    /// rear, from where the hips are.
    pub fn find(skeleton: Arc<Skeleton>, poses: &[&[f64]]) -> Result<Self, SkeletonFeetError> {
        let rest = skeleton.rest_pose([0.0; 3]);
        let given: Vec<&[f64]> = (poses.iter().copied())
            .filter(|p| p.len() == skeleton.coordinates())
            .collect();
        let poses: &[&[f64]] = if given.is_empty() { &[&rest] } else { &given };
        let places = Places::over(&skeleton, poses);
        let ends = ends(&skeleton);
        let has = |joint: usize, words: &[&str]| {
            let name = skeleton.joints[joint].name.to_lowercase();
            words.iter().any(|w| name.contains(w))
        };
        let mut legs: Vec<SkeletonLeg> = Vec::new();
        for end in &ends {
            let parent = skeleton.joints[*end].parent.unwrap_or(*end);
            let named = has(*end, &FOOT_NAMES) || has(parent, &FOOT_NAMES);
            let low = places.lowest[*end] < LOW_SHARE * places.height;
            if !named && (!low || has(*end, &OTHER_NAMES)) {
                continue;
            }
            let Ok(leg) = SkeletonLeg::above(&skeleton, "", *end) else {
                continue;
            };
            // Several toes of one leg: the first counts.
            if !legs.iter().any(|l| l.hip == leg.hip || l.knee == leg.knee) {
                legs.push(leg);
            }
        }
        if legs.is_empty() {
            let names: Vec<&str> = (ends.iter())
                .map(|e| skeleton.joints[*e].name.as_str())
                .collect();
            return Err(SkeletonFeetError::NotFound {
                found: "no end of the tree is named as a foot or comes down to the ground with hip and knee above it".into(),
                ends: names.join(", "),
            });
        }
        name_legs(&skeleton, &places, &mut legs);
        Self::with_legs(skeleton.clone(), legs, poses)
    }

    /// The feet of `legs`; `poses` tell where knees bend, as in [`SkeletonFeet::find`].
    pub fn with_legs(
        skeleton: Arc<Skeleton>,
        legs: Vec<SkeletonLeg>,
        poses: &[&[f64]],
    ) -> Result<Self, SkeletonFeetError> {
        for leg in &legs {
            let known = [leg.hip, leg.knee, leg.ankle, leg.foot];
            let above = |a: usize, b: usize| a == b || ancestors(&skeleton, b).any(|j| j == a);
            if known.iter().any(|j| *j >= skeleton.len())
                || leg.hip == leg.knee
                || leg.knee == leg.ankle
                || !(above(leg.hip, leg.knee)
                    && above(leg.knee, leg.ankle)
                    && above(leg.ankle, leg.foot))
            {
                return Err(SkeletonFeetError::Leg {
                    leg: leg.name.clone(),
                    problem: format!(
                        "joints {known:?} of {} must be hip, knee, ankle and foot, each below the one before",
                        skeleton.len()
                    ),
                });
            }
        }
        let rest = skeleton.rest_pose([0.0; 3]);
        let reach_m = (legs.iter())
            .map(|leg| {
                let at = |joint| skeleton.position(&rest, joint);
                (at(leg.knee) - at(leg.hip)).norm()
                    + (at(leg.ankle) - at(leg.knee)).norm()
                    + (at(leg.foot) - at(leg.ankle)).norm()
            })
            .collect();
        let axes = (legs.iter())
            .map(|leg| knee_axis(&skeleton, leg, poses, &rest))
            .collect();
        Ok(Self {
            skeleton,
            legs,
            axes,
            reach_m,
        })
    }

    /// The legs, in foot order.
    pub fn legs(&self) -> &[SkeletonLeg] {
        &self.legs
    }

    /// Indices of the joints of leg `foot`, from the hip to the foot and what hangs on it.
    pub fn joints_of(&self, foot: usize) -> Vec<usize> {
        let hip = self.legs[foot].hip;
        (hip..self.skeleton.len())
            .filter(|j| *j == hip || ancestors(&self.skeleton, *j).any(|a| a == hip))
            .collect()
    }
}

fn ancestors(skeleton: &Skeleton, joint: usize) -> impl Iterator<Item = usize> + '_ {
    let parent = |joint: usize| skeleton.joints.get(joint).and_then(|j| j.parent);
    std::iter::successors(parent(joint), move |j| parent(*j))
}

/// Joints without children; of tips behind a joint that has no others, that joint.
fn ends(skeleton: &Skeleton) -> Vec<usize> {
    let has_child = |joint: usize| skeleton.joints.iter().any(|j| j.parent == Some(joint));
    let mut ends: Vec<usize> = (0..skeleton.len())
        .filter(|joint| !has_child(*joint))
        .map(|joint| {
            let name = skeleton.joints[joint].name.to_lowercase();
            let tip = TIP_NAMES.iter().any(|t| name.contains(t));
            skeleton.joints[joint]
                .parent
                .filter(|_| tip)
                .unwrap_or(joint)
        })
        .collect();
    ends.dedup();
    ends
}

/// Where joints are over some poses.
struct Places {
    /// Least height of each joint over the lowest of all, metres.
    lowest: Vec<f64>,
    /// Mean place of each joint in the travelling frame, metres.
    mean: Vec<Vector3<f64>>,
    /// Height of the whole, metres.
    height: f64,
}

impl Places {
    fn over(skeleton: &Skeleton, poses: &[&[f64]]) -> Self {
        let n = skeleton.len();
        let mut frames = vec![Isometry3::identity(); n];
        let mut lowest = vec![f64::INFINITY; n];
        let mut mean = vec![Vector3::zeros(); n];
        let mut top = f64::NEG_INFINITY;
        for pose in poses {
            skeleton.frames(pose, &mut frames);
            for (i, frame) in frames.iter().enumerate() {
                let at = frame.translation.vector;
                lowest[i] = lowest[i].min(at.z);
                mean[i] += at / poses.len() as f64;
                top = top.max(at.z);
            }
        }
        let bottom = lowest.iter().copied().fold(f64::INFINITY, f64::min);
        lowest.iter_mut().for_each(|z| *z -= bottom);
        Self {
            lowest,
            mean,
            height: top - bottom,
        }
    }
}

/// Names legs by where their hips are; sides by name where all names tell one.
fn name_legs(skeleton: &Skeleton, places: &Places, legs: &mut [SkeletonLeg]) {
    let count = legs.len();
    let middle = |axis: usize| {
        legs.iter().map(|l| places.mean[l.hip][axis]).sum::<f64>() / count.max(1) as f64
    };
    let (x, y) = (middle(0), middle(1));
    let told = |leg: &SkeletonLeg| Side::of(&skeleton.joints[leg.foot].name);
    let all_told = legs.iter().all(|l| told(l).is_some());
    let names: Vec<String> = (legs.iter())
        .map(|leg| {
            let at = places.mean[leg.hip];
            let by_place = if at.y >= y { Side::Left } else { Side::Right };
            let side = told(leg).filter(|_| all_told).unwrap_or(by_place);
            let side = if side == Side::Left { "left" } else { "right" };
            match count {
                1 => skeleton.joints[leg.foot].name.clone(),
                2 => side.to_string(),
                _ if at.x >= x => format!("front_{side}"),
                _ => format!("rear_{side}"),
            }
        })
        .collect();
    for (i, leg) in legs.iter_mut().enumerate() {
        // More than four legs, or two in one corner: the foot's own name tells them apart.
        let alone = names.iter().filter(|n| **n == names[i]).count() == 1;
        leg.name = if alone {
            names[i].clone()
        } else {
            skeleton.joints[leg.foot].name.clone()
        };
    }
    legs.sort_by(|a, b| a.name.cmp(&b.name));
}

/// The axis about which the knee bends, in the frame of the joint above it: from the pose in which it
/// bends most. A leg that is straight in all of them bends forwards, as a human's.
fn knee_axis(
    skeleton: &Skeleton,
    leg: &SkeletonLeg,
    poses: &[&[f64]],
    rest: &[f64],
) -> Vector3<f64> {
    let mut best = (STRAIGHT, None);
    for pose in poses.iter().copied().chain(std::iter::once(rest)) {
        if pose.len() != skeleton.coordinates() {
            continue;
        }
        let [hip, knee, ankle] = [leg.hip, leg.knee, leg.ankle].map(|j| skeleton.position(pose, j));
        let (u, v) = (hip - knee, ankle - knee);
        let cross = u.cross(&v);
        let sine = cross.norm() / (u.norm() * v.norm()).max(1e-12);
        if sine > best.0 {
            let axis = above_knee(skeleton, pose, leg).inverse() * cross.normalize();
            best = (sine, Some(axis));
        }
    }
    best.1.unwrap_or_else(|| {
        let pose = poses.first().copied().unwrap_or(rest);
        above_knee(skeleton, pose, leg).inverse() * -Vector3::y()
    })
}

/// Rotation of the joint above the knee, in the travelling frame.
fn above_knee(skeleton: &Skeleton, pose: &[f64], leg: &SkeletonLeg) -> UnitQuaternion<f64> {
    above(skeleton, pose, leg.knee)
}

/// Rotation of the parent of `joint`, in the travelling frame.
fn above(skeleton: &Skeleton, pose: &[f64], joint: usize) -> UnitQuaternion<f64> {
    match skeleton.joints[joint].parent {
        Some(parent) => skeleton.frame(pose, parent).rotation,
        None => UnitQuaternion::identity(),
    }
}

impl Feet for SkeletonFeet {
    fn count(&self) -> usize {
        self.legs.len()
    }

    fn name(&self, foot: usize) -> &str {
        &self.legs[foot].name
    }

    fn position(&self, pose: &[f64], foot: usize) -> Point3<f64> {
        self.skeleton.position(pose, self.legs[foot].foot)
    }

    /// Hip and knee turn, the knee stays on its side, and the foot keeps its orientation, unless the leg
    /// reaches only by turning it too.
    fn place(&self, pose: &mut [f64], foot: usize, goal: Point3<f64>) -> f64 {
        let leg = &self.legs[foot];
        let skeleton = &*self.skeleton;
        let [hip, knee, ankle] = [leg.hip, leg.knee, leg.ankle].map(|j| skeleton.frame(pose, j));
        let over = [leg.hip, leg.knee, leg.ankle].map(|j| above(skeleton, pose, j));
        let chain = [hip, knee, ankle].map(|f| f.translation.vector);
        let toe = skeleton.position(pose, leg.foot).coords;
        let bend = reach(chain, toe, goal.coords, over[1] * self.axes[foot]);
        let turned = bend.hip * bend.knee;
        let local = [
            over[0].inverse() * bend.hip * hip.rotation,
            over[1].inverse() * bend.knee * knee.rotation,
            (turned * over[2]).inverse() * bend.foot * ankle.rotation,
        ];
        for (joint, mut rotation) in [leg.hip, leg.knee, leg.ankle].into_iter().zip(local) {
            rotation.renormalize();
            // The same sign as before: a rotation that hardly changed has coordinates that hardly changed.
            if rotation.coords.dot(&Skeleton::rotation(pose, joint).coords) < 0.0 {
                rotation = UnitQuaternion::new_unchecked(-rotation.into_inner());
            }
            Skeleton::set_rotation(pose, joint, &rotation);
        }
        (self.position(pose, foot) - goal).norm()
    }

    fn shift(&self, pose: &mut [f64], way: Vector3<f64>) {
        for (coordinate, way) in pose.iter_mut().zip(way.iter()) {
            *coordinate += way;
        }
    }

    fn reach_m(&self, foot: usize) -> f64 {
        self.reach_m[foot]
    }
}

#[cfg(test)]
mod tests;
