//! Time warps: which instant of one clip corresponds to which of another (Casas 2013, 3.2.1).
//!
//! Everything here works on clips embedded as features ([`FeatureClip`]: frames x features, Euclidean),
//! so that it serves joints, skeletons and meshes. [`dtw`] finds a non-linear warp, [`phase_offset`] the
//! rotation of one cycle against another, [`limb_offsets`] one such per limb (Rhodin 2016, 9.5.2),
//! [`align`] does all of it for the clips of a class.

mod align;
mod dtw;
mod path;
mod phase;
mod shape;

pub(super) use align::STILL;
pub use align::{Aligned, Alignment, PairMatch, align, match_pair};
pub use dtw::{DtwOptions, dtw};
pub use path::{CostTable, Path, cheapest_path};
pub use phase::{PhaseMatch, limb_offsets, phase_match, phase_offset};
pub use shape::Warp;

use super::clip::{Clip, ClipKind};
use crate::body::PoseSpace;

/// Frames x features.
pub type Frames = [Vec<f64>];

/// Why clips cannot be aligned.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum WarpError {
    /// No clip at all.
    #[error("no clips given; at least one is needed")]
    Empty,
    /// Too short.
    #[error("clip {clip} has {found} frames, at least {least} are needed")]
    TooShort {
        /// Which clip.
        clip: String,
        /// Its frames.
        found: usize,
        /// Frames that are needed.
        least: usize,
    },
    /// Frames of different lengths.
    #[error(
        "clip {clip}, frame {frame}: {found} features, {expected} are expected; all clips need the same body"
    )]
    Features {
        /// Which clip.
        clip: String,
        /// Index of the frame.
        frame: usize,
        /// Its features.
        found: usize,
        /// Features of the first frame of the first clip.
        expected: usize,
    },
    /// A feature that is not a finite number.
    #[error("clip {clip}, frame {frame}, feature {feature}: {found} is not a finite number")]
    NotFinite {
        /// Which clip.
        clip: String,
        /// Index of the frame.
        frame: usize,
        /// Index of the feature.
        feature: usize,
        /// What was found.
        found: f64,
    },
    /// A key pair beyond the clips' frames.
    #[error(
        "key pair {pair} ({a}, {b}) lies outside the clips; frames are 0..={last_a} and 0..={last_b}"
    )]
    KeyOutside {
        /// Index of the pair.
        pair: usize,
        /// Frame of the first clip.
        a: usize,
        /// Frame of the second clip.
        b: usize,
        /// Last frame of the first clip.
        last_a: usize,
        /// Last frame of the second clip.
        last_b: usize,
    },
    /// Key pairs that do not increase in both clips.
    #[error(
        "key pair ({a}, {b}) does not come after ({before_a}, {before_b}) in both clips; list key pairs in time order, ends belong together already"
    )]
    KeyOrder {
        /// Frame of the first clip.
        a: usize,
        /// Frame of the second clip.
        b: usize,
        /// Frame of the first clip in the pair before.
        before_a: usize,
        /// Frame of the second clip in the pair before.
        before_b: usize,
    },
    /// Key pairs that ask for more change of tempo than allowed.
    #[error(
        "between key pairs ({before_a}, {before_b}) and ({a}, {b}) the second clip would run at {slope:.2} times its tempo; allowed is {low:.2}..{high:.2}: move or remove a pair"
    )]
    KeySlope {
        /// Frame of the first clip.
        a: usize,
        /// Frame of the second clip.
        b: usize,
        /// Frame of the first clip in the pair before.
        before_a: usize,
        /// Frame of the second clip in the pair before.
        before_b: usize,
        /// Normalised slope between them.
        slope: f64,
        /// Least slope allowed.
        low: f64,
        /// Largest slope allowed.
        high: f64,
    },
    /// Cycles and paths together.
    #[error("clip {clip} {}, {first} {}; a class has clips of one kind", kind(*.cyclic), kind(!*.cyclic))]
    MixedKinds {
        /// The odd clip.
        clip: String,
        /// The first clip.
        first: String,
        /// Whether the odd clip repeats.
        cyclic: bool,
    },
    /// A limb with a feature that does not exist.
    #[error("limb {limb} uses feature {feature}, the clips have {features}")]
    Limb {
        /// Index of the limb.
        limb: usize,
        /// The feature.
        feature: usize,
        /// Number of features.
        features: usize,
    },
}

fn kind(cyclic: bool) -> &'static str {
    if cyclic { "is a cycle" } else { "is a path" }
}

/// A clip as features over time, free of the root's place and heading.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureClip {
    /// Name of the clip.
    pub name: String,
    /// Frames evenly over one cycle (the last followed by the first), or from start to end.
    pub cyclic: bool,
    /// Frames x features: Euclidean, in metres where possible.
    pub frames: Vec<Vec<f64>>,
    /// Length of the cycle or of the path, s; 0 if unknown.
    pub duration_s: f64,
    /// Limbs with a timeline of their own: features of each.
    pub limbs: Vec<Vec<usize>>,
}

/// Frames that a clip is sampled at for alignment.
const SAMPLES: usize = 64;

