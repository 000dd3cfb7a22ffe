//! The joint map: which servo moves which joint, checked against the URDF's limits.

use super::error::{ConfigError, Pointer};
use super::file::{BusEntry, JointEntry, OnExit, RobotEntry};
use crate::base::suggest::hint;
use crate::bus::dynamixel::model::{MODELS, MODES};
use crate::bus::dynamixel::{
    Direction, Follow, Gains, Mode, Model, Profile, ServoSpec, Settings, SpecError,
};
use crate::robot::RobotModel;

/// Servos in model order; every moving joint has exactly one.
pub(super) fn servo_map(
    robot: &RobotEntry,
    bus: &BusEntry,
    model: &RobotModel,
    at: &Pointer<'_>,
) -> Result<Vec<ServoSpec>, ConfigError> {
    let joints = model.joint_names();
    let of_all = |problem| at.key("bus.model", problem);
    let servo_model = model_named(bus.model.get_ref(), of_all)?;
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

/// The servo model of this name; `blame` makes the error of a name that is unknown.
fn model_named(
    name: &str,
    blame: impl Fn(String) -> ConfigError,
) -> Result<&'static Model, ConfigError> {
    Model::by_name(name).ok_or_else(|| {
        let names = MODELS.iter().map(|model| model.name);
        let hint = hint(name, names.clone());
        let names: Vec<&str> = names.collect();
        blame(format!(
            "unknown servo model {name:?}{hint} Allowed: {}",
            names.join(", ")
        ))
    })
}

fn mode_of(entry: &JointEntry, at: &Pointer<'_>) -> Result<Mode, ConfigError> {
    let Some(name) = &entry.mode else {
        return Ok(Mode::default());
    };
    Mode::by_name(name.get_ref()).ok_or_else(|| {
        let names = MODES.iter().filter(|mode| **mode != Mode::Pwm);
        let names = names.map(|mode| mode.name());
        let hint = hint(name.get_ref(), names.clone());
        let names: Vec<&str> = names.collect();
        let problem = format!(
            "unknown mode {:?}{hint} Allowed: {}",
            name.get_ref(),
            names.join(", ")
        );
        at.at(name.span(), "robot.joint.mode", problem)
    })
}

fn settings_of(entry: &JointEntry, mode: Mode, at: &Pointer<'_>) -> Result<Settings, ConfigError> {
    let gains = entry.gains.as_ref().map_or(Gains::default(), |g| Gains {
        p: g.p,
        i: g.i,
        d: g.d,
        feedforward_1: g.feedforward_1,
        feedforward_2: g.feedforward_2,
    });
    let profile = entry.profile.as_ref().map(|p| Profile {
        acceleration_rad_s2: p.acceleration_rad_s2,
        velocity_rad_s: p.velocity_rad_s,
    });
    let follow = match &entry.host_gains {
        Some(_) if mode.holds_position() => {
            return Err(at.at(
                entry.name.span(),
                "robot.joint.host_gains",
                format!(
                    "in mode \"{}\" the servo closes the position loop itself; its gains are `gains`",
                    mode.name()
                ),
            ));
        }
        Some(g) => Follow { p: g.p, d: g.d },
        None if mode == Mode::Current => {
            return Err(at.at(
                entry.name.span(),
                "robot.joint.host_gains",
                "mode \"current\" needs host_gains = { p = A/rad, d = A s/rad }: no default fits every load",
            ));
        }
        None => Follow::default(),
    };
    Ok(Settings {
        gains,
        profile,
        current_limit_a: entry.current_a,
        follow,
    })
}

fn servo_spec(
    entry: &JointEntry,
    joint: &str,
    chain_model: &'static Model,
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
    let model = match &entry.model {
        Some(name) => {
            let here = |problem| at.at(name.span(), "robot.joint.model", problem);
            model_named(name.get_ref(), here)?
        }
        None => chain_model,
    };
    let mode = mode_of(entry, at)?;
    let mut spec = ServoSpec::new(*entry.servo.get_ref(), joint, model);
    spec.mode = mode;
    spec.direction = direction;
    spec.zero_pulse = entry.zero_pulse.unwrap_or(spec.zero_pulse);
    spec.settings = settings_of(entry, mode, at)?;
    (spec.min_pulse, spec.max_pulse) = match &entry.range_pulse {
        Some(range) => (range.get_ref()[0], range.get_ref()[1]),
        None if mode.has_position_limits() => (spec.min_pulse, spec.max_pulse),
        None => range_of(&spec, lower, upper),
    };
    let span = entry.range_pulse.as_ref().map(|range| range.span());
    spec.check().map_err(|e| {
        let span = match (&e, span, &entry.mode) {
            (SpecError::Range { .. }, Some(span), _) => span,
            (SpecError::Mode { .. }, _, Some(mode)) => mode.span(),
            _ => entry.name.span(),
        };
        at.at(span, "robot.joint", e)
    })?;
    let (min_pulse, max_pulse) = (spec.min_pulse, spec.max_pulse);
    let ends = [spec.position_rad(min_pulse), spec.position_rad(max_pulse)];
    let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    // A joint without end has the servo's range.
    let outside = |limit: f64, beyond: bool| limit.is_finite() && beyond;
    if outside(lower, lower < low - 1e-3) || outside(upper, upper > high + 1e-3) {
        let hint = if mode.has_position_limits() && upper - lower > high - low {
            ", or use mode = \"extended_position\""
        } else {
            ""
        };
        return Err(at.at(
            entry.name.span(),
            "robot.joint",
            format!(
                "joint {joint} moves in {lower:.3}..{upper:.3} rad, its servo only reaches {low:.3}..{high:.3} rad with zero_pulse {} and range_pulse {min_pulse}..{max_pulse}; correct these or narrow the URDF's limits{hint}",
                spec.zero_pulse
            ),
        ));
    }
    Ok(spec)
}

/// Servos without a position loop of their own go on with their last goal when nobody sends them another: something must stop
/// them, at the end of a run and if the host dies.
pub(super) fn check_stopping(
    servos: &[ServoSpec],
    on_exit: OnExit,
    watchdog_ms: u32,
    at: &Pointer<'_>,
) -> Result<(), ConfigError> {
    let Some(servo) = servos.iter().find(|servo| !servo.mode.holds_position()) else {
        return Ok(());
    };
    let (joint, mode) = (&servo.joint, servo.mode.name());
    if on_exit == OnExit::Hold {
        return Err(at.key(
            "safety.on_exit",
            format!(
                "joint {joint} is in mode \"{mode}\", in which a servo holds no position by itself; use \"torque_off\""
            ),
        ));
    }
    if watchdog_ms == 0 {
        return Err(at.key(
            "bus.watchdog_ms",
            format!(
                "joint {joint} is in mode \"{mode}\": without a watchdog its servo would turn on if this program died. Use 20 to 2540"
            ),
        ));
    }
    Ok(())
}

/// The counts that a joint needs which moves from `lower` to `upper`, rad; without end, all that the mode has.
fn range_of(spec: &ServoSpec, lower: f64, upper: f64) -> (i32, i32) {
    let (bottom, top) = spec.model.goal_range(spec.mode);
    let unlimited = ServoSpec {
        min_pulse: bottom,
        max_pulse: top,
        ..spec.clone()
    };
    // Infinity is clamped to what the mode has; there is no NaN in a URDF's limits.
    let count = |limit| unlimited.goal_pulse(limit).unwrap_or(spec.zero_pulse);
    let (a, b) = (count(lower), count(upper));
    (a.min(b), a.max(b))
}
