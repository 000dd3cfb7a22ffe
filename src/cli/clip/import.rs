//! `handwave clip import`: a motion of another program as a clip.

use super::source::SourceArgs;
use crate::cli::{ExitStatus, Failure, say, warn};
use crate::motion::clip::{ClipFile, ClipKind};
use crate::motion::take::Take;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// What `--help` shows after the options.
pub(super) const EXAMPLES: &str = "Examples:
  handwave clip import fox.glb#Walk --unit cm --out fox_walk.json
  handwave clip import walk.bvh --start 1.10 --end 2.17 --kind cycle --out walk.json
  handwave clip import 02_01.amc --kind path --origin 'CMU 02_01, mocap.cs.cmu.edu' --out walk.json
  handwave clip import humanoid3d_walk.txt --out walk.json          DeepMimic: wraps, so a cycle
  handwave clip import trot0.txt --out trot.json                    A1, Laikago: joints of the URDF
  handwave clip import targets.csv --out played.json                what run --targets wrote

Formats, told from extension and content:
  .glb .gltf .vrm  skins and animations of glTF 2.0; metres, y up. One clip each: FILE#NAME
  .bvh             y up; the unit is guessed from the size of the skeleton unless --unit tells it
  .amc             on its .asf, found beside it or by --skeleton; CMU's unit and 120 frames a second
  .json .txt       DeepMimic humanoid and dog, Laikago and A1 (19 or 61 numbers a frame), clips
  .csv             t,<joint>,... in rad, with x,y,z,roll,pitch,yaw if the robot walks; of a skeleton
                   t,x,y,z,<joint>.rx,<joint>.ry,<joint>.rz,... with --skeleton FILE

A clip is in metres and radians, x forward, y left, z up. A motion that says it loops becomes a cycle,
any other a path, unless --kind tells; --start and --end then mark one cycle, of which the end is the
start again.";

/// A motion and what to make of it.
#[derive(Args, Debug)]
pub(super) struct ImportArgs {
    /// The motion file, with #NAME for one of its animations.
    file: PathBuf,
    /// Where to write the clip.
    #[arg(long)]
    out: PathBuf,
    /// Where it begins, seconds.
    #[arg(long, value_name = "S")]
    start: Option<f64>,
    /// Where it ends, seconds.
    #[arg(long, value_name = "S")]
    end: Option<f64>,
    /// What it is: one cycle, or a path from rest to extreme.
    #[arg(long)]
    kind: Option<Kind>,
    /// Frames of the clip (default: about as many as the file has there).
    #[arg(long, value_name = "N")]
    frames: Option<usize>,
    /// Name of the clip (default: that of the animation, or of the file).
    #[arg(long)]
    name: Option<String>,
    /// Print one JSON object about the clip.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    source: SourceArgs,
}

/// Kinds as words of the command line.
#[derive(Copy, Clone, Debug, PartialEq, Eq, ValueEnum)]
enum Kind {
    Cycle,
    Path,
}

/// Frames a clip may be asked for.
const MOST_FRAMES: usize = 100_000;
/// A cycle whose ends differ by more than this does not close, rad.
const OPEN_RAD: f64 = 0.05;

pub(super) fn run(args: &ImportArgs) -> Result<ExitStatus, Failure> {
    let mut take = args.source.read(&args.file)?;
    if take.origin.is_empty() {
        warn(format_args!(
            "{}: nobody will know where it comes from; --origin 'AUTHOR, RECORDING, LICENCE' says",
            args.file.display()
        ));
    }
    if let Some(name) = &args.name {
        take.name.clone_from(name);
    }
    let bad = |problem: String| Failure::input(format!("{}: {problem}", args.file.display()));
    let whole_s = take.duration_s();
    let (start_s, end_s) = (args.start.unwrap_or(0.0), args.end.unwrap_or(whole_s));
    if !(0.0 <= start_s && start_s < end_s && end_s <= whole_s + 0.5 * take.dt_s) {
        return Err(bad(format!(
            "--start {start_s} and --end {end_s} must lie in 0 to {whole_s:.3} s, the start first"
        )));
    }
    let cut = args.start.is_some() || args.end.is_some();
    let kind = match args.kind {
        Some(Kind::Cycle) => ClipKind::Cycle,
        Some(Kind::Path) => ClipKind::Path,
        None if take.wraps && !cut => ClipKind::Cycle,
        None => ClipKind::Path,
    };
    let intervals = ((end_s - start_s) / take.dt_s).round().max(1.0) as usize;
    let usual = match kind {
        ClipKind::Cycle => intervals.max(8),
        ClipKind::Path => intervals + 1,
    };
    let frames = args.frames.unwrap_or(usual.min(MOST_FRAMES));
    let least = match kind {
        ClipKind::Cycle => 8,
        ClipKind::Path => 2,
    };
    if !(least..=MOST_FRAMES).contains(&frames) {
        return Err(bad(format!(
            "--frames {frames} must lie in {least} to {MOST_FRAMES}"
        )));
    }
    if cut {
        take = take.part(start_s, end_s, intervals + 1);
    }
    if kind == ClipKind::Cycle {
        warn_open(&take, args);
    }
    let clip = take.to_clip(kind, frames);
    let text = clip.to_json();
    // What is written must be readable: a cycle in which a joint turns round is found here.
    let clip = ClipFile::from_json(&text).map_err(|e| bad(e.to_string()))?;
    std::fs::write(&args.out, text)
        .map_err(|e| Failure::input(format!("cannot write {}: {e}", args.out.display())))?;
    report(args, &clip, end_s - start_s);
    Ok(ExitStatus::Done)
}

/// Says so where the end of a cycle is not its start.
fn warn_open(take: &Take, args: &ImportArgs) {
    if let Some((name, gap)) = take.gap()
        && gap > OPEN_RAD
    {
        warn(format_args!(
            "{}: the cycle does not close: {name} ends {gap:.3} from where it began; move --start or --end",
            args.file.display()
        ));
    }
}

fn report(args: &ImportArgs, clip: &ClipFile, duration_s: f64) {
    let speed = clip.root.forward_m.hypot(clip.root.left_m) / duration_s.max(1e-9);
    if args.json {
        say(format_args!(
            "{}",
            serde_json::json!({
                "name": clip.name, "kind": clip.kind, "origin": clip.origin,
                "frames": clip.frames.len(), "joints": clip.joints.len(),
                "duration_s": duration_s, "frequency_hz": clip.frequency_hz,
                "root": clip.root, "speed_m_s": speed, "skeleton": clip.skeleton.is_some(),
            })
        ));
        return;
    }
    let kind = match clip.kind {
        ClipKind::Cycle => format!("cycle of {:.3} Hz", clip.frequency_hz),
        ClipKind::Path => format!("path of {duration_s:.3} s"),
    };
    say(format_args!(
        "{}: {kind}, {} frames, {} joints; travels {:.3} m forwards, {:.3} m left, turns {:.3} rad ({speed:.2} m/s)",
        args.out.display(),
        clip.frames.len(),
        clip.joints.len(),
        clip.root.forward_m,
        clip.root.left_m,
        clip.root.yaw_rad
    ));
}
