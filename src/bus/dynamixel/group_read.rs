//! Reads of several servos at once, sync and bulk: ordinary, one status each in turn, and fast, one combined status.

use super::client::{ClientError, Outcome, Reply};
use super::master::{Accepted, FAST_BYTES, Master};
use handwave_dynamixel::fast::{self, Blocks};
use handwave_dynamixel::instruction::{BulkReadEntry, Instruction, SyncRead};
use handwave_dynamixel::lists::encode_bulk_read;
use handwave_dynamixel::{BROADCAST_ID, BufferTooSmall, ErrorCode, Status, wire};
use std::time::Duration;

/// Waking up this much later than asked for, the system had no time for us.
const OVERSLEPT: Duration = Duration::from_micros(300);

/// What is asked of whom.
#[derive(Copy, Clone)]
pub(super) enum Asked<'a> {
    /// The same registers of all.
    Sync(SyncRead<'a>),
    /// Registers of its own of each, an id at most once.
    Bulk(&'a [BulkReadEntry]),
}

impl Asked<'_> {
    fn count(&self) -> usize {
        match self {
            Asked::Sync(list) => list.ids.len(),
            Asked::Bulk(entries) => entries.len(),
        }
    }

    fn id(&self, place: usize) -> u8 {
        match self {
            Asked::Sync(list) => list.ids[place],
            Asked::Bulk(entries) => entries[place].id,
        }
    }

    /// Data bytes of the servo at `place`.
    fn size(&self, place: usize) -> usize {
        match self {
            Asked::Sync(list) => list.length.into(),
            Asked::Bulk(entries) => entries[place].length.into(),
        }
    }

    /// Data bytes of the servos before `place`.
    fn offset(&self, place: usize) -> usize {
        match self {
            Asked::Sync(list) => place * usize::from(list.length),
            Asked::Bulk(entries) => entries[..place].iter().map(|e| usize::from(e.length)).sum(),
        }
    }

    fn position(&self, id: u8) -> Option<usize> {
        (0..self.count()).find(|&place| self.id(place) == id)
    }

    /// Data bytes of the servos from `place` on.
    fn rest(&self, place: usize) -> usize {
        self.offset(self.count()) - self.offset(place)
    }

    /// Bytes of the first `servos` statuses of an ordinary read.
    fn statuses(&self, servos: usize) -> usize {
        servos * wire::status(0) + self.offset(servos)
    }

    /// Bytes of a combined status as far as the first `servos` blocks.
    fn combined(&self, servos: usize) -> usize {
        wire::fast_status(servos, 0) + self.offset(servos)
    }

    /// How many blocks a combined status of `bytes` bytes holds whole.
    fn blocks_in(&self, bytes: usize) -> usize {
        (0..self.count())
            .take_while(|&place| self.combined(place + 1) <= bytes)
            .count()
    }

    /// Bytes of the instruction for `servos` of them.
    fn request(&self, servos: usize) -> usize {
        match self {
            Asked::Sync(_) => wire::sync_read(servos),
            Asked::Bulk(_) => wire::BARE_INSTRUCTION + 5 * servos,
        }
    }

    fn encode<'b>(&self, fast: bool, buf: &'b mut [u8]) -> Result<&'b [u8], BufferTooSmall> {
        match *self {
            Asked::Sync(list) if fast => Instruction::FastSyncRead(list).encode(BROADCAST_ID, buf),
            Asked::Sync(list) => Instruction::SyncRead(list).encode(BROADCAST_ID, buf),
            Asked::Bulk(entries) => encode_bulk_read(buf, fast, entries.iter().copied()),
        }
    }
}

impl Master {
    /// Sync and bulk read: see [`Client::sync_read`](super::Client::sync_read).
    pub(super) fn read_in_turn(
        &mut self,
        asked: Asked<'_>,
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError> {
        outcomes.fill(Outcome::NotReached);
        self.send(|buf| asked.encode(false, buf))?;
        let count = asked.count();
        // The servo whose turn it is.
        let mut turn = 0;
        let mut silence = false;
        while turn < count {
            // Some servos pass over a silent predecessor when its time is over: the wait lasts until
            // the second one behind it had its turn, or its answer would collide with the next request.
            let latest = (turn + 3).min(count);
            let due = self.due(latest as u32, asked.statuses(latest));
            let behind = count - turn - 1;
            let again = asked.request(behind) + behind * wire::status(0) + asked.rest(turn + 1);
            let deadline = self.deadline(due, again);
            let mut heard = turn;
            let bad_crc = self.listener.damage().bad_crc;
            let mut accept = |status: &Status<'_>| {
                let index = asked.position(status.id);
                let Some(index) = index.filter(|&index| outcomes[index] == Outcome::NotReached)
                else {
                    return Accepted::Stranger;
                };
                heard = index;
                let begin = asked.offset(index);
                outcomes[index] = if status.error != ErrorCode::None {
                    Outcome::Refused(status.error)
                } else if let Some(place) = data
                    .get_mut(begin..begin + asked.size(index))
                    .filter(|place| place.len() == status.params.len())
                {
                    place.copy_from_slice(status.params);
                    Outcome::Fresh(Reply {
                        alert: status.alert,
                    })
                } else {
                    Outcome::Damaged
                };
                Accepted::Done
            };
            // All of the rest at once, until it should be there. Only then, with time to spare, what may be
            // late: one that stays silent must not keep the answers behind it waiting.
            let rest = asked.statuses(count) - asked.statuses(turn);
            let whole = self.due(count as u32, asked.statuses(count)) + self.allowance.get();
            let mut answered = self.receive(rest, deadline.min(whole), &mut accept)?;
            if !answered && whole < deadline {
                answered = self.receive(1, deadline, &mut accept)?;
            }
            let missing = if self.listener.damage().bad_crc > bad_crc {
                Outcome::Damaged
            } else {
                Outcome::Silent
            };
            if !answered {
                outcomes[turn] = missing;
                self.missed(due, turn == 0);
                return Ok(());
            }
            for passed in &mut outcomes[turn..heard.max(turn)] {
                if *passed == Outcome::NotReached {
                    *passed = missing;
                }
            }
            silence |= heard > turn;
            turn = turn.max(heard + 1);
            // After a silence, how late the last one is says nothing of the adapter.
            if turn == count && !silence {
                self.arrived(self.due(turn as u32, asked.statuses(turn)));
            }
        }
        Ok(())
    }

