//! What a [`Master`] asks of servos with Protocol 1.0.

use super::WINDOW;
use super::view::{self, TABLE_BYTES, View};
use crate::base::Time;
use crate::bus::dynamixel::client::{ClientError, Outcome, Ping, Reply};
use crate::bus::dynamixel::master::Master;
use crate::bus::dynamixel::model::address;
use handwave_dynamixel::p1::lists::encode_sync_write;
use handwave_dynamixel::p1::{BROADCAST_ID, Instruction, MAX_ID, wire};

/// Registers 0 to 2: model number, firmware version.
const IDENTITY_BYTES: u8 = 3;
/// The last id that is listed when all are asked: the highest of Protocol 2.0, as everywhere in this program.
const LAST_ID: u8 = if MAX_ID < handwave_dynamixel::MAX_ID {
    MAX_ID
} else {
    handwave_dynamixel::MAX_ID
};

impl Master {
    /// Sends an instruction of Protocol 1.0 and waits for the answer, until `latest` at most.
    fn ask_one(
        &mut self,
        id: u8,
        instruction: &Instruction<'_>,
        data: &mut [u8],
        latest: Option<Time>,
    ) -> Result<Reply, ClientError> {
        self.listener.listen_for(true);
        let asked = self
            .send(|buf| instruction.encode(id, buf))
            .and_then(|()| match id {
                BROADCAST_ID => Ok(Reply::default()),
                _ => self.answer_within(id, data, wire::status(data.len()), latest),
            });
        self.listener.listen_for(false);
        asked
    }

    /// Reads own registers of the servo.
    fn read_own(
        &mut self,
        id: u8,
        begin: u8,
        data: &mut [u8],
        latest: Option<Time>,
    ) -> Result<Reply, ClientError> {
        let Ok(length) = u8::try_from(data.len()) else {
            return Err(ClientError::TooLong {
                bytes: data.len(),
                limit: u8::MAX.into(),
            });
        };
        let read = Instruction::Read {
            address: begin,
            length,
        };
        self.ask_one(id, &read, data, latest)
    }

    /// Pings, and reads model number and firmware version.
    pub(in crate::bus::dynamixel) fn ping_one(&mut self, id: u8) -> Result<Ping, ClientError> {
        self.ask_one(id, &Instruction::Ping, &mut [], None)?;
        let mut identity = [0; IDENTITY_BYTES as usize];
        let reply = self.read_own(id, 0, &mut identity, None)?;
        let [low, high, firmware] = identity;
        Ok(Ping {
            id,
            model: u16::from_le_bytes([low, high]),
            firmware,
            alert: reply.alert,
        })
    }

    /// Asks every id in turn: a broadcast ping would bring all answers at once.
    pub(in crate::bus::dynamixel) fn ping_all_one(
        &mut self,
        found: &mut dyn FnMut(Ping),
    ) -> Result<(), ClientError> {
        for id in 0..=LAST_ID {
            // An id may be there twice, once for each protocol: then they disturb one another, and it is told so elsewhere.
            if self.is_two(id) {
                continue;
            }
            match self.ping_one(id) {
                Ok(ping) => {
                    self.speak_one_to(id);
                    found(ping);
                }
                Err(ClientError::Port(error)) => return Err(error.into()),
                Err(_) => {}
            }
        }
        Ok(())
    }

    /// Reads own registers, or above [`WINDOW`] what they mean in terms of the X series.
    pub(in crate::bus::dynamixel) fn read_one(
        &mut self,
        id: u8,
        address: u16,
        data: &mut [u8],
        latest: Option<Time>,
    ) -> Result<Reply, ClientError> {
        let Some(x_series) = address.checked_sub(WINDOW) else {
            let Ok(begin) = u8::try_from(address) else {
                return Err(self.refused_address(id));
            };
            return self.read_own(id, begin, data, latest);
        };
        let needed = view::needed(x_series, data.len());
        let mut own = [0; TABLE_BYTES];
        let own = &mut own[..needed.len()];
        let reply = if own.is_empty() {
            // What is asked for stands in the answer itself, or nowhere.
            self.ask_one(id, &Instruction::Ping, &mut [], latest)?
        } else {
            self.read_own(id, needed.start, own, latest)?
        };
        let view = View {
            begin: needed.start,
            bytes: own,
            conditions: self.listener.conditions.0,
        };
        view.show(x_series, data);
        Ok(reply)
    }

    /// Writes own registers, or above [`WINDOW`] what means the same; what the servo does not have is left out.
    pub(in crate::bus::dynamixel) fn write_one(
        &mut self,
        id: u8,
        address: u16,
        data: &[u8],
    ) -> Result<Reply, ClientError> {
        let Some(x_series) = address.checked_sub(WINDOW) else {
            let Ok(begin) = u8::try_from(address) else {
                return Err(self.refused_address(id));
            };
            let write = Instruction::Write {
                address: begin,
                data,
            };
            return self.ask_one(id, &write, &mut [], None);
        };
        if x_series == address::TORQUE_ENABLE && data == [1] && id != BROADCAST_ID {
            self.restore_torque_limit(id)?;
        }
        let mut own = [0; TABLE_BYTES];
        let Some((begin, count)) = view::write(x_series, data, &mut own) else {
            return Err(self.refused_address(id));
        };
        if count == 0 {
            return Ok(Reply::default());
        }
        let write = Instruction::Write {
            address: begin,
            data: &own[..count],
        };
        self.ask_one(id, &write, &mut [], None)
    }

