//! The front end: pose samples in, one estimate per gesture out, every sample, no allocation.

mod options;
mod readers;

pub use options::{FrontEndError, FrontEndOptions};
pub use readers::GestureEstimate;

use super::channel::{DerivedChannel, DerivedChannelError, Mixer};
use super::tracker::{Completion, OutlierFilter, RestMeasure, SideSwaps};
use super::{FeatureSpec, PoseFeatures};
use super::{GestureKind, GestureSet, PerformerScale, References, TrackingCounts};
use crate::base::angle::wrap_tau;
use crate::pose::{GlobalFit, GlobalMotion, PoseHeader, PoseSample, SampleFault, channel_as_point};
use readers::Readers;
use std::f64::consts::TAU;

/// A point of lower confidence counts as not seen.
const LEAST_CONFIDENCE: f64 = 0.1;

/// Channels of the global motion, before the stream's own.
const GLOBAL_CHANNELS: [&str; 5] = ["yaw_rad", "height_m", "distance_m", "x_m", "z_m"];

/// From pose samples to gesture estimates.
///
/// [`FrontEnd::push`] takes about 50 microseconds per cyclic gesture (108 Hz, one core of a cloud
/// server) and allocates nothing.
pub struct FrontEnd {
    fit: GlobalFit,
    /// Index in the stream of each point of the set; of a channel where the stream has no points.
    columns: Vec<usize>,
    stream_points: usize,
    readers: Readers,
    trust_tracker: bool,
    swaps: SideSwaps,
    outliers: OutlierFilter,
    completion: Completion,
    filled: u64,
    rest: RestMeasure,
    /// The performer's scale; `None` while it is still to be measured.
    scale: Option<f64>,
    places: Vec<[f64; 3]>,
    seen: Vec<bool>,
    /// Per point how far it is trusted: its confidence, 0 where it was not seen.
    weights: Vec<f64>,
    fresh: Vec<[f64; 3]>,
    /// Local place of every point as it was read last; those of the reference at first.
    local: Vec<[f64; 3]>,
    home: Vec<[f64; 3]>,
    motion: GlobalMotion,
    channel_names: Vec<String>,
    channels: Vec<f64>,
    mixer: Mixer,
    last_t: Option<f64>,
    /// Features for pose maps, see [`FrontEnd::feature`].
    features: Vec<PoseFeatures>,
}

impl std::fmt::Debug for FrontEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FrontEnd")
            .field("estimates", &self.estimates())
            .field("motion", &self.motion)
            .field("last_t", &self.last_t)
            .finish_non_exhaustive()
    }
}

impl FrontEnd {
    /// Trains the planes of `set` and matches its points to those of `stream` by name; to its
    /// channels where it has no points ([`channel_as_point`]).
    ///
    /// # Errors
    /// No gesture, points the stream lacks, another dimension, options out of range.
    pub fn new(
        set: &GestureSet,
        stream: &PoseHeader,
        options: FrontEndOptions,
    ) -> Result<Self, FrontEndError> {
        let all = (0..set.gestures.len()).collect();
        Self::with_neighbourhoods(set, stream, options, &[all])
    }

    /// The same for a motion graph: `neighbourhoods` lists for every node the gestures (indices in
    /// `set`) that can be performed there, and only these are told apart while
    /// [`FrontEnd::set_active`] says so. Node 0 is active at first. Without a node all compete.
    ///
    /// # Errors
    /// As [`FrontEnd::new`].
    pub fn with_neighbourhoods(
        set: &GestureSet,
        stream: &PoseHeader,
        options: FrontEndOptions,
        neighbourhoods: &[Vec<usize>],
    ) -> Result<Self, FrontEndError> {
        if neighbourhoods.is_empty() {
            return Self::new(set, stream, options);
        }
        if set.gestures.is_empty() {
            return Err(FrontEndError::NoGestures);
        }
        Self::build(set, stream, options, neighbourhoods)
    }

