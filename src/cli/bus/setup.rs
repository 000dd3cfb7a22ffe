//! `handwave bus setup`: new servos out of the box become those of a chain, one at a time; and back again.

use super::ask::{Ask, interrupted, prompt};
use super::{crew, model_name, open, say};
use crate::bus::BusAddress;
use crate::bus::address::parse_baud;
use crate::bus::dynamixel::setup::work::locate;
use crate::bus::dynamixel::setup::{
    Change, Found, Halt, Place, SetupError, Sweep, UndoEntry, UndoFile, Wanted, commission, plan,
    restore, sweep,
};
use crate::bus::dynamixel::{Client, Model, ServoSpec};
use crate::cli::{ExitStatus, Failure};
use clap::Args;
use handwave_dynamixel::baud::RATES;
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};

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

fn parse_limits(text: &str) -> Result<(i32, i32), String> {
    let parsed = text
        .split_once('-')
        .and_then(|(min, max)| Some((min.trim().parse().ok()?, max.trim().parse().ok()?)));
    parsed
        .filter(|(min, max)| min < max)
        .ok_or_else(|| format!("'{text}' is no range of pulses such as 1024-3072"))
}

fn parse_rates(text: &str, target: u32) -> Result<Vec<u32>, Failure> {
    let mut rates = match text {
        // Where it is most likely first.
        "all" => [&[target, 57_600][..], &RATES].concat(),
        list => list
            .split(',')
            .map(|rate| parse_baud(rate.trim()))
            .collect::<Result<_, _>>()?,
    };
    let mut seen = Vec::new();
    rates.retain(|rate| {
        !seen.contains(rate) && {
            seen.push(*rate);
            true
        }
    });
    Ok(rates)
}

/// One servo's place in the plan: what it is to become, and for what.
struct Post {
    /// `joint1 (servo 11)` or `servo 3`.
    name: String,
    model: Option<&'static Model>,
    wanted: Wanted,
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
                    "\nall set up. Plug all of them in, then\n  handwave bus scan {bus}\n  \
                     handwave bus calibrate --config {config} {bus}"
                ),
            )?;
        }
    }
    Ok(ExitStatus::Done)
}

