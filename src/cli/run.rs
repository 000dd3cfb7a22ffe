//! `handwave run`: the main job. Poses in, servos move.

use super::keeping::{self, HowRun, KeepOptions, Keeping, Kept};
use super::summary;
use super::targets::TargetsFile;
use super::{ExitStatus, Failure, say, warn};
use crate::base::{Clock, VirtualClock};
use crate::bus::BusAddress;
use crate::config::file::OnBusLost;
use crate::config::files::BUILT_IN;
use crate::config::{self, Character, Files, GestureFiles};
use crate::gesture::PerformerScale;
use crate::live::control::Ending;
use crate::live::footing::{Footing, Slides};
use crate::live::reload::News;
use crate::live::session::{self, Observer, Report, Session};
use crate::live::source::{self, Source};
use crate::live::wire::{self, WireError};
use crate::live::{CycleRecord, RealClock, StopSwitch};
use crate::sim::FaultSpec;
use crate::view::Display;
use clap::{Args, ValueEnum};
use std::io::BufRead;
use std::path::PathBuf;
use std::sync::Arc;

/// Arguments of `handwave run`.
#[derive(Args, Debug, Default)]
#[command(after_help = EXAMPLES)]
pub struct RunArgs {
    /// A character (default: the built-in quadruped)
    config: Option<PathBuf>,
    #[command(flatten)]
    options: RunOptions,
}

impl RunArgs {
    /// The built-in quadruped with `options`: what `handwave` does without a command.
    pub fn built_in(options: RunOptions) -> Self {
        Self {
            config: None,
            options,
        }
    }
}

/// Examples and exit codes, for `--help`.
pub const EXAMPLES: &str = "Examples:
  handwave run                                        the built-in quadruped, simulated, with a recorded performer
  handwave run --bus dynamixel:/dev/ttyUSB0@1000000   the same on real servos
  handwave run my_robot.toml --input file:take3.jsonl
  handwave run my_robot.toml --input udp://7000       live: pose-stream JSON, one object a datagram, header first
  my_tracker | handwave run my_robot.toml --input -   live from a pipe (JSON Lines or CSV)
  handwave run --scale 1.5                            a small hand (its poses enlarged to the gestures' size)
  handwave run --headless --speed max --targets a.csv the whole performance at once, same bytes every time
  handwave run configs/fox.toml --headless --speed max --targets fox.csv   an avatar: rotations, no servos
  handwave run --fault \"7:silent@8s..9s\"              see what a silent servo does

Ctrl-C once: the robot comes to rest, lies down, torque goes off. Twice: torque goes off at once.
A servo that fell out, or a bus that is back, is taken into control again by key r or SIGUSR1 ([safety] rearm).
[safety] of a configuration says what is watched and what follows: on_servo_fault, on_bus_lost, on_overrun,
on_lost, stop_gesture, limits for following error, stall, temperature, supply and effort (configs/quadruped.toml).
Exit codes: 0 done, 2 bad usage, config or input, 3 bus failure, 4 safety stop, 130 interrupted.";

/// Options of `handwave run`.
#[derive(Args, Debug, Default)]
pub struct RunOptions {
    /// Pose source in place of the configuration's: file:take.jsonl, udp://[ADDRESS:]PORT (this machine
    /// only without an address), - (standard input). A live one plays until Ctrl-C, --duration or its end
    #[arg(long, value_name = "SOURCE")]
    input: Option<String>,
    /// Size of the gestures' reference by the performer's (1.4: a child), or rest: measured over
    /// the first still second
    #[arg(long, value_name = "NUMBER|rest")]
    scale: Option<PerformerScale>,
    /// Bus in place of the configuration's: sim, dynamixel:PATH@BAUD; with NAME of the bus so called
    /// (repeatable), without it of all
    #[arg(long, value_name = "[NAME=]BUS")]
    bus: Vec<String>,
    /// Control cycles per second
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Bring the run to its end after this many seconds
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    duration: Option<f64>,
    /// real: by the clock; max: time comes from the input, as fast as it computes
    #[arg(long, value_enum, default_value_t = Speed::Real)]
    speed: Speed,
    /// No view; a summary at the end
    #[arg(long)]
    headless: bool,
    /// Write one row of joint targets per control cycle
    #[arg(long, value_name = "FILE.csv")]
    targets: Option<PathBuf>,
    /// Inject a fault into the simulated bus: ID:NAME[=VALUE]@T1s[..T2s] or bus:NAME...
    /// (`handwave sim dynamixel --list-faults`)
    #[arg(long, value_name = "SPEC")]
    fault: Vec<String>,
    /// Where chance begins, for faults
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Load changed gesture files while the run goes on (with live sources it does so by itself)
    #[arg(long)]
    watch: bool,
    /// Print the summary as one JSON object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    keep: KeepOptions,
}

/// Where time comes from.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Speed {
    /// The clock.
    #[default]
    Real,
    /// The input.
    Max,
}

