//! `handwave gesture`: define gestures, estimate their waves over a recording, check a set.

mod check;
mod define;
mod estimate;
mod report;
mod teach;

use super::{ExitStatus, Failure};
use crate::gesture::GestureSet;
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
    /// Define a gesture from one example, marked in a recording or shown live.
    #[command(after_help = "Examples:
  handwave gesture define --poses waiting.csv --name drum --start 0.52 --into hand.toml
      one period from the start mark; its end is found
  handwave gesture define --poses waiting.csv --name drum --start 0.52 --end 1.60 --into hand.toml
  handwave gesture define --poses splay.csv --name splay --rest 0.60 --extreme 0.90 --into hand.toml
      a movement that does not repeat
  handwave gesture define --input udp://7000 --name wave --into hand.toml
      live: space (Enter, Page Down: presenter remotes, pedals) begins; the end is found after two to three
      periods, or marked by another press; then space keeps it, r is once more, q leaves
  handwave gesture define --input udp://7000 --name wave --start-after 3 --into hand.toml
      hands-free: three seconds after the first pose
  handwave gesture define --input udp://7000 --name bow --kind non-cyclic --start-after 3 --into hand.toml
      hold the rest pose until the count-down ends, go to the extreme and stay (or come back)
  handwave gesture define --input file:waiting.csv --name drum --start-after 0.5 --speed max --into hand.toml

Adds to the gesture file, or replaces the gesture of the same name. Live, a bar shows how new the movement
is against what is defined already: red is known and will be confused, green is new. A quality report
follows; a gesture that reads less than 0.2 of itself when it is played back cannot start anything and is
not written (exit 2) without --force. A recording's marks are taken as they are, with warnings.")]
    Define(Box<define::DefineArgs>),
    /// Run an estimator over a recording: one row per gesture and sample.
    #[command(after_help = "Examples:
  handwave gesture estimate --gestures hand.toml --poses performance.jsonl --out waves.csv

Columns: t,gesture,amplitude,frequency_hz,phase_rad,quality. Amplitude 1 is as large as shown, not
clamped; phase in [0, 2 pi); the frequency is negative in the opposite sense. Non-cyclic gestures:
amplitude is the progression, frequency 0. A sample that is dropped has no row.")]
    Estimate {
        /// The gesture file.
        #[arg(long)]
        gestures: PathBuf,
        /// The pose stream (.jsonl or .csv).
        #[arg(long)]
        poses: PathBuf,
        /// Where to write the estimates (CSV).
        #[arg(long)]
        out: PathBuf,
        /// default, gabor.
        #[arg(long, default_value = "default")]
        estimator: String,
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

First table: the frames of one gesture shown to the plane of another. A plane should answer 1 to its own
gesture and 0 to all others; above 0.2 the two may be confused. Second table: every gesture performed at 0.5,
1 and 1.5 times its speed and at half and full size through the whole estimator, and what every gesture then
reads. Then a verdict on each, with advice. --json: one row per line, \"table\" says which.")]
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
        } => estimate::estimate(&gestures, &poses, &out, &estimator),
        GestureCommand::List { gestures, json } => check::list(&gestures, json),
        GestureCommand::Check { gestures, json } => check::check(&gestures, json),
    }
}

fn load(path: &Path) -> Result<GestureSet, Failure> {
    GestureSet::load(path).map_err(Failure::input)
}
