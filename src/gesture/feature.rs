//! Pose features for direct mapping: x = [places, w velocities] of the points, without global motion.
//!
//! Rhodin 2016, section 8.1.2: after removal of global motion and mean-centring a source pose is the
//! vector [x, w dx/dt], w = 0.1 s, smoothed by a one-sided Gaussian of 0.1 s. Trackers do not keep
//! their rate, so the Gaussian weighs the *intervals* between samples: both the mean place and the
//! mean velocity under the kernel are exact for a motion that is straight between samples, whatever
//! the time stamps.

use super::LONGEST_GAP_S;
use crate::pose::{
    GlobalFit, GlobalOptions, PoseHeader, PoseSample, Recording, SampleFault, channel_as_point,
};

/// The kernel ends here, in standard deviations: 0.03 % of its weight is beyond.
pub const KERNEL_SIGMAS: f64 = 3.5;
/// Samples kept: the kernel of 0.1 s is whole up to 730 Hz; of a faster stream it is shorter.
const KEPT_SAMPLES: usize = 256;
/// A point of lower confidence counts as not seen.
const LEAST_CONFIDENCE: f64 = 0.1;

/// What a feature is made of: points, what counts as global motion, centre, weights.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureSpec {
    /// Names and dimension of the points (channels do not count).
    pub header: PoseHeader,
    /// What is removed as global motion.
    pub global: GlobalOptions,
    /// The frame to which global motion is fitted, one place per point, metres.
    pub reference: Vec<[f64; 3]>,
    /// Mean local place of every point, metres; the feature is taken from here.
    pub mean: Vec<[f64; 3]>,
    /// w: how much velocities count against places, seconds (0.1); 0 leaves them out.
    pub velocity_weight_s: f64,
    /// Standard deviation of the one-sided Gaussian, seconds (0.1); 0 for none.
    pub smoothing_s: f64,
}

impl FeatureSpec {
    /// The feature of a reference recording: global motion is fitted to its first sample, the centre
    /// is the mean pose after its removal. `recording` has no gaps ([`Recording::without_gaps`]).
    ///
    /// # Errors
    /// An anchor that is no point.
    pub fn of_recording(
        recording: &Recording,
        global: GlobalOptions,
        velocity_weight_s: f64,
        smoothing_s: f64,
    ) -> Result<Self, FeatureError> {
        let points = recording.header.points.len();
        let first = recording.samples.first().map(|s| &s.points);
        let mut spec = Self {
            header: PoseHeader {
                channels: Vec::new(),
                ..recording.header.clone()
            },
            global,
            reference: (0..points)
                .map(|p| first.and_then(|f| f[p]).unwrap_or_default())
                .collect(),
            mean: vec![[0.0; 3]; points],
            velocity_weight_s,
            smoothing_s,
        };
        let mut features = PoseFeatures::new(&spec, &recording.header)?;
        let mut mean = vec![[0.0; 3]; points];
        let mut count = 0.0;
        for sample in &recording.samples {
            if features.push(sample).is_ok() {
                count += 1.0;
                let local = features.local();
                for (mean, place) in mean.as_flattened_mut().iter_mut().zip(local.as_flattened()) {
                    *mean += (place - *mean) / count;
                }
            }
        }
        spec.mean = mean;
        Ok(spec)
    }

    /// The feature at every sample of `recording` that gives one, with the index of the sample.
    ///
    /// # Errors
    /// As [`PoseFeatures::new`].
    pub fn features(&self, recording: &Recording) -> Result<Vec<(usize, Vec<f64>)>, FeatureError> {
        let mut features = PoseFeatures::new(self, &recording.header)?;
        let mut all = Vec::new();
        for (index, sample) in recording.samples.iter().enumerate() {
            if features.push(sample).is_ok()
                && let Some(feature) = features.feature()
            {
                all.push((index, feature.to_vec()));
            }
        }
        Ok(all)
    }
}