/// Runs `handwave run`.
pub fn run(args: &RunArgs) -> Result<ExitStatus, Failure> {
    let RunArgs { config, options } = args;
    let mut character = match config {
        None => config::load(Files::Embedded.keeping(), BUILT_IN),
        Some(path) => {
            let (files, name) = Files::of(path);
            config::load(files.keeping(), &name)
        }
    }
    .map_err(Failure::input)?;
    if let (Some(avatar), true) = (
        &character.body.avatar,
        !options.bus.is_empty() || !options.fault.is_empty(),
    ) {
        return Err(Failure::input(format!(
            "--bus and --fault are for servos; {} is an avatar of {} joints and has none: leave them out",
            character.name,
            avatar.skeleton.len()
        )));
    }
    for bus in &options.bus {
        bus.parse()
            .and_then(|choice| character.bus.choose(&choice))
            .map_err(|e| Failure::input(format!("--bus {bus}: {e}")))?;
    }
    if let Some(scale) = options.scale {
        character.front_options.scale = scale;
    }
    let rate_hz = options.rate.unwrap_or(character.rate_hz);
    if !(10.0..=2000.0).contains(&rate_hz) {
        return Err(Failure::input(format!(
            "--rate {rate_hz} is not in 10..2000 Hz"
        )));
    }
    character
        .check_watchdog(rate_hz)
        .map_err(|problem| Failure::input(format!("--rate {rate_hz}: {problem}")))?;
    if let Some(d) = options.duration
        && !(d > 0.0)
    {
        return Err(Failure::input(format!("--duration {d} must be above 0 s")));
    }
    let faults = faults(options, &character)?;
    if options.speed == Speed::Max && character.bus != BusAddress::Sim {
        return Err(Failure::input(
            "--speed max would drive the servos on a real bus faster than real time; it works with --bus sim only",
        ));
    }
    if let Some(input) = &options.input {
        character.source.clone_from(input);
    }
    let live = source::is_live(&character.source);
    if live && options.speed == Speed::Max {
        return Err(Failure::input(format!(
            "--speed max takes time from a recording; {} is live and has none to give: leave --speed out, or record it first",
            character.source
        )));
    }
    let stop = StopSwitch::new();
    stop.on_signals()
        .map_err(|e| Failure::input(format!("cannot listen for signals: {e}")))?;
    let folder = match &options.input {
        Some(_) => source::working_folder(),
        None => character.files.clone(),
    };
    let source = source::open_any(&character.source, &folder, &stop)?;
    if let Some(assumption) = source.reader.assumption() {
        warn(format_args!("{assumption}"));
    }
    let targets = options
        .targets
        .as_ref()
        .map(|path| {
            TargetsFile::create(path, &character)
                .map_err(|e| Failure::input(format!("--targets {}: {e}", path.display())))
        })
        .transpose()?;
    if let Some(problem) = wire::too_slow(&character, &character.bus, rate_hz) {
        warn(format_args!("warning: {problem}"));
    }
    let mut onlooker = Onlooker {
        targets,
        display: Display::Quiet,
        newest: CycleRecord::default(),
        footing: character.body.feet.clone().map(Footing::new),
        later: Vec::new(),
        keeping: Keeping::plan(&options.keep, &character, options.speed == Speed::Max),
    };
    let report = match options.speed {
        Speed::Max => {
            let clock = VirtualClock::new();
            let shared: Arc<dyn Clock> = Arc::new(clock.clone());
            let session = session(
                options,
                &character,
                rate_hz,
                source,
                faults,
                shared,
                stop,
                &mut onlooker.keeping,
            )?;
            session::run_virtual(session, &clock, &mut onlooker)
        }
        Speed::Real => {
            let clock: Arc<dyn Clock> = Arc::new(RealClock::new());
            if !options.headless {
                onlooker.display = Display::open(&character, &stop);
                if !onlooker.display.shares_the_terminal() {
                    // Somebody looks on and has a key to re-arm with.
                    character.safety.on_bus_lost.get_or_insert(OnBusLost::Wait);
                }
            }
            let session = session(
                options,
                &character,
                rate_hz,
                source,
                faults,
                Arc::clone(&clock),
                stop,
                &mut onlooker.keeping,
            )?;
            let ran = session::run_real(session, clock, &mut onlooker, character.view_hz);
            onlooker.display = Display::Quiet;
            ran.map_err(Failure::input)?
        }
    };
    for line in &onlooker.later {
        warn(format_args!("{line}"));
    }
    let written = onlooker.targets.map_or(Ok(()), TargetsFile::finish);
    let slides = onlooker.footing.map(|f| f.slides());
    let kept = onlooker.keeping.finish(bad_end(&report.ending));
    conclude(options, report, slides, written, &kept, &character)
}

