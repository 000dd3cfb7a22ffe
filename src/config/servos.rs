//! The joint map: which servo moves which joint, checked against the URDF's limits.

use super::error::{ConfigError, Pointer};
use super::file::{BusEntry, JointEntry, RobotEntry};
use crate::base::suggest::hint;
use crate::bus::dynamixel::{Direction, Model, ServoSpec};
use crate::robot::RobotModel;

/// Servos in model order; every moving joint has exactly one.
pub(super) fn servo_map(
    robot: &RobotEntry,
    bus: &BusEntry,
    model: &RobotModel,
    at: &Pointer<'_>,
) -> Result<Vec<ServoSpec>, ConfigError> {
    let joints = model.joint_names();
    let servo_model = Model::by_name(bus.model.get_ref()).ok_or_else(|| {
        let names: Vec<&str> = crate::bus::dynamixel::model::MODELS
            .iter()
            .map(|m| m.name)
            .collect();
        at.key(
            "bus.model",
            format!(
                "unknown servo model {:?}. Allowed: {}",
                bus.model.get_ref(),
                names.join(", ")
            ),
        )
    })?;
    let mut by_joint: Vec<Option<&JointEntry>> = vec![None; joints.len()];
    for entry in &robot.joint {
        let name = entry.name.get_ref();
        let Some(joint) = joints.iter().position(|j| j == name) else {
            let hint = hint(name, joints.iter().map(String::as_str));
            return Err(at.at(
                entry.name.span(),
                "robot.joint.name",
                format!(
                    "{name:?} is not a moving joint of {}{hint} Joints: {}",
                    robot.urdf.get_ref(),
                    joints.join(", ")
                ),
            ));
        };
        if let Some(other) = by_joint
            .iter()
            .flatten()
            .find(|o| o.servo.get_ref() == entry.servo.get_ref())
        {
            return Err(at.at(
                entry.servo.span(),
                "robot.joint.servo",
                format!(
                    "servo {} is already given to joint {}; every joint needs its own",
                    entry.servo.get_ref(),
                    other.name.get_ref()
                ),
            ));
        }
        if by_joint[joint].replace(entry).is_some() {
            return Err(at.at(
                entry.name.span(),
                "robot.joint.name",
                format!("joint {name} is listed twice"),
            ));
        }
    }
    joints
        .iter()
        .zip(by_joint)
        .zip(model.limits())
        .map(|((joint, entry), limit)| {
            let entry = entry.ok_or_else(|| {
                at.key(
                    "robot.joint",
                    format!("joint {joint} has no servo; add {{ name = \"{joint}\", servo = ID }}"),
                )
            })?;
            servo_spec(entry, joint, servo_model, (limit.lower, limit.upper), at)
        })
        .collect()
}

fn servo_spec(
    entry: &JointEntry,
    joint: &str,
    model: &'static Model,
    (lower, upper): (f64, f64),
    at: &Pointer<'_>,
) -> Result<ServoSpec, ConfigError> {
    let direction = match entry.direction {
        1 => Direction::Forward,
        -1 => Direction::Reverse,
        other => {
            return Err(at.at(
                entry.name.span(),
                "robot.joint.direction",
                format!("{other} is not 1 or -1"),
            ));
        }
    };
    let [min_pulse, max_pulse] = *entry.range_pulse.get_ref();
    let spec = ServoSpec {
        id: *entry.servo.get_ref(),
        joint: joint.into(),
        model,
        zero_pulse: entry.zero_pulse,
        direction,
        min_pulse,
        max_pulse,
        ..ServoSpec::new(0, "", model)
    };
    spec.check()
        .map_err(|e| at.at(entry.name.span(), "robot.joint", e))?;
    let ends = [spec.position_rad(min_pulse), spec.position_rad(max_pulse)];
    let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    if lower < low - 1e-3 || upper > high + 1e-3 {
        return Err(at.at(
            entry.name.span(),
            "robot.joint",
            format!(
                "joint {joint} moves in {lower:.3}..{upper:.3} rad, its servo only reaches {low:.3}..{high:.3} rad with zero_pulse {} and range_pulse {min_pulse}..{max_pulse}; correct these or narrow the URDF's limits",
                entry.zero_pulse
            ),
        ));
    }
    Ok(spec)
}
