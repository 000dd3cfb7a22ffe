//! `handwave gesture`: define gestures, estimate their waves over a recording, check a set.

use super::{ExitStatus, Failure, poses, say, warn};
use crate::base::suggest;
use crate::gesture::{
    CyclicMarks, Definition, EstimatorKind, FrontEnd, FrontEndOptions, GestureKind, GestureSet,
    NonCyclicMarks, define_cyclic, define_non_cyclic, responses,
};
use crate::pose::Recording;
use clap::{Args, Subcommand};
use std::fs::File;
use std::io::{BufWriter, Write};
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
    Define(DefineArgs),
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

#[derive(Args, Debug)]
struct DefineArgs {
    /// The recording (.jsonl or .csv).
    #[arg(long)]
    poses: PathBuf,
    /// Name of the gesture.
    #[arg(long)]
    name: String,
    /// Start of one period, seconds on the recording's clock.
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    start: Option<f64>,
    /// End of the period; found when not given.
    #[arg(
        long,
        value_name = "T",
        requires = "start",
        allow_negative_numbers = true
    )]
    end: Option<f64>,
    /// The rest pose of a movement that does not repeat.
    #[arg(
        long,
        value_name = "T",
        requires = "extreme",
        conflicts_with = "start",
        allow_negative_numbers = true
    )]
    rest: Option<f64>,
    /// Its extreme pose.
    #[arg(
        long,
        value_name = "T",
        requires = "rest",
        allow_negative_numbers = true
    )]
    extreme: Option<f64>,
    /// The gesture file to add to; made when it does not exist.
    #[arg(long, value_name = "GESTURES.toml")]
    into: PathBuf,
}

/// Runs `handwave gesture`.
///
/// # Errors
/// Bad input, with exit code 2.
pub fn run(args: GestureArgs) -> Result<ExitStatus, Failure> {
    match args.command {
        GestureCommand::Define(args) => define(&args),
        GestureCommand::Estimate {
            gestures,
            poses,
            out,
            estimator,
        } => estimate(&gestures, &poses, &out, &estimator),
        GestureCommand::List { gestures, json } => list(&gestures, json),
        GestureCommand::Check { gestures, json } => check(&gestures, json),
    }
}

fn load(path: &Path) -> Result<GestureSet, Failure> {
    GestureSet::load(path).map_err(Failure::input)
}

fn define(args: &DefineArgs) -> Result<ExitStatus, Failure> {
    if args.name.is_empty() || args.name.contains([',', '"', '\n', '\r']) {
        return Err(Failure::input(format!(
            "--name {:?}: a name is not empty and has no comma, quote or line end",
            args.name
        )));
    }
    let (recording, _) = poses::read(&args.poses)?;
    let mut set = if args.into.exists() {
        load(&args.into)?
    } else {
        GestureSet::new(&recording.header, Vec::new())
    };
    let file = args
        .poses
        .file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let failed = |error| Failure::input(format!("{}: {error}", args.poses.display()));
    let definition = match (args.start, args.rest, args.extreme) {
        (Some(start_s), None, None) => {
            let source = format!("{file} from {start_s} s");
            let marks = CyclicMarks {
                start_s,
                end_s: args.end,
            };
            define_cyclic(&set, &recording, &args.name, &source, marks).map_err(failed)?
        }
        (None, Some(rest_s), Some(extreme_s)) => {
            let source = format!("{file}, rest {rest_s} s, extreme {extreme_s} s");
            let marks = NonCyclicMarks { rest_s, extreme_s };
            define_non_cyclic(&set, &recording, &args.name, &source, marks).map_err(failed)?
        }
        _ => {
            return Err(Failure::input(
                "a gesture needs marks: --start T [--end T] where it repeats, --rest T --extreme T where it does not",
            ));
        }
    };
    report(&definition);
    let replaced = set.put(definition.gesture);
    warn_of_confusion(&set);
    set.save(&args.into).map_err(Failure::input)?;
    say(format_args!(
        "{}: {} `{}` ({} gestures)",
        args.into.display(),
        if replaced { "replaced" } else { "added" },
        args.name,
        set.gestures.len()
    ));
    Ok(ExitStatus::Done)
}

fn report(definition: &Definition) {
    let gesture = &definition.gesture;
    match gesture.kind {
        GestureKind::Cyclic => {
            let repeats = definition
                .periodicity
                .map_or_else(String::new, |value| format!(", autocorrelation {value:.2}"));
            say(format_args!(
                "`{}`: one period of {:.3} s ({:.2} Hz), {} frames, closes within {:.2} of its size{repeats}",
                gesture.name,
                gesture.duration_s,
                1.0 / gesture.duration_s,
                gesture.frames.len(),
                definition.closure
            ));
        }
        GestureKind::NonCyclic => say(format_args!(
            "`{}`: rest to extreme in {:.3} s, {} frames",
            gesture.name,
            gesture.duration_s,
            gesture.frames.len()
        )),
    }
}