    /// The same with features for pose maps; with a feature the set may be without gesture.
    ///
    /// # Errors
    /// As [`FrontEnd::new`], and features that the stream cannot give.
    pub fn with_features(
        set: &GestureSet,
        stream: &PoseHeader,
        mut options: FrontEndOptions,
        neighbourhoods: &[Vec<usize>],
        features: &[FeatureSpec],
    ) -> Result<Self, FrontEndError> {
        let features = features
            .iter()
            .map(|spec| PoseFeatures::new(spec, stream))
            .collect::<Result<Vec<_>, _>>()?;
        let mut front = if set.gestures.is_empty() && !features.is_empty() {
            // Without gestures nobody knows how far a point may go.
            options.trust_tracker = true;
            Self::build(set, stream, options, neighbourhoods)?
        } else {
            Self::with_neighbourhoods(set, stream, options, neighbourhoods)?
        };
        front.features = features;
        Ok(front)
    }

    fn build(
        set: &GestureSet,
        stream: &PoseHeader,
        options: FrontEndOptions,
        neighbourhoods: &[Vec<usize>],
    ) -> Result<Self, FrontEndError> {
        if stream.dim != set.header.dim {
            return Err(FrontEndError::Dimension {
                found: stream.dim,
                expected: set.header.dim,
            });
        }
        let columns = stream.columns_of(&set.header.points).map_err(|missing| {
            FrontEndError::MissingPoints {
                missing,
                needed: set.header.points.clone(),
            }
        })?;
        let mut settings = set.options;
        settings.lambda = options.lambda.unwrap_or(settings.lambda);
        settings
            .check()
            .map_err(|(key, found, allowed)| FrontEndError::Option {
                key,
                found,
                allowed,
            })?;
        let scale = match options.scale {
            PerformerScale::Declared(scale) if !options.scale.is_allowed() => {
                return Err(FrontEndError::Option {
                    key: "scale",
                    found: scale,
                    allowed: PerformerScale::ALLOWED,
                });
            }
            PerformerScale::Declared(scale) => Some(scale),
            PerformerScale::Rest => None,
        };
        let references = References::new(set).map_err(|anchor| FrontEndError::Anchor { anchor })?;
        let points = set.header.points.len();
        let mut home = vec![[0.0; 3]; points];
        references.fit.remove(&set.reference, None, &mut home);
        let mut channel_names: Vec<String> = GLOBAL_CHANNELS.map(String::from).to_vec();
        channel_names.extend(stream.channels.iter().cloned());
        let estimator = options.estimator;
        let readers = Readers::new(set, &references, estimator, &settings, neighbourhoods);
        // Jumps are judged in the tracker's own metres.
        let reach_m = references.reach_m / scale.unwrap_or(1.0);
        let completion = Completion::new(&references);
        let rest = RestMeasure::new(&home, &references);
        let mut fit = references.fit;
        fit.set_scale(scale.unwrap_or(1.0));
        Ok(Self {
            columns,
            stream_points: stream.points.len(),
            fit,
            readers,
            trust_tracker: options.trust_tracker,
            swaps: SideSwaps::new(&set.header.points),
            outliers: OutlierFilter::new(points, reach_m),
            completion,
            filled: 0,
            rest,
            scale,
            places: vec![[0.0; 3]; points],
            seen: vec![false; points],
            weights: vec![0.0; points],
            fresh: vec![[0.0; 3]; points],
            local: home.clone(),
            home,
            motion: GlobalMotion::default(),
            channels: vec![0.0; channel_names.len()],
            channel_names,
            mixer: Mixer::default(),
            last_t: None,
            features: Vec::new(),
        })
    }

    /// The same with one more channel, mixed from those that are there.
    ///
    /// # Errors
    /// An unknown channel in the weights, a name that is taken, a value out of range.
    pub fn with_channel(mut self, derived: &DerivedChannel) -> Result<Self, DerivedChannelError> {
        let mut mixer = std::mem::take(&mut self.mixer);
        let names: Vec<&str> = self.channel_aliases().collect();
        mixer.add(derived, &names, |name| self.channel_index(name))?;
        self.mixer = mixer;
        self.channel_names.push(derived.name.clone());
        self.channels.push(0.0);
        Ok(self)
    }

