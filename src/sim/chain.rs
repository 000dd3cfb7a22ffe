//! The servos on the line: who hears an instruction, who answers when, and which faults strike.

use super::fault::{Chance, FaultError, FaultKind, FaultSpec, Target};
use super::line::{AfterSilence, LineOptions};
use super::servo::{Ailments, Servo, hardware_error};
use super::table::addr;
use super::wire::{Pace, Wire};
use crate::base::Time;
use handwave_dynamixel::instruction::Instruction;
use handwave_dynamixel::{BROADCAST_ID, Crc, ErrorCode, Frame, MAX_ID, Status, baud, fast, frame};
use std::time::Duration;

/// Room for the longest status: a whole control table, stuffed.
const FRAME_ROOM: usize = 4096;
/// Bytes that a truncated reply loses.
const TRUNCATED_BYTES: usize = 3;
const ALERT: u8 = 0x80;

/// A place on the line.
#[derive(Debug)]
pub(super) struct Slot {
    label: u8,
    pub servo: Servo,
    plugged: bool,
}

/// What one servo is asked in a read of several.
#[derive(Copy, Clone, Debug)]
struct Asked {
    id: u8,
    address: u16,
    length: u16,
}

/// The servos, the faults and the wire back to the host.
#[derive(Debug)]
pub(super) struct Chain {
    pub options: LineOptions,
    pub wire: Wire,
    pub chance: Chance,
    slots: Vec<Slot>,
    faults: Vec<FaultSpec>,
    /// When faults begin or end, ascending; a label means that this servo reboots.
    changes: Vec<(Time, Option<u8>)>,
    now: Time,
    data: Vec<u8>,
    frame: Vec<u8>,
    asked: Vec<Asked>,
}

impl Chain {
    pub fn new(options: LineOptions) -> Self {
        Self {
            options,
            wire: Wire::new(),
            chance: Chance::new(options.seed),
            slots: Vec::new(),
            faults: Vec::new(),
            changes: Vec::new(),
            now: Time::from_nanos(i64::MIN),
            data: Vec::with_capacity(FRAME_ROOM),
            frame: vec![0; FRAME_ROOM],
            asked: Vec::with_capacity(256),
        }
    }

    pub fn attach(&mut self, label: u8, servo: Servo) {
        self.slots.push(Slot {
            label,
            servo,
            plugged: true,
        });
    }

    pub fn slot(&self, label: u8) -> Option<&Slot> {
        self.slots.iter().find(|slot| slot.label == label)
    }

    pub fn slot_mut(&mut self, label: u8) -> Option<&mut Slot> {
        self.slots.iter_mut().find(|slot| slot.label == label)
    }

