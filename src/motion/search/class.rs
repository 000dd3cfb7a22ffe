//! A class as the search sees it: features of its clips on common normalised time, and distances within.

use super::clips::{
    ClassSpec, ClipFeatures, FeatureError, Synthesis, check, resample, resample_root, time_of,
};
use super::weight_map::{Hat, WeightMap};
use super::{FRAMES_PER_SECOND, State};
use std::sync::Arc;

/// A class ready to be searched. Share it between edges with an [`Arc`].
pub struct SearchClass {
    /// Class name.
    pub name: String,
    /// Whether time wraps.
    pub cyclic: bool,
    /// Names of the clips or references.
    pub clips: Vec<String>,
    map: Arc<dyn WeightMap>,
    frames: usize,
    durations_s: Vec<f64>,
    /// References x frames x width: `[x; sqrt(lambda_v) s] / sqrt(n)`, so that d is a squared distance.
    features: Vec<f64>,
    width: usize,
    spec: (f64, f64),
    /// Frames x references.
    penalty: Vec<f64>,
    /// Frames x references x references: squared distances at one time, and to the next frame.
    within: Vec<f64>,
    next: Vec<f64>,
}

/// A time between two frames.
#[derive(Copy, Clone, Debug)]
pub(super) struct Between {
    pub(super) frame: usize,
    pub(super) next: usize,
    /// Weight of the next frame.
    pub(super) part: f64,
}

impl SearchClass {
    /// Resamples `clips`, adds velocities and measures all distances within the class.
    ///
    /// Velocities are backward differences, so frame 0 looks across the seam of a cyclic clip and
    /// forwards in an open one; the root's is always forwards at frame 0, since it does not come back.
    ///
    /// # Errors
    /// No or too short clips, wrong sizes, numbers that are not finite.
    pub fn new(
        spec: &ClassSpec,
        clips: &[ClipFeatures<'_>],
        map: Arc<dyn WeightMap>,
    ) -> Result<Self, FeatureError> {
        check(spec, clips, map.as_ref())?;
        let (n, frames) = (clips.len(), spec.frames);
        let positions = clips[0].width;
        let rooted = !clips[0].root.is_empty();
        let width = 2 * positions + if rooted { 3 } else { 0 };
        let mut class = Self {
            name: spec.name.clone(),
            cyclic: spec.cyclic,
            clips: clips.iter().map(|c| c.name.to_owned()).collect(),
            map,
            frames,
            durations_s: clips.iter().map(|c| c.duration_s).collect(),
            features: Vec::with_capacity(n * frames * width),
            width,
            spec: (spec.lambda_v, spec.points as f64),
            penalty: vec![0.0; frames * n],
            within: vec![0.0; frames * n * n],
            next: vec![0.0; frames * n * n],
        };
        for (index, clip) in clips.iter().enumerate() {
            class.add_features(spec, clip);
            if !clip.penalty.is_empty() {
                let penalty = resample(clip.penalty, 1, frames, spec.cyclic);
                for (k, value) in penalty.into_iter().enumerate() {
                    class.penalty[k * n + index] = value;
                }
            }
        }
        for k in 0..frames {
            for i in 0..n {
                for j in 0..n {
                    let at = (k * n + i) * n + j;
                    class.within[at] = squared(class.feature(i, k), class.feature(j, k));
                    let following = (k + 1) % frames;
                    class.next[at] = squared(class.feature(i, k), class.feature(j, following));
                }
            }
        }
        Ok(class)
    }

    /// A class whose blend is not linear: references at `steps` steps per parameter are synthesised;
    /// between them the search blends linearly (the hybrid blend of section 3.3.3). With one step the
    /// references are the corners.
    ///
    /// # Errors
    /// As [`SearchClass::new`].
    pub fn subdivided(
        spec: &ClassSpec,
        parameters: usize,
        steps: usize,
        motion: &dyn Synthesis,
    ) -> Result<Self, FeatureError> {
        let hat = Hat::new(parameters, steps);
        let width = motion.width();
        let mut made = Vec::new();
        for index in 0..hat.references() {
            let place = hat.place(index);
            let place = &place[..hat.parameters()];
            let mut positions = vec![0.0; spec.frames * width];
            let mut root = Vec::new();
            for (k, out) in positions.chunks_exact_mut(width.max(1)).enumerate() {
                let t = time_of(k, spec.frames, spec.cyclic);
                motion.features(place, t, out);
                root.extend(motion.root(place, t).into_iter().flatten());
            }
            made.push((
                motion.name(place),
                motion.duration_s(place),
                positions,
                root,
            ));
        }
        let clips: Vec<ClipFeatures<'_>> = made
            .iter()
            .map(|(name, duration_s, positions, root)| ClipFeatures {
                name,
                duration_s: *duration_s,
                width,
                positions,
                root,
                penalty: &[],
            })
            .collect();
        Self::new(spec, &clips, Arc::new(hat))
    }

    fn add_features(&mut self, spec: &ClassSpec, clip: &ClipFeatures<'_>) {
        let (frames, m) = (spec.frames, clip.width);
        let positions = resample(clip.positions, m, frames, spec.cyclic);
        // From one frame to the next, in frames of 1/25 s.
        let steps = if spec.cyclic { frames } else { frames - 1 };
        let per_frame = steps as f64 / (clip.duration_s * FRAMES_PER_SECOND);
        let scale = 1.0 / (spec.points as f64).sqrt();
        let velocity_scale = scale * spec.lambda_v.sqrt() * per_frame;
        let root = resample_root(clip.root, frames, spec.cyclic);
        for k in 0..frames {
            let row = &positions[k * m..(k + 1) * m];
            self.features.extend(row.iter().map(|x| x * scale));
            let (from, to) = match k {
                0 if spec.cyclic => (frames - 1, 0),
                0 => (0, 1),
                _ => (k - 1, k),
            };
            for d in 0..m {
                let step = positions[to * m + d] - positions[from * m + d];
                self.features.push(step * velocity_scale);
            }
            if !root.is_empty() {
                let (from, to) = if k == 0 { (0, 1) } else { (k - 1, k) };
                let [x, y, yaw] = [0, 1, 2].map(|d| root[3 * to + d] - root[3 * from + d]);
                let (sin, cos) = root[3 * from + 2].sin_cos();
                let body = [cos * x + sin * y, cos * y - sin * x, yaw * spec.height_m];
                // The root weighs as much as all points together, which all move with it.
                let weight = velocity_scale * (spec.points as f64).sqrt();
                self.features.extend(body.map(|v| v * weight));
            }
        }
    }

    /// Number of free parameters.
    pub fn parameters(&self) -> usize {
        self.map.parameters()
    }

    /// Number of clips or references.
    pub fn references(&self) -> usize {
        self.durations_s.len()
    }

    /// Frames per clip.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Normalised time of a frame.
    pub fn time_of(&self, frame: usize) -> f64 {
        time_of(frame, self.frames, self.cyclic)
    }

    /// Blend weights at `state`, into `out`.
    pub fn weights(&self, state: &State, out: &mut [f64]) {
        self.map
            .weights(&state.parameters[..self.parameters()], out);
    }

    /// Stacked features of reference `index` at `frame`: their squared distance is `d` of (4.3).
    pub fn feature(&self, index: usize, frame: usize) -> &[f64] {
        let at = (index * self.frames + frame) * self.width;
        &self.features[at..at + self.width]
    }

    /// Numbers in [`SearchClass::feature`].
    pub fn width(&self) -> usize {
        self.width
    }

    /// Length of the blend, seconds: `T(w) = sum w_i T_i`.
    pub fn duration_s(&self, weights: &[f64]) -> f64 {
        self.durations_s
            .iter()
            .zip(weights)
            .map(|(t, w)| t * w)
            .sum()
    }

    /// Stacked features of the linear blend at any state, into `out`. For tests and plots; the search
    /// itself needs distances only.
    pub fn blend(&self, state: &State, out: &mut [f64]) {
        let mut weights = vec![0.0; self.references()];
        self.weights(state, &mut weights);
        let at = self.between(state.t);
        out.fill(0.0);
        for (i, w) in weights.iter().enumerate() {
            let (a, b) = (self.feature(i, at.frame), self.feature(i, at.next));
            for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
                *out += w * ((1.0 - at.part) * a + at.part * b);
            }
        }
    }

