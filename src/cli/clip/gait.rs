//! `handwave clip gait`: author gaits and poses for a legged URDF.

use crate::cli::disk::{self, read};
use crate::cli::legged::{Legged, LeggedArgs, load};
use crate::cli::{ExitStatus, Failure, say};
use crate::motion::gait::{GaitDescription, GaitName};
use crate::motion::gait_frames::{Authored, author, outside_limits};
use clap::Args;
use std::path::{Path, PathBuf};

/// Shown after the help.
pub(super) const EXAMPLES: &str = "Examples:
  handwave clip gait --urdf dog.urdf --gait trot --out trot.json
  handwave clip gait --urdf dog.urdf --gait walk --stride 0.1 --frequency 1.2 --out walk.json
  handwave clip gait --urdf dog.urdf --gait trot --stride 0 --turn 0.3 --out turn_left.json
  handwave clip gait --urdf hexapod.urdf --gait tripod --out tripod.json
  handwave clip gait --urdf dog.urdf --gait my_gait.toml --out my_gait.json

A gait is a preset or a description file, in which poses of the body and of single feet
can also be strung together (bow, sit, shake hands). Presets for four legs: walk, trot,
pace, bound, gallop, rotary_gallop, pronk; for six: tripod, ripple, wave; for both: stand.
What the joints are too slow for is shortened, with a note; --strict refuses it instead.
`handwave character new` makes a whole character at once.";

/// Arguments of `handwave clip gait`.
#[derive(Args, Debug)]
pub(super) struct GaitArgs {
    #[command(flatten)]
    robot: LeggedArgs,
    /// Preset (walk, trot, tripod, ...) or description file (.toml)
    #[arg(long)]
    gait: String,
    /// Where to write the clip
    #[arg(long)]
    out: PathBuf,
    /// Name of the clip (default: that of the description, or the preset)
    #[arg(long)]
    name: Option<String>,
    /// Cycles per second it must be able to play, Hz
    #[arg(long)]
    frequency: Option<f64>,
    /// Body travel per cycle, m
    #[arg(long, allow_negative_numbers = true)]
    stride: Option<f64>,
    /// Body travel to the left per cycle, m
    #[arg(long, allow_negative_numbers = true)]
    left: Option<f64>,
    /// Turn per cycle, rad, counter-clockwise; with --stride 0 in place
    #[arg(long, allow_negative_numbers = true)]
    turn: Option<f64>,
    /// Fraction of the cycle a foot is on the ground
    #[arg(long)]
    duty: Option<f64>,
    /// Foot clearance in swing, m
    #[arg(long)]
    lift: Option<f64>,
    /// Height of the root link above the feet, m
    #[arg(long)]
    height: Option<f64>,
    /// Feet this much further out on each side, m
    #[arg(long, allow_negative_numbers = true)]
    width: Option<f64>,
    /// Refuse what the joints cannot do instead of shortening the stride
    #[arg(long)]
    strict: bool,
}

/// Runs `handwave clip gait ...`.
pub(super) fn run(args: &GaitArgs) -> Result<ExitStatus, Failure> {
    let description = description(args)?;
    let robot = load(&args.robot)?;
    let authored = author(&description, robot.walker(), args.strict)
        .map_err(|e| Failure::input(format!("{}: {e}", args.gait)))?;
    disk::write(&args.out, authored.file.to_json())?;
    report(&args.out, &authored, &robot)
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
    description.left_m = args.left.unwrap_or(description.left_m);
    description.duty_factor = args.duty.or(description.duty_factor);
    description.step_height_m = args.lift.or(description.step_height_m);
    description.body_height_m = args.height.or(description.body_height_m);
    description.turn_rad = args.turn.unwrap_or(description.turn_rad);
    description.stance_width_m = args.width.unwrap_or(description.stance_width_m);
    Ok(description)
}

fn report(out: &Path, authored: &Authored, robot: &Legged) -> Result<ExitStatus, Failure> {
    let file = &authored.file;
    let turn = match file.root.yaw_rad {
        0.0 => String::new(),
        yaw => format!(" and {yaw:.3} rad"),
    };
    say(format_args!(
        "{}: {} frames, {} joints, {:.3} m{turn} per cycle",
        out.display(),
        file.frames.len(),
        file.joints.len(),
        file.root.forward_m
    ));
    if let Some((max_hz, joint)) = &authored.max_frequency {
        say(format_args!(
            "made for {:.2} Hz, playable up to {max_hz:.2} Hz ({joint} decides); feet stay on their spots within {:.2} mm",
            file.frequency_hz,
            authored.stance_error_m * 1e3
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
    for line in outside_limits(&clip, &robot.model) {
        say(format_args!("warning: {line}"));
    }
    Ok(ExitStatus::Done)
}
