//! `handwave bus`: look at and set up the servos of a bus.

mod action;
mod ask;
mod backup;
mod bench;
mod calibrate;
mod clear;
mod crew;
mod factory_reset;
mod ids;
mod jog;
mod monitor;
mod play;
mod record;
mod registers;
mod scan;
mod setup;

use super::{ExitStatus, Failure};
use crate::base::Clock;
use crate::bus::dynamixel::{self, Backup, Client, ClientError, Model, Speaks};
use crate::bus::port::bare;
use crate::bus::{AddressError, BusAddress};
use crate::live::RealClock;
use clap::{Args, Subcommand};
use ids::IdList;
use std::io::{self, Write};
use std::sync::Arc;

/// Look at and set up the servos of a bus.
#[derive(Args, Debug)]
#[command(after_help = "\
BUS is `dynamixel:PORT[@BAUD]`, 1000000 baud if none is given.

Examples:
  handwave bus scan dynamixel:/dev/ttyUSB0 --baud all
  handwave bus setup --config my_arm.toml dynamixel:/dev/ttyUSB0       new servos, one at a time
  handwave bus calibrate --config my_arm.toml dynamixel:/dev/ttyUSB0   zero, direction, range by hand
  handwave bus monitor dynamixel:/dev/ttyUSB0
  handwave bus jog dynamixel:/dev/ttyUSB0 3
  handwave bus record dynamixel:/dev/ttyUSB0 --out take.csv            lead the robot by hand
  handwave bus play dynamixel:/dev/ttyUSB0 take.csv
  handwave bus ping dynamixel:/dev/ttyUSB0 3
  handwave bus read dynamixel:/dev/ttyUSB0 1-12 present_position
  handwave bus read dynamixel:/dev/ttyUSB0 3 all
  handwave bus write dynamixel:/dev/ttyUSB0@57600 1 baud_rate 3
  handwave bus reboot dynamixel:/dev/ttyUSB0 3
  handwave bus bench dynamixel:/dev/ttyUSB0 --seconds 5")]
pub struct BusArgs {
    #[command(subcommand)]
    command: BusCommand,
}

#[derive(Subcommand, Debug)]
enum BusCommand {
    Scan(scan::ScanArgs),
    Setup(Box<setup::SetupArgs>),
    Monitor(monitor::MonitorArgs),
    Jog(jog::JogArgs),
    Calibrate(calibrate::CalibrateArgs),
    Record(record::RecordArgs),
    Play(play::PlayArgs),
    Ping(scan::PingArgs),
    Read(registers::ReadArgs),
    Write(registers::WriteArgs),
    Reboot(RebootArgs),
    Action(action::ActionArgs),
    /// Let servos store their control table in themselves.
    Backup(backup::BackupArgs),
    /// Give servos the control table back that they stored; they restart.
    Restore(backup::BackupArgs),
    Clear(clear::ClearArgs),
    FactoryReset(factory_reset::FactoryResetArgs),
    Bench(bench::BenchArgs),
}

/// Restart servos: clears a latched hardware error; torque is off afterwards.
#[derive(Args, Debug)]
struct RebootArgs {
    /// The bus, such as dynamixel:/dev/ttyUSB0@1000000.
    #[arg(value_name = "BUS")]
    bus: BusAddress,
    /// Servo ids, such as 3, 1,3,5 or 1-12.
    #[arg(value_name = "IDS")]
    ids: IdList,
}

/// Runs `handwave bus`.
pub fn run(args: BusArgs) -> Result<ExitStatus, Failure> {
    let mut out = io::stdout().lock();
    match args.command {
        BusCommand::Scan(args) => scan::scan(&args, &mut out),
        BusCommand::Setup(args) => setup::setup(&args, &mut out),
        BusCommand::Monitor(args) => monitor::monitor(&args, &mut out),
        BusCommand::Jog(args) => jog::jog(&args, &mut out),
        BusCommand::Calibrate(args) => calibrate::calibrate(&args, &mut out),
        BusCommand::Record(args) => record::record(&args, &mut out),
        BusCommand::Play(args) => play::play(&args, &mut out),
        BusCommand::Ping(args) => scan::ping(&args, &mut out),
        BusCommand::Read(args) => registers::read(&args, &mut out),
        BusCommand::Write(args) => registers::write(&args, &mut out),
        BusCommand::Reboot(args) => reboot(&args, &mut out),
        BusCommand::Action(args) => action::action(&args, &mut out),
        BusCommand::Backup(args) => backup::backup(&args, Backup::Store, &mut out),
        BusCommand::Restore(args) => backup::backup(&args, Backup::Restore, &mut out),
        BusCommand::Clear(args) => clear::clear(&args, &mut out),
        BusCommand::FactoryReset(args) => factory_reset::factory_reset(&args, &mut out),
        BusCommand::Bench(args) => bench::bench(&args, &mut out),
    }
}

fn reboot(args: &RebootArgs, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let mut client = open(&args.bus)?;
    for id in args.ids.iter() {
        client.reboot(id)?;
        say(out, format_args!("servo {id} reboots, its torque is off"))?;
    }
    Ok(ExitStatus::Done)
}

/// A client on the bus.
fn open(bus: &BusAddress) -> Result<Box<dyn Client>, Failure> {
    open_on(bus, Arc::new(RealClock::new()))
}

/// A client on the bus, its time that of `clock`.
fn open_on(bus: &BusAddress, clock: Arc<dyn Clock>) -> Result<Box<dyn Client>, Failure> {
    match bus {
        BusAddress::Sim => Err(Failure::input(
            "the bus `sim` lives inside `handwave run`. For servos that other commands can reach start \
             `handwave sim dynamixel --servos 1-12 --link /tmp/servos` and use dynamixel:/tmp/servos",
        )),
        BusAddress::Dynamixel {
            path,
            baud,
            backend,
        } => dynamixel::open(path, *baud, *backend, Speaks::Either, clock, &mut bare)
            .map_err(Failure::bus),
    }
}

impl From<ClientError> for Failure {
    fn from(error: ClientError) -> Self {
        match error {
            ClientError::Timeout { id, .. } => Failure::bus(format_args!(
                "servo {id} does not answer. Check its power, cable, id and baud rate; \
                 `handwave bus scan BUS --baud all` finds servos"
            )),
            other => Failure::bus(other),
        }
    }
}

impl From<AddressError> for Failure {
    fn from(error: AddressError) -> Self {
        Failure::input(error)
    }
}

/// Prints one line. That nobody reads any more, as behind `| head`, is no reason to leave work half done.
fn say(out: &mut dyn Write, line: impl std::fmt::Display) -> Result<(), Failure> {
    match writeln!(out, "{line}") {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::input(format_args!("standard output: {error}")))
        }
        Ok(()) | Err(_) => Ok(()),
    }
}

/// Reads a number above 0.
fn positive(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|value: &f64| *value > 0.0 && value.is_finite())
        .ok_or_else(|| format!("'{text}' is not a number above 0"))
}

/// Name of a model number, for tables.
fn model_name(number: u16) -> &'static str {
    Model::by_number(number).map_or("unknown", |model| model.name)
}
