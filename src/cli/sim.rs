//! `handwave sim`: simulated servos on a pseudo-terminal, for any client.

use super::{ExitStatus, Failure, say, warn};
use crate::base::Clock;
use crate::base::suggest::nearest;
use crate::bus::dynamixel::model::PULSES_PER_TURN;
use crate::live::{RealClock, realtime};
use crate::sim::fault::FAULTS;
use crate::sim::line::SharedLine;
use crate::sim::models::{self, MODELS};
use crate::sim::table::Device;
use crate::sim::trace::Trace;
use crate::sim::{FaultSpec, Line, LineOptions, PtyServer, Servo};
use clap::{Args, Subcommand};
use handwave_dynamixel::{MAX_ID, baud};
use std::io::BufRead;
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// Arguments of `handwave sim`.
#[derive(Args, Debug)]
pub struct SimArgs {
    #[command(subcommand)]
    bus: SimBus,
}

#[derive(Subcommand, Debug)]
enum SimBus {
    /// Dynamixel servos (Protocol 2.0) on a pseudo-terminal
    #[command(after_help = DYNAMIXEL_HELP)]
    Dynamixel(DynamixelArgs),
}

const DYNAMIXEL_HELP: &str = "\
Prints 'ready PATH' when clients may connect, serves them one after another, and ends on Ctrl-C or SIGTERM.

Servos start as commissioned: return delay 0, status return level 2, position mode, torque off, position 2048.
A servo set to another baud rate than the client's port is silent. A reboot takes a quarter of a second.
FIRMWARE is a version, as in xl330-m288@47: fast reads need 45 (46 on the 330 size; MX and PH42 have none), a bus watchdog 38,
and the indirect data of the 330 size lies at 224 before 52, at 208 from then on.
Behind a servo that stays silent in a sync or bulk read, the others answer when its time is over (or never, with
--fault bus:wait-in-vain@0s); a fast read ends there. A shaft that is held (--fault 3:stuck@5s) heats its motor and
trips overload within seconds; all that the servos draw lowers the voltage they report.

Standard input is the hand at the servos: 'plug N' and 'unplug N', and 'turn N DEGREES' turns a shaft whose torque is off
(N as in --servos).

Examples:
  handwave sim dynamixel --servos 1-12 --link /tmp/servos
  handwave sim dynamixel --servos 1-6:xl330-m288@47,20:xm430-w350 --link /tmp/servos --baud 3000000
  handwave sim dynamixel --servos 1-4 --link /tmp/servos --fault 3:silent@2s..2.5s --fault bus:corrupt=0.01@0s --seed 7
  handwave sim dynamixel --servos 1-12 --link /tmp/servos --fault bus:unplugged=1@5s..6s     back as /tmp/servos.1
  handwave sim dynamixel --servos 1-12 --link /tmp/servos --trace motion.csv
  handwave sim dynamixel --servos 1-3 --link /tmp/servos --factory     then type: plug 1
";

#[derive(Args, Debug)]
struct DynamixelArgs {
    /// Servo ids and their model: 1-12[:MODEL[@FIRMWARE]][,20:MODEL...]; MODEL defaults to xl430-w250
    #[arg(long, required_unless_present = "list_faults")]
    servos: Option<String>,
    /// Where to link the pseudo-terminal; an old link is replaced
    #[arg(long, value_name = "PATH", required_unless_present = "list_faults")]
    link: Option<PathBuf>,
    /// Baud rate the servos are set to
    #[arg(long, value_name = "N", default_value_t = 1_000_000)]
    baud: u32,
    /// Answer at once instead of at line speed
    #[arg(long)]
    unpaced: bool,
    /// Servos out of the box: id 1, 57,600 baud, return delay 500 us. Several are off the line until 'plug N'
    /// is typed on standard input (N as in --servos); 'unplug N' takes one off again
    #[arg(long, conflicts_with = "baud")]
    factory: bool,
    /// Delay of the adapter on the way to the client, milliseconds
    #[arg(long, value_name = "X", default_value_t = 0.0)]
    latency_ms: f64,
    /// Delay of a servo between an instruction and its status, beside its return delay, microseconds
    #[arg(long, value_name = "X", default_value_t = 0.0)]
    turnaround_us: f64,
    /// Delay of each servo behind its predecessor in a fast read, microseconds
    #[arg(long, value_name = "X", default_value_t = 0.0)]
    hop_us: f64,
    /// Write what the servos really do: a row every 5 ms with position, goal (pulses), torque, watchdog,
    /// load (share of stall), temperature and voltage of each, and the instructions heard so far
    #[arg(long, value_name = "FILE.csv")]
    trace: Option<PathBuf>,
    /// Inject a fault: TARGET:NAME[=VALUE]@T1s[..T2s], TARGET an id or 'bus' (repeatable, see --list-faults)
    #[arg(long = "fault", value_name = "SPEC")]
    faults: Vec<String>,
    /// Where chance begins, for faults
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// List the faults, one a line: name, scope, description
    #[arg(long)]
    list_faults: bool,
}

