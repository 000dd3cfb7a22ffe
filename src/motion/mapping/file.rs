//! The map file: TOML, complete in itself, written by `handwave map learn`.
//!
//! ```toml
//! handwave = "map"
//! version = 1
//!
//! [source]                                # the performer
//! points = ["head", "left", "right"]      # what is tracked, by name
//! dim = 3                                 # coordinates per point, 2 or 3
//! # The frame to which global motion is fitted, and the mean place of every point after its removal:
//! # x, y, z of every point in metres.
//! reference = [0.02, 1.75, -1.38, 0.22, 1.40, -1.05, -0.18, 1.38, -1.07]
//! mean = [0.02, 1.75, -1.38, 0.20, 1.38, -1.02, -0.15, 1.41, -1.01]
//! spread_m = 0.31                         # root mean square distance of poses from that mean
//! global = { anchor = "head", yaw = false }   # what counts as global motion (optional), as in a gesture file
//! recording = "vr_dance.csv"              # where the pairs come from (for people)
//!
//! [options]                               # all optional, here with their defaults
//! velocity_weight_s = 0.1                 # w of [x, w dx/dt]; 0 leaves velocities out
//! smoothing_s = 0.1                       # one-sided Gaussian over the source
//! noise_variance = 0.05                   # sigma^2: more smooths the map, less meets the pairs closer
//! components = 50                         # most principal axes of the target
//! yaw_ratio = 0.0                         # turn of the root per turn of the performer
//!
//! [target]                                # the body
//! joints = ["joint1", "joint2"]
//! clips = ["../clips/arm_sweep.json"]     # unlabelled motion, relative to this file; or [volume] below
//!
//! [volume]                                # instead of clips: the admissible poses themselves
//! mean = [0.0, 0.1]                       # one number per joint
//! axes = [[1.0, 0.0], [0.0, 1.0]]         # principal axes, one row each, orthonormal
//! low = [-1.2, -0.5]                      # interval of every axis
//! high = [1.2, 0.6]
//! kept = 1.0                              # share of the variance that the axes hold
//! root = [[0.0, 0.0], [0.0, 0.0]]         # optional: m/s forwards and left per unit of |change| along each axis
//!
//! [[pair]]                                # 2 or more
//! name = "5.85 s = arm_reach@1"           # for people
//! pose = { joint1 = 0.4, joint2 = -0.3 }  # target pose, rad
//! # The source up to the instant of the pair, so that smoothing and velocity are there too.
//! # One row per frame: seconds from the first, then x, y, z of every point in metres as tracked.
//! frames = [
//!   [0.0, 0.02, 1.75, -1.38, 0.22, 1.40, -1.05, -0.18, 1.38, -1.07],
//!   [0.0112, 0.02, 1.75, -1.38, 0.22, 1.41, -1.05, -0.18, 1.38, -1.06],
//! ]
//! ```
//! Unknown keys are errors.

use super::volume::{LatentVolume, MOST_AXES};
use crate::pose::{GlobalOptions, PoseHeader};
use serde::Deserialize;
use std::collections::BTreeMap;

/// Format version this program reads and writes.
pub const VERSION: u64 = 1;

/// Why a map file cannot be used: key, what was found, what is allowed. The file's name is the caller's.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MapFileError {
    /// Not TOML, an unknown key or a value of the wrong type; with line and column.
    #[error("{0}")]
    Syntax(String),
    /// A value that is not allowed.
    #[error("{key}: found {found}; allowed: {allowed}")]
    Value {
        /// The key, as `pair "5.85 s".frames row 3`.
        key: String,
        /// What stands there.
        found: String,
        /// What may stand there.
        allowed: String,
    },
}

/// Where the admissible poses come from.
#[derive(Clone, Debug, PartialEq)]
pub enum VolumeSource {
    /// Clips of unlabelled target motion, paths relative to the map file.
    Clips(Vec<String>),
    /// The volume itself (joint limits open), and two rows of root weights, empty for none.
    Volume(LatentVolume, Vec<f64>),
}

