//! What a servo is to be, what it is, and the difference.

use super::SetupError;
use super::work::Place;
use crate::bus::dynamixel::client::{Client, ClientError};
use crate::bus::dynamixel::model::{Model, POSITION_MODE, Register};
use handwave_dynamixel::baud;
use std::time::Duration;

/// An offset beyond this is ignored by servos in position mode, pulses.
const MAX_OFFSET: i64 = 1024;
/// How often a register is asked for before its servo counts as silent.
const TRIES: usize = 4;
/// Between two tries the line is listened to until it was quiet this long.
const QUIET: Duration = Duration::from_millis(5);

/// What is wanted of a servo, beside what every servo of a chain needs: position mode, no return delay,
/// an answer to everything (status return level 2), torque off at power-up, no second id, no reversal of its own.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Id, 0..=252.
    pub id: u8,
    /// Bits per second.
    pub baud: u32,
    /// Least and greatest position it may be sent to, pulses; `None` leaves its limits.
    pub limits: Option<(i32, i32)>,
    /// Make the place where the shaft stands now the middle of the turn (pulse 2048).
    pub zero_here: bool,
}

/// One register to be written.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// The register.
    pub register: &'static Register,
    /// What it holds.
    pub old: i64,
    /// What it shall hold.
    pub new: i64,
}

/// Reads one register by name; `None` where the model has none of that name.
///
/// # Errors
/// The servo does not answer, or refuses.
pub fn value(
    client: &mut dyn Client,
    id: u8,
    model: &'static Model,
    name: &str,
) -> Result<Option<(&'static Register, i64)>, ClientError> {
    let Some(register) = model.register(name) else {
        return Ok(None);
    };
    let mut bytes = [0; 4];
    let bytes = &mut bytes[..usize::from(register.size).min(4)];
    let mut tries = 1;
    while let Err(error) = client.read(id, register.address, bytes) {
        match error {
            // A lost answer, or one that a busy system handed over late.
            ClientError::Timeout { .. } if tries < TRIES => tries += 1,
            other => return Err(other),
        }
        client.settle(QUIET)?;
    }
    Ok(Some((register, register.decode(bytes))))
}

/// What has to be written to the servo at `place` so that it is as `wanted`, in the order of writing: what
/// makes it answer first, then settings, then id and baud rate. Nothing is written but the (volatile) return level
/// of a servo that answers no reads.
///
/// # Errors
/// A value that the model does not take, or a servo that does not answer.
pub fn plan(
    client: &mut dyn Client,
    place: Place,
    model: &'static Model,
    wanted: &Wanted,
) -> Result<Vec<Change>, SetupError> {
    let code = baud::code(wanted.baud)
        .map(i64::from)
        .filter(|code| {
            model
                .register("baud_rate")
                .is_some_and(|r| (r.min..=r.max).contains(code))
        })
        .ok_or_else(|| SetupError::Baud {
            model: model.name,
            baud: wanted.baud,
            allowed: baud::RateList.to_string(),
        })?;
    let mut targets: Vec<(&str, i64)> = vec![
        ("status_return_level", 2),
        ("torque_enable", 0),
        ("return_delay_time", 0),
        ("drive_mode", 0),
        ("operating_mode", POSITION_MODE.into()),
        ("secondary_id", 255),
        ("startup_configuration", 0),
    ];
    if let Some(offset) = offset(client, place, model, wanted)? {
        targets.push(("homing_offset", offset));
    }
    if let Some((min, max)) = wanted.limits {
        targets.push(("max_position_limit", max.into()));
        targets.push(("min_position_limit", min.into()));
    }
    targets.push(("id", wanted.id.into()));
    targets.push(("baud_rate", code));
    let mut changes = Vec::new();
    for (name, new) in targets {
        let read = match value(client, place.id, model, name) {
            // At a lower return level reads are not answered, and the level is the first thing to change.
            Err(ClientError::Timeout { .. }) if name == "status_return_level" => {
                model.register(name).map(|register| (register, 0))
            }
            other => other?,
        };
        let Some((register, old)) = read else {
            continue;
        };
        if !(register.min..=register.max).contains(&new) {
            return Err(SetupError::Range {
                model: model.name,
                register: register.name,
                value: new,
                min: register.min,
                max: register.max,
            });
        }
        if name == "status_return_level" && old != new {
            // From here on it answers, so that the rest can be read. Volatile on most models, and harmless.
            client.sync_write(register.address, 1, &[place.id], &[2])?;
        }
        if old != new {
            changes.push(Change { register, old, new });
        }
    }
    Ok(changes)
}

/// The homing offset that is wanted; `None` where the model has none.
fn offset(
    client: &mut dyn Client,
    place: Place,
    model: &'static Model,
    wanted: &Wanted,
) -> Result<Option<i64>, SetupError> {
    if !wanted.zero_here {
        return Ok(model.register("homing_offset").map(|_| 0));
    }
    let now = value(client, place.id, model, "homing_offset")?;
    let present = value(client, place.id, model, "present_position")?;
    let (Some((_, now)), Some((_, present))) = (now, present) else {
        return Ok(None);
    };
    let middle = (model.pulses_per_turn / 2.0) as i64;
    let bare = present - now;
    let offset = middle - bare;
    if offset.abs() > MAX_OFFSET {
        return Err(SetupError::FarFromMiddle {
            pulse: bare,
            degrees: offset as f64 * -360.0 / model.pulses_per_turn,
        });
    }
    Ok(Some(offset))
}
