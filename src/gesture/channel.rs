//! Derived channels: linear mixes of a stream's channels, such as an emotion from blendshapes of a face.

use super::wave::ProgressionSmoother;
use crate::base::suggest::hint;

/// Longest smoothing of a derived channel, seconds.
pub const LONGEST_SMOOTHING_S: f64 = 2.0;

/// A channel mixed from others: `offset + sum of weight times channel`, limited to `range`, smoothed.
#[derive(Clone, Debug, PartialEq)]
pub struct DerivedChannel {
    /// Its name, by which layers ask for it; no other channel's.
    pub name: String,
    /// Channels and their weights: the stream's, those of the global motion (`yaw`, `height`, ...)
    /// and derived ones before this.
    pub weights: Vec<(String, f64)>,
    /// Value where all channels are zero.
    pub offset: f64,
    /// Lowest and highest value; unlimited when not given.
    pub range: Option<[f64; 2]>,
    /// Standard deviation of the causal Gaussian smoothing, seconds, 0 to 2; 0 follows at once.
    pub smoothing_s: f64,
}

/// Why a derived channel cannot be made for a stream.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DerivedChannelError {
    /// A weight names a channel that is not there.
    #[error("channel {channel:?}: there is no channel {found:?}{hint} Channels: {}", known.join(", "))]
    Unknown {
        /// The derived channel.
        channel: String,
        /// The name in its weights.
        found: String,
        /// `; did you mean ...?` or a full stop.
        hint: String,
        /// Channels it may name.
        known: Vec<String>,
    },
    /// The name is taken.
    #[error("channel {channel:?} is there already; give the derived one another name")]
    Taken {
        /// The derived channel.
        channel: String,
    },
    /// A value out of range.
    #[error("channel {channel:?}: {key} = {found}; allowed: {allowed}")]
    Value {
        /// The derived channel.
        channel: String,
        /// The key.
        key: &'static str,
        /// Its value.
        found: String,
        /// Values allowed.
        allowed: &'static str,
    },
}

impl DerivedChannelError {
    /// The derived channel that it is about.
    pub fn channel(&self) -> &str {
        match self {
            Self::Unknown { channel, .. }
            | Self::Taken { channel }
            | Self::Value { channel, .. } => channel,
        }
    }
}

impl DerivedChannel {
    /// Checks the numbers.
    ///
    /// # Errors
    /// No weight, a number that is not finite, a range that is none, smoothing outside 0 to 2 s.
    pub fn check(&self) -> Result<(), DerivedChannelError> {
        let wrong = |key, found: String, allowed| {
            Err(DerivedChannelError::Value {
                channel: self.name.clone(),
                key,
                found,
                allowed,
            })
        };
        if self.weights.is_empty() {
            return wrong(
                "weights",
                "{}".into(),
                "at least one channel and its weight",
            );
        }
        if let Some((name, weight)) = self.weights.iter().find(|(_, weight)| !is_weight(*weight)) {
            return wrong(
                "weights",
                format!("{{ {name} = {weight} }}"),
                "-1000 to 1000",
            );
        }
        if !is_weight(self.offset) {
            return wrong("offset", self.offset.to_string(), "-1000 to 1000");
        }
        if let Some([low, high]) = self.range
            && !(low.is_finite() && high.is_finite() && low < high)
        {
            let allowed = "two finite numbers, the lower first";
            return wrong("range", format!("[{low}, {high}]"), allowed);
        }
        if !(0.0..=LONGEST_SMOOTHING_S).contains(&self.smoothing_s) {
            return wrong("smoothing_s", self.smoothing_s.to_string(), "0 to 2 s");
        }
        Ok(())
    }
}

fn is_weight(value: f64) -> bool {
    value.abs() <= 1e3
}

/// One derived channel, bound to the channels it mixes.
#[derive(Clone, Debug)]
struct Mix {
    /// Index of each channel and its weight.
    terms: Vec<(usize, f64)>,
    offset: f64,
    range: Option<[f64; 2]>,
    smoother: Option<ProgressionSmoother>,
}

/// Works out derived channels sample by sample; allocates nothing after construction.
#[derive(Clone, Debug, Default)]
pub struct Mixer {
    mixes: Vec<Mix>,
}

impl Mixer {
    /// Adds a channel that mixes those of `names`, whose index `find` tells; its own index is that
    /// of the next name.
    ///
    /// # Errors
    /// An unknown channel, a taken name, a value out of range.
    pub(super) fn add(
        &mut self,
        derived: &DerivedChannel,
        names: &[&str],
        find: impl Fn(&str) -> Option<usize>,
    ) -> Result<(), DerivedChannelError> {
        derived.check()?;
        if find(&derived.name).is_some() {
            return Err(DerivedChannelError::Taken {
                channel: derived.name.clone(),
            });
        }
        let term = |(name, weight): &(String, f64)| {
            let index = find(name).ok_or_else(|| DerivedChannelError::Unknown {
                channel: derived.name.clone(),
                found: name.clone(),
                hint: hint(name, names.iter().copied()),
                known: names.iter().map(ToString::to_string).collect(),
            })?;
            Ok((index, *weight))
        };
        let smooth = derived.smoothing_s > 0.0;
        self.mixes.push(Mix {
            terms: derived.weights.iter().map(term).collect::<Result<_, _>>()?,
            offset: derived.offset,
            range: derived.range,
            smoother: smooth.then(|| ProgressionSmoother::new(derived.smoothing_s)),
        });
        Ok(())
    }

    /// Writes the derived channels at time `t` (seconds) to the end of `channels`, one after
    /// another, from the channels before them.
    pub(super) fn mix(&mut self, t: f64, channels: &mut [f64]) {
        let first = channels.len().saturating_sub(self.mixes.len());
        for (index, mix) in self.mixes.iter_mut().enumerate() {
            let value = |(index, weight): &(usize, f64)| {
                weight * channels.get(*index).copied().unwrap_or(0.0)
            };
            let mut sum = mix.offset + mix.terms.iter().map(value).sum::<f64>();
            if let Some([low, high]) = mix.range {
                sum = sum.clamp(low, high);
            }
            if let Some(smoother) = &mut mix.smoother {
                sum = smoother.push(t, sum);
            }
            channels[first + index] = sum;
        }
    }

    /// Forgets all samples.
    pub(super) fn reset(&mut self) {
        for smoother in self
            .mixes
            .iter_mut()
            .filter_map(|mix| mix.smoother.as_mut())
        {
            smoother.reset();
        }
    }
}
