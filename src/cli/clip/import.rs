//! `handwave clip import`: a motion of another program as a clip.

use super::source::SourceArgs;
use crate::cli::disk;
use crate::cli::{ExitStatus, Failure, say, warn};
use crate::motion::analysis::cut::{self, CutOptions};
use crate::motion::analysis::cycle::{self, Features};
use crate::motion::analysis::{BodyModel, Cycle, contact, travel};
use crate::motion::clip::{ClipFile, ClipKind};
use crate::motion::take::Take;
use crate::robot::RobotModel;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// What `--help` shows after the options.
pub(super) const EXAMPLES: &str = "Examples:
  handwave clip import fox.glb#Walk --unit cm --out fox_walk.json
  handwave clip import walk.bvh --start 1.10 --end 2.17 --kind cycle --out walk.json
  handwave clip import walk.bvh --cycle auto --out walk.json        one cycle, found and closed
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

A clip is in metres and radians, x forward, y left, z up. A motion that says it loops becomes a
cycle, any other a path, unless --kind tells; --start and --end then mark one cycle, of which
the end is the start again. --cycle auto finds the cycle. The ends of a cycle are joined: what
they differ by is spread over it. Legs that are found (of a robot with --urdf) become the
segments of a cycle.";

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
    /// Find one cycle, within --start and --end where they are given.
    #[arg(long, value_name = "auto", conflicts_with = "kind")]
    cycle: Option<Found>,
    /// The robot's description, so that its legs are known.
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
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

/// How a cycle is found.
#[derive(Copy, Clone, Debug, PartialEq, Eq, ValueEnum)]
enum Found {
    Auto,
}

/// Frames a clip may be asked for.
const MOST_FRAMES: usize = 100_000;
/// Ends of a cycle this far apart are joined with a word, as a share of the motion's extent.
const OPEN: f64 = 0.05;

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
    let is_cut = args.start.is_some() || args.end.is_some();
    if is_cut {
        let intervals = ((end_s - start_s) / take.dt_s).round().max(1.0) as usize;
        take = take.part(start_s, end_s, intervals + 1);
    }
    let clip = match (args.cycle, args.kind) {
        (Some(Found::Auto), _) | (None, Some(Kind::Cycle)) => cycle_of(&take, args)?,
        (None, None) if take.wraps && !is_cut => cycle_of(&take, args)?,
        (None, _) => {
            let frames = frames(args, take.len(), 2)?;
            take.to_clip(ClipKind::Path, frames)
        }
    };
    let duration_s = match clip.kind {
        ClipKind::Cycle => 1.0 / clip.frequency_hz.max(1e-9),
        ClipKind::Path => take.duration_s(),
    };
    let text = clip.to_json();
    // What is written must be readable: a cycle in which a joint turns round is found here.
    let clip = ClipFile::from_json(&text).map_err(|e| bad(e.to_string()))?;
    disk::write(&args.out, text)?;
    report(args, &clip, duration_s);
    Ok(ExitStatus::Done)
}

/// As many frames as asked for, else `usual`.
fn frames(args: &ImportArgs, usual: usize, least: usize) -> Result<usize, Failure> {
    let frames = args.frames.unwrap_or(usual.clamp(least, MOST_FRAMES));
    if (least..=MOST_FRAMES).contains(&frames) {
        return Ok(frames);
    }
    Err(Failure::input(format!(
        "{}: --frames {frames} must lie in {least} to {MOST_FRAMES}",
        args.file.display()
    )))
}

/// One closed cycle of a take: the one that is found, or the whole.
fn cycle_of(take: &Take, args: &ImportArgs) -> Result<ClipFile, Failure> {
    let bad = |e: &dyn std::fmt::Display| Failure::input(format!("{}: {e}", args.file.display()));
    let model = match &args.urdf {
        None => None,
        Some(urdf) => {
            let bad =
                |e: &dyn std::fmt::Display| Failure::input(format!("{}: {e}", urdf.display()));
            let text = std::fs::read_to_string(urdf).map_err(|e| bad(&e))?;
            Some(RobotModel::from_urdf(&text).map_err(|e| bad(&e))?)
        }
    };
    let body = BodyModel::of(take, model.as_ref()).map_err(|e| bad(&e))?;
    if let Some(note) = &body.note {
        warn(format_args!(
            "{}: no limbs in the clip: {note}",
            args.file.display()
        ));
    }
    let auto = args.cycle.is_some();
    let whole = if auto {
        cycle::find(&Features::of(take, body.space()), take).map_err(|e| bad(&e))?
    } else {
        Cycle {
            start: 0,
            frames: take.len().saturating_sub(1) as f64,
            frequency_hz: 1.0 / take.duration_s().max(1e-9),
            likeness: 1.0,
            closed: true,
        }
    };
    let mut way = travel::of(take);
    let feet = match body.feet() {
        Some(feet) => contact::find(take, feet, Some(&whole), &mut way),
        None => Vec::new(),
    };
    let options = CutOptions {
        frames: frames(args, whole.frames.round() as usize, 8)?,
        // Who says where the cycle is has it closed there; it is said below how far.
        most_seam: if auto {
            CutOptions::default().most_seam
        } else {
            f64::INFINITY
        },
        ..CutOptions::default()
    };
    let made = cut::cycle(take, &body, &whole, &feet, &options).map_err(|e| bad(&e))?;
    if auto {
        let start_s = args.start.unwrap_or(0.0) + whole.start as f64 * take.dt_s;
        warn(format_args!(
            "{}: cycle found from {start_s:.3} s, {:.3} Hz (likeness {:.2})",
            args.file.display(),
            whole.frequency_hz,
            whole.likeness
        ));
    }
    if made.seam.share > OPEN {
        warn(format_args!(
            "{}: the ends of the cycle were {:.3} m apart ({:.0} % of the motion) and were joined",
            args.file.display(),
            made.seam.distance_m,
            100.0 * made.seam.share
        ));
    }
    Ok(made.clip)
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