    /// The frames around `t`.
    pub(super) fn between(&self, t: f64) -> Between {
        if self.cyclic {
            let at = t.rem_euclid(1.0) * self.frames as f64;
            let frame = (at.floor() as usize).min(self.frames - 1);
            Between {
                frame,
                next: (frame + 1) % self.frames,
                part: (at - frame as f64).clamp(0.0, 1.0),
            }
        } else {
            let at = t.clamp(0.0, 1.0) * (self.frames - 1) as f64;
            let frame = (at.floor() as usize).min(self.frames - 2);
            Between {
                frame,
                next: frame + 1,
                part: (at - frame as f64).clamp(0.0, 1.0),
            }
        }
    }

    /// Squared distances at one frame, references x references.
    pub(super) fn within(&self, frame: usize) -> &[f64] {
        let n = self.references();
        &self.within[frame * n * n..(frame + 1) * n * n]
    }

    /// Squared distances from a frame to the one after it, references x references.
    pub(super) fn to_next(&self, frame: usize) -> &[f64] {
        let n = self.references();
        &self.next[frame * n * n..(frame + 1) * n * n]
    }

    pub(super) fn penalty(&self, frame: usize) -> &[f64] {
        let n = self.references();
        &self.penalty[frame * n..(frame + 1) * n]
    }

    /// Whether distances to `other` mean anything.
    pub(super) fn comparable(&self, other: &Self) -> Result<(), FeatureError> {
        let checks = [
            ("features", self.width as f64, other.width as f64),
            ("lambda_v", self.spec.0, other.spec.0),
            ("points", self.spec.1, other.spec.1),
        ];
        for (what, source_value, target_value) in checks {
            if source_value != target_value {
                return Err(FeatureError::Unlike {
                    source_class: self.name.clone(),
                    target_class: other.name.clone(),
                    what,
                    source_value,
                    target_value,
                });
            }
        }
        Ok(())
    }
}

impl std::fmt::Debug for SearchClass {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SearchClass")
            .field("name", &self.name)
            .field("clips", &self.clips)
            .field("frames", &self.frames)
            .finish_non_exhaustive()
    }
}

pub(super) fn squared(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}
