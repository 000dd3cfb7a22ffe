//! `handwave bus play`: plays a recorded take on the servos, checked first, eased into and out of.

use super::ask::{Ask, interrupted};
use super::jog::failure;
use super::setup::progress;
use super::{crew, open_on, say};
use crate::base::Clock;
use crate::bus::BusAddress;
use crate::bus::dynamixel::ServoSpec;
use crate::bus::dynamixel::setup::plan::value;
use crate::cli::{ExitStatus, Failure};
use crate::live::RealClock;
use crate::live::drive::{Drive, DriveError};
use crate::live::playback::{Playback, Ramp};
use crate::motion::import::{self, ImportOptions};
use crate::motion::take::{Take, TakeBody};
use crate::robot::JointEnvelope;
use clap::Args;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;

/// Control cycles per second.
const RATE_HZ: f64 = 100.0;
/// Acceleration of servos without a configuration, rad/s^2.
const ACCELERATION_RAD_S2: f64 = 40.0;
/// After an interruption the joints brake for so long before torque goes off, seconds.
const BRAKE_S: f64 = 0.3;

/// Play a recorded take: limits checked before anything moves, a slow ramp to its first row, back where the robot stood, torque off.
#[derive(Args, Debug)]
#[command(after_help = "\
The take is a CSV as `handwave bus record` or `handwave run --targets` writes it: t,<joint>,... in seconds and radians.
With --config its joints are the robot's, and the robot's limits hold; without, columns are called servo_ID.
Joints without a column stay where they are. Ctrl-C: the joints brake and torque goes off.

Examples:
  handwave bus play --config my_arm.toml dynamixel:/dev/ttyUSB0 wave.csv
  handwave bus play dynamixel:/dev/ttyUSB0 take.csv --speed 0.5 --repeat 3")]
pub struct PlayArgs {
    /// The bus, such as dynamixel:/dev/ttyUSB0@1000000.
    #[arg(value_name = "BUS")]
    bus: BusAddress,
    /// The take.
    #[arg(value_name = "TAKE.csv")]
    take: PathBuf,
    /// The character whose servos these are.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Times the take's own speed.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = super::positive)]
    speed: f64,
    /// So many times.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
    /// Torque off at the last row, instead of back where the robot stood.
    #[arg(long)]
    stay: bool,
    /// Ask nothing.
    #[arg(long)]
    yes: bool,
}