    pub fn labels(&self) -> impl Iterator<Item = u8> + '_ {
        self.slots.iter().map(|slot| slot.label)
    }

    pub fn set_plugged(&mut self, label: u8, plugged: bool, now: Time) -> bool {
        let Some(slot) = self.slot_mut(label) else {
            return false;
        };
        if plugged != slot.plugged {
            // Plugging in is powering up, unplugging loses torque and RAM.
            slot.servo.reboot(now);
            slot.plugged = plugged;
        }
        true
    }

    pub fn inject(&mut self, fault: FaultSpec) -> Result<(), FaultError> {
        let label = match fault.target {
            Target::Bus => None,
            Target::Servo(label) if self.slot(label).is_some() => Some(label),
            Target::Servo(label) => {
                let labels: Vec<_> = self.labels().map(|l| l.to_string()).collect();
                return Err(FaultError {
                    spec: format!("{label}:..."),
                    problem: format!(
                        "no servo {label} on this line; there are {}",
                        labels.join(", ")
                    ),
                });
            }
        };
        self.faults.push(fault);
        let reboots = label.filter(|_| fault.kind == FaultKind::Reboot);
        self.changes.push((fault.from.max(self.now), reboots));
        self.changes
            .extend(fault.until.map(|until| (until.max(self.now), None)));
        self.changes.sort_by_key(|(time, _)| *time);
        Ok(())
    }

    /// The value of an active fault; `None` when it is not active.
    pub fn fault(&self, target: Target, kind: FaultKind, now: Time) -> Option<f64> {
        self.faults
            .iter()
            .find(|f| f.kind == kind && f.target == target && f.is_active(now))
            .map(|f| f.value)
    }

    pub fn next_change(&self, now: Time) -> Option<Time> {
        let times = self.changes.iter().map(|(time, _)| *time);
        times.filter(|&time| time > now).min()
    }

    /// Moves all servos on to `now`, through every change of faults on the way.
    pub fn advance(&mut self, now: Time) {
        while let Some(&(time, reboots)) = self.changes.first()
            && time <= now
        {
            self.changes.remove(0);
            for index in 0..self.slots.len() {
                let label = self.slots[index].label;
                let ailments = self.ailments(label, time);
                let servo = &mut self.slots[index].servo;
                servo.advance(time);
                if reboots == Some(label) {
                    servo.reboot(time);
                }
                servo.set_ailments(ailments);
            }
        }
        for slot in &mut self.slots {
            slot.servo.advance(now);
        }
        self.now = self.now.max(now);
    }

    fn ailments(&self, label: u8, now: Time) -> Ailments {
        let active = |kind| self.fault(Target::Servo(label), kind, now);
        let mut bits = 0;
        for (kind, bit) in [
            (FaultKind::Voltage, hardware_error::VOLTAGE),
            (FaultKind::Overheat, hardware_error::OVERHEATING),
            (FaultKind::Encoder, hardware_error::ENCODER),
            (FaultKind::Shock, hardware_error::SHOCK),
            (FaultKind::Overload, hardware_error::OVERLOAD),
        ] {
            if active(kind).is_some() {
                bits |= bit;
            }
        }
        Ailments {
            hardware_error: bits,
            stuck: active(FaultKind::Stuck).is_some(),
            watchdog_defect: active(FaultKind::WatchdogDefect).is_some(),
            temperature_c: active(FaultKind::Overheat),
            voltage_v: active(FaultKind::Voltage),
        }
    }

    /// Lets the servos act on an instruction whose last byte ended at `now`, and answer.
    pub fn obey(&mut self, frame: &Frame, now: Time, baud_bps: u32) {
        self.advance(now);
        if frame.instruction == frame::STATUS {
            return;
        }
        if self.happens(Target::Bus, FaultKind::CorruptBus, now) {
            return;
        }
        for index in 0..self.slots.len() {
            if self.hears(index, now, baud_bps) {
                self.slots[index].servo.heard(now);
            }
        }
        let instruction = match Instruction::parse(frame) {
            Ok(instruction) => instruction,
            Err(refused) => {
                self.refuse(frame.id, refused.error_code(), now, baud_bps);
                return;
            }
        };
        if frame.id != BROADCAST_ID {
            self.execute_one(frame.id, &instruction, now, baud_bps);
            return;
        }
        self.asked.clear();
        match instruction {
            Instruction::Ping => self.ping_all(now, baud_bps),
            Instruction::SyncWrite(list) => {
                for (id, data) in list.iter() {
                    self.write_entry(id, list.address, data, now, baud_bps);
                }
            }
            Instruction::BulkWrite(list) => {
                for entry in list.iter() {
                    self.write_entry(entry.id, entry.address, entry.data, now, baud_bps);
                }
            }
            Instruction::SyncRead {
                address,
                length,
                ids,
            }
            | Instruction::FastSyncRead {
                address,
                length,
                ids,
            } => {
                for &id in ids {
                    self.ask(id, address, length);
                }
            }
            Instruction::BulkRead(list) | Instruction::FastBulkRead(list) => {
                for entry in list.iter() {
                    self.ask(entry.id, entry.address, entry.length);
                }
            }
            single => {
                for index in 0..self.slots.len() {
                    if self.hears(index, now, baud_bps) {
                        self.data.clear();
                        let servo = &mut self.slots[index].servo;
                        servo.execute(&single, true, now, &mut self.data);
                    }
                }
            }
        }
        match instruction {
            Instruction::SyncRead { .. } | Instruction::BulkRead(_) => {
                self.answer_in_turn(now, baud_bps);
            }
            Instruction::FastSyncRead { .. } | Instruction::FastBulkRead(_) => {
                self.answer_together(now, baud_bps);
            }
            _ => {}
        }
    }

    /// Notes an entry of a list; an id counts once.
    fn ask(&mut self, id: u8, address: u16, length: u16) {
        if !self.asked.iter().any(|asked| asked.id == id) {
            self.asked.push(Asked {
                id,
                address,
                length,
            });
        }
    }

    fn hears(&self, index: usize, now: Time, baud_bps: u32) -> bool {
        let slot = &self.slots[index];
        let own = baud::rate(slot.servo.register(addr::BAUD_RATE) as u8).unwrap_or(0);
        // The manual tolerates an error below 3 %.
        let same_rate = u64::from(own.abs_diff(baud_bps)) * 100 < u64::from(own) * 3;
        slot.plugged
            && same_rate
            && slot.servo.is_online(now)
            && self
                .fault(Target::Servo(slot.label), FaultKind::Disconnected, now)
                .is_none()
    }

    fn answers(&self, index: usize, now: Time) -> bool {
        let label = self.slots[index].label;
        self.fault(Target::Servo(label), FaultKind::Silent, now)
            .is_none()
    }

    fn happens(&mut self, target: Target, kind: FaultKind, now: Time) -> bool {
        self.fault(target, kind, now)
            .is_some_and(|probability| self.chance.happens(probability))
    }

    fn execute_one(&mut self, id: u8, instruction: &Instruction, now: Time, baud_bps: u32) {
        for index in 0..self.slots.len() {
            if !self.hears(index, now, baud_bps) {
                continue;
            }
            let servo = &mut self.slots[index].servo;
            let shadowed = servo.register(addr::SHADOW_ID) == u32::from(id) && id <= MAX_ID;
            self.data.clear();
            if servo.id() == id {
                // A write of the id or of the rate is still answered as it was asked, but the
                // return delay is already the new one.
                let code = servo.execute(instruction, false, now, &mut self.data);
                if let Some(code) = code {
                    self.answer(index, id, code, now, baud_bps);
                }
            } else if shadowed {
                // The secondary id obeys without answering.
                servo.execute(instruction, true, now, &mut self.data);
            }
        }
    }

    fn refuse(&mut self, id: u8, code: ErrorCode, now: Time, baud_bps: u32) {
        for index in 0..self.slots.len() {
            let servo = &self.slots[index].servo;
            if servo.id() == id && servo.answers_all() && self.hears(index, now, baud_bps) {
                self.data.clear();
                self.answer(index, id, code.to_byte(), now, baud_bps);
            }
        }
    }

    fn ping_all(&mut self, now: Time, baud_bps: u32) {
        let mut free = now;
        for id in 0..=MAX_ID {
            let mut end = free;
            for index in 0..self.slots.len() {
                if self.slots[index].servo.id() == id && self.hears(index, now, baud_bps) {
                    self.data.clear();
                    let servo = &mut self.slots[index].servo;
                    let code = servo.execute(&Instruction::Ping, true, now, &mut self.data);
                    if let Some(code) = code {
                        end = end.max(self.answer(index, id, code, free, baud_bps));
                    }
                }
            }
            free = end;
        }
    }

    fn write_entry(&mut self, id: u8, address: u16, data: &[u8], now: Time, baud_bps: u32) {
        for index in 0..self.slots.len() {
            let servo = &self.slots[index].servo;
            let meant = servo.id() == id || servo.register(addr::SHADOW_ID) == u32::from(id);
            if meant && self.hears(index, now, baud_bps) {
                self.slots[index].servo.write_entry(address, data);
            }
        }
    }

    /// Sync and bulk read: one status after the other.
    fn answer_in_turn(&mut self, now: Time, baud_bps: u32) {
        let pace = self.pace(baud_bps);
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
                let code = servo.read_entry(asked.address, asked.length, begin, &mut self.data);
                if let Some(code) = code
                    && self.answers(index, now)
                {
                    end = end.max(Some(self.answer(index, asked.id, code, free, baud_bps)));
                }
            }
            free = match (end, self.options.after_silence) {
                (Some(end), _) => end,
                (None, AfterSilence::Wait) => return,
                (None, AfterSilence::Answer) => {
                    let missed = handwave_dynamixel::wire::status(usize::from(asked.length));
                    free + pace.bytes(missed)
                }
            };
        }
    }

    /// Fast reads: one combined status, which ends at the first servo that does not join in.
    fn answer_together(&mut self, now: Time, baud_bps: u32) {
        let pace = self.pace(baud_bps);
        let lengths = self.asked.iter().map(|asked| usize::from(asked.length));
        let blocks_len: usize = lengths.map(|length| length + fast::BLOCK_OVERHEAD).sum();
        let blocks_len = u16::try_from(blocks_len).unwrap_or(u16::MAX);
        let mut crc = Crc::new();
        let mut free = now;
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
                begin = self.wire.send(begin, prefix, pace, &mut self.chance);
            } else if pace.baud.is_some() {
                begin = begin + self.options.hop;
            }
            let servo = &mut self.slots[index].servo;
            servo.advance(begin);
            self.data.clear();
            let code = servo.read_entry(asked.address, asked.length, begin, &mut self.data);
            let Some(code) = code else { return };
            let error_byte = code | if servo.alert() { ALERT } else { 0 };
            // A servo that cannot read what was asked keeps its place in the frame.
            self.data.resize(usize::from(asked.length), 0);
            let block =
                fast::encode_block(&mut self.frame, error_byte, asked.id, &self.data, &mut crc);
            let Ok(mut len) = block.map(|block| block.len()) else {
                return;
            };
            self.damage(label, len, begin);
            let truncated = self.happens(Target::Bus, FaultKind::Truncated, begin);
            if truncated {
                len = len.saturating_sub(TRUNCATED_BYTES);
            }
            let block = &self.frame[..len];
            free = self.wire.send(begin, block, pace, &mut self.chance);
            if truncated {
                return;
            }
        }
    }

    /// When a servo begins to answer if the line is free from `free` on.
    fn begin(&self, index: usize, free: Time) -> Time {
        let slot = &self.slots[index];
        let mut delay = Duration::ZERO;
        if self.options.paced {
            let register = slot.servo.register(addr::RETURN_DELAY_TIME) as u8;
            delay = handwave_dynamixel::wire::return_delay(register) + self.options.turnaround;
        }
        self.late(slot.label, free + delay)
    }

    fn late(&self, label: u8, begin: Time) -> Time {
        let late = self.fault(Target::Servo(label), FaultKind::Late, begin);
        begin + Duration::from_micros(late.map_or(0, |ms| (ms * 1000.0) as u64))
    }

    /// Sends a status with the collected data; returns when it has ended.
    fn answer(&mut self, index: usize, id: u8, code: u8, free: Time, baud_bps: u32) -> Time {
        if !self.answers(index, self.now) {
            return free;
        }
        let pace = self.pace(baud_bps);
        let label = self.slots[index].label;
        let begin = self.begin(index, free);
        let begin = self.clutter(begin, pace);
        let status = Status {
            id,
            alert: self.slots[index].servo.alert(),
            error: ErrorCode::from_byte(code),
            params: &self.data,
        };
        let Ok(mut len) = status.encode(&mut self.frame).map(|frame| frame.len()) else {
            return free;
        };
        self.damage(label, len, begin);
        if self.happens(Target::Bus, FaultKind::Truncated, begin) {
            len = len.saturating_sub(TRUNCATED_BYTES);
        }
        let frame = &self.frame[..len];
        let mut end = self.wire.send(begin, frame, pace, &mut self.chance);
        if self.happens(Target::Bus, FaultKind::Duplicated, begin) {
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
    }
}
