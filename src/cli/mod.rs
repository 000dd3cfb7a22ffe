//! The command line: one file per command, exit codes, messages.

mod bus;
mod failure;
mod sim;

pub use failure::{ExitStatus, Failure};

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// A performer's hands, body or face bring a robot to life.
#[derive(Parser, Debug)]
#[command(name = "handwave", version, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand, Debug)]
enum Command {
    Bus(bus::BusArgs),
    /// Simulated servos for any client
    Sim(sim::SimArgs),
}

/// Parses the command line, runs the command, prints its failure and returns its exit code.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let outcome: Result<ExitStatus, Failure> = match cli.command {
        None => Ok(ExitStatus::Done),
        Some(Command::Bus(args)) => bus::run(args),
        Some(Command::Sim(args)) => sim::run(args),
    };
    match outcome {
        Ok(status) => status.into(),
        Err(failure) => {
            eprintln!("handwave: {failure}");
            failure.status.into()
        }
    }
}
