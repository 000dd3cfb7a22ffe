//! `handwave bus record`: leads the robot by hand and writes down where it was.

use super::ask::{Ask, interrupted, prompt};
use super::setup::progress;
use super::{IdList, crew, open_on, say};
use crate::base::Clock;
use crate::bus::BusAddress;
use crate::cli::{ExitStatus, Failure};
use crate::live::RealClock;
use crate::live::drive::Drive;
use clap::Args;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// Record a motion by leading the robot by hand: torque off, positions at a steady rate into a CSV.
#[derive(Args, Debug)]
#[command(after_help = "\
The file has the header t,<joint>,... (servo_3 without --config), seconds, radians; `handwave bus play` plays it,
`handwave clip import` makes a clip of it.

Examples:
  handwave bus record --config my_arm.toml dynamixel:/dev/ttyUSB0 --out wave.csv
  handwave bus record dynamixel:/dev/ttyUSB0 --ids 1-4 --out take.csv --seconds 10 --yes")]
pub struct RecordArgs {
    /// The bus, such as dynamixel:/dev/ttyUSB0@1000000.
    #[arg(value_name = "BUS")]
    bus: BusAddress,
    /// Where to write.
    #[arg(long, value_name = "FILE.csv")]
    out: PathBuf,
    /// The character whose servos these are: joint names and joint angles.
    #[arg(long, value_name = "FILE", conflicts_with = "ids")]
    config: Option<PathBuf>,
    /// Servos to record; all that answer when not given.
    #[arg(long, value_name = "IDS")]
    ids: Option<IdList>,
    /// Rows per second.
    #[arg(long, value_name = "HZ", default_value_t = 50.0, value_parser = super::positive)]
    rate: f64,
    /// End after so long; else by Enter.
    #[arg(long, value_name = "S", value_parser = super::positive)]
    seconds: Option<f64>,
    /// Ask nothing: torque goes off at once.
    #[arg(long)]
    yes: bool,
}

pub fn record(args: &RecordArgs, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let clock: Arc<dyn Clock> = Arc::new(RealClock::new());
    let specs = args.config.as_deref().map(crew::character).transpose()?;
    let mut client = open_on(&args.bus, Arc::clone(&clock))?;
    let specs = match specs {
        Some(character) => character.servos,
        None => {
            let ids = args.ids.as_ref().map(|ids| ids.iter().collect());
            let ids = crew::present(&mut *client, ids)?;
            ids.into_iter()
                .map(|id| crew::spec_of(&mut *client, id))
                .collect::<Result<_, _>>()?
        }
    };
    let mut ask = Ask::new(args.yes)?;
    crew::all_there(&mut *client, &specs)?;
    crew::release(&mut *client, &specs, &mut ask, out)?;
    let chain = crew::chain(client, specs, &args.bus, args.rate, false)?;
    let mut drive =
        Drive::begin(Box::new(chain), clock, Vec::new(), args.rate).map_err(super::jog::failure)?;
    let file_error =
        |e: std::io::Error| Failure::input(format_args!("--out {}: {e}", args.out.display()));
    let mut file = BufWriter::new(File::create(&args.out).map_err(file_error)?);
    writeln!(file, "t,{}", drive.joints().join(",")).map_err(file_error)?;

    let by_enter = args.seconds.is_none();
    if by_enter && !args.yes {
        prompt(
            out,
            "torque is off: take hold of the robot, and press Enter to begin ",
        );
        ask.line(&mut || Ok(()))?;
    }
    say(
        out,
        match args.seconds {
            None => "recording; Enter ends".to_owned(),
            Some(seconds) => format!("recording for {seconds} s"),
        },
    )?;
    let mut rows = 0_u64;
    let mut begin = None;
    let ended = loop {
        if ask.is_stopped() {
            break Ok(true);
        }
        if let Err(error) = drive.step(&[]) {
            break Err(error);
        }
        let t = drive.now().secs_since(*begin.get_or_insert(drive.now()));
        if args.seconds.is_some_and(|seconds| t > seconds + 1e-9) {
            break Ok(false);
        }
        write!(file, "{t:.4}").map_err(file_error)?;
        for position in drive.positions() {
            write!(file, ",{position:.5}").map_err(file_error)?;
        }
        writeln!(file).map_err(file_error)?;
        rows += 1;
        if rows.is_multiple_of(25) {
            let degrees: Vec<String> = drive
                .positions()
                .map(|q| format!("{:.0}", q.to_degrees()))
                .collect();
            progress(Some(format_args!("{t:.1} s, {} deg", degrees.join(" "))));
        }
        if by_enter && ask.line_within(Duration::ZERO).is_some() {
            break Ok(false);
        }
        if by_enter && ask.is_over() {
            break Ok(false);
        }
    };
    progress(None);
    file.flush().map_err(file_error)?;
    let path = args.out.display();
    let seconds = rows.saturating_sub(1) as f64 / args.rate;
    let summary = format!(
        "{path}: {rows} rows, {seconds:.1} s, {} joints, {} readings missed (a joint keeps its last)",
        drive.joints().len(),
        drive.missed
    );
    match ended {
        Err(error) => Err(Failure::bus(format_args!(
            "{error}. Kept so far: {summary}"
        ))),
        Ok(true) => Err(interrupted(format_args!(
            "interrupted; torque is off. {summary}"
        ))),
        Ok(false) => {
            say(out, summary)?;
            let config = args
                .config
                .as_ref()
                .map_or(String::new(), |c| format!("--config {} ", c.display()));
            say(
                out,
                format_args!(
                    "play it:        handwave bus play {config}{} {path}\n\
                     make it a clip: handwave clip import {path} --out {}",
                    args.bus,
                    args.out.with_extension("json").display()
                ),
            )?;
            Ok(ExitStatus::Done)
        }
    }
}
