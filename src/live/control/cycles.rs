//! The loop itself: waits for the deadline, steps the puppet, sends, records.

use super::outage::Wire;
use super::send::Fresh;
use super::{ControlOptions, Ending, Parts};
use crate::base::{JointState, Time};
use crate::bus::{BusError, CycleReport};
use crate::live::safety::{Cause, FaultKind, Reaction, Supervisor};
use crate::live::stats::Stats;
use crate::live::stop::StopRequest;
use crate::pose::PoseSample;
use crate::puppet::{Inputs, Stage};
use std::time::{Duration, Instant};

/// Time missed beyond this is not caught up: motion goes on from where it stood. More in one goal would
/// be a jump for the servo.
const CATCH_UP_AT_MOST_S: f64 = 0.02;
/// Most samples handed to one cycle.
pub(super) const SAMPLES_PER_CYCLE: usize = 64;

/// A run from its first cycle on.
pub(super) struct Run<'p, 'a> {
    pub parts: &'p mut Parts<'a>,
    pub options: &'p ControlOptions,
    pub stats: &'p mut Stats,
    pub supervisor: Supervisor,
    pub states: Vec<JointState>,
    /// Where the goals stood when servos were armed.
    pub goals: Vec<f64>,
    /// Joints that are left out of the motion at present.
    pub left_out: Vec<bool>,
    pub samples: Vec<PoseSample>,
    pub start: Time,
    pub cycle: i64,
    pub rest_cycles: u64,
    pub input_begun: bool,
    pub wire: Wire,
}

impl Run<'_, '_> {
    /// Time of the cycle, seconds since the start of the run.
    pub(super) fn t_s(&self) -> f64 {
        self.cycle as f64 / self.options.rate_hz
    }

    /// Goes on until the end pose was held for a while, or something stops it at once.
    pub(super) fn cycles(mut self) -> Result<Ending, BusError> {
        let dt_s = 1.0 / self.options.rate_hz;
        loop {
            let deadline = self.start + Duration::from_secs_f64(self.cycle as f64 * dt_s);
            self.parts.clock.sleep_until(deadline);
            let late_s = self.parts.clock.now().secs_since(deadline).max(0.0);
            self.stats.lateness.add((late_s * 1e6) as u64);
            let mut behind = (late_s / dt_s) as i64;
            let late = behind > 0;
            self.stats.overruns += behind as u64;
            if behind as f64 * dt_s > CATCH_UP_AT_MOST_S {
                self.start = self.start + Duration::from_secs_f64(behind as f64 * dt_s);
                behind = 0;
            }
            let next = deadline + Duration::from_secs_f64((behind + 1) as f64 * dt_s);
            // Missed cycles are computed, so that motion has no gap in time; only the last one is sent.
            let mut newest_sample_s = None;
            let last = self.cycle + behind;
            while self.cycle <= last {
                let t_s = self.t_s();
                if self.parts.stop.request() == StopRequest::AtOnce {
                    return Ok(self.ending(None));
                }
                let step_us = self.step(t_s, &mut newest_sample_s);
                let mut report = CycleReport::default();
                if self.cycle == last {
                    let fresh = Fresh {
                        t_s,
                        late,
                        newest_sample_s,
                    };
                    let reaction;
                    (report, reaction) = self.send(&fresh)?;
                    if reaction == Reaction::AtOnce {
                        return Ok(self.ending(Some(Cause {
                            kind: FaultKind::NotFinite,
                            joint: None,
                            t_s,
                            value: 0.0,
                            limit: 0.0,
                        })));
                    }
                    self.stats.missed += u64::from(self.parts.clock.now() > next);
                }
                self.record(t_s, report, late_s, step_us, self.cycle == last);
                let stage = self.parts.puppet.stage();
                if stage == Stage::Playing && !self.input_begun {
                    self.parts.feed.begin(t_s + dt_s);
                    self.input_begun = true;
                }
                if stage == Stage::Done {
                    self.rest_cycles = self.rest_cycles.saturating_sub(1);
                }
                if self.stops_while_lost() {
                    return Ok(self.ending(None));
                }
                self.cycle += 1;
            }
            if self.rest_cycles == 0 {
                return Ok(self.ending(None));
            }
        }
    }

    /// Computes one cycle; returns how long that took, microseconds.
    fn step(&mut self, t_s: f64, newest_sample_s: &mut Option<f64>) -> u64 {
        let parts = &mut *self.parts;
        parts.feed.take(t_s, &mut self.samples);
        self.stats.samples += self.samples.len() as u64;
        if let Some(handover) = &mut parts.handover {
            handover.cycle(parts.puppet, &self.samples);
        }
        *newest_sample_s = self.samples.last().map(|s| s.t).or(*newest_sample_s);
        let finish = self.supervisor.cause().is_some()
            || parts.stop.request() == StopRequest::Orderly
            || parts.feed.ended()
            || self.options.duration_s.is_some_and(|d| t_s >= d);
        let inputs = Inputs {
            samples: &self.samples,
            states: &self.states,
            finish,
        };
        let before = Instant::now();
        let targets = parts.puppet.step(Time::from_secs(t_s), &inputs);
        let step_us = before.elapsed().as_micros() as u64;
        self.stats.step.add(step_us);
        self.stats.cycles += 1;
        self.stats.held_back += u64::from(targets.held_back > 0);
        self.stats.poses_lost += u64::from(targets.poses_lost);
        if !finish && targets.stage == Stage::Settling {
            // Nobody asked for the end, so the puppet gave up by itself.
            self.supervisor.blame(FaultKind::PosesLost, None, 0.0, 0.0);
        }
        parts.feed.give_back(&mut self.samples);
        step_us
    }

    fn record(&mut self, t_s: f64, report: CycleReport, late_s: f64, step_us: u64, sent: bool) {
        let waits = self.waits();
        let Some(record) = self.parts.recorder.slot() else {
            return;
        };
        record.fill(self.parts.puppet, &self.states);
        record.t_s = t_s;
        record.bus = report;
        record.late_us = (late_s * 1e6) as u64;
        record.step_us = step_us;
        record.overruns = self.stats.overruns;
        record.missed = self.stats.missed;
        record.pose_to_wire_us = self.stats.latest_pose_to_wire_us.filter(|_| sent);
        record.fill_health(self.parts.bus.health());
        record.robot = self.supervisor.robot();
        record.vigour = self.supervisor.vigour();
        record.waits = waits;
        self.parts.recorder.commit();
    }
}
