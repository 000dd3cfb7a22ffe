//! The control cycle: goals out, states in, and what is done about servos that do not answer.

use super::chain::{DynamixelChain, Link};
use super::client::{ClientError, Outcome};
use super::model::STATE_BYTES;
use super::servo::position_pulse;
use crate::base::{JointState, Time};
use crate::bus::{BusError, CycleReport};
use handwave_dynamixel::wire;
use std::time::Duration;

/// How often servos are asked in one cycle: at first, and again for what damage or silence took along.
const MAX_ROUNDS: u32 = 3;
/// The longest step of time that moves a ramped goal.
const MAX_STEP: Duration = Duration::from_millis(50);

/// The bit of joint `index` in a report; none beyond the first 64.
pub(super) fn bit(index: usize) -> u64 {
    u32::try_from(index)
        .ok()
        .and_then(|index| 1u64.checked_shl(index))
        .unwrap_or(0)
}

impl DynamixelChain {
    pub(super) fn cycle(
        &mut self,
        targets_rad: &[f64],
        states: &mut [JointState],
    ) -> Result<CycleReport, BusError> {
        let begin = self.client.now();
        let before = self.client.traffic();
        let mut report = CycleReport::default();
        if self.watchdogs_may_have_tripped(begin) {
            self.revive_all()?;
        }
        let step = self.last_cycle.map_or(Duration::ZERO, |last| {
            begin.saturating_since(last).min(MAX_STEP)
        });
        if self
            .last_cycle
            .is_none_or(|last| begin.saturating_since(last) >= self.options.lost_after)
        {
            // Silence counts only while somebody asks.
            self.last_heard = begin;
        }
        self.last_cycle = Some(begin);

        self.send_goals(targets_rad, states, step.as_secs_f64())?;
        report.goal_sent_us = micros(self.client.now().saturating_since(begin));
        let read = self.read_states(states, &mut report, begin);
        self.client.set_cycle_end(None);
        read?;
        self.retry_one(begin)?;

        let now = self.client.now();
        if report.fresh > 0 {
            self.last_heard = now;
        }
        self.was_mute = report.fresh == 0;
        for (index, servo) in self.servos.iter().enumerate() {
            match servo.link {
                Link::Torqueless => report.torqueless_mask |= bit(index),
                Link::Ramping => report.ramping_mask |= bit(index),
                Link::Silent | Link::Driven | Link::Resting => {}
            }
        }
        let after = self.client.traffic();
        let bytes = (after.sent - before.sent) + (after.received - before.received);
        report.bytes = u32::try_from(bytes).unwrap_or(u32::MAX);
        report.damaged = u16::try_from(after.damaged - before.damaged).unwrap_or(u16::MAX);
        report.cycle_us = micros(now.saturating_since(begin));
        self.look_after_health(begin, report.alert_mask)?;

        let silence = now.saturating_since(self.last_heard);
        if report.fresh == 0 && silence >= self.options.lost_after && !self.servos.is_empty() {
            return Err(BusError::Lost {
                port: self.client.port_name().into(),
                silence_ms: u32::try_from(silence.as_millis()).unwrap_or(u32::MAX),
            });
        }
        Ok(report)
    }

    /// Reads all servos that are not silent, group by group; asks again for what a silent or damaged one took with it.
    fn read_states(
        &mut self,
        states: &mut [JointState],
        report: &mut CycleReport,
        begin: Time,
    ) -> Result<(), BusError> {
        for servo in &mut self.servos {
            (servo.fresh, servo.mute) = (false, false);
        }
        let end = begin + self.options.cycle_budget;
        for group in 0..self.groups.len() {
            // The groups behind have their turn in the same cycle.
            let behind = self.read_time_behind(group);
            self.client.set_cycle_end(Some(end - behind));
            self.read_group(group, states, report, begin + behind)?;
        }
        self.leave_out_mute(report.fresh);
        for (index, servo) in self.servos.iter().enumerate() {
            if !servo.fresh {
                report.silent = report.silent.saturating_add(1);
                report.silent_mask |= bit(index);
            }
        }
        Ok(())
    }

    /// Wire time of reading the groups behind `group`, once each.
    fn read_time_behind(&self, group: usize) -> Duration {
        let bytes = (group + 1..self.groups.len()).map(|group| {
            let members = self
                .servos
                .iter()
                .filter(|servo| servo.group == group && servo.link != Link::Silent);
            let count = members.count();
            wire::sync_read(count) + self.answer_bytes(count, self.groups[group].fast.first())
        });
        wire::duration(bytes.sum(), self.client.baud())
    }

    fn answer_bytes(&self, servos: usize, fast: bool) -> usize {
        if fast {
            wire::fast_status(servos, STATE_BYTES)
        } else {
            servos * wire::status(STATE_BYTES)
        }
    }

