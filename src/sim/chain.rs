//! The servos on the line: who hears an instruction and obeys it, and which faults are in force.

use super::fault::{Chance, FaultError, FaultKind, FaultSpec, Target};
use super::line::LineOptions;
use super::servo::{Ailments, Servo};
use super::thermal::TICK_NANOS;
use super::wire::Wire;
use crate::base::Time;
use crate::bus::dynamixel::model::{address, hardware_error};
use handwave_dynamixel::instruction::Instruction;
use handwave_dynamixel::{BROADCAST_ID, ErrorCode, Frame, MAX_ID, baud, frame};
use std::time::Duration;

/// Room for the longest status: a whole control table, stuffed.
const FRAME_ROOM: usize = 4096;

/// A place on the line.
#[derive(Debug)]
pub(super) struct Slot {
    pub label: u8,
    pub servo: Servo,
    plugged: bool,
}

/// What one servo is asked in a read of several.
#[derive(Copy, Clone, Debug)]
pub(super) struct Asked {
    pub id: u8,
    pub address: u16,
    pub length: u16,
}

/// The servos, the faults and the wire back to the host.
#[derive(Debug)]
pub(super) struct Chain {
    pub options: LineOptions,
    pub wire: Wire,
    pub chance: Chance,
    pub slots: Vec<Slot>,
    faults: Vec<FaultSpec>,
    /// When faults begin or end, ascending, with the fault if it strikes once at that time.
    changes: Vec<(Time, Option<FaultSpec>)>,
    pub now: Time,
    /// Up to when the supply was followed.
    supply_at: Time,
    /// Instructions heard on the line so far.
    pub packets: u64,
    pub data: Vec<u8>,
    pub frame: Vec<u8>,
    /// What a combined status has been so far.
    pub combined: Vec<u8>,
    pub asked: Vec<Asked>,
}