    /// Takes the next sample. A sample that is refused changes no estimate.
    ///
    /// - Left and right exchanged by the tracker are put back; a point that jumps for a sample or
    ///   two counts as not seen (unless [`FrontEndOptions::trust_tracker`]).
    /// - Points that were not seen, or with a confidence below 0.1, are put where the others say
    ///   they should be, from how all move together in the gestures. A confidence between 0.1 and 1
    ///   is how far a point is believed against that.
    ///
    /// # Errors
    /// Another number of points than the stream's header, a number that is not finite, a time that
    /// is not later than the last, less than half of the points seen (or left after the filter).
    pub fn push(&mut self, sample: &PoseSample) -> Result<(), SampleFault> {
        if sample.points.len() != self.stream_points {
            return Err(SampleFault::PointCount {
                found: sample.points.len(),
                expected: self.stream_points,
            });
        }
        let channels_finite = (sample.channels.iter().flatten()).all(|value| value.is_finite());
        if !sample.t.is_finite() || !channels_finite {
            return Err(SampleFault::NonFinite);
        }
        if let Some(last) = self.last_t.filter(|last| sample.t <= *last) {
            return Err(SampleFault::TimeBackwards { t: sample.t, last });
        }
        let mut count = 0;
        for (index, column) in self.columns.iter().enumerate() {
            let confidence = sample.confidence.get(*column).copied().unwrap_or(1.0);
            let place = if self.stream_points > 0 {
                sample.points[*column].filter(|_| confidence >= LEAST_CONFIDENCE)
            } else {
                let value = sample.channels.get(*column).copied().flatten();
                value.map(|value| channel_as_point(index, self.columns.len(), value))
            };
            if let Some(place) = place {
                // Places beyond a thousand kilometres are no places; their squares overflow nothing.
                if !place.iter().all(|value| value.abs() < 1e6) {
                    return Err(SampleFault::NonFinite);
                }
                self.places[index] = place;
                count += 1;
            }
            self.seen[index] = place.is_some();
            self.weights[index] = if place.is_some() {
                confidence.min(1.0)
            } else {
                0.0
            };
        }
        let needed = self.columns.len().div_ceil(2).max(1);
        let enough = |seen: usize| {
            if seen < needed {
                return Err(SampleFault::TooFewPoints { seen, needed });
            }
            Ok(seen as f64 / self.columns.len() as f64)
        };
        let mut share = enough(count)?;
        if !self.trust_tracker {
            let (places, seen) = (&mut self.places, &mut self.seen);
            let (outliers, weights) = (&mut self.outliers, &mut self.weights);
            self.swaps.pass(sample.t, outliers, places, seen, weights);
            outliers.pass(sample.t, places, seen);
            share = enough(seen.iter().filter(|seen| **seen).count())?;
        }
        if self.scale.is_none() {
            self.scale = self.rest.push(sample.t, &self.places, &self.seen);
            if let Some(scale) = self.scale {
                self.fit.set_scale(scale);
                // What was read at another scale is no history of this one.
                self.readers.reset();
            }
        }
        self.motion = if share < 1.0 && self.last_t.is_some() {
            let (places, seen, last) = (&self.places, &self.seen, &self.local);
            (self.fit).remove_incomplete(places, seen, last, &mut self.fresh)
        } else {
            let seen = Some(&self.seen[..]);
            self.fit.remove(&self.places, seen, &mut self.fresh)
        };
        let mut filled = 0;
        for (weight, seen) in self.weights.iter_mut().zip(&self.seen) {
            if !*seen {
                *weight = 0.0;
            }
            filled += u64::from(*weight < 1.0);
        }
        if filled == 0 {
            self.local.copy_from_slice(&self.fresh);
        } else {
            let step_s = self.last_t.map_or(f64::INFINITY, |last| sample.t - last);
            (self.completion).fill(step_s, &self.weights, &self.fresh, &mut self.local);
            self.filled += filled;
        }
        self.readers
            .push(sample.t, self.local.as_flattened(), share);
        let motion = &self.motion;
        self.channels[..GLOBAL_CHANNELS.len()].copy_from_slice(&[
            motion.yaw_rad,
            motion.height_m,
            motion.distance_m,
            motion.x_m,
            motion.z_m,
        ]);
        let own = &mut self.channels[GLOBAL_CHANNELS.len()..];
        for (channel, value) in own.iter_mut().zip(&sample.channels) {
            if let Some(value) = value {
                *channel = *value;
            }
        }
        self.mixer.mix(sample.t, &mut self.channels);
        for feature in &mut self.features {
            // Sees the points of its map; where they are too few it stays as it was.
            let _ = feature.push(sample);
        }
        self.last_t = Some(sample.t);
        Ok(())
    }

