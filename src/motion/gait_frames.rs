//! Frames of a gait: foot paths, leg inverse kinematics, and what the joints allow.

use super::clip::{Clip, ClipFile, ClipKind, Segment};
use super::gait::{GaitDescription, GaitError, GaitName};
use super::gait_paths::path_clip;
use super::gait_plan::{Plan, phase_of};
use super::gait_stance::Stance;
pub use super::gait_stance::Walker;
use super::range::cycle_limit;
use crate::robot::RobotModel;

/// Frames of a cycle; doubled, at most to [`MOST_FRAMES`], until the feet stay where they stand.
const LEAST_FRAMES: usize = 64;
/// See [`LEAST_FRAMES`].
const MOST_FRAMES: usize = 512;
/// How far the spline through the frames may carry a foot off its spot in stance, metres.
const STANCE_ERROR_M: f64 = 1e-4;
/// A stride is never shortened below this part of what was asked for.
const LEAST_STRIDE: f64 = 0.3;
/// Share of the highest frequency that a gait is made for when none is asked.
const TEMPO_SHARE: f64 = 0.8;

/// A clip made from a description, with what had to be changed.
#[derive(Clone, Debug)]
pub struct Authored {
    /// The clip.
    pub file: ClipFile,
    /// Highest frequency the joints allow, Hz, and the joint that decides it (cycles only).
    pub max_frequency: Option<(f64, String)>,
    /// How much of the asked stride and step height was kept, 0..1.
    pub stride_kept: f64,
    /// Farthest that a foot in stance is from its spot on the ground, metres (cycles only).
    pub stance_error_m: f64,
}

/// Makes a clip for the legs of `walker`.
///
/// When the joints are too slow for `frequency_hz`, stride and step height are shortened to what they
/// can do, down to 30 %; `strict` refuses instead. Without `frequency_hz` the gait is made for its
/// natural tempo, or 80 % of what the joints can do if that is less.
pub fn author(
    description: &GaitDescription,
    walker: Walker<'_>,
    strict: bool,
) -> Result<Authored, GaitError> {
    description.check()?;
    if !description.pose.is_empty() {
        return Ok(Authored {
            file: path_clip(description, walker)?,
            max_frequency: None,
            stride_kept: 1.0,
            stance_error_m: 0.0,
        });
    }
    check_legs(description, walker)?;
    let joints = walker.model.joint_names();
    let attempt = |kept: f64, frames: usize| -> Result<(Cycle, f64, usize), GaitError> {
        let cycle = Cycle::new(description, walker, kept, frames)?;
        let (max_hz, joint) = cycle_limit(&cycle.clip, walker.ranges);
        Ok((cycle, max_hz, joint))
    };
    let frequency_hz = description.frequency_hz.unwrap_or(0.0);
    let (mut cycle, mut max_hz, mut joint) = attempt(1.0, LEAST_FRAMES)?;
    let mut kept = 1.0;
    if max_hz < frequency_hz {
        let too_fast = |max_hz: f64, joint: usize, least: f64| GaitError::TooFast {
            name: description.name.clone(),
            joint: joints[joint].clone(),
            max_hz,
            frequency_hz,
            least_percent: least * 100.0,
        };
        if strict {
            return Err(too_fast(max_hz, joint, 1.0));
        }
        let (_, least_hz, least_joint) = attempt(LEAST_STRIDE, LEAST_FRAMES)?;
        if least_hz < frequency_hz {
            return Err(too_fast(least_hz, least_joint, LEAST_STRIDE));
        }
        // The limit falls steadily with the stride: halve the interval to 1 %.
        let (mut low, mut high) = (LEAST_STRIDE, 1.0);
        while high - low > 0.01 {
            let middle = 0.5 * (low + high);
            // A little room, for more frames follow a foot path more closely.
            if attempt(middle, LEAST_FRAMES)?.1 >= 1.01 * frequency_hz {
                low = middle;
            } else {
                high = middle;
            }
        }
        kept = low;
        (cycle, max_hz, joint) = attempt(kept, LEAST_FRAMES)?;
    }
    let mut frames = LEAST_FRAMES;
    let mut stance_error_m = cycle.stance_error_m(walker);
    while stance_error_m > STANCE_ERROR_M && frames < MOST_FRAMES {
        frames *= 2;
        (cycle, max_hz, joint) = attempt(kept, frames)?;
        stance_error_m = cycle.stance_error_m(walker);
    }
    let mut file = cycle.file;
    if description.frequency_hz.is_none() && max_hz.is_finite() {
        let tempo = description.gait.map_or(0.2, GaitName::tempo);
        let natural = tempo * (9.81 / cycle.leg_length_m).sqrt();
        let hz = natural.min(TEMPO_SHARE * max_hz);
        file.frequency_hz = (hz * 100.0).floor() / 100.0;
    }
    Ok(Authored {
        file,
        max_frequency: max_hz.is_finite().then(|| (max_hz, joints[joint].clone())),
        stride_kept: kept,
        stance_error_m,
    })
}

