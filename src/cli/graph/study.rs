//! `handwave graph study`: online transition search against stored transitions, cost, latency and time.

use super::classes::FRAMES;
use super::{load, make_folder};
use crate::cli::disk::write;
use crate::cli::{ExitStatus, Failure, say, warn};
use crate::config::Character;
use crate::live::RealClock;
use crate::motion::class::Example;
use crate::motion::clip::ClipKind;
use crate::motion::gait::{GaitDescription, GaitName};
use crate::motion::gait_frames::{Walker, author};
use crate::motion::range::JointRange;
use crate::motion::search::clip_blend::ClipBlend;
use crate::motion::search::study::{MethodRow, StudyOptions, StudyResult, study as run_study};
use crate::motion::search::{SearchClass, SearchOptions};
use crate::robot::Leg;
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub(super) const EXAMPLES: &str = "Examples:
  handwave graph study
      the built-in quadruped's walk and trot to a pace, one parameter (tempo)
  handwave graph study --parameters 2 --out study
      two parameters (size of the steps and tempo); a plot goes into the folder
  handwave graph study configs/quadruped.toml --requests 50 --seed 7 --json

From the start class's clips to those of another class: the first one with an edge from it whose clips repeat,
or, on a robot with legs, a gait written for it (a pace; with six legs a wave), or else the first class of clips. --parameters 1: tempo; 2: size and tempo; 3: also how deep the
body crouches (the layer of that name). The same random requests (present state, wished state) go to all methods:
online-N searches trellises of depth N, stored-N has the N best transition points fixed beforehand,
exhaustive-10 visits every pair of nodes of depth 10. Columns: mean cost (E_S + lambda E_L), its part for
dissimilarity, mean latency in seconds, median time of a request in microseconds (best of several passes; with
three parameters exhaustive-10 takes a second a request). kappa, the weight of dissimilarity, is calibrated on other requests so
that E_S is 1 to 2.5 times lambda E_L, as in the paper.";

#[derive(Args, Debug)]
pub(super) struct StudyArgs {
    /// The character (default: the built-in quadruped)
    config: Option<PathBuf>,
    /// Random requests, the same for all methods
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    requests: u32,
    /// Where chance begins
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// Free parameters of both classes
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=3))]
    parameters: u32,
    /// Folder for study.csv and study.svg
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// JSON Lines instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn study(args: &StudyArgs) -> Result<ExitStatus, Failure> {
    let character = load(args.config.as_deref())?;
    if let Some(out) = &args.out {
        // Before the work, not after it.
        make_folder(out)?;
    }
    let (source, target) = pair(&character, args.parameters as usize)?;
    let options = StudyOptions {
        requests: args.requests as usize,
        seed: args.seed,
        search: SearchOptions::default(),
    };
    let result =
        run_study(&source, &target, &options, &RealClock::new()).map_err(Failure::input)?;
    let calibration = result.calibration;
    warn(format_args!(
        "{} requests; kappa {:.0}: E_S is {:.2} times lambda E_L on the calibration requests{}",
        result.requests,
        calibration.kappa,
        calibration.ratio,
        if calibration.in_range() {
            ""
        } else {
            ", outside 1 to 2.5: these classes do not allow it"
        }
    ));
    if result.requests < options.requests {
        warn(format_args!(
            "warning: only {} of {} requests can be answered by every method: the others had passed all stored points",
            result.requests, options.requests
        ));
    }
    for row in &result.rows {
        if args.json {
            let row = serde_json::json!({
                "method": row.method, "cost": row.cost, "e_s": row.e_s,
                "latency_s": row.latency_s, "time_us": row.time_us,
            });
            say(format_args!("{row}"));
        }
    }
    if !args.json {
        say(format_args!("{}", table(&result.rows)));
        say(format_args!(
            "online-10 and exhaustive-10 differ by {:.1e} at most",
            result.off
        ));
    }
    if let Some(out) = &args.out {
        write(&out.join("study.csv"), csv(&result.rows))?;
        draw(&result, &source, &target, out)?;
    }
    Ok(ExitStatus::Done)
}