/// Runs `handwave sim`.
pub fn run(args: SimArgs) -> Result<ExitStatus, Failure> {
    match args.bus {
        SimBus::Dynamixel(args) if args.list_faults => list_faults(),
        SimBus::Dynamixel(args) => dynamixel(&args),
    }
}

fn list_faults() -> Result<ExitStatus, Failure> {
    for info in FAULTS {
        say(format_args!(
            "{} {} {}",
            info.name, info.scope, info.description
        ));
    }
    Ok(ExitStatus::Done)
}

fn dynamixel(args: &DynamixelArgs) -> Result<ExitStatus, Failure> {
    let (Some(servos), Some(link)) = (&args.servos, &args.link) else {
        return Err(Failure::input("--servos and --link are needed"));
    };
    let servos = parse_servos(servos).map_err(Failure::input)?;
    let (line, port_baud) = build_line(args, &servos).map_err(Failure::input)?;
    let line = SharedLine::new(line);
    let clock: Arc<dyn Clock> = Arc::new(RealClock::new());

    let (stop, stopper) = UnixStream::pair().map_err(Failure::bus)?;
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
        let stopper = stopper.try_clone().map_err(Failure::bus)?;
        signal_hook::low_level::pipe::register(signal, stopper).map_err(Failure::bus)?;
    }
    let mut server = PtyServer::open(line.clone(), Arc::clone(&clock), link, port_baud)
        .map_err(Failure::input)?;
    if let Some(path) = &args.trace {
        let no_file = |e| Failure::input(format!("--trace {}: {e}", path.display()));
        let file = std::fs::File::create(path).map_err(no_file)?;
        let out = Box::new(std::io::BufWriter::new(file));
        let trace = Trace::new(&line.lock(), out).map_err(no_file)?;
        server.trace_to(trace);
    }
    std::thread::spawn(move || follow_hands(&line, clock.as_ref()));
    // A wire does not wait for the scheduler; without the right to it all still works.
    let _best_effort = realtime::request();
    say(format_args!("ready {}", link.display()));
    server.serve(stop.as_fd()).map_err(Failure::bus)?;
    Ok(ExitStatus::Done)
}

fn build_line(args: &DynamixelArgs, servos: &[Asked]) -> Result<(Line, u32), String> {
    if !(0.0..=1000.0).contains(&args.latency_ms) {
        return Err(format!(
            "--latency-ms takes 0 to 1000, not {}",
            args.latency_ms
        ));
    }
    for (option, value) in [
        ("--turnaround-us", args.turnaround_us),
        ("--hop-us", args.hop_us),
    ] {
        if !(0.0..=1e6).contains(&value) {
            return Err(format!("{option} takes 0 to 1000000, not {value}"));
        }
    }
    let code = baud::code(args.baud).ok_or_else(|| {
        format!(
            "--baud {} is no rate of these servos; there are {}",
            args.baud,
            baud::RateList
        )
    })?;
    let mut line = Line::new(LineOptions {
        paced: !args.unpaced,
        turnaround: Duration::from_secs_f64(args.turnaround_us * 1e-6),
        hop: Duration::from_secs_f64(args.hop_us * 1e-6),
        latency: Duration::from_secs_f64(args.latency_ms * 1e-3),
        seed: args.seed,
        ..LineOptions::default()
    });
    let clock_start = crate::base::Time::ZERO;
    for &Asked {
        id,
        device,
        firmware,
    } in servos
    {
        if args.factory {
            line.attach(id, Servo::factory(device).with_firmware(firmware));
            line.set_plugged(id, servos.len() == 1, clock_start);
        } else {
            let servo = Servo::commissioned(device, id, code);
            line.attach(id, servo.with_firmware(firmware));
        }
    }
    for spec in &args.faults {
        let fault: FaultSpec = spec.parse().map_err(|e| format!("{e}"))?;
        line.inject(fault).map_err(|e| e.to_string())?;
    }
    Ok((line, if args.factory { 57_600 } else { args.baud }))
}

/// A servo as asked for.
#[derive(Copy, Clone, Debug)]
struct Asked {
    id: u8,
    device: &'static Device,
    firmware: u8,
}

