//! Statuses on their way back: who answers when, in turn or together, and what faults do to them.

use super::chain::Chain;
use super::fault::{FaultKind, Target};
use super::line::AfterSilence;
use super::wire::Pace;
use crate::base::Time;
use crate::bus::dynamixel::model::address;
use handwave_dynamixel::{Crc, ErrorCode, MAX_ID, Status, fast};
use std::time::Duration;

/// Bytes that a truncated reply loses.
const TRUNCATED_BYTES: usize = 3;

impl Chain {
    /// Sync and bulk read: one status after the other.
    pub fn answer_in_turn(&mut self, now: Time, baud_bps: u32) {
        let pace = self.pace(baud_bps);
        let patient = self.options.after_silence == AfterSilence::Wait
            || self
                .fault(Target::Bus, FaultKind::WaitInVain, now)
                .is_some();
        let mut free = now;
        for turn in 0..self.asked.len() {
            let asked = self.asked[turn];
            let mut end = None;
            for index in 0..self.slots.len() {
                if self.slots[index].servo.id() != asked.id || !self.hears(index, now, baud_bps) {
                    continue;
                }
                let begin = self.begin(index, free);
                let servo = &mut self.slots[index].servo;
                servo.advance(begin);
                self.data.clear();
                let error = servo.read_entry(asked.address, asked.length, begin, &mut self.data);
                if let Some(error) = error
                    && self.answers(index, now)
                {
                    end = end.max(Some(self.answer(index, asked.id, error, free, baud_bps)));
                }
            }
            free = match end {
                Some(end) => end,
                None if patient => return,
                None => {
                    let missed = handwave_dynamixel::wire::status(usize::from(asked.length));
                    free + pace.bytes(missed)
                }
            };
        }
    }

    /// Fast reads: one combined status, which ends at the first servo that does not join in.
    pub fn answer_together(&mut self, now: Time, baud_bps: u32) {
        let pace = self.pace(baud_bps);
        let lengths = self.asked.iter().map(|asked| usize::from(asked.length));
        let blocks_len: usize = lengths.map(|length| length + fast::BLOCK_OVERHEAD).sum();
        let blocks_len = u16::try_from(blocks_len).unwrap_or(u16::MAX);
        let mut crc = Crc::new();
        let mut free = now;
        let again = self.happens(Target::Bus, FaultKind::Duplicated, now);
        self.combined.clear();
        for turn in 0..self.asked.len() {
            let asked = self.asked[turn];
            let joins = |index: &usize| {
                let servo = &self.slots[*index].servo;
                servo.id() == asked.id
                    && servo.knows_fast_reads()
                    && self.hears(*index, now, baud_bps)
                    && self.answers(*index, now)
            };
            let Some(index) = (0..self.slots.len()).find(joins) else {
                return;
            };
            let label = self.slots[index].label;
            let mut begin = self.late(label, free);
            if turn == 0 {
                begin = self.begin(index, free);
                begin = self.clutter(begin, pace);
                // The buffer is far longer than the eight bytes.
                let prefix = fast::encode_prefix(&mut self.frame, blocks_len, &mut crc);
                let Ok(prefix) = prefix else { return };
                self.combined.extend_from_slice(prefix);
                begin = self.wire.send(begin, prefix, pace, &mut self.chance);
            } else if pace.baud.is_some() {
                begin = begin + self.options.hop;
            }
            let servo = &mut self.slots[index].servo;
            servo.advance(begin);
            self.data.clear();
            let error = servo.read_entry(asked.address, asked.length, begin, &mut self.data);
            let Some(error) = error else { return };
            let own_id = self.spoken_id(label, asked.id, begin);
            let servo = &self.slots[index].servo;
            let status = Status {
                id: asked.id,
                alert: servo.alert(),
                error,
                params: &[],
            };
            let error_byte = status.error_byte();
            // A servo that cannot read what was asked keeps its place in the frame.
            self.data.resize(usize::from(asked.length), 0);
            let block =
                fast::encode_block(&mut self.frame, error_byte, own_id, &self.data, &mut crc);
            let Ok(mut len) = block.map(|block| block.len()) else {
                return;
            };
            self.damage(label, len, begin);
            let full = len;
            len = self.shortened(label, len, begin);
            let block = &self.frame[..len];
            self.combined.extend_from_slice(block);
            free = self.wire.send(begin, block, pace, &mut self.chance);
            if self.happens(Target::Servo(label), FaultKind::DuplicatedServo, begin) {
                let block = &self.frame[..len];
                free = self.wire.send(free, block, pace, &mut self.chance);
            }
            if len < full {
                return;
            }
        }
        if again {
            self.wire.send(free, &self.combined, pace, &mut self.chance);
        }
    }

