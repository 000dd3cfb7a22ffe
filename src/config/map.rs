//! Pose maps of a configuration: the map file read, its features computed, the map learned.

use super::error::ConfigError;
use super::files::Files;
use crate::gesture::{FeatureError, FeatureSpec, KERNEL_SIGMAS, PoseFeatures};
use crate::motion::clip::{Clip, ClipError, ClipFile};
use crate::motion::mapping::file::{FiledPair, VolumeSource};
use crate::motion::mapping::{
    MOST_AXES, MapFile, MapFileError, MapOptions, MappingError, NOISE_VARIANCE, Pair, PoseMap,
    RootMap, learn_volume,
};
use crate::pose::{PoseSample, Recording};
use std::path::Path;

/// A pose map ready to be played, and the feature that it listens to.
#[derive(Clone, Debug)]
pub struct MapParts {
    /// What its feature is made of.
    pub spec: FeatureSpec,
    /// The map, joints in the order of the body.
    pub map: PoseMap,
}

/// Why a map file cannot be played.
#[derive(Debug, thiserror::Error)]
pub enum MapError {
    /// The map file or a clip cannot be read.
    #[error("{0}")]
    Read(#[from] ConfigError),
    /// The map file is wrong.
    #[error("{file}: {source}")]
    File {
        /// The map file.
        file: String,
        /// What is wrong.
        source: MapFileError,
    },
    /// A clip of target motion is wrong.
    #[error("{file}: {source}")]
    Clip {
        /// The clip's file.
        file: String,
        /// What is wrong.
        source: ClipError,
    },
    /// Points, reference and anchor do not fit.
    #[error("{file}: {source}")]
    Feature {
        /// The map file.
        file: String,
        /// What is wrong.
        source: FeatureError,
    },
    /// The pairs teach nothing.
    #[error("{file}: {source}")]
    Learn {
        /// The map file.
        file: String,
        /// What is wrong.
        source: MappingError,
    },
}

/// What the feature of a map file is made of.
pub fn feature_spec(file: &MapFile) -> FeatureSpec {
    FeatureSpec {
        header: file.header.clone(),
        global: file.global.clone(),
        reference: file.reference.clone(),
        mean: file.mean.clone(),
        velocity_weight_s: file.velocity_weight_s,
        smoothing_s: file.smoothing_s,
    }
}

/// The feature at the last frame of a filed pair.
///
/// # Errors
/// An anchor that is no point.
pub fn feature_of(spec: &FeatureSpec, pair: &FiledPair) -> Result<Vec<f64>, FeatureError> {
    let mut features = PoseFeatures::new(spec, &spec.header)?;
    for (t, frame) in pair.times_s.iter().zip(&pair.frames) {
        let sample = PoseSample {
            t: *t,
            points: frame.iter().map(|place| Some(*place)).collect(),
            ..PoseSample::default()
        };
        // The file was checked: numbers are finite and times rise.
        let _ = features.push(&sample);
    }
    Ok(features.feature().unwrap_or_default().to_vec())
}

/// What a source pose shall mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Lesson {
    /// Time of a sample of the recording, seconds.
    pub t_s: f64,
    /// Target pose, rad.
    pub pose: Vec<f64>,
    /// Name for people.
    pub name: String,
}

