//! Layers: secondary motion added on top, driven by a channel, a gesture or the clock (heading, crouch
//! height, breathing).
//!
//! Rhodin 2016, section 9.5.2: secondary motions are added as differences to the rest pose, several at once.

use super::class::Drive;
use super::clip::{Clip, ClipKind};
use super::range::{JointRange, Steepness};
use super::smooth::Follower;
use crate::base::angle::wrap_pi;
use crate::base::suggest::nearest;
use crate::body::PoseSpace;
use std::f64::consts::TAU;

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

/// What drives a layer.
#[derive(Copy, Clone, Debug, PartialEq)]
pub enum LayerDrive {
    /// A channel of the pose stream, by index: its value is the weight.
    Channel(usize, ChannelMap),
    /// A gesture, by index: its amplitude or progression is the weight, its phase that of a cycle.
    Gesture(usize),
    /// The clock, at full weight.
    Clock,
}

/// What layers are driven by in one step.
#[derive(Copy, Clone, Debug, Default)]
pub struct LayerInput<'a> {
    /// Channel values by index; not finite where there is none.
    pub channels: &'a [f64],
    /// Gestures of the front end by index.
    pub gestures: &'a [Drive],
}

/// How a layer is laid over other motion.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerOptions {
    /// What drives it.
    pub drive: LayerDrive,
    /// Parts it may move, by name; `None`: all.
    pub parts: Option<Vec<String>>,
    /// Cycles a second of a cycle that no gesture drives, Hz; `None`: as the clip was made.
    pub frequency_hz: Option<f64>,
    /// Only while no gesture is performed.
    pub idle_only: bool,
}

/// Why a layer cannot be used.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum LayerError {
    /// A mask names what the body lacks.
    #[error("layer {layer}: the body has no part {part:?}{hint}")]
    UnknownPart {
        /// Layer name.
        layer: String,
        /// As given.
        part: String,
        /// A near name.
        hint: String,
    },
    /// The clock cannot drive a path: it has no end to come back from.
    #[error(
        "layer {layer}: clip {clip} is a path; the clock drives cycles (give a channel or a gesture)"
    )]
    ClockedPath {
        /// Layer name.
        layer: String,
        /// Clip name.
        clip: String,
    },
    /// A cycle without a frequency.
    #[error("layer {layer}: clip {clip} does not say its frequency; give frequency_hz above 0")]
    NoFrequency {
        /// Layer name.
        layer: String,
        /// Clip name.
        clip: String,
    },
}

/// An additive layer and its state.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Layer name.
    pub name: String,
    drive: LayerDrive,
    idle_only: bool,
    frequency_hz: f64,
    clip: Clip,
    rest: Vec<f64>,
    /// Tangent coordinates that the layer may move.
    mask: Vec<bool>,
    weight: Follower,
    /// Phase of a cycle, turns.
    turns: f64,
    /// Highest speed of the weight, 1/s, that the joints allow.
    fastest: f64,
    steepness: Steepness,
    ranges: Vec<JointRange>,
    pose: Vec<f64>,
    blended: Vec<f64>,
    difference: Vec<f64>,
}

/// Share of the joints' range that a layer may use while other motion goes on.
const LAYER_SHARE: f64 = 0.18;
/// How fast a layer's weight follows, 1/s.
const WEIGHT_RATE: f64 = 4.0;
/// A gesture below this amplitude is not performed, for layers that show at rest only.
const PERFORMED: f64 = 0.1;

impl Layer {
    /// A layer of `clip`, which is added as its difference to its first frame. A path at its end is weight 1;
    /// a negative weight adds the mirrored difference. A cycle goes round, scaled by the weight.
    pub fn new(
        name: &str,
        options: &LayerOptions,
        clip: Clip,
        space: &dyn PoseSpace,
        ranges: &[JointRange],
    ) -> Result<Self, LayerError> {
        let clocked = !matches!(options.drive, LayerDrive::Gesture(_));
        if clip.kind == ClipKind::Path && options.drive == LayerDrive::Clock {
            return Err(LayerError::ClockedPath {
                layer: name.into(),
                clip: clip.name.clone(),
            });
        }
        let frequency_hz = options.frequency_hz.unwrap_or(clip.frequency_hz);
        if clip.kind == ClipKind::Cycle && clocked && !(frequency_hz > 0.0) {
            return Err(LayerError::NoFrequency {
                layer: name.into(),
                clip: clip.name.clone(),
            });
        }
        let mut rest = vec![0.0; space.len()];
        clip.pose(0.0, &mut rest);
        let steepness = Steepness::of(&[&clip]);
        let fastest = steepness.rate_limit(&[1.0], 1.0, ranges, LAYER_SHARE) / TAU;
        Ok(Self {
            name: name.into(),
            drive: options.drive,
            idle_only: options.idle_only,
            frequency_hz,
            mask: mask(name, options, space)?,
            pose: rest.clone(),
            blended: rest.clone(),
            difference: vec![0.0; space.tangent_len()],
            rest,
            clip,
            weight: Follower::at(0.0),
            turns: 0.0,
            fastest: fastest.min(1e3),
            steepness,
            ranges: ranges.to_vec(),
        })
    }