/// The two classes, named on standard error.
fn pair(
    character: &Character,
    parameters: usize,
) -> Result<(Arc<SearchClass>, Arc<SearchClass>), Failure> {
    let bad = |problem: String| Failure::input(format!("{}: {problem}", character.config_name));
    let (start, edges) = character.graph();
    let from = &character.classes[start];
    if from.map.is_some() {
        return Err(bad(format!(
            "the start class {} maps poses and has no clips; the study needs a class of clips as graph.start",
            from.name
        )));
    }
    let repeats = |examples: &[Example]| {
        !examples.is_empty() && examples.iter().all(|e| e.clip.kind == ClipKind::Cycle)
    };
    let other = edges
        .iter()
        .filter(|(a, _)| *a == start)
        .map(|(_, b)| &character.classes[*b])
        .find(|class| repeats(class.examples()));
    let (name, examples) = match other {
        Some(class) => (class.name.clone(), class.examples().to_vec()),
        None => match written(character).map_err(bad)? {
            Some(gait) => gait,
            None => shown(character).map_err(bad)?,
        },
    };
    let space = character.body.space.shared();
    let made = |name: &str, examples: &[Example], fewer: bool| {
        let mut blend = ClipBlend::new(name, examples, &space)
            .map_err(|e| bad(e.to_string()))?
            .moving();
        if parameters < 2 {
            blend = blend.at_full_amplitude();
        }
        if parameters > 2 {
            let crouch = character.layer_clip("crouch").ok_or_else(|| {
                bad(
                    "--parameters 3 needs a [[layer]] named \"crouch\"; it is the third parameter"
                        .into(),
                )
            })?;
            blend = blend.with_added(crouch.clone());
        }
        if blend.parameters() > parameters || (blend.parameters() < parameters && !fewer) {
            return Err(bad(format!(
                "class {name} has {} parameter(s) ({}), --parameters asks for {parameters}; give it clips of more than one amplitude and frequency_hz",
                blend.parameters(),
                blend.parameter_names().join(", "),
            )));
        }
        warn(format_args!(
            "{name}: {}; {}",
            blend.clip_names().join(", "),
            blend.parameter_names().join(", ")
        ));
        // In-between references where the blend bends most; with three parameters the corners alone.
        let steps = [4, 2, 1][parameters.clamp(1, 3) - 1];
        let class = blend.search_class(FRAMES, steps);
        class.map(Arc::new).map_err(|e| bad(e.to_string()))
    };
    // A path that is entered need not have the parameters of what leads to it.
    let entered = !repeats(&examples);
    Ok((
        made(&from.name, from.examples(), false)?,
        made(&name, &examples, entered)?,
    ))
}

/// The first class of clips that the start class leads to.
fn shown(character: &Character) -> Result<(String, Vec<Example>), String> {
    let (start, edges) = character.graph();
    let led_to = edges.iter().filter(|(from, _)| *from == start);
    led_to
        .map(|(_, to)| &character.classes[*to])
        .find(|class| class.map.is_none())
        .map(|class| (class.name.clone(), class.examples().to_vec()))
        .ok_or_else(|| {
            format!(
                "the study needs a second class of clips, and no edge leads from the start class {} to one; no gait can be written for a body without legs of its own: add a class and an edge to it",
                character.classes[start].name
            )
        })
}

/// A gait for the legs of a robot, short and long, slow and quick: a pace for four, a wave for more. `None`
/// without legs.
fn written(character: &Character) -> Result<Option<(String, Vec<Example>)>, String> {
    let Some(model) = &character.model else {
        return Ok(None);
    };
    let Ok((legs, facing)) = Leg::find_all_facing(model, None) else {
        return Ok(None);
    };
    // A wave swings one leg after the other, each in a small part of the cycle.
    let (gait, of, tempi) = match legs.len() {
        5.. => (GaitName::Wave, "wave", [("slow", 0.6), ("quick", 1.0)]),
        _ => (GaitName::Pace, "pace", [("slow", 0.9), ("quick", 1.6)]),
    };
    let ranges: Vec<JointRange> = character
        .limits
        .iter()
        .map(|l| JointRange {
            velocity: l.velocity,
            acceleration: l.acceleration,
        })
        .collect();
    let walker = Walker {
        model,
        legs: &legs,
        facing,
        ranges: &ranges,
    };
    let mut examples = Vec::new();
    for (size, share) in [("short", 0.5), ("long", 1.0)] {
        for (tempo, frequency_hz) in tempi {
            let name = format!("{of}_{size}_{tempo}");
            let mut description = GaitDescription::preset(&name, gait);
            description.frequency_hz = Some(frequency_hz);
            let full = 0.25 * legs.first().map_or(0.3, |l| l.length(model));
            description.stride_m = Some(share * full);
            description.step_height_m = Some(0.3 * share * full);
            let authored = author(&description, walker, false).map_err(|e| e.to_string())?;
            let clip = (character.body.clip(&authored.file)).map_err(|e| e.to_string())?;
            examples.push(Example {
                clip,
                parameters: [share, frequency_hz].into(),
            });
        }
    }
    Ok(Some((of.to_owned(), examples)))
}

