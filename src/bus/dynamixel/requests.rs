//! What a [`Master`] can be asked: the instructions of Protocol 2.0; those of 1.0 are in [`one`](super::one).

use super::client::{Client, ClientError, Outcome, Ping, Reply, Traffic};
use super::group_read::Asked;
use super::master::{Accepted, Master, Speaks};
use super::model::Protocol;
use crate::base::Time;
use handwave_dynamixel::instruction::{
    Backup, BulkReadEntry, BulkWriteEntry, FactoryReset, SyncRead,
};
use handwave_dynamixel::lists::{encode_bulk_write, encode_sync_write};
use handwave_dynamixel::p1 as one;
use handwave_dynamixel::{BROADCAST_ID, Instruction, MAX_ID, wire};
use std::time::Duration;

/// What a host has to wait per possible id after a broadcast ping, beside the answers' wire time.
const PING_SLOT: Duration = Duration::from_millis(3);

fn ping_reply(id: u8, alert: bool, params: &[u8]) -> Option<Ping> {
    match *params {
        [low, high, firmware] => Some(Ping {
            id,
            model: u16::from_le_bytes([low, high]),
            firmware,
            alert,
        }),
        _ => None,
    }
}

impl Master {
    pub(super) fn ping_two(&mut self, id: u8) -> Result<Ping, ClientError> {
        self.send(|buf| Instruction::Ping.encode(id, buf))?;
        let mut params = [0; 3];
        let reply = self.answer(id, &mut params)?;
        Ok(Ping {
            id,
            model: u16::from_le_bytes([params[0], params[1]]),
            firmware: params[2],
            alert: reply.alert,
        })
    }

    fn ping_all_two(&mut self, found: &mut dyn FnMut(Ping)) -> Result<(), ClientError> {
        self.send(|buf| Instruction::Ping.encode(BROADCAST_ID, buf))?;
        let ids = u32::from(MAX_ID) + 1;
        let deadline = self.line_free_at
            + (PING_SLOT + self.wire_time(wire::PING_STATUS)) * ids
            + self.allowance.max();
        self.receive(wire::PING_STATUS, deadline, |status| {
            match ping_reply(status.id, status.alert, status.params) {
                Some(ping) => {
                    found(ping);
                    Accepted::More
                }
                None => Accepted::Stranger,
            }
        })?;
        Ok(())
    }

    /// Of a list, what its first servo speaks: the servos of a chain speak the same.
    fn is_list_one(&mut self, ids: &[u8]) -> Result<bool, ClientError> {
        ids.first().map_or(Ok(false), |&id| self.is_one(id))
    }

    fn only_two(&mut self, id: u8, what: &'static str) -> Result<(), ClientError> {
        if self.is_one(id)? {
            return Err(ClientError::NotInProtocolOne { id, what });
        }
        Ok(())
    }
}

impl Client for Master {
    fn port_name(&self) -> &str {
        self.port.name()
    }

    fn baud(&self) -> u32 {
        self.port.baud()
    }

    fn set_baud(&mut self, baud: u32) -> Result<(), ClientError> {
        Ok(self.port.set_baud(baud)?)
    }

    fn now(&self) -> Time {
        self.port.now()
    }

    fn traffic(&self) -> Traffic {
        Traffic {
            sent: self.sent,
            received: self.received,
            damaged: self.damaged + self.listener.waste(),
        }
    }

    fn set_return_delay(&mut self, delay: Duration) {
        self.return_delay = delay;
    }

    fn patience(&self) -> Duration {
        self.return_delay + self.allowance.get()
    }