/// Why a run ended that ended badly.
fn bad_end(ending: &Ending) -> Option<String> {
    match ending {
        Ending::Complete | Ending::Interrupted => None,
        Ending::SafetyStop(why) => Some(format!("safety stop: {why}")),
        Ending::Bus(error) => Some(format!("bus failure: {error}")),
    }
}

fn faults(options: &RunOptions, character: &Character) -> Result<Vec<FaultSpec>, Failure> {
    if !options.fault.is_empty() && character.bus != BusAddress::Sim {
        return Err(Failure::input(
            "--fault works on the simulated bus inside this process only; give it to `handwave sim dynamixel` instead",
        ));
    }
    let ids: Vec<u8> = character.servos.iter().map(|s| s.id).collect();
    options
        .fault
        .iter()
        .map(|text| {
            let fault: FaultSpec = text
                .parse()
                .map_err(|e| Failure::input(format!("--fault: {e}")))?;
            match fault.servo() {
                Some(id) if !ids.contains(&id) => Err(Failure::input(format!(
                    "--fault {text}: there is no servo {id}; servos: {ids:?}"
                ))),
                _ => Ok(fault),
            }
        })
        .collect()
}

/// The gesture files to watch, if any: by --watch, by the configuration, or because the source is live.
fn reload(
    options: &RunOptions,
    character: &Character,
    live: bool,
) -> Result<Option<GestureFiles>, Failure> {
    let files = character.gesture_files();
    if options.watch && !files.can_change() {
        return Err(Failure::input(
            "--watch: these gestures cannot change while they are played: those of the built-in quadruped are part of the program (copy configs/quadruped.toml and its parts, and run that), and a character with a pose map keeps its own",
        ));
    }
    if options.watch && options.speed == Speed::Max {
        return Err(Failure::input(
            "--watch works by the clock; --speed max has none: leave one of them out",
        ));
    }
    let wanted = options.watch || character.reload.unwrap_or(live);
    Ok((wanted && files.can_change()).then_some(files))
}

/// Opens the bus and puts the session together.
#[expect(clippy::too_many_arguments, reason = "each is a part of a session")]
fn session(
    options: &RunOptions,
    character: &Character,
    rate_hz: f64,
    mut source: Source,
    faults: Vec<FaultSpec>,
    clock: Arc<dyn Clock>,
    stop: StopSwitch,
    keeping: &mut Keeping,
) -> Result<Session<Box<dyn BufRead + Send>>, Failure> {
    let reload = reload(options, character, source.live.is_some())?;
    let first = source.first_sample()?;
    let puppet =
        session::puppet(character, source.reader.header(), rate_hz).map_err(Failure::input)?;
    let now_ns = clock.now().nanos();
    let wire = wire::open(
        character,
        &character.bus,
        clock,
        rate_hz,
        &mut |name, port| keeping.wrap(name, port),
    )
    .map_err(|e| match e {
        WireError::Port(_) => Failure::bus(e),
        other => Failure::input(other),
    })?;
    let bus = keeping.wrap_bus(character, wire.bus)?;
    let how = HowRun {
        rate_hz,
        duration_s: options.duration,
        faults: &options.fault,
        is_virtual: options.speed == Speed::Max,
        now_ns,
    };
    keeping.begin(character, source.reader.header(), &how)?;
    let line = wire.line;
    if let Some(line) = &line {
        for line in line.each() {
            line.lock().set_seed(options.seed);
        }
    }
    Ok(Session {
        puppet,
        bus,
        reader: source.reader,
        first,
        live: source.live,
        reload,
        stop,
        options: session::control_options(character, rate_hz, options.duration),
        taps: keeping.taps(),
        on_start: Box::new(move |start| {
            if let Some(line) = &line {
                wire::inject(line, &faults, start);
            }
        }),
    })
}

