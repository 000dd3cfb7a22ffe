//! `handwave map`: direct pose mapping. Suggest pairs, learn a map, apply it, study it.

mod apply;
mod learn;
#[cfg(feature = "plot")]
mod plot;
mod shelf;
mod study;
mod suggest;

use super::{ExitStatus, Failure};
use clap::{Args, Subcommand};

/// Arguments of `handwave map`.
#[derive(Args, Debug)]
pub struct MapArgs {
    #[command(subcommand)]
    command: MapCommand,
}

#[derive(Subcommand, Debug)]
enum MapCommand {
    /// Which source poses would teach a map most
    #[command(after_help = "Examples:
  handwave map suggest --poses dance.csv --target arm_keys.json@0 --target arm_keys.json@1
      candidates for the source poses of two target poses, before any pair is given
  handwave map suggest --poses dance.csv --pair 5.85=arm_keys.json@0 --target arm_keys.json@1
      the same after a pair was accepted: q is computed anew
  handwave map suggest --poses dance.csv --target a.json@0 --target a.json@1 --auto
      takes the best candidate of each target before it goes on to the next

q is the uncertainty of the map at a source pose (Rhodin 2016, eq. 8.3): largest where a pair would
teach most. It does not depend on the target: which candidate means which target is yours to say.")]
    Suggest(suggest::SuggestArgs),
    /// Learn a map from pairs of source time and target pose
    #[command(after_help = "Examples:
  handwave map learn --poses dance.csv --urdf arm.urdf --clip sweep.json --clip keys.json \\
      --pair 5.85=keys@0 --pair 7.71=keys@0.25 --pair 12.2=keys@0.5 --pair 14=keys@0.75 --out arm.toml
  handwave map learn --poses dance.csv --urdf arm.urdf --clip sweep.json --pairs pairs.txt --out arm.toml

A pair is T=CLIP@PHASE: the time in the recording, s; the name of a --clip, or a path; the fraction of
its cycle, or the progression of a path, 0..1. A pairs file has one pair a line; # begins a comment.
All clips together are the unlabelled motion that bounds the target poses. 4 to 8 pairs do.")]
    Learn(Box<learn::LearnArgs>),
    /// Run a map over a recording: one row of joint positions per sample
    #[command(after_help = "Examples:
  handwave map apply --map arm.toml --poses dance.csv --out joints.csv
  handwave map apply --map arm.toml --poses dance.csv --urdf arm.urdf --out joints.csv

Columns: t,<joint>,... in radians, t as in the recording. The mapped pose itself: inside the map's volume
and, with --urdf, inside the robot's limits; `handwave run` also holds it to the joints' speed.")]
    Apply(apply::ApplyArgs),
    /// How good a map is by number of pairs, against its variants
    #[command(after_help = "Examples:
  handwave map study --poses drum.jsonl --pairs pairs.txt --clip walk.json --csv study.csv --svg study.svg
  handwave map study --poses drum.jsonl --pairs pairs.txt --clip walk.json --splits 20 --seed 7 --json

Of all pairs n are drawn for learning, the others judge; SNR = 10 log10(V/E) dB, E the mean squared
error of a joint, V that of the mean pose (Rhodin 2016, section 8.6.2, with joints in place of vertices).
Variants: latent (velocities, volume), no-velocity, pca (no volume), no-pca, polynomial, latent-D (D axes).")]
    Study(study::StudyArgs),
}

/// Runs `handwave map`.
///
/// # Errors
/// Bad usage or input (exit code 2).
pub fn run(args: MapArgs) -> Result<ExitStatus, Failure> {
    match args.command {
        MapCommand::Suggest(args) => suggest::suggest(&args),
        MapCommand::Learn(args) => learn::learn(&args),
        MapCommand::Apply(args) => apply::apply(&args),
        MapCommand::Study(args) => study::study(&args),
    }
}
