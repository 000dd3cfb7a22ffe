//! `handwave bus jog`: moves one servo, slowly, within its limits, torque off at the end.

use super::ask::interrupted;
use super::{crew, open_on, say};
use crate::base::Clock;
use crate::bus::BusAddress;
use crate::bus::dynamixel::ServoSpec;
use crate::cli::{ExitStatus, Failure};
use crate::live::drive::{Drive, DriveError};
use crate::live::keys::Keys;
use crate::live::stop::StopRequest;
use crate::live::{RealClock, StopSwitch};
use crate::robot::JointEnvelope;
use clap::Args;
use std::f64::consts::TAU;
use std::io::Write;
use std::str::FromStr;
use std::sync::Arc;

/// Control cycles per second.
const RATE_HZ: f64 = 50.0;
/// A fine and a coarse step by keys, degrees.
const STEPS_DEG: (f64, f64) = (1.0, 10.0);
/// Cycles in which a servo that has reached its goal may settle.
const SETTLE: u32 = 15;

/// Move one servo: by keys, or to a position. Slow, within the servo's position limits, torque off at the end.
///
/// The present position is read before torque goes on and is where the motion begins.
/// Stops with torque off when the servo reports an error, on Ctrl-C and on every other end.
#[derive(Args, Debug)]
#[command(after_help = "\
Keys: left and right 1 degree, down and up 10 degrees, h the middle (pulse 2048), q or Enter ends.
Degrees count from the middle of the servo's turn (pulse 2048), growing with the pulses.

Examples:
  handwave bus jog dynamixel:/dev/ttyUSB0 3
  handwave bus jog dynamixel:/dev/ttyUSB0 3 --by -5
  handwave bus jog dynamixel:/dev/ttyUSB0 3 --to 2048p --speed 30
  handwave bus jog dynamixel:/dev/ttyUSB0 3 --to 90 --hold")]
pub struct JogArgs {
    /// The bus, such as dynamixel:/dev/ttyUSB0@1000000.
    #[arg(value_name = "BUS")]
    bus: BusAddress,
    /// Servo id.
    #[arg(value_name = "ID", value_parser = clap::value_parser!(u8).range(0..=252))]
    id: u8,
    /// Go there: degrees from the middle, or pulses with a p, such as 2048p.
    #[arg(
        long,
        value_name = "DEG|PULSEp",
        allow_hyphen_values = true,
        conflicts_with = "by"
    )]
    to: Option<Spot>,
    /// Go so far from where it stands: degrees, or pulses with a p.
    #[arg(long, value_name = "DEG|PULSEp", allow_hyphen_values = true)]
    by: Option<Spot>,
    /// Greatest speed, degrees per second.
    #[arg(long, value_name = "DEG/S", default_value_t = 20.0, value_parser = super::positive)]
    speed: f64,
    /// Leave torque on at the end.
    #[arg(long)]
    hold: bool,
}

/// A place or a way: degrees or pulses.
#[derive(Copy, Clone, Debug, PartialEq)]
enum Spot {
    Degrees(f64),
    Pulses(f64),
}

impl FromStr for Spot {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |part: &str| part.trim().parse::<f64>().ok().filter(|n| n.is_finite());
        match text.strip_suffix('p') {
            Some(pulses) => number(pulses).map(Spot::Pulses),
            None => number(text.strip_suffix("deg").unwrap_or(text)).map(Spot::Degrees),
        }
        .ok_or_else(|| {
            format!("'{text}' is neither degrees, such as -12.5, nor pulses, such as 2048p")
        })
    }
}

impl Spot {
    /// From the middle of the turn, or of a way, radians.
    fn rad(self, middle: f64, per_turn: f64) -> f64 {
        match self {
            Spot::Degrees(degrees) => degrees.to_radians(),
            Spot::Pulses(pulses) => (pulses - middle) * TAU / per_turn,
        }
    }
}

