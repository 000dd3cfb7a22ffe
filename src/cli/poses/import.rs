//! `handwave poses import`: another program's recording, or part of a pose stream, as a pose stream.

use super::write;
use crate::cli::{ExitStatus, Failure, warn};
use crate::pose::bvh::LengthUnit;
use crate::pose::import::{ImportKind, ImportOptions, import};
use clap::Args;
use std::path::PathBuf;

/// What `--help` shows after the options.
pub(super) const EXAMPLES: &str = "Examples:
  handwave poses import walk.bvh --out walk.csv                  joints of a BVH file as points
  handwave poses import walk.bvh --points Hips,Foot_L,Foot_R --unit cm --out feet.csv
  handwave poses import face.csv --out face.jsonl                blendshapes as channels
  handwave poses import face.csv --as-points JawOpen,MouthSmileLeft --out mouth.csv
  handwave poses import face.csv --channels JawOpen,MouthFrownLeft --from 10 --to 25 --out part.csv
  handwave poses import tracked.json --out hands.csv             headset and controllers
  handwave poses import dog.txt --table --rate 60 --out dog.csv  x,y,z of every point, no header
  handwave poses import waiting.json --out waiting.csv           a Leap Motion recording
  handwave poses import take.jsonl --points wrist,index_tip --out part.csv

Kinds, told from the content (or by --kind):
  bvh             BVH motion capture; joints are points. Rotations in the order of the channels,
                  a position channel replaces the OFFSET. The unit is guessed from the size of
                  the skeleton unless --unit tells it. --ends adds the End Sites. A root that
                  stays at the origin while the hips below it travel is left out.
  live-link-face  Live Link Face CSV, time code at 60 per second; no points. 52 blendshapes are
                  channels named as in the file, 0..1. --rotations adds head and eyes, rad.
  a-frame         A-Frame motion capture JSON. Points head, left, right and, 0.1 m ahead of
                  each, head_tip, left_tip, right_tip.
  table           Lines of x,y,z of every point, divided by commas, semicolons, tabs or spaces;
                  needs --rate. Points are p0, p1, ... or as --names says; metres or --unit.
  leap            Leap Motion (LeapJS playback, decompressed JSON). --joints adds the joints
                  of the fingers.
  poses           A pose stream (.jsonl, .csv), for --points, --channels, --from, --to and
                  --as-points.

--as-points makes points of channels, so that gestures can be defined over a face: point k stands
still on the ground and moves up by 0.1 m as channel k goes from 0 to 1. It replaces the points of
the recording; channels stay. Gestures defined over such points also read a stream of the channels
alone, such as face.jsonl above. Lengths are metres, y up; times seconds, from 0 where the
recording was cut or had another clock.";

/// A recording and how to read it.
#[derive(Args, Debug)]
pub(super) struct ImportArgs {
    /// The recording.
    file: PathBuf,
    /// Where to write it: .jsonl or .csv, metres and seconds.
    #[arg(long)]
    out: PathBuf,
    /// bvh, live-link-face, a-frame, table, leap or poses; told from the content when not given.
    #[arg(long, value_parser = ImportKind::from_name)]
    kind: Option<ImportKind>,
    /// A table without a header: the same as --kind table.
    #[arg(long, conflicts_with = "kind")]
    table: bool,
    /// Frames per second of a table.
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Names of a table's points, in the order of its columns.
    #[arg(long, value_delimiter = ',', value_name = "A,B,...")]
    names: Vec<String>,
    /// Unit of a BVH file or a table: m, cm, mm, in, ft, or its length in metres.
    #[arg(long)]
    unit: Option<LengthUnit>,
    /// With the End Sites of a BVH file.
    #[arg(long)]
    ends: bool,
    /// With the angles of head and eyes of a face, as channels in rad.
    #[arg(long)]
    rotations: bool,
    /// With the joints of every finger (mcp, pip, dip) of a Leap Motion recording.
    #[arg(long)]
    joints: bool,
    /// Keep these points only, in this order.
    #[arg(long, value_delimiter = ',', value_name = "A,B,...")]
    points: Vec<String>,
    /// Keep these channels only, in this order.
    #[arg(long, value_delimiter = ',', value_name = "A,B,...")]
    channels: Vec<String>,
    /// Leave out what comes before, seconds on the recording's clock.
    #[arg(long, value_name = "S")]
    from: Option<f64>,
    /// Leave out what comes after, seconds on the recording's clock.
    #[arg(long, value_name = "S")]
    to: Option<f64>,
    /// Make points of these channels, in this order.
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "A,B,...",
        conflicts_with = "points"
    )]
    as_points: Vec<String>,
}

pub(super) fn run(args: ImportArgs) -> Result<ExitStatus, Failure> {
    let options = ImportOptions {
        kind: args.kind.or(args.table.then_some(ImportKind::Table)),
        joints: args.joints,
        ends: args.ends,
        rotations: args.rotations,
        unit: args.unit,
        rate_hz: args.rate,
        names: args.names,
    };
    let imported = import(&args.file, &options).map_err(Failure::input)?;
    if let Some(assumption) = imported.assumption {
        warn(format_args!("{}: {assumption}", args.file.display()));
    }
    let mut recording = imported.recording;
    let chosen = |flag: &str, what: String| {
        Failure::input(format!("{}: {flag}: {what}", args.file.display()))
    };
    if args.from.is_some() || args.to.is_some() {
        recording = recording
            .cut(
                args.from.unwrap_or(f64::NEG_INFINITY),
                args.to.unwrap_or(f64::INFINITY),
            )
            .map_err(|what| chosen("--from, --to", what))?;
    }
    if !args.points.is_empty() {
        recording = recording
            .with_points(&args.points)
            .map_err(|what| chosen("--points", what))?;
    }
    if !args.as_points.is_empty() {
        recording = recording
            .with_channels_as_points(&args.as_points)
            .map_err(|what| chosen("--as-points", what))?;
    }
    if !args.channels.is_empty() {
        recording = recording
            .with_channels(&args.channels)
            .map_err(|what| chosen("--channels", what))?;
    }
    write(&recording, &args.out)
}
