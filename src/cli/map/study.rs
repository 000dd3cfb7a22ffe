//! `handwave map study`: the SNR of a map by number of pairs, against its variants.

use super::shelf::{Shelf, SourceArgs, TargetArgs};
use crate::cli::{ExitStatus, Failure, say};
use crate::motion::mapping::study::{Score, StudyPlan, Variant, study as run_study};
use crate::motion::mapping::{LatentVolume, MOST_AXES, NOISE_VARIANCE, Pair, target_frames};
use clap::Args;
use std::path::{Path, PathBuf};

#[derive(Args, Debug)]
pub(super) struct StudyArgs {
    #[command(flatten)]
    source: SourceArgs,
    #[command(flatten)]
    targets: TargetArgs,
    /// Numbers of training pairs (default: steps from 4 to four fifths of the pairs)
    #[arg(long, value_delimiter = ',', value_name = "N,...")]
    counts: Vec<usize>,
    /// Numbers of principal axes of the sweep (default: doubling up to the target's)
    #[arg(long, value_delimiter = ',', value_name = "D,...")]
    axes: Vec<usize>,
    /// Random draws per number
    #[arg(long, default_value_t = 10)]
    splits: usize,
    /// sigma^2 of the regression
    #[arg(long, value_name = "VARIANCE", default_value_t = NOISE_VARIANCE, allow_negative_numbers = true)]
    noise: f64,
    /// Seed of the draws
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Write variant,pairs,snr_db,deviation_db,splits
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Draw the curves
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// JSON Lines instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn study(args: &StudyArgs) -> Result<ExitStatus, Failure> {
    if !(2..=1000).contains(&args.splits) {
        return Err(Failure::input(format!(
            "--splits {} is not in 2..1000",
            args.splits
        )));
    }
    let source = args.source.read()?;
    let mut shelf = Shelf::of(None);
    let wishes = args.targets.read(&mut shelf)?;
    if wishes.len() < 6 {
        return Err(Failure::input(format!(
            "{} pairs; a study draws from many: give 6 or more, 50 as in the thesis, with --pairs FILE",
            wishes.len()
        )));
    }
    let mut pairs = Vec::new();
    for wish in &wishes {
        let label = format!("pair {} = {}", wish.t_s, wish.target.text);
        let feature = source
            .at(wish.t_s)
            .map_err(|e| Failure::input(format!("{label}: {e}")))?;
        pairs.push(Pair {
            label,
            source: source.features[feature].clone(),
            target: shelf.pose(&wish.target),
        });
    }
    let frames = target_frames(&shelf.clips);
    let counts = if args.counts.is_empty() {
        let most = pairs.len() * 4 / 5;
        let steps = [4, 6, 8, 12, 16, 20, 25, 30, 35, 40, 50, 60, 80, 100];
        steps.into_iter().filter(|n| *n <= most).collect()
    } else {
        args.counts.clone()
    };
    let axes = if args.axes.is_empty() {
        let all = LatentVolume::learn(&frames, MOST_AXES)
            .map_err(Failure::input)?
            .dimensions();
        let doubling = std::iter::successors(Some(1), |d| Some(2 * d));
        doubling.take_while(|d| *d < all).collect()
    } else {
        args.axes.clone()
    };
    let plan = StudyPlan {
        variants: Variant::all(&axes),
        counts,
        splits: args.splits,
        noise_variance: args.noise,
        seed: args.seed,
    };
    let scores = run_study(&pairs, source.spread_m, &frames, &plan).map_err(Failure::input)?;
    if args.json {
        for s in &scores {
            let row = serde_json::json!({
                "variant": s.variant, "pairs": s.pairs, "snr_db": s.snr_db,
                "deviation_db": s.deviation_db, "splits": s.draws_db.len(),
            });
            say(format_args!("{row}"));
        }
    } else {
        table(&plan, &scores);
    }
    if let Some(path) = &args.csv {
        let mut text = String::from("variant,pairs,snr_db,deviation_db,splits\n");
        for s in &scores {
            text += &format!(
                "{},{},{:.3},{:.3},{}\n",
                s.variant,
                s.pairs,
                s.snr_db,
                s.deviation_db,
                s.draws_db.len()
            );
        }
        write(path, &text)?;
    }
    if let Some(path) = &args.svg {
        write(path, &svg(&plan, &scores)?)?;
    }
    Ok(ExitStatus::Done)
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    std::fs::write(path, text).map_err(|e| {
        Failure::input(format!(
            "{}: cannot be written: {e}; check the folder and its permissions",
            path.display()
        ))
    })
}

/// One line per variant, one column per number of pairs.
fn table(plan: &StudyPlan, scores: &[Score]) {
    let cells = |cells: Vec<String>| cells.join("");
    let head = plan.counts.iter().map(|n| format!("{n:>8}")).collect();
    say(format_args!("{:<14}{}", "SNR [dB], pairs", cells(head)));
    for variant in &plan.variants {
        let row = scores
            .iter()
            .filter(|s| s.variant == variant.name)
            .map(|s| format!("{:>8.2}", s.snr_db))
            .collect();
        say(format_args!("{:<15}{}", variant.name, cells(row)));
    }
}

#[cfg(feature = "plot")]
fn svg(plan: &StudyPlan, scores: &[Score]) -> Result<String, Failure> {
    let curves: Vec<(String, Vec<(f64, f64)>)> = plan
        .variants
        .iter()
        .map(|variant| {
            let points = scores.iter().filter(|s| s.variant == variant.name);
            let points = points.map(|s| (s.pairs as f64, s.snr_db)).collect();
            (variant.name.clone(), points)
        })
        .collect();
    super::plot::curves(
        "Pose map: SNR by number of pairs",
        "training pairs",
        "SNR [dB]",
        &curves,
    )
    .map_err(|e| Failure::input(format!("the plot cannot be drawn: {e}")))
}

#[cfg(not(feature = "plot"))]
fn svg(_: &StudyPlan, _: &[Score]) -> Result<String, Failure> {
    Err(Failure::input(
        "--svg: this build has no plots; build with the feature `plot`, or take --csv",
    ))
}
