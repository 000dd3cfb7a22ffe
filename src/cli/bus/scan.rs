//! `handwave bus scan` and `handwave bus ping`: who is there.

use super::setup::progress;
use super::{IdList, model_name, open, say};
use crate::base::print::warn;
use crate::bus::BusAddress;
use crate::bus::address::parse_baud;
use crate::bus::dynamixel::setup::sweep;
use crate::bus::dynamixel::vitals::Vitals;
use crate::bus::dynamixel::{Model, Ping};
use crate::cli::{ExitStatus, Failure};
use clap::Args;
use handwave_dynamixel::baud::RATES;
use serde_json::json;
use std::io::Write;

/// Find the servos that answer, with voltage, temperature and latched errors. Without --ids by one broadcast, a second or two per baud rate.
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
        let ids: Option<Vec<u8>> = args.ids.as_ref().map(|ids| ids.iter().collect());
        progress(Some(format_args!("looking at {rate} baud")));
        let swept = sweep(&mut *client, &[rate], ids.as_deref(), &mut |_| true);
        progress(None);
        let swept = swept?;
        for found in &swept.found {
            if total == 0 && !args.json {
                say(out, "  id  model        firmware     baud     V   C  error")?;
            }
            total += 1;
            let health = Model::by_number(found.ping.model)
                .and_then(|model| Vitals::read(&mut *client, found.ping.id, model).ok());
            row(out, &found.ping, rate, health.as_ref(), args.json)?;
            if found.garbled {
                talk_over(&format!("id {} at {rate} baud", found.ping.id), &args.bus);
            }
        }
        if !swept.noise.is_empty() {
            total += 1;
            talk_over(&format!("an id at {rate} baud"), &args.bus);
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

/// Says that several servos share an id, and what to do.
fn talk_over(place: &str, bus: &BusAddress) {
    warn(format_args!(
        "handwave: several servos seem to answer to {place}: their words come damaged. Unplug all of them but one, \
         give it an id of its own by `handwave bus setup --id N {bus}`, then the next"
    ));
}

pub fn ping(args: &PingArgs, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let mut client = open(&args.bus)?;
    let ping = client.ping(args.id)?;
    if args.json {
        row(out, &ping, client.baud(), None, true)?;
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

fn row(
    out: &mut dyn Write,
    ping: &Ping,
    baud: u32,
    health: Option<&Vitals>,
    as_json: bool,
) -> Result<(), Failure> {
    let name = model_name(ping.model);
    let voltage = health.and_then(|vitals| vitals.voltage_v);
    let temperature = health.and_then(|vitals| vitals.temperature_c);
    if as_json {
        let row = json!({
            "id": ping.id,
            "model": name,
            "model_number": ping.model,
            "firmware": ping.firmware,
            "baud": baud,
            "alert": ping.alert,
            "voltage_v": voltage.map(|v| (v * 10.0).round() / 10.0),
            "temperature_c": temperature,
            "hardware_error": health.map(|vitals| vitals.errors),
        });
        return say(out, row);
    }
    let number = |value: Option<f64>, digits: usize| {
        value.map_or(String::new(), |value| format!("{value:.digits$}"))
    };
    let errors = match (health.map(Vitals::error_names), ping.alert) {
        (Some(names), _) if !names.is_empty() => names,
        (_, true) => "hardware error latched".into(),
        (_, false) => String::new(),
    };
    let line = format!(
        "{:>4}  {name:<11}  {:>8}  {baud:>7}  {:>4}  {:>2}  {errors}",
        ping.id,
        ping.firmware,
        number(voltage, 1),
        number(temperature, 0)
    );
    say(out, line.trim_end())
}
