//! `handwave clip`: bring motion in and out; author gaits for a legged URDF; look into a clip.

mod blend;
mod export;
mod gait;
mod import;
mod info;
mod source;

use super::{ExitStatus, Failure};
use clap::{Args, Subcommand};

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
    /// Blend two gaits at several weights: slide of the feet, hanging legs
    #[command(after_help = blend::EXAMPLES)]
    Blend(Box<blend::BlendArgs>),
    /// Write a clip for other programs: BVH, CSV, glTF
    #[command(after_help = export::EXAMPLES)]
    Export(Box<export::ExportArgs>),
    /// Turn a gait description and a URDF with legs into a joint-space clip
    #[command(after_help = gait::EXAMPLES)]
    Gait(Box<gait::GaitArgs>),
    /// Show what a motion is: cycle, speed, contacts, symmetry, quality
    #[command(after_help = info::EXAMPLES)]
    Info(Box<info::InfoArgs>),
}

/// Runs `handwave clip ...`.
pub fn run(args: &ClipArgs) -> Result<ExitStatus, Failure> {
    match &args.command {
        ClipCommand::Import(args) => import::run(args),
        ClipCommand::Blend(args) => blend::run(args),
        ClipCommand::Export(args) => export::run(args),
        ClipCommand::Gait(args) => gait::run(args),
        ClipCommand::Info(args) => info::run(args),
    }
}
