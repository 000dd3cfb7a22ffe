//! `handwave bus setup`: new servos out of the box become those of a chain, one at a time; and back again.

mod back;
mod posts;

use super::ask::{Ask, interrupted, prompt};
use super::{model_name, open, say};
use crate::bus::BusAddress;
use crate::bus::address::parse_baud;
use crate::bus::dynamixel::setup::{
    Change, ChooseError, Found, Halt, Place, SetupError, Sweep, UndoEntry, UndoFile, choose,
    commission, plan, sweep, undo,
};
use crate::bus::dynamixel::{Client, ClientError, Model};
use crate::cli::{ExitStatus, Failure};
use crate::live::clock::unix_now;
use clap::Args;
use handwave_dynamixel::baud::RATES;
use posts::{Post, parse_limits, parse_rates, posts};
use std::io::{IsTerminal, Write};
use std::path::PathBuf;

/// Give new servos their id, baud rate and settings, one at a time; undo it.
///
/// Guided by a configuration (which joint has which id, and the range of each), or for one servo by --id.
/// Looks at every baud rate for the one servo that is new, shows what changes, asks once, writes, and reads
/// everything back at the new id and rate. What stood there before goes into an undo file first.
#[derive(Args, Debug)]
#[command(after_help = "\
Every servo gets: position mode, no return delay, an answer to everything, torque off at power-up, no second id,
no reversal and no offset of its own (direction and zero are the configuration's, see `handwave bus calibrate`).

Examples:
  handwave bus setup --config my_arm.toml dynamixel:/dev/ttyUSB0
  handwave bus setup --config my_arm.toml --joint joint3 dynamixel:/dev/ttyUSB0      a servo was replaced
  handwave bus setup --id 3 --baud 1000000 dynamixel:/dev/ttyUSB0
  handwave bus setup --id 3 --limits 1024-3072 --zero-here --yes dynamixel:/dev/ttyUSB0
  handwave bus setup --undo servo_undo.jsonl --id 3 dynamixel:/dev/ttyUSB0")]
pub struct SetupArgs {
    /// The bus; its baud rate (1000000 if none is given) is what the servos are set to.
    #[arg(value_name = "BUS")]
    bus: BusAddress,
    /// The character whose servos these are; its joints are gone through one by one.
    #[arg(long, value_name = "FILE", conflicts_with = "id")]
    config: Option<PathBuf>,
    /// Only this joint of the configuration (repeatable).
    #[arg(long, value_name = "NAME", requires = "config")]
    joint: Vec<String>,
    /// Id to give to the one servo that is plugged in; with --undo, whose changes to undo.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=252))]
    id: Option<u8>,
    /// Baud rate to give, instead of that of BUS.
    #[arg(long, value_name = "N")]
    baud: Option<String>,
    /// Baud rates at which to look for the new servo: `all`, or a list such as 57600,1000000.
    #[arg(long, value_name = "all|N,N", default_value = "all")]
    at: String,
    /// Least and greatest position the servo may be sent to, pulses (with --id).
    #[arg(long, value_name = "MIN-MAX", requires = "id", value_parser = parse_limits)]
    limits: Option<(i32, i32)>,
    /// Make the place where the shaft stands now the middle of the turn, by the homing offset.
    #[arg(long)]
    zero_here: bool,
    /// Where to note what stood in the registers before.
    #[arg(long, value_name = "FILE", default_value = "servo_undo.jsonl")]
    undo_file: PathBuf,
    /// Put back what this undo file says was changed.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["config", "limits", "zero_here"])]
    undo: Option<PathBuf>,
    /// Ask nothing.
    #[arg(long)]
    yes: bool,
}

/// The tools of the work.
struct Bench<'a> {
    client: Box<dyn Client>,
    args: &'a SetupArgs,
    ask: Ask,
    rates: Vec<u32>,
    baud: u32,
    /// Ids that belong to the chain.
    crew: Vec<u8>,
}

/// What became of a post.
enum Outcome {
    Done,
    /// Say why and ask again.
    Again(String),
}

pub fn setup(args: &SetupArgs, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let own = match &args.bus {
        BusAddress::Dynamixel { baud, .. } => *baud,
        BusAddress::Sim => RATES[3],
    };
    let baud = args.baud.as_deref().map_or(Ok(own), parse_baud)?;
    let rates = parse_rates(&args.at, baud)?;
    if args.undo.is_none() && args.config.is_none() && args.id.is_none() {
        return Err(Failure::input(
            "what shall the servo become? Give --config FILE (joints and ids of a character) or --id N",
        ));
    }
    let posts = posts(args, baud)?;
    let client = open(&args.bus)?;
    let ask = Ask::new(args.yes)?;
    let mut bench = Bench {
        client,
        args,
        ask,
        rates,
        baud,
        crew: posts.iter().map(|post| post.wanted.id).collect(),
    };
    match (&args.undo, &args.config) {
        (Some(file), _) => bench.undo(&UndoFile::new(file), out)?,
        (None, None) => {
            for post in &posts {
                if let Outcome::Again(problem) = bench.one(post, out)? {
                    return Err(Failure::bus(problem));
                }
            }
        }
        (None, Some(config)) => {
            bench.guided(&posts, out)?;
            let (config, bus) = (config.display(), &args.bus);
            say(
                out,
                format_args!(
                    "\ndone. With all of them plugged in, what comes next:\n  \
                     handwave bus scan {bus}\n  \
                     handwave bus calibrate --config {config} {bus}    (zero, direction, range by hand)\n  \
                     handwave run {config} --bus {bus} --duration 10"
                ),
            )?;
        }
    }
    Ok(ExitStatus::Done)
}

