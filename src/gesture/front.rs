//! The front end: pose samples in, one estimate per gesture out, every sample, no allocation.

use super::channel::{DerivedChannel, DerivedChannelError, Mixer};
use super::wave::ProgressionSmoother;
use super::{Estimator, EstimatorKind, GestureKind, GestureSet, Plane, References};
use crate::base::angle::wrap_tau;
use crate::pose::{GlobalFit, GlobalMotion, PoseHeader, PoseSample, SampleFault, channel_as_point};
use std::f64::consts::TAU;

/// A point of lower confidence counts as not seen.
const LEAST_CONFIDENCE: f64 = 0.1;

/// Channels of the global motion, before the stream's own.
const GLOBAL_CHANNELS: [&str; 5] = ["yaw_rad", "height_m", "distance_m", "x_m", "z_m"];

/// What may differ between uses of the same gesture file.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct FrontEndOptions {
    /// Which estimator reads the waves.
    pub estimator: EstimatorKind,
    /// Window in periods instead of the file's; 0.5 for a robot.
    pub lambda: Option<f64>,
}

/// Why gestures and stream do not fit together.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FrontEndError {
    /// The set has no gesture.
    #[error("the gesture file has no gesture; add one with `handwave gesture define`")]
    NoGestures,
    /// The stream lacks points of the set.
    #[error("the pose stream has no point {}; the gestures were defined with {}; use the same tracker, or define the gestures again", missing.join(", "), needed.join(", "))]
    MissingPoints {
        /// Points the stream lacks.
        missing: Vec<String>,
        /// All points of the set.
        needed: Vec<String>,
    },
    /// Dimension 2 against 3.
    #[error(
        "the pose stream is {found}-dimensional, the gestures are {expected}-dimensional; define them again with this tracker"
    )]
    Dimension {
        /// Of the stream.
        found: usize,
        /// Of the set.
        expected: usize,
    },
    /// The anchor is none of the set's points.
    #[error("global.anchor `{anchor}` is none of the gesture file's points")]
    Anchor {
        /// The anchor's name.
        anchor: String,
    },
    /// An option out of range.
    #[error("option {key}: found {found}; allowed: {allowed}")]
    Option {
        /// The key.
        key: &'static str,
        /// Its value.
        found: f64,
        /// Values allowed.
        allowed: &'static str,
    },
}

/// Amplitude, frequency and phase of one gesture.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct GestureEstimate {
    /// Cyclic: 0 = not performed, 1 = as large as shown. Non-cyclic: progression, 0 at rest, 1 at
    /// the extreme. Not clamped.
    pub amplitude: f64,
    /// Cycles per second, negative in the opposite sense; 0 for non-cyclic gestures.
    pub frequency_hz: f64,
    /// [0, 2 pi); for non-cyclic gestures 2 pi times the progression, wrapped.
    pub phase_rad: f64,
    /// Cyclic: how much of the motion is that wave; non-cyclic: share of points seen. 0..1.
    pub quality: f64,
    /// Whether the gesture repeats.
    pub kind: GestureKind,
}

/// How one gesture is read.
enum Reading {
    Wave(Box<dyn Estimator>),
    Progression(ProgressionSmoother),
}

/// From pose samples to gesture estimates.
///
/// [`FrontEnd::push`] takes about 50 microseconds per cyclic gesture (108 Hz, one core of a cloud
/// server) and allocates nothing.
pub struct FrontEnd {
    fit: GlobalFit,
    /// Index in the stream of each point of the set; of a channel where the stream has no points.
    columns: Vec<usize>,
    stream_points: usize,
    planes: Vec<Plane>,
    readings: Vec<Reading>,
    estimates: Vec<GestureEstimate>,
    with_variance: bool,
    places: Vec<[f64; 3]>,
    seen: Vec<bool>,
    fresh: Vec<[f64; 3]>,
    /// Last known local place of every point; those of the reference at first.
    local: Vec<[f64; 3]>,
    home: Vec<[f64; 3]>,
    motion: GlobalMotion,
    channel_names: Vec<String>,
    channels: Vec<f64>,
    mixer: Mixer,
    last_t: Option<f64>,
}

impl std::fmt::Debug for FrontEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FrontEnd")
            .field("estimates", &self.estimates)
            .field("motion", &self.motion)
            .field("last_t", &self.last_t)
            .finish_non_exhaustive()
    }
}

