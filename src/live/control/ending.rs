//! How a run ends: torque off on every way out, read back; the reason in words.

use super::cycles::Run;
use super::{ControlOptions, Ending, Outcome, Parts};
use crate::live::safety::{Cause, Crew, sentence};
use crate::live::stats::Stats;
use crate::live::stop::StopRequest;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs from a safe start to the declared end. Torque is switched off on every way out but an
/// orderly end with `torque_off_at_end` unset; that includes a panic of the step.
pub fn run(mut parts: Parts<'_>, options: &ControlOptions) -> Outcome {
    let mut stats = Stats::default();
    let mut notes = Vec::new();
    let caught = catch_unwind(AssertUnwindSafe(|| {
        let Some(run) = Run::start(&mut parts, options, &mut stats)? else {
            return Ok(Ending::Interrupted);
        };
        notes = run.notes();
        run.cycles()
    }));
    let ending = match caught {
        Ok(Ok(ending)) => ending,
        Ok(Err(error)) => Ending::Bus(error),
        Err(_) => Ending::SafetyStop(
            "an internal error stopped the control loop (its message is above); please report it"
                .into(),
        ),
    };
    let keep_torque = matches!(ending, Ending::Complete) && !options.torque_off_at_end;
    let torque = if keep_torque {
        None
    } else {
        Some(parts.bus.torque_off())
    };
    Outcome {
        ending,
        stats,
        torque,
        notes,
    }
}

impl Run<'_, '_> {
    /// The ending of a run that came to its end pose, or was stopped at once for `cause`.
    pub(super) fn ending(&mut self, cause: Option<Cause>) -> Ending {
        if let Some(error) = self.outage_error() {
            return Ending::Bus(error);
        }
        if let Some(cause) = cause.or_else(|| self.supervisor.cause().copied()) {
            let crew = Crew {
                joints: self.parts.bus.joints(),
                ids: &self.options.ids,
            };
            return Ending::SafetyStop(sentence(&cause, crew));
        }
        if self.parts.stop.request() == StopRequest::None {
            Ending::Complete
        } else {
            Ending::Interrupted
        }
    }
}