    /// Weight in the last step, -1..1.
    pub fn weight(&self) -> f64 {
        self.weight.value
    }

    /// What drives it.
    pub fn drive(&self) -> LayerDrive {
        self.drive
    }

    /// Moves towards the weight that `input` asks for and adds the layer to `pose`. Allocates nothing.
    pub fn step(
        &mut self,
        space: &dyn PoseSpace,
        input: &LayerInput<'_>,
        dt_s: f64,
        pose: &mut [f64],
    ) {
        let goal = self.goal(input);
        let fastest = match self.clip.kind {
            ClipKind::Path => self.fastest,
            ClipKind::Cycle => WEIGHT_RATE,
        };
        let rate = WEIGHT_RATE.min(2.0 * fastest);
        let weight = self.weight.step(goal, rate, fastest, dt_s);
        let at = match self.clip.kind {
            ClipKind::Path => weight.abs(),
            ClipKind::Cycle => self.turn(input, dt_s),
        };
        if weight.abs() < 1e-9 {
            return;
        }
        self.clip.pose(at, &mut self.pose);
        if self.clip.kind == ClipKind::Path && self.mask.iter().all(|moves| *moves) {
            let (rest, there) = (&self.rest, &self.pose);
            space.add_way(pose, rest, there, weight.signum(), &mut self.difference);
            return;
        }
        // Clips of skeletons come out of their splines a hair off unit length.
        space.blend(&self.pose, &[1.0], &mut self.blended);
        space.diff(&self.rest, &self.blended, &mut self.difference);
        for (d, moves) in self.difference.iter_mut().zip(&self.mask) {
            if !moves {
                *d = 0.0;
            }
        }
        let scale = match self.clip.kind {
            ClipKind::Path => weight.signum(),
            ClipKind::Cycle => weight,
        };
        space.add(pose, &self.difference, scale);
    }

    /// The weight that is asked for.
    fn goal(&self, input: &LayerInput<'_>) -> f64 {
        let performed = |drive: &Drive| drive.amplitude > PERFORMED;
        if self.idle_only && input.gestures.iter().any(performed) {
            return 0.0;
        }
        let asked = match self.drive {
            LayerDrive::Channel(index, map) => {
                map.weight(input.channels.get(index).copied().unwrap_or(f64::NAN))
            }
            LayerDrive::Gesture(index) => match input.gestures.get(index) {
                Some(drive) if drive.frequency_hz >= 0.0 && drive.amplitude.is_finite() => {
                    drive.amplitude.clamp(0.0, 1.0)
                }
                _ => 0.0,
            },
            LayerDrive::Clock => 1.0,
        };
        if self.clip.kind == ClipKind::Path {
            return asked;
        }
        // A cycle that is too fast for the joints is made smaller.
        let hz = match (self.drive, self.gesture(input)) {
            (LayerDrive::Gesture(_), Some(drive)) => drive.frequency_hz.abs(),
            _ => self.frequency_hz,
        };
        let most =
            self.steepness
                .scale_limit(&[1.0], TAU * hz.max(1e-6), &self.ranges, LAYER_SHARE);
        asked.clamp(-most, most)
    }

    fn gesture<'a>(&self, input: &LayerInput<'a>) -> Option<&'a Drive> {
        match self.drive {
            LayerDrive::Gesture(index) => input.gestures.get(index),
            _ => None,
        }
    }

    /// Where a cycle is, in turns: with its gesture, drawn to its phase, or by the clock.
    fn turn(&mut self, input: &LayerInput<'_>, dt_s: f64) -> f64 {
        match self.gesture(input) {
            Some(drive) if drive.phase_rad.is_finite() && drive.frequency_hz > 0.0 => {
                let on = self.turns + drive.frequency_hz * dt_s;
                let lag = wrap_pi(drive.phase_rad - TAU * on) / TAU;
                let most = 0.3 * drive.frequency_hz * dt_s;
                self.turns = if self.weight.value.abs() < 1e-6 {
                    drive.phase_rad / TAU
                } else {
                    on + (4.0 * lag * dt_s).clamp(-most, most)
                };
            }
            Some(_) => {}
            None => self.turns += self.frequency_hz * dt_s,
        }
        self.turns = self.turns.rem_euclid(1.0);
        self.turns
    }
}

/// Which tangent coordinates a layer may move.
fn mask(
    name: &str,
    options: &LayerOptions,
    space: &dyn PoseSpace,
) -> Result<Vec<bool>, LayerError> {
    let Some(parts) = &options.parts else {
        return Ok(vec![true; space.tangent_len()]);
    };
    let mut mask = vec![false; space.tangent_len()];
    for wanted in parts {
        let found = space.parts().iter().find(|p| p.name == *wanted);
        let part = found.ok_or_else(|| LayerError::UnknownPart {
            layer: name.into(),
            part: wanted.clone(),
            hint: nearest(wanted, space.parts().iter().map(|p| p.name.as_str()))
                .map(|n| format!("; did you mean {n}?"))
                .unwrap_or_default(),
        })?;
        mask[part.tangent.clone()].fill(true);
    }
    Ok(mask)
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
