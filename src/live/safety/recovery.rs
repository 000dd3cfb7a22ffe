//! Servos that fell out are taken back: granted, rebooted where an error is latched, armed, led into the motion.

use super::kind::FaultKind;
use super::state::Signs;
use super::supervisor::{Supervisor, bit, out_of_motion};
use super::verdict::{Change, Request, Seen};
use crate::config::file::{OnServoFault, Rearm};

/// By itself the supervisor grants this many re-arms to a servo,
const AUTO_TRIES: u32 = 3;
/// this long after it fell out, or after the last one, seconds.
pub(super) const AUTO_WAIT_S: f64 = 1.0;
/// A granted re-arm that leads to nothing is forgotten after this long, seconds.
const REARM_AT_MOST_S: f64 = 3.0;

impl Supervisor {
    /// Takes a servo back that fell out, step by step, once that is granted.
    pub(super) fn recover(&mut self, index: usize, seen: &Seen<'_>) -> Option<Request> {
        let joint = &mut self.joints[index];
        if !joint.left_out || self.policy.on_servo_fault == OnServoFault::Stop {
            return None;
        }
        let by_itself = self.policy.rearm == Rearm::Auto
            && joint.tries < AUTO_TRIES
            && seen.t_s >= joint.auto_at_s;
        match joint.granted_s {
            None if seen.rearm || by_itself => {
                joint.granted_s = Some(seen.t_s);
                joint.tries = if seen.rearm { 0 } else { joint.tries + 1 };
                joint.auto_at_s = seen.t_s + REARM_AT_MOST_S + AUTO_WAIT_S;
            }
            None => return None,
            Some(since) if seen.t_s - since > REARM_AT_MOST_S => {
                joint.granted_s = None;
                joint.rebooted = false;
                return None;
            }
            Some(_) => {}
        }
        if joint.rebooted || seen.t_s < self.request_at_s {
            return None;
        }
        if joint.faults & bit(FaultKind::Alert) != 0 {
            joint.rebooted = true;
            return Some(Request::Reboot(index));
        }
        if joint.faults & bit(FaultKind::Torqueless) != 0 {
            return Some(Request::Rearm(index));
        }
        // It has torque and stands where it was left: the cause was seen to.
        self.took_back(index);
        None
    }

    /// The bus did what [`Verdict::request`](super::Verdict::request) asked; or it could not.
    pub fn answered(&mut self, request: Request, done: bool) {
        self.changes.clear();
        match (request, done) {
            (Request::Rearm(index), true) => self.took_back(index),
            (Request::Reboot(_), true) => {}
            (Request::Rearm(index) | Request::Reboot(index), false) => {
                if let Some(joint) = self.joints.get_mut(index) {
                    joint.granted_s = None;
                    joint.rebooted = false;
                }
            }
        }
    }

    fn took_back(&mut self, index: usize) {
        if index >= self.joints.len() {
            return;
        }
        for kind in FaultKind::ALL {
            if bit(kind) & out_of_motion() != 0 {
                self.set(Some(index), kind, false, 0.0, 0.0);
            }
        }
        let joint = &mut self.joints[index];
        joint.left_out = false;
        joint.granted_s = None;
        joint.watch.forget();
        joint.state = joint.state.next(Signs {
            answers: true,
            torque: true,
            rearmed: true,
            ..Signs::default()
        });
        for begins in [true, false] {
            self.changes.push(Change {
                kind: FaultKind::Rearmed,
                joint: Some(index),
                begins,
                value: 0.0,
                limit: 0.0,
            });
        }
    }
}