    fn lateness(&self) -> Duration {
        self.return_delay + self.allowance.typical()
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn port_candidates(&self) -> Vec<String> {
        self.port.candidates()
    }

    fn port_sought(&self) -> String {
        self.port.sought()
    }

    fn reopen_port(&mut self, name: &str) -> Result<(), ClientError> {
        self.port.reopen(name)?;
        self.listener.clear();
        self.may_hold_stale = true;
        self.missed_due = None;
        self.line_free_at = self.port.now();
        self.allowance.begin_anew();
        Ok(())
    }

    fn close_port(&mut self) {
        self.port.close();
    }

    fn set_cycle_end(&mut self, end: Option<Time>) {
        self.cycle_end = end;
    }

    fn settle(&mut self, quiet: Duration) -> Result<(), ClientError> {
        let end = self.port.now() + quiet * 10;
        let mut late = [0; 256];
        loop {
            let deadline = end.min(self.port.now() + quiet);
            let count = self.port.read(&mut late, 1, deadline)?;
            self.damaged += count as u64;
            if let Some(due) = self.missed_due.take_if(|_| count > 0) {
                let lateness = self.port.now().saturating_since(due);
                self.allowance.came_late(lateness);
            }
            if count == 0 || self.port.now() >= end {
                return Ok(());
            }
        }
    }

    fn ping(&mut self, id: u8) -> Result<Ping, ClientError> {
        match self.speaks {
            Speaks::Only(Protocol::Two) => self.ping_two(id),
            Speaks::Only(Protocol::One) => self.ping_one(id),
            Speaks::Either => self.ping_either(id).map(|(ping, _)| ping),
        }
    }

    fn ping_all(&mut self, found: &mut dyn FnMut(Ping)) -> Result<(), ClientError> {
        if self.speaks != Speaks::Only(Protocol::One) {
            let mut two = [false; 256];
            self.ping_all_two(&mut |ping| {
                two[usize::from(ping.id)] = true;
                found(ping);
            })?;
            self.speak_two_to(&two);
        }
        match self.speaks {
            Speaks::Only(Protocol::Two) => Ok(()),
            Speaks::Only(Protocol::One) | Speaks::Either => self.ping_all_one(found),
        }
    }

    fn read(&mut self, id: u8, address: u16, data: &mut [u8]) -> Result<Reply, ClientError> {
        if self.is_one(id)? {
            return self.read_one(id, address, data, None);
        }
        let length = u16::try_from(data.len()).unwrap_or(u16::MAX);
        self.send(|buf| Instruction::Read { address, length }.encode(id, buf))?;
        self.answer(id, data)
    }

    fn read_by(
        &mut self,
        id: u8,
        address: u16,
        data: &mut [u8],
        latest: Time,
    ) -> Result<Reply, ClientError> {
        if self.is_one(id)? {
            return self.read_one(id, address, data, Some(latest));
        }
        let length = u16::try_from(data.len()).unwrap_or(u16::MAX);
        self.send(|buf| Instruction::Read { address, length }.encode(id, buf))?;
        self.answer_by(id, data, Some(latest))
    }

    fn write(&mut self, id: u8, address: u16, data: &[u8]) -> Result<Reply, ClientError> {
        if self.is_one(id)? {
            return self.write_one(id, address, data);
        }
        self.command(id, &Instruction::Write { address, data })
    }

    fn reboot(&mut self, id: u8) -> Result<Reply, ClientError> {
        self.only_two(
            id,
            "restart it by an instruction: switch its power off and on",
        )?;
        self.command(id, &Instruction::Reboot)
    }

    fn reg_write(&mut self, id: u8, address: u16, data: &[u8]) -> Result<Reply, ClientError> {
        if self.is_one(id)? {
            return self.reg_write_one(id, address, data);
        }
        self.command(id, &Instruction::RegWrite { address, data })
    }

    fn action(&mut self, id: u8) -> Result<Reply, ClientError> {
        if self.is_one(id)? {
            return self.command_one(id, &one::Instruction::Action);
        }
        self.command(id, &Instruction::Action)
    }

    fn clear_multi_turn(&mut self, id: u8) -> Result<Reply, ClientError> {
        self.only_two(id, "clear its turns")?;
        self.command(id, &Instruction::ClearMultiTurn)
    }

    fn back_up(&mut self, id: u8, what: Backup) -> Result<Reply, ClientError> {
        self.only_two(id, "keep a copy of its control table")?;
        self.command(id, &Instruction::Backup(what))
    }

    fn factory_reset(&mut self, id: u8, what: FactoryReset) -> Result<Reply, ClientError> {
        if self.is_one(id)? {
            return match what {
                FactoryReset::All => self.command_one(id, &one::Instruction::FactoryReset),
                _ => Err(ClientError::NotInProtocolOne {
                    id,
                    what: "keep its id or rate in a factory reset; it can reset all, and is id 1 at 1000000 baud then",
                }),
            };
        }
        self.command(id, &Instruction::FactoryReset(what))
    }

    fn sync_write(
        &mut self,
        address: u16,
        length: u16,
        ids: &[u8],
        data: &[u8],
    ) -> Result<(), ClientError> {
        if self.is_list_one(ids)? {
            return self.sync_write_one(address, length, ids, data);
        }
        let size = usize::from(length).max(1);
        let items = ids.iter().copied().zip(data.chunks(size));
        self.send(|buf| encode_sync_write(buf, address, length, items))?;
        self.may_hold_stale = false;
        Ok(())
    }

    fn bulk_write(&mut self, entries: &[BulkWriteEntry<'_>]) -> Result<(), ClientError> {
        once_each(entries.iter().map(|entry| entry.id))?;
        self.send(|buf| encode_bulk_write(buf, entries.iter().copied()))?;
        self.may_hold_stale = false;
        Ok(())
    }

    fn sync_read(
        &mut self,
        address: u16,
        length: u16,
        ids: &[u8],
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError> {
        if self.is_list_one(ids)? {
            return self.sync_read_one(address, length, ids, data, outcomes);
        }
        let list = SyncRead {
            address,
            length,
            ids,
        };
        self.read_in_turn(Asked::Sync(list), data, outcomes)
    }

    fn fast_sync_read(
        &mut self,
        address: u16,
        length: u16,
        ids: &[u8],
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError> {
        if self.is_list_one(ids)? {
            return self.sync_read_one(address, length, ids, data, outcomes);
        }
        let list = SyncRead {
            address,
            length,
            ids,
        };
        self.read_combined(Asked::Sync(list), data, outcomes)
    }

    fn bulk_read(
        &mut self,
        entries: &[BulkReadEntry],
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError> {
        once_each(entries.iter().map(|entry| entry.id))?;
        self.read_in_turn(Asked::Bulk(entries), data, outcomes)
    }

    fn fast_bulk_read(
        &mut self,
        entries: &[BulkReadEntry],
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError> {
        once_each(entries.iter().map(|entry| entry.id))?;
        self.read_combined(Asked::Bulk(entries), data, outcomes)
    }
}

/// A servo acts on its first entry of a bulk instruction only, and waits in vain for its second turn.
fn once_each(ids: impl Iterator<Item = u8>) -> Result<(), ClientError> {
    let mut seen = [false; 256];
    for id in ids {
        if std::mem::replace(&mut seen[usize::from(id)], true) {
            return Err(ClientError::TwiceInList { id });
        }
    }
    Ok(())
}
