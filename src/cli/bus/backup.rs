//! `handwave bus backup` and `handwave bus restore`: the control table, kept in the servo itself.

use super::{IdList, open, say};
use crate::bus::BusAddress;
use crate::bus::dynamixel::Backup;
use crate::cli::{ExitStatus, Failure};
use clap::Args;
use std::io::Write;

/// Servos to store or restore.
#[derive(Args, Debug)]
#[command(after_help = "\
Torque must be off. X430 and X540 servos know it from firmware 45 on, X330 from 46 on.

Examples:
  handwave bus backup dynamixel:/dev/ttyUSB0 1-12
  handwave bus restore dynamixel:/dev/ttyUSB0 3")]
pub struct BackupArgs {
    /// The bus, such as dynamixel:/dev/ttyUSB0@1000000.
    #[arg(value_name = "BUS")]
    bus: BusAddress,
    /// Servo ids, such as 3, 1,3,5 or 1-12.
    #[arg(value_name = "IDS")]
    ids: IdList,
}

pub fn backup(args: &BackupArgs, what: Backup, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let mut client = open(&args.bus)?;
    let done = match what {
        Backup::Store => "has stored its control table",
        Backup::Restore => "has its stored control table back and restarts",
    };
    for id in args.ids.iter() {
        client.back_up(id, what)?;
        say(out, format_args!("servo {id} {done}"))?;
    }
    Ok(ExitStatus::Done)
}
