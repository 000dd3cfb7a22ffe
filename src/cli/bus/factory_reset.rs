//! `handwave bus factory-reset`: servos as they came out of the box.

use super::{IdList, open, say};
use crate::bus::BusAddress;
use crate::bus::dynamixel::FactoryReset;
use crate::cli::{ExitStatus, Failure};
use clap::{Args, ValueEnum};
use std::io::{self, BufRead, IsTerminal, Write};

/// Reset servos to factory settings: limits, gains, homing offset and, if told so, id and baud rate are lost.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  handwave bus factory-reset dynamixel:/dev/ttyUSB0 3
  handwave bus factory-reset dynamixel:/dev/ttyUSB0 3 --keep nothing --yes    then id 1 at 57600 baud")]
pub struct FactoryResetArgs {
    /// The bus, such as dynamixel:/dev/ttyUSB0@1000000.
    #[arg(value_name = "BUS")]
    bus: BusAddress,
    /// Servo ids, such as 3, 1,3,5 or 1-12.
    #[arg(value_name = "IDS")]
    ids: IdList,
    /// What stays as it is.
    #[arg(long, value_enum, default_value_t = Keep::IdAndBaud)]
    keep: Keep,
    /// Do not ask.
    #[arg(long)]
    yes: bool,
}

/// What a factory reset keeps.
#[derive(Copy, Clone, Debug, PartialEq, Eq, ValueEnum)]
enum Keep {
    IdAndBaud,
    Id,
    Nothing,
}

pub fn factory_reset(args: &FactoryResetArgs, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let ids: Vec<u8> = args.ids.iter().collect();
    let (what, after) = match args.keep {
        Keep::IdAndBaud => (FactoryReset::KeepIdAndBaud, "keeps its id and baud rate"),
        Keep::Id => (
            FactoryReset::KeepId,
            "keeps its id and is found at 57600 baud",
        ),
        Keep::Nothing => (FactoryReset::All, "is found as id 1 at 57600 baud"),
    };
    if args.keep == Keep::Nothing && ids.len() > 1 {
        return Err(Failure::input(
            "--keep nothing takes one servo at a time: several on one line would all have id 1",
        ));
    }
    if !args.yes && !agreed(&ids)? {
        return Err(Failure::input("nothing was reset"));
    }
    let mut client = open(&args.bus)?;
    for id in ids {
        client.factory_reset(id, what)?;
        say(
            out,
            format_args!("servo {id} restarts with factory settings and {after}"),
        )?;
    }
    Ok(ExitStatus::Done)
}

/// Asks whoever sits there; without a terminal there is nobody to ask.
fn agreed(ids: &[u8]) -> Result<bool, Failure> {
    let input = io::stdin();
    if !input.is_terminal() {
        return Err(Failure::input("nobody is there to ask; add --yes to reset"));
    }
    eprint!("Reset servo(s) {ids:?}? All their settings are lost. Type yes: ");
    let mut line = String::new();
    let read = input.lock().read_line(&mut line);
    read.map_err(|error| Failure::input(format_args!("standard input: {error}")))?;
    Ok(line.trim() == "yes")
}
