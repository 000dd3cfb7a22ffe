//! `handwave clip blend`: two gaits blended at several weights, with limb timelines and without: slide of
//! the feet, hanging legs.

use super::source::SourceArgs;
use crate::base::print::{say, warn};
use crate::cli::disk;
use crate::cli::{ExitStatus, Failure};
use crate::motion::analysis::{BodyModel, analyse, cut};
#[cfg(feature = "plot")]
use crate::motion::blending::STEPS;
use crate::motion::blending::{Blended, Pair};
use crate::motion::clip::{ClipFile, ClipKind};
use crate::motion::take::Take;
use crate::robot::RobotModel;
#[cfg(feature = "plot")]
use crate::view::plot::{Axis, Figure, Panel, Series, Style};
use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Examples for the help.
pub const EXAMPLES: &str = "Examples:
  handwave clip blend walk_long.json gallop.json --urdf pup.urdf
  handwave clip blend walk.json trot.json --urdf dog.urdf --steps 12 --out blend.svg
  handwave clip blend pace0.txt trot0.txt --urdf a1.urdf --json

Each row is a share of B played in A, at a steady tempo, feet not pinned. Slide is the mean way of a foot
over the ground in one stance, hanging the share of the time in which a foot neither stands nor
clears the ground. With timelines every leg keeps its own time, so that all clips put it down
together; without, legs whose phases differ are averaged. What timelines cannot take away: clips
that have a leg on the ground for unlike parts of the cycle do not lift it together.
Recordings are cut to one cycle first.";

/// Arguments of `handwave clip blend`.
#[derive(Args, Debug)]
pub struct BlendArgs {
    /// The first gait: a clip, or any format that `clip import` reads
    a: PathBuf,
    /// The second gait, of the same body
    b: PathBuf,
    /// Robot of motions in joint space
    #[arg(long)]
    urdf: Option<PathBuf>,
    /// Weights from one clip to the other, the ends included, 2 to 101
    #[arg(long, default_value_t = 9, value_parser = clap::value_parser!(u32).range(2..=101))]
    steps: u32,
    /// Draw foot heights and slide as SVG
    #[arg(long, value_name = "OUT.svg")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    source: SourceArgs,
}

/// Runs `handwave clip blend ...`.
///
/// # Errors
/// Files that cannot be read, motions without cycle or feet, bodies that differ (exit code 2).
pub fn run(args: &BlendArgs) -> Result<ExitStatus, Failure> {
    let model = args.urdf.as_deref().map(disk::read_model).transpose()?;
    let (body, a) = cycle_of(&args.a, args, model.as_ref())?;
    let (_, b) = cycle_of(&args.b, args, model.as_ref())?;
    let Some(feet) = body.feet() else {
        let why = body.note.as_deref().unwrap_or("none are found");
        return Err(Failure::input(format!(
            "{}: a blend is judged by its feet: {why}",
            args.a.display()
        )));
    };
    let clip = |file: &ClipFile, path: &Path| {
        file.for_space(body.space())
            .map_err(|e| Failure::input(format!("{}: {e}", path.display())))
    };
    let (first, second) = (clip(&a, &args.a)?, clip(&b, &args.b)?);
    let pair = Pair {
        space: body.space(),
        feet,
        clips: [&first, &second],
    };
    let steps = pair.steps().map_err(|e| Failure::input(e.to_string()))?;
    let rows = (0..args.steps)
        .map(|k| {
            let weight = f64::from(k) / f64::from(args.steps - 1);
            let blend = |timelines| {
                (pair.blend(weight, timelines, &steps)).map_err(|e| Failure::input(e.to_string()))
            };
            Ok([blend(true)?, blend(false)?])
        })
        .collect::<Result<Vec<_>, Failure>>()?;
    if args.json {
        say(format_args!("{}", to_json(&a.name, &b.name, &rows)));
    } else {
        print(&a.name, &b.name, &rows);
    }
    if let Some(out) = &args.out {
        draw(out, &a.name, &b.name, feet.name(0), &rows)?;
    }
    Ok(ExitStatus::Done)
}

#[cfg(feature = "plot")]
fn draw(out: &Path, a: &str, b: &str, foot: &str, rows: &[[Blended; 2]]) -> Result<(), Failure> {
    let text = (figure(a, b, foot, rows).svg()).map_err(|e| Failure::input(e.to_string()))?;
    disk::write(out, text)?;
    warn(format_args!("wrote {}", out.display()));
    Ok(())
}

/// This build draws none.
#[cfg(not(feature = "plot"))]
fn draw(_: &Path, _: &str, _: &str, _: &str, _: &[[Blended; 2]]) -> Result<(), Failure> {
    warn(format_args!("no plot: this build lacks the feature `plot`"));
    Ok(())
}

