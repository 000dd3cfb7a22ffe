//! `handwave gesture study`: all wave estimators on the same sequences; CSV, plots, a short report.

#[cfg(feature = "plot")]
mod plots;
mod report;
mod table;

use crate::base::suggest;
use crate::cli::{ExitStatus, Failure, say, warn};
use crate::config::Files;
use crate::gesture::GestureSet;
use crate::gesture::study::{
    RealPerformance, Row, Study, StudyOptions, Subject, study as run_study,
};
use crate::pose::{PoseFormat, PoseReader, Recording};
use clap::Args;
use std::io::Write;
use std::path::{Path, PathBuf};

pub(super) const EXAMPLES: &str = "Examples:
  handwave gesture study --out study
      everything: about two minutes in a release build
  handwave gesture study --out look --quick
      the same with one repeat of each: a look, not a measurement
  handwave gesture study --out study --estimators gabor,default --seed 7
  handwave gesture study --out study --json > rows.jsonl

Synthetic performers move points in waves; their gestures are defined from one clean period, and the
whole front end reads them, each estimator with its own smoothing. Measured: settling after steps of
tempo and size (last time more than 10 % off the new value), errors in steady state, delay on a tempo
ramp, starts by pure noise, gaps, onset and release, held poses, gestures that share joints, and the
bundled recording of a real hand. Medians over repeats with their own noise and start phase.

DIR/study.csv has one row per figure: sequence,estimator,noise,metric,value,unit,lambda; `inf` means
that it never settled. DIR/report.md says what the figures mean and shows the plots. The same seed
gives the same files.";

/// What to study and where to put it.
#[derive(Args, Debug)]
pub(super) struct StudyArgs {
    /// Folder for study.csv, report.md and the plots; made when it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Start of all noise and phases.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// One repeat, short noise, fewer noise levels and windows.
    #[arg(long)]
    quick: bool,
    /// Only these, by name, separated by commas; all when not given.
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    estimators: Option<Vec<String>>,
    /// JSON Lines, one object per row of study.csv, instead of a table; null = never settled.
    #[arg(long)]
    json: bool,
}

pub(super) fn study(args: &StudyArgs) -> Result<ExitStatus, Failure> {
    let options = StudyOptions {
        seed: args.seed,
        quick: args.quick,
        subjects: subjects(args.estimators.as_deref())?,
        real: Some(bundled()?),
    };
    // Before minutes of work, not after them.
    std::fs::create_dir_all(&args.out).map_err(|error| unwritable(&args.out, &error))?;
    let csv = args.out.join("study.csv");
    std::fs::write(&csv, "").map_err(|error| unwritable(&csv, &error))?;
    let mut tenths = 0;
    let mut progress = |what: &str, share: f64| {
        if (10.0 * share).floor() as i32 >= tenths {
            tenths = (10.0 * share).floor() as i32 + 1;
            warn(format_args!("{:3.0} %  {what}", 100.0 * share));
        }
    };
    let study = run_study(&options, &mut progress).map_err(Failure::input)?;
    write(&csv, &csv_text(&study.rows))?;
    let plots = draw(&study, &options.subjects, &args.out)?;
    let report = report::report(&study, &options, &plots);
    write(&args.out.join("report.md"), &report)?;
    if args.json {
        for row in &study.rows {
            let object = serde_json::json!({
                "sequence": row.sequence, "estimator": row.estimator, "noise": row.noise,
                "metric": row.metric, "value": row.value, "unit": row.unit, "lambda": row.lambda,
            });
            say(format_args!("{object}"));
        }
    } else {
        let rows = table::summary(&study, &options.subjects);
        say(format_args!("{}", table::plain(&rows)));
        say(format_args!(
            "{} rows in {}; plots and words in {}",
            study.rows.len(),
            csv.display(),
            args.out.join("report.md").display()
        ));
    }
    Ok(ExitStatus::Done)
}

/// Writes the plots; returns their file names.
#[cfg(feature = "plot")]
fn draw(study: &Study, subjects: &[Subject], out: &Path) -> Result<Vec<&'static str>, Failure> {
    let mut names = Vec::new();
    for (name, figure) in plots::figures(study, subjects) {
        let text = figure.svg().map_err(Failure::input)?;
        write(&out.join(name), &text)?;
        names.push(name);
    }
    Ok(names)
}

/// This build draws none.
#[cfg(not(feature = "plot"))]
fn draw(_: &Study, _: &[Subject], _: &Path) -> Result<Vec<&'static str>, Failure> {
    warn(format_args!(
        "no plots: this build lacks the feature `plot`"
    ));
    Ok(Vec::new())
}

/// The estimators asked for, each once, in the order of the list of all.
fn subjects(names: Option<&[String]>) -> Result<Vec<Subject>, Failure> {
    let all = Subject::all();
    let Some(names) = names else { return Ok(all) };
    let mut chosen = Vec::new();
    for name in names {
        let found = all
            .iter()
            .find(|s| s.name == name.trim() || (name.trim() == "default" && s.is_default()));
        let Some(found) = found else {
            let allowed: Vec<&str> = all.iter().map(|s| s.name).chain(["default"]).collect();
            return Err(Failure::input(format!(
                "--estimators {name:?}: allowed: {}, separated by commas{}",
                allowed.join(", "),
                suggest::hint(name, allowed.iter().copied())
            )));
        };
        if !chosen.contains(found) {
            chosen.push(*found);
        }
    }
    chosen.sort_by_key(|subject| all.iter().position(|s| s == subject));
    Ok(chosen)
}

/// The performance that is part of the program.
fn bundled() -> Result<RealPerformance, Failure> {
    let (gestures, poses) = ("gestures/hand.toml", "performances/drum_and_splay.jsonl");
    let read = |path: &str| Files::Embedded.read(path).map_err(Failure::input);
    let set = GestureSet::from_toml(&read(gestures)?, gestures).map_err(Failure::input)?;
    let text = read(poses)?;
    let mut reader =
        PoseReader::new(text.as_bytes(), PoseFormat::JsonLines, poses).map_err(Failure::input)?;
    let mut samples = Vec::new();
    for sample in &mut reader {
        samples.push(sample.map_err(Failure::input)?);
    }
    let header = reader.header().clone();
    Ok(RealPerformance::drum_and_splay(
        set,
        Recording { header, samples },
    ))
}

fn unwritable(path: &Path, error: &std::io::Error) -> Failure {
    Failure::input(format!(
        "{}: cannot be written: {error}; check the folder and its permissions",
        path.display()
    ))
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let mut file = std::fs::File::create(path).map_err(|error| unwritable(path, &error))?;
    file.write_all(text.as_bytes())
        .map_err(|error| unwritable(path, &error))
}

fn csv_text(rows: &[Row]) -> String {
    let mut text = String::from("sequence,estimator,noise,metric,value,unit,lambda\n");
    for row in rows {
        // Names of methods may hold a comma.
        let estimator = if row.estimator.contains(',') {
            format!("\"{}\"", row.estimator)
        } else {
            row.estimator.clone()
        };
        text.push_str(&format!(
            "{},{estimator},{:.4},{},{:.6},{},{:.4}\n",
            row.sequence, row.noise, row.metric, row.value, row.unit, row.lambda
        ));
    }
    text
}
