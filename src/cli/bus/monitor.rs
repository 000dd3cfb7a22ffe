//! `handwave bus monitor`: how all servos are, live; changes nothing.

use super::ask::interrupted;
use super::{IdList, crew, open, say};
use crate::base::{Clock, Time};
use crate::bus::BusAddress;
use crate::bus::dynamixel::setup::plan::value;
use crate::bus::dynamixel::vitals::Vitals;
use crate::bus::dynamixel::{Client, ClientError, Model, ServoSpec};
use crate::cli::{ExitStatus, Failure};
use crate::live::stop::StopRequest;
use crate::live::{RealClock, StopSwitch};
#[cfg(feature = "tui")]
use crate::view::servos::ServoScreen;
use crate::view::servos::{Cell, Column, Level, ServoTable};
use clap::Args;
use serde_json::json;
use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

/// Without a terminal a table is printed this often.
const PRINT_EVERY: Duration = Duration::from_secs(1);
/// So near to its temperature limit a servo is warm, degrees.
const WARM_C: f64 = 10.0;

/// Watch the servos: position, speed, load, temperature, voltage, errors. Changes nothing, no torque either.
#[derive(Args, Debug)]
#[command(after_help = "\
On a terminal a live table (q ends); elsewhere a table every second, with --json one object a servo and reading.
Position in degrees is the joint's with --config, else from the middle of the servo's turn (pulse 2048).
Yellow is near a limit; white on red is beyond one, silent, or a latched error.

Examples:
  handwave bus monitor dynamixel:/dev/ttyUSB0
  handwave bus monitor --config my_arm.toml dynamixel:/dev/ttyUSB0
  handwave bus monitor dynamixel:/dev/ttyUSB0 --ids 1-6 --once
  handwave bus monitor dynamixel:/dev/ttyUSB0 --json --seconds 10 > log.jsonl")]
pub struct MonitorArgs {
    /// The bus, such as dynamixel:/dev/ttyUSB0@1000000.
    #[arg(value_name = "BUS")]
    bus: BusAddress,
    /// The character whose servos these are: names the joints and shows joint angles.
    #[arg(long, value_name = "FILE", conflicts_with = "ids")]
    config: Option<PathBuf>,
    /// Servos to watch; all that answer when not given.
    #[arg(long, value_name = "IDS")]
    ids: Option<IdList>,
    /// One reading, then end.
    #[arg(long)]
    once: bool,
    /// One JSON object a servo and reading.
    #[arg(long)]
    json: bool,
    /// Readings per second, as far as the bus allows.
    #[arg(long, value_name = "HZ", default_value_t = 10.0, value_parser = super::positive)]
    rate: f64,
    /// End after so long.
    #[arg(long, value_name = "S", value_parser = super::positive)]
    seconds: Option<f64>,
}

/// One servo under watch.
struct Watched {
    id: u8,
    model: Option<&'static Model>,
    number: u16,
    spec: Option<ServoSpec>,
    limit_c: Option<f64>,
    volts: Option<(f64, f64)>,
    vitals: Option<Vitals>,
    missed: u64,
}

pub fn monitor(args: &MonitorArgs, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let specs = match &args.config {
        Some(config) => Some(crew::character(config)?.servos),
        None => None,
    };
    let mut client = open(&args.bus)?;
    let stop = StopSwitch::new();
    stop.on_signals().map_err(Failure::bus)?;
    let clock = RealClock::new();
    let mut watched = watched(&mut *client, args, specs)?;

    #[cfg(feature = "tui")]
    let mut screen = match args.once || args.json {
        true => None,
        false => ServoScreen::open(),
    };
    let period = Duration::from_secs_f64(1.0 / args.rate);
    let begin = clock.now();
    let (mut rounds, mut last_print, mut next) = (0_u64, None::<Time>, begin);
    loop {
        for servo in &mut watched {
            servo.read(&mut *client)?;
        }
        rounds += 1;
        let now = clock.now();
        let elapsed = now.saturating_since(begin).as_secs_f64();
        if args.json {
            for servo in &watched {
                say(out, servo.json(elapsed))?;
            }
        } else {
            let table = table(args, &watched, rounds as f64 / elapsed.max(1e-3), &*client);
            #[cfg(feature = "tui")]
            if let Some(screen) = &mut screen
                && screen.show(&table)
            {
                return Ok(ExitStatus::Done);
            }
            #[cfg(feature = "tui")]
            let screenless = screen.is_none();
            #[cfg(not(feature = "tui"))]
            let screenless = true;
            if screenless && last_print.is_none_or(|at| now.saturating_since(at) >= PRINT_EVERY) {
                for line in table.lines() {
                    say(out, line)?;
                }
                last_print = Some(now);
            }
        }
        if args.once {
            return match watched.iter().any(|servo| servo.vitals.is_some()) {
                true => Ok(ExitStatus::Done),
                false => Err(crew::nobody(&*client)),
            };
        }
        if args.seconds.is_some_and(|seconds| elapsed >= seconds) {
            return Ok(ExitStatus::Done);
        }
        if stop.request() != StopRequest::None {
            return Err(interrupted("interrupted; nothing was changed"));
        }
        next = (next + period).max(clock.now() - period);
        clock.sleep_until(next);
    }
}

