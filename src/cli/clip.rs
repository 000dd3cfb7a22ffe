//! `handwave clip`: bring motion in and out; author gaits for a legged URDF; look into a clip.

mod export;
mod import;
mod source;

use super::{ExitStatus, Failure, say, warn};
use crate::motion::clip::{ClipFile, ClipKind};
use crate::motion::gait::{GaitDescription, GaitName};
use crate::motion::gait_frames::{Authored, author, outside_limits};
use crate::motion::range::JointRange;
use crate::robot::{Leg, RobotModel};
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};

/// Arguments of `handwave clip`.
#[derive(Args, Debug)]
pub struct ClipArgs {
    #[command(subcommand)]
    command: ClipCommand,
}

#[derive(Subcommand, Debug)]
enum ClipCommand {
    /// Bring a motion of another program in: glTF, BVH, AMC, joint-space JSON and CSV
    #[command(after_help = import::EXAMPLES)]
    Import(Box<import::ImportArgs>),
    /// Write a clip for other programs: BVH, CSV, glTF
    #[command(after_help = export::EXAMPLES)]
    Export(Box<export::ExportArgs>),
    /// Turn a gait description and a URDF with legs into a joint-space clip
    #[command(after_help = "Examples:
  handwave clip gait --urdf dog.urdf --gait trot --out trot.json
  handwave clip gait --urdf dog.urdf --gait walk --stride 0.1 --frequency 1.2 --out walk.json
  handwave clip gait --urdf dog.urdf --gait my_gait.toml --out my_gait.json

A gait is a preset (walk, trot, pace, bound, stand) or a description file, in which
poses of the body can also be strung together (bow, crouch). What the joints are too
slow for is shortened, with a note; --strict refuses it instead.")]
    Gait(Box<GaitArgs>),
    /// Show what is in a clip: joints, frames, cycle, travel, limbs, ranges
    Info {
        /// The clip
        file: PathBuf,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
    },
}

#[derive(Args, Debug)]
struct GaitArgs {
    /// Robot description
    #[arg(long)]
    urdf: PathBuf,
    /// Preset (walk, trot, pace, bound, stand) or description file (.toml)
    #[arg(long)]
    gait: String,
    /// Where to write the clip
    #[arg(long)]
    out: PathBuf,
    /// Feet by leg, when they cannot be found: front_left=LINK,front_right=LINK,...
    #[arg(long, value_delimiter = ',', value_name = "LEG=LINK")]
    legs: Vec<String>,
    /// Name of the clip (default: that of the description, or the preset)
    #[arg(long)]
    name: Option<String>,
    /// Cycles per second it must be able to play, Hz
    #[arg(long)]
    frequency: Option<f64>,
    /// Body travel per cycle, m
    #[arg(long, allow_negative_numbers = true)]
    stride: Option<f64>,
    /// Fraction of the cycle a foot is on the ground
    #[arg(long)]
    duty: Option<f64>,
    /// Foot clearance in swing, m
    #[arg(long)]
    lift: Option<f64>,
    /// Height of the root link above the feet, m
    #[arg(long)]
    height: Option<f64>,
    /// Turn per cycle, rad, counter-clockwise
    #[arg(long, allow_negative_numbers = true)]
    turn: Option<f64>,
    /// Acceleration every joint may use, rad/s^2 (a URDF does not tell)
    #[arg(long, default_value_t = 120.0)]
    max_acceleration: f64,
    /// Refuse what the joints cannot do instead of shortening the stride
    #[arg(long)]
    strict: bool,
}

/// Runs `handwave clip ...`.
pub fn run(args: &ClipArgs) -> Result<ExitStatus, Failure> {
    match &args.command {
        ClipCommand::Import(args) => import::run(args),
        ClipCommand::Export(args) => export::run(args),
        ClipCommand::Gait(args) => gait(args),
        ClipCommand::Info { file, json } => info(file, *json),
    }
}

fn read(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path)
        .map_err(|e| Failure::input(format!("cannot read {}: {e}", path.display())))
}

fn gait(args: &GaitArgs) -> Result<ExitStatus, Failure> {
    let in_urdf =
        |e: &dyn std::fmt::Display| Failure::input(format!("{}: {e}", args.urdf.display()));
    let model = RobotModel::from_urdf(&read(&args.urdf)?).map_err(|e| in_urdf(&e))?;
    for warning in &model.warnings {
        warn(format_args!("warning: {}: {warning}", args.urdf.display()));
    }
    let legs = if args.legs.is_empty() {
        let legs = Leg::find_all(&model).map_err(|e| in_urdf(&e))?;
        let found: Vec<String> = legs
            .iter()
            .map(|l| format!("{}={}", l.name, model.links[l.foot]))
            .collect();
        warn(format_args!("legs found: {}", found.join(",")));
        legs
    } else {
        declared_legs(&model, &args.legs)?
    };
    if !(args.max_acceleration > 0.0) {
        return Err(Failure::input("--max-acceleration must be above 0 rad/s^2"));
    }
    let ranges: Vec<JointRange> = model
        .limits()
        .iter()
        .map(|l| JointRange {
            velocity: l.velocity,
            acceleration: args.max_acceleration,
        })
        .collect();
    let description = description(args)?;
    let authored = author(&description, &model, &legs, &ranges, args.strict)
        .map_err(|e| Failure::input(format!("{}: {e}", args.gait)))?;
    std::fs::write(&args.out, authored.file.to_json())
        .map_err(|e| Failure::input(format!("cannot write {}: {e}", args.out.display())))?;
    report(args, &authored, &model)
}

