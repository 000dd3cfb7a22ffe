//! The guard: targets that would bring links too near are not followed; the robot brakes and stays.

use super::{CollisionModel, Nearest, Scratch};
use crate::robot::envelope::Envelope;
use crate::robot::guard::Guard;
use std::sync::Arc;

/// A pair counts as nearer than before from this difference on, metres.
const NEARER_M: f64 = 1e-7;
/// Braking to a stand-still is followed at most so many steps.
const STEPS: usize = 2000;
/// A joint that moves less in a step has come to rest, rad.
const STILL_RAD: f64 = 1e-9;

/// Stops targets that would bring links too near each other or to a keep-out box.
///
/// A step is let through when the robot, should it brake from there within the limits of the envelope, comes to rest
/// with every pair at least the margin apart, or no nearer than where it would have come to rest before this step.
/// Else all joints brake from where they are, which ends where the step before was found to be safe. So a pair stays
/// outside the margin once it was, and one that begins inside may only get further apart.
#[derive(Debug)]
pub struct CollisionGuard {
    model: Arc<CollisionModel>,
    scratch: Scratch,
    /// The envelope before the step, and one that brakes ahead of it. `None` before the start.
    envelopes: Option<(Envelope, Envelope)>,
    no_targets: Vec<f64>,
    rest: Vec<f64>,
    at_rest_before: Vec<f64>,
    /// Per pair its distance where the robot would come to rest, before and after the step.
    before_m: Vec<f64>,
    after_m: Vec<f64>,
    held_steps: u64,
    worst: Option<Nearest>,
}

impl CollisionGuard {
    /// A guard by `model`.
    pub fn new(model: Arc<CollisionModel>) -> Self {
        let pairs = model.pairs();
        Self {
            scratch: model.scratch(),
            model,
            envelopes: None,
            no_targets: Vec::new(),
            rest: Vec::new(),
            at_rest_before: Vec::new(),
            before_m: vec![f64::INFINITY; pairs],
            after_m: vec![f64::INFINITY; pairs],
            held_steps: 0,
            worst: None,
        }
    }

    /// Steps in which the robot was held.
    pub fn held_steps(&self) -> u64 {
        self.held_steps
    }

    /// The nearest that a step that was not let through would have led to.
    pub fn worst(&self) -> Option<Nearest> {
        self.worst
    }

    /// The first pair that `after_m` has too near, and nearer than before.
    fn too_near(&self) -> Option<Nearest> {
        let margin_m = self.model.margin_m();
        (self.before_m.iter().zip(&self.after_m))
            .position(|(before, after)| *after < margin_m && *after < before - NEARER_M)
            .map(|pair| Nearest {
                pair,
                distance_m: self.after_m[pair],
            })
    }
}

impl Guard for CollisionGuard {
    fn start(&mut self, envelope: &Envelope, present: &[f64]) {
        self.envelopes = Some((envelope.clone(), envelope.clone()));
        self.no_targets = vec![f64::NAN; present.len()];
        self.rest = present.to_vec();
        self.at_rest_before = present.to_vec();
        self.held_steps = 0;
        self.worst = None;
        let limit_m = self.model.margin_m();
        (self.model).distances(present, limit_m, &mut self.scratch, &mut self.before_m);
    }

    fn pass(&mut self, envelope: &mut Envelope, targets: &[f64], out: &mut [f64]) -> usize {
        let Some((before, ahead)) = &mut self.envelopes else {
            return envelope.pass(targets, out);
        };
        before.copy_from(envelope);
        let held_back = envelope.pass(targets, out);
        ahead.copy_from(envelope);
        self.rest.copy_from_slice(out);
        for _ in 0..STEPS {
            self.at_rest_before.copy_from_slice(&self.rest);
            ahead.pass(&self.no_targets, &mut self.rest);
            let moved = self.rest.iter().zip(&self.at_rest_before);
            if moved
                .into_iter()
                .all(|(now, before)| (now - before).abs() < STILL_RAD)
            {
                break;
            }
        }
        let limit_m = self.model.margin_m();
        (self.model).distances(&self.rest, limit_m, &mut self.scratch, &mut self.after_m);
        let Some(near) = self.too_near() else {
            std::mem::swap(&mut self.before_m, &mut self.after_m);
            return held_back;
        };
        self.held_steps += 1;
        if self
            .worst
            .is_none_or(|worst| near.distance_m < worst.distance_m)
        {
            self.worst = Some(near);
        }
        if let Some((before, _)) = &self.envelopes {
            envelope.copy_from(before);
        }
        envelope.pass(&self.no_targets, out);
        out.len()
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = self.model.notes().to_vec();
        if let Some(worst) = self.worst {
            let (a, b) = self.model.names(worst.pair);
            notes.push(format!(
                "collision: held in {} cycles; the nearest would have been {a} and {b}, {:.1} mm apart where {:.1} mm are allowed (safety.collision)",
                self.held_steps,
                1e3 * worst.distance_m,
                1e3 * self.model.margin_m()
            ));
        }
        notes
    }
}