    /// When a servo begins to answer if the line is free from `free` on.
    fn begin(&self, index: usize, free: Time) -> Time {
        let slot = &self.slots[index];
        let mut delay = Duration::ZERO;
        if self.options.paced {
            let register = slot.servo.register(address::RETURN_DELAY_TIME) as u8;
            delay = handwave_dynamixel::wire::return_delay(register) + self.options.turnaround;
        }
        self.late(slot.label, free + delay)
    }

    fn late(&self, label: u8, begin: Time) -> Time {
        let late = self.fault(Target::Servo(label), FaultKind::Late, begin);
        begin + Duration::from_micros(late.map_or(0, |ms| (ms * 1000.0) as u64))
    }

    /// Sends a status with the collected data; returns when it has ended.
    pub fn answer(
        &mut self,
        index: usize,
        id: u8,
        error: ErrorCode,
        free: Time,
        baud_bps: u32,
    ) -> Time {
        if !self.answers(index, self.now) {
            return free;
        }
        let pace = self.pace(baud_bps);
        let label = self.slots[index].label;
        let begin = self.begin(index, free);
        let begin = self.clutter(begin, pace);
        let status = Status {
            id: self.spoken_id(label, id, begin),
            alert: self.slots[index].servo.alert(),
            error,
            params: &self.data,
        };
        let Ok(mut len) = status.encode(&mut self.frame).map(|frame| frame.len()) else {
            return free;
        };
        self.damage(label, len, begin);
        len = self.shortened(label, len, begin);
        let frame = &self.frame[..len];
        let mut end = self.wire.send(begin, frame, pace, &mut self.chance);
        let own = self.happens(Target::Servo(label), FaultKind::DuplicatedServo, begin);
        if self.happens(Target::Bus, FaultKind::Duplicated, begin) || own {
            let frame = &self.frame[..len];
            end = self.wire.send(end, frame, pace, &mut self.chance);
        }
        end
    }

    /// What faults put on the line before a reply; returns when the reply can begin.
    fn clutter(&mut self, begin: Time, pace: Pace) -> Time {
        let mut begin = begin;
        if self.happens(Target::Bus, FaultKind::Foreign, begin) {
            let stranger = Status {
                id: MAX_ID,
                alert: false,
                error: ErrorCode::None,
                params: &[],
            };
            if let Ok(bytes) = stranger.encode(&mut self.frame) {
                begin = self.wire.send(begin, bytes, pace, &mut self.chance);
            }
        }
        let noise = self.fault(Target::Bus, FaultKind::Noise, begin);
        for _ in 0..noise.map_or(0, |count| count as usize) {
            let byte = [self.chance.bits() as u8];
            begin = self.wire.send(begin, &byte, pace, &mut self.chance);
        }
        begin
    }

    /// The id that servo `label` answers under instead of its `id`.
    fn spoken_id(&self, label: u8, id: u8, now: Time) -> u8 {
        let wrong = self.fault(Target::Servo(label), FaultKind::WrongId, now);
        wrong.map_or(id, |wrong| wrong as u8)
    }

    /// How many of the `len` bytes of a reply go out.
    fn shortened(&mut self, label: u8, len: usize, now: Time) -> usize {
        let own = self.happens(Target::Servo(label), FaultKind::TruncatedServo, now);
        let bus = self.happens(Target::Bus, FaultKind::Truncated, now);
        match own || bus {
            true => len.saturating_sub(TRUNCATED_BYTES),
            false => len,
        }
    }

    /// Flips one bit of the first `len` bytes of the frame buffer if a fault says so.
    fn damage(&mut self, label: u8, len: usize, begin: Time) {
        let own = self.happens(Target::Servo(label), FaultKind::CorruptServo, begin);
        let bus = self.happens(Target::Bus, FaultKind::CorruptBus, begin);
        if own || bus {
            let bit = self.chance.below(8 * len);
            if let Some(byte) = self.frame.get_mut(bit / 8) {
                *byte ^= 1 << (bit % 8);
            }
        }
        let twin = self.fault(Target::Servo(label), FaultKind::DuplicateId, begin);
        if twin.is_some() {
            // Two that speak at once and say nearly the same: some bytes come through.
            for byte in &mut self.frame[..len] {
                let mask = self.chance.bits();
                *byte ^= (mask as u8) & (mask >> 8) as u8;
            }
        }
    }
}