impl Chain {
    pub fn new(options: LineOptions) -> Self {
        Self {
            options,
            wire: Wire::new(options.latency),
            chance: Chance::new(options.seed),
            slots: Vec::new(),
            faults: Vec::new(),
            changes: Vec::new(),
            now: Time::from_nanos(i64::MIN),
            supply_at: Time::ZERO,
            packets: 0,
            data: Vec::with_capacity(FRAME_ROOM),
            frame: vec![0; FRAME_ROOM],
            combined: Vec::with_capacity(FRAME_ROOM),
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
        match fault.target {
            Target::Bus => {}
            Target::Servo(label) if self.slot(label).is_some() => {}
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
        }
        self.faults.push(fault);
        let strikes = fault.kind.is_event().then_some(fault);
        self.changes.push((fault.from.max(self.now), strikes));
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

    pub fn adapter_name(&self, now: Time) -> u32 {
        let over = self.faults.iter().filter_map(|fault| {
            let ended = fault.until.filter(|&until| until <= now)?;
            (fault.kind == FaultKind::Unplugged).then_some((ended, fault.value))
        });
        over.max_by_key(|(ended, _)| *ended)
            .map_or(0, |(_, value)| value as u32)
    }

    pub fn next_change(&self, now: Time) -> Option<Time> {
        let times = self.changes.iter().map(|(time, _)| *time);
        times.filter(|&time| time > now).min()
    }

    /// Moves all servos on to `now`, through every change of faults on the way.
    pub fn advance(&mut self, now: Time) {
        while let Some(&(time, strikes)) = self.changes.first()
            && time <= now
        {
            self.changes.remove(0);
            self.follow_supply(time);
            for index in 0..self.slots.len() {
                let label = self.slots[index].label;
                let pulse_rad = self.slots[index].servo.pulse_rad();
                let ailments = self.ailments(label, pulse_rad, time);
                let servo = &mut self.slots[index].servo;
                servo.advance(time);
                match strikes.filter(|s| s.servo().is_none_or(|struck| struck == label)) {
                    None => {}
                    Some(FaultSpec {
                        kind: FaultKind::TorqueLoss,
                        ..
                    }) => servo.lose_torque(),
                    Some(FaultSpec {
                        kind: FaultKind::WatchdogTrip,
                        ..
                    }) => servo.trip_watchdog(),
                    Some(_) => servo.reboot(time),
                }
                servo.set_ailments(ailments);
            }
            self.wire.loss = self
                .fault(Target::Bus, FaultKind::LostBytes, time)
                .unwrap_or(0.0);
            let late_ms = self.fault(Target::Bus, FaultKind::Latency, time);
            let late = Duration::from_secs_f64(late_ms.unwrap_or(0.0) * 1e-3);
            self.wire.delay = self.options.latency + late;
        }
        self.follow_supply(now);
        for slot in &mut self.slots {
            slot.servo.advance(now);
        }
        self.now = self.now.max(now);
    }

    /// Lets what all servos draw pull the supply down, in ticks on a fixed grid up to `now`.
    fn follow_supply(&mut self, now: Time) {
        let tick = |time: Time| time.nanos().div_euclid(TICK_NANOS);
        if self.slots.is_empty() {
            self.supply_at = self.supply_at.max(now);
        }
        while tick(self.supply_at) < tick(now) {
            self.supply_at = Time::from_nanos((tick(self.supply_at) + 1) * TICK_NANOS);
            let mut drawn_a = 0.0;
            for slot in self.slots.iter_mut().filter(|slot| slot.plugged) {
                slot.servo.advance(self.supply_at);
                drawn_a += slot.servo.supply_current_a();
            }
            for slot in &mut self.slots {
                slot.servo
                    .set_supply_drop(drawn_a * self.options.supply_ohm);
            }
        }
    }

    fn ailments(&self, label: u8, pulse_rad: f64, now: Time) -> Ailments {
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
        let seed = self.options.seed ^ u64::from(label) << 56;
        Ailments {
            hardware_error: bits,
            stuck: active(FaultKind::Stuck).is_some(),
            load: active(FaultKind::HeavyLoad).unwrap_or(0.0),
            duty_limit: active(FaultKind::Slow),
            sag_v: active(FaultKind::Sag).unwrap_or(0.0),
            encoder_jump_rad: active(FaultKind::EncoderJump).unwrap_or(0.0) * pulse_rad,
            noise_pulses: active(FaultKind::EncoderNoise).map(|most| (most, seed)),
            frozen: active(FaultKind::FrozenPosition).is_some(),
            deaf: active(FaultKind::Deaf).is_some(),
            refuses: active(FaultKind::Refuses).map(|code| code as u8),
            watchdog_defect: active(FaultKind::WatchdogDefect).is_some(),
            watchdog_runaway: active(FaultKind::WatchdogRunaway),
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
        self.packets += 1;
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
            Instruction::SyncRead(list) | Instruction::FastSyncRead(list) => {
                for &id in list.ids {
                    self.ask(id, list.address, list.length);
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
            Instruction::SyncRead(_) | Instruction::BulkRead(_) => {
                self.answer_in_turn(now, baud_bps);
            }
            Instruction::FastSyncRead(_) | Instruction::FastBulkRead(_) => {
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

    pub fn hears(&self, index: usize, now: Time, baud_bps: u32) -> bool {
        let slot = &self.slots[index];
        let own = baud::rate(slot.servo.register(address::BAUD_RATE) as u8).unwrap_or(0);
        // The manual tolerates an error below 3 %.
        let same_rate = u64::from(own.abs_diff(baud_bps)) * 100 < u64::from(own) * 3;
        slot.plugged
            && same_rate
            && slot.servo.is_online(now)
            && self
                .fault(Target::Servo(slot.label), FaultKind::Disconnected, now)
                .is_none()
    }

    pub fn answers(&self, index: usize, now: Time) -> bool {
        let label = self.slots[index].label;
        self.fault(Target::Servo(label), FaultKind::Silent, now)
            .is_none()
    }

    pub fn happens(&mut self, target: Target, kind: FaultKind, now: Time) -> bool {
        self.fault(target, kind, now)
            .is_some_and(|probability| self.chance.happens(probability))
    }

    fn execute_one(&mut self, id: u8, instruction: &Instruction, now: Time, baud_bps: u32) {
        for index in 0..self.slots.len() {
            if !self.hears(index, now, baud_bps) {
                continue;
            }
            let servo = &mut self.slots[index].servo;
            let shadowed = servo.register(address::SECONDARY_ID) == u32::from(id) && id <= MAX_ID;
            self.data.clear();
            if servo.id() == id {
                // A write of the id or of the rate is still answered as it was asked, but the
                // return delay is already the new one.
                let error = servo.execute(instruction, false, now, &mut self.data);
                if let Some(error) = error {
                    self.answer(index, id, error, now, baud_bps);
                }
            } else if shadowed {
                // The secondary id obeys without answering.
                servo.execute(instruction, true, now, &mut self.data);
            }
        }
    }

    fn refuse(&mut self, id: u8, error: ErrorCode, now: Time, baud_bps: u32) {
        for index in 0..self.slots.len() {
            let servo = &self.slots[index].servo;
            if servo.id() == id && servo.answers_all() && self.hears(index, now, baud_bps) {
                self.data.clear();
                self.answer(index, id, error, now, baud_bps);
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
                    let error = servo.execute(&Instruction::Ping, true, now, &mut self.data);
                    if let Some(error) = error {
                        end = end.max(self.answer(index, id, error, free, baud_bps));
                    }
                }
            }
            free = end;
        }
    }

    fn write_entry(&mut self, id: u8, address: u16, data: &[u8], now: Time, baud_bps: u32) {
        for index in 0..self.slots.len() {
            let servo = &self.slots[index].servo;
            let meant = servo.id() == id || servo.register(address::SECONDARY_ID) == u32::from(id);
            if meant && self.hears(index, now, baud_bps) {
                self.slots[index].servo.write_entry(address, data);
            }
        }
    }
}