/// The servos to watch, by id, with their limits.
fn watched(
    client: &mut dyn Client,
    args: &MonitorArgs,
    specs: Option<Vec<ServoSpec>>,
) -> Result<Vec<Watched>, Failure> {
    let ids = match &specs {
        Some(specs) => Some(specs.iter().map(|spec| spec.id).collect()),
        None => args.ids.as_ref().map(|ids| ids.iter().collect()),
    };
    let mut all = Vec::new();
    for id in crew::present(client, ids)? {
        let mut servo = Watched {
            id,
            model: None,
            number: 0,
            spec: specs.iter().flatten().find(|spec| spec.id == id).cloned(),
            limit_c: None,
            volts: None,
            vitals: None,
            missed: 0,
        };
        servo.meet(client)?;
        all.push(servo);
    }
    all.sort_by_key(|servo| servo.id);
    Ok(all)
}

impl Watched {
    /// Asks who it is and what it bears; does nothing when it is silent.
    fn meet(&mut self, client: &mut dyn Client) -> Result<(), Failure> {
        let ping = match client.ping(self.id) {
            Ok(ping) => ping,
            Err(ClientError::Port(error)) => return Err(Failure::bus(error)),
            Err(_) => return Ok(()),
        };
        self.number = ping.model;
        self.model = Model::by_number(ping.model);
        let Some(model) = self.model else {
            return Ok(());
        };
        let mut limit = |name: &str| {
            let read = value(client, self.id, model, name).ok().flatten();
            read.map(|(_, value)| value as f64)
        };
        self.limit_c = limit("temperature_limit");
        self.volts = limit("min_voltage_limit").zip(limit("max_voltage_limit"));
        self.volts = self.volts.map(|(min, max)| (0.1 * min, 0.1 * max));
        Ok(())
    }

    fn read(&mut self, client: &mut dyn Client) -> Result<(), Failure> {
        if self.model.is_none() {
            self.meet(client)?;
        }
        let Some(model) = self.model else {
            self.missed += 1;
            return Ok(());
        };
        self.vitals = match Vitals::read(client, self.id, model) {
            Ok(vitals) => Some(vitals),
            Err(ClientError::Port(error)) => return Err(Failure::bus(error)),
            Err(_) => {
                self.missed += 1;
                None
            }
        };
        Ok(())
    }

    fn degrees(&self) -> Option<f64> {
        let pulse = self.vitals.as_ref()?.pulse?;
        let spec = match &self.spec {
            Some(spec) => spec.clone(),
            None => ServoSpec::new(self.id, "", self.model?),
        };
        let rad = spec.position_rad(i32::try_from(pulse).ok()?).to_degrees();
        // No minus before a rounded zero.
        Some(if rad.abs() < 0.05 { 0.0 } else { rad })
    }

    fn joint(&self) -> &str {
        self.spec.as_ref().map_or("", |spec| &spec.joint)
    }

    fn model_name(&self) -> String {
        match (self.model, self.number) {
            (Some(model), _) => model.name.into(),
            (None, 0) => String::new(),
            (None, number) => format!("number {number}"),
        }
    }