fn table(rows: &[MethodRow]) -> String {
    let mut text = format!(
        "{:<14} {:>9} {:>9} {:>11} {:>11}\n",
        "method", "cost", "E_S", "latency [s]", "time [us]"
    );
    for row in rows {
        text.push_str(&format!(
            "{:<14} {:>9.2} {:>9.2} {:>11.3} {:>11.2}\n",
            row.method, row.cost, row.e_s, row.latency_s, row.time_us
        ));
    }
    text.trim_end().to_owned()
}

fn csv(rows: &[MethodRow]) -> String {
    let mut text = String::from("method,cost,e_s,latency_s,time_us\n");
    for row in rows {
        text.push_str(&format!(
            "{},{:.4},{:.4},{:.5},{:.3}\n",
            row.method, row.cost, row.e_s, row.latency_s, row.time_us
        ));
    }
    text
}

#[cfg(feature = "plot")]
fn draw(
    result: &StudyResult,
    source: &SearchClass,
    target: &SearchClass,
    out: &Path,
) -> Result<(), Failure> {
    use crate::view::plot::{Axis, Figure, Panel, Series, Style};
    let names: Vec<String> = result.rows.iter().map(|r| r.method.clone()).collect();
    let bars = |name: &str, color: usize, values: Vec<f64>| Series {
        name: name.into(),
        color,
        style: Style::Bars {
            width: 0.6,
            shift: 0.0,
        },
        points: values
            .into_iter()
            .enumerate()
            .map(|(x, y)| (x as f64, y))
            .collect(),
    };
    let of = |value: &dyn Fn(&MethodRow) -> f64| result.rows.iter().map(value).collect::<Vec<_>>();
    let top = |values: &[f64]| 1.1 * values.iter().copied().fold(1e-9, f64::max);
    let panel = |title: &str, y: Axis, series: Vec<Series>| Panel {
        title: title.into(),
        x: Axis::names("", names.clone()),
        y,
        spans: Vec::new(),
        series,
    };
    let (cost, latency) = (of(&|r| r.cost), of(&|r| r.latency_s));
    let time = of(&|r| r.time_us.max(0.02));
    let low = 10_f64.powf(
        time.iter()
            .copied()
            .fold(f64::INFINITY, f64::min)
            .log10()
            .floor(),
    );
    let figure = Figure {
        title: format!(
            "From {} to {}, {} parameter(s), {} common requests",
            source.name,
            target.name,
            source.parameters(),
            result.requests
        ),
        size: (1000, 250),
        columns: 1,
        panels: vec![
            panel(
                "mean cost of a transition",
                Axis::linear("cost", 0.0, top(&cost)),
                vec![
                    bars("latency, lambda E_L", 1, cost.clone()),
                    bars("dissimilarity, E_S", 2, of(&|r| r.e_s)),
                ],
            ),
            panel(
                "mean latency",
                Axis::linear("latency [s]", 0.0, top(&latency)),
                vec![bars("", 1, latency)],
            ),
            panel(
                "median time of a request",
                Axis::log("time [us]", low, top(&time)),
                vec![bars("", 7, time)],
            ),
        ],
    };
    write(
        &out.join("study.svg"),
        figure.svg().map_err(Failure::input)?,
    )
}

/// This build draws none.
#[cfg(not(feature = "plot"))]
fn draw(_: &StudyResult, _: &SearchClass, _: &SearchClass, _: &Path) -> Result<(), Failure> {
    warn(format_args!("no plot: this build lacks the feature `plot`"));
    Ok(())
}
