//! Chooses what of a recording goes on: some of its points, or some of its channels as points.

use super::{PoseHeader, Recording};
use crate::base::suggest::hint;
use std::f64::consts::TAU;

/// A channel as a point moves this far up for a value of 1, metres.
pub const CHANNEL_STROKE_M: f64 = 0.1;

/// The circle on which such points stand, metres.
const CIRCLE_M: f64 = 0.05;

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

    /// Channels as points, so that gestures can be defined over them: the recording's own points
    /// give way to one point per named channel, and all channels stay.
    ///
    /// Point k stands at a fixed place of a circle on the ground and moves up by 0.1 m for a value
    /// of 1 (y = 0.1 value). Since nothing moves along the ground and no point is an anchor, the
    /// removal of global motion leaves such points as they are. A point is named as its channel.
    ///
    /// # Errors
    /// A name that is no channel or comes twice, with a suggestion and all names.
    pub fn with_channels_as_points(mut self, names: &[String]) -> Result<Self, String> {
        let columns = columns("channel", names, &self.header.channels)?;
        let spots: Vec<(f64, f64)> = (0..names.len())
            .map(|index| (TAU * index as f64 / names.len() as f64).sin_cos())
            .map(|(sin, cos)| (CIRCLE_M * cos, CIRCLE_M * sin))
            .collect();
        for sample in &mut self.samples {
            let place = |(index, (x, z)): (&usize, &(f64, f64))| {
                let value = sample.channels.get(*index).copied().flatten()?;
                Some([*x, CHANNEL_STROKE_M * value, *z])
            };
            sample.points = columns.iter().zip(&spots).map(place).collect();
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
