//! Frames of a gait: foot paths, leg inverse kinematics, and what the joints allow.

use super::clip::{Clip, ClipFile, ClipKind, RootAdvance, Segment};
use super::gait::{BodyPose, GaitDescription, GaitError, GaitName};
use super::range::{JointRange, cycle_limit};
use super::smooth::ease;
use crate::robot::leg::LegError;
use crate::robot::{Leg, RobotModel};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

/// Frames of a cycle. Foot paths are twice differentiable, so a spline through 64 follows them closely.
const CYCLE_FRAMES: usize = 64;
/// Frames of a path between two poses.
const PATH_FRAMES: usize = 17;
/// A stride is never shortened below this part of what was asked for.
const LEAST_STRIDE: f64 = 0.3;

/// A clip made from a description, with what had to be changed.
#[derive(Clone, Debug)]
pub struct Authored {
    /// The clip.
    pub file: ClipFile,
    /// Highest frequency the joints allow, Hz, and the joint that decides it (cycles only).
    pub max_frequency: Option<(f64, String)>,
    /// How much of the asked stride and step height was kept, 0..1.
    pub stride_kept: f64,
}

/// Makes a clip for the legs of `model`.
///
/// `ranges`: speed and acceleration each joint may use, in joint order. When the joints are too
/// slow for `frequency_hz`, stride and step height are shortened to what they can do, down to 30 %;
/// `strict` refuses instead.
pub fn author(
    description: &GaitDescription,
    model: &RobotModel,
    legs: &[Leg],
    ranges: &[JointRange],
    strict: bool,
) -> Result<Authored, GaitError> {
    description.check()?;
    for leg in description.phase.keys() {
        if !legs.iter().any(|l| l.name == *leg) {
            let names: Vec<&str> = legs.iter().map(|l| l.name.as_str()).collect();
            return Err(GaitError::Value {
                key: "phase",
                problem: format!("leg {leg} is not one of {}", names.join(", ")),
            });
        }
    }
    if !description.pose.is_empty() {
        let file = path_clip(description, model, legs)?;
        return Ok(Authored {
            file,
            max_frequency: None,
            stride_kept: 1.0,
        });
    }
    let joints = model.joint_names();
    let attempt = |kept: f64| -> Result<(ClipFile, f64, usize), GaitError> {
        let file = cycle_clip(description, model, legs, kept)?;
        let clip = file.for_body(&joints).map_err(|e| GaitError::Value {
            key: "name",
            problem: e.to_string(),
        })?;
        let (max_hz, joint) = cycle_limit(&clip, ranges);
        Ok((file, max_hz, joint))
    };
    let frequency_hz = description.frequency_hz.unwrap_or(0.0);
    let (mut file, mut max_hz, mut joint) = attempt(1.0)?;
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
        let (_, least_hz, least_joint) = attempt(LEAST_STRIDE)?;
        if least_hz < frequency_hz {
            return Err(too_fast(least_hz, least_joint, LEAST_STRIDE));
        }
        // The limit falls steadily with the stride: halve the interval to 1 %.
        let (mut low, mut high) = (LEAST_STRIDE, 1.0);
        while high - low > 0.01 {
            let middle = 0.5 * (low + high);
            if attempt(middle)?.1 >= frequency_hz {
                low = middle;
            } else {
                high = middle;
            }
        }
        kept = low;
        (file, max_hz, joint) = attempt(kept)?;
    }
    Ok(Authored {
        file,
        max_frequency: max_hz.is_finite().then(|| (max_hz, joints[joint].clone())),
        stride_kept: kept,
    })
}

/// Ground contact of every foot when the body stands still.
struct Stance {
    neutral: Vec<Point3<f64>>,
    body_height_m: f64,
    leg_length_m: f64,
}