    /// Fast sync and fast bulk read: see [`Client::fast_sync_read`](super::Client::fast_sync_read).
    pub(super) fn read_combined(
        &mut self,
        asked: Asked<'_>,
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError> {
        outcomes.fill(Outcome::NotReached);
        let total = asked.combined(asked.count());
        let blocks_len = match u16::try_from(total - fast::PREFIX_LEN) {
            Ok(blocks_len) if total <= FAST_BYTES / 2 => blocks_len,
            _ => return self.read_in_turn(asked, data, outcomes),
        };
        self.send(|buf| asked.encode(true, buf))?;
        let filled = self.receive_combined(asked, total, blocks_len)?;
        let bytes = &self.combined[..filled];
        let Some(begin) = fast::find_prefix(bytes, blocks_len) else {
            self.damaged += filled as u64;
            if let Some(first) = outcomes.first_mut() {
                // Bytes without a prefix: somebody spoke, and it was damaged.
                *first = if filled >= fast::PREFIX_LEN {
                    Outcome::Damaged
                } else {
                    Outcome::Silent
                };
            }
            return Ok(());
        };
        self.damaged += begin as u64;
        let mut blocks = Blocks::new(&bytes[begin..]);
        let mut damaged = false;
        for (index, outcome) in outcomes.iter_mut().enumerate().take(asked.count()) {
            let (begin, size) = (asked.offset(index), asked.size(index));
            match blocks.next_block(asked.id(index), size) {
                Ok(block) if block.error == ErrorCode::None => {
                    if let Some(place) = data.get_mut(begin..begin + size) {
                        place.copy_from_slice(block.data);
                        *outcome = Outcome::Fresh(Reply { alert: block.alert });
                    }
                }
                Ok(block) => *outcome = Outcome::Refused(block.error),
                Err(fast::BlockError::Incomplete { missing }) => {
                    // Bytes of its own, or bytes lost before it: somebody spoke here.
                    let spoke = missing < size + fast::BLOCK_OVERHEAD;
                    self.damaged += u64::from(spoke);
                    *outcome = if spoke || damaged {
                        Outcome::Damaged
                    } else {
                        Outcome::Silent
                    };
                    return Ok(());
                }
                Err(_) => {
                    damaged = true;
                    self.damaged += 1;
                    *outcome = Outcome::Damaged;
                    blocks.skip_block(size);
                }
            }
        }
        Ok(())
    }

    /// Receives a combined status of `total` bytes, or as much of it as comes; returns the bytes received.
    ///
    /// A bad checksum in the middle does not end it: as long as bytes come, the line is not free.
    fn receive_combined(
        &mut self,
        asked: Asked<'_>,
        total: usize,
        blocks_len: u16,
    ) -> Result<usize, ClientError> {
        let servos = asked.count();
        let mut filled = 0;
        loop {
            // Stale bytes in front are no part of the answer.
            let stale = fast::find_prefix(&self.combined[..filled], blocks_len).unwrap_or(0);
            let got = filled - stale;
            if got >= total {
                self.arrived(self.due(1, total));
                return Ok(filled);
            }
            let coming = (asked.blocks_in(got) + 1).min(servos);
            let behind = servos - coming;
            let again = asked.request(behind) + wire::fast_status(behind, 0) + asked.rest(coming);
            let due = self.due(1, asked.combined(coming));
            let deadline = self.deadline(due, again);
            let rest = (total - got).min(FAST_BYTES - filled);
            let place = &mut self.combined[filled..filled + rest];
            let mut count = self.port.read(place, rest, deadline)?;
            if count == 0 && self.port.now() > deadline + OVERSLEPT {
                // This machine stood still, and what was to answer may have stood still with it.
                let grace = self.port.now() + OVERSLEPT;
                count = self.port.read(place, rest, grace)?;
            }
            if count == 0 {
                self.missed(due, filled == 0);
                return Ok(filled);
            }
            filled += count;
            self.received += count as u64;
        }
    }
}
