//! `handwave gesture`: define gestures, estimate their waves over a recording, check a set.

mod check;
mod define;
mod estimate;

use super::{ExitStatus, Failure};
use crate::gesture::{GestureSet, PerformerScale};
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};

/// Gestures: define, estimate, list, check.
#[derive(Args, Debug)]
pub struct GestureArgs {
    #[command(subcommand)]
    command: GestureCommand,
}

#[derive(Subcommand, Debug)]
enum GestureCommand {
    /// Define a gesture from one example in a recording.
    #[command(after_help = "Examples:
  handwave gesture define --poses waiting.csv --name drum --start 0.52 --into hand.toml
      one period from the start mark; its end is found
  handwave gesture define --poses waiting.csv --name drum --start 0.52 --end 1.60 --into hand.toml
  handwave gesture define --poses splay.csv --name splay --rest 0.60 --extreme 0.90 --into hand.toml
      a movement that does not repeat

Adds to the gesture file, or replaces the gesture of the same name.")]
    Define(define::DefineArgs),
    /// Run an estimator over a recording: one row per gesture and sample.
    #[command(after_help = "Examples:
  handwave gesture estimate --gestures hand.toml --poses performance.jsonl --out waves.csv
  handwave gesture estimate --gestures hand.toml --poses child.jsonl --scale 1.5 --out waves.csv

Columns: t,gesture,amplitude,frequency_hz,phase_rad,quality. Amplitude 1 is as large as shown, not
clamped; phase in [0, 2 pi); the frequency is negative in the opposite sense. Non-cyclic gestures:
amplitude is the progression, frequency 0. A sample that is dropped has no row.")]
    Estimate {
        /// The gesture file.
        #[arg(long)]
        gestures: PathBuf,
        /// The pose stream (.jsonl, .csv or .bvh).
        #[arg(long)]
        poses: PathBuf,
        /// Where to write the estimates (CSV).
        #[arg(long)]
        out: PathBuf,
        /// default, gabor.
        #[arg(long, default_value = "default")]
        estimator: String,
        /// Size of the gestures' reference by the performer's, or rest: measured over the first
        /// still second.
        #[arg(long, value_name = "NUMBER|rest", default_value = "1")]
        scale: PerformerScale,
    },
    /// The gestures of a file.
    #[command(after_help = "Examples:
  handwave gesture list --gestures hand.toml
  handwave gesture list --gestures hand.toml --json")]
    List {
        /// The gesture file.
        #[arg(long)]
        gestures: PathBuf,
        /// JSON Lines instead of a table.
        #[arg(long)]
        json: bool,
    },
    /// How well the gestures of a file can be told apart.
    #[command(after_help = "Examples:
  handwave gesture check --gestures hand.toml

Each row: the frames of one gesture shown to the plane of another. A plane should answer 1 to its
own gesture and 0 to all others; above 0.2 the two may be confused.")]
    Check {
        /// The gesture file.
        #[arg(long)]
        gestures: PathBuf,
        /// JSON Lines instead of a table.
        #[arg(long)]
        json: bool,
    },
}

/// Runs `handwave gesture`.
///
/// # Errors
/// Bad input, with exit code 2.
pub fn run(args: GestureArgs) -> Result<ExitStatus, Failure> {
    match args.command {
        GestureCommand::Define(args) => define::define(&args),
        GestureCommand::Estimate {
            gestures,
            poses,
            out,
            estimator,
            scale,
        } => estimate::estimate(&gestures, &poses, &out, &estimator, scale),
        GestureCommand::List { gestures, json } => check::list(&gestures, json),
        GestureCommand::Check { gestures, json } => check::check(&gestures, json),
    }
}

fn load(path: &Path) -> Result<GestureSet, Failure> {
    GestureSet::load(path).map_err(Failure::input)
}