impl FeatureClip {
    /// Embeds a clip in the features of its body, metres ([`PoseSpace::embed`]).
    ///
    /// Limbs are those of the clip; a limb's features are those that change when its joints turn.
    pub fn from_clip(clip: &Clip, space: &dyn PoseSpace) -> Self {
        let cyclic = clip.kind == ClipKind::Cycle;
        let last = if cyclic { SAMPLES } else { SAMPLES - 1 };
        let mut pose = vec![0.0; space.len()];
        let frames = (0..SAMPLES)
            .map(|k| {
                clip.pose(k as f64 / last as f64, &mut pose);
                embedded(space, &pose)
            })
            .collect();
        let duration_s = if cyclic && clip.frequency_hz > 0.0 {
            1.0 / clip.frequency_hz
        } else {
            clip.duration_s
        };
        Self {
            name: clip.name.clone(),
            cyclic,
            frames,
            duration_s,
            limbs: clip
                .limbs
                .iter()
                .map(|l| moved_features(space, &l.coordinates))
                .collect(),
        }
    }

    /// Number of features of a frame.
    pub fn features(&self) -> usize {
        self.frames.first().map_or(0, Vec::len)
    }

    /// Root of the mean squared distance of the frames to their mean: how much moves.
    pub fn spread(&self) -> f64 {
        let mean = mean(&self.frames);
        let sum: f64 = self.frames.iter().map(|f| distance_sq(f, &mean)).sum();
        (sum / self.frames.len().max(1) as f64).sqrt()
    }

    fn check(&self, expected: usize) -> Result<(), WarpError> {
        check(&self.name, &self.frames, expected)
    }
}

fn embedded(space: &dyn PoseSpace, pose: &[f64]) -> Vec<f64> {
    let mut features = vec![0.0; space.features()];
    space.embed(pose, &mut features);
    features
}

/// Features that change when the joints with these coordinates turn.
fn moved_features(space: &dyn PoseSpace, coordinates: &[usize]) -> Vec<usize> {
    let mut rest = vec![0.0; space.len()];
    space.rest(&mut rest);
    let mut turn = vec![0.0; space.tangent_len()];
    for part in space.parts() {
        if part.coordinates.clone().any(|c| coordinates.contains(&c)) {
            // No part of a turn that could bring a joint back to where it was.
            turn[part.tangent.clone()].fill(0.37);
        }
    }
    let still = embedded(space, &rest);
    let mut bent = rest;
    space.add(&mut bent, &turn, 1.0);
    let moved = embedded(space, &bent);
    (0..still.len())
        .filter(|c| (still[*c] - moved[*c]).abs() > 1e-9)
        .collect()
}

fn check(clip: &str, frames: &Frames, expected: usize) -> Result<(), WarpError> {
    if frames.len() < 2 {
        return Err(WarpError::TooShort {
            clip: clip.into(),
            found: frames.len(),
            least: 2,
        });
    }
    for (k, frame) in frames.iter().enumerate() {
        if frame.len() != expected {
            return Err(WarpError::Features {
                clip: clip.into(),
                frame: k,
                found: frame.len(),
                expected,
            });
        }
        if let Some(feature) = frame.iter().position(|v| !v.is_finite()) {
            return Err(WarpError::NotFinite {
                clip: clip.into(),
                frame: k,
                feature,
                found: frame[feature],
            });
        }
    }
    Ok(())
}

fn check_pair(a: &Frames, b: &Frames) -> Result<(), WarpError> {
    let expected = a.first().map_or(0, Vec::len);
    check("a", a, expected)?;
    check("b", b, expected)
}

fn mean(frames: &Frames) -> Vec<f64> {
    let mut mean = vec![0.0; frames.first().map_or(0, Vec::len)];
    for frame in frames {
        for (m, v) in mean.iter_mut().zip(frame) {
            *m += v / frames.len() as f64;
        }
    }
    mean
}

fn distance_sq(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum()
}

/// Frame at `u` by cubic interpolation (Catmull-Rom): wrapped for a cycle, else clamped to 0..1.
fn sampled(frames: &Frames, cyclic: bool, u: f64, out: &mut Vec<f64>) {
    let n = frames.len();
    let (x, at): (f64, Box<dyn Fn(isize) -> usize>) = if cyclic {
        let at = move |k: isize| k.rem_euclid(n as isize) as usize;
        (u.rem_euclid(1.0) * n as f64, Box::new(at))
    } else {
        let at = move |k: isize| k.clamp(0, n as isize - 1) as usize;
        (u.clamp(0.0, 1.0) * (n - 1) as f64, Box::new(at))
    };
    let k = x.floor();
    let w = x - k;
    let [p, q, r, s] = [-1, 0, 1, 2].map(|d| &frames[at(k as isize + d)]);
    out.clear();
    out.extend((0..q.len()).map(|c| {
        let (p, q, r, s) = (p[c], q[c], r[c], s[c]);
        q + 0.5 * w * (r - p + w * (2.0 * p - 5.0 * q + 4.0 * r - s + w * (3.0 * (q - r) + s - p)))
    }));
}

/// `frames` at `count` even phases of the cycle from `offset` on.
fn resampled_cycle(frames: &Frames, count: usize, offset: f64) -> Vec<Vec<f64>> {
    (0..count)
        .map(|k| {
            let mut frame = Vec::new();
            sampled(frames, true, offset + k as f64 / count as f64, &mut frame);
            frame
        })
        .collect()
}
