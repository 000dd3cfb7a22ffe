//! What a character moves: a robot on its bus, or an avatar.

use super::avatar::{Avatar, coordinate_names};
use super::body::Body;
use super::buses::bus_lines;
use super::error::{ConfigError, Pointer};
use super::file::{AvatarEntry, CharacterFile, RobotEntry};
use super::files::Files;
use super::motion::read;
use super::servos::servo_map;
use crate::bus::dynamixel::ServoSpec;
use crate::bus::{BusAddress, Buses};
use crate::robot::{JointEnvelope, RobotModel};

/// What is driven, and what carries the targets to it.
pub(super) struct Parts {
    pub(super) model: Option<RobotModel>,
    pub(super) body: Body,
    pub(super) joints: Vec<String>,
    pub(super) limits: Vec<JointEnvelope>,
    pub(super) servos: Vec<ServoSpec>,
    pub(super) wire: WireParts,
}

/// How targets are carried.
pub(super) struct WireParts {
    pub(super) bus: Buses,
    pub(super) rate_hz: f64,
    pub(super) watchdog_ms: u32,
}

/// A robot on its bus, or an avatar.
pub(super) fn parts(
    files: &Files,
    file: &CharacterFile,
    at: &Pointer<'_>,
) -> Result<Parts, ConfigError> {
    let (robot, buses) = match (&file.robot, &file.bus, &file.avatar) {
        (Some(robot), Some(buses), None) => (robot, buses),
        (None, None, Some(avatar)) => return avatar_parts(files, avatar, at),
        (Some(_), _, Some(avatar)) => {
            let problem =
                "a character is a robot or an avatar: leave out [robot] and [bus], or [avatar]";
            return Err(at.at(avatar.model.span(), "avatar", problem));
        }
        (None, Some(_), Some(_)) => {
            let problem = "an avatar has no servos: leave [bus] out (rate_hz stands in [avatar])";
            return Err(at.key("bus.bus", problem));
        }
        (Some(robot), None, None) => {
            let problem = "a robot needs a bus; add [bus] with bus = \"sim\"";
            return Err(at.at(robot.urdf.span(), "bus", problem));
        }
        (None, _, None) => {
            let problem =
                "nothing to move: add [robot] with urdf and [bus], or [avatar] with model";
            return Err(at.key("robot", problem));
        }
    };
    let model = RobotModel::from_urdf(&read(files, &robot.urdf, "robot.urdf", at)?)
        .map_err(|e| at.at(robot.urdf.span(), "robot.urdf", e))?;
    let lines = bus_lines(buses, at)?;
    let (servos, of_joint) = servo_map(robot, &buses.0, &model, at)?.into_iter().unzip();
    let (rate_hz, watchdog_ms) = buses
        .0
        .first()
        .map_or((0.0, 0), |bus| (bus.rate_hz, bus.watchdog_ms));
    Ok(Parts {
        body: Body::new(&model, robot, at)?,
        joints: model.joint_names(),
        limits: envelope_limits(robot, &model),
        servos,
        model: Some(model),
        wire: WireParts {
            bus: Buses::several(lines, of_joint),
            rate_hz,
            watchdog_ms,
        },
    })
}

/// Limits that hold nothing back: an avatar's joints have none, and its coordinates are no angles.
const FREE: JointEnvelope = JointEnvelope {
    lower: -1e9,
    upper: 1e9,
    velocity: 1e9,
    acceleration: 1e12,
};

fn avatar_parts(
    files: &Files,
    entry: &AvatarEntry,
    at: &Pointer<'_>,
) -> Result<Parts, ConfigError> {
    let body = Body::of_avatar(Avatar::load(files, entry, at)?);
    let joints = coordinate_names(body.space.get());
    Ok(Parts {
        model: None,
        limits: vec![FREE; joints.len()],
        joints,
        body,
        servos: Vec::new(),
        wire: WireParts {
            bus: Buses::one(BusAddress::Sim, 0),
            rate_hz: entry.rate_hz,
            watchdog_ms: 0,
        },
    })
}

fn envelope_limits(robot: &RobotEntry, model: &RobotModel) -> Vec<JointEnvelope> {
    model
        .limits()
        .iter()
        .map(|l| JointEnvelope {
            lower: l.lower,
            upper: l.upper,
            velocity: l.velocity * robot.velocity_share,
            acceleration: robot.acceleration_rad_s2,
        })
        .collect()
}
