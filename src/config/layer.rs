//! Layers of a configuration, checked, and bound to the channels of a stream.

use super::body::Body;
use super::class::gesture_named;
use super::error::{ConfigError, Pointer};
use super::file::LayerEntry;
use super::files::Files;
use super::motion::clip;
use crate::base::suggest::hint;
use crate::gesture::{FrontEnd, GestureSet};
use crate::motion::clip::{Clip, ClipKind};
use crate::motion::layer::{ChannelMap, Layer, LayerDrive, LayerOptions};
use crate::motion::range::JointRange;

/// A layer, not yet bound to its channel.
#[derive(Clone, Debug)]
pub(super) struct LayerParts {
    pub(super) name: String,
    source: Source,
    pub(super) clip: Clip,
    joints: Option<Vec<String>>,
    frequency_hz: Option<f64>,
    idle_only: bool,
    /// Line of the layer in the configuration, for messages.
    line: usize,
}

#[derive(Clone, Debug)]
enum Source {
    Channel(String, ChannelMap),
    Gesture(usize),
    Clock,
}

/// How a channel drives something: its range and dead zone, checked.
pub(super) fn channel_map(
    range: &toml::Spanned<[f64; 2]>,
    one_sided: bool,
    dead_zone: f64,
    key: &str,
    at: &Pointer<'_>,
) -> Result<ChannelMap, ConfigError> {
    let [low, high] = *range.get_ref();
    if !(low.is_finite() && high.is_finite() && low != high) {
        return Err(at.at(
            range.span(),
            &format!("{key}.range"),
            format!("[{low}, {high}] must be two different finite numbers"),
        ));
    }
    if !(0.0..=0.9).contains(&dead_zone) {
        return Err(at.at(
            range.span(),
            &format!("{key}.dead_zone"),
            format!("{dead_zone} is not in 0..0.9"),
        ));
    }
    Ok(ChannelMap {
        low,
        high,
        one_sided,
        dead_zone,
    })
}

/// Checks a layer.
pub(super) fn layer_parts(
    files: &Files,
    entry: &LayerEntry,
    body: &Body,
    gestures: &GestureSet,
    at: &Pointer<'_>,
) -> Result<LayerParts, ConfigError> {
    let span = entry.name.span();
    let source = match (&entry.channel, &entry.gesture, entry.clock) {
        (Some(channel), None, false) => {
            let Some(range) = &entry.range else {
                let problem = "a layer driven by a channel needs range = [low, high]: the channel's values at its lowest and highest weight";
                return Err(at.at(channel.span(), "layer.range", problem));
            };
            let map = channel_map(range, entry.one_sided, entry.dead_zone, "layer", at)?;
            Source::Channel(channel.get_ref().clone(), map)
        }
        (None, Some(gesture), false) => {
            Source::Gesture(gesture_named(gesture, "layer.gesture", gestures, at)?)
        }
        (None, None, true) => Source::Clock,
        _ => {
            let problem =
                "needs exactly one of channel = \"NAME\", gesture = \"NAME\" and clock = true";
            return Err(at.at(
                span,
                "layer",
                format!("layer {}: {problem}", entry.name.get_ref()),
            ));
        }
    };
    // Between two values of a channel lies a way; the clock goes round.
    let kind = match &source {
        Source::Channel(..) => Some(ClipKind::Path),
        Source::Clock => Some(ClipKind::Cycle),
        Source::Gesture(_) => None,
    };
    if let Some(hz) = entry.frequency_hz
        && !(hz > 0.0 && hz <= 50.0)
    {
        return Err(at.at(
            span,
            "layer.frequency_hz",
            format!("{hz} is not in 0..50 (above 0)"),
        ));
    }
    Ok(LayerParts {
        name: entry.name.get_ref().clone(),
        source,
        clip: clip(files, &entry.clip, "layer.clip", body, kind, at)?,
        joints: entry.joints.clone(),
        frequency_hz: entry.frequency_hz,
        idle_only: entry.idle_only,
        line: at.line_of((entry.channel.as_ref()).map_or(span.start, |c| c.span().start)),
    })
}

impl LayerParts {
    /// The layer, bound to the channels of `front`. `ranges`: what the joints may do.
    pub(super) fn bind(
        &self,
        front: &FrontEnd,
        body: &Body,
        ranges: &[JointRange],
        config_name: &str,
    ) -> Result<Layer, ConfigError> {
        let wrong = |key: &str, problem: String| ConfigError {
            file: config_name.into(),
            line: Some(self.line),
            key: key.into(),
            problem,
        };
        let drive = match &self.source {
            Source::Channel(name, map) => {
                let channel = channel_index(front, name)
                    .map_err(|e| wrong("layer.channel", format!("layer {}: {e}", self.name)))?;
                LayerDrive::Channel(channel, *map)
            }
            Source::Gesture(index) => LayerDrive::Gesture(*index),
            Source::Clock => LayerDrive::Clock,
        };
        let options = LayerOptions {
            drive,
            parts: self.joints.clone(),
            frequency_hz: self.frequency_hz,
            idle_only: self.idle_only,
        };
        Layer::new(
            &self.name,
            &options,
            self.clip.clone(),
            body.space.get(),
            ranges,
        )
        .map_err(|e| wrong("layer", e.to_string()))
    }
}

/// Index of the channel `name` of the pose stream, or what there is instead.
pub(super) fn channel_index(front: &FrontEnd, name: &str) -> Result<usize, String> {
    front.channel_index(name).ok_or_else(|| {
        let names = front.channel_names();
        let hint = hint(name, front.channel_aliases());
        format!(
            "the pose stream has no channel {name:?}{hint} It has: {}",
            names.join(", ")
        )
    })
}