/// Why a stream has no such feature.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FeatureError {
    /// The stream lacks points.
    #[error("the pose stream has no point {}; the pose map was learned with {}; use the same tracker, or learn the map again (`handwave map learn`)", missing.join(", "), needed.join(", "))]
    MissingPoints {
        /// Points the stream lacks.
        missing: Vec<String>,
        /// All points of the feature.
        needed: Vec<String>,
    },
    /// Dimension 2 against 3.
    #[error(
        "the pose stream is {found}-dimensional, the pose map was learned from a {expected}-dimensional one; learn it again with this tracker"
    )]
    Dimension {
        /// Of the stream.
        found: usize,
        /// Of the map.
        expected: usize,
    },
    /// The anchor is none of the points.
    #[error("global.anchor `{anchor}` is none of the points of the pose map")]
    Anchor {
        /// Its name.
        anchor: String,
    },
}

/// From pose samples to features; allocates nothing after construction.
#[derive(Clone, Debug)]
pub struct PoseFeatures {
    spec: FeatureSpec,
    fit: GlobalFit,
    /// Index in the stream of each point; of a channel where the stream has no points.
    columns: Vec<usize>,
    from_points: bool,
    places: Vec<[f64; 3]>,
    seen: Vec<bool>,
    fresh: Vec<[f64; 3]>,
    /// Last known local place of every point; those of the mean at first.
    local: Vec<[f64; 3]>,
    /// Ring of the last samples: time, and one row of local coordinates each.
    times: Vec<f64>,
    rows: Vec<f64>,
    newest: usize,
    kept: usize,
    /// Places, then weighted velocities.
    feature: Vec<f64>,
    yaw_rad: f64,
}

impl PoseFeatures {
    /// Matches the points of `spec` to those of `stream` by name, or to the channels of a stream that has
    /// no points.
    ///
    /// # Errors
    /// Points the stream lacks, another dimension, an anchor that is no point.
    pub fn new(spec: &FeatureSpec, stream: &PoseHeader) -> Result<Self, FeatureError> {
        if stream.dim != spec.header.dim {
            return Err(FeatureError::Dimension {
                found: stream.dim,
                expected: spec.header.dim,
            });
        }
        let names = &spec.header.points;
        let columns =
            (stream.columns_of(names)).map_err(|missing| FeatureError::MissingPoints {
                missing,
                needed: names.clone(),
            })?;
        let fit = GlobalFit::new(&spec.header, &spec.reference, &spec.global)
            .map_err(|anchor| FeatureError::Anchor { anchor })?;
        let points = names.len();
        let mut spec = spec.clone();
        spec.mean.resize(points, [0.0; 3]);
        let width = points * spec.header.dim;
        Ok(Self {
            columns,
            from_points: !stream.points.is_empty(),
            places: vec![[0.0; 3]; points],
            seen: vec![false; points],
            fresh: vec![[0.0; 3]; points],
            local: spec.mean.clone(),
            times: vec![0.0; KEPT_SAMPLES],
            rows: vec![0.0; KEPT_SAMPLES * width],
            newest: 0,
            kept: 0,
            feature: vec![0.0; 2 * width],
            yaw_rad: 0.0,
            fit,
            spec,
        })
    }

    /// Numbers in a feature: twice the coordinates of the points (6 V in space, 4 V in an image).
    pub fn len(&self) -> usize {
        self.feature.len()
    }

    /// Whether the feature has no number.
    pub fn is_empty(&self) -> bool {
        self.feature.is_empty()
    }

