//! `handwave bus scan` and `handwave bus ping`: who is there.

use super::{IdList, model_name, open, say};
use crate::base::print::warn;
use crate::bus::BusAddress;
use crate::bus::address::parse_baud;
use crate::bus::dynamixel::{Client, ClientError, Ping};
use crate::cli::{ExitStatus, Failure};
use clap::Args;
use handwave_dynamixel::baud::RATES;
use serde_json::json;
use std::io::Write;

/// Find the servos that answer. Without --ids by one broadcast, a second or two per baud rate.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  handwave bus scan dynamixel:/dev/ttyUSB0
  handwave bus scan dynamixel:/dev/ttyUSB0 --baud all --json
  handwave bus scan dynamixel:/dev/ttyUSB0 --baud 57600 --ids 1-20")]
pub struct ScanArgs {
    /// The bus, such as dynamixel:/dev/ttyUSB0@1000000.
    #[arg(value_name = "BUS")]
    bus: BusAddress,
    /// Baud rate to scan at instead of that of BUS: a number, or `all` for every rate that servos know.
    #[arg(long, value_name = "all|N")]
    baud: Option<String>,
    /// Ask these ids one by one instead of all by broadcast, such as 1-20.
    #[arg(long, value_name = "IDS")]
    ids: Option<IdList>,
    /// One JSON object a line.
    #[arg(long)]
    json: bool,
}

/// Ask one servo who it is.
#[derive(Args, Debug)]
pub struct PingArgs {
    /// The bus, such as dynamixel:/dev/ttyUSB0@1000000.
    #[arg(value_name = "BUS")]
    bus: BusAddress,
    /// Servo id.
    #[arg(value_name = "ID", value_parser = clap::value_parser!(u8).range(0..=252))]
    id: u8,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

pub fn scan(args: &ScanArgs, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let rates = match args.baud.as_deref() {
        None => None,
        Some("all") => Some(RATES.to_vec()),
        Some(text) => Some(vec![parse_baud(text)?]),
    };
    let mut client = open(&args.bus)?;
    let rates = rates.unwrap_or_else(|| vec![client.baud()]);
    let mut total = 0;
    for &rate in &rates {
        match client.set_baud(rate) {
            Ok(()) => {}
            // Not every adapter knows every rate.
            Err(error) if rates.len() > 1 => {
                warn(format_args!("handwave: {error}"));
                continue;
            }
            Err(error) => return Err(error.into()),
        }
        let found = match &args.ids {
            None => {
                let mut found = Vec::new();
                client.ping_all(&mut |ping| found.push(ping))?;
                found
            }
            Some(ids) => ping_each(&mut *client, ids)?,
        };
        for ping in &found {
            if total == 0 && !args.json {
                say(out, "  id  model        firmware     baud  alert")?;
            }
            total += 1;
            row(out, ping, rate, args.json)?;
        }
    }
    if total > 0 {
        return Ok(ExitStatus::Done);
    }
    let more = if rates.len() > 1 {
        ""
    } else {
        "; `--baud all` tries every rate (new servos have 57600)"
    };
    Err(Failure::bus(format_args!(
        "no servo answers on {}. Check power and cable{more}",
        client.port_name()
    )))
}

fn ping_each(client: &mut dyn Client, ids: &IdList) -> Result<Vec<Ping>, ClientError> {
    let mut found = Vec::new();
    for id in ids.iter() {
        match client.ping(id) {
            Ok(ping) => found.push(ping),
            Err(ClientError::Port(error)) => return Err(error.into()),
            // Nobody there, or nobody that speaks clearly.
            Err(_) => {}
        }
    }
    Ok(found)
}

pub fn ping(args: &PingArgs, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let mut client = open(&args.bus)?;
    let ping = client.ping(args.id)?;
    if args.json {
        row(out, &ping, client.baud(), true)?;
    } else {
        let alert = if ping.alert {
            ", hardware error latched"
        } else {
            ""
        };
        say(
            out,
            format_args!(
                "servo {}: {} (model number {}), firmware {}{alert}",
                ping.id,
                model_name(ping.model),
                ping.model,
                ping.firmware
            ),
        )?;
    }
    Ok(ExitStatus::Done)
}

fn row(out: &mut dyn Write, ping: &Ping, baud: u32, as_json: bool) -> Result<(), Failure> {
    let name = model_name(ping.model);
    if as_json {
        let row = json!({
            "id": ping.id,
            "model": name,
            "model_number": ping.model,
            "firmware": ping.firmware,
            "baud": baud,
            "alert": ping.alert,
        });
        return say(out, row);
    }
    let alert = if ping.alert { "yes" } else { "" };
    let line = format!(
        "{:>4}  {name:<11}  {:>8}  {baud:>7}  {alert}",
        ping.id, ping.firmware
    );
    say(out, line.trim_end())
}
