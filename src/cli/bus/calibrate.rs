//! `handwave bus calibrate`: zero, direction and range of each joint, learnt from a hand that moves it.

use super::ask::{Ask, interrupted, prompt};
use super::setup::progress;
use super::{crew, open, say};
use crate::bus::BusAddress;
use crate::bus::dynamixel::setup::calibrate::{
    Follower, LEAST_MOVE_RAD, RangeProblem, direction, range,
};
use crate::bus::dynamixel::setup::plan::value;
use crate::bus::dynamixel::{Client, ClientError, Direction, ServoSpec};
use crate::cli::{ExitStatus, Failure};
use crate::config::Character;
use crate::config::edit::with_joint_map;
use clap::Args;
use std::cell::RefCell;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Readings that may be missed in a row while a joint is moved.
const MISSES: u32 = 50;

/// Learn zero, direction and range of each joint: torque off, you move it, the configuration is written.
///
/// Joint by joint: to its zero, in its positive direction, to both ends. A direction that is not what the
/// configuration says is asked for a second time, and after writing every joint is moved once more: a wrong sign
/// puts the old configuration back.
#[derive(Args, Debug)]
#[command(after_help = "\
Zero, positive direction and limits are the URDF's. Comments in the configuration stay; the old one is kept beside it.

Examples:
  handwave bus calibrate --config my_arm.toml dynamixel:/dev/ttyUSB0
  handwave bus calibrate --config my_arm.toml --joint joint3 dynamixel:/dev/ttyUSB0")]
pub struct CalibrateArgs {
    /// The bus, such as dynamixel:/dev/ttyUSB0@1000000.
    #[arg(value_name = "BUS")]
    bus: BusAddress,
    /// The configuration to calibrate; it is written.
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Only this joint (repeatable).
    #[arg(long, value_name = "NAME")]
    joint: Vec<String>,
    /// Learn zero and direction only, keep the ranges.
    #[arg(long)]
    no_range: bool,
}

/// A person at the joints, and the servos.
struct Hands {
    client: Box<dyn Client>,
    ask: Ask,
}

pub fn calibrate(args: &CalibrateArgs, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let character = crew::character(&args.config)?;
    if let Some(unknown) = args.joint.iter().find(|j| !character.joints.contains(j)) {
        return Err(Failure::input(format_args!(
            "--joint {unknown}: {} has no such joint. Joints: {}",
            args.config.display(),
            character.joints.join(", ")
        )));
    }
    let client = open(&args.bus)?;
    let ask = Ask::new(false)?;
    let mut hands = Hands { client, ask };
    crew::all_there(&mut *hands.client, &character.servos)?;
    crew::release(&mut *hands.client, &character.servos, &mut hands.ask, out)?;

    let chosen = |spec: &&ServoSpec| args.joint.is_empty() || args.joint.contains(&spec.joint);
    let todo: Vec<&ServoSpec> = character.servos.iter().filter(chosen).collect();
    say(
        out,
        format_args!(
            "{} joints. Torque is off. Directions are the robot's: forward, left, up are its own, not yours.",
            todo.len()
        ),
    )?;
    let mut learnt = Vec::new();
    for (number, spec) in todo.iter().enumerate() {
        say(
            out,
            format_args!(
                "\n{} of {}: {} (servo {})",
                number + 1,
                todo.len(),
                spec.joint,
                spec.id
            ),
        )?;
        if let Some(spec) = hands.joint(args, &character, spec, out)? {
            learnt.push(spec);
        }
    }
    if learnt.is_empty() {
        say(out, "nothing was learnt, nothing is written")?;
        return Ok(ExitStatus::Done);
    }
    say(
        out,
        "\njoint              zero_pulse     direction   range_pulse",
    )?;
    for new in &learnt {
        let Some(old) = character.servos.iter().find(|s| s.joint == new.joint) else {
            continue;
        };
        let arrow = |a: String, b: String| if a == b { b } else { format!("{a} -> {b}") };
        let sign = |s: &ServoSpec| format!("{:+}", s.direction.sign());
        let ends = |s: &ServoSpec| format!("{}..{}", s.min_pulse, s.max_pulse);
        say(
            out,
            format_args!(
                "{:<17}  {:<13}  {:<10}  {}",
                new.joint,
                arrow(old.zero_pulse.to_string(), new.zero_pulse.to_string()),
                arrow(sign(old), sign(new)),
                arrow(ends(old), ends(new))
            ),
        )?;
    }
    write(args, &mut hands, &learnt, out)?;
    let (config, bus) = (args.config.display(), &args.bus);
    say(
        out,
        format_args!(
            "\ncalibrated. The servos themselves keep to the same ranges after\n  handwave bus setup --config {config} {bus}\n\
             and then, slowly at first:\n  handwave run {config} --bus {bus} --duration 10"
        ),
    )?;
    Ok(ExitStatus::Done)
}