    fn json(&self, t_s: f64) -> serde_json::Value {
        let vitals = self.vitals.clone().unwrap_or_default();
        json!({
            "t": (t_s * 1e4).round() / 1e4,
            "id": self.id,
            "model": self.model_name(),
            "joint": self.joint(),
            "answers": self.vitals.is_some(),
            "position_deg": self.degrees(),
            "position_pulse": vitals.pulse,
            "velocity": vitals.velocity.map(|(value, _)| value),
            "velocity_unit": vitals.velocity.map(|(_, unit)| unit),
            "effort": vitals.effort.map(|(value, _)| value),
            "effort_unit": vitals.effort.map(|(_, unit)| unit),
            "temperature_c": vitals.temperature_c,
            "voltage_v": vitals.voltage_v,
            "torque": vitals.torque,
            "hardware_error": vitals.errors,
            "errors": vitals.error_names(),
            "missed": self.missed,
        })
    }

    fn row(&self) -> Vec<Cell> {
        let id = Cell::plain(self.id);
        let (joint, model) = (Cell::plain(self.joint()), Cell::plain(self.model_name()));
        let missed = Cell::plain(self.missed).at(match self.missed {
            0 => Level::Plain,
            _ => Level::Warm,
        });
        let Some(vitals) = &self.vitals else {
            let silent = Cell::plain("silent: check cable, power, baud rate").at(Level::Bad);
            let blank = || Cell::plain("");
            return vec![
                id,
                joint,
                model,
                blank(),
                blank(),
                blank(),
                blank(),
                blank(),
                blank(),
                blank(),
                missed,
                silent,
            ];
        };
        let number = |value: Option<f64>, digits: usize| {
            Cell::plain(value.map_or(String::new(), |v| format!("{v:.digits$}")))
        };
        let with_unit = |value: Option<(f64, &str)>| {
            Cell::plain(value.map_or(String::new(), |(v, unit)| format!("{v:.1} {unit}")))
        };
        let heat = match (vitals.temperature_c, self.limit_c) {
            (Some(now), Some(limit)) if now >= limit => Level::Bad,
            (Some(now), Some(limit)) if now >= limit - WARM_C => Level::Warm,
            _ => Level::Plain,
        };
        let supply = match (vitals.voltage_v, self.volts) {
            (Some(now), Some((min, max))) if !(min..=max).contains(&now) => Level::Bad,
            _ => Level::Plain,
        };
        let errors = vitals.error_names();
        let wrong = if errors.is_empty() {
            Level::Plain
        } else {
            Level::Bad
        };
        let outside = self
            .spec
            .as_ref()
            .zip(vitals.pulse)
            .is_some_and(|(spec, pulse)| i32::try_from(pulse).is_ok_and(|p| !spec.contains(p)));
        let place = if outside { Level::Warm } else { Level::Plain };
        vec![
            id,
            joint,
            model,
            number(self.degrees(), 1).at(place),
            Cell::plain(vitals.pulse.map_or(String::new(), |p| p.to_string())).at(place),
            with_unit(vitals.velocity),
            with_unit(vitals.effort),
            number(vitals.temperature_c, 0).at(heat),
            number(vitals.voltage_v, 1).at(supply),
            Cell::plain(match vitals.torque {
                Some(true) => "on",
                Some(false) => "off",
                None => "",
            }),
            missed,
            Cell::plain(errors).at(wrong),
        ]
    }
}

fn table(args: &MonitorArgs, watched: &[Watched], rate_hz: f64, client: &dyn Client) -> ServoTable {
    let columns: [(&'static str, bool); 12] = [
        ("id", true),
        ("joint", false),
        ("model", false),
        ("deg", true),
        ("pulse", true),
        ("velocity", true),
        ("load", true),
        ("C", true),
        ("V", true),
        ("torque", false),
        ("missed", true),
        ("error", false),
    ];
    let mut table = ServoTable {
        columns: columns
            .into_iter()
            .map(|(name, right)| Column { name, right })
            .collect(),
        rows: watched.iter().map(Watched::row).collect(),
        title: args.bus.to_string(),
        footer: format!(
            "{rate_hz:.1} readings a second of {} servos, {} damaged bytes seen. Changes nothing; q ends.",
            watched.len(),
            client.traffic().damaged
        ),
    };
    if watched.iter().all(|servo| servo.joint().is_empty()) {
        table.columns.remove(1);
        table.rows.iter_mut().for_each(|row| {
            row.remove(1);
        });
    }
    table
}
