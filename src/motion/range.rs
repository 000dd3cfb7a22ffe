//! The frequencies a clip can be played at, from the speed and acceleration of the joints.

use super::clip::Clip;
use std::f64::consts::TAU;

/// What a joint may use, in radians and seconds.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct JointRange {
    /// Speed, rad/s.
    pub velocity: f64,
    /// Acceleration, rad/s^2.
    pub acceleration: f64,
}

/// Highest frequency at which a cycle stays inside the ranges, Hz, and the joint that decides it.
///
/// With q(u) over the cycle: |q'| f <= velocity and |q''| f^2 <= acceleration. Infinite for a clip
/// that does not move.
pub fn cycle_limit(clip: &Clip, ranges: &[JointRange]) -> (f64, usize) {
    let mut limit = (f64::INFINITY, 0);
    for (joint, range) in ranges.iter().enumerate() {
        let (first, second) = clip.steepest(joint);
        let hz = (range.velocity / first).min((range.acceleration / second).sqrt());
        if hz < limit.0 {
            limit = (hz, joint);
        }
    }
    limit
}

/// Steepness of several clips under blending: an upper bound of |dq/dphase| and |d2q/dphase2|.
///
/// The triangle inequality bounds the blend by the weighted sum of each clip's own maxima.
#[derive(Clone, Debug)]
pub struct Steepness {
    joints: usize,
    /// Clips x joints: per radian of phase.
    first: Vec<f64>,
    /// Clips x joints: per radian squared.
    second: Vec<f64>,
}

impl Steepness {
    /// Maxima over each clip.
    pub fn of(clips: &[&Clip]) -> Self {
        let joints = clips.first().map_or(0, |c| c.coordinates());
        let mut first = Vec::new();
        let mut second = Vec::new();
        for clip in clips {
            for joint in 0..joints {
                let (d1, d2) = clip.steepest(joint);
                first.push(d1 / TAU);
                second.push(d2 / (TAU * TAU));
            }
        }
        Self {
            joints,
            first,
            second,
        }
    }

    /// Highest phase rate (rad/s) for the blend `weights` scaled by `scale`, when each joint may use
    /// `share` of its range. Infinite when nothing moves.
    pub fn rate_limit(
        &self,
        weights: &[f64],
        scale: f64,
        ranges: &[JointRange],
        share: f64,
    ) -> f64 {
        let mut limit = f64::INFINITY;
        for (joint, range) in ranges.iter().enumerate() {
            let (v, a) = self.bound(weights, joint);
            let by_speed = share * range.velocity / (scale * v);
            let by_acceleration = (share * range.acceleration / (scale * a)).sqrt();
            limit = limit.min(by_speed).min(by_acceleration);
        }
        limit
    }

    /// Largest scale at which the blend can be played at `rate` (rad/s).
    pub fn scale_limit(
        &self,
        weights: &[f64],
        rate: f64,
        ranges: &[JointRange],
        share: f64,
    ) -> f64 {
        let mut limit = f64::INFINITY;
        for (joint, range) in ranges.iter().enumerate() {
            let (v, a) = self.bound(weights, joint);
            limit = limit
                .min(share * range.velocity / (rate * v))
                .min(share * range.acceleration / (rate * rate * a));
        }
        limit
    }

    fn bound(&self, weights: &[f64], joint: usize) -> (f64, f64) {
        let mut bound = (0.0, 0.0);
        for (clip, weight) in weights.iter().enumerate() {
            let at = clip * self.joints + joint;
            bound.0 += weight * self.first[at];
            bound.1 += weight * self.second[at];
        }
        bound
    }
}