/// Every leg must have a phase, and every phase a leg.
fn check_legs(description: &GaitDescription, walker: Walker<'_>) -> Result<(), GaitError> {
    let names: Vec<&str> = walker.legs.iter().map(|l| l.name.as_str()).collect();
    for leg in description.phase.keys() {
        if !names.contains(&leg.as_str()) {
            return Err(GaitError::Value {
                key: "phase",
                problem: format!("leg {leg} is not one of {}", names.join(", ")),
            });
        }
    }
    let all_given = names.iter().all(|leg| description.phase.contains_key(*leg));
    let fits = |gait: GaitName| all_given || gait.legs().is_none_or(|n| n == names.len());
    let without = names
        .iter()
        .find(|leg| phase_of(description, leg).is_none() || !description.gait.is_none_or(fits));
    match (without, description.gait) {
        (None, _) => Ok(()),
        (Some(_), Some(gait)) => Err(GaitError::Value {
            key: "gait",
            problem: format!(
                "{} is not for these {} legs ({}); for them there are {} and stand, or give every leg its [phase]",
                gait.name(),
                names.len(),
                names.join(", "),
                GaitName::for_legs(names.len()).join(", "),
            ),
        }),
        (Some(leg), None) => Err(GaitError::Value {
            key: "phase",
            problem: format!("leg {leg} has none, and no gait says it"),
        }),
    }
}

/// A gait with everything filled in, its frames, and their spline.
struct Cycle {
    plan: Plan,
    file: ClipFile,
    clip: Clip,
    leg_length_m: f64,
}

impl Cycle {
    fn new(
        description: &GaitDescription,
        walker: Walker<'_>,
        kept: f64,
        frames: usize,
    ) -> Result<Self, GaitError> {
        let stance = Stance::new(description, walker);
        let plan = Plan::new(description, walker, &stance, kept);
        let mut file = stance.empty_file(description, ClipKind::Cycle);
        file.root = plan.root;
        file.segments = walker
            .legs
            .iter()
            .zip(&plan.phases)
            .map(|(leg, phase)| Segment {
                name: leg.name.clone(),
                joints: leg.joints.iter().map(|j| file.joints[*j].clone()).collect(),
                phase: *phase,
                duty: plan.duty,
            })
            .collect();
        let mut positions = stance.stand()?;
        for k in 0..frames {
            let u = k as f64 / frames as f64;
            let root = stance.root_pose(&plan.body(u));
            for leg in 0..walker.legs.len() {
                stance.place(leg, &root, plan.foot(leg, u), &mut positions)?;
            }
            file.frames.push(positions.clone());
            file.body.push(Stance::body_row(&root));
        }
        let clip = file.for_body(&file.joints).map_err(|e| GaitError::Value {
            key: "name",
            problem: e.to_string(),
        })?;
        Ok(Self {
            plan,
            file,
            clip,
            leg_length_m: stance.leg_length_m,
        })
    }

    /// Farthest that a foot in stance is from where it should be, between the frames too, metres.
    fn stance_error_m(&self, walker: Walker<'_>) -> f64 {
        let samples = 4 * self.file.frames.len();
        let mut pose = vec![0.0; self.file.joints.len()];
        let mut worst: f64 = 0.0;
        let facing = walker.facing.rotation();
        for k in 0..samples {
            let u = k as f64 / samples as f64;
            self.clip.pose(u, &mut pose);
            let [x, y, z, roll, pitch, yaw] = self.plan.body(u);
            let root = nalgebra::Isometry3::from_parts(
                nalgebra::Translation3::new(x, y, z),
                nalgebra::UnitQuaternion::from_euler_angles(roll, pitch, yaw) * facing,
            );
            for (i, leg) in walker.legs.iter().enumerate() {
                if (u - self.plan.phases[i]).rem_euclid(1.0) < self.plan.duty {
                    let foot = root * leg.foot_position(walker.model, &pose);
                    worst = worst.max((foot - self.plan.foot(i, u)).norm());
                }
            }
        }
        worst
    }
}

