//! `handwave gesture define`: a gesture from one example in a recording.

use super::load;
use crate::cli::{ExitStatus, Failure, poses, say, warn};
use crate::gesture::{
    CyclicMarks, Definition, GestureKind, GestureSet, NonCyclicMarks, define_cyclic,
    define_non_cyclic, responses,
};
use clap::Args;
use std::path::PathBuf;

/// Marks in a recording.
#[derive(Args, Debug)]
pub(super) struct DefineArgs {
    /// The recording (.jsonl, .csv or .bvh).
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

pub(super) fn define(args: &DefineArgs) -> Result<ExitStatus, Failure> {
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