impl Stance {
    fn new(description: &GaitDescription, model: &RobotModel, legs: &[Leg]) -> Self {
        let leg_length_m = legs
            .iter()
            .map(|l| l.length(model))
            .fold(f64::INFINITY, f64::min);
        let hips: Vec<Point3<f64>> = legs.iter().map(|l| l.below_hip(model)).collect();
        let lowest_hip = hips.iter().map(|h| h.z).fold(f64::INFINITY, f64::min);
        let body_height_m = description
            .body_height_m
            .unwrap_or(0.78 * leg_length_m - lowest_hip);
        let neutral = hips
            .iter()
            .map(|h| Point3::new(h.x, h.y, -body_height_m))
            .collect();
        Self {
            neutral,
            body_height_m,
            leg_length_m,
        }
    }

    fn cannot(&self, name: &str, source: LegError) -> GaitError {
        GaitError::Leg {
            name: name.into(),
            source,
            body_height_m: self.body_height_m,
            leg_length_m: self.leg_length_m,
        }
    }
}

fn empty_file(description: &GaitDescription, model: &RobotModel, kind: ClipKind) -> ClipFile {
    let origin = if description.origin.is_empty() {
        format!("authored by handwave clip gait for robot {}", model.name)
    } else {
        description.origin.clone()
    };
    ClipFile {
        handwave: "clip".into(),
        version: 1,
        name: description.name.clone(),
        origin,
        kind,
        joints: model.joint_names(),
        frequency_hz: description.frequency_hz.unwrap_or(0.0),
        duration_s: 0.0,
        skeleton: None,
        body: Vec::new(),
        way: Vec::new(),
        root: RootAdvance::default(),
        segments: Vec::new(),
        frames: Vec::new(),
    }
}

fn cycle_clip(
    description: &GaitDescription,
    model: &RobotModel,
    legs: &[Leg],
    kept: f64,
) -> Result<ClipFile, GaitError> {
    let preset = description.gait.unwrap_or(GaitName::Stand);
    let still = description.gait == Some(GaitName::Stand);
    let duty = description
        .duty_factor
        .unwrap_or_else(|| preset.duty_factor());
    let stance = Stance::new(description, model, legs);
    let default_stride = if still {
        0.0
    } else {
        0.5 * stance.leg_length_m
    };
    let default_lift = if still {
        0.0
    } else {
        0.12 * stance.leg_length_m
    };
    let stride = kept * description.stride_m.unwrap_or(default_stride);
    let turn = kept * description.turn_rad;
    let lift = kept * description.step_height_m.unwrap_or(default_lift);
    let phase_of = |leg: &Leg| {
        description
            .phase
            .get(&leg.name)
            .copied()
            .unwrap_or_else(|| preset.phase(&leg.name))
    };
    let foot_at = |leg: usize, cycle: f64| {
        let (sweep, height) = foot_path(cycle - phase_of(&legs[leg]), duty);
        let neutral = stance.neutral[leg];
        let turned =
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), sweep * duty * turn) * neutral;
        Point3::new(
            turned.x + sweep * duty * stride,
            turned.y,
            neutral.z + height * lift,
        )
    };
    let mut file = empty_file(description, model, ClipKind::Cycle);
    file.root = RootAdvance {
        forward_m: stride,
        left_m: 0.0,
        yaw_rad: turn,
    };
    file.segments = legs
        .iter()
        .map(|leg| Segment {
            name: leg.name.clone(),
            joints: leg.joints.iter().map(|j| file.joints[*j].clone()).collect(),
            phase: phase_of(leg),
            duty,
        })
        .collect();
    let mut positions = vec![0.0; file.joints.len()];
    for (i, leg) in legs.iter().enumerate() {
        // The knee's side is chosen where the foot stands, so that every clip of the robot agrees.
        leg.place_foot_from_scratch(model, stance.neutral[i], &mut positions)
            .map_err(|e| stance.cannot(&description.name, e))?;
    }
    for k in 0..CYCLE_FRAMES {
        for (i, leg) in legs.iter().enumerate() {
            leg.place_foot(
                model,
                foot_at(i, k as f64 / CYCLE_FRAMES as f64),
                &mut positions,
            )
            .map_err(|e| stance.cannot(&description.name, e))?;
        }
        file.frames.push(positions.clone());
    }
    Ok(file)
}

