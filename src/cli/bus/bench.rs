//! `handwave bus bench`: how many control cycles a bus does, how evenly, and what goes wrong in them.

use super::{IdList, open, say};
use crate::base::Clock;
use crate::bus::BusAddress;
use crate::bus::dynamixel::{Client, ClientError};
use crate::cli::{ExitStatus, Failure};
use crate::live::bus_bench::{
    Bench, BenchOptions, BenchReport, Found, InspectError, Reads, ServoCount,
};
use crate::live::clock::thread_cpu_time;
use crate::live::stop::StopRequest;
use crate::live::{RealClock, StopSwitch, realtime};
use clap::{Args, ValueEnum};
use serde_json::json;
use std::io::Write;
use std::time::Duration;

/// Measure control cycles: goals out, states in, as fast as the wire allows. Nothing moves, torque stays as it is.
#[derive(Args, Debug)]
#[command(after_help = "\
Finds the servos by a scan, then does one cycle after the other: a sync write of all goals, a read of all states
(current or load, velocity, position). The goal of a servo without torque is its present position. One with torque
gets the goal that it has, or its present position if that goal is far away. A servo that turns torque on by a goal
(drive_mode bit 3) gets none. A servo that is silent three cycles in a row is left out and asked again every 250 ms.
An answer counts as lost when it comes 20 ms late, with --rate at the end of the cycle.

Prints cycles per second beside what the wire allows (byte times and return delays), the time of a cycle (median, 99th
percentile, longest), processor time per cycle, and errors by kind: silent (no answer), damaged, refused (answered with
an error), not reached (the read ended before its turn).

Examples:
  handwave bus bench dynamixel:/dev/ttyUSB0
  handwave bus bench dynamixel:/dev/ttyUSB0@3000000 --seconds 30 --json
  handwave bus bench dynamixel:/dev/ttyUSB0 --rate 200 --seconds 60
  handwave bus bench dynamixel:/tmp/servos --ids 1-12 --reads ordinary")]
pub struct BenchArgs {
    /// The bus, such as dynamixel:/dev/ttyUSB0@1000000.
    #[arg(value_name = "BUS")]
    bus: BusAddress,
    /// For how long.
    #[arg(long, value_name = "S", default_value = "5", value_parser = parse_seconds)]
    seconds: f64,
    /// Cycles per second, instead of as many as the wire allows.
    #[arg(long, value_name = "HZ", value_parser = parse_rate)]
    rate: Option<f64>,
    /// How states are read. Default: fast where the firmware of every servo knows it.
    #[arg(long, value_enum, value_name = "fast|ordinary")]
    reads: Option<ReadsArg>,
    /// These servos instead of all that a scan finds, such as 1-12. They are asked even if they do not answer.
    #[arg(long, value_name = "IDS")]
    ids: Option<IdList>,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Copy, Clone, Debug, ValueEnum)]
enum ReadsArg {
    Fast,
    Ordinary,
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if seconds > 0.0 && seconds <= 86_400.0 => Ok(seconds),
        _ => Err("expected seconds above 0, at most 86400".into()),
    }
}

fn parse_rate(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(rate_hz) if (0.1..=20_000.0).contains(&rate_hz) => Ok(rate_hz),
        _ => Err("expected cycles per second, 0.1 to 20000".into()),
    }
}

pub fn bench(args: &BenchArgs, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let mut client = open(&args.bus)?;
    let found = find(&mut *client, args.ids.as_ref())?;
    let mut bench = Bench::inspect(&mut *client, &found)?;
    let options = BenchOptions {
        reads: match args.reads {
            None => bench.reads,
            Some(ReadsArg::Fast) => Reads::Fast,
            Some(ReadsArg::Ordinary) => Reads::Ordinary,
        },
        span: Duration::from_secs_f64(args.seconds),
        period: args
            .rate
            .map(|rate_hz| Duration::from_secs_f64(1.0 / rate_hz)),
    };
    let stop = StopSwitch::new();
    stop.on_signals()
        .map_err(|error| Failure::bus(format_args!("cannot watch for signals: {error}")))?;
    let _best_effort = realtime::request();
    let clock = RealClock::new();
    let report = bench.run(
        &mut *client,
        &options,
        &|span| clock.sleep_until(clock.now() + span),
        &thread_cpu_time,
        &|| stop.request() != StopRequest::None,
    )?;
    if args.json {
        say(out, as_json(&report, &bench))?;
    } else {
        table(out, &report, &bench, args, client.baud())?;
    }
    Ok(match report.interrupted {
        true => ExitStatus::Interrupted,
        false => ExitStatus::Done,
    })
}

