//! What supervision asks of the motion: less of it, a stand-still, joints left where they are, and the way back.
//!
//! All of it comes before the envelope, so nothing asked here can make a target jump.

use super::Puppet;
use crate::base::Time;
use crate::motion::{ease, eased_span_s};

/// What supervision asks at present.
#[derive(Clone, Debug, Default)]
pub(super) struct Guidance {
    /// Share of amplitude and speed that motion may use, 0..1.
    pub vigour: f64,
    /// The puppet's time stands still.
    pub hold: bool,
    /// It stood still, and is not yet back at its pace.
    held: bool,
    /// Per joint where it is kept, or from where it is on the way back.
    places: Vec<Option<Place>>,
    /// The pose with those joints replaced.
    asked: Vec<f64>,
}

/// Where a joint is kept.
#[derive(Copy, Clone, Debug)]
struct Place {
    position: f64,
    /// Since when it is on its way back into the motion, and how long that takes.
    release: Option<(Time, f64)>,
}

impl Guidance {
    pub fn new(joints: usize) -> Self {
        Self {
            vigour: 1.0,
            hold: false,
            held: false,
            places: vec![None; joints],
            asked: vec![0.0; joints],
        }
    }

    /// Whether it is by our word that time runs slower, if it does (`slow`) in this step.
    pub fn slowed(&mut self, slow: bool) -> bool {
        self.held = slow && (self.hold || self.held);
        self.held
    }

    /// The pose at `now` with the joints that are kept or on their way back.
    pub fn apply<'a>(&'a mut self, now: Time, pose: &'a [f64]) -> &'a [f64] {
        if self.places.iter().all(Option::is_none) {
            return pose;
        }
        for ((asked, pose), place) in self.asked.iter_mut().zip(pose).zip(&mut self.places) {
            *asked = *pose;
            let Some(kept) = *place else { continue };
            let back = kept.release.map_or(0.0, |(since, seconds)| {
                ease(now.secs_since(since) / seconds.max(1e-9))
            });
            if back >= 1.0 {
                *place = None;
            } else if pose.is_finite() {
                *asked = kept.position + back * (pose - kept.position);
            } else {
                *asked = kept.position;
            }
        }
        &self.asked
    }
}

impl Puppet {
    /// How much of the gestures' amplitude and of the joints' speed motion may use from the next step on,
    /// 0..1. The caller sees to it that it changes smoothly.
    pub fn set_vigour(&mut self, share: f64) {
        self.guidance.vigour = share.clamp(0.0, 1.0);
        self.envelope.set_pace(self.guidance.vigour);
    }

    /// Lets time stand still (eased) while playing, or go on.
    pub fn set_hold(&mut self, hold: bool) {
        self.guidance.hold = hold;
    }

    /// Leaves a joint out of the motion: it goes to `position` (rad), inside its envelope, and stays.
    /// Called again it goes to the new place.
    pub fn leave_out(&mut self, joint: usize, position: f64) {
        if let Some(place) = self.guidance.places.get_mut(joint)
            && position.is_finite()
        {
            *place = Some(Place {
                position,
                release: None,
            });
        }
    }

    /// Leads a joint that was left out back into the motion, eased over the time of the start ramp at least.
    pub fn take_back(&mut self, now: Time, joint: usize) {
        let Some(Some(place)) = self.guidance.places.get(joint) else {
            return;
        };
        if place.release.is_some() {
            return;
        }
        let position = place.position;
        let limit = self.envelope.limits()[joint];
        let way = self.pose[joint] - position;
        let share = super::RAMP_SHARE * self.guidance.vigour.max(0.1);
        let (velocity, acceleration) = (share * limit.velocity, share * limit.acceleration);
        let seconds = eased_span_s(way, velocity, acceleration).max(self.options.ramp_s);
        self.guidance.places[joint] = Some(Place {
            position,
            release: Some((now, seconds)),
        });
    }

    /// Begins anew from where the servos were armed (rad, joint order), at rest, and leads every joint from
    /// there back into the motion; where in its run the puppet is stays as it is.
    pub fn begin_again(&mut self, now: Time, present: &[f64]) {
        self.envelope.start(present);
        self.targets.positions.copy_from_slice(present);
        for (joint, position) in present.iter().enumerate() {
            self.leave_out(joint, *position);
            self.take_back(now, joint);
        }
    }
}