fn declared_legs(model: &RobotModel, pairs: &[String]) -> Result<Vec<Leg>, Failure> {
    pairs
        .iter()
        .map(|pair| {
            let (leg, link) = pair.split_once('=').ok_or_else(|| {
                Failure::input(format!(
                    "--legs: {pair:?} is not LEG=LINK, for example front_left=FL_foot"
                ))
            })?;
            Leg::to_foot(model, leg, link).map_err(|e| Failure::input(format!("--legs: {e}")))
        })
        .collect()
}

fn description(args: &GaitArgs) -> Result<GaitDescription, Failure> {
    let mut description = match GaitName::by_name(&args.gait) {
        Some(preset) => GaitDescription::preset(&args.gait, preset),
        None => {
            let path = Path::new(&args.gait);
            if !path.exists() {
                let names: Vec<&str> = GaitName::ALL.iter().map(|(n, _)| *n).collect();
                return Err(Failure::input(format!(
                    "--gait {}: neither a preset ({}) nor a file",
                    args.gait,
                    names.join(", ")
                )));
            }
            GaitDescription::from_toml(&read(path)?)
                .map_err(|e| Failure::input(format!("{}: {e}", args.gait)))?
        }
    };
    if let Some(name) = &args.name {
        description.name = name.clone();
    }
    description.frequency_hz = args.frequency.or(description.frequency_hz);
    description.stride_m = args.stride.or(description.stride_m);
    description.duty_factor = args.duty.or(description.duty_factor);
    description.step_height_m = args.lift.or(description.step_height_m);
    description.body_height_m = args.height.or(description.body_height_m);
    description.turn_rad = args.turn.unwrap_or(description.turn_rad);
    Ok(description)
}

fn report(args: &GaitArgs, authored: &Authored, model: &RobotModel) -> Result<ExitStatus, Failure> {
    let file = &authored.file;
    say(format_args!(
        "{}: {} frames, {} joints, {:.3} m per cycle",
        args.out.display(),
        file.frames.len(),
        file.joints.len(),
        file.root.forward_m
    ));
    if let Some((max_hz, joint)) = &authored.max_frequency {
        say(format_args!(
            "playable up to {max_hz:.2} Hz ({joint} decides)"
        ));
    }
    if authored.stride_kept < 1.0 {
        say(format_args!(
            "note: stride and step height were shortened to {:.0} % so that the joints can play {:.2} Hz",
            authored.stride_kept * 100.0,
            file.frequency_hz
        ));
    }
    let clip = file
        .for_body(&file.joints)
        .map_err(|e| Failure::input(e.to_string()))?;
    for line in outside_limits(&clip, model) {
        say(format_args!("warning: {line}"));
    }
    Ok(ExitStatus::Done)
}

fn info(path: &Path, json: bool) -> Result<ExitStatus, Failure> {
    let file = ClipFile::from_json(&read(path)?)
        .map_err(|e| Failure::input(format!("{}: {e}", path.display())))?;
    if json {
        let summary = serde_json::json!({
            "name": file.name, "kind": file.kind, "origin": file.origin,
            "frames": file.frames.len(), "joints": file.joints,
            "frequency_hz": file.frequency_hz, "root": file.root, "segments": file.segments,
        });
        say(format_args!("{summary}"));
        return Ok(ExitStatus::Done);
    }
    let kind = match file.kind {
        ClipKind::Cycle => "cycle",
        ClipKind::Path => "path",
    };
    say(format_args!(
        "{} ({kind}, {} frames) {}",
        file.name,
        file.frames.len(),
        file.origin
    ));
    if file.kind == ClipKind::Cycle {
        say(format_args!(
            "made for {:.2} Hz; per cycle {:.3} m forwards, {:.3} m left, {:.3} rad",
            file.frequency_hz, file.root.forward_m, file.root.left_m, file.root.yaw_rad
        ));
    }
    for s in &file.segments {
        say(format_args!(
            "  limb {:<12} phase {:.2}  duty {:.2}  {}",
            s.name,
            s.phase,
            s.duty,
            s.joints.join(" ")
        ));
    }
    for (j, joint) in file.joints.iter().enumerate() {
        let (low, high) = file
            .frames
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), f| {
                (lo.min(f[j]), hi.max(f[j]))
            });
        say(format_args!(
            "  joint {joint:<20} {low:>7.3} .. {high:>6.3} rad"
        ));
    }
    Ok(ExitStatus::Done)
}