    /// A servo that shut down has torque limit 0, and torque comes on only once it is set again: to the maximal torque,
    /// which it is after power-up.
    fn restore_torque_limit(&mut self, id: u8) -> Result<(), ClientError> {
        let mut value = [0; 2];
        self.read_one(id, WINDOW + address::GOAL_PWM, &mut value, None)?;
        if value == [0, 0] {
            self.read_one(id, WINDOW + address::PWM_LIMIT, &mut value, None)?;
            self.write_one(id, WINDOW + address::GOAL_PWM, &value)?;
        }
        Ok(())
    }

    /// The same registers of several servos; `data` holds `length` bytes for each.
    pub(in crate::bus::dynamixel) fn sync_write_one(
        &mut self,
        address: u16,
        length: u16,
        ids: &[u8],
        data: &[u8],
    ) -> Result<(), ClientError> {
        let size = usize::from(length).max(1);
        let refused = self.refused_address(BROADCAST_ID);
        let mut entries = ids.iter().copied().zip(data.chunks(size)).peekable();
        let Some(&(_, sample)) = entries.peek() else {
            return Ok(());
        };
        let own = |bytes: &[u8]| -> Option<(u8, usize, [u8; 8])> {
            let mut short = [0; 8];
            let Some(x_series) = address.checked_sub(WINDOW) else {
                let place = short.get_mut(..bytes.len())?;
                place.copy_from_slice(bytes);
                return Some((u8::try_from(address).ok()?, bytes.len(), short));
            };
            let mut own = [0; TABLE_BYTES];
            let (begin, count) = view::write(x_series, bytes, &mut own)?;
            let count = count.min(short.len());
            short[..count].copy_from_slice(&own[..count]);
            Some((begin, count, short))
        };
        let Some((begin, count, _)) = own(sample) else {
            return Err(refused);
        };
        if count == 0 {
            return Ok(());
        }
        // Fits: `own` bounds it by 8.
        let each = count as u8;
        let items = entries.filter_map(|(id, bytes)| Some((id, own(bytes)?.2)));
        self.send(|buf| encode_sync_write(buf, begin, each, items))?;
        self.may_hold_stale = false;
        Ok(())
    }

    /// Protocol 1.0 has no sync read: each servo is asked in turn, and one that is silent costs its own time alone.
    ///
    /// Once the cycle has no room for another answer, the others are not reached.
    pub(in crate::bus::dynamixel) fn sync_read_one(
        &mut self,
        address: u16,
        length: u16,
        ids: &[u8],
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError> {
        outcomes.fill(Outcome::NotReached);
        let cells = data.chunks_mut(usize::from(length).max(1));
        let mut silent = false;
        for ((&id, cell), outcome) in ids.iter().zip(cells).zip(outcomes) {
            let one = self.wire_time(wire::READ + wire::status(length.into()));
            let end = self.cycle_end.filter(|_| silent);
            if end.is_some_and(|end| self.port.now() + one > end) {
                break;
            }
            *outcome = match self.read_one(id, address, cell, end) {
                Ok(reply) => Outcome::Fresh(reply),
                Err(ClientError::Port(error)) => return Err(error.into()),
                Err(ClientError::Refused { error, .. }) => Outcome::Refused(error),
                Err(ClientError::AnswerLength { .. }) => Outcome::Damaged,
                Err(_) if self.heard_damage => Outcome::Damaged,
                Err(_) => {
                    silent = true;
                    Outcome::Silent
                }
            };
        }
        Ok(())
    }

    /// Hands a servo a write of its own registers that it holds.
    pub(in crate::bus::dynamixel) fn reg_write_one(
        &mut self,
        id: u8,
        address: u16,
        data: &[u8],
    ) -> Result<Reply, ClientError> {
        let Ok(address) = u8::try_from(address) else {
            return Err(self.refused_address(id));
        };
        self.ask_one(id, &Instruction::RegWrite { address, data }, &mut [], None)
    }

    /// Sends an instruction that is answered without data.
    pub(in crate::bus::dynamixel) fn command_one(
        &mut self,
        id: u8,
        instruction: &Instruction<'_>,
    ) -> Result<Reply, ClientError> {
        self.ask_one(id, instruction, &mut [], None)
    }

    fn refused_address(&self, id: u8) -> ClientError {
        ClientError::Refused {
            id,
            error: handwave_dynamixel::ErrorCode::Access,
        }
    }
}