/// The body of a motion and one cycle of it: a clip as it is, of a recording the cycle that is found.
fn cycle_of(
    path: &Path,
    args: &BlendArgs,
    model: Option<&RobotModel>,
) -> Result<(BodyModel, ClipFile), Failure> {
    let bad =
        |problem: &dyn std::fmt::Display| Failure::input(format!("{}: {problem}", path.display()));
    let clip = std::fs::read_to_string(path)
        .ok()
        .and_then(|text| ClipFile::from_json(&text).ok());
    if let Some(clip) = clip {
        if clip.kind != ClipKind::Cycle {
            return Err(bad(&"a path; gaits to blend are cycles"));
        }
        let body = BodyModel::of(&Take::of_clip(&clip), model).map_err(|e| bad(&e))?;
        return Ok((body, clip));
    }
    let take = args.source.read(path)?;
    let body = BodyModel::of(&take, model).map_err(|e| bad(&e))?;
    let found = analyse(&take, &body).map_err(|e| bad(&e))?;
    let cycle =
        (found.cycle).ok_or_else(|| bad(&"no cycle is found; gaits to blend are cycles"))?;
    let options = cut::CutOptions {
        most_seam: 1.0,
        ..cut::CutOptions::default()
    };
    let cut = cut::cycle(&take, &body, &cycle, &found.feet, &options).map_err(|e| bad(&e))?;
    Ok((body, cut.clip))
}

fn print(a: &str, b: &str, rows: &[[Blended; 2]]) {
    say(format_args!("{a} to {b}"));
    say(format_args!(
        "            slide a stance, mm    hanging legs, %     feet lifted, mm\n  {:>6}    {:>8}  {:>8}    {:>7}  {:>7}    {:>7}  {:>7}",
        "weight", "with", "without", "with", "without", "with", "without"
    ));
    for [with, without] in rows {
        say(format_args!(
            "  {:>6.3}    {:>8.2}  {:>8.2}    {:>7.1}  {:>7.1}    {:>7.1}  {:>7.1}",
            with.weight,
            1e3 * with.slide_m,
            1e3 * without.slide_m,
            100.0 * with.hanging,
            100.0 * without.hanging,
            1e3 * with.lift_m,
            1e3 * without.lift_m
        ));
    }
}

fn to_json(a: &str, b: &str, rows: &[[Blended; 2]]) -> serde_json::Value {
    let figures = |blend: &Blended| {
        json!({
            "slide_m": blend.slide_m, "largest_slide_m": blend.largest_slide_m,
            "hanging": blend.hanging, "lift_m": blend.lift_m,
        })
    };
    let rows: Vec<_> = (rows.iter())
        .map(|[with, without]| {
            json!({
                "weight": with.weight,
                "timelines": figures(with), "no_timelines": figures(without),
            })
        })
        .collect();
    json!({ "a": a, "b": b, "rows": rows })
}

#[cfg(feature = "plot")]
const NAMES: [&str; 2] = ["with limb timelines", "without"];

#[cfg(feature = "plot")]
/// Heights of one foot in the middle, slide and hanging legs against weight.
fn figure(a: &str, b: &str, foot: &str, rows: &[[Blended; 2]]) -> Figure {
    let middle = &rows[rows.len() / 2];
    let heights = |of: &Blended| -> Vec<(f64, f64)> {
        let first = of.heights_m.first();
        (first.into_iter().flatten().enumerate())
            .map(|(k, z)| (k as f64 / STEPS as f64, 1e3 * z))
            .collect()
    };
    let against = |value: fn(&Blended) -> f64| {
        [0, 1].map(|way| -> Vec<(f64, f64)> {
            rows.iter()
                .map(|r| (r[way].weight, value(&r[way])))
                .collect()
        })
    };
    let panel = |title: String, x: Axis, label: &str, lines: [Vec<(f64, f64)>; 2], style| {
        let highest = (lines.iter().flatten()).fold(0.0_f64, |most, p| most.max(p.1));
        let lowest = (lines.iter().flatten()).fold(0.0_f64, |least, p| least.min(p.1));
        Panel {
            title,
            x,
            y: Axis::linear(label, 1.05 * lowest, 1.05 * highest.max(1e-3)),
            spans: Vec::new(),
            series: (lines.into_iter().enumerate())
                .map(|(way, points)| Series {
                    name: NAMES[way].into(),
                    color: way,
                    style,
                    points,
                })
                .collect(),
        }
    };
    let weight = || Axis::linear(&format!("share of {b}"), 0.0, 1.0);
    Figure {
        title: format!("{a} to {b}"),
        size: (900, 260),
        columns: 1,
        panels: vec![
            panel(
                format!(
                    "{foot} over the ground at a share of {:.2}",
                    middle[0].weight
                ),
                Axis::linear("fraction of the cycle", 0.0, 1.0),
                "height, mm",
                [heights(&middle[0]), heights(&middle[1])],
                Style::Line,
            ),
            panel(
                "slide of a foot in one stance".into(),
                weight(),
                "slide, mm",
                against(|b| 1e3 * b.slide_m),
                Style::Dotted,
            ),
            panel(
                "hanging legs".into(),
                weight(),
                "of the time, %",
                against(|b| 100.0 * b.hanging),
                Style::Dotted,
            ),
        ],
    }
}
