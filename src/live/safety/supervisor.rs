//! The supervisor: sees every cycle, says what follows. Pure, and without allocation once it is made.

use super::kind::FaultKind;
use super::recovery::AUTO_WAIT_S;
use super::state::{ServoState, Signs};
use super::verdict::{Cause, Change, Policy, Reaction, Seen, Verdict};
use super::watch::Watch;
use crate::bus::ServoFacts;
use crate::config::file::{OnOverrun, OnServoFault, Rearm};

/// How fast motion is made smaller and grows again, per second.
const VIGOUR_RATE: [f64; 2] = [0.5, 0.1];
/// Share of late cycles (over about a second) at which motion is held, and at which it goes on.
const LATE: [f64; 2] = [0.5, 0.1];
/// The mean of late cycles is over this time, seconds.
const LATE_WINDOW_S: f64 = 1.0;
/// Poses may be no numbers for this long, seconds.
const NOT_FINITE_S: f64 = 0.1;
/// Requests to the bus are this far apart, seconds: each takes some milliseconds of a cycle.
const REQUESTS_APART_S: f64 = 0.1;
/// Between two cycles never more than this counts, seconds.
const LONGEST_STEP_S: f64 = 0.05;

#[derive(Clone, Debug)]
pub(super) struct Joint {
    pub state: ServoState,
    pub watch: Watch,
    /// Faults at present, one bit per kind.
    pub faults: u32,
    pub left_out: bool,
    /// Since when a re-arm is granted.
    pub granted_s: Option<f64>,
    pub rebooted: bool,
    pub tries: u32,
    pub auto_at_s: f64,
}

pub(super) fn bit(kind: FaultKind) -> u32 {
    1 << kind as u32
}

/// Faults that take a servo out of the motion.
pub(super) fn out_of_motion() -> u32 {
    bit(FaultKind::Alert)
        | bit(FaultKind::Torqueless)
        | bit(FaultKind::FollowingError)
        | bit(FaultKind::Stall)
}

/// Sees every cycle of a run.
#[derive(Clone, Debug)]
pub struct Supervisor {
    pub(super) policy: Policy,
    pub(super) joints: Vec<Joint>,
    pub(super) changes: Vec<Change>,
    vigour: f64,
    /// Mean share of late cycles.
    late: f64,
    holds: bool,
    bus_lost: bool,
    not_finite_s: f64,
    gesture_s: f64,
    stopped: bool,
    last_s: f64,
    pub(super) request_at_s: f64,
    cause: Option<Cause>,
}

impl Supervisor {
    /// For a robot of `joints` joints, of which nothing is known yet.
    pub fn new(joints: usize, policy: Policy) -> Self {
        let joint = Joint {
            state: ServoState::Offline,
            watch: Watch::new(&policy.supervision),
            faults: 0,
            left_out: false,
            granted_s: None,
            rebooted: false,
            tries: 0,
            auto_at_s: 0.0,
        };
        Self {
            policy,
            joints: vec![joint; joints],
            changes: Vec::with_capacity((joints + 1) * FaultKind::ALL.len()),
            vigour: 1.0,
            late: 0.0,
            holds: false,
            bus_lost: false,
            not_finite_s: 0.0,
            gesture_s: 0.0,
            stopped: false,
            last_s: 0.0,
            request_at_s: 0.0,
            cause: None,
        }
    }

    /// All servos were found; `facts`: what they say of themselves, as far as they do.
    pub fn found(&mut self, facts: &[ServoFacts]) {
        for (joint, facts) in self.joints.iter_mut().zip(facts) {
            joint.watch.learn(facts, &self.policy.supervision);
        }
        for joint in &mut self.joints {
            joint.state = joint.state.next(Signs {
                answers: true,
                rearmed: true,
                ..Signs::default()
            });
            joint.watch.forget();
        }
    }

    /// Torque is on, all goals where the servos stand: whatever was wrong begins anew.
    pub fn armed(&mut self) {
        self.changes.clear();
        for index in 0..self.joints.len() {
            for kind in FaultKind::ALL {
                self.set(Some(index), kind, false, 0.0, 0.0);
            }
            let joint = &mut self.joints[index];
            joint.state = joint.state.next(Signs {
                answers: true,
                torque: true,
                rearmed: true,
                ..Signs::default()
            });
            joint.left_out = false;
            joint.granted_s = None;
            joint.watch.forget();
        }
        if self.bus_lost {
            self.bus_lost = false;
            self.note(FaultKind::BusLost, false, 0.0);
            self.note(FaultKind::Rearmed, true, 0.0);
            self.note(FaultKind::Rearmed, false, 0.0);
        }
    }

