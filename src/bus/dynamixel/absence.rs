//! What is found out about a servo that does not answer at the start: another baud rate, two servos with one id.

use super::chain::DynamixelChain;
use super::client::ClientError;
use super::model::{STATE_BYTES, address};
use crate::bus::BusError;
use handwave_dynamixel::baud;
use std::time::Duration;

/// Rates at which it is looked for, the likeliest first: as it comes out of the box, then the common ones.
const RATES: [u32; 8] = [
    57_600, 1_000_000, 3_000_000, 4_000_000, 2_000_000, 115_200, 4_500_000, 9_600,
];
/// How often it is asked whether its answers are garbled.
const LOOKS: u32 = 4;
/// The line is quiet between two looks.
const QUIET: Duration = Duration::from_millis(5);

impl DynamixelChain {
    /// Replaces the error of an absent servo by one that says more, where more can be found out.
    pub(super) fn explain_absence(&mut self, error: BusError) -> BusError {
        let BusError::Absent { id, .. } = error else {
            return error;
        };
        let Some(index) = self.servos.iter().position(|servo| servo.spec.id == id) else {
            return error;
        };
        let (speaks, garbled) = self.listen_to(index);
        if garbled > 0 {
            let bus = &self.options.bus;
            let free = (1..=252).find(|id| self.servos.iter().all(|s| s.spec.id != *id));
            return self.servo_problem(
                index,
                format!("something answers to id {id}, but garbled ({garbled} of {} times)", 2 * LOOKS),
                format!(
                    "Likely two servos have this id: unplug one of them, give the other another id by \
                     `handwave bus write {bus} {id} id {}`, then plug it in again. If there is only one, check cables and ground",
                    free.unwrap_or(1)
                ),
            );
        }
        if speaks {
            return error;
        }
        match self.other_rate(index) {
            Ok(Some(explained)) => explained,
            Ok(None) => error,
            Err(error) => error,
        }
    }

    /// Whether servo `index` answers clearly, and how many of its answers are garbled.
    fn listen_to(&mut self, index: usize) -> (bool, u32) {
        let spec = &self.servos[index].spec;
        let (id, present) = (spec.id, spec.at(address::PRESENT_STATE));
        let (mut speaks, mut garbled) = (false, 0);
        for look in 0..2 * LOOKS {
            // Two servos of one model say the same to a ping, and stand in different places.
            let damaged = self.client.traffic().damaged;
            let answered = if look % 2 == 0 {
                self.client.ping(id).is_ok()
            } else {
                let mut state = [0; STATE_BYTES];
                self.client.read(id, present, &mut state).is_ok()
            };
            speaks |= answered;
            // What comes after the end of the wait counts too. A lost port shows up in the next request.
            let _ = self.client.settle(QUIET);
            garbled += u32::from(!answered && self.client.traffic().damaged > damaged);
        }
        (speaks, garbled)
    }

    /// Looks for servo `index` at other baud rates, and for the others of the chain where it is found.
    fn other_rate(&mut self, index: usize) -> Result<Option<BusError>, BusError> {
        let rate = self.client.baud();
        let id = self.servos[index].spec.id;
        let mut found = None;
        for other in RATES.into_iter().filter(|other| *other != rate) {
            // Not every adapter knows every rate.
            if self.client.set_baud(other).is_err() || !self.answers(id) {
                continue;
            }
            let mut ids = vec![id.to_string()];
            for place in 0..self.servos.len() {
                let another = self.servos[place].spec.id;
                if another != id && self.answers(another) {
                    ids.push(another.to_string());
                }
            }
            found = Some((other, ids.join(",")));
            break;
        }
        let back = self.client.set_baud(rate);
        back.map_err(|error| self.servo_error(index, error))?;
        let Some((other, ids)) = found else {
            return Ok(None);
        };
        let bus = &self.options.bus;
        let there = bus.rsplit_once('@').map_or(bus.as_str(), |(port, _)| port);
        let advice = match baud::code(rate) {
            Some(code) => format!(
                "Set it (torque is off out of the box): `handwave bus write {there}@{other} {ids} baud_rate {code}`"
            ),
            None => format!("Let the bus run at a rate that servos have, such as {other}"),
        };
        let problem = format!("it answers at {other} baud, the bus runs at {rate}");
        Ok(Some(self.servo_problem(index, problem, advice)))
    }

    fn answers(&mut self, id: u8) -> bool {
        // Twice: the first answer at a new rate may have met an old one.
        (0..2).any(|_| match self.client.ping(id) {
            Ok(_) => true,
            Err(ClientError::Timeout { .. }) | Err(_) => false,
        })
    }
}
