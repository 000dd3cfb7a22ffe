//! `handwave replay`: a recorded run once more, and whether it sends the same bytes.

use super::targets::TargetsFile;
use super::{ExitStatus, Failure, say, warn};
use crate::bus::tap::Difference;
use crate::live::recording::{Replayed, replay};
use crate::view::recorder::read::{Loaded, read};
use clap::Args;
use serde_json::json;
use std::path::PathBuf;

const EXAMPLES: &str = "Examples:
  handwave run --headless --speed max --record walk.mcap
  handwave replay walk.mcap                       the same bytes?
  handwave replay walk.mcap --targets walk.csv    joint targets of every cycle, as of `run --targets`
  handwave replay handwave-fault-20260102-101500.mcap --from 8 --to 10 --targets fault.csv

The recording brings its character along and needs no other file, no servos and no source of poses. A file that
was cut (a kill, a full disk) is replayed up to the cut. A recording of another build may differ: it is named.
The logs hold every answer of clock, poses and servos; what is compared is every byte sent to the servos (of an
avatar: every target).

Exit codes: 0 identical as far as the recording goes; 2 no recording, or nothing in it to replay;
4 it differs: the first difference is told, decoded both ways.";

/// Arguments of `handwave replay`.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct ReplayArgs {
    /// A recording made by `handwave run --record`, or one that was kept of a fault
    file: PathBuf,
    /// Write one row of joint targets per control cycle
    #[arg(long, value_name = "FILE.csv")]
    targets: Option<PathBuf>,
    /// Rows of targets from this time on, seconds since the first cycle (the run is computed from its beginning)
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    from: Option<f64>,
    /// Replay up to this time only, seconds since the first cycle
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    to: Option<f64>,
    /// One JSON object instead of text
    #[arg(long)]
    json: bool,
}

/// Runs `handwave replay`.
///
/// # Errors
/// No recording (2), a difference (4).
pub fn run(args: &ReplayArgs) -> Result<ExitStatus, Failure> {
    for (name, value) in [("--from", args.from), ("--to", args.to)] {
        if let Some(s) = value
            && !(s >= 0.0)
        {
            return Err(Failure::input(format!(
                "{name} {s}: expected are seconds since the first cycle, 0 or more"
            )));
        }
    }
    let loaded = read(&args.file).map_err(Failure::input)?;
    let file = args.file.display();
    if !loaded.whole {
        return Err(Failure::input(format!(
            "{file} holds the last part of a run; a replay needs its beginning. Look at it in Foxglove, or record whole runs with `handwave run --record FILE` (or raise record.ring_mb)"
        )));
    }
    let own = env!("CARGO_PKG_VERSION");
    if loaded.version != own {
        warn(format_args!(
            "warning: {file} was recorded by version {}, this is {own}: differences may be those of the versions",
            loaded.version
        ));
    }
    let mut targets = args
        .targets
        .as_ref()
        .map(|path| {
            TargetsFile::create(path, &loaded.recorded.character)
                .map_err(|e| Failure::input(format!("--targets {}: {e}", path.display())))
        })
        .transpose()?;
    let Loaded {
        recorded, cut, run, ..
    } = loaded;
    let from_s = args.from.unwrap_or(0.0);
    let replayed = replay(recorded, args.to, |record| {
        if let Some(targets) = &mut targets
            && record.t_s >= from_s
        {
            targets.row(record);
        }
    })
    .map_err(|e| Failure::input(format!("{file}: {e}")))?;
    targets
        .map_or(Ok(()), TargetsFile::finish)
        .map_err(Failure::input)?;
    if args.json {
        say(format_args!("{}", to_json(&replayed, cut.as_deref(), &run)));
    } else {
        say(format_args!("{}", to_text(&replayed, cut.as_deref())));
    }
    match &replayed.difference {
        None => Ok(ExitStatus::Done),
        Some((difference, cycle)) => Err(Failure {
            status: ExitStatus::SafetyStop,
            message: format!(
                "the replay differs from the recording in cycle {cycle} on {}",
                difference.log
            ),
        }),
    }
}

/// Seconds since cycle 0 of a difference.
fn at_s(replayed: &Replayed, difference: &Difference) -> f64 {
    difference.at.secs_since(replayed.start)
}

fn to_text(replayed: &Replayed, cut: Option<&str>) -> String {
    let cycles = replayed.stats.cycles;
    let mut text = format!(
        "{cycles} cycles, {} frames, {} bytes",
        replayed.frames, replayed.bytes
    );
    match &replayed.difference {
        None => text += ", identical",
        Some((difference, cycle)) => {
            text += &format!(
                " identical, then a difference at {:.6} s, cycle {cycle}, {}:\n  recorded  {}\n  replayed  {}",
                at_s(replayed, difference),
                difference.log,
                difference.recorded,
                difference.replayed
            );
        }
    }
    if let Some(ended) = &replayed.ended {
        text += &format!("\nnote: {ended}");
    }
    if let Some(cut) = cut {
        text += &format!("\nnote: the file ends before its end ({cut}): replayed up to there");
    }
    text
}

fn to_json(replayed: &Replayed, cut: Option<&str>, run: &serde_json::Value) -> serde_json::Value {
    let difference = replayed.difference.as_ref().map(|(d, cycle)| {
        json!({
            "t_s": at_s(replayed, d), "cycle": cycle, "log": d.log,
            "recorded": d.recorded, "replayed": d.replayed,
        })
    });
    json!({
        "identical": difference.is_none(), "cycles": replayed.stats.cycles,
        "frames": replayed.frames, "bytes": replayed.bytes, "difference": difference,
        "ended": replayed.ended, "cut": cut, "run": run,
    })
}
