//! A legged robot from the command line: its URDF, legs, facing and what its joints may do.

use super::disk::read;
use super::{Failure, warn};
use crate::motion::gait_frames::Walker;
use crate::motion::range::JointRange;
use crate::robot::{Facing, Leg, RobotModel};
use clap::Args;
use std::path::{Path, PathBuf};

/// Arguments that describe the robot.
#[derive(Args, Debug)]
pub(super) struct LeggedArgs {
    /// Robot description
    #[arg(long)]
    pub urdf: PathBuf,
    /// Feet by leg, when they cannot be found: front_left=LINK,front_right=LINK,...
    ///
    /// LINK@X:Y:Z is a point of the link, in metres in its frame.
    #[arg(long, value_delimiter = ',', value_name = "LEG=LINK")]
    pub legs: Vec<String>,
    /// Axis of the root link that points forward: x, -x, y, -y, z, -z (default: told by the legs)
    #[arg(long, allow_hyphen_values = true, value_name = "AXIS")]
    pub forward: Option<String>,
    /// Axis of the root link that points up (default: told by the legs)
    #[arg(long, allow_hyphen_values = true, value_name = "AXIS")]
    pub up: Option<String>,
    /// No joint may be faster, rad/s; needed where the URDF has placeholders
    #[arg(long, value_name = "RAD_S")]
    pub max_velocity: Option<f64>,
    /// Acceleration every joint may use, rad/s^2 (a URDF does not tell)
    #[arg(long, default_value_t = 120.0, value_name = "RAD_S2")]
    pub max_acceleration: f64,
    /// Other position limits, rad: JOINT=LOW..HIGH, where * in JOINT stands for anything
    #[arg(long, allow_hyphen_values = true, value_name = "JOINT=LOW..HIGH")]
    pub limits: Vec<String>,
}

/// A robot with legs.
#[derive(Debug)]
pub(super) struct Legged {
    pub model: RobotModel,
    pub legs: Vec<Leg>,
    pub facing: Facing,
    pub ranges: Vec<JointRange>,
}

impl Legged {
    pub fn walker(&self) -> Walker<'_> {
        Walker {
            model: &self.model,
            legs: &self.legs,
            facing: self.facing,
            ranges: &self.ranges,
        }
    }
}

/// Reads a file.
/// Reads the robot, finds its legs, and says what it took for what.
pub(super) fn load(args: &LeggedArgs) -> Result<Legged, Failure> {
    let urdf = args.urdf.display();
    let in_urdf = |e: &dyn std::fmt::Display| Failure::input(format!("{urdf}: {e}"));
    let mut model = RobotModel::from_urdf(&read(&args.urdf)?).map_err(|e| in_urdf(&e))?;
    model.read_mesh_tips(args.urdf.parent().unwrap_or(Path::new(".")));
    limit(args, &mut model)?;
    let (legs, facing) = legs(args, &model)?;
    let found: Vec<String> = legs
        .iter()
        .map(|l| format!("{}={}", l.name, model.links[l.foot]))
        .collect();
    if args.legs.is_empty() {
        warn(format_args!("legs found: {}", found.join(",")));
    }
    if facing != Facing::default() {
        warn(format_args!(
            "the robot faces {} with {} up, seen from its link {} (--forward and --up say otherwise)",
            facing.forward(),
            facing.up(),
            model.links[model.root]
        ));
    }
    let ranges = model
        .limits()
        .iter()
        .map(|l| JointRange {
            velocity: l.velocity,
            acceleration: args.max_acceleration,
        })
        .collect();
    Ok(Legged {
        model,
        legs,
        facing,
        ranges,
    })
}