/// What the servos are to become.
fn posts(args: &SetupArgs, baud: u32) -> Result<Vec<Post>, Failure> {
    if args.undo.is_some() {
        return Ok(Vec::new());
    }
    let Some(config) = &args.config else {
        let id = args.id.unwrap_or(1);
        return Ok(vec![Post {
            name: format!("servo {id}"),
            model: None,
            wanted: Wanted {
                id,
                baud,
                limits: args.limits,
                zero_here: args.zero_here,
            },
        }]);
    };
    let character = crew::character(config)?;
    let known = |name: &String| character.servos.iter().any(|s| s.joint == *name);
    if let Some(unknown) = args.joint.iter().find(|name| !known(name)) {
        return Err(Failure::input(format_args!(
            "--joint {unknown}: {} has no such joint. Joints: {}",
            config.display(),
            character.joints.join(", ")
        )));
    }
    let post = |spec: &ServoSpec| Post {
        name: format!("{} (servo {})", spec.joint, spec.id),
        model: Some(spec.model),
        wanted: Wanted {
            id: spec.id,
            baud,
            limits: Some((spec.min_pulse, spec.max_pulse)),
            zero_here: args.zero_here,
        },
    };
    Ok(character.servos.iter().map(post).collect())
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
                "{} servos to set up for {} baud. One at a time: a new servo answers to the same id as every other new one.\n\
                 What stood in them before goes into {}.",
                todo.len(),
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
            let complete = match here {
                Some(found) => self.changes(found, post)?.is_empty(),
                None => false,
            };
            let head = format!("\n{} of {}: {}", number + 1, todo.len(), post.name);
            if complete {
                say(out, format_args!("{head} is set up already"))?;
                continue;
            }
            say(out, head)?;
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
        let found = match self.choose(&swept, post) {
            Ok(found) => found,
            Err(problem) => return Ok(Outcome::Again(problem)),
        };
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
        let changes = self.changes(&found, post)?;
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

    /// Which servo is the new one; else what to do about it.
    fn choose(&self, swept: &Sweep, post: &Post) -> Result<Found, String> {
        let wanted = post.wanted;
        let list = |found: &[Found]| {
            let names: Vec<String> = found
                .iter()
                .map(|f| {
                    format!(
                        "{} {} at {} baud",
                        model_name(f.ping.model),
                        f.ping.id,
                        f.baud
                    )
                })
                .collect();
            names.join(", ")
        };
        if swept.collisions() {
            let mut at: Vec<String> = swept
                .noise
                .iter()
                .map(|baud| format!("at {baud} baud"))
                .collect();
            at.extend(
                swept
                    .found
                    .iter()
                    .filter(|f| f.garbled)
                    .map(|f| format!("id {} at {} baud", f.ping.id, f.baud)),
            );
            return Err(format!(
                "several servos answer at once ({}) and damage each other's words: they have the same id. Unplug all of them but one",
                at.join(", ")
            ));
        }
        let there = |f: &&Found| f.ping.id == wanted.id && f.baud == wanted.baud;
        let known = |f: &Found| {
            f.baud == wanted.baud && (self.args.config.is_none() || self.crew.contains(&f.ping.id))
        };
        let strangers: Vec<Found> = swept.found.iter().filter(|f| !known(f)).copied().collect();
        match (swept.found.as_slice(), strangers.as_slice()) {
            ([], _) => Err(format!(
                "no servo answers. Check its power (the LED blinks once at power-up) and its cable{}",
                if self.rates.len() < RATES.len() {
                    "; --at all looks at every baud rate"
                } else {
                    ""
                }
            )),
            // The only one there is meant, unless it is another's of this chain.
            ([only], _) if there(&only) || self.args.config.is_none() || !known(only) => Ok(*only),
            (_, [new]) => match swept.found.iter().find(there) {
                Some(_) => Err(format!(
                    "id {} at {} baud is taken already, and {} is new here. Unplug the one that has the id to replace it, or give the new one another",
                    wanted.id,
                    wanted.baud,
                    list(&[*new])
                )),
                None => Ok(*new),
            },
            (_, []) => match swept.found.iter().find(there) {
                Some(found) if self.args.config.is_some() => Ok(*found),
                _ => Err(format!(
                    "no new servo is among those that answer: {}. Plug the new one in, or unplug all but the one that is meant",
                    list(&swept.found)
                )),
            },
            (_, several) => Err(format!(
                "{} servos answer that are not set up: {}. Unplug all of them but one",
                several.len(),
                list(several)
            )),
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

    fn changes(&mut self, found: &Found, post: &Post) -> Result<Vec<Change>, Failure> {
        let model = Model::by_number(found.ping.model).ok_or_else(|| {
            Failure::input(SetupError::UnknownModel {
                id: found.ping.id,
                number: found.ping.model,
            })
        })?;
        self.client.set_baud(found.baud)?;
        let place = Place {
            id: found.ping.id,
            baud: found.baud,
        };
        plan(&mut *self.client, place, model, &post.wanted).map_err(failure)
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
            SetupError::Client(crate::bus::dynamixel::ClientError::Port(_))
            | SetupError::File { .. } => Err(Failure::bus(text)),
            _ => Ok(Outcome::Again(text)),
        }
    }

    /// Puts back what the undo file says.
    fn undo(&mut self, file: &UndoFile, out: &mut dyn Write) -> Result<(), Failure> {
        let mut groups = file.groups().map_err(Failure::input)?;
        if let Some(id) = self.args.id {
            groups.retain(|group| group.place().id == id);
        }
        let ids: Vec<String> = groups.iter().map(|g| g.place().id.to_string()).collect();
        let group = match groups.as_slice() {
            [group] => group,
            [] => {
                return Err(Failure::input(
                    "there is nothing in this file that could be undone",
                ));
            }
            _ => {
                return Err(Failure::input(format_args!(
                    "this file has changes of several servos, now {}. One at a time: --id N, and only that servo plugged in",
                    ids.join(", ")
                )));
            }
        };
        let id = group.place().id;
        let found = locate(&mut *self.client, group)?;
        let Some(place) = found else {
            return Err(Failure::bus(format_args!(
                "servo {id} ({}) does not answer at {}, nor where it was before. Plug it in",
                group.model,
                group.place()
            )));
        };
        let model = Model::by_name(&group.model)
            .ok_or_else(|| Failure::input(format_args!("unknown model {}", group.model)))?;
        say(out, format_args!("  {} is {place}; back to:", group.model))?;
        for entry in group.entries.iter().rev() {
            say(
                out,
                format_args!("    {:<22} {:>7}", entry.register, entry.old),
            )?;
        }
        if !self.ask.confirm(out, "  Write these?", true)? {
            return Err(Failure::input("nothing was written"));
        }
        match restore(&mut *self.client, place, model, group) {
            Ok((count, place)) => {
                file.note_undone(id).map_err(Failure::bus)?;
                say(
                    out,
                    format_args!("  {count} registers put back and read: the servo is {place}"),
                )
            }
            Err(halt) => Err(Failure::bus(format_args!(
                "{}. The servo is {}; {} registers are put back. The same command goes on from there",
                halt.reason, halt.place, halt.done
            ))),
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
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    utc(now.map_or(0, |since| since.as_secs()))
}

/// Days to a date as in Howard Hinnant's `civil_from_days`.
fn utc(seconds: u64) -> String {
    let (days, second) = (seconds / 86_400, seconds % 86_400);
    let z = days + 719_468;
    let era = z / 146_097;
    let day_of_era = z % 146_097;
    let year = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = year + era * 400 + u64::from(month <= 2);
    let (h, m, s) = (second / 3600, second / 60 % 60, second % 60);
    format!("{year:04}-{month:02}-{day:02}T{h:02}:{m:02}:{s:02}Z")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_dates() {
        assert_eq!(utc(0), "1970-01-01T00:00:00Z");
        assert_eq!(utc(951_827_696), "2000-02-29T12:34:56Z");
        assert_eq!(utc(1_764_059_301), "2025-11-25T08:28:21Z");
    }

    #[test]
    fn rates_to_look_at_come_once_and_likely_ones_first() {
        let all = parse_rates("all", 1_000_000).expect("a good list");
        assert_eq!((all[0], all[1], all.len()), (1_000_000, 57_600, 8));
        assert_eq!(
            parse_rates("57600, 115200", 1).expect("a good list"),
            [57_600, 115_200]
        );
        assert!(parse_rates("fast", 1).is_err());
    }

    #[test]
    fn limits_as_users_write_them() {
        assert_eq!(parse_limits("1024-3072"), Ok((1024, 3072)));
        for wrong in ["", "1024", "3072-1024", "a-b"] {
            assert!(parse_limits(wrong).is_err(), "'{wrong}' was taken");
        }
    }
}
