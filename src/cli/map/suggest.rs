//! `handwave map suggest`: source poses that would teach a map most.

use super::shelf::{Shelf, SourceArgs, TargetArgs};
use crate::cli::{ExitStatus, Failure, say};
use crate::motion::mapping::{CANDIDATES, NOISE_VARIANCE, Uncertainty, candidates, scaled};
use clap::Args;
use std::path::Path;

#[derive(Args, Debug)]
pub(super) struct SuggestArgs {
    #[command(flatten)]
    source: SourceArgs,
    /// A target pose to find a source pose for, CLIP@PHASE (repeatable)
    #[arg(long, value_name = "CLIP@PHASE", required = true)]
    target: Vec<String>,
    #[command(flatten)]
    targets: TargetArgs,
    /// Take the best candidate of each target before going on to the next
    #[arg(long)]
    auto: bool,
    /// JSON Lines instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn suggest(args: &SuggestArgs) -> Result<ExitStatus, Failure> {
    let source = args.source.read()?;
    let mut shelf = Shelf::of(None);
    let accepted = args.targets.read(&mut shelf)?;
    let mut targets = Vec::new();
    for target in &args.target {
        targets.push(shelf.target(target, Path::new(""))?);
    }
    let frames: Vec<Vec<f64>> = source
        .features
        .iter()
        .map(|feature| {
            let mut x = vec![0.0; feature.len()];
            scaled(feature, source.spread_m, &mut x);
            x
        })
        .collect();
    let mut taught = Vec::new();
    for wish in &accepted {
        let index = source
            .at(wish.t_s)
            .map_err(|e| Failure::input(format!("pair {}: {e}", wish.target.text)))?;
        taught.push(frames[index].clone());
    }
    if !args.json {
        say(format_args!(
            "{:<28} {:>9} {:>8}  {:<20}",
            "target", "t [s]", "q", "bar"
        ));
    }
    let inputs = frames.first().map_or(0, Vec::len);
    for target in &targets {
        let uncertainty = Uncertainty::new(inputs, &taught, NOISE_VARIANCE);
        let found = candidates(&uncertainty, &source.times_s, &frames, CANDIDATES);
        for (rank, candidate) in found.iter().enumerate() {
            let accepted = args.auto && rank == 0;
            if args.json {
                let row = serde_json::json!({
                    "target": target.text, "rank": rank + 1, "t_s": candidate.t_s, "q": candidate.q,
                    "bar": candidate.share, "accepted": accepted, "pairs": taught.len(),
                });
                say(format_args!("{row}"));
            } else {
                say(format_args!(
                    "{:<28} {:>9.3} {:>8.3}  {:<20}{}",
                    target.text,
                    candidate.t_s,
                    candidate.q,
                    "#".repeat((candidate.share * 20.0).round() as usize),
                    if accepted { " accepted" } else { "" }
                ));
            }
        }
        if let (true, Some(best)) = (args.auto, found.first()) {
            taught.push(frames[best.frame].clone());
        }
    }
    Ok(ExitStatus::Done)
}
