//! A clip: one example motion of a body, ready to be sampled at any phase.

mod file;
mod prepare;

pub use crate::body::RootAdvance;
pub use file::{ClipError, ClipFile, ClipKind, Segment};

use super::spline::Spline;
use std::ops::Range;

/// A clip ready to be sampled, in the coordinates of a body.
#[derive(Clone, Debug)]
pub struct Clip {
    /// Name of the motion.
    pub name: String,
    /// Whether it repeats.
    pub kind: ClipKind,
    /// The frequency that a cycle was made for, Hz.
    pub frequency_hz: f64,
    /// How long a path takes by the clock, seconds; 0: not said.
    pub duration_s: f64,
    /// Travel per cycle, or over the whole path.
    pub root: RootAdvance,
    /// Limbs.
    pub limbs: Vec<Limb>,
    spline: Spline,
    /// Travel per unit of the clip, where it is not even.
    way: Option<Spline>,
}

/// A limb of a loaded clip.
#[derive(Clone, Debug, PartialEq)]
pub struct Limb {
    /// Limb name.
    pub name: String,
    /// Its coordinates in a pose.
    pub coordinates: Vec<usize>,
    /// Start of the limb's cycle, fraction of the clip's cycle.
    pub phase: f64,
    /// Fraction of the cycle on the ground.
    pub duty: f64,
}

impl Limb {
    /// Whether the limb carries weight at `u`, fraction of the cycle.
    pub fn in_contact(&self, u: f64) -> bool {
        self.duty >= 1.0 || (u - self.phase).rem_euclid(1.0) < self.duty
    }
}

impl Clip {
    /// Coordinate `coordinate` at `u`: fraction of the cycle (wrapped) or progression (clamped to 0..1).
    pub fn sample(&self, u: f64, coordinate: usize) -> f64 {
        self.spline.value(u, coordinate)
    }

    /// The coordinates `range` of the pose at `u` into `out`, as long as the range.
    ///
    /// Quaternions come out near unit length; blending brings them to it.
    pub fn sample_range(&self, u: f64, range: Range<usize>, out: &mut [f64]) {
        self.spline.values(u, range, out);
    }

    /// The whole pose at `u` into `out`.
    pub fn pose(&self, u: f64, out: &mut [f64]) {
        self.spline.values(u, 0..self.coordinates(), out);
    }

    /// Travel per unit of the clip at `u`, in the body's frame.
    pub fn rate(&self, u: f64) -> RootAdvance {
        match &self.way {
            None => self.root,
            Some(way) => {
                let mut v = [0.0; 3];
                way.values(u, 0..3, &mut v);
                let [forward_m, left_m, yaw_rad] = v;
                RootAdvance {
                    forward_m,
                    left_m,
                    yaw_rad,
                }
            }
        }
    }

    /// Number of coordinates of a pose.
    pub fn coordinates(&self) -> usize {
        self.spline.coordinates()
    }

    /// Largest speed (per cycle or unit progression) and acceleration (per square of it) of a coordinate.
    pub fn steepest(&self, coordinate: usize) -> (f64, f64) {
        self.spline.steepest(coordinate)
    }
}