    /// Reads one group in a cycle of which as much time counts as spent as has passed since `begin`.
    fn read_group(
        &mut self,
        group: usize,
        states: &mut [JointState],
        report: &mut CycleReport,
        begin: Time,
    ) -> Result<(), BusError> {
        self.scratch.ids.clear();
        self.scratch.indices.clear();
        for (index, servo) in self.servos.iter().enumerate() {
            if servo.link != Link::Silent && servo.group == group {
                self.scratch.ids.push(servo.spec.id);
                self.scratch.indices.push(index);
            }
        }
        let fresh_before = report.fresh;
        let mut fast = self.groups[group].fast.first();
        let mut fast_was_mute = false;
        let mut asked_ordinary = false;
        for round in 0..MAX_ROUNDS {
            let count = self.scratch.ids.len();
            let answer = self.answer_bytes(count, fast);
            let needed = wire::duration(wire::sync_read(count) + answer, self.client.baud());
            let spent = self.client.now().saturating_since(begin);
            let room = spent + needed <= self.options.cycle_budget;
            if count == 0 || (round > 0 && !room) {
                break;
            }
            self.read_listed(self.groups[group].address, fast)?;
            self.take_states(states, report);
            asked_ordinary |= !fast;
            let fresh = report.fresh - fresh_before;
            let reads = &mut self.groups[group].fast;
            reads.works |= fast && fresh > 0;
            let mut members = self.servos.iter().filter(|servo| servo.group == group);
            if fast && fresh == 0 && members.any(|servo| servo.mute) {
                // Not even the first servo spoke. If fast reads have worked so far, it is silent; else an
                // ordinary read shows whether they are not understood.
                fast_was_mute = true;
                fast = reads.works;
            }
        }
        let fresh = report.fresh - fresh_before;
        let reads = &mut self.groups[group].fast;
        reads.judge(fast_was_mute, asked_ordinary, fresh);
        Ok(())
    }

    fn read_listed(&mut self, address: u16, fast: bool) -> Result<(), BusError> {
        let count = self.scratch.ids.len();
        let scratch = &mut self.scratch;
        let data = &mut scratch.data[..count * STATE_BYTES];
        let outcomes = &mut scratch.outcomes[..count];
        let length = STATE_BYTES as u16;
        let read = if fast {
            self.client
                .fast_sync_read(address, length, &scratch.ids, data, outcomes)
        } else {
            self.client
                .sync_read(address, length, &scratch.ids, data, outcomes)
        };
        read.map_err(port_error)
    }

    /// Moves what is fresh into `states` and keeps in the list who can be asked again.
    fn take_states(&mut self, states: &mut [JointState], report: &mut CycleReport) {
        let now = self.client.now();
        let scratch = &mut self.scratch;
        let (mut kept, mut damaged) = (0, 0);
        for place in 0..scratch.ids.len() {
            let index = scratch.indices[place];
            match scratch.outcomes[place] {
                Outcome::Fresh(reply) => {
                    let begin = place * STATE_BYTES;
                    if let Some((registers, state)) = scratch.data[begin..]
                        .first_chunk::<STATE_BYTES>()
                        .zip(states.get_mut(index))
                    {
                        *state = self.servos[index].spec.state(registers, now);
                        self.servos[index].stands_at(position_pulse(registers));
                    }
                    self.servos[index].fresh = true;
                    report.fresh = report.fresh.saturating_add(1);
                    if reply.alert {
                        report.alert_mask |= bit(index);
                    }
                }
                Outcome::Silent => self.servos[index].mute = true,
                // It is there; asking again brings the same answer.
                Outcome::Refused(_) => {}
                Outcome::Damaged | Outcome::NotReached => {
                    scratch.ids[kept] = scratch.ids[place];
                    scratch.indices[kept] = index;
                    // Who damages its answer each time would take those behind it along again: the damaged
                    // come last, and the first of them, who may have damaged the next, at the very end.
                    scratch.ids[kept - damaged..=kept].rotate_right(1);
                    scratch.indices[kept - damaged..=kept].rotate_right(1);
                    damaged += usize::from(scratch.outcomes[place] == Outcome::Damaged);
                    kept += 1;
                }
            }
        }
        scratch.ids.truncate(kept);
        scratch.indices.truncate(kept);
    }

    /// Takes servos that were mute out of the following cycles.
    ///
    /// If nobody at all answered, the line may have hiccuped: then only in the second such cycle.
    fn leave_out_mute(&mut self, fresh: u16) {
        if fresh == 0 && !self.was_mute {
            return;
        }
        let now = self.client.now();
        for servo in self.servos.iter_mut().filter(|servo| servo.mute) {
            servo.link = Link::Silent;
            // The first time in the next cycle: a single lost answer should not cost a quarter of a second.
            servo.retry_at = now;
            servo.retry_after = self.options.retry_every / 16;
        }
    }
}

/// In the cycle the only failure of a request to many is the port's.
pub(super) fn port_error(error: ClientError) -> BusError {
    match error {
        ClientError::Port(error) => BusError::Port(error),
        other => BusError::Servo {
            id: handwave_dynamixel::BROADCAST_ID,
            joint: String::new(),
            problem: other.to_string(),
            advice: "Split the chain over two buses".into(),
        },
    }
}

fn micros(span: Duration) -> u32 {
    u32::try_from(span.as_micros()).unwrap_or(u32::MAX)
}
