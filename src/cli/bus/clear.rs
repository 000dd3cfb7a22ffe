//! `handwave bus clear`: takes the whole turns out of the present position.

use super::{IdList, open, say};
use crate::bus::BusAddress;
use crate::bus::dynamixel::model::address;
use crate::cli::{ExitStatus, Failure};
use clap::Args;
use std::io::Write;

/// Set the whole turns of the present position to zero (extended position mode). Refused while it moves.
#[derive(Args, Debug)]
#[command(after_help = "\
Example:
  handwave bus clear dynamixel:/dev/ttyUSB0 3")]
pub struct ClearArgs {
    /// The bus, such as dynamixel:/dev/ttyUSB0@1000000.
    #[arg(value_name = "BUS")]
    bus: BusAddress,
    /// Servo ids, such as 3, 1,3,5 or 1-12.
    #[arg(value_name = "IDS")]
    ids: IdList,
}

pub fn clear(args: &ClearArgs, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let mut client = open(&args.bus)?;
    for id in args.ids.iter() {
        client.clear_multi_turn(id)?;
        let mut position = [0; 4];
        client.read(id, address::PRESENT_POSITION, &mut position)?;
        let pulse = i32::from_le_bytes(position);
        say(out, format_args!("servo {id} stands at {pulse}"))?;
    }
    Ok(ExitStatus::Done)
}