    /// The bus is lost: nobody can be asked or told anything.
    pub fn lost(&mut self) {
        self.changes.clear();
        for joint in &mut self.joints {
            joint.state = joint.state.next(Signs::default());
            joint.watch.forget();
        }
        if !self.bus_lost {
            self.bus_lost = true;
            self.note(FaultKind::BusLost, true, 0.0);
        }
    }

    /// Whether a bus that is back, with torque off, is to be armed now.
    pub fn arms(&self, asked: bool) -> bool {
        asked || self.policy.rearm == Rearm::Auto
    }

    /// One cycle. What began and ended in it is in [`changes`](Self::changes) until the next call.
    pub fn step(&mut self, seen: &Seen<'_>) -> Verdict {
        self.changes.clear();
        let dt_s = (seen.t_s - self.last_s).clamp(0.0, LONGEST_STEP_S);
        self.last_s = seen.t_s;
        let mut share = 1.0_f64;
        let mut request = None;
        for index in 0..self.joints.len() {
            share = share.min(self.look(index, seen, dt_s));
            request = request.or_else(|| self.recover(index, seen));
        }
        let [down, up] = VIGOUR_RATE.map(|rate| rate * dt_s);
        self.vigour += (share - self.vigour).clamp(-down, up);
        self.judge_overruns(seen, dt_s);
        self.judge_motion(seen, dt_s);
        let operator_stop = self.judge_gesture(seen, dt_s);
        if request.is_some() {
            self.request_at_s = seen.t_s + REQUESTS_APART_S;
        }
        let reaction = if seen.targets.iter().any(|t| !t.is_finite()) {
            Reaction::AtOnce
        } else if self.cause.is_some() {
            Reaction::Ease
        } else if operator_stop {
            Reaction::OperatorStop
        } else if self.holds {
            Reaction::Hold
        } else {
            Reaction::GoOn
        };
        Verdict {
            reaction,
            vigour: self.vigour,
            request,
        }
    }

    /// Looks at one servo: faults, state. Returns how much of its motion it can bear.
    fn look(&mut self, index: usize, seen: &Seen<'_>, dt_s: f64) -> f64 {
        let mask = |mask: u64| index < 64 && mask >> index & 1 == 1;
        let silent = mask(seen.report.silent_mask);
        let torqueless = mask(seen.report.torqueless_mask);
        let alert = mask(seen.report.alert_mask);
        let health = seen.health.get(index).copied().unwrap_or_default();
        let (Some(target), Some(state)) = (seen.targets.get(index), seen.states.get(index)) else {
            return 1.0;
        };
        let joint = &mut self.joints[index];
        let away = silent || torqueless || alert || joint.left_out;
        let ramping = mask(seen.report.ramping_mask);
        let follows = !(away || ramping) && joint.faults & out_of_motion() == 0;
        let look = joint.watch.look(
            &self.policy.supervision,
            *target,
            state,
            &health,
            follows,
            dt_s,
        );
        for finding in look.findings {
            // What took a servo out stays until it is taken back.
            let latches = bit(finding.kind) & out_of_motion() != 0;
            if finding.active || !latches {
                self.set(
                    Some(index),
                    finding.kind,
                    finding.active,
                    finding.value,
                    finding.limit,
                );
            }
        }
        if alert {
            self.set(
                Some(index),
                FaultKind::Alert,
                true,
                f64::from(health.hardware_error),
                0.0,
            );
        }
        if torqueless {
            self.set(Some(index), FaultKind::Torqueless, true, 0.0, 0.0);
        }
        let joint = &mut self.joints[index];
        if !silent && !alert && joint.rebooted {
            joint.rebooted = false;
            self.set(Some(index), FaultKind::Alert, false, 0.0, 0.0);
        }
        let joint = &mut self.joints[index];
        let lasting = joint.faults
            & (bit(FaultKind::Alert) | bit(FaultKind::FollowingError) | bit(FaultKind::Stall));
        let rebooting = joint.rebooted && silent;
        let signs = Signs {
            answers: !silent,
            torque: !torqueless,
            still: joint.left_out || joint.watch.is_still(),
            fault: lasting != 0 && !rebooting,
            rearmed: joint.granted_s.is_some(),
        };
        joint.state = joint.state.next(signs);
        if joint.faults & out_of_motion() != 0 && !joint.left_out {
            joint.left_out = true;
            joint.auto_at_s = seen.t_s + AUTO_WAIT_S;
        }
        look.share
    }

