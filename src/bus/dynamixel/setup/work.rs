//! Writes a plan to a servo, step by step: noted before, read back after, and where it stands when it stops half way.

use super::SetupError;
use super::plan::Change;
use super::undo::UndoGroup;
use crate::bus::dynamixel::client::{Client, ClientError};
use crate::bus::dynamixel::model::{Model, Register};
use handwave_dynamixel::baud;
use std::fmt;
use std::time::Duration;

/// Where a servo answers.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Id.
    pub id: u8,
    /// Bits per second.
    pub baud: u32,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "id {} at {} baud", self.id, self.baud)
    }
}

impl Place {
    /// Where the servo answers after `value` was written to `register`.
    pub fn after(self, register: &str, value: i64) -> Place {
        let code = u8::try_from(value).unwrap_or(u8::MAX);
        match register {
            "id" => Place { id: code, ..self },
            "baud_rate" => Place {
                baud: baud::rate(code).unwrap_or(self.baud),
                ..self
            },
            _ => self,
        }
    }
}

/// The work stopped before its end.
#[derive(Debug, thiserror::Error)]
#[error("{reason}")]
pub struct Halt {
    /// Why.
    pub reason: SetupError,
    /// Where the servo answered last, or answers when the last write arrived although its answer did not.
    pub place: Place,
    /// How many changes are written and read back.
    pub done: usize,
}

/// How often a write or a read that brought no answer is repeated.
const TRIES: usize = 3;
/// A servo that moved to another rate or id is given this long before it is asked there.
const SETTLE: Duration = Duration::from_millis(20);

/// Writes `changes` to the servo at `place` and reads each back, also at a new id and a new baud rate.
///
/// `note` is told where the servo is and what comes before each write, and may stop the work by an error.
/// Returns where the servo answers afterwards; the client is set to that rate. Torque is off before
/// the first register that needs it to be.
///
/// # Errors
/// What stopped it, with the state that the servo is in; the same call with a new plan goes on from there.
pub fn commission(
    client: &mut dyn Client,
    place: Place,
    changes: &[Change],
    note: &mut dyn FnMut(Place, &Change) -> Result<(), SetupError>,
) -> Result<Place, Halt> {
    let mut at = place;
    for (done, change) in changes.iter().enumerate() {
        let step = note(at, change).and_then(|()| write(client, at, change.register, change.new));
        match step {
            Ok(place) => at = place,
            Err(reason) => {
                return Err(Halt {
                    reason,
                    place: at,
                    done,
                });
            }
        }
    }
    Ok(at)
}

/// Writes one register and reads it back where the servo answers then.
fn write(
    client: &mut dyn Client,
    at: Place,
    register: &'static Register,
    new: i64,
) -> Result<Place, SetupError> {
    client.set_baud(at.baud)?;
    let next = at.after(register.name, new);
    if next != at {
        // Two servos in one place cannot be told apart any more.
        client.set_baud(next.baud)?;
        let taken = answers(client, next.id)?;
        client.set_baud(at.baud)?;
        if taken {
            return Err(SetupError::Taken {
                id: next.id,
                baud: next.baud,
            });
        }
    }
    let bytes = register.encode(new);
    let bytes = &bytes[..usize::from(register.size).min(4)];
    let mut outcome = Ok(());
    for _ in 0..TRIES {
        outcome = match client.write(at.id, register.address, bytes) {
            Err(error @ ClientError::Timeout { .. }) => {
                // It may have heard it and moved away; then it is found where it should be.
                if next != at {
                    break;
                }
                Err(error)
            }
            Err(error) => return Err(error.into()),
            Ok(_) => Ok(()),
        };
        if outcome.is_ok() {
            break;
        }
        client.settle(SETTLE)?;
    }
    outcome?;
    client.settle(SETTLE)?;
    client.set_baud(next.baud)?;
    let found = read(client, next.id, register)?;
    if found != new {
        return Err(SetupError::NotKept {
            register: register.name,
            written: new,
            found,
        });
    }
    Ok(next)
}

fn read(client: &mut dyn Client, id: u8, register: &Register) -> Result<i64, ClientError> {
    let mut bytes = [0; 4];
    let bytes = &mut bytes[..usize::from(register.size).min(4)];
    let mut tries = 1;
    loop {
        match client.read(id, register.address, bytes) {
            Ok(_) => return Ok(register.decode(bytes)),
            Err(ClientError::Timeout { .. }) if tries < TRIES => tries += 1,
            Err(error) => return Err(error),
        }
        client.settle(SETTLE)?;
    }
}

/// Whether anybody answers to `id` at the present rate.
fn answers(client: &mut dyn Client, id: u8) -> Result<bool, ClientError> {
    let before = client.traffic().damaged;
    match client.ping(id) {
        Ok(_) => Ok(true),
        Err(ClientError::Port(error)) => Err(error.into()),
        // Damaged answers are answers, too.
        Err(_) => Ok(client.traffic().damaged > before),
    }
}

/// Finds the servo of `group` along the way it took, last place first; `None` when it answers nowhere.
///
/// # Errors
/// The port fails.
pub fn locate(client: &mut dyn Client, group: &UndoGroup) -> Result<Option<Place>, ClientError> {
    let mut places = vec![group.place()];
    places.extend(group.entries.iter().rev().map(|entry| Place {
        id: entry.id,
        baud: entry.baud,
    }));
    places.dedup();
    for place in places {
        client.set_baud(place.baud)?;
        for _ in 0..TRIES {
            match client.ping(place.id) {
                Ok(ping) if Model::by_number(ping.model).map(|m| m.name) == Some(&group.model) => {
                    return Ok(Some(place));
                }
                Err(ClientError::Port(error)) => return Err(error.into()),
                Ok(_) => break,
                Err(_) => {}
            }
        }
    }
    Ok(None)
}

/// Puts back what `group` changed in the servo that stands at `place`, last change first. Returns how many
/// registers were written and where it answers then.
///
/// # Errors
/// As [`commission`]; a place that another servo has taken meanwhile is one of the reasons.
pub fn restore(
    client: &mut dyn Client,
    place: Place,
    model: &'static Model,
    group: &UndoGroup,
) -> Result<(usize, Place), Halt> {
    let mut at = place;
    let mut done = 0;
    for entry in group.entries.iter().rev() {
        let Some(register) = model.register(&entry.register) else {
            continue;
        };
        let moves = matches!(register.name, "id" | "baud_rate");
        let before = at.after(register.name, entry.old);
        let step = if moves && at.after(register.name, entry.new) != at {
            // It never got there.
            Ok(at)
        } else if register.name == "torque_enable" {
            // Torque comes on by nobody's undo.
            Ok(at)
        } else {
            client
                .set_baud(at.baud)
                .and_then(|()| read(client, at.id, register))
                .map_err(SetupError::from)
                .and_then(|now| match now == entry.old {
                    true => Ok(before),
                    false => {
                        let moved = write(client, at, register, entry.old);
                        done += usize::from(moved.is_ok());
                        moved
                    }
                })
        };
        match step {
            Ok(place) => at = place,
            Err(reason) => {
                return Err(Halt {
                    reason,
                    place: at,
                    done,
                });
            }
        }
    }
    Ok((done, at))
}
