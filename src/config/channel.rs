//! Derived channels of a configuration, checked at load and bound to a stream's channels.

use super::error::{ConfigError, Pointer};
use super::file::CharacterFile;
use crate::gesture::{DerivedChannel, FrontEnd};

/// A derived channel, not yet bound to the channels it mixes.
#[derive(Clone, Debug)]
pub(super) struct ChannelParts {
    derived: DerivedChannel,
    /// Line of its name in the configuration, for messages.
    line: usize,
}

/// The derived channels in the order of the file, numbers checked.
pub(super) fn channel_parts(
    file: &CharacterFile,
    at: &Pointer<'_>,
) -> Result<Vec<ChannelParts>, ConfigError> {
    let parts = file.channel.iter().map(|entry| {
        let derived = DerivedChannel {
            name: entry.name.get_ref().clone(),
            weights: entry.weights.clone().into_iter().collect(),
            offset: entry.offset,
            range: entry.range,
            smoothing_s: entry.smoothing_s,
        };
        derived
            .check()
            .map_err(|problem| at.at(entry.name.span(), "channel", problem))?;
        Ok(ChannelParts {
            derived,
            line: at.line_of(entry.name.span().start),
        })
    });
    parts.collect()
}

/// Adds the derived channels to those of `front`.
pub(super) fn bind(
    mut front: FrontEnd,
    parts: &[ChannelParts],
    config_name: &str,
) -> Result<FrontEnd, ConfigError> {
    for part in parts {
        front = front
            .with_channel(&part.derived)
            .map_err(|problem| ConfigError {
                file: config_name.into(),
                line: Some(part.line),
                key: "channel".into(),
                problem: problem.to_string(),
            })?;
    }
    Ok(front)
}