pub fn play(args: &PlayArgs, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let take = read(args)?;
    let clock: Arc<dyn Clock> = Arc::new(RealClock::new());
    let character = args.config.as_deref().map(crew::character).transpose()?;
    // What can be refused without a bus is.
    if let Some(character) = &character {
        playback(args, take.clone(), &character.joints)?
            .check(&character.joints, &character.limits)
            .map_err(|e| named(args, e))?;
    }
    let mut client = open_on(&args.bus, Arc::clone(&clock))?;
    let (specs, limits) = match character {
        Some(character) => (character.servos, character.limits),
        None => of_take(&mut *client, &take)?,
    };
    crew::all_there(&mut *client, &specs)?;
    let joints: Vec<String> = specs.iter().map(|spec| spec.joint.clone()).collect();
    let playback = playback(args, take, &joints)?;
    playback
        .check(&joints, &limits)
        .map_err(|e| named(args, e))?;

    let mut ask = Ask::new(args.yes)?;
    let chain = crew::chain(client, specs, &args.bus, RATE_HZ, false)?;
    let mut drive =
        Drive::begin(Box::new(chain), clock, limits.clone(), RATE_HZ).map_err(failure)?;
    let rest: Vec<f64> = drive.positions().collect();
    let to_first = Ramp::new(rest.clone(), playback.at(0.0, &rest), &limits);
    let last = playback.at(playback.duration_s(), &rest);
    let again = Ramp::new(last.clone(), playback.at(0.0, &rest), &limits);
    let back = Ramp::new(last, rest.clone(), &limits);
    let question = format!(
        "{} joints move: {:.1} s to the first row, {:.1} s of the take{}{}. Is the way clear?",
        joints.len(),
        to_first.duration_s,
        playback.duration_s(),
        match args.repeat {
            1 => String::new(),
            n => format!(" {n} times"),
        },
        match args.stay {
            true => String::new(),
            false => format!(", {:.1} s back", back.duration_s),
        }
    );
    if !ask.confirm(out, &question, false)? {
        return Err(Failure::input("nothing was moved"));
    }
    drive.arm().map_err(failure)?;
    say(out, "moving; Ctrl-C brakes and turns torque off")?;
    let mut behind: f64 = 0.0;
    let mut run = || -> Result<bool, DriveError> {
        let mut part = |name: &str, duration_s: f64, pose: &dyn Fn(f64) -> Vec<f64>| {
            let begin = drive.now();
            loop {
                if ask.is_stopped() {
                    return Ok(true);
                }
                let t = drive.now().secs_since(begin);
                let wanted = pose(t);
                drive.step(&wanted)?;
                for (goal, wanted) in drive.goals().iter().zip(&wanted) {
                    behind = behind.max((goal - wanted).abs());
                }
                progress(Some(format_args!("{name} {t:.1} s")));
                if t >= duration_s {
                    return Ok(false);
                }
            }
        };
        if part("to the first row", to_first.duration_s, &|t| to_first.at(t))? {
            return Ok(true);
        }
        for round in 0..args.repeat {
            if round > 0 && part("to the first row", again.duration_s, &|t| again.at(t))? {
                return Ok(true);
            }
            if part("playing", playback.duration_s(), &|t| playback.at(t, &rest))? {
                return Ok(true);
            }
        }
        if !args.stay && part("back", back.duration_s, &|t| back.at(t))? {
            return Ok(true);
        }
        // What the envelope still holds back.
        let end = if args.stay {
            back.at(0.0)
        } else {
            rest.clone()
        };
        part("settling", BRAKE_S, &|_| end.clone())
    };
    let ended = run();
    progress(None);
    let stopped = ended.map_err(failure)?;
    if stopped {
        let brake = vec![f64::NAN; joints.len()];
        for _ in 0..(BRAKE_S * RATE_HZ) as u32 {
            drive.step(&brake).map_err(failure)?;
        }
    }
    let missed = drive.missed;
    let report = drive.finish().map_err(failure)?;
    if let Some((joint, reason)) = report.unconfirmed.first() {
        return Err(Failure::bus(format_args!(
            "torque off is not confirmed by {joint}: {reason}. Cut its power"
        )));
    }
    if stopped {
        return Err(interrupted(
            "interrupted; the joints have braked, torque is off",
        ));
    }
    say(
        out,
        format_args!(
            "played; torque is off at {} joints, as read back. At most {:.1} deg from the take by the limits, {missed} readings missed",
            report.confirmed_off.len(),
            behind.to_degrees()
        ),
    )?;
    Ok(ExitStatus::Done)
}

fn named(args: &PlayArgs, error: impl std::fmt::Display) -> Failure {
    Failure::input(format_args!("{}: {error}", args.take.display()))
}

fn read(args: &PlayArgs) -> Result<Take, Failure> {
    let imported = import::open(&args.take, &ImportOptions::default()).map_err(Failure::input)?;
    let take = imported.takes.into_iter().next();
    take.ok_or_else(|| named(args, "there is no motion in it"))
}

fn playback(args: &PlayArgs, take: Take, joints: &[String]) -> Result<Playback, Failure> {
    Playback::new(take, joints, args.speed).map_err(|e| named(args, e))
}

/// Servos by the take's columns, `servo_3`, with the limits that they have themselves.
fn of_take(
    client: &mut dyn crate::bus::dynamixel::Client,
    take: &Take,
) -> Result<(Vec<ServoSpec>, Vec<JointEnvelope>), Failure> {
    let TakeBody::Joints(names) = &take.body else {
        return Err(Failure::input(
            "this is no take of joint positions: expected a header `t,<joint>,...`",
        ));
    };
    let (mut specs, mut limits) = (Vec::new(), Vec::new());
    for name in names {
        let id = name.strip_prefix("servo_").and_then(|id| id.parse().ok());
        let id = id.ok_or_else(|| {
            Failure::input(format_args!(
                "column {name:?} is a joint's name: say with --config FILE which servo moves it. Without, columns are called servo_ID"
            ))
        })?;
        let spec = crew::spec_of(client, id)?;
        let top = value(client, id, spec.model, "velocity_limit")?;
        let velocity = top.map_or(3.0, |(_, counts)| {
            counts as f64 * spec.model.velocity_unit_rad_s
        });
        limits.push(JointEnvelope {
            lower: spec.position_rad(spec.min_pulse),
            upper: spec.position_rad(spec.max_pulse),
            velocity: velocity.max(0.1),
            acceleration: ACCELERATION_RAD_S2,
            jerk: f64::INFINITY,
        });
        specs.push(spec);
    }
    Ok((specs, limits))
}
