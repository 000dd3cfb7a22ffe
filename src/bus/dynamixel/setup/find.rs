//! Who is on the line, at any baud rate, and whether several servos answer to one id.

use crate::bus::dynamixel::client::{Client, ClientError, Ping};
use crate::bus::dynamixel::model::Model;
use crate::bus::port::PortError;

/// A servo that answers, and where.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// What it says of itself.
    pub ping: Ping,
    /// Baud rate at which it answers.
    pub baud: u32,
    /// Its answers come damaged again and again: two servos may have this id.
    pub garbled: bool,
}

/// What a look at all the baud rates gave.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sweep {
    /// Servos, by baud rate in the order looked at, then by id.
    pub found: Vec<Found>,
    /// Rates at which bytes came and no servo could be made out: servos that answer all at once.
    pub noise: Vec<u32>,
    /// Rates that the port cannot be set to, with what the system says.
    pub refused: Vec<String>,
}

impl Sweep {
    /// Whether several servos share an id, as far as one can tell.
    pub fn collisions(&self) -> bool {
        !self.noise.is_empty() || self.found.iter().any(|found| found.garbled)
    }
}

/// How often a servo is asked for what differs between two servos.
const LOOKS: usize = 4;

/// Looks at each of `rates` (bits per second) for servos: all ids by broadcast, or `ids` one by one.
///
/// `progress` is told each rate before it is looked at and ends the sweep by returning false. The
/// client is left at the last rate. Takes 1 to 4 s a rate by broadcast. Changes nothing in the servos.
///
/// # Errors
/// The port fails, or the only rate asked for is refused.
pub fn sweep(
    client: &mut dyn Client,
    rates: &[u32],
    ids: Option<&[u8]>,
    progress: &mut dyn FnMut(u32) -> bool,
) -> Result<Sweep, ClientError> {
    let mut sweep = Sweep::default();
    for &baud in rates {
        if !progress(baud) {
            break;
        }
        match client.set_baud(baud) {
            Ok(()) => {}
            Err(ClientError::Port(PortError::Baud { reason, .. })) if rates.len() > 1 => {
                // Not every adapter knows every rate.
                sweep.refused.push(format!("{baud} baud: {reason}"));
                continue;
            }
            Err(error) => return Err(error),
        }
        look(client, baud, ids, &mut sweep)?;
    }
    Ok(sweep)
}

/// One rate.
fn look(
    client: &mut dyn Client,
    baud: u32,
    ids: Option<&[u8]>,
    sweep: &mut Sweep,
) -> Result<(), ClientError> {
    let damaged = client.traffic().damaged;
    let mut pings: Vec<(Ping, bool)> = Vec::new();
    match ids {
        None => client.ping_all(&mut |ping| add(&mut pings, ping))?,
        Some(ids) => {
            for &id in ids {
                match client.ping(id) {
                    Ok(ping) => add(&mut pings, ping),
                    Err(ClientError::Port(error)) => return Err(error.into()),
                    // Nobody there, or nobody that speaks clearly.
                    Err(_) => {}
                }
            }
        }
    }
    if ids.is_none() && client.traffic().damaged > damaged {
        // Answers that met on the line: ask the likely ids alone, among them that of new servos.
        let heard: Vec<u8> = pings.iter().map(|(ping, _)| ping.id).collect();
        for id in (1..=20).filter(|id| !heard.contains(id)) {
            match client.ping(id) {
                Ok(ping) => pings.push((ping, false)),
                Err(ClientError::Port(error)) => return Err(error.into()),
                Err(_) => {}
            }
        }
    }
    if pings.is_empty() && client.traffic().damaged > damaged {
        sweep.noise.push(baud);
    }
    pings.sort_by_key(|(ping, _)| ping.id);
    for (ping, twice) in pings {
        let garbled = twice || !speaks_clearly(client, &ping)?;
        sweep.found.push(Found {
            ping,
            baud,
            garbled,
        });
    }
    Ok(())
}

fn add(pings: &mut Vec<(Ping, bool)>, ping: Ping) {
    match pings.iter_mut().find(|(known, _)| known.id == ping.id) {
        Some((_, twice)) => *twice = true,
        None => pings.push((ping, false)),
    }
}

/// Whether the servo answers cleanly when asked for what two servos never have alike: clock and position.
///
/// Two servos with one id answer a ping with the same bytes at the same time, which may look well.
fn speaks_clearly(client: &mut dyn Client, ping: &Ping) -> Result<bool, ClientError> {
    let Some(model) = Model::by_number(ping.model) else {
        return Ok(true);
    };
    let names = ["realtime_tick", "present_position", "present_temperature"];
    let spots: Vec<_> = names.iter().filter_map(|n| model.register(n)).collect();
    let before = client.traffic().damaged;
    let mut missed = 0;
    for look in 0..LOOKS {
        let Some(register) = spots.get(look % spots.len().max(1)) else {
            return Ok(true);
        };
        let mut bytes = [0; 4];
        let bytes = &mut bytes[..usize::from(register.size).min(4)];
        match client.read(ping.id, register.address, bytes) {
            // Refused is said in a clear voice.
            Ok(_) | Err(ClientError::Refused { .. }) => {}
            Err(ClientError::Port(error)) => return Err(error.into()),
            Err(_) => missed += 1,
        }
    }
    // At status return level 0 a servo answers pings only: silence, but nothing damaged.
    Ok(missed == 0 || client.traffic().damaged == before)
}