fn find(client: &mut dyn Client, ids: Option<&IdList>) -> Result<Vec<Found>, ClientError> {
    let mut found = Vec::new();
    let Some(ids) = ids else {
        client.ping_all(&mut |ping| found.push(Found::Servo(ping)))?;
        return Ok(found);
    };
    for id in ids.iter() {
        found.push(match client.ping(id) {
            Ok(ping) => Found::Servo(ping),
            Err(ClientError::Port(error)) => return Err(error.into()),
            Err(_) => Found::Absent(id),
        });
    }
    Ok(found)
}

fn as_json(report: &BenchReport, bench: &Bench) -> serde_json::Value {
    let errors = report.errors();
    let troubled: Vec<_> = report
        .servos
        .iter()
        .filter(|servo| servo.errors.total() + servo.alerts + servo.left_out > 0)
        .map(|servo| {
            json!({
                "id": servo.id,
                "fresh": servo.fresh,
                "alerts": servo.alerts,
                "left_out": servo.left_out,
                "errors": servo.errors,
            })
        })
        .collect();
    json!({
        "cycles_per_s": report.cycles_per_s(),
        "p50_us": report.cycle_us.p50,
        "p99_us": report.cycle_us.p99,
        "max_us": report.cycle_us.max,
        "cpu_us": report.cpu_us,
        "errors": errors.total(),
        "servos": report.servos.len(),
        "errors_by_kind": errors,
        "noise": report.noise,
        "cycles": report.cycles,
        "late": report.late,
        "seconds": report.span.as_secs_f64(),
        "reads": report.reads.as_str(),
        "wire_limit_hz": report.wire_limit_hz(),
        "wire_us": report.wire.as_secs_f64() * 1e6,
        "wire_share": report.cycles_per_s() / report.wire_limit_hz(),
        "fresh": report.servos.iter().map(|servo| servo.fresh).sum::<u64>(),
        "troubled": troubled,
        "notes": bench.notes,
    })
}

fn table(
    out: &mut dyn Write,
    report: &BenchReport,
    bench: &Bench,
    args: &BenchArgs,
    baud: u32,
) -> Result<(), Failure> {
    for note in &bench.notes {
        say(out, format_args!("note: {note}"))?;
    }
    let with_torque = bench.servos.iter().filter(|servo| servo.torque).count();
    say(
        out,
        format_args!(
            "{} servos at {baud} baud, {} reads, {with_torque} with torque on",
            report.servos.len(),
            report.reads.as_str()
        ),
    )?;
    let rate = report.cycles_per_s();
    let pace = match args.rate {
        Some(rate_hz) => format!(" of {rate_hz} asked for, {} late", report.late),
        None => String::new(),
    };
    say(out, format_args!("cycles/s       {rate:.1}{pace}"))?;
    let share = 100.0 * rate / report.wire_limit_hz();
    let reached = match () {
        () if args.rate.is_some() => format!("used to {share:.1} %"),
        () if share > 101.0 => "this line takes less than its byte times".into(),
        () => format!("reached to {share:.1} %"),
    };
    say(
        out,
        format_args!(
            "wire limit     {:.1} ({:.0} us a cycle), {reached}",
            report.wire_limit_hz(),
            report.wire.as_secs_f64() * 1e6
        ),
    )?;
    let us = report.cycle_us;
    say(
        out,
        format_args!(
            "cycle          median {} us, 99 % {} us, longest {} us",
            us.p50, us.p99, us.max
        ),
    )?;
    say(
        out,
        format_args!("processor      {:.1} us a cycle", report.cpu_us),
    )?;
    let errors = report.errors();
    say(
        out,
        format_args!(
            "errors         {} of {} reads: silent {}, damaged {}, refused {}, not reached {}; noise {}",
            errors.total(),
            report.servos.len() as u64 * report.cycles,
            errors.silent,
            errors.damaged,
            errors.refused,
            errors.not_reached,
            report.noise
        ),
    )?;
    let troubled = |servo: &&ServoCount| servo.errors.total() + servo.alerts + servo.left_out > 0;
    if report.servos.iter().any(|servo| troubled(&servo)) {
        say(
            out,
            "  id     fresh    silent   damaged   refused  not reached  left out    alerts",
        )?;
    }
    for servo in report.servos.iter().filter(troubled) {
        let errors = servo.errors;
        say(
            out,
            format_args!(
                "{:>4}  {:>8}  {:>8}  {:>8}  {:>8}  {:>11}  {:>8}  {:>8}",
                servo.id,
                servo.fresh,
                errors.silent,
                errors.damaged,
                errors.refused,
                errors.not_reached,
                servo.left_out,
                servo.alerts
            ),
        )?;
    }
    Ok(())
}

impl From<InspectError> for Failure {
    fn from(error: InspectError) -> Self {
        match error {
            InspectError::Client(error) => error.into(),
            other => Failure::bus(other),
        }
    }
}
