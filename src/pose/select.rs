//! Chooses what of a recording goes on: a stretch of time, points, channels, channels as points.

use super::{PoseHeader, Recording};
use crate::base::suggest::hint;
use std::f64::consts::TAU;

/// A channel as a point moves this far up for a value of 1, metres.
pub const CHANNEL_STROKE_M: f64 = 0.1;

/// The circle on which such points stand, metres.
const CIRCLE_M: f64 = 0.05;

/// Where a channel with this value is as point number `index` of `count`.
///
/// It stands at a fixed place of a circle on the ground and moves up by 0.1 m for a value of 1. Since
/// nothing moves along the ground and no point is an anchor, the removal of global motion leaves
/// such points as they are.
pub fn channel_as_point(index: usize, count: usize, value: f64) -> [f64; 3] {
    let (sin, cos) = (TAU * index as f64 / count.max(1) as f64).sin_cos();
    [CIRCLE_M * cos, CHANNEL_STROKE_M * value, CIRCLE_M * sin]
}

impl Recording {
    /// The recording with the points of these names only, in their order.
    ///
    /// # Errors
    /// A name that is no point or comes twice, with a suggestion and all names.
    pub fn with_points(mut self, names: &[String]) -> Result<Self, String> {
        let columns = columns("point", names, &self.header.points)?;
        for sample in &mut self.samples {
            sample.points = columns.iter().map(|index| sample.points[*index]).collect();
            if !sample.confidence.is_empty() {
                let old = &sample.confidence;
                sample.confidence = columns.iter().map(|index| old[*index]).collect();
            }
        }
        self.header.points = names.to_vec();
        Ok(self)
    }

    /// The recording with the channels of these names only, in their order.
    ///
    /// # Errors
    /// A name that is no channel or comes twice, with a suggestion and all names.
    pub fn with_channels(mut self, names: &[String]) -> Result<Self, String> {
        let columns = columns("channel", names, &self.header.channels)?;
        for sample in &mut self.samples {
            let value = |index: &usize| sample.channels.get(*index).copied().flatten();
            sample.channels = columns.iter().map(value).collect();
        }
        self.header.channels = names.to_vec();
        Ok(self)
    }

    /// The samples from `from_s` to `to_s` (seconds on the recording's clock, both included), with
    /// times that start at 0 again.
    ///
    /// # Errors
    /// No sample lies between them.
    pub fn cut(mut self, from_s: f64, to_s: f64) -> Result<Self, String> {
        let (first, last) = self.span_s();
        self.samples
            .retain(|sample| sample.t >= from_s && sample.t <= to_s);
        let start = self.span_s().0;
        for sample in &mut self.samples {
            sample.t -= start;
        }
        if self.samples.is_empty() {
            return Err(format!(
                "no sample from {from_s} s to {to_s} s; the recording runs from {first:.3} s to {last:.3} s"
            ));
        }
        Ok(self)
    }

    /// Channels as points, so that gestures can be defined over them: the recording's own points
    /// give way to one point per named channel ([`channel_as_point`]), named like it; channels stay.
    ///
    /// # Errors
    /// A name that is no channel or comes twice, with a suggestion and all names.
    pub fn with_channels_as_points(mut self, names: &[String]) -> Result<Self, String> {
        let columns = columns("channel", names, &self.header.channels)?;
        for sample in &mut self.samples {
            let place = |(index, column): (usize, &usize)| {
                let value = sample.channels.get(*column).copied().flatten()?;
                Some(channel_as_point(index, columns.len(), value))
            };
            sample.points = columns.iter().enumerate().map(place).collect();
            sample.confidence.clear();
        }
        self.header = PoseHeader {
            points: names.to_vec(),
            dim: 3,
            channels: self.header.channels,
        };
        Ok(self)
    }
}

/// Where each of `names` stands among `known`.
fn columns(what: &str, names: &[String], known: &[String]) -> Result<Vec<usize>, String> {
    let mut columns = Vec::new();
    for name in names {
        let index = known.iter().position(|known| known == name);
        let index = index.ok_or_else(|| {
            let all = if known.is_empty() {
                "none".into()
            } else {
                known.join(", ")
            };
            format!(
                "the recording has no {what} {name:?}{} Its {what}s: {all}",
                hint(name, known.iter().map(String::as_str))
            )
        })?;
        if columns.contains(&index) {
            return Err(format!("{what} {name:?} is named twice"));
        }
        columns.push(index);
    }
    Ok(columns)
}