/// What was injected, one line a fault: read beside what was noticed of it.
fn injected(options: &RunOptions, character: &Character) -> String {
    let faults = options.fault.iter().filter_map(|text| text.parse().ok());
    faults
        .map(|fault: FaultSpec| {
            let joint = character
                .servos
                .iter()
                .find(|s| Some(s.id) == fault.servo());
            let who = joint.map_or("whole bus".to_owned(), |s| {
                format!("servo {} (joint {})", s.id, s.joint)
            });
            format!("injected      {who} {fault}\n")
        })
        .collect()
}

/// Prints the summary and turns the ending into an exit code.
fn conclude(
    options: &RunOptions,
    report: Report,
    slides: Option<Slides>,
    written: Result<(), String>,
    kept: &Kept,
    character: &Character,
) -> Result<ExitStatus, Failure> {
    let injected = injected(options, character);
    if options.json {
        let mut summary = summary::to_json(&report, slides, character);
        summary["recording"] = keeping::to_json(kept);
        summary["injected"] = options.fault.clone().into();
        say(format_args!("{summary}"));
    } else {
        let text = summary::to_text(&report, slides, character) + &injected + &keeping::lines(kept);
        say(format_args!("{}", text.trim_end()));
    }
    let end = |status, message: String| Failure { status, message };
    // The gravest first: what became of the robot outranks what was wrong with a file.
    let interrupted = matches!(report.ending, Ending::Interrupted);
    match report.ending {
        Ending::Bus(error) => return Err(Failure::bus(error)),
        Ending::SafetyStop(reason) => {
            return Err(end(
                ExitStatus::SafetyStop,
                format!("safety stop: {reason}"),
            ));
        }
        Ending::Complete | Ending::Interrupted => {}
    }
    match &report.torque {
        Some(Ok(torque)) if !torque.unconfirmed.is_empty() => {
            let joints: Vec<&str> = torque.unconfirmed.iter().map(|(j, _)| j.as_str()).collect();
            return Err(Failure::bus(format!(
                "torque is not confirmed off: {}. Take the power off before you touch the robot",
                joints.join(", ")
            )));
        }
        Some(Err(error)) => {
            return Err(Failure::bus(format!(
                "torque could not be read back: {error}. Take the power off before you touch the robot"
            )));
        }
        Some(Ok(_)) | None => {}
    }
    if let Some(error) = report.pose_error {
        return Err(Failure::input(error));
    }
    written.map_err(Failure::input)?;
    if let Some(problem) = kept.problems.first() {
        return Err(Failure::input(problem));
    }
    Ok(if interrupted {
        ExitStatus::Interrupted
    } else {
        ExitStatus::Done
    })
}

/// Writes targets and feeds the view.
struct Onlooker {
    targets: Option<TargetsFile>,
    display: Display,
    newest: CycleRecord,
    footing: Option<Footing>,
    /// What could not be said while the view had the terminal.
    later: Vec<String>,
    /// What is kept of the run.
    keeping: Keeping,
}

impl Observer for Onlooker {
    fn cycle(&mut self, record: &CycleRecord) {
        if let Some(targets) = &mut self.targets {
            targets.row(record);
        }
        if let Some(footing) = &mut self.footing {
            footing.see(record);
        }
        self.keeping.see(record);
        self.newest.clone_from(record);
        self.display.count(record);
    }

    fn tick(&mut self) {
        self.display.draw(&self.newest);
    }

    fn news(&mut self, news: &News) {
        if let News::Gestures(names) = news {
            self.display.rename_gestures(names);
            self.keeping.rename_gestures(names);
        }
        if self.display.shares_the_terminal() {
            warn(format_args!("{news}"));
        } else {
            self.later.push(news.to_string());
        }
    }
}