fn limit(args: &LeggedArgs, model: &mut RobotModel) -> Result<(), Failure> {
    let urdf = args.urdf.display();
    if !(args.max_acceleration > 0.0) {
        return Err(Failure::input("--max-acceleration must be above 0 rad/s^2"));
    }
    if let Some(velocity) = args.max_velocity {
        if !(velocity > 0.0) {
            return Err(Failure::input("--max-velocity must be above 0 rad/s"));
        }
        model.cap_velocity(velocity);
    }
    for rule in &args.limits {
        let (pattern, low, high) = range_rule(rule)?;
        let names: Vec<String> = model
            .joint_names()
            .into_iter()
            .filter(|n| matches(pattern, n))
            .collect();
        if names.is_empty() {
            return Err(Failure::input(format!(
                "--limits {rule}: no joint that moves is called so; those are {}",
                model.joint_names().join(", ")
            )));
        }
        for name in names {
            model
                .set_range(&name, low, high)
                .map_err(|e| Failure::input(format!("--limits {rule}: {e}")))?;
        }
    }
    let placeholders = model.placeholder_velocities();
    if let Some(first) = placeholders.first() {
        return Err(Failure::input(format!(
            "{urdf}: the velocity limits of {} joints ({} {} rad/s, ...) are placeholders; what can the drives do? \
             Add `--max-velocity RAD_S`, for example `--max-velocity 4.7` for XL430 servos",
            placeholders.len(),
            first.name,
            first.limits.map_or(0.0, |l| l.velocity)
        )));
    }
    let wide = model.wide_ranges();
    if let Some((first, limits)) = wide.first().and_then(|j| Some((j, j.limits?))) {
        warn(format_args!(
            "warning: {urdf}: {} joints may turn further than once ({} {:.2}..{:.2} rad), so nothing keeps the legs off the body; \
             say better with, for example, `--limits '{}=-1.5..1.5'`",
            wide.len(),
            first.name,
            limits.lower,
            limits.upper,
            first.name
        ));
    }
    Ok(())
}

fn range_rule(rule: &str) -> Result<(&str, f64, f64), Failure> {
    let parts = || {
        let (name, range) = rule.split_once('=')?;
        let (low, high) = range.split_once("..")?;
        Some((name, low.parse().ok()?, high.parse().ok()?))
    };
    parts().ok_or_else(|| {
        Failure::input(format!(
            "--limits: {rule:?} is not JOINT=LOW..HIGH, for example knee=-2.5..-0.3"
        ))
    })
}

/// Whether `name` is `pattern`, in which one `*` stands for anything.
fn matches(pattern: &str, name: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == name,
        Some((head, tail)) => {
            name.len() >= head.len() + tail.len() && name.starts_with(head) && name.ends_with(tail)
        }
    }
}

fn legs(args: &LeggedArgs, model: &RobotModel) -> Result<(Vec<Leg>, Facing), Failure> {
    let known = match (&args.forward, &args.up) {
        (None, None) => None,
        (forward, up) => {
            let (forward, up) = (
                forward.as_deref().unwrap_or("x"),
                up.as_deref().unwrap_or("z"),
            );
            let facing = Facing::named(forward, up).ok_or_else(|| {
                Failure::input(format!(
                    "--forward {forward} --up {up}: give two axes at right angles out of x, -x, y, -y, z, -z"
                ))
            })?;
            Some(facing)
        }
    };
    if args.legs.is_empty() {
        return Leg::find_all_facing(model, known)
            .map_err(|e| Failure::input(format!("{}: {e}", args.urdf.display())));
    }
    let legs = args
        .legs
        .iter()
        .map(|pair| {
            let (leg, link) = pair.split_once('=').ok_or_else(|| {
                Failure::input(format!(
                    "--legs: {pair:?} is not LEG=LINK, for example front_left=FL_foot"
                ))
            })?;
            Leg::to_foot(model, leg, link).map_err(|e| Failure::input(format!("--legs: {e}")))
        })
        .collect::<Result<Vec<_>, _>>()?;
    let facing = known.unwrap_or_else(|| Leg::facing(model, &legs));
    Ok((legs, facing))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_stands_for_anything() {
        assert!(matches("*_KFE", "FL_KFE") && matches("FL_*", "FL_KFE") && matches("*", "x"));
        assert!(!matches("*_KFE", "FL_HFE") && !matches("FL_KFE", "FL_KFE2"));
        assert!(!matches("ab*ba", "aba"));
    }

    #[test]
    fn range_rules_are_read_or_explained() {
        assert_eq!(range_rule("a=-1..0.5").ok(), Some(("a", -1.0, 0.5)));
        for wrong in ["a", "a=1", "a=x..1", "=.."] {
            assert!(range_rule(wrong).is_err(), "{wrong}");
        }
    }
}