/// Foot path at `cycle` (fraction since touch-down): sweep in -0.5..0.5 of the stance way (front is
/// positive) and height in 0..1 of the step height.
///
/// Stance is steady; swing is the quintic that leaves and meets the ground at stance speed with no
/// acceleration, so a foot neither scuffs nor stamps.
fn foot_path(cycle: f64, duty: f64) -> (f64, f64) {
    let u = cycle.rem_euclid(1.0);
    if duty >= 1.0 {
        return (0.0, 0.0);
    }
    if u < duty {
        return (0.5 - u / duty, 0.0);
    }
    let w = (u - duty) / (1.0 - duty);
    // Going on at stance speed would carry the foot back by `drift` more; the ease brings it forward.
    let drift = (1.0 - duty) / duty;
    let sweep = -0.5 - drift * w + (1.0 + drift) * ease(w);
    let bump = w * (1.0 - w);
    (sweep, 64.0 * bump * bump * bump)
}

fn path_clip(
    description: &GaitDescription,
    model: &RobotModel,
    legs: &[Leg],
) -> Result<ClipFile, GaitError> {
    let stance = Stance::new(description, model, legs);
    let mut file = empty_file(description, model, ClipKind::Path);
    let mut positions = vec![0.0; file.joints.len()];
    let steps = description.pose.len() - 1;
    let frames = (PATH_FRAMES - 1) * steps + 1;
    for k in 0..frames {
        let along = k as f64 / (PATH_FRAMES - 1) as f64;
        let from = (along as usize).min(steps - 1);
        let w = ease(along - from as f64);
        let body = body_at(
            &description.pose[from],
            &description.pose[from + 1],
            w,
            &stance,
        );
        for (leg, neutral) in legs.iter().zip(&stance.neutral) {
            let ground = Point3::new(neutral.x, neutral.y, 0.0);
            let foot = body.inverse_transform_point(&ground);
            if k == 0 {
                leg.place_foot_from_scratch(model, *neutral, &mut positions)
                    .map_err(|e| stance.cannot(&description.name, e))?;
            }
            leg.place_foot(model, foot, &mut positions)
                .map_err(|e| stance.cannot(&description.name, e))?;
        }
        file.frames.push(positions.clone());
    }
    Ok(file)
}

/// Pose of the body over the ground between two poses.
fn body_at(a: &BodyPose, b: &BodyPose, w: f64, stance: &Stance) -> Isometry3<f64> {
    let mix = |x: f64, y: f64| x + w * (y - x);
    let height = mix(
        a.body_height_m.unwrap_or(stance.body_height_m),
        b.body_height_m.unwrap_or(stance.body_height_m),
    );
    Isometry3::from_parts(
        Translation3::new(
            mix(a.forward_m, b.forward_m),
            mix(a.left_m, b.left_m),
            height,
        ),
        UnitQuaternion::from_euler_angles(
            mix(a.roll_rad, b.roll_rad),
            mix(a.pitch_rad, b.pitch_rad),
            mix(a.yaw_rad, b.yaw_rad),
        ),
    )
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

    #[test]
    fn foot_path_is_smooth_over_the_whole_cycle() {
        for duty in [0.35, 0.5, 0.7] {
            let h = 1e-4;
            let mut jump: f64 = 0.0;
            let mut u = 0.0;
            while u < 1.0 {
                let s = |u: f64| foot_path(u, duty).0;
                let left = (s(u) - s(u - h)) / h;
                let right = (s(u + h) - s(u)) / h;
                jump = jump.max((right - left).abs());
                u += h;
            }
            assert!(jump < 0.05, "speed jumps by {jump} cycles at duty {duty}");
        }
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
