//! `handwave bus action`: starts the writes that servos hold.

use super::{open, say};
use crate::bus::BusAddress;
use crate::cli::{ExitStatus, Failure};
use clap::Args;
use handwave_dynamixel::BROADCAST_ID;
use std::io::Write;

/// Let all servos carry out the writes that they hold (`bus write --later`), at the same instant.
#[derive(Args, Debug)]
#[command(after_help = "\
Example:
  handwave bus write dynamixel:/dev/ttyUSB0 1 goal_position 2100 --later
  handwave bus write dynamixel:/dev/ttyUSB0 2 goal_position 1996 --later
  handwave bus action dynamixel:/dev/ttyUSB0")]
pub struct ActionArgs {
    /// The bus, such as dynamixel:/dev/ttyUSB0@1000000.
    #[arg(value_name = "BUS")]
    bus: BusAddress,
}

pub fn action(args: &ActionArgs, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let mut client = open(&args.bus)?;
    client.action(BROADCAST_ID)?;
    say(out, "held writes started (nobody answers to this)")?;
    Ok(ExitStatus::Done)
}
