//! What may stop a target on its way through the envelope, because of where it would lead the robot.

use super::envelope::Envelope;
use std::fmt::Debug;

/// Looks where targets lead before they are taken.
pub trait Guard: Debug + Send {
    /// A run begins at `present` (rad, joint order) with `envelope`, which was started there. May allocate.
    fn start(&mut self, envelope: &Envelope, present: &[f64]);

    /// Passes one step of targets through `envelope` into `out`, as [`Envelope::pass`] does; or, where that would
    /// lead somewhere it must not, lets all joints brake within their limits and stay. Returns how many joints were
    /// held back. No allocation.
    fn pass(&mut self, envelope: &mut Envelope, targets: &[f64], out: &mut [f64]) -> usize;

    /// What it did in this run and what it does not look at, for the reader.
    fn notes(&self) -> Vec<String>;
}
