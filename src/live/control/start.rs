//! The start: every servo is looked at, armed where it stands, and the puppet begins there.

use super::cycles::{Run, SAMPLES_PER_CYCLE};
use super::outage::Wire;
use super::{ControlOptions, Parts};
use crate::base::{JointState, Time};
use crate::bus::BusError;
use crate::live::safety::Supervisor;
use crate::live::stats::Stats;
use crate::live::stop::StopRequest;

/// Time in the end pose before torque goes off, so that lagging servos arrive, seconds.
const REST_AT_END_S: f64 = 0.3;

impl<'p, 'a> Run<'p, 'a> {
    /// Prepares and arms the servos; `None` when the operator wanted the end before that.
    pub(super) fn start(
        parts: &'p mut Parts<'a>,
        options: &'p ControlOptions,
        stats: &'p mut Stats,
    ) -> Result<Option<Self>, BusError> {
        let joints = parts.bus.joints().len();
        let mut states = vec![JointState::default(); joints];
        let mut supervisor = Supervisor::new(joints, options.policy.clone());
        parts.bus.prepare(&mut states)?;
        supervisor.found(parts.bus.facts());
        if parts.stop.request() != StopRequest::None {
            return Ok(None);
        }
        // Nobody has seen the robot yet: an earlier wish to re-arm is none.
        let _ = parts.stop.take_rearm();
        parts.bus.arm()?;
        supervisor.armed();
        // Not what was read before: a limp joint may have moved until its torque came on.
        let mut armed_at: Vec<f64> = states.iter().map(|s| s.position).collect();
        parts.bus.goals(&mut armed_at);
        parts.puppet.begin(Time::ZERO, &armed_at);
        let start = parts.clock.now();
        (parts.on_start)(start);
        Ok(Some(Run {
            parts,
            options,
            stats,
            supervisor,
            states,
            goals: armed_at,
            left_out: vec![false; joints],
            samples: Vec::with_capacity(SAMPLES_PER_CYCLE),
            start,
            cycle: 0,
            rest_cycles: (REST_AT_END_S * options.rate_hz) as u64,
            input_begun: false,
            wire: Wire::Driven,
        }))
    }

    /// Servos that go on without us: those that have no watchdog of their own.
    pub(super) fn notes(&self) -> Vec<String> {
        let facts = self.parts.bus.facts();
        let told = |id: u8| {
            let name = format!("servo {id} ");
            let of_it = |note: &&String| note.contains(&name) && note.contains("not protected");
            self.parts.bus.notes().iter().any(|note| of_it(&note))
        };
        let names: Vec<String> = facts
            .iter()
            .zip(self.parts.bus.joints())
            .filter(|(facts, _)| facts.watchdog_s.is_none() && !told(facts.id))
            .map(|(facts, joint)| format!("{} ({joint})", facts.id))
            .collect();
        if names.is_empty() {
            return Vec::new();
        }
        vec![format!(
            "no bus watchdog protects servo {}: should this program die, it goes on to its last goal and keeps its \
             torque. Keep the power switch at hand (bus.watchdog_ms = 0 switches watchdogs off; servos of the 330 size \
             have one that does not stop them)",
            names.join(", ")
        )]
    }
}