pub fn jog(args: &JogArgs, out: &mut dyn Write) -> Result<ExitStatus, Failure> {
    let by_keys = args.to.is_none() && args.by.is_none();
    let stop = StopSwitch::new();
    stop.on_signals().map_err(Failure::bus)?;
    let clock: Arc<dyn Clock> = Arc::new(RealClock::new());
    let mut client = open_on(&args.bus, Arc::clone(&clock))?;
    let spec = crew::spec_of(&mut *client, args.id)?;
    let keys = match by_keys {
        true => Some(Keys::open().ok_or_else(|| {
            Failure::input("jogging by keys needs a terminal; elsewhere say --to or --by")
        })?),
        false => None,
    };
    let (lower, upper) = ends(&spec);
    let limits = vec![JointEnvelope {
        lower,
        upper,
        velocity: args.speed.to_radians(),
        acceleration: 3.0 * args.speed.to_radians(),
    }];
    let chain = crew::chain(client, vec![spec.clone()], &args.bus, RATE_HZ, args.hold)?;
    let mut drive = Drive::begin(Box::new(chain), clock, limits, RATE_HZ).map_err(failure)?;
    let present = drive.positions().next().unwrap_or(0.0);
    let middle = f64::from(spec.zero_pulse);
    let per_turn = spec.model.pulses_per_turn;
    let target = match (args.to, args.by) {
        (Some(to), _) => to.rad(middle, per_turn),
        (None, Some(by)) => present + by.rad(0.0, per_turn),
        (None, None) => present,
    };
    if !(lower - 1e-9..=upper + 1e-9).contains(&target) {
        return Err(Failure::input(format_args!(
            "{} is outside the position limits of servo {}, {} to {}; nothing was moved",
            place(&spec, target),
            spec.id,
            place(&spec, lower),
            place(&spec, upper)
        )));
    }
    say(
        out,
        format_args!(
            "servo {} ({}) stands at {}, limits {} to {}",
            spec.id,
            spec.model.name,
            place(&spec, present),
            place(&spec, lower),
            place(&spec, upper)
        ),
    )?;
    drive.arm().map_err(failure)?;
    let ended = match keys {
        Some(keys) => by_hand(&mut drive, keys, &spec, target, &stop, out),
        None => go(&mut drive, target, &stop),
    };
    let reached = drive.positions().next().unwrap_or(target);
    let interrupted_by = match ended {
        Ok(interrupted) => interrupted,
        Err(error) => return Err(failure(error)),
    };
    if args.hold && !interrupted_by {
        drive.leave_holding();
        say(
            out,
            format_args!(
                "at {}, torque stays on; off by: handwave bus write {} {} torque_enable 0",
                place(&spec, reached),
                args.bus,
                spec.id
            ),
        )?;
        return Ok(ExitStatus::Done);
    }
    let report = drive.finish().map_err(failure)?;
    if let Some((_, reason)) = report.unconfirmed.first() {
        return Err(Failure::bus(format_args!(
            "torque off is not confirmed by servo {}: {reason}. Cut its power",
            spec.id
        )));
    }
    if interrupted_by {
        return Err(interrupted(format_args!(
            "interrupted at {}, torque off",
            place(&spec, reached)
        )));
    }
    say(
        out,
        format_args!("at {}, torque off", place(&spec, reached)),
    )?;
    Ok(ExitStatus::Done)
}

/// Goes to `target` and settles; true when interrupted.
fn go(drive: &mut Drive, target: f64, stop: &StopSwitch) -> Result<bool, DriveError> {
    let mut settling = 0;
    while settling < SETTLE {
        if stop.request() != StopRequest::None {
            return Ok(true);
        }
        drive.step(&[target])?;
        settling += u32::from(drive.arrived(&[target]));
    }
    Ok(false)
}

/// Follows keys until one ends it; true when interrupted.
fn by_hand(
    drive: &mut Drive,
    mut keys: Keys,
    spec: &ServoSpec,
    mut target: f64,
    stop: &StopSwitch,
    out: &mut dyn Write,
) -> Result<bool, DriveError> {
    let (lower, upper) = ends(spec);
    let (fine, coarse) = (STEPS_DEG.0.to_radians(), STEPS_DEG.1.to_radians());
    loop {
        if stop.request() != StopRequest::None {
            return Ok(true);
        }
        while let Some(key) = keys.key() {
            let step = match key.as_slice() {
                b"\x1b[C" | b"\x1bOC" => fine,
                b"\x1b[D" | b"\x1bOD" => -fine,
                b"\x1b[A" | b"\x1bOA" => coarse,
                b"\x1b[B" | b"\x1bOB" => -coarse,
                b"h" => -target,
                b"q" | b"Q" | b"\n" | b"\r" | b"\x1b" => {
                    let _ = writeln!(out);
                    return Ok(false);
                }
                _ => 0.0,
            };
            target = (target + step).clamp(lower, upper);
        }
        drive.step(&[target])?;
        let now = drive.positions().next().unwrap_or(target);
        let line = format!(
            "\r\x1b[K  at {}  to {}   (left/right 1 deg, down/up 10 deg, h middle, q ends)",
            place(spec, now),
            place(spec, target)
        );
        // It is only there to be looked at.
        let _ = out.write_all(line.as_bytes()).and_then(|()| out.flush());
    }
}

/// Limits, radians from the middle.
fn ends(spec: &ServoSpec) -> (f64, f64) {
    (
        spec.position_rad(spec.min_pulse),
        spec.position_rad(spec.max_pulse),
    )
}

/// `12.0 deg (2185)`.
fn place(spec: &ServoSpec, rad: f64) -> String {
    let pulse = rad * spec.model.pulses_per_turn / TAU + f64::from(spec.zero_pulse);
    format!("{:.1} deg ({})", rad.to_degrees() + 0.0, pulse.round())
}

/// A drive's end as an exit code: 4 when the servo stopped it, 3 when the bus did.
pub fn failure(error: DriveError) -> Failure {
    Failure {
        status: match error.is_safety_stop() {
            true => ExitStatus::SafetyStop,
            false => ExitStatus::BusFailure,
        },
        message: error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_as_users_write_them() {
        assert_eq!("90".parse(), Ok(Spot::Degrees(90.0)));
        assert_eq!("-12.5deg".parse(), Ok(Spot::Degrees(-12.5)));
        assert_eq!("2048p".parse(), Ok(Spot::Pulses(2048.0)));
        for wrong in ["", "p", "ninety", "nan", "inf", "1e400"] {
            assert!(wrong.parse::<Spot>().is_err(), "'{wrong}' was taken");
        }
        let quarter = Spot::Pulses(3072.0).rad(2048.0, 4096.0);
        assert!((quarter - TAU / 4.0).abs() < 1e-12, "{quarter}");
    }
}
