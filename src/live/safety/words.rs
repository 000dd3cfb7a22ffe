//! Causes in sentences: servo, joint, time, what was measured, what to do.

use super::{Cause, FaultKind};

/// Names and servo ids of the joints, for messages.
#[derive(Copy, Clone, Debug)]
pub struct Crew<'a> {
    /// Joint names.
    pub joints: &'a [String],
    /// Servo id of each joint; empty where there are none.
    pub ids: &'a [u8],
}

impl Crew<'_> {
    /// Such as `servo 7 (rear_left_hip)`.
    pub fn name(&self, joint: usize) -> String {
        let name = self.joints.get(joint).map_or("?", String::as_str);
        match self.ids.get(joint) {
            Some(id) => format!("servo {id} ({name})"),
            None => format!("joint {name}"),
        }
    }
}

/// What a cause is, as one sentence with advice.
pub fn sentence(cause: &Cause, crew: Crew<'_>) -> String {
    let who = cause.joint.map(|joint| crew.name(joint));
    let what = match (cause.kind, who) {
        (FaultKind::PosesLost, _) => {
            "no poses came for longer than safety.lost_s, and safety.on_lost is \"stop\"".into()
        }
        (FaultKind::NotFinite, _) => "the motion gave no numbers".into(),
        (FaultKind::Overrun, _) => {
            "cycles keep beginning late, and safety.on_overrun is \"stop\"".into()
        }
        (FaultKind::Alert, Some(who)) => format!("{who}: hardware error latched"),
        (FaultKind::Torqueless, Some(who)) => format!("{who}: came back without torque"),
        (kind, Some(who)) => format!("{who}: {}", kind.as_str()),
        (kind, None) => kind.as_str().into(),
    };
    let measured = match cause.kind.measured(cause.value, cause.limit) {
        text if text.is_empty() => text,
        text => format!(": {text}"),
    };
    let mut text = format!(
        "{what}{measured}, at {:.3} s. {}",
        cause.t_s,
        cause.kind.advice()
    );
    if cause.kind.takes_out() {
        text += " (safety.on_servo_fault = \"continue\" plays on without it)";
    }
    text
}
