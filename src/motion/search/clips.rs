//! Clips as features: what a class is made of, resampling to common frames, and what is refused.

use super::MAX_PARAMETERS;
use super::weight_map::WeightMap;
use crate::base::angle::wrap_pi;

/// What a class is made of, beside its clips.
#[derive(Clone, Debug, PartialEq)]
pub struct ClassSpec {
    /// Name, for messages and plots.
    pub name: String,
    /// Whether time wraps.
    pub cyclic: bool,
    /// Frames that every clip is resampled to, at least 2. Of a cyclic class frame k is at `k / frames`,
    /// of an open one at `k / (frames - 1)`.
    pub frames: usize,
    /// `n` of (4.3): points, joints or vertices that a distance is the mean over.
    pub points: usize,
    /// Weight of velocities against positions in the distance; velocities are in metres per 1/25 s.
    pub lambda_v: f64,
    /// A length of the body that makes a turn of the root a length, metres.
    pub height_m: f64,
}

impl ClassSpec {
    /// A class of this name with 40 frames, distances per feature, `lambda_v = 1`, height 0.3 m.
    pub fn new(name: &str, cyclic: bool, points: usize) -> Self {
        Self {
            name: name.into(),
            cyclic,
            frames: 40,
            points,
            lambda_v: 1.0,
            height_m: 0.3,
        }
    }
}

/// One clip as features.
#[derive(Copy, Clone, Debug)]
pub struct ClipFeatures<'a> {
    /// Clip name.
    pub name: &'a str,
    /// Length, seconds; of one cycle for a cyclic clip.
    pub duration_s: f64,
    /// Features per frame: Euclidean, root-free, metres.
    pub width: usize,
    /// Frames x width, evenly over the clip. A cyclic clip does not repeat its first frame at the end.
    pub positions: &'a [f64],
    /// Frames x 3: the root on the ground, x and y in metres and yaw in radians; or empty. Only its
    /// velocity in the body's own frame counts.
    pub root: &'a [f64],
    /// One number per frame, not negative, for the penalty term of the cost (nearness of joint limits,
    /// of self-collision); or empty.
    pub penalty: &'a [f64],
}

/// A blend that is not linear in the features, to be sampled at references.
pub trait Synthesis {
    /// Features per frame.
    fn width(&self) -> usize;

    /// Length of the motion at `parameters`, seconds.
    fn duration_s(&self, parameters: &[f64]) -> f64;

    /// Features at normalised time `t` (0..1), into `out`.
    fn features(&self, parameters: &[f64], t: f64, out: &mut [f64]);

    /// The root on the ground at `t`: x and y in metres, yaw in radians; `None` for a body without.
    fn root(&self, _parameters: &[f64], _t: f64) -> Option<[f64; 3]> {
        None
    }

    /// A name for the motion at `parameters`.
    fn name(&self, parameters: &[f64]) -> String {
        let values: Vec<String> = parameters.iter().map(|v| format!("{v:.2}")).collect();
        format!("({})", values.join(", "))
    }
}

/// Why features cannot be used.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum FeatureError {
    /// No clip at all, or another number than the weight map has.
    #[error("class {class}: {found} clips, the weight map is made for {expected}")]
    Count {
        /// Class.
        class: String,
        /// Clips given.
        found: usize,
        /// Clips needed.
        expected: usize,
    },
    /// A clip without a velocity.
    #[error("class {class}, clip {clip}: {found} frame(s); a velocity needs at least 2")]
    TooShort {
        /// Class.
        class: String,
        /// Clip.
        clip: String,
        /// Frames given.
        found: usize,
    },
    /// A table of the wrong size.
    #[error("class {class}, clip {clip}: {what} has {found} numbers, expected {expected}")]
    Size {
        /// Class.
        class: String,
        /// Clip.
        clip: String,
        /// Which table.
        what: &'static str,
        /// Numbers given.
        found: usize,
        /// Numbers needed.
        expected: usize,
    },
    /// A number that cannot be used.
    #[error("class {class}, clip {clip}, frame {frame}: {what} is {value}; {allowed}")]
    Number {
        /// Class.
        class: String,
        /// Clip.
        clip: String,
        /// Frame.
        frame: usize,
        /// Which number.
        what: &'static str,
        /// What it is.
        value: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// A number of the class itself.
    #[error("class {class}: {what} is {value}; {allowed}")]
    Spec {
        /// Class.
        class: String,
        /// Which number.
        what: &'static str,
        /// What it is.
        value: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// Two classes whose poses cannot be compared.
    #[error(
        "classes {source_class} and {target_class} differ in {what} ({source_value} and {target_value}); embed both in the same way"
    )]
    Unlike {
        /// Source class.
        source_class: String,
        /// Target class.
        target_class: String,
        /// In what they differ.
        what: &'static str,
        /// Of the source.
        source_value: f64,
        /// Of the target.
        target_value: f64,
    },
}

pub(super) fn time_of(frame: usize, frames: usize, cyclic: bool) -> f64 {
    let steps = if cyclic { frames } else { frames - 1 };
    frame as f64 / steps as f64
}

