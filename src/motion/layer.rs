//! Layers: secondary motion added on top, driven by a channel (heading, crouch height).
//!
//! Rhodin 2016, section 9.5.2: secondary motions are added as differences to the rest pose.

use super::clip::{Clip, ClipKind};
use super::range::{JointRange, Steepness};
use super::smooth::Follower;
use crate::body::PoseSpace;

/// How a channel's value becomes a layer's weight.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct ChannelMap {
    /// Channel value at weight -1 (or 0 when `one_sided`).
    pub low: f64,
    /// Channel value at weight +1.
    pub high: f64,
    /// Weight runs from 0 to 1 instead of -1 to +1.
    pub one_sided: bool,
    /// Part of the range around its rest that counts as nothing, 0..0.9.
    pub dead_zone: f64,
}

impl ChannelMap {
    /// Weight for a channel value; 0 when the value is not finite.
    pub fn weight(&self, value: f64) -> f64 {
        let u = (value - self.low) / (self.high - self.low);
        if !u.is_finite() {
            return 0.0;
        }
        let centred = if self.one_sided { u } else { 2.0 * u - 1.0 };
        let size = (centred.abs() - self.dead_zone).max(0.0) / (1.0 - self.dead_zone);
        let bounded = size.min(1.0) * centred.signum();
        if self.one_sided {
            bounded.max(0.0)
        } else {
            bounded
        }
    }
}

/// An additive layer and its state.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Layer name.
    pub name: String,
    /// Index of the driving channel in the front end.
    pub channel: usize,
    map: ChannelMap,
    clip: Clip,
    rest: Vec<f64>,
    follower: Follower,
    /// Highest speed of the weight, 1/s, that the joints allow.
    fastest: f64,
    pose: Vec<f64>,
    difference: Vec<f64>,
}

/// Share of the joints' range that a layer may use while other motion goes on.
const LAYER_SHARE: f64 = 0.18;

impl Layer {
    /// A layer that adds the path `clip` (weight 1 = its end), driven by `channel`.
    ///
    /// A negative weight adds the mirrored difference. `None` when the clip is a cycle.
    pub fn new(
        name: &str,
        channel: usize,
        map: ChannelMap,
        clip: Clip,
        ranges: &[JointRange],
    ) -> Option<Self> {
        if clip.kind != ClipKind::Path {
            return None;
        }
        let mut rest = vec![0.0; clip.coordinates()];
        clip.pose(0.0, &mut rest);
        let fastest = Steepness::of(&[&clip]).rate_limit(&[1.0], 1.0, ranges, LAYER_SHARE)
            / std::f64::consts::TAU;
        Some(Self {
            name: name.into(),
            channel,
            map,
            pose: rest.clone(),
            difference: vec![0.0; rest.len()],
            rest,
            clip,
            follower: Follower::at(0.0),
            fastest: fastest.min(1e3),
        })
    }

    /// Weight in the last step, -1..1.
    pub fn weight(&self) -> f64 {
        self.follower.value
    }

    /// Moves towards the weight of `value` and adds the layer to `pose`. Allocates nothing.
    pub fn step(&mut self, space: &dyn PoseSpace, value: f64, dt_s: f64, pose: &mut [f64]) {
        let goal = self.map.weight(value);
        let rate = 4.0_f64.min(2.0 * self.fastest);
        let weight = self.follower.step(goal, rate, self.fastest, dt_s);
        if weight.abs() < 1e-9 {
            return;
        }
        self.clip.pose(weight.abs(), &mut self.pose);
        let (rest, there) = (&self.rest, &self.pose);
        space.add_way(pose, rest, there, weight.signum(), &mut self.difference);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channel_values_map_to_bounded_weights() {
        let map = ChannelMap {
            low: -0.5,
            high: 0.5,
            one_sided: false,
            dead_zone: 0.2,
        };
        for (value, expected) in [
            (0.0, 0.0),
            (0.05, 0.0),
            (0.5, 1.0),
            (-9.0, -1.0),
            (f64::NAN, 0.0),
        ] {
            assert_eq!(map.weight(value), expected, "value {value}");
        }
    }
}