    /// Takes the next sample. A sample that is refused changes nothing. Points that are not seen
    /// stay where they last were relative to the body.
    ///
    /// # Errors
    /// Numbers that are not finite, a time that is not later than the last, less than half of the
    /// points seen.
    pub fn push(&mut self, sample: &PoseSample) -> Result<(), SampleFault> {
        if !sample.t.is_finite() {
            return Err(SampleFault::NonFinite);
        }
        let last = self.times[self.newest];
        if self.kept > 0 && sample.t <= last {
            return Err(SampleFault::TimeBackwards { t: sample.t, last });
        }
        let mut count = 0;
        for (index, column) in self.columns.iter().enumerate() {
            let confidence = sample.confidence.get(*column).copied().unwrap_or(1.0);
            let place = if self.from_points {
                let place = sample.points.get(*column).copied().flatten();
                place.filter(|_| confidence >= LEAST_CONFIDENCE)
            } else {
                let value = sample.channels.get(*column).copied().flatten();
                value.map(|value| channel_as_point(index, self.columns.len(), value))
            };
            if let Some(place) = place {
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
        let motion = (self.fit).remove(&self.places, Some(&self.seen), &mut self.fresh);
        self.yaw_rad = motion.yaw_rad;
        for (index, seen) in self.seen.iter().enumerate() {
            if *seen {
                self.local[index] = self.fresh[index];
            }
        }
        if sample.t - last > LONGEST_GAP_S {
            self.kept = 0;
        }
        self.newest = (self.newest + 1) % KEPT_SAMPLES;
        self.kept = (self.kept + 1).min(KEPT_SAMPLES);
        self.times[self.newest] = sample.t;
        let (dim, width) = (self.spec.header.dim, self.feature.len() / 2);
        let row = &mut self.rows[self.newest * width..][..width];
        for (out, place) in row.chunks_exact_mut(dim).zip(&self.local) {
            out.copy_from_slice(&place[..dim]);
        }
        self.smooth();
        Ok(())
    }

    /// Mean place and velocity under the kernel.
    fn smooth(&mut self) {
        let (dim, width) = (self.spec.header.dim, self.feature.len() / 2);
        let sigma = self.spec.smoothing_s;
        let now = self.times[self.newest];
        let (places, velocities) = self.feature.split_at_mut(width);
        places.fill(0.0);
        velocities.fill(0.0);
        let mut total = 0.0;
        for back in 0..self.kept.saturating_sub(1) {
            let late = (self.newest + KEPT_SAMPLES - back) % KEPT_SAMPLES;
            let early = (late + KEPT_SAMPLES - 1) % KEPT_SAMPLES;
            let step = self.times[late] - self.times[early];
            let age = now - 0.5 * (self.times[late] + self.times[early]);
            if back > 0 && !(age <= KERNEL_SIGMAS * sigma) {
                break;
            }
            let weight = if sigma > 0.0 {
                (-0.5 * (age / sigma).powi(2)).exp()
            } else {
                1.0
            };
            total += weight * step;
            let rows = (late * width, early * width);
            for c in 0..width {
                let (b, a) = (self.rows[rows.0 + c], self.rows[rows.1 + c]);
                places[c] += weight * step * 0.5 * (a + b);
                velocities[c] += weight * (b - a);
            }
        }
        let newest = &self.rows[self.newest * width..][..width];
        for c in 0..width {
            let smoothed = total > 0.0 && sigma > 0.0;
            let place = if smoothed {
                places[c] / total
            } else {
                newest[c]
            };
            places[c] = place - self.spec.mean[c / dim][c % dim];
            velocities[c] *= if total > 0.0 {
                self.spec.velocity_weight_s / total
            } else {
                0.0
            };
        }
    }

    /// The feature at the last sample: places from the mean, metres, then w times their velocities,
    /// metres; `None` before the first sample.
    pub fn feature(&self) -> Option<&[f64]> {
        (self.kept > 0).then_some(&self.feature)
    }

    /// Local places at the last sample, metres.
    pub fn local(&self) -> &[[f64; 3]] {
        &self.local
    }

    /// Yaw of the body against the reference at the last sample, rad.
    pub fn yaw_rad(&self) -> f64 {
        self.yaw_rad
    }

    /// Forgets all samples.
    pub fn reset(&mut self) {
        self.kept = 0;
        self.yaw_rad = 0.0;
        self.local.copy_from_slice(&self.spec.mean);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn spec(velocity_weight_s: f64, smoothing_s: f64) -> FeatureSpec {
        FeatureSpec {
            header: PoseHeader {
                points: vec!["a".into(), "b".into()],
                dim: 3,
                channels: Vec::new(),
            },
            global: GlobalOptions::default(),
            reference: vec![[0.0; 3]; 2],
            mean: vec![[0.0; 3]; 2],
            velocity_weight_s,
            smoothing_s,
        }
    }

    fn sample(t: f64, x: f64) -> PoseSample {
        PoseSample {
            t,
            points: vec![Some([x, 0.0, 0.0]), Some([0.0, -x, 0.0])],
            ..PoseSample::default()
        }
    }

    #[test]
    fn bad_samples_are_refused_and_change_nothing() {
        let spec = spec(0.1, 0.1);
        let mut features = PoseFeatures::new(&spec, &spec.header).expect("same points");
        assert_eq!(features.feature(), None);
        features.push(&sample(1.0, 0.2)).expect("a good sample");
        let before = features.feature().map(<[f64]>::to_vec);
        let mut unseen = sample(1.1, 0.5);
        unseen.points = vec![None, None];
        let mut absurd = sample(1.1, 0.5);
        absurd.points[1] = Some([f64::INFINITY, 0.0, 0.0]);
        for bad in [
            sample(1.0, 0.5),
            sample(f64::NAN, 0.5),
            sample(0.2, 0.5),
            unseen,
            absurd,
        ] {
            assert!(features.push(&bad).is_err(), "{bad:?} was taken");
            assert_eq!(features.feature().map(<[f64]>::to_vec), before);
        }
        let other = PoseHeader {
            points: vec!["a".into(), "c".into()],
            dim: 3,
            channels: Vec::new(),
        };
        let message = PoseFeatures::new(&spec, &other).expect_err("no point b");
        assert!(message.to_string().contains("no point b"), "{message}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(128))]
        /// A straight motion under any stamps: its velocity is exact, its place that of the
        /// kernel's mean age, 0.8 sigma = 80 ms ago.
        #[test]
        fn stamps_do_not_bend_a_straight_motion(
            steps in prop::collection::vec(0.001..0.02f64, 60..200),
            speed in -3.0..3.0f64,
        ) {
            let spec = spec(0.1, 0.1);
            let mut features = PoseFeatures::new(&spec, &spec.header).expect("same points");
            let mut t = 0.0;
            for step in &steps {
                t += step;
                features.push(&sample(t, speed * t)).expect("a good sample");
            }
            let feature = features.feature().expect("samples came");
            prop_assert!((feature[6] - 0.1 * speed).abs() < 1e-9, "w v {}", feature[6]);
            prop_assert!((feature[10] + 0.1 * speed).abs() < 1e-9, "w v {}", feature[10]);
            if t > 0.4 {
                let lag_s = t - feature[0] / speed;
                prop_assert!(speed.abs() < 0.1 || (lag_s - 0.08).abs() < 0.004, "lag {lag_s} s");
            }
        }
    }

    #[test]
    fn after_a_gap_it_begins_anew() {
        let spec = spec(0.1, 0.1);
        let mut features = PoseFeatures::new(&spec, &spec.header).expect("same points");
        for k in 0..50 {
            let t = f64::from(k) * 0.01;
            features.push(&sample(t, t)).expect("a good sample");
        }
        features.push(&sample(5.0, 0.3)).expect("a good sample");
        let feature = features.feature().expect("samples came");
        assert!((feature[0] - 0.3).abs() < 1e-12, "place {}", feature[0]);
        assert_eq!(feature[6], 0.0, "no velocity across a gap");
    }
}