impl FrontEnd {
    /// Trains the planes of `set` and matches its points to those of `stream` by name.
    ///
    /// # Errors
    /// No gesture, points the stream lacks, another dimension, options out of range.
    pub fn new(
        set: &GestureSet,
        stream: &PoseHeader,
        options: FrontEndOptions,
    ) -> Result<Self, FrontEndError> {
        if set.gestures.is_empty() {
            return Err(FrontEndError::NoGestures);
        }
        if stream.dim != set.header.dim {
            return Err(FrontEndError::Dimension {
                found: stream.dim,
                expected: set.header.dim,
            });
        }
        // A stream of channels alone (a face) is read as points that move with its channels.
        let places = if stream.points.is_empty() {
            &stream.channels
        } else {
            &stream.points
        };
        let find = |name: &String| places.iter().position(|place| place == name);
        let missing: Vec<String> = set
            .header
            .points
            .iter()
            .filter(|name| find(name).is_none())
            .cloned()
            .collect();
        if !missing.is_empty() {
            return Err(FrontEndError::MissingPoints {
                missing,
                needed: set.header.points.clone(),
            });
        }
        let mut settings = set.options;
        settings.lambda = options.lambda.unwrap_or(settings.lambda);
        settings
            .check()
            .map_err(|(key, found, allowed)| FrontEndError::Option {
                key,
                found,
                allowed,
            })?;
        let references = References::new(set).map_err(|anchor| FrontEndError::Anchor { anchor })?;
        let points = set.header.points.len();
        let mut home = vec![[0.0; 3]; points];
        references.fit.remove(&set.reference, None, &mut home);
        let mut channel_names: Vec<String> = GLOBAL_CHANNELS.map(String::from).to_vec();
        channel_names.extend(stream.channels.iter().cloned());
        let planes: Vec<Plane> = (0..set.gestures.len())
            .map(|index| Plane::train(set, &references, index))
            .collect();
        Ok(Self {
            columns: set.header.points.iter().filter_map(find).collect(),
            stream_points: stream.points.len(),
            fit: references.fit,
            readings: set
                .gestures
                .iter()
                .zip(&planes)
                .map(|(gesture, plane)| match gesture.kind {
                    GestureKind::Cyclic => {
                        Reading::Wave(options.estimator.build(&settings, plane.shape()))
                    }
                    GestureKind::NonCyclic => Reading::Progression(ProgressionSmoother::new(
                        settings.progression_smoothing_s,
                    )),
                })
                .collect(),
            estimates: set
                .gestures
                .iter()
                .map(|gesture| silent(gesture.kind))
                .collect(),
            planes,
            with_variance: settings.under_constrained,
            places: vec![[0.0; 3]; points],
            seen: vec![false; points],
            fresh: vec![[0.0; 3]; points],
            local: home.clone(),
            home,
            motion: GlobalMotion::default(),
            channels: vec![0.0; channel_names.len()],
            channel_names,
            mixer: Mixer::default(),
            last_t: None,
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

    /// Takes the next sample. A sample that is refused changes nothing.
    ///
    /// Points that were not seen (or with a confidence below 0.1) stay where they last were
    /// relative to the body.
    ///
    /// # Errors
    /// Another number of points than the stream's header, a number that is not finite, a time that
    /// is not later than the last, less than half of the points seen.
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
        }
        let needed = self.columns.len().div_ceil(2).max(1);
        if count < needed {
            return Err(SampleFault::TooFewPoints {
                seen: count,
                needed,
            });
        }
        self.motion = self
            .fit
            .remove(&self.places, Some(&self.seen), &mut self.fresh);
        for (index, seen) in self.seen.iter().enumerate() {
            if *seen {
                self.local[index] = self.fresh[index];
            }
        }
        let flat = self.local.as_flattened();
        let share = count as f64 / self.columns.len() as f64;
        for ((plane, reading), estimate) in self
            .planes
            .iter()
            .zip(&mut self.readings)
            .zip(&mut self.estimates)
        {
            match reading {
                Reading::Wave(estimator) => {
                    estimator.push(sample.t, plane.apply(flat, self.with_variance));
                    let wave = estimator.estimate();
                    estimate.amplitude = wave.amplitude;
                    estimate.frequency_hz = wave.frequency_hz;
                    estimate.phase_rad = wave.phase_rad;
                    estimate.quality = wave.quality;
                }
                Reading::Progression(smoother) => {
                    let progression = smoother.push(sample.t, plane.apply(flat, false).z[0]);
                    estimate.amplitude = progression;
                    estimate.phase_rad = wrap_tau(TAU * progression);
                    estimate.quality = share;
                }
            }
        }
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
        self.last_t = Some(sample.t);
        Ok(())
    }

    /// The estimates at the last sample, one per gesture in the order of the file.
    pub fn estimates(&self) -> &[GestureEstimate] {
        &self.estimates
    }

    /// The estimate of a gesture carried on to time `t`: the phase runs on at its frequency.
    ///
    /// For the instant the servo acts, and for coasting through a gap. A gesture that does not
    /// exist is silent; a time that is not finite changes nothing.
    pub fn predict(&self, gesture: usize, t: f64) -> GestureEstimate {
        let Some(estimate) = self.estimates.get(gesture) else {
            return silent(GestureKind::Cyclic);
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

    /// Forgets all samples; planes and channels' names stay.
    pub fn reset(&mut self) {
        for reading in &mut self.readings {
            match reading {
                Reading::Wave(estimator) => estimator.reset(),
                Reading::Progression(smoother) => smoother.reset(),
            }
        }
        for estimate in &mut self.estimates {
            *estimate = silent(estimate.kind);
        }
        self.local.copy_from_slice(&self.home);
        self.channels.fill(0.0);
        self.mixer.reset();
        self.motion = GlobalMotion::default();
        self.last_t = None;
    }
}

fn silent(kind: GestureKind) -> GestureEstimate {
    GestureEstimate {
        amplitude: 0.0,
        frequency_hz: 0.0,
        phase_rad: 0.0,
        quality: 0.0,
        kind,
    }
}
