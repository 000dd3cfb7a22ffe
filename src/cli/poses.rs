//! `handwave poses`: bring recordings into the pose stream, look at them, compose performances.

mod import;

use super::{ExitStatus, Failure, say, warn};
use crate::pose::{FaultCounts, PoseError, PoseReader, Recording, compose};
use clap::{Args, Subcommand};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Pose streams: import, info, compose.
#[derive(Args, Debug)]
pub struct PosesArgs {
    #[command(subcommand)]
    command: PosesCommand,
}

#[derive(Subcommand, Debug)]
enum PosesCommand {
    /// Bring another program's recording (BVH, Live Link Face, ...) into the pose stream.
    #[command(after_help = import::EXAMPLES)]
    Import(import::ImportArgs),
    /// What is in a pose stream: points, length, rate, gaps, dropped samples.
    #[command(after_help = "Examples:
  handwave poses info waiting.csv
  handwave poses info waiting.csv --json
  handwave poses info walk.bvh")]
    Info {
        /// The pose stream (.jsonl, .csv or .bvh).
        file: PathBuf,
        /// One JSON object instead of text.
        #[arg(long)]
        json: bool,
    },
    /// Compose a performance from recordings, by a recipe.
    #[command(after_help = "Examples:
  handwave poses compose drum_and_splay.toml --out drum_and_splay.jsonl

A recipe (TOML) names its sources and lists segments:
  handwave = \"recipe\"
  version = 1
  seed = 1
  [sources]
  waiting = \"waiting.csv\"
  [[segment]]
  kind = \"loop\"          # hold, loop or cut
  source = \"waiting\"
  from = 0.5
  to = 1.6
  crossfade_s = 0.1
  speed = 0.8
  size = 0.7
  duration_s = 8.0
  join_s = 0.5")]
    Compose {
        /// The recipe.
        recipe: PathBuf,
        /// Where to write the performance: .jsonl or .csv.
        #[arg(long)]
        out: PathBuf,
    },
}

/// Runs `handwave poses`.
///
/// # Errors
/// Bad input, with exit code 2.
pub fn run(args: PosesArgs) -> Result<ExitStatus, Failure> {
    match args.command {
        PosesCommand::Import(args) => import::run(args),
        PosesCommand::Info { file, json } => info(&file, json),
        PosesCommand::Compose { recipe, out } => {
            write(&compose::compose(&recipe).map_err(Failure::input)?, &out)
        }
    }
}

fn write(recording: &Recording, out: &Path) -> Result<ExitStatus, Failure> {
    recording.write(out).map_err(Failure::input)?;
    let (from, to) = recording.span_s();
    let channels = match recording.header.channels.len() {
        0 => String::new(),
        count => format!(", {count} channels"),
    };
    say(format_args!(
        "{}: {} samples, {} points{channels}, {:.3} s",
        out.display(),
        recording.samples.len(),
        recording.header.points.len(),
        to - from
    ));
    Ok(ExitStatus::Done)
}

/// Reads a recording and says on standard error what was dropped.
pub(super) fn read(path: &Path) -> Result<(Recording, FaultCounts), Failure> {
    let failed = |error: PoseError| Failure::input(error);
    let reader = PoseReader::open(path).map_err(failed)?;
    if let Some(assumption) = reader.assumption() {
        warn(format_args!("{assumption}"));
    }
    let (recording, dropped) = Recording::read_all(reader).map_err(failed)?;
    if dropped.total() > 0 {
        warn(format_args!(
            "{}: dropped samples: {dropped}",
            path.display()
        ));
    }
    Ok((recording, dropped))
}

