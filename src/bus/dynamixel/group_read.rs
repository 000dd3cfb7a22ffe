//! Reads of several servos at once: ordinary, one status each in turn, and fast, one combined status.

use super::client::{ClientError, Outcome, Reply};
use super::master::{Accepted, FAST_BYTES, Master};
use handwave_dynamixel::fast::{self, Blocks};
use handwave_dynamixel::instruction::{Instruction, SyncRead};
use handwave_dynamixel::{BROADCAST_ID, ErrorCode, wire};

impl Master {
    /// Sync read: see [`Client::sync_read`](super::Client::sync_read).
    pub(super) fn read_in_turn(
        &mut self,
        address: u16,
        length: u16,
        ids: &[u8],
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError> {
        outcomes.fill(Outcome::NotReached);
        let request = Instruction::SyncRead(SyncRead {
            address,
            length,
            ids,
        });
        self.send(|buf| request.encode(BROADCAST_ID, buf))?;
        let size = usize::from(length);
        let answer_bytes = wire::status(size);
        // The servo whose turn it is.
        let mut turn = 0;
        while turn < ids.len() {
            // Some servos pass over a silent predecessor when its time is over: the wait lasts until
            // the second one behind it had its turn, or its answer would collide with the next request.
            let latest = (turn + 3).min(ids.len());
            let due = self.due(latest as u32, latest * answer_bytes);
            let behind = ids.len() - turn - 1;
            let deadline = self.deadline(due, behind, behind * answer_bytes);
            let want = (ids.len() - turn) * answer_bytes;
            let mut heard = turn;
            let bad_crc = self.parser.damage().bad_crc;
            let answered = self.receive(want, deadline, |status| {
                let index = ids.iter().position(|&id| id == status.id);
                let Some(index) = index.filter(|&index| outcomes[index] == Outcome::NotReached)
                else {
                    return Accepted::Stranger;
                };
                heard = index;
                outcomes[index] = if status.error != ErrorCode::None {
                    Outcome::Refused(status.error)
                } else if let Some(place) = data
                    .get_mut(index * size..(index + 1) * size)
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
            })?;
            let missing = if self.parser.damage().bad_crc > bad_crc {
                Outcome::Damaged
            } else {
                Outcome::Silent
            };
            if !answered {
                outcomes[turn] = missing;
                self.allowance.missed(turn == 0);
                return Ok(());
            }
            for passed in &mut outcomes[turn..heard.max(turn)] {
                if *passed == Outcome::NotReached {
                    *passed = missing;
                }
            }
            turn = turn.max(heard + 1);
            if turn == ids.len() {
                self.arrived(self.due(turn as u32, turn * answer_bytes));
            }
        }
        Ok(())
    }

    /// Fast sync read: see [`Client::fast_sync_read`](super::Client::fast_sync_read).
    pub(super) fn read_combined(
        &mut self,
        address: u16,
        length: u16,
        ids: &[u8],
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError> {
        outcomes.fill(Outcome::NotReached);
        let size = usize::from(length);
        let total = wire::fast_status(ids.len(), size);
        let blocks_len = match u16::try_from(total - fast::PREFIX_LEN) {
            Ok(blocks_len) if total <= FAST_BYTES / 2 => blocks_len,
            _ => return self.read_in_turn(address, length, ids, data, outcomes),
        };
        let request = Instruction::FastSyncRead(SyncRead {
            address,
            length,
            ids,
        });
        self.send(|buf| request.encode(BROADCAST_ID, buf))?;
        let filled = self.receive_combined(total, blocks_len, ids.len(), size)?;
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
        for (index, &id) in ids.iter().enumerate() {
            match blocks.next_block(id, size) {
                Ok(block) if block.error == ErrorCode::None => {
                    if let Some(place) = data.get_mut(index * size..(index + 1) * size) {
                        place.copy_from_slice(block.data);
                        outcomes[index] = Outcome::Fresh(Reply { alert: block.alert });
                    }
                }
                Ok(block) => outcomes[index] = Outcome::Refused(block.error),
                Err(fast::BlockError::Incomplete { missing }) => {
                    // Bytes of its own, or bytes lost before it: somebody spoke here.
                    let spoke = missing < size + fast::BLOCK_OVERHEAD;
                    self.damaged += u64::from(spoke);
                    outcomes[index] = if spoke || damaged {
                        Outcome::Damaged
                    } else {
                        Outcome::Silent
                    };
                    return Ok(());
                }
                Err(_) => {
                    damaged = true;
                    self.damaged += 1;
                    outcomes[index] = Outcome::Damaged;
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
        total: usize,
        blocks_len: u16,
        servos: usize,
        size: usize,
    ) -> Result<usize, ClientError> {
        let block = size + fast::BLOCK_OVERHEAD;
        let mut filled = 0;
        loop {
            // Stale bytes in front are no part of the answer.
            let stale = fast::find_prefix(&self.combined[..filled], blocks_len).unwrap_or(0);
            let got = filled - stale;
            if got >= total {
                self.arrived(self.due(1, total));
                return Ok(filled);
            }
            let whole_blocks = got.saturating_sub(fast::PREFIX_LEN) / block;
            let next = wire::fast_status((whole_blocks + 1).min(servos), size);
            let behind = servos.saturating_sub(whole_blocks + 1);
            // Where not even the first servo speaks, the others are asked again one by one.
            let again = if whole_blocks == 0 {
                behind * wire::status(size)
            } else {
                wire::fast_status(behind, size)
            };
            let deadline = self.deadline(self.due(1, next), behind, again);
            let rest = (total - got).min(FAST_BYTES - filled);
            let place = &mut self.combined[filled..filled + rest];
            let count = self.port.read(place, rest, deadline)?;
            if count == 0 {
                self.allowance.missed(filled == 0);
                return Ok(filled);
            }
            filled += count;
            self.received += count as u64;
        }
    }
}