/// Positions at which a clip leaves the joint limits, for the report of `clip gait`.
pub fn outside_limits(clip: &Clip, model: &RobotModel) -> Vec<String> {
    let names = model.joint_names();
    let mut found = Vec::new();
    for (joint, limit) in model.limits().iter().enumerate() {
        let (low, high) = (0..256)
            .map(|k| clip.sample(f64::from(k) / 256.0, joint))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), q| {
                (q.min(lo), q.max(hi))
            });
        if low < limit.lower - 1e-6 || high > limit.upper + 1e-6 {
            found.push(format!(
                "joint {}: {low:.3}..{high:.3} rad leaves its limits {:.3}..{:.3}",
                names[joint], limit.lower, limit.upper
            ));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::range::JointRange;
    use crate::robot::Leg;

    const PUP: &str = include_str!("../../configs/robots/pup.urdf");

    fn pup() -> (RobotModel, Vec<Leg>, Vec<JointRange>) {
        let model = RobotModel::from_urdf(PUP).expect("shipped URDF");
        let legs = Leg::find_all(&model).expect("four legs");
        let ranges = model
            .limits()
            .iter()
            .map(|l| JointRange {
                velocity: l.velocity,
                acceleration: 120.0,
            })
            .collect();
        (model, legs, ranges)
    }

    fn author(
        description: &GaitDescription,
        model: &RobotModel,
        legs: &[Leg],
        ranges: &[JointRange],
        strict: bool,
    ) -> Result<Authored, GaitError> {
        let facing = Leg::facing(model, legs);
        let walker = Walker {
            model,
            legs,
            facing,
            ranges,
        };
        super::author(description, walker, strict)
    }

    #[test]
    fn feet_of_the_trot_stay_on_the_ground_in_stance_and_clear_it_in_swing() {
        let (model, legs, ranges) = pup();
        let mut description = GaitDescription::preset("trot", GaitName::Trot);
        description.stride_m = Some(0.1);
        description.body_height_m = Some(0.15);
        description.step_height_m = Some(0.02);
        let authored = author(&description, &model, &legs, &ranges, false).expect("reachable");
        let clip = authored
            .file
            .for_body(&model.joint_names())
            .expect("own joints");
        let mut pose = vec![0.0; 12];
        let (mut worst, mut highest): (f64, f64) = (0.0, 0.0);
        for k in 0..400 {
            let u = f64::from(k) / 400.0;
            clip.pose(u, &mut pose);
            for (leg, limb) in legs.iter().zip(&clip.limbs) {
                let height = leg.foot_position(&model, &pose).z + 0.15;
                if (u - limb.phase).rem_euclid(1.0) < limb.duty {
                    worst = worst.max(height.abs());
                } else {
                    highest = highest.max(height);
                }
            }
        }
        assert!(
            worst < 2e-4,
            "stance foot {:.3} mm off the ground",
            worst * 1e3
        );
        assert!((highest - 0.02).abs() < 5e-4, "swing height {highest}");
    }

    #[test]
    fn a_stride_too_fast_for_the_servos_is_shortened_or_refused() {
        let (model, legs, ranges) = pup();
        let mut description = GaitDescription::preset("trot", GaitName::Trot);
        description.stride_m = Some(0.14);
        description.body_height_m = Some(0.15);
        description.step_height_m = Some(0.015);
        description.frequency_hz = Some(2.6);
        let authored = author(&description, &model, &legs, &ranges, false).expect("shortened");
        assert!(authored.stride_kept < 0.99, "kept {}", authored.stride_kept);
        let (max_hz, _) = authored
            .max_frequency
            .clone()
            .expect("a moving gait has a limit");
        assert!(max_hz >= 2.6, "limit {max_hz} Hz");
        let refused = author(&description, &model, &legs, &ranges, true).expect_err("strict");
        assert!(refused.to_string().contains("Hz is asked for"), "{refused}");
        description.frequency_hz = Some(9.0);
        assert!(author(&description, &model, &legs, &ranges, false).is_err());
    }

    #[test]
    fn a_body_too_high_names_the_leg_and_the_reach() {
        let (model, legs, ranges) = pup();
        let mut description = GaitDescription::preset("stand", GaitName::Stand);
        description.body_height_m = Some(0.3);
        let message = author(&description, &model, &legs, &ranges, false)
            .expect_err("legs are 0.2 m")
            .to_string();
        assert!(
            message.contains("cannot reach") && message.contains("0.200"),
            "{message}"
        );
    }
}
