//! `handwave graph`: look at a character's motion graph, check it, compare ways to find transitions.

mod check;
mod classes;
mod draw;
mod matrix;
mod show;
mod study;

use super::{ExitStatus, Failure, graph_build};
use crate::config::files::BUILT_IN;
use crate::config::{self, Character, Files};
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};

/// The motion graph: classes, transitions between them.
#[derive(Args, Debug)]
pub struct GraphArgs {
    #[command(subcommand)]
    command: GraphCommand,
}

#[derive(Subcommand, Debug)]
enum GraphCommand {
    /// Which clips make one class, how they align, and the [[class]] tables to paste
    #[command(after_help = graph_build::EXAMPLES)]
    Build(graph_build::BuildArgs),
    /// Draw the graph and how similar its classes are; without --out as text
    #[command(after_help = "Examples:
  handwave graph show
      the built-in quadruped's graph as text
  handwave graph show configs/quadruped.toml --out graph.svg
      a picture of the graph, and in graph_edges/ one similarity matrix per edge

A similarity matrix has a row for every pose of the class that is left (clip by clip, phase 0 to
1) and a column for every pose of the one that is entered: yellow is equal, dark blue as
different as any two poses of these classes. A transition is smooth where it is bright.")]
    Show {
        /// The character (default: the built-in quadruped)
        config: Option<PathBuf>,
        /// Picture of the graph; the matrices go into a folder beside it, NAME_edges
        #[arg(long, value_name = "FILE.svg")]
        out: Option<PathBuf>,
    },
    /// Name nodes that cannot be reached or left, and classes without overlap
    #[command(after_help = "Examples:
  handwave graph check
  handwave graph check my_character.toml --json
  handwave graph check my_character.toml --s-min 0.9

Broken (exit 2): a class that no way from the start leads to, a class without a way back to it.
Warnings (exit 0): an edge whose best transition is less similar than --s-min or farther than
--far-mm apart, a clip whose parameters the gesture cannot reach. The distance of two poses is
the root mean square over joints of joint position times lever arm, speeds included.")]
    Check {
        /// The character (default: the built-in quadruped)
        config: Option<PathBuf>,
        /// Least similarity (0..1) of an edge's best transition
        #[arg(long, default_value_t = 0.8, value_name = "S")]
        s_min: f64,
        /// Largest distance of an edge's best transition, mm
        #[arg(long, default_value_t = 20.0, value_name = "MM")]
        far_mm: f64,
        /// One JSON object
        #[arg(long)]
        json: bool,
    },
    /// Compare online transition search with stored transition points, on the same requests
    #[command(after_help = study::EXAMPLES)]
    Study(study::StudyArgs),
}

/// Runs `handwave graph`.
///
/// # Errors
/// Bad input, with exit code 2.
pub fn run(args: &GraphArgs) -> Result<ExitStatus, Failure> {
    match &args.command {
        GraphCommand::Build(args) => graph_build::run(args),
        GraphCommand::Show { config, out } => show::show(config.as_deref(), out.as_deref()),
        GraphCommand::Check {
            config,
            s_min,
            far_mm,
            json,
        } => check::check(config.as_deref(), *s_min, *far_mm, *json),
        GraphCommand::Study(args) => study::study(args),
    }
}

fn load(config: Option<&Path>) -> Result<Character, Failure> {
    match config {
        None => config::load(Files::Embedded, BUILT_IN),
        Some(path) => {
            let (files, name) = Files::of(path);
            config::load(files, &name)
        }
    }
    .map_err(Failure::input)
}

fn make_folder(path: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(path)
        .map_err(|e| Failure::input(format!("cannot make the folder {}: {e}", path.display())))
}