/// Writes what was learnt, and has every joint moved once more; a wrong sign puts the old file back.
fn write(
    args: &CalibrateArgs,
    hands: &mut Hands,
    learnt: &[ServoSpec],
    out: &mut dyn Write,
) -> Result<(), Failure> {
    let path = args.config.as_path();
    let file_error = |what: &Path, e: &dyn std::fmt::Display| {
        Failure::input(format_args!("{}: {e}", what.display()))
    };
    let before = std::fs::read_to_string(path).map_err(|e| file_error(path, &e))?;
    let after = with_joint_map(&before, learnt).map_err(|e| file_error(path, &e))?;
    let kept = path.with_extension("toml.before");
    let question = format!(
        "Write this into {} (the old one stays as {})?",
        path.display(),
        kept.display()
    );
    if !hands.ask.confirm(out, &question, true)? {
        say(out, "not written. For your own hand, in robot.joint:")?;
        for spec in learnt {
            say(
                out,
                format_args!(
                    "  {{ name = \"{}\", servo = {}, zero_pulse = {}, direction = {}, range_pulse = [{}, {}] }},",
                    spec.joint,
                    spec.id,
                    spec.zero_pulse,
                    spec.direction.sign(),
                    spec.min_pulse,
                    spec.max_pulse
                ),
            )?;
        }
        return Err(Failure::input("nothing was written"));
    }
    std::fs::write(&kept, &before).map_err(|e| file_error(&kept, &e))?;
    std::fs::write(path, &after).map_err(|e| file_error(path, &e))?;
    let back = |failure: Failure| -> Failure {
        let told = match std::fs::write(path, &before) {
            Ok(()) => format!("{} is as it was before", path.display()),
            Err(e) => format!(
                "{} could not be put back ({e}): it is in {}",
                path.display(),
                kept.display()
            ),
        };
        Failure {
            message: format!("{}. {told}", failure.message),
            ..failure
        }
    };
    let character = crew::character(path).map_err(back)?;
    say(
        out,
        "\nWritten. Now the test: each joint once more in its positive direction.",
    )?;
    for new in learnt {
        let spec = character.servos.iter().find(|s| s.joint == new.joint);
        let Some(spec) = spec else { continue };
        hands.verify(&character, spec, out).map_err(back)?;
    }
    Ok(())
}

/// Where a joint's far end is when all joints are at zero.
fn zero_place(character: &Character, joint: &str) -> String {
    let index = character.joints.iter().position(|name| name == joint);
    let rest = vec![0.0; character.joints.len()];
    match character.model.as_ref().zip(index) {
        Some((model, index)) => match model.far_end(index, &rest) {
            place if place.is_empty() => String::new(),
            place => format!("; with all joints at 0 {place}"),
        },
        None => String::new(),
    }
}

