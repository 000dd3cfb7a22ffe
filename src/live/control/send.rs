//! The exchange with the bus: only targets computed in this cycle are sent, and what comes back is judged.

use super::cycles::Run;
use super::outage::Wire;
use crate::base::Time;
use crate::bus::{BusError, CycleReport};
use crate::live::safety::{Reaction, Request, Seen};
use crate::puppet::Stage;
use std::time::Duration;

/// A cycle's targets, just computed: nothing else may be sent, so that what feeds the servos' watchdogs is a puppet
/// that lives.
pub(super) struct Fresh {
    /// Time of the cycle, seconds since the start.
    pub t_s: f64,
    /// The cycle began a period or more after its deadline.
    pub late: bool,
    /// When the newest sample that went into them arrived.
    pub newest_sample_s: Option<f64>,
}

impl Run<'_, '_> {
    /// One exchange, and what supervision makes of it.
    pub(super) fn send(&mut self, fresh: &Fresh) -> Result<(CycleReport, Reaction), BusError> {
        let now = Time::from_secs(fresh.t_s);
        let targets = self.parts.puppet.targets();
        if targets.positions.iter().any(|p| !p.is_finite()) {
            return Ok((CycleReport::default(), Reaction::AtOnce));
        }
        if !matches!(self.wire, Wire::Driven) {
            let report = self.wait_for_bus(now);
            self.stats.bus(fresh.t_s, &report);
            if !matches!(self.wire, Wire::Driven) {
                self.stay_where_found();
            }
            return Ok((report, Reaction::GoOn));
        }
        let report = match self.exchange(fresh) {
            Ok(report) => report,
            Err(error) => {
                self.lose(error)?;
                self.stay_where_found();
                return Ok((CycleReport::default(), Reaction::GoOn));
            }
        };
        self.stats.bus(fresh.t_s, &report);
        let reaction = self.supervise(fresh, &report);
        Ok((report, reaction))
    }

    /// Sends and reads; counts the way from the newest sample to the wire.
    fn exchange(&mut self, fresh: &Fresh) -> Result<CycleReport, BusError> {
        let began = self.parts.clock.now();
        let targets = &self.parts.puppet.targets().positions;
        let report = self.parts.bus.exchange(targets, &mut self.states)?;
        self.stats.latest_pose_to_wire_us = fresh.newest_sample_s.map(|arrived_s| {
            let sent = began + Duration::from_micros(u64::from(report.goal_sent_us));
            ((sent.secs_since(self.start) - arrived_s).max(0.0) * 1e6) as u64
        });
        if let Some(waited_us) = self.stats.latest_pose_to_wire_us {
            self.stats.pose_to_wire.add(waited_us);
        }
        Ok(report)
    }

    /// Shows the supervisor the cycle and carries its verdict out.
    fn supervise(&mut self, fresh: &Fresh, report: &CycleReport) -> Reaction {
        let puppet = &self.parts.puppet;
        let targets = puppet.targets();
        let playing = targets.stage == Stage::Playing;
        let gesture = (self.options.stop_gesture)
            .filter(|_| playing)
            .and_then(|index| puppet.estimates().get(index));
        let verdict = self.supervisor.step(&Seen {
            t_s: fresh.t_s,
            targets: &targets.positions,
            states: &self.states,
            report,
            health: self.parts.bus.health(),
            late: fresh.late,
            not_finite: targets.not_finite,
            rearm: self.parts.stop.take_rearm(),
            stop_gesture: gesture.map_or(0.0, |g| g.amplitude),
        });
        self.note_changes();
        if let Some(request) = verdict.request {
            let done = match request {
                Request::Reboot(joint) => self.parts.bus.reboot(joint),
                Request::Rearm(joint) => self.parts.bus.rearm(joint),
            };
            self.supervisor.answered(request, done.is_ok());
            self.note_changes();
        }
        let now = Time::from_secs(fresh.t_s);
        for joint in 0..self.states.len() {
            let was = self.left_out.get(joint).copied().unwrap_or(false);
            let is = self.supervisor.left_out(joint);
            if is && (!was || self.supervisor.is_limp(joint)) {
                (self.parts.puppet).leave_out(joint, self.states[joint].position);
            } else if was && !is {
                self.parts.puppet.take_back(now, joint);
            }
            if let Some(place) = self.left_out.get_mut(joint) {
                *place = is;
            }
        }
        self.parts.puppet.set_vigour(verdict.vigour);
        (self.parts.puppet).set_hold(verdict.reaction == Reaction::Hold);
        if verdict.reaction == Reaction::OperatorStop {
            self.parts.stop.press();
        }
        verdict.reaction
    }

    /// Puts what began and ended into the timeline.
    pub(super) fn note_changes(&mut self) {
        let t_s = self.t_s();
        for change in self.supervisor.changes() {
            self.stats.change(t_s, change);
        }
    }
}