impl Bench<'_> {
    /// Goes through the joints of a configuration.
    fn guided(&mut self, posts: &[Post], out: &mut dyn Write) -> Result<(), Failure> {
        let wanted = |post: &Post| {
            let joint = post.name.split(' ').next().unwrap_or_default();
            self.args.joint.is_empty() || self.args.joint.iter().any(|name| name == joint)
        };
        let todo: Vec<&Post> = posts.iter().filter(|post| wanted(post)).collect();
        if self.ask.is_silent() && todo.len() > 1 {
            return Err(Failure::input(
                "--yes takes one servo at a time: name its joint with --joint NAME",
            ));
        }
        say(
            out,
            format_args!(
                "{} for {} baud. One at a time: a new servo answers to the same id as every other new one.\n\
                 What stood in them before goes into {}.",
                match todo.len() {
                    1 => "1 servo to set up".to_owned(),
                    n => format!("{n} servos to set up"),
                },
                self.baud,
                self.args.undo_file.display()
            ),
        )?;
        let there = self.look(&[self.baud])?;
        for (number, post) in todo.iter().enumerate() {
            let place = Place {
                id: post.wanted.id,
                baud: self.baud,
            };
            let here = there
                .found
                .iter()
                .find(|f| f.ping.id == place.id && !f.garbled);
            let head = format!("\n{} of {}: {}", number + 1, todo.len(), post.name);
            if let Some(found) = here {
                if self.changes(found, post).map_err(failure)?.is_empty() {
                    say(out, format_args!("{head} is set up already"))?;
                    continue;
                }
                // It is this joint's already, only not as it should be.
                say(out, format_args!("{head} is there and differs"))?;
                match self.make(post, found, out)? {
                    Outcome::Done => continue,
                    Outcome::Again(problem) if self.ask.is_silent() => {
                        return Err(Failure::bus(problem));
                    }
                    Outcome::Again(problem) => say(out, format_args!("  {problem}"))?,
                }
            } else {
                say(out, head)?;
            }
            loop {
                if !self.ask.is_silent() {
                    let what = post.model.map_or("servo", |model| model.name);
                    prompt(
                        out,
                        format_args!(
                            "  Plug in one {what} for it, alone or beside those that are set up, and press Enter (s skips, q ends): "
                        ),
                    );
                    match self.ask.line(&mut || Ok(()))?.as_str() {
                        "s" => break,
                        "q" => {
                            return Err(interrupted(
                                "ended; what was set up stays so. The same command goes on from here",
                            ));
                        }
                        _ => {}
                    }
                }
                match self.one(post, out)? {
                    Outcome::Done => break,
                    Outcome::Again(problem) if self.ask.is_silent() => {
                        return Err(Failure::bus(problem));
                    }
                    Outcome::Again(problem) => say(out, format_args!("  {problem}"))?,
                }
            }
        }
        Ok(())
    }

    /// Finds the one new servo and makes it what `post` says.
    fn one(&mut self, post: &Post, out: &mut dyn Write) -> Result<Outcome, Failure> {
        let rates = self.rates.clone();
        let swept = self.look(&rates)?;
        let crew = self.args.config.as_ref().map(|_| self.crew.as_slice());
        match choose(&swept, &post.wanted, crew) {
            Ok(found) => self.make(post, &found, out),
            Err(ChooseError::Nobody) if self.rates.len() < RATES.len() => Ok(Outcome::Again(
                format!("{}; --at all looks at every baud rate", ChooseError::Nobody),
            )),
            Err(problem) => Ok(Outcome::Again(problem.to_string())),
        }
    }

    /// Makes the servo that was found what `post` says.
    fn make(
        &mut self,
        post: &Post,
        found: &Found,
        out: &mut dyn Write,
    ) -> Result<Outcome, Failure> {
        let name = model_name(found.ping.model);
        say(
            out,
            format_args!(
                "  found: {name}, firmware {}, id {} at {} baud",
                found.ping.firmware, found.ping.id, found.baud
            ),
        )?;
        if let Some(model) = post.model
            && model.number != found.ping.model
        {
            return Ok(Outcome::Again(format!(
                "this is {name} (model number {}), the configuration says {}: take the right servo, or correct the configuration",
                found.ping.model, model.name
            )));
        }
        if found.ping.alert {
            return Ok(Outcome::Again(format!(
                "it has a hardware error latched. `handwave bus monitor {} --once` names it; remove the cause and unplug it for a moment",
                self.args.bus
            )));
        }
        let changes = match self.changes(found, post) {
            Ok(changes) => changes,
            Err(SetupError::Client(ClientError::Timeout { .. })) => {
                return Ok(Outcome::Again(
                    "it has fallen silent meanwhile. Check its cable".into(),
                ));
            }
            Err(error) => return Err(failure(error)),
        };
        if changes.is_empty() {
            say(out, format_args!("  {} is as it should be", post.name))?;
            return Ok(Outcome::Done);
        }
        say(out, "    register                   now      new  unit")?;
        for Change { register, old, new } in &changes {
            let line = format!(
                "    {:<22} {old:>7}  {new:>7}  {}",
                register.name,
                unit(register.name, *new, register.unit)
            );
            say(out, line.trim_end())?;
        }
        if !self.ask.confirm(out, "  Write these?", true)? {
            return Ok(Outcome::Again("nothing was written".into()));
        }
        let place = Place {
            id: found.ping.id,
            baud: found.baud,
        };
        match self.write(place, name, &changes) {
            Ok(place) => {
                say(
                    out,
                    format_args!(
                        "  written and read back: {} is {place}, torque off",
                        post.name
                    ),
                )?;
                Ok(Outcome::Done)
            }
            Err(halt) => self.halted(&halt, &changes),
        }
    }

    fn look(&mut self, rates: &[u32]) -> Result<Sweep, Failure> {
        let ask = &self.ask;
        let swept = sweep(&mut *self.client, rates, None, &mut |baud| {
            progress(Some(format_args!("looking at {baud} baud")));
            !ask.is_stopped()
        });
        progress(None);
        let swept = swept.map_err(Failure::from)?;
        if self.ask.is_stopped() {
            return Err(interrupted(
                "interrupted; nothing was written to this servo",
            ));
        }
        Ok(swept)
    }

    fn changes(&mut self, found: &Found, post: &Post) -> Result<Vec<Change>, SetupError> {
        let place = Place {
            id: found.ping.id,
            baud: found.baud,
        };
        let model = Model::by_number(found.ping.model).ok_or(SetupError::UnknownModel {
            id: place.id,
            number: found.ping.model,
        })?;
        self.client.set_baud(place.baud)?;
        plan(&mut *self.client, place, model, &post.wanted)
    }

    fn write(&mut self, place: Place, model: &str, changes: &[Change]) -> Result<Place, Halt> {
        let undo = UndoFile::new(&self.args.undo_file);
        let (ask, bus) = (&self.ask, self.args.bus.to_string());
        let mut note = |at: Place, change: &Change| {
            if ask.is_stopped() {
                return Err(SetupError::Stopped);
            }
            undo.note(UndoEntry {
                time: utc_now(),
                bus: bus.clone(),
                id: at.id,
                baud: at.baud,
                model: model.into(),
                register: change.register.name.into(),
                address: change.register.address,
                old: change.old,
                new: change.new,
            })
        };
        commission(&mut *self.client, place, changes, &mut note)
    }

    /// Says in which state a servo was left, and what to do.
    fn halted(&self, halt: &Halt, changes: &[Change]) -> Result<Outcome, Failure> {
        let name = |c: &Change| c.register.name;
        let done: Vec<&str> = changes[..halt.done].iter().map(name).collect();
        let left: Vec<&str> = changes[halt.done..].iter().map(name).collect();
        let done = if done.is_empty() {
            "nothing".into()
        } else {
            done.join(", ")
        };
        let text = format!(
            "{}.\n  The servo is now {}; written: {done}; not yet: {}.\n  \
             Plug in this servo and do the same again: it goes on from there. Or back: handwave bus setup --undo {} {}",
            halt.reason,
            halt.place,
            left.join(", "),
            self.args.undo_file.display(),
            self.args.bus
        );
        match &halt.reason {
            SetupError::Stopped => Err(interrupted(text)),
            SetupError::Client(ClientError::Port(_)) | SetupError::File { .. } => {
                Err(Failure::bus(text))
            }
            _ => Ok(Outcome::Again(text)),
        }
    }
}

/// What a value means where its unit does not say it.
fn unit(register: &str, value: i64, unit: &str) -> String {
    match register {
        "baud_rate" => u8::try_from(value)
            .ok()
            .and_then(handwave_dynamixel::baud::rate)
            .map_or(String::new(), |rate| format!("{rate} baud")),
        _ => unit.to_owned(),
    }
}

/// A line that comes and goes on a terminal; `None` takes it away.
pub fn progress(line: Option<std::fmt::Arguments<'_>>) {
    let mut err = std::io::stderr();
    if !err.is_terminal() {
        return;
    }
    // It is only there to be looked at.
    let _ = match line {
        Some(line) => write!(err, "\r\x1b[K  {line} ..."),
        None => write!(err, "\r\x1b[K"),
    };
    let _ = err.flush();
}

fn failure(error: SetupError) -> Failure {
    match error {
        SetupError::Client(error) => error.into(),
        other => Failure::input(other),
    }
}

/// The time now as `2026-11-25T08:15:02Z`.
fn utc_now() -> String {
    undo::utc(unix_now().as_secs())
}
