//! `handwave graph build`: clips come in, classes come out: groups, alignment, parameters, TOML.

use super::disk::{self, read};
use super::{ExitStatus, Failure, say};
use crate::body::{JointSpace, PoseSpace, SkeletonSpace};
use crate::motion::Clip;
use crate::motion::clip::{ClipFile, ClipKind};
use crate::motion::suggest::{
    APART_FROM, Suggested, SuggestedClass, UNRELATED_FROM, suggest, suggest_parameters,
};
use crate::motion::warp::FeatureClip;
use crate::motion::weights::{Weights, WeightsError};
use clap::Args;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Examples of `handwave graph build`.
pub(super) const EXAMPLES: &str = "Examples:
  handwave graph build --clips walk.json trot.json stand.json bow.json --urdf dog.urdf
      groups of related clips, how each aligns with its class, and [[class]] tables to paste
  handwave graph build --clips walk.json trot.json --urdf dog.urdf --out plots
      the warps as SVG too, one file a class
  handwave graph build --clips a.json b.json --json

With --urdf poses are compared in metres (lever arms of the joints), else in radians. Clips with a
warp cost of 0.33 or more are unrelated: there is no safe in-between. Legs that are named in a
clip's \"segments\" are aligned each on its own; the plots show one warp for the whole body.";

