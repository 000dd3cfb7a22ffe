//! `handwave clip`: bring motion in and out; author gaits for a legged URDF; look into a clip.

mod export;
mod import;
mod source;

mod gait;

use super::{ExitStatus, Failure, say};
use crate::motion::clip::{ClipFile, ClipKind};
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
    #[command(after_help = gait::EXAMPLES)]
    Gait(Box<gait::GaitArgs>),
    /// Show what is in a clip: joints, frames, cycle, travel, limbs, ranges
    Info {
        /// The clip
        file: PathBuf,
        /// Print one JSON object
        #[arg(long)]
        json: bool,
    },
}

/// Runs `handwave clip ...`.
pub fn run(args: &ClipArgs) -> Result<ExitStatus, Failure> {
    match &args.command {
        ClipCommand::Import(args) => import::run(args),
        ClipCommand::Export(args) => export::run(args),
        ClipCommand::Gait(args) => gait::run(args),
        ClipCommand::Info { file, json } => info(file, *json),
    }
}

fn read(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path)
        .map_err(|e| Failure::input(format!("cannot read {}: {e}", path.display())))
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
