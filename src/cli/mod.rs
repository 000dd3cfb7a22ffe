//! The command line: one file per command, exit codes, messages.

pub mod bus;
pub mod character;
pub mod clip;
mod disk;
mod failure;
pub mod gesture;
pub mod graph;
mod graph_build;
#[cfg(feature = "record")]
mod keeping;
#[cfg(not(feature = "record"))]
#[path = "keeping_off.rs"]
mod keeping;
mod legged;
pub mod map;
pub mod poses;
#[cfg(feature = "record")]
pub mod replay;
pub mod run;
pub mod sim;
mod summary;
mod targets;

pub use failure::{ExitStatus, Failure};

use crate::base::print::{say, warn};
use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// A performer's hands, body or face bring a robot to life.
///
/// Without a command: `run` with the built-in quadruped and a recorded performer, no hardware needed.
#[derive(Parser, Debug)]
#[command(name = "handwave", version, propagate_version = true, args_conflicts_with_subcommands = true, after_help = run::EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: run::RunOptions,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// The main job: poses in, servos move
    Run(run::RunArgs),
    /// Record gestures from one example, estimate their waves, check them
    Gesture(gesture::GestureArgs),
    /// Pose streams: import, info, compose
    Poses(poses::PosesArgs),
    /// Bring motion in; author gaits for a legged robot
    Clip(clip::ClipArgs),
    /// Make a whole character, ready to run, from the URDF of a legged robot
    Character(character::CharacterArgs),
    /// Pose mapping: the performer's pose itself drives a body; suggest, learn, apply, study
    Map(map::MapArgs),
    /// A recorded run once more: does it send the same bytes?
    #[cfg(feature = "record")]
    Replay(replay::ReplayArgs),
    /// The motion graph: build classes, show it, check it, compare ways to find transitions
    Graph(graph::GraphArgs),
    /// Look at and set up servos on a bus
    Bus(bus::BusArgs),
    /// Simulated servos on a pseudo-terminal, for any client
    Sim(sim::SimArgs),
}

/// Parses the command line, runs the command, prints its failure and returns its exit code.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let outcome: Result<ExitStatus, Failure> = match cli.command {
        None => run::run(&run::RunArgs::built_in(cli.run)),
        Some(Command::Run(args)) => run::run(&args),
        Some(Command::Gesture(args)) => gesture::run(args),
        Some(Command::Poses(args)) => poses::run(args),
        Some(Command::Clip(args)) => clip::run(&args),
        Some(Command::Character(args)) => character::run(&args),
        Some(Command::Map(args)) => map::run(args),
        #[cfg(feature = "record")]
        Some(Command::Replay(args)) => replay::run(&args),
        Some(Command::Graph(args)) => graph::run(&args),
        Some(Command::Bus(args)) => bus::run(args),
        Some(Command::Sim(args)) => sim::run(args),
    };
    match outcome {
        Ok(status) => status.into(),
        Err(failure) => {
            warn(format_args!("handwave: {failure}"));
            failure.status.into()
        }
    }
}