/// Linear interpolation of rows of `width` to `frames` frames.
pub(super) fn resample(rows: &[f64], width: usize, frames: usize, cyclic: bool) -> Vec<f64> {
    let count = rows.len() / width.max(1);
    let steps = if cyclic { count } else { count - 1 };
    let mut out = Vec::with_capacity(frames * width);
    for k in 0..frames {
        let at = time_of(k, frames, cyclic) * steps as f64;
        let from = (at.floor() as usize).min(count - 1);
        let to = if cyclic {
            (from + 1) % count
        } else {
            (from + 1).min(count - 1)
        };
        let part = at - from as f64;
        for d in 0..width {
            out.push((1.0 - part) * rows[from * width + d] + part * rows[to * width + d]);
        }
    }
    out
}

/// The root's track resampled as an open one, yaw without turns; a cyclic clip's last frame is one step
/// before its end.
pub(super) fn resample_root(root: &[f64], frames: usize, cyclic: bool) -> Vec<f64> {
    if root.is_empty() {
        return Vec::new();
    }
    let mut track = root.to_vec();
    let count = track.len() / 3;
    for k in 1..count {
        let step = wrap_pi(root[3 * k + 2] - root[3 * k - 1]);
        track[3 * k + 2] = track[3 * k - 1] + step;
    }
    if !cyclic {
        return resample(&track, 3, frames, false);
    }
    // Goes on beyond the last frame as it went on up to it.
    for d in 0..3 {
        track.push(2.0 * track[3 * (count - 1) + d] - track[3 * (count - 2) + d]);
    }
    let mut out = resample(&track, 3, frames + 1, false);
    out.truncate(3 * frames);
    out
}

pub(super) fn check(
    spec: &ClassSpec,
    clips: &[ClipFeatures<'_>],
    map: &dyn WeightMap,
) -> Result<(), FeatureError> {
    let class = || spec.name.clone();
    let numbers = [
        ("frames", spec.frames as f64, 2.0, "at least 2"),
        ("points", spec.points as f64, 1.0, "at least 1"),
        ("lambda_v", spec.lambda_v, 0.0, "not negative and finite"),
        ("height_m", spec.height_m, 0.0, "not negative and finite"),
    ];
    for (what, value, least, allowed) in numbers {
        if !(value >= least && value.is_finite()) {
            return Err(FeatureError::Spec {
                class: class(),
                what,
                value,
                allowed,
            });
        }
    }
    if map.parameters() > MAX_PARAMETERS {
        return Err(FeatureError::Spec {
            class: class(),
            what: "number of parameters",
            value: map.parameters() as f64,
            allowed: "at most 4",
        });
    }
    if clips.is_empty() || clips.len() != map.references() {
        return Err(FeatureError::Count {
            class: class(),
            found: clips.len(),
            expected: map.references(),
        });
    }
    for clip in clips {
        check_clip(spec, clip, &clips[0])?;
    }
    Ok(())
}

fn check_clip(
    spec: &ClassSpec,
    clip: &ClipFeatures<'_>,
    first: &ClipFeatures<'_>,
) -> Result<(), FeatureError> {
    let size = |what, found, expected| FeatureError::Size {
        class: spec.name.clone(),
        clip: clip.name.to_owned(),
        what,
        found,
        expected,
    };
    let number = |frame, what, value, allowed| FeatureError::Number {
        class: spec.name.clone(),
        clip: clip.name.to_owned(),
        frame,
        what,
        value,
        allowed,
    };
    if clip.width == 0 || clip.width != first.width {
        return Err(size("a frame", clip.width, first.width.max(1)));
    }
    let frames = clip.positions.len() / clip.width;
    if clip.positions.len() != frames * clip.width {
        return Err(size(
            "positions",
            clip.positions.len(),
            (frames + 1) * clip.width,
        ));
    }
    if frames < 2 {
        return Err(FeatureError::TooShort {
            class: spec.name.clone(),
            clip: clip.name.to_owned(),
            found: frames,
        });
    }
    let rooted = !first.root.is_empty();
    if clip.root.len() != if rooted { 3 * frames } else { 0 } {
        return Err(size(
            "root",
            clip.root.len(),
            if rooted { 3 * frames } else { 0 },
        ));
    }
    if !clip.penalty.is_empty() && clip.penalty.len() != frames {
        return Err(size("penalty", clip.penalty.len(), frames));
    }
    if !(clip.duration_s > 0.0 && clip.duration_s.is_finite()) {
        return Err(number(
            0,
            "duration_s",
            clip.duration_s,
            "above 0 and finite",
        ));
    }
    let tables = [
        ("a feature", clip.positions, clip.width, f64::NEG_INFINITY),
        ("the root", clip.root, 3, f64::NEG_INFINITY),
        ("the penalty", clip.penalty, 1, 0.0),
    ];
    for (what, table, width, least) in tables {
        if let Some(at) = table.iter().position(|v| !(v.is_finite() && *v >= least)) {
            let allowed = if least == 0.0 {
                "finite, not negative"
            } else {
                "finite"
            };
            return Err(number(at / width, what, table[at], allowed));
        }
    }
    Ok(())
}
