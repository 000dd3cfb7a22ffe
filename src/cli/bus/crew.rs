//! Which servos a command is about: those of a configuration, or those that answer.

use super::Failure;
use super::ask::Ask;
use super::{model_name, say};
use crate::bus::address::BusAddress;
use crate::bus::dynamixel::setup::plan::value;
use crate::bus::dynamixel::{ChainOptions, Client, ClientError, DynamixelChain, Model, ServoSpec};
use crate::config::{Character, Files, load};
use std::io::Write;
use std::path::Path;

/// The robot of the configuration at `path`.
pub fn character(path: &Path) -> Result<Character, Failure> {
    let (files, name) = Files::of(path);
    let character = load(files, &name).map_err(Failure::input)?;
    if character.servos.is_empty() {
        return Err(Failure::input(format_args!(
            "{}: this character has no servos (it is an avatar); a robot's configuration is needed",
            path.display()
        )));
    }
    Ok(character)
}

/// Ids of all servos that answer a broadcast, or `ids` where they are given.
pub fn present(client: &mut dyn Client, ids: Option<Vec<u8>>) -> Result<Vec<u8>, Failure> {
    if let Some(ids) = ids {
        return Ok(ids);
    }
    let mut ids = Vec::new();
    client.ping_all(&mut |ping| ids.push(ping.id))?;
    ids.sort_unstable();
    ids.dedup();
    if ids.is_empty() {
        return Err(nobody(client));
    }
    Ok(ids)
}

/// Nobody answers.
pub fn nobody(client: &dyn Client) -> Failure {
    Failure::bus(format_args!(
        "no servo answers on {} at {} baud. Check power and cable; `handwave bus scan BUS --baud all` tries every \
         rate (new servos have 57600)",
        client.port_name(),
        client.baud()
    ))
}

/// What servo `id` says of itself, as a servo of a chain whose joint is called `servo_ID`: zero in the middle of
/// the turn, range by its own limits.
pub fn spec_of(client: &mut dyn Client, id: u8) -> Result<ServoSpec, Failure> {
    let ping = client.ping(id)?;
    let model = Model::by_number(ping.model).ok_or_else(|| {
        Failure::bus(format_args!(
            "servo {id} has model number {}, which this build does not know",
            ping.model
        ))
    })?;
    let mut spec = ServoSpec::new(id, format!("servo_{id}"), model);
    let min = value(client, id, model, "min_position_limit")?;
    let max = value(client, id, model, "max_position_limit")?;
    if let (Some((_, min)), Some((_, max))) = (min, max) {
        spec.min_pulse = i32::try_from(min).unwrap_or(spec.min_pulse);
        spec.max_pulse = i32::try_from(max).unwrap_or(spec.max_pulse);
    }
    spec.check().map_err(|error| {
        Failure::bus(format_args!(
            "servo {id} ({}): {error}. Give it limits that make sense: `handwave bus write BUS {id} max_position_limit 4095`",
            model_name(ping.model)
        ))
    })?;
    Ok(spec)
}

/// A chain of `specs` for a tool: its watchdog stops the servos when the tool dies, unless they are to hold.
pub fn chain(
    client: Box<dyn Client>,
    specs: Vec<ServoSpec>,
    bus: &BusAddress,
    rate_hz: f64,
    hold: bool,
) -> Result<DynamixelChain, Failure> {
    let options = ChainOptions {
        bus: bus.to_string(),
        watchdog: if hold { 0 } else { 10 },
        cycle_budget: std::time::Duration::from_secs_f64(1.0 / rate_hz),
        ..ChainOptions::default()
    };
    DynamixelChain::new(client, specs, options).map_err(Failure::input)
}

/// Turns torque off on servos that have it on, after asking: a limb may fall.
pub fn release(
    client: &mut dyn Client,
    specs: &[ServoSpec],
    ask: &mut Ask,
    out: &mut dyn Write,
) -> Result<(), Failure> {
    let mut stiff: Vec<&ServoSpec> = Vec::new();
    for spec in specs {
        let torque = value(client, spec.id, spec.model, "torque_enable")?;
        if torque.is_some_and(|(_, on)| on != 0) {
            stiff.push(spec);
        }
    }
    if stiff.is_empty() {
        return Ok(());
    }
    let names: Vec<String> = stiff
        .iter()
        .map(|s| format!("{} (servo {})", s.joint, s.id))
        .collect();
    let question = format!(
        "Torque is on at {}. It goes off now and limbs may fall: hold the robot. Go on?",
        names.join(", ")
    );
    if !ask.confirm(out, &question, false)? {
        return Err(Failure::input("nothing was changed"));
    }
    for spec in stiff {
        let Some(register) = spec.model.register("torque_enable") else {
            continue;
        };
        client.write(spec.id, register.address, &[0])?;
        if value(client, spec.id, spec.model, "torque_enable")?.is_none_or(|(_, on)| on != 0) {
            return Err(Failure::bus(format_args!(
                "the torque of {} (servo {}) stays on",
                spec.joint, spec.id
            )));
        }
    }
    say(out, "torque is off")
}

/// Says which of `specs` do not answer, if any.
pub fn all_there(client: &mut dyn Client, specs: &[ServoSpec]) -> Result<(), Failure> {
    let mut missing = Vec::new();
    for spec in specs {
        let mut heard = false;
        for _ in 0..3 {
            match client.ping(spec.id) {
                Ok(_) => heard = true,
                Err(ClientError::Port(error)) => return Err(Failure::bus(error)),
                Err(_) => continue,
            }
            break;
        }
        if !heard {
            missing.push(format!("{} (servo {})", spec.joint, spec.id));
        }
    }
    if missing.is_empty() {
        return Ok(());
    }
    Err(Failure::bus(format_args!(
        "no answer at {} baud from {}. All servos of the configuration have to be plugged in and set up: \
         `handwave bus setup --config FILE BUS` says what is missing",
        client.baud(),
        missing.join(", ")
    )))
}