/// Says on standard error which gestures answer to one another.
fn warn_of_confusion(set: &GestureSet) {
    for response in responses(set).into_iter().flatten() {
        if response.gesture != response.shown && response.largest > 0.2 {
            warn(format_args!(
                "`{}` answers {:.2} to frames of `{}`: the two may be confused; make them differ more",
                set.gestures[response.gesture].name,
                response.largest,
                set.gestures[response.shown].name
            ));
        }
    }
}

fn estimate(
    gestures: &Path,
    poses: &Path,
    out: &Path,
    estimator: &str,
) -> Result<ExitStatus, Failure> {
    let kind = EstimatorKind::from_name(estimator).ok_or_else(|| {
        let names = EstimatorKind::NAMES;
        let hint = suggest::nearest(estimator, names)
            .map_or_else(String::new, |name| format!("; did you mean {name}?"));
        Failure::input(format!(
            "--estimator {estimator}: allowed: {}{hint}",
            names.join(", ")
        ))
    })?;
    let set = load(gestures)?;
    let (recording, _) = poses::read(poses)?;
    let options = FrontEndOptions {
        estimator: kind,
        ..FrontEndOptions::default()
    };
    let mut front = FrontEnd::new(&set, &recording.header, options)
        .map_err(|error| Failure::input(format!("{}: {error}", poses.display())))?;
    let failed = |error: std::io::Error| {
        Failure::input(format!(
            "{}: cannot be written: {error}; check the folder and its permissions",
            out.display()
        ))
    };
    let mut file = BufWriter::new(File::create(out).map_err(failed)?);
    let refused = write_estimates(&mut file, &set, &recording, &mut front).map_err(failed)?;
    if refused > 0 {
        warn(format_args!(
            "{}: {refused} samples without estimate: too few points seen",
            poses.display()
        ));
    }
    Ok(ExitStatus::Done)
}

/// Writes one row per gesture and sample; returns how many samples the front end refused.
fn write_estimates(
    file: &mut impl Write,
    set: &GestureSet,
    recording: &Recording,
    front: &mut FrontEnd,
) -> std::io::Result<u64> {
    writeln!(file, "t,gesture,amplitude,frequency_hz,phase_rad,quality")?;
    let mut refused = 0;
    for sample in &recording.samples {
        // A sample with too few points changes nothing: what the puppet would go on with is the
        // last estimate carried to this instant.
        let coasting = front.push(sample).is_err();
        refused += u64::from(coasting);
        for (index, gesture) in set.gestures.iter().enumerate() {
            let estimate = front.predict(index, sample.t);
            // Rounded up, an angle just under a full turn would print as one.
            let phase = (estimate.phase_rad * 1e6).floor() * 1e-6;
            writeln!(
                file,
                "{},{},{:.6},{:.6},{:.6},{:.4}",
                sample.t,
                gesture.name,
                estimate.amplitude,
                estimate.frequency_hz,
                phase,
                estimate.quality
            )?;
        }
    }
    file.flush()?;
    Ok(refused)
}

fn list(path: &Path, json: bool) -> Result<ExitStatus, Failure> {
    let set = load(path)?;
    if !json {
        say(format_args!(
            "{:<16} {:<10} {:>10} {:>7}  source",
            "gesture", "kind", "duration_s", "frames"
        ));
    }
    for gesture in &set.gestures {
        if json {
            let object = serde_json::json!({
                "gesture": gesture.name, "kind": gesture.kind.name(),
                "duration_s": gesture.duration_s, "frames": gesture.frames.len(),
                "source": gesture.source,
            });
            say(format_args!("{object}"));
        } else {
            say(format_args!(
                "{:<16} {:<10} {:>10.3} {:>7}  {}",
                gesture.name,
                gesture.kind.name(),
                gesture.duration_s,
                gesture.frames.len(),
                gesture.source
            ));
        }
    }
    Ok(ExitStatus::Done)
}

fn check(path: &Path, json: bool) -> Result<ExitStatus, Failure> {
    let set = load(path)?;
    let table = responses(&set).map_err(|anchor| {
        Failure::input(format!(
            "{}: global.anchor {anchor:?} is none of the points",
            path.display()
        ))
    })?;
    if !json {
        say(format_args!(
            "{:<16} {:<16} {:>7} {:>8}  ",
            "plane of", "shown", "mean", "largest"
        ));
    }
    for response in table {
        let plane = &set.gestures[response.gesture].name;
        let shown = &set.gestures[response.shown].name;
        let confusable = response.gesture != response.shown && response.largest > 0.2;
        if json {
            let object = serde_json::json!({
                "gesture": plane, "shown": shown, "mean": response.mean,
                "largest": response.largest, "confusable": confusable,
            });
            say(format_args!("{object}"));
        } else {
            say(format_args!(
                "{plane:<16} {shown:<16} {:>7.3} {:>8.3}  {}",
                response.mean,
                response.largest,
                if confusable { "may be confused" } else { "" }
            ));
        }
    }
    Ok(ExitStatus::Done)
}
