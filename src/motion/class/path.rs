//! A class of paths in one step: driven by progression, or by the clock from start to end.

use super::{Drive, MotionClass, Played, RANGE_SHARE, awake};
use crate::body::{PoseSpace, RootAdvance};
use std::f64::consts::TAU;

impl MotionClass {
    /// Weighs the paths for `drive`; returns the highest speed of progression that the joints allow, 1/s.
    fn weigh_path(&mut self, drive: &Drive, dt_s: f64) -> f64 {
        self.follow_extra(drive, dt_s);
        self.weigh(self.wish(1.0, 0.0), 1.0);
        // Steepness is kept per radian of phase; one progression is one turn of it.
        (self.steepness).rate_limit(&self.weights, 1.0, &self.ranges, RANGE_SHARE) / TAU
    }

    pub(super) fn step_path(
        &mut self,
        space: &dyn PoseSpace,
        drive: Drive,
        dt_s: f64,
        out: &mut [f64],
    ) -> Played {
        let wanted = if drive.amplitude.is_finite() {
            awake(drive.amplitude).min(1.0)
        } else {
            0.0
        };
        let fastest = self.weigh_path(&drive, dt_s);
        let before = self.state.amplitude.value.clamp(0.0, 1.0);
        let progression = self
            .state
            .amplitude
            .step(wanted, 9.0_f64.min(2.0 * fastest), fastest.min(1e3), dt_s)
            .clamp(0.0, 1.0);
        self.sample(space, progression * TAU, out);
        Played {
            phase_rad: progression * TAU,
            frequency_hz: 0.0,
            amplitude: progression,
            stride: 1.0,
            locked: true,
            root_velocity: if dt_s > 0.0 {
                self.travel(progression, (progression - before) / dt_s)
            } else {
                RootAdvance::default()
            },
            uncertainty: 0.0,
        }
    }

    /// One step of a class that plays once: along by the clock while it shows, then it waits at its end.
    pub(super) fn step_once(
        &mut self,
        space: &dyn PoseSpace,
        drive: Drive,
        dt_s: f64,
        out: &mut [f64],
    ) -> Played {
        let fastest = self.weigh_path(&drive, dt_s);
        let takes_s: f64 = (self.examples.iter().zip(&self.weights))
            .map(|(e, w)| w * e.clip.duration_s)
            .sum();
        // A clip that does not say how long it takes is played in a second where the joints can.
        let wanted = if takes_s > 0.0 { 1.0 / takes_s } else { 1.0 };
        let per_second = if self.shown { wanted.min(fastest) } else { 0.0 };
        let before = self.state.progress;
        self.state.progress = (before + per_second * dt_s).min(1.0);
        if self.state.progress >= 1.0 {
            self.state.ended = true;
        }
        self.sample(space, self.state.progress * TAU, out);
        let moved = self.state.progress - before;
        Played {
            phase_rad: self.state.progress * TAU,
            frequency_hz: 0.0,
            amplitude: if self.shown && !self.state.ended {
                1.0
            } else {
                0.0
            },
            stride: 1.0,
            locked: true,
            root_velocity: if dt_s > 0.0 {
                self.travel(before, moved / dt_s)
            } else {
                RootAdvance::default()
            },
            uncertainty: 0.0,
        }
    }
}