    fn judge_overruns(&mut self, seen: &Seen<'_>, dt_s: f64) {
        let late = if seen.late { 1.0 } else { 0.0 };
        self.late += (dt_s / LATE_WINDOW_S).min(1.0) * (late - self.late);
        let held = self.holds;
        let [begins, ends] = LATE;
        self.holds = self.late > if held { ends } else { begins };
        self.holds &= self.policy.on_overrun != OnOverrun::Continue;
        if self.holds != held {
            self.note(FaultKind::Overrun, self.holds, self.late);
            if self.holds && self.policy.on_overrun == OnOverrun::Stop {
                self.blame(FaultKind::Overrun, None, self.late, begins);
            }
        }
    }

    fn judge_motion(&mut self, seen: &Seen<'_>, dt_s: f64) {
        let before = self.not_finite_s;
        self.not_finite_s = if seen.not_finite > 0 {
            before + dt_s
        } else {
            0.0
        };
        if (before > 0.0) != (self.not_finite_s > 0.0) {
            let begins = self.not_finite_s > 0.0;
            self.note(FaultKind::NotFinite, begins, seen.not_finite as f64);
        }
        if self.not_finite_s > NOT_FINITE_S {
            self.blame(FaultKind::NotFinite, None, seen.not_finite as f64, 0.0);
        }
    }

    /// True once when the stop gesture was performed for long enough.
    fn judge_gesture(&mut self, seen: &Seen<'_>, dt_s: f64) -> bool {
        let Some(gesture) = &self.policy.stop_gesture else {
            return false;
        };
        self.gesture_s = if seen.stop_gesture >= gesture.level {
            self.gesture_s + dt_s
        } else {
            0.0
        };
        if self.stopped || self.gesture_s < gesture.hold_s {
            return false;
        }
        self.stopped = true;
        self.note(FaultKind::StopGesture, true, seen.stop_gesture);
        true
    }

    /// Something ends the run that is not the supervisor's finding. The first cause stays.
    pub fn blame(&mut self, kind: FaultKind, joint: Option<usize>, value: f64, limit: f64) {
        let t_s = self.last_s;
        self.cause.get_or_insert(Cause {
            kind,
            joint,
            t_s,
            value,
            limit,
        });
    }

    fn note(&mut self, kind: FaultKind, begins: bool, value: f64) {
        self.changes.push(Change {
            kind,
            joint: None,
            begins,
            value,
            limit: 0.0,
        });
    }

    /// Begins or ends a fault of a servo, or learns its value.
    pub(super) fn set(
        &mut self,
        at: Option<usize>,
        kind: FaultKind,
        active: bool,
        value: f64,
        limit: f64,
    ) {
        let Some(joint) = at.and_then(|index| self.joints.get_mut(index)) else {
            return;
        };
        let was = joint.faults & bit(kind) != 0;
        joint.faults = (joint.faults & !bit(kind)) | if active { bit(kind) } else { 0 };
        // The cause of an alert is often read some cycles after it.
        let learnt = kind == FaultKind::Alert && value > 0.0;
        if was == active && !(active && learnt) {
            return;
        }
        self.changes.push(Change {
            kind,
            joint: at,
            begins: active,
            value,
            limit,
        });
        if active && kind.takes_out() && self.policy.on_servo_fault == OnServoFault::Stop {
            self.blame(kind, at, value, limit);
        }
        if let Some(cause) = &mut self.cause
            && learnt
            && (cause.kind, cause.joint) == (kind, at)
        {
            cause.value = value;
        }
    }

    /// What began and ended since the last call of [`step`](Self::step) and its like.
    pub fn changes(&self) -> &[Change] {
        &self.changes
    }

    /// Why the run is to end, if it is.
    pub fn cause(&self) -> Option<&Cause> {
        self.cause.as_ref()
    }

    /// Whether a joint is left out of the motion.
    pub fn left_out(&self, joint: usize) -> bool {
        self.joints.get(joint).is_some_and(|j| j.left_out)
    }

    /// Whether a joint that is left out has no torque, so that it is where it is pushed to.
    pub fn is_limp(&self, joint: usize) -> bool {
        let limp = bit(FaultKind::Alert) | bit(FaultKind::Torqueless);
        (self.joints.get(joint)).is_some_and(|j| j.faults & limp != 0)
    }

    /// Whether somebody has to ask for a re-arm for a servo to be taken back.
    pub fn waits(&self) -> bool {
        self.joints
            .iter()
            .any(|j| j.left_out && j.granted_s.is_none())
    }

    /// The state of a servo.
    pub fn servo(&self, joint: usize) -> ServoState {
        self.joints
            .get(joint)
            .map_or(ServoState::Offline, |j| j.state)
    }

    /// The state of the robot as a whole.
    pub fn robot(&self) -> ServoState {
        ServoState::of_all(self.joints.iter().map(|j| j.state))
    }

    /// How much of the motion is let through, 0..1.
    pub fn vigour(&self) -> f64 {
        self.vigour
    }
}