/// A map file of `lessons`, each with the stretch of `recording` that its feature needs. Joints and
/// volume are the caller's to fill in; the options are the defaults and those of `spec`.
pub fn teach(
    recording: &Recording,
    spec: &FeatureSpec,
    spread_m: f64,
    lessons: &[Lesson],
) -> MapFile {
    let pairs = lessons.iter().map(|lesson| {
        // One sample more than the kernel reaches, for its first interval.
        let reach_s = KERNEL_SIGMAS * spec.smoothing_s;
        let until = (recording.samples).partition_point(|s| s.t <= lesson.t_s + 1e-9);
        let samples = &recording.samples[..until];
        let from = samples
            .partition_point(|s| s.t < lesson.t_s - reach_s)
            .min(until.saturating_sub(1))
            .saturating_sub(1);
        let samples = &samples[from..];
        let start = samples.first().map_or(0.0, |s| s.t);
        let frame = |s: &PoseSample| s.points.iter().map(|p| p.unwrap_or_default()).collect();
        FiledPair {
            name: lesson.name.clone(),
            pose: lesson.pose.clone(),
            times_s: samples.iter().map(|s| s.t - start).collect(),
            frames: samples.iter().map(frame).collect(),
        }
    });
    MapFile {
        header: spec.header.clone(),
        global: spec.global.clone(),
        reference: spec.reference.clone(),
        mean: spec.mean.clone(),
        spread_m,
        recording: String::new(),
        velocity_weight_s: spec.velocity_weight_s,
        smoothing_s: spec.smoothing_s,
        noise_variance: NOISE_VARIANCE,
        components: MOST_AXES,
        yaw_ratio: 0.0,
        joints: Vec::new(),
        volume: VolumeSource::Clips(Vec::new()),
        pairs: pairs.collect(),
    }
}

/// Reads the map file `path` of `files` and learns its map for a body with the given joints and
/// limits (rad, the same order).
///
/// # Errors
/// An unreadable or wrong file, a body that does not fit, pairs that teach nothing.
pub fn load_map(
    files: &Files,
    path: &str,
    joints: &[String],
    lower: &[f64],
    upper: &[f64],
) -> Result<MapParts, MapError> {
    let text = files.read(path)?;
    let name = files.name(path);
    let in_file = |source| MapError::File {
        file: name.clone(),
        source,
    };
    let file = MapFile::from_toml(&text).map_err(in_file)?;
    let file = file.for_body(joints).map_err(in_file)?;
    let mut clips = Vec::new();
    if let VolumeSource::Clips(paths) = &file.volume {
        let folder = Path::new(path).parent().unwrap_or(Path::new(""));
        for clip in paths {
            clips.push(clip_of(
                files,
                &folder.join(clip).to_string_lossy(),
                joints,
            )?);
        }
    }
    build_map(&name, &file, &clips, lower, upper)
}

fn clip_of(files: &Files, path: &str, joints: &[String]) -> Result<Clip, MapError> {
    let text = files.read(path)?;
    ClipFile::from_json(&text)
        .and_then(|clip| clip.for_body(joints))
        .map_err(|source| MapError::Clip {
            file: files.name(path),
            source,
        })
}

/// Learns the map of `file`, whose joints are in the order of `lower`, `upper` and `clips`; `name`
/// stands in messages.
///
/// # Errors
/// Pairs that teach nothing, poses outside of the limits, an anchor that is no point.
pub fn build_map(
    name: &str,
    file: &MapFile,
    clips: &[Clip],
    lower: &[f64],
    upper: &[f64],
) -> Result<MapParts, MapError> {
    let spec = feature_spec(file);
    let learn = |source| MapError::Learn {
        file: name.into(),
        source,
    };
    let (volume, root) = match &file.volume {
        VolumeSource::Clips(_) => learn_volume(clips, file.components).map_err(learn)?,
        VolumeSource::Volume(volume, root) => {
            let weights = root.clone();
            (volume.clone(), RootMap { weights })
        }
    };
    let volume = volume.within(lower, upper).map_err(learn)?;
    let mut pairs = Vec::new();
    for (k, pair) in file.pairs.iter().enumerate() {
        let source = feature_of(&spec, pair).map_err(|source| MapError::Feature {
            file: name.into(),
            source,
        })?;
        pairs.push(Pair {
            label: format!("pair {} ({})", k + 1, pair.name),
            source,
            target: pair.pose.clone(),
        });
    }
    let options = MapOptions {
        noise_variance: file.noise_variance,
        yaw_ratio: file.yaw_ratio,
    };
    let map = PoseMap::learn(&pairs, file.spread_m, volume, root, options).map_err(learn)?;
    Ok(MapParts { spec, map })
}