    /// The estimates at the last sample, one per gesture in the order of the file.
    pub fn estimates(&self) -> &[GestureEstimate] {
        self.readers.estimates()
    }

    /// Goes to a node of the motion graph: from now on the gestures of its neighbourhood are read,
    /// the others are silent. A node that does not exist changes nothing. Allocates nothing.
    ///
    /// Estimates are those of the last sample at once: every gesture is read in all neighbourhoods
    /// where its plane differs, all the time.
    pub fn set_active(&mut self, node: usize) {
        self.readers.set_active(node);
    }

    /// Number of planes that are read: gestures times the neighbourhoods in which theirs differ.
    pub fn planes(&self) -> usize {
        self.readers.planes()
    }

    /// What of the tracker's had to be mended since the last reset.
    pub fn tracking(&self) -> TrackingCounts {
        TrackingCounts {
            outliers: self.outliers.rejected(),
            swapped: self.swaps.undone(),
            filled: self.filled,
        }
    }

    /// The performer's scale in use; `None` while it is still to be measured at rest.
    pub fn performer_scale(&self) -> Option<f64> {
        self.scale
    }

    /// The estimate of a gesture carried on to time `t`: the phase runs on at its frequency.
    ///
    /// For the instant the servo acts, and for coasting through a gap. A gesture that does not
    /// exist is silent; a time that is not finite changes nothing.
    pub fn predict(&self, gesture: usize, t: f64) -> GestureEstimate {
        let Some(estimate) = self.estimates().get(gesture) else {
            return GestureEstimate::silent(GestureKind::Cyclic);
        };
        let mut ahead = *estimate;
        if let Some(last) = self.last_t
            && t.is_finite()
            && ahead.kind == GestureKind::Cyclic
        {
            ahead.phase_rad = wrap_tau(ahead.phase_rad + TAU * ahead.frequency_hz * (t - last));
        }
        ahead
    }

    /// Features for pose map `index`, in the order they were asked for.
    pub fn feature(&self, index: usize) -> Option<&PoseFeatures> {
        self.features.get(index)
    }

    /// What was removed from the last pose as global motion.
    pub fn global_motion(&self) -> GlobalMotion {
        self.motion
    }

    /// Value of a channel; 0 while it was never seen, the last one while it is not seen.
    pub fn channel(&self, index: usize) -> f64 {
        self.channels.get(index).copied().unwrap_or(0.0)
    }

    /// Index of a channel: `yaw_rad`, `height_m`, `distance_m`, `x_m`, `z_m` (the unit may be left
    /// out), or one of the stream's own.
    pub fn channel_index(&self, name: &str) -> Option<usize> {
        self.channel_names
            .iter()
            .position(|known| known == name)
            .or_else(|| {
                (GLOBAL_CHANNELS.iter())
                    .position(|known| known.rsplit_once('_').is_some_and(|(stem, _)| stem == name))
            })
    }

    /// Names by which channels may be asked for: as listed, and global ones without their unit.
    pub fn channel_aliases(&self) -> impl Iterator<Item = &str> {
        let stems = GLOBAL_CHANNELS
            .iter()
            .filter_map(|known| known.rsplit_once('_').map(|(stem, _)| stem));
        stems.chain(self.channel_names.iter().map(String::as_str))
    }

    /// Names of all channels, in the order of [`FrontEnd::channel`].
    pub fn channel_names(&self) -> &[String] {
        &self.channel_names
    }

    /// Time of the last sample that was taken, in seconds.
    pub fn last_t(&self) -> Option<f64> {
        self.last_t
    }

    /// Forgets all samples; planes, channels' names and the performer's scale stay.
    pub fn reset(&mut self) {
        self.readers.reset();
        self.swaps.reset();
        self.outliers.reset();
        self.rest.reset();
        self.filled = 0;
        self.local.copy_from_slice(&self.home);
        self.channels.fill(0.0);
        self.mixer.reset();
        self.features.iter_mut().for_each(PoseFeatures::reset);
        self.motion = GlobalMotion::default();
        self.last_t = None;
    }
}
