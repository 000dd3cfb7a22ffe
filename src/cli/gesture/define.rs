//! `handwave gesture define`: a gesture from one example, marked in a recording or shown live.

use super::report::{CONFUSABLE, describe};
use super::{load, teach};
use crate::cli::run::Speed;
use crate::cli::{ExitStatus, Failure, poses, say, warn};
use crate::gesture::{
    CyclicMarks, GestureKind, GestureSet, NonCyclicMarks, define_cyclic, define_non_cyclic,
    responses,
};
use crate::pose::PoseHeader;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Whether a taught gesture repeats.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Kind {
    /// Performed over and over
    #[default]
    Cyclic,
    /// From a rest pose to an extreme
    NonCyclic,
}

impl From<Kind> for GestureKind {
    fn from(kind: Kind) -> Self {
        match kind {
            Kind::Cyclic => GestureKind::Cyclic,
            Kind::NonCyclic => GestureKind::NonCyclic,
        }
    }
}

/// Marks in a recording, or a source and how it is marked.
#[derive(Args, Debug)]
pub(super) struct DefineArgs {
    /// The recording (.jsonl, .csv or .bvh) in which the gesture is marked.
    #[arg(long, required_unless_present = "input", conflicts_with = "input")]
    poses: Option<PathBuf>,
    /// Name of the gesture.
    #[arg(long)]
    pub(super) name: String,
    /// Start of one period, seconds on the recording's clock.
    #[arg(
        long,
        value_name = "T",
        conflicts_with = "input",
        allow_negative_numbers = true
    )]
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
        conflicts_with_all = ["start", "input"],
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
    pub(super) into: PathBuf,
    /// Show it now: udp://[ADDRESS:]PORT, - (standard input), or file:PATH played as if it were live.
    #[arg(long, value_name = "SOURCE")]
    input: Option<String>,
    /// Live: whether the gesture repeats.
    #[arg(long, value_enum, default_value_t, requires = "input")]
    pub(super) kind: Kind,
    /// Live, hands-free: begin this many seconds after the first pose; the end is found.
    #[arg(
        long,
        value_name = "S",
        requires = "input",
        allow_negative_numbers = true
    )]
    pub(super) start_after: Option<f64>,
    /// Live: seconds from the start mark to the recording.
    #[arg(
        long,
        value_name = "S",
        default_value_t = 0.0,
        requires = "input",
        allow_negative_numbers = true
    )]
    pub(super) count_down: f64,
    /// Live: a channel of the stream that marks by rising above 0.5 (a clicker or pedal of the tracker's).
    #[arg(long, value_name = "NAME", requires = "input")]
    pub(super) mark_channel: Option<String>,
    /// Live: give up after this many seconds of recording.
    #[arg(
        long,
        value_name = "S",
        default_value_t = 30.0,
        requires = "input",
        allow_negative_numbers = true
    )]
    pub(super) longest: f64,
    /// real: by the clock; max: a recording as fast as it computes, the same result every time.
    #[arg(long, value_enum, default_value_t = Speed::Real, requires = "input")]
    pub(super) speed: Speed,
    /// Live: write the gesture although it cannot work.
    #[arg(long, requires = "input")]
    pub(super) force: bool,
    /// Live: the quality report as one JSON object.
    #[arg(long, requires = "input")]
    pub(super) json: bool,
}

impl DefineArgs {
    /// The set to add to: the file's, or an empty one for streams with `header`.
    pub(super) fn set(&self, header: &PoseHeader) -> Result<GestureSet, Failure> {
        if self.into.exists() {
            load(&self.into)
        } else {
            Ok(GestureSet::new(header, Vec::new()))
        }
    }
}

pub(super) fn define(args: &DefineArgs) -> Result<ExitStatus, Failure> {
    check_name(&args.name)?;
    match (&args.input, &args.poses) {
        (Some(input), _) => teach::run(args, input),
        (None, Some(poses)) => marked(args, poses),
        (None, None) => Err(Failure::input(
            "--poses FILE with marks, or --input SOURCE to show the gesture live",
        )),
    }
}

/// Names go into tables and TOML headers.
pub(super) fn check_name(name: &str) -> Result<(), Failure> {
    if name.is_empty() || name.contains([',', '"', '\n', '\r']) {
        return Err(Failure::input(format!(
            "--name {name:?}: a name is not empty and has no comma, quote or line end"
        )));
    }
    Ok(())
}

fn marked(args: &DefineArgs, path: &std::path::Path) -> Result<ExitStatus, Failure> {
    let (recording, _) = poses::read(path)?;
    let mut set = args.set(&recording.header)?;
    let file = path
        .file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let failed = |error| Failure::input(format!("{}: {error}", path.display()));
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
    describe(
        &definition.gesture,
        definition.periodicity,
        definition.closure,
    );
    set.put(definition.gesture);
    warn_of_confusion(&set);
    put(args, set, false)
}

/// Writes the set with its new gesture and says so.
pub(super) fn put(args: &DefineArgs, set: GestureSet, quiet: bool) -> Result<ExitStatus, Failure> {
    let replaced = args.into.exists() && load(&args.into)?.index_of(&args.name).is_some();
    set.save(&args.into).map_err(Failure::input)?;
    if !quiet {
        say(format_args!(
            "{}: {} `{}` ({} gestures)",
            args.into.display(),
            if replaced { "replaced" } else { "added" },
            args.name,
            set.gestures.len()
        ));
    }
    Ok(ExitStatus::Done)
}

/// Says on standard error which gestures answer to one another.
fn warn_of_confusion(set: &GestureSet) {
    for response in responses(set).into_iter().flatten() {
        if response.gesture != response.shown && response.largest > CONFUSABLE {
            warn(format_args!(
                "`{}` answers {:.2} to frames of `{}`: the two may be confused; make them differ more",
                set.gestures[response.gesture].name,
                response.largest,
                set.gestures[response.shown].name
            ));
        }
    }
}