/// Arguments of `handwave graph build`.
#[derive(Args, Debug)]
pub struct BuildArgs {
    /// Clips of one body
    #[arg(long, required = true, num_args = 1.., value_name = "FILE")]
    clips: Vec<PathBuf>,
    /// Robot description: poses are then compared in metres
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Folder for plots of the warps (SVG)
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// One class with all that is printed of it.
struct Built {
    name: String,
    class: SuggestedClass,
    parameters: Vec<Suggested>,
    /// Why these parameters span no space, if so.
    problem: Option<WeightsError>,
}

/// Runs `handwave graph build`.
///
/// # Errors
/// A file that cannot be read, is no clip or of another body, clips that cannot be compared (exit code 2).
pub fn run(args: &BuildArgs) -> Result<ExitStatus, Failure> {
    let files = (args.clips.iter())
        .map(|path| {
            let file = ClipFile::from_json(&read(path)?);
            Ok((path, file.map_err(|e| in_file(path, &e))?))
        })
        .collect::<Result<Vec<_>, Failure>>()?;
    let space = space(args, &files)?;
    let clips = (files.iter())
        .map(|(path, file)| file.for_space(&*space).map_err(|e| in_file(path, &e)))
        .collect::<Result<Vec<Clip>, Failure>>()?;
    let features: Vec<FeatureClip> = (clips.iter())
        .map(|clip| FeatureClip::from_clip(clip, &*space))
        .collect();
    let (classes, pairs) = suggest(&features).map_err(Failure::input)?;
    let built: Vec<Built> = classes
        .into_iter()
        .map(|class| built(class, &clips, &features))
        .collect();
    if args.json {
        let classes: Vec<_> = built.iter().map(|b| json(b, &clips, args)).collect();
        say(format_args!(
            "{}",
            serde_json::json!({
                "unrelated_from": UNRELATED_FROM, "apart_from": APART_FROM,
                "classes": classes, "pairs": pairs,
            })
        ));
    } else {
        let unit = if args.urdf.is_some() { "m" } else { "rad" };
        for b in &built {
            say(format_args!("{}", table(b, &clips, unit)));
        }
        // Cycles and paths are apart anyway.
        let apart: Vec<_> = (pairs.iter())
            .filter(|p| !p.related && p.place.is_some())
            .collect();
        if !apart.is_empty() {
            say(format_args!("Apart:"));
            for pair in apart {
                say(format_args!("  {pair}"));
            }
            say(format_args!(""));
        }
        for b in &built {
            say(format_args!("{}", toml(b, args)));
        }
    }
    match &args.out {
        Some(folder) => plots(folder, &built, args.json),
        None => Ok(ExitStatus::Done),
    }
}

fn in_file(path: &Path, problem: &dyn std::fmt::Display) -> Failure {
    Failure::input(format!("{}: {problem}", path.display()))
}

/// The body of the clips: the URDF's, the first clip's skeleton, or the first clip's joints.
fn space(args: &BuildArgs, files: &[(&PathBuf, ClipFile)]) -> Result<Box<dyn PoseSpace>, Failure> {
    // At least one clip: the argument is required.
    let first = &files[0].1;
    let floats = files.iter().any(|(_, f)| !f.body.is_empty());
    if let Some(urdf) = &args.urdf {
        let model = disk::read_model(urdf)?;
        return Ok(Box::new(JointSpace::of_robot(&model, floats)));
    }
    Ok(match &first.skeleton {
        Some(skeleton) => Box::new(SkeletonSpace::new(Arc::new(skeleton.clone()))),
        None if floats => Box::new(JointSpace::floating(&first.joints)),
        None => Box::new(JointSpace::fixed(&first.joints)),
    })
}

fn built(class: SuggestedClass, clips: &[Clip], features: &[FeatureClip]) -> Built {
    let own: Vec<&Clip> = class.clips.iter().map(|c| &clips[*c]).collect();
    let spreads: Vec<f64> = (class.clips.iter())
        .map(|c| features[*c].spread())
        .collect();
    let parameters = suggest_parameters(&own, &spreads);
    let moving: Vec<_> = (parameters.iter())
        .filter(|p| p.amplitude > 0.0)
        .map(Suggested::parameters)
        .collect();
    let problem = match Weights::new(&moving) {
        Err(problem @ WeightsError::Duplicate { .. }) => Some(problem),
        _ => None,
    };
    Built {
        name: own[class.alignment.reference].name.clone(),
        class,
        parameters,
        problem,
    }
}

fn degrees(cycles: Option<f64>) -> String {
    cycles.map_or_else(
        || "-".into(),
        // Adding zero takes the sign off a zero.
        |c| format!("{:.0}", (360.0 * c).round() + 0.0),
    )
}

fn table(built: &Built, clips: &[Clip], unit: &str) -> String {
    let alignment = &built.class.alignment;
    let reference = &clips[built.class.clips[alignment.reference]];
    let cycles = reference.kind == ClipKind::Cycle;
    let mut text = format!(
        "Class {} ({}, {} clip{}), warped to {}",
        built.name,
        if cycles { "cycles" } else { "paths" },
        built.class.clips.len(),
        if built.class.clips.len() == 1 {
            ""
        } else {
            "s"
        },
        reference.name
    );
    let limbs: Vec<&str> = (clips[built.class.clips[alignment.limb_reference]]
        .limbs
        .iter())
    .map(|l| l.name.as_str())
    .collect();
    if cycles && !limbs.is_empty() {
        let _ = write!(
            text,
            "; limbs against {}",
            clips[built.class.clips[alignment.limb_reference]].name
        );
    }
    let _ = write!(
        text,
        "\n  {:<16} {:>7} {:>6} {:>9} {:>10} {:>9} {:>9}",
        "clip",
        "s",
        "cost",
        "offset deg",
        format!("size {unit}"),
        "amplitude",
        "frequency"
    );
    if cycles {
        for limb in &limbs {
            let _ = write!(text, " {limb:>12}");
        }
    }
    for (i, aligned) in alignment.clips.iter().enumerate() {
        let (clip, p) = (&clips[built.class.clips[i]], &built.parameters[i]);
        let seconds = duration_s(clip);
        let _ = write!(
            text,
            "\n  {:<16} {:>7} {:>6.2} {:>9} {:>10.3} {:>9.2} {:>9.2}",
            aligned.name,
            seconds.map_or_else(|| "-".into(), |s| format!("{s:.2}")),
            cost(built, i),
            degrees(cycles.then_some(aligned.offset_cycles)),
            p.stride_m,
            p.amplitude,
            p.frequency_hz,
        );
        for offset in &aligned.limb_offsets {
            let _ = write!(text, " {:>12}", degrees(*offset));
        }
    }
    if let Some(problem) = &built.problem {
        let _ = write!(
            text,
            "\n  note: {problem}, for example by a further parameter"
        );
    }
    text.push('\n');
    text
}

/// Cost of clip `i` against the reference, limbs aligned on their own.
fn cost(built: &Built, i: usize) -> f64 {
    let alignment = &built.class.alignment;
    alignment
        .pair(alignment.reference, i)
        .map_or(0.0, |p| p.by_limb)
}

fn duration_s(clip: &Clip) -> Option<f64> {
    match clip.kind {
        ClipKind::Cycle if clip.frequency_hz > 0.0 => Some(1.0 / clip.frequency_hz),
        ClipKind::Path if clip.duration_s > 0.0 => Some(clip.duration_s),
        _ => None,
    }
}

fn round(v: f64) -> f64 {
    (v * 1000.0).round() / 1000.0 + 0.0
}

/// The class as a table of a character's configuration.
fn toml(built: &Built, args: &BuildArgs) -> String {
    let quoted = |s: &str| toml::Value::from(s).to_string();
    let mut text = format!(
        "[[class]]\nname = {}\ngesture = \"NAME\"    # the gesture that drives it\n",
        quoted(&built.name)
    );
    if built.parameters.iter().any(|p| p.turn_rate.is_some()) {
        let most = (built.parameters.iter())
            .filter_map(|p| p.turn_rate)
            .fold(0.0, |a: f64, b| a.max(b.abs()));
        let _ = writeln!(
            text,
            "parameter = [{{ name = \"turn_rate\", channel = \"NAME\", range = [-1.0, 1.0] }}]    # -1..1 for {most:.2} rad/s either way"
        );
    }
    text.push_str("clip = [\n");
    let most = (built.parameters.iter())
        .filter_map(|p| p.turn_rate)
        .fold(0.0, |a: f64, b| a.max(b.abs()));
    for (i, p) in built.parameters.iter().enumerate() {
        let path = args.clips[built.class.clips[i]].display().to_string();
        let _ = write!(text, "  {{ file = {}", quoted(&path));
        let path = built.class.alignment.clips[i].limb_offsets.is_empty() && p.frequency_hz == 0.0;
        if !path || p.amplitude < 1.0 {
            let _ = write!(text, ", amplitude = {:?}", round(p.amplitude));
        }
        if p.frequency_hz > 0.0 {
            let _ = write!(text, ", frequency_hz = {:?}", round(p.frequency_hz));
        }
        if let Some(turn) = p.turn_rate {
            let _ = write!(text, ", at = {{ turn_rate = {:?} }}", round(turn / most));
        }
        text.push_str(" },\n");
    }
    text.push_str("]\n");
    text
}

fn json(built: &Built, clips: &[Clip], args: &BuildArgs) -> serde_json::Value {
    let alignment = &built.class.alignment;
    let entries: Vec<_> = (alignment.clips.iter().enumerate())
        .map(|(i, aligned)| {
            let clip = &clips[built.class.clips[i]];
            let limbs: serde_json::Map<_, _> = (clips[built.class.clips[alignment.limb_reference]]
                .limbs
                .iter())
            .zip(&aligned.limb_offsets)
            .map(|(limb, offset)| (limb.name.clone(), serde_json::json!(offset)))
            .collect();
            let p = &built.parameters[i];
            serde_json::json!({
                "name": aligned.name, "file": args.clips[built.class.clips[i]],
                "kind": clip.kind, "duration_s": duration_s(clip),
                "cost": cost(built, i), "whole_cost": aligned.cost,
                "offset_cycles": aligned.offset_cycles, "warp": aligned.warp.knots(),
                "limb_offsets_cycles": limbs,
                "amplitude": p.amplitude, "frequency_hz": p.frequency_hz,
                "turn_rate": p.turn_rate, "stride_m": p.stride_m,
            })
        })
        .collect();
    serde_json::json!({
        "name": built.name,
        "reference": alignment.clips[alignment.reference].name,
        "limb_reference": alignment.clips[alignment.limb_reference].name,
        "problem": built.problem.as_ref().map(ToString::to_string),
        "clips": entries,
        "toml": toml(built, args),
    })
}

#[cfg(not(feature = "plot"))]
fn plots(_: &Path, _: &[Built], _: bool) -> Result<ExitStatus, Failure> {
    Err(Failure::input(
        "--out: this build draws no plots; build with the feature \"plot\"",
    ))
}

#[cfg(feature = "plot")]
fn plots(folder: &Path, built: &[Built], quiet: bool) -> Result<ExitStatus, Failure> {
    let cannot =
        |e: std::io::Error| Failure::input(format!("cannot write {}: {e}", folder.display()));
    std::fs::create_dir_all(folder).map_err(cannot)?;
    for b in built.iter().filter(|b| b.class.clips.len() > 1) {
        let path = folder.join(format!("warp_{}.svg", b.name));
        let svg = figure(b)
            .svg()
            .map_err(|e| Failure::input(format!("{}: {e}", path.display())))?;
        std::fs::write(&path, svg).map_err(cannot)?;
        if !quiet {
            say(format_args!("{}", path.display()));
        }
    }
    Ok(ExitStatus::Done)
}

/// Left: time of each clip over time of the reference. Right: how far it runs ahead of even time.
#[cfg(feature = "plot")]
fn figure(built: &Built) -> crate::view::plot::Figure {
    use crate::view::plot::{Axis, Figure, Panel, Series, Style};
    let alignment = &built.class.alignment;
    let reference = &alignment.clips[alignment.reference].name;
    let lines = |value: &dyn Fn(f64, f64, f64) -> f64| -> Vec<Series> {
        (alignment.clips.iter().enumerate())
            .map(|(i, clip)| Series {
                name: clip.name.clone(),
                color: i % 8,
                style: if i == alignment.reference {
                    Style::Wide
                } else {
                    Style::Line
                },
                points: (0..=64)
                    .map(|k| {
                        let s = f64::from(k) / 64.0;
                        (s, value(s, clip.warp.at(s), clip.offset_cycles))
                    })
                    .collect(),
            })
            .collect()
    };
    let ahead = |s: f64, t: f64, offset: f64| 100.0 * (offset + t - s);
    let most = (lines(&ahead).iter())
        .flat_map(|l| l.points.iter().map(|p| p.1.abs()))
        .fold(5.0, f64::max);
    let panel = |title: &str, y: Axis, series: Vec<Series>| Panel {
        title: title.into(),
        x: Axis::linear(
            &format!("time of {reference}, share of its length"),
            0.0,
            1.0,
        ),
        y,
        spans: Vec::new(),
        series,
    };
    Figure {
        title: format!("Class {}: one warp for the whole body", built.name),
        panels: vec![
            panel(
                "Time of each clip, its offset taken off",
                Axis::linear("share of the clip's length", 0.0, 1.0),
                lines(&|_, t, _| t),
            ),
            panel(
                "Ahead of even time",
                Axis::linear("% of the clip's length", -1.1 * most, 1.1 * most),
                lines(&ahead),
            ),
        ],
        size: (880, 380),
        columns: 2,
    }
}