fn info(file: &Path, json: bool) -> Result<ExitStatus, Failure> {
    let (recording, dropped) = read(file)?;
    let (from, to) = recording.span_s();
    let mut steps: Vec<f64> = recording
        .samples
        .windows(2)
        .map(|pair| pair[1].t - pair[0].t)
        .collect();
    steps.sort_by(f64::total_cmp);
    let step = |share: f64| -> f64 {
        let index = (share * steps.len().saturating_sub(1) as f64) as usize;
        1e3 * steps.get(index).copied().unwrap_or(0.0)
    };
    let rate = if to > from {
        steps.len() as f64 / (to - from)
    } else {
        0.0
    };
    let points: Vec<PointInfo> = (0..recording.header.points.len())
        .map(|index| PointInfo::of(&recording, index))
        .collect();
    let channels: Vec<ChannelInfo> = (0..recording.header.channels.len())
        .map(|index| ChannelInfo::of(&recording, index))
        .collect();
    if json {
        let object = serde_json::json!({
            "file": file.display().to_string(),
            "samples": recording.samples.len(),
            "dim": recording.header.dim,
            "from_s": from, "to_s": to, "rate_hz": rate,
            "step_ms": {"min": step(0.0), "median": step(0.5), "max": step(1.0)},
            "points": points.iter().map(PointInfo::json).collect::<Vec<_>>(),
            "channels": recording.header.channels,
            "channel_values": channels.iter().map(ChannelInfo::json).collect::<Vec<_>>(),
            "dropped": dropped.by_reason().into_iter().collect::<BTreeMap<_, _>>(),
        });
        say(format_args!("{object}"));
        return Ok(ExitStatus::Done);
    }
    say(format_args!(
        "{}: {} samples, {}-D, {from:.3} to {to:.3} s, {rate:.1} Hz (steps {:.1} / {:.1} / {:.1} ms min / median / max)",
        file.display(),
        recording.samples.len(),
        recording.header.dim,
        step(0.0),
        step(0.5),
        step(1.0)
    ));
    say(format_args!("dropped: {dropped}"));
    if !points.is_empty() {
        say(format_args!(
            "{:<20} {:>6}  {:>26}  {:>20}",
            "point", "seen", "mean x y z [mm]", "range x y z [mm]"
        ));
    }
    for point in &points {
        let [x, y, z] = point.mean.map(|v| 1e3 * v);
        let [dx, dy, dz] = point.range.map(|v| 1e3 * v);
        say(format_args!(
            "{:<20} {:>5.1}%  {x:>8.1} {y:>8.1} {z:>8.1}  {dx:>6.1} {dy:>6.1} {dz:>6.1}",
            point.name,
            100.0 * point.seen
        ));
    }
    if !channels.is_empty() {
        say(format_args!(
            "{:<20} {:>6}  {:>8} {:>8} {:>8}",
            "channel", "seen", "mean", "least", "most"
        ));
    }
    for channel in &channels {
        say(format_args!(
            "{:<20} {:>5.1}%  {:>8.3} {:>8.3} {:>8.3}",
            channel.name,
            100.0 * channel.seen,
            channel.mean,
            channel.least,
            channel.most
        ));
    }
    Ok(ExitStatus::Done)
}

struct ChannelInfo {
    name: String,
    seen: f64,
    mean: f64,
    least: f64,
    most: f64,
}

impl ChannelInfo {
    fn of(recording: &Recording, index: usize) -> Self {
        let samples = recording.samples.iter();
        let values: Vec<f64> = samples
            .filter_map(|s| s.channels.get(index).copied().flatten())
            .collect();
        let count = values.len().max(1) as f64;
        let bound = |start: f64, of: fn(f64, f64) -> f64| {
            let found = values.iter().copied().fold(start, of);
            if values.is_empty() { 0.0 } else { found }
        };
        Self {
            name: recording.header.channels[index].clone(),
            seen: values.len() as f64 / recording.samples.len().max(1) as f64,
            mean: values.iter().sum::<f64>() / count,
            least: bound(f64::INFINITY, f64::min),
            most: bound(f64::NEG_INFINITY, f64::max),
        }
    }

    fn json(&self) -> serde_json::Value {
        serde_json::json!({
            "name": self.name, "seen": self.seen, "mean": self.mean,
            "min": self.least, "max": self.most,
        })
    }
}

struct PointInfo {
    name: String,
    seen: f64,
    mean: [f64; 3],
    range: [f64; 3],
}

impl PointInfo {
    fn of(recording: &Recording, index: usize) -> Self {
        let places = || {
            recording
                .samples
                .iter()
                .filter_map(move |sample| sample.points[index])
        };
        let count = places().count();
        let mut mean = [0.0; 3];
        let mut range = [0.0; 3];
        if count > 0 {
            for axis in 0..3 {
                mean[axis] = places().map(|p| p[axis]).sum::<f64>() / count as f64;
                let low = places().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
                let high = places().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
                range[axis] = high - low;
            }
        }
        Self {
            name: recording.header.points[index].clone(),
            seen: count as f64 / recording.samples.len().max(1) as f64,
            mean,
            range,
        }
    }

    fn json(&self) -> serde_json::Value {
        serde_json::json!({
            "name": self.name, "seen": self.seen, "mean_m": self.mean, "range_m": self.range,
        })
    }
}
