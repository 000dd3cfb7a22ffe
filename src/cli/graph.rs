//! `handwave graph`: motion classes and the graph of them.

use super::graph_build as build;
use super::{ExitStatus, Failure};
use clap::{Args, Subcommand};

/// Arguments of `handwave graph`.
#[derive(Args, Debug)]
pub struct GraphArgs {
    #[command(subcommand)]
    command: GraphCommand,
}

#[derive(Subcommand, Debug)]
enum GraphCommand {
    /// Which clips make one class, how they align, and the [[class]] tables to paste
    #[command(after_help = build::EXAMPLES)]
    Build(build::BuildArgs),
}

/// Runs `handwave graph`.
///
/// # Errors
/// Bad usage or input (exit code 2).
pub fn run(args: &GraphArgs) -> Result<ExitStatus, Failure> {
    match &args.command {
        GraphCommand::Build(args) => build::run(args),
    }
}