/// Reads `1-12[:MODEL[@FIRMWARE]][,20:MODEL...]`.
fn parse_servos(list: &str) -> Result<Vec<Asked>, String> {
    let mut servos: Vec<Asked> = Vec::new();
    for part in list.split(',') {
        let (ids, kind) = part.split_once(':').unwrap_or((part, MODELS[0].model.name));
        let (name, firmware) = match kind.split_once('@') {
            None => (kind, None),
            Some((name, text)) => {
                let version = text.parse::<u8>().ok().filter(|version| *version > 0);
                let version = version.ok_or_else(|| {
                    format!("--servos: '{text}' is no firmware version 1..255, as in {name}@47")
                })?;
                (name, Some(version))
            }
        };
        let device = models::model(name).ok_or_else(|| {
            let known = MODELS.iter().map(|device| device.model.name);
            match nearest(name, known.clone()) {
                Some(near) => format!("--servos: unknown model '{name}'; did you mean '{near}'?"),
                None => {
                    let known: Vec<_> = known.collect();
                    let known = known.join(", ");
                    format!("--servos: unknown model '{name}'; there are {known}")
                }
            }
        })?;
        let (first, last) = ids.split_once('-').unwrap_or((ids, ids));
        let id = |text: &str| text.trim().parse().ok().filter(|id| *id <= MAX_ID);
        let (Some(first), Some(last)) = (id(first), id(last)) else {
            return Err(format!(
                "--servos: '{ids}' is no id or range of ids 0..{MAX_ID}, as in 1-12 or 20"
            ));
        };
        if first > last {
            return Err(format!("--servos: the range '{ids}' runs backwards"));
        }
        for id in first..=last {
            if servos.iter().any(|other| other.id == id) {
                return Err(format!("--servos: servo {id} is named twice"));
            }
            servos.push(Asked {
                id,
                device,
                firmware: firmware.unwrap_or(device.firmware),
            });
        }
    }
    Ok(servos)
}

/// How fast a hand turns a shaft, degrees per second, and how often it moves it on, seconds.
const HAND_DEG_S: f64 = 180.0;
const HAND_STEP_S: f64 = 0.005;

/// Takes `plug N`, `unplug N` and `turn N DEG` from standard input until it ends.
fn follow_hands(line: &SharedLine, clock: &dyn Clock) {
    for command in std::io::stdin().lock().lines().map_while(Result::ok) {
        let words: Vec<&str> = command.split_whitespace().collect();
        let label = words.get(1).and_then(|word| word.parse().ok());
        let degrees = words.get(2).and_then(|word| word.parse::<f64>().ok());
        let found = match (words.as_slice(), label) {
            ([], _) => continue,
            (["plug" | "unplug", _], Some(label)) => {
                let now = clock.now();
                line.lock().set_plugged(label, words[0] == "plug", now)
            }
            (["turn", _, _], Some(label)) if degrees.is_some_and(|d| d.abs() <= 3600.0) => {
                turn(line, clock, label, degrees.unwrap_or(0.0))
            }
            _ => {
                warn(format_args!(
                    "expected 'plug N', 'unplug N' or 'turn N DEGREES', found '{command}'"
                ));
                continue;
            }
        };
        if !found {
            let labels: Vec<_> = line.lock().labels().map(|l| l.to_string()).collect();
            warn(format_args!(
                "no such servo in '{command}'; there are {}",
                labels.join(", ")
            ));
        }
    }
}

/// Turns the shaft of servo `label` by hand, at a hand's speed; false when there is no such servo.
fn turn(line: &SharedLine, clock: &dyn Clock, label: u8, degrees: f64) -> bool {
    let steps = (degrees.abs() / HAND_DEG_S / HAND_STEP_S).ceil().max(1.0);
    let pulses = degrees / 360.0 * PULSES_PER_TURN / steps;
    for _ in 0..steps as u32 {
        let turned = line
            .lock()
            .servo_mut(label)
            .map(|servo| servo.turn_by_hand(pulses));
        match turned {
            None => return false,
            Some(true) => {}
            Some(false) => {
                warn(format_args!(
                    "the torque of servo {label} is on and holds it"
                ));
                return true;
            }
        }
        clock.sleep_until(clock.now() + Duration::from_secs_f64(HAND_STEP_S));
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bad_list_of_servos_is_refused_with_a_reason() {
        for (list, expected) in [
            ("", "is no id"),
            ("1-", "is no id"),
            ("1-300", "is no id"),
            ("253", "is no id"),
            ("5-3", "runs backwards"),
            ("1-3,2", "servo 2 is named twice"),
            ("1:xl430-w25", "did you mean 'xl430-w250'?"),
            ("1:frob", "there are xl430-w250"),
            ("1:xl330-m288@", "no firmware version"),
            ("1:xl330-m288@256", "no firmware version"),
        ] {
            let message = parse_servos(list).expect_err("a bad list");
            assert!(message.contains(expected), "{list}: {message}");
        }
    }

    #[test]
    fn ranges_and_single_servos_mix() {
        let servos = parse_servos("1-3,20:XL430-W250").expect("a good list");
        let ids: Vec<u8> = servos.iter().map(|asked| asked.id).collect();
        assert_eq!(ids, [1, 2, 3, 20]);
        let servos = parse_servos("1-2:xl330-m288@47,3:xl330-m288").expect("a good list");
        let firmware: Vec<u8> = servos.iter().map(|asked| asked.firmware).collect();
        assert_eq!(firmware, [47, 47, 52]);
    }
}