/// What the positive direction of a joint does.
fn way(character: &Character, joint: &str) -> String {
    let index = character.joints.iter().position(|name| name == joint);
    let rest = vec![0.0; character.joints.len()];
    let model = character.model.as_ref().zip(index);
    model.map_or(String::new(), |(model, index)| {
        model.positive_way(index, &rest)
    })
}

impl Hands {
    /// Learns one joint; `None` when it is skipped.
    fn joint(
        &mut self,
        args: &CalibrateArgs,
        character: &Character,
        old: &ServoSpec,
        out: &mut dyn Write,
    ) -> Result<Option<ServoSpec>, Failure> {
        let mut spec = old.clone();
        let zero = format!(
            "  zero: where its URDF has position 0{}.\n    Move it there and press Enter (s skips this joint): ",
            zero_place(character, &old.joint)
        );
        let (answer, hand) = self.moved(out, old, &zero)?;
        if answer == "s" {
            return Ok(None);
        }
        let zero = hand.now();
        let per_turn = spec.model.pulses_per_turn;
        spec.zero_pulse = zero.rem_euclid(per_turn as i64) as i32;
        say(
            out,
            format_args!("    zero is at pulse {}", spec.zero_pulse),
        )?;
        spec.direction = self.direction(character, old, out)?;
        if args.no_range {
            return Ok(Some(spec));
        }
        let limits = character.joints.iter().position(|name| *name == old.joint);
        let limits = limits
            .and_then(|index| character.model.as_ref()?.limits().get(index).copied())
            .map(|limit| (limit.lower, limit.upper))
            .unwrap_or((-std::f64::consts::PI, std::f64::consts::PI));
        loop {
            let text = format!(
                "  range: move it to both ends of its range, {:.0} and {:.0} deg in the URDF.\n    Then press Enter (k keeps {}..{}): ",
                limits.0.to_degrees(),
                limits.1.to_degrees(),
                old.min_pulse,
                old.max_pulse
            );
            let (answer, mut hand) = self.moved(out, old, &text)?;
            if answer == "k" {
                return Ok(Some(spec));
            }
            // The turn that the zero was read in counts.
            let turn = (zero - i64::from(spec.zero_pulse)) / per_turn as i64 * per_turn as i64;
            hand.min -= turn;
            hand.max -= turn;
            match range(&spec, &hand, limits) {
                Ok([min, max]) => {
                    spec.min_pulse = min;
                    spec.max_pulse = max;
                    say(out, format_args!("    range is {min} to {max}"))?;
                    return Ok(Some(spec));
                }
                Err(problem @ RangeProblem::Short { .. }) => say(
                    out,
                    format_args!(
                        "    {problem}. Again, to both ends; where it cannot go so far, give the URDF narrower limits first"
                    ),
                )?,
                Err(problem @ RangeProblem::TurnEnds { .. }) => {
                    return Err(Failure::input(problem));
                }
            }
        }
    }

    /// Which way the servo turns, asked twice when it is not what the configuration says.
    fn direction(
        &mut self,
        character: &Character,
        old: &ServoSpec,
        out: &mut dyn Write,
    ) -> Result<Direction, Failure> {
        let way = way(character, &old.joint);
        let text = format!(
            "  direction: move it 10 degrees or more in its positive direction: {way}.\n    Then Enter: "
        );
        let first = self.sense(out, old, &text)?;
        if first == old.direction {
            say(
                out,
                format_args!("    direction {:+}, as configured", first.sign()),
            )?;
            return Ok(first);
        }
        say(
            out,
            format_args!(
                "    that is direction {:+}, the configuration says {:+}. To be sure, once more:",
                first.sign(),
                old.direction.sign()
            ),
        )?;
        self.moved(out, old, "  move it back to about zero, then Enter: ")?;
        let second = self.sense(out, old, &text)?;
        if second != first {
            return Err(Failure::input(format_args!(
                "{}: the two movements went opposite ways, so one of them was not the positive direction ({way}). \
                 Nothing was written; begin again: --joint {}",
                old.joint, old.joint
            )));
        }
        say(out, format_args!("    direction {:+}", first.sign()))?;
        Ok(first)
    }