/// A pair as filed.
#[derive(Clone, Debug, PartialEq)]
pub struct FiledPair {
    /// Name for people.
    pub name: String,
    /// Target pose, in the order of [`MapFile::joints`].
    pub pose: Vec<f64>,
    /// Seconds from the first frame.
    pub times_s: Vec<f64>,
    /// One place per point and frame, metres, as tracked; the last is the instant of the pair.
    pub frames: Vec<Vec<[f64; 3]>>,
}

/// A map file, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct MapFile {
    /// Names and dimension of the points.
    pub header: PoseHeader,
    /// What counts as global motion.
    pub global: GlobalOptions,
    /// The frame to which global motion is fitted, metres.
    pub reference: Vec<[f64; 3]>,
    /// Mean local place of every point, metres.
    pub mean: Vec<[f64; 3]>,
    /// Root mean square distance of source poses from their mean, metres.
    pub spread_m: f64,
    /// Where the pairs come from, for people.
    pub recording: String,
    /// w of the feature, seconds.
    pub velocity_weight_s: f64,
    /// Standard deviation of the source's smoothing, seconds.
    pub smoothing_s: f64,
    /// sigma^2 of the regression.
    pub noise_variance: f64,
    /// Most principal axes.
    pub components: usize,
    /// Turn of the root per turn of the performer.
    pub yaw_ratio: f64,
    /// Joints of the body.
    pub joints: Vec<String>,
    /// Admissible poses.
    pub volume: VolumeSource,
    /// The pairs.
    pub pairs: Vec<FiledPair>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileTable {
    handwave: String,
    version: u64,
    source: SourceTable,
    #[serde(default)]
    options: OptionsTable,
    target: TargetTable,
    volume: Option<VolumeTable>,
    #[serde(default)]
    pair: Vec<PairTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SourceTable {
    points: Vec<String>,
    #[serde(default = "three")]
    dim: usize,
    reference: Vec<f64>,
    mean: Vec<f64>,
    spread_m: f64,
    #[serde(default)]
    global: GlobalOptions,
    #[serde(default)]
    recording: String,
}

fn three() -> usize {
    3
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct OptionsTable {
    velocity_weight_s: f64,
    smoothing_s: f64,
    noise_variance: f64,
    components: usize,
    yaw_ratio: f64,
}

impl Default for OptionsTable {
    fn default() -> Self {
        Self {
            velocity_weight_s: 0.1,
            smoothing_s: 0.1,
            noise_variance: super::NOISE_VARIANCE,
            components: MOST_AXES,
            yaw_ratio: 0.0,
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TargetTable {
    joints: Vec<String>,
    clips: Option<Vec<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct VolumeTable {
    mean: Vec<f64>,
    axes: Vec<Vec<f64>>,
    low: Vec<f64>,
    high: Vec<f64>,
    #[serde(default = "whole")]
    kept: f64,
    #[serde(default)]
    root: Vec<Vec<f64>>,
}

fn whole() -> f64 {
    1.0
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PairTable {
    #[serde(default)]
    name: String,
    pose: BTreeMap<String, f64>,
    frames: Vec<Vec<f64>>,
}

fn value(key: impl Into<String>, found: impl ToString, allowed: impl Into<String>) -> MapFileError {
    MapFileError::Value {
        key: key.into(),
        found: found.to_string(),
        allowed: allowed.into(),
    }
}

/// Turns a flat row into places; the row is as long as it should be.
fn places(row: &[f64], dim: usize) -> Vec<[f64; 3]> {
    row.chunks_exact(dim)
        .map(|c| {
            let mut place = [0.0; 3];
            place[..dim].copy_from_slice(c);
            place
        })
        .collect()
}

/// Fails unless `row` has `width` finite numbers.
fn check_row(key: &str, row: &[f64], width: usize, what: &str) -> Result<(), MapFileError> {
    if row.len() != width {
        let found = format!("{} numbers", row.len());
        return Err(value(key, found, format!("{width} numbers: {what}")));
    }
    match row.iter().find(|v| !(v.abs() <= 1e6)) {
        Some(bad) => Err(value(key, bad, "finite numbers")),
        None => Ok(()),
    }
}

/// Fails on an empty list, an empty name or one that is there twice.
fn check_names(key: &str, names: &[String]) -> Result<(), MapFileError> {
    if names.is_empty() {
        return Err(value(key, "none", "at least one name"));
    }
    for (index, name) in names.iter().enumerate() {
        if name.is_empty() || names[..index].contains(name) {
            return Err(value(
                key,
                format!("{name:?}"),
                "different, non-empty names",
            ));
        }
    }
    Ok(())
}

impl MapFile {
    /// Reads a map file and checks all that it says of itself.
    ///
    /// # Errors
    /// TOML that is wrong, unknown keys, values that are not allowed.
    pub fn from_toml(text: &str) -> Result<Self, MapFileError> {
        let table: FileTable = toml::from_str(text)
            .map_err(|error| MapFileError::Syntax(error.to_string().trim_end().to_owned()))?;
        if table.handwave != "map" {
            let found = format!("{:?}", table.handwave);
            return Err(value("handwave", found, "\"map\""));
        }
        if table.version != VERSION {
            let allowed = "1; a newer version needs a newer handwave";
            return Err(value("version", table.version, allowed));
        }
        let source = table.source;
        if !(2..=3).contains(&source.dim) {
            return Err(value("source.dim", source.dim, "2 or 3"));
        }
        check_names("source.points", &source.points)?;
        check_names("target.joints", &table.target.joints)?;
        if let Some(anchor) = &source.global.anchor
            && !source.points.contains(anchor)
        {
            let allowed = format!("one of the points: {}", source.points.join(", "));
            return Err(value("source.global.anchor", anchor, allowed));
        }
        let dim = source.dim;
        let width = source.points.len() * dim;
        let what = format!("{dim} coordinates of each point");
        check_row("source.reference", &source.reference, width, &what)?;
        check_row("source.mean", &source.mean, width, &what)?;
        let options = table.options;
        for (key, found, low, high) in [
            ("source.spread_m", source.spread_m, 1e-6, 1e6),
            (
                "options.velocity_weight_s",
                options.velocity_weight_s,
                0.0,
                10.0,
            ),
            ("options.smoothing_s", options.smoothing_s, 0.0, 2.0),
            ("options.noise_variance", options.noise_variance, 1e-6, 1e3),
            ("options.yaw_ratio", options.yaw_ratio, -100.0, 100.0),
            (
                "options.components",
                options.components as f64,
                1.0,
                MOST_AXES as f64,
            ),
        ] {
            if !(found >= low && found <= high) {
                return Err(value(key, found, format!("{low} to {high}")));
            }
        }
        let joints = table.target.joints;
        let volume = match (table.target.clips, table.volume) {
            (Some(clips), None) => {
                check_names("target.clips", &clips)?;
                VolumeSource::Clips(clips)
            }
            (None, Some(volume)) => volume_of(volume, joints.len())?,
            (found, _) => {
                let found = if found.is_some() { "both" } else { "neither" };
                let allowed = "target.clips or [volume], one of the two";
                return Err(value("target.clips", found, allowed));
            }
        };
        let pairs = table
            .pair
            .into_iter()
            .enumerate()
            .map(|(k, pair)| filed_pair(k, pair, &joints, dim, width))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            reference: places(&source.reference, dim),
            mean: places(&source.mean, dim),
            header: PoseHeader {
                points: source.points,
                dim,
                channels: Vec::new(),
            },
            global: source.global,
            spread_m: source.spread_m,
            recording: source.recording,
            velocity_weight_s: options.velocity_weight_s,
            smoothing_s: options.smoothing_s,
            noise_variance: options.noise_variance,
            components: options.components,
            yaw_ratio: options.yaw_ratio,
            joints,
            volume,
            pairs,
        })
    }
}

fn volume_of(table: VolumeTable, joints: usize) -> Result<VolumeSource, MapFileError> {
    check_row("volume.mean", &table.mean, joints, "one per joint")?;
    let axes = table.axes.len();
    if axes == 0 || axes > joints.min(MOST_AXES) {
        let allowed = format!("1 to {} rows", joints.min(MOST_AXES));
        return Err(value("volume.axes", format!("{axes} rows"), allowed));
    }
    for (k, axis) in table.axes.iter().enumerate() {
        let key = format!("volume.axes row {}", k + 1);
        check_row(&key, axis, joints, "one per joint")?;
        for (other, before) in table.axes[..=k].iter().enumerate() {
            let product: f64 = axis.iter().zip(before).map(|(a, b)| a * b).sum();
            if (product - f64::from(u8::from(other == k))).abs() > 1e-4 {
                let found = format!("product {product:.6} with row {}", other + 1);
                return Err(value(&key, found, "rows of length 1 at right angles"));
            }
        }
    }
    check_row("volume.low", &table.low, axes, "one per axis")?;
    check_row("volume.high", &table.high, axes, "one per axis")?;
    for (k, (low, high)) in table.low.iter().zip(&table.high).enumerate() {
        // The mean pose is inside: every interval holds zero.
        if !(*low <= 0.0 && *high >= 0.0) {
            let found = format!("{low}..{high} of axis {}", k + 1);
            return Err(value("volume.low", found, "an interval that holds 0"));
        }
    }
    if !(table.kept >= 0.0 && table.kept <= 1.0) {
        return Err(value("volume.kept", table.kept, "0 to 1"));
    }
    if !matches!(table.root.len(), 0 | 2) {
        let found = format!("{} rows", table.root.len());
        return Err(value("volume.root", found, "2 rows, forwards and left"));
    }
    for row in &table.root {
        check_row("volume.root", row, axes, "one per axis")?;
    }
    let volume = LatentVolume {
        mean: table.mean,
        axes: table.axes.concat(),
        low: table.low,
        high: table.high,
        kept: table.kept,
        lower: vec![f64::NEG_INFINITY; joints],
        upper: vec![f64::INFINITY; joints],
    };
    Ok(VolumeSource::Volume(volume, table.root.concat()))
}

fn filed_pair(
    k: usize,
    pair: PairTable,
    joints: &[String],
    dim: usize,
    width: usize,
) -> Result<FiledPair, MapFileError> {
    let label = format!("pair {} {:?}", k + 1, pair.name);
    let key = format!("{label}.pose");
    if let Some(stranger) = pair.pose.keys().find(|name| !joints.contains(name)) {
        let hint = crate::base::suggest::hint(stranger, joints.iter().map(String::as_str));
        return Err(value(
            key,
            format!("joint {stranger:?}{hint}"),
            joints.join(", "),
        ));
    }
    let pose: Vec<f64> = joints
        .iter()
        .map(|name| {
            let found = pair.pose.get(name).copied();
            found.ok_or_else(|| {
                value(
                    &key,
                    format!("no joint {name:?}"),
                    "a number for each joint",
                )
            })
        })
        .collect::<Result<_, _>>()?;
    check_row(&key, &pose, joints.len(), "one per joint")?;
    if pair.frames.is_empty() {
        return Err(value(format!("{label}.frames"), "none", "at least one row"));
    }
    let mut last = f64::NEG_INFINITY;
    let what = format!("time, then {dim} coordinates of each point");
    for (index, row) in pair.frames.iter().enumerate() {
        let key = format!("{label}.frames row {}", index + 1);
        check_row(&key, row, width + 1, &what)?;
        if !(row[0] > last) {
            return Err(value(key, format!("time {}", row[0]), "times that rise"));
        }
        last = row[0];
    }
    Ok(FiledPair {
        name: pair.name,
        pose,
        times_s: pair.frames.iter().map(|row| row[0]).collect(),
        frames: pair
            .frames
            .iter()
            .map(|row| places(&row[1..], dim))
            .collect(),
    })
}
