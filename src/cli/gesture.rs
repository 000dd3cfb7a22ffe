//! `handwave gesture`: define gestures, estimate their waves, check and share them, compare estimators.

mod check;
mod define;
mod estimate;
mod library;
mod report;
mod study;
mod teach;

use super::{ExitStatus, Failure};
use crate::gesture::{GestureSet, PerformerScale};
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};

/// Gestures: define, estimate, check, list, copy, remove.
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
    /// The gestures of files and folders.
    #[command(after_help = "Examples:
  handwave gesture list hand.toml
  handwave gesture list ~/gestures other.toml --json")]
    List {
        /// Gesture files, and folders that hold some.
        #[arg(value_name = "DIR|FILE", required_unless_present = "gestures")]
        places: Vec<PathBuf>,
        /// The gesture file (the same as naming it).
        #[arg(long)]
        gestures: Option<PathBuf>,
        /// JSON Lines instead of a table.
        #[arg(long)]
        json: bool,
    },
    /// Take a gesture from another file.
    #[command(after_help = "Examples:
  handwave gesture copy --from shared.toml --name wave --into hand.toml
  handwave gesture copy --from shared.toml --name wave --as hello --into hand.toml

Both files must track the same points (in any order). Lengths stay as they were shown. A new file is a copy of
the other one with this gesture alone.")]
    Copy {
        /// The file that has it.
        #[arg(long, value_name = "A.toml")]
        from: PathBuf,
        /// The gesture.
        #[arg(long)]
        name: String,
        /// Its name in the other file.
        #[arg(long, value_name = "NAME")]
        r#as: Option<String>,
        /// The file that gets it; made when it does not exist.
        #[arg(long, value_name = "B.toml")]
        into: PathBuf,
        /// In place of a gesture of that name.
        #[arg(long)]
        replace: bool,
    },
    /// Remove a gesture from a file.
    #[command(after_help = "Examples:
  handwave gesture remove --gestures hand.toml --name wave")]
    Remove {
        /// The gesture file.
        #[arg(long, alias = "from")]
        gestures: PathBuf,
        /// The gesture.
        #[arg(long)]
        name: String,
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
    /// Compare all wave estimators on the same sequences: CSV, plots and a short report.
    #[command(after_help = study::EXAMPLES)]
    Study(study::StudyArgs),
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
        GestureCommand::List {
            places,
            gestures,
            json,
        } => {
            let places: Vec<PathBuf> = places.into_iter().chain(gestures).collect();
            library::list(&places, json)
        }
        GestureCommand::Copy {
            from,
            name,
            r#as,
            into,
            replace,
        } => library::copy(&library::Copy {
            from: &from,
            name: &name,
            new_name: r#as.as_deref(),
            into: &into,
            replace,
        }),
        GestureCommand::Remove { gestures, name } => library::remove(&gestures, &name),
        GestureCommand::Check { gestures, json } => check::check(&gestures, json),
        GestureCommand::Study(args) => study::study(&args),
    }
}

fn load(path: &Path) -> Result<GestureSet, Failure> {
    GestureSet::load(path).map_err(Failure::input)
}