    /// Asks for a movement until it is large enough to tell its sense.
    fn sense(
        &mut self,
        out: &mut dyn Write,
        spec: &ServoSpec,
        text: &str,
    ) -> Result<Direction, Failure> {
        loop {
            let begin = self.pulse(spec)?;
            let (_, hand) = self.moved(out, spec, text)?;
            let per_turn = spec.model.pulses_per_turn;
            if let Some(found) = direction(i64::from(begin), hand.now(), per_turn) {
                return Ok(found);
            }
            say(
                out,
                format_args!(
                    "    it has moved by {:.1} degrees only; 5 at least are needed",
                    (hand.now() - i64::from(begin)) as f64 * 360.0 / per_turn
                ),
            )?;
        }
    }

    /// A last movement, judged by the configuration as written.
    fn verify(
        &mut self,
        character: &Character,
        spec: &ServoSpec,
        out: &mut dyn Write,
    ) -> Result<(), Failure> {
        let way = way(character, &spec.joint);
        loop {
            let from = self.pulse(spec)?;
            let text = format!("  {}: {way}. Then Enter (s skips): ", spec.joint);
            let (answer, hand) = self.moved(out, spec, &text)?;
            if answer == "s" {
                return Ok(());
            }
            let turn = std::f64::consts::TAU / spec.model.pulses_per_turn;
            let moved = (hand.now() - i64::from(from)) as f64 * turn * spec.direction.sign();
            if moved <= -LEAST_MOVE_RAD {
                return Err(Failure::input(format_args!(
                    "{}: moved in its positive direction it reads {:.1} degrees less: its sign is wrong (or it was moved the other way; \
                     positive is: {way}). Begin again: --joint {}",
                    spec.joint,
                    -moved.to_degrees(),
                    spec.joint
                )));
            }
            if moved >= LEAST_MOVE_RAD {
                return say(
                    out,
                    format_args!("    reads {:+.1} degrees, right", moved.to_degrees()),
                );
            }
            say(
                out,
                format_args!("    it has moved by {:.1} degrees only", moved.to_degrees()),
            )?;
        }
    }

    fn pulse(&mut self, spec: &ServoSpec) -> Result<i32, Failure> {
        let mut tries = 0;
        loop {
            match value(&mut *self.client, spec.id, spec.model, "present_position") {
                Ok(read) => return Ok(read.map_or(0, |(_, pulse)| pulse as i32)),
                Err(ClientError::Timeout { .. }) if tries < 5 => tries += 1,
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Asks `text` and follows the joint until a line comes; the line, and where the joint went.
    fn moved(
        &mut self,
        out: &mut dyn Write,
        spec: &ServoSpec,
        text: &str,
    ) -> Result<(String, Follower), Failure> {
        let hand = RefCell::new(Follower::new(self.pulse(spec)?, spec.model.pulses_per_turn));
        prompt(out, text);
        let (client, ask) = (&mut self.client, &mut self.ask);
        let mut misses = 0;
        let line =
            ask.line(
                &mut || match value(&mut **client, spec.id, spec.model, "present_position") {
                    Ok(read) => {
                        misses = 0;
                        if let Some((_, pulse)) = read {
                            hand.borrow_mut().push(pulse as i32);
                        }
                        Ok(())
                    }
                    Err(ClientError::Timeout { .. }) if misses < MISSES => {
                        misses += 1;
                        Ok(())
                    }
                    Err(error) => Err(error.into()),
                },
            );
        let line = line.map_err(|failure| match failure.status {
            ExitStatus::Interrupted => interrupted("interrupted; torque is off"),
            _ => failure,
        })?;
        // Where it stands now counts, not where it stood 20 ms ago.
        let last = self.pulse(spec)?;
        let mut hand = hand.into_inner();
        hand.push(last);
        progress(None);
        Ok((line, hand))
    }
}
