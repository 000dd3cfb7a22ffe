//! Classes of clips for the search: poses of any body as lengths, blended as the animator blends them.

use super::class::SearchClass;
use super::clips::{ClassSpec, FeatureError, Synthesis};
use crate::body::PoseSpace;
use crate::motion::class::{ClassError, Example, runs};
use crate::motion::clip::{Clip, ClipKind};
use crate::motion::limbs::{Timelines, timelines};
use crate::motion::weights::{Parameters, Weights};
use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

/// Seconds from the beginning to the end of a path that does not say how long it takes, as it is played.
pub const PATH_S: f64 = 1.0;

/// Why a class of clips cannot be searched.
#[derive(Debug, thiserror::Error)]
pub enum ClipsError {
    /// No moving clip, or clips that do not fit together.
    #[error(transparent)]
    Class(#[from] ClassError),
    /// Features that cannot be used.
    #[error(transparent)]
    Features(#[from] FeatureError),
    /// Nothing to blend.
    #[error("class {class}: no clip with an amplitude above 0; nothing to make a transition to")]
    NothingMoves {
        /// Class.
        class: String,
    },
}

/// A class of clips as the animator blends it: common phase, every limb with its own timeline.
///
/// Parameters are, in this order and as far as the clips have more than one value: amplitude,
/// frequency, and the amount of an added path (crouch). From rest (the clip at amplitude 0) to the smallest
/// moving clip the motion grows in proportion to amplitude, as in the animator.
#[derive(Clone)]
pub struct ClipBlend {
    name: String,
    space: Arc<dyn PoseSpace>,
    kind: ClipKind,
    /// The moving clips; then the rest clip, if there is one.
    clips: Vec<Clip>,
    weights: Weights,
    /// Least amplitude of a moving clip; 0 without a rest clip.
    least_amplitude: f64,
    /// Ranges of amplitude and frequency.
    low: [f64; 2],
    high: [f64; 2],
    /// A point of the parameter space with all others at zero.
    straight: Parameters,
    free: Vec<usize>,
    /// Coordinates of a pose in runs that belong to one limb (or to none).
    runs: Vec<(Range<usize>, Option<usize>)>,
    offsets: Vec<Option<Vec<f64>>>,
    added: Option<Clip>,
}

impl std::fmt::Debug for ClipBlend {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ClipBlend")
            .field("name", &self.name)
            .field("clips", &self.clip_names())
            .field("parameters", &self.parameter_names())
            .finish_non_exhaustive()
    }
}

impl ClipBlend {
    /// A class of `examples` whose poses are those of `space`.
    ///
    /// # Errors
    /// No moving clip; clips whose parameters or limbs do not fit together.
    pub fn new(
        name: &str,
        examples: &[Example],
        space: &Arc<dyn PoseSpace>,
    ) -> Result<Self, ClipsError> {
        let nothing = || ClipsError::NothingMoves { class: name.into() };
        let moving: Vec<&Example> = examples.iter().filter(|e| e.parameters[0] > 0.0).collect();
        let first = moving.first().ok_or_else(nothing)?;
        let kind = first.clip.kind;
        let parameters: Vec<Parameters> = moving.iter().map(|e| e.parameters).collect();
        let weights = Weights::new(&parameters).map_err(|source| ClassError::Weights {
            class: name.into(),
            source,
        })?;
        let rest = examples.iter().find(|e| e.parameters[0] == 0.0);
        let blended = moving.iter().copied().chain(rest);
        let clips: Vec<&Clip> = blended.map(|e| &e.clip).collect();
        let Timelines {
            limb_of, offsets, ..
        } = timelines(name, &clips, first.clip.coordinates(), true)?;
        let over = |d: usize, pick: fn(f64, f64) -> f64| {
            parameters.iter().map(|p| p[d]).fold(parameters[0][d], pick)
        };
        let (mut low, mut high) = (
            [over(0, f64::min), over(1, f64::min)],
            [over(0, f64::max), over(1, f64::max)],
        );
        let least_amplitude = if rest.is_some() { low[0] } else { 0.0 };
        if rest.is_some() {
            low[0] = 0.0;
        }
        // The user's own parameters stay at zero: straight ahead, no emotion.
        let straight = (2..parameters[0].dimensions()).fold(parameters[0], |p, d| p.with(d, 0.0));
        if kind == ClipKind::Path {
            // Progression is time here, and paths have no frequency.
            (low, high) = ([1.0, 0.0], [1.0, 0.0]);
        }
        Ok(Self {
            name: name.into(),
            space: Arc::clone(space),
            kind,
            clips: clips.into_iter().cloned().collect(),
            weights,
            least_amplitude,
            free: (0..2).filter(|d| high[*d] > low[*d]).collect(),
            low,
            high,
            straight,
            runs: runs(&limb_of),
            offsets,
            added: None,
        })
    }

    /// The same at full amplitude only.
    #[must_use]
    pub fn at_full_amplitude(mut self) -> Self {
        self.low[0] = self.high[0];
        self.free.retain(|d| *d != 0);
        self
    }

    /// The same without rest: amplitude begins at the smallest moving clip.
    #[must_use]
    pub fn moving(mut self) -> Self {
        if self.free.contains(&0) {
            self.low[0] = self.low[0].max(self.least_amplitude);
            self.free.retain(|d| self.high[*d] > self.low[*d]);
        }
        self
    }

    /// The same with a path added on top, as a layer is; its amount is a further parameter.
    #[must_use]
    pub fn with_added(mut self, path: Clip) -> Self {
        self.added = Some(path);
        self
    }

    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        self.free.len() + usize::from(self.added.is_some())
    }

    /// Names of the clips that take part, and of the added path.
    pub fn clip_names(&self) -> Vec<&str> {
        let at_rest = self.low[0] < self.least_amplitude;
        let count = self.weights.len() + usize::from(at_rest);
        let clips = self.clips.iter().take(count);
        clips.chain(&self.added).map(|c| c.name.as_str()).collect()
    }

    /// Names of the parameters with their ranges.
    pub fn parameter_names(&self) -> Vec<String> {
        let named = self.free.iter().map(|d| match d {
            0 => format!("amplitude {:.2}..{:.2}", self.low[0], self.high[0]),
            _ => format!("frequency {:.2}..{:.2} Hz", self.low[1], self.high[1]),
        });
        let added = self.added.iter().map(|c| format!("{} 0..1", c.name));
        named.chain(added).collect()
    }

    /// Amplitude and frequency at normalised parameters.
    pub fn wish(&self, parameters: &[f64]) -> Parameters {
        let mut wish = self.straight.with(0, self.low[0]).with(1, self.low[1]);
        for (d, p) in self.free.iter().zip(parameters) {
            wish = wish.with(*d, self.low[*d] + p * (self.high[*d] - self.low[*d]));
        }
        wish
    }

    /// Normalised parameters (0..1) of an amplitude and a frequency, into `out`; an added path is 0.
    pub fn normalised(&self, wish: Parameters, out: &mut [f64]) {
        out.fill(0.0);
        for (d, out) in self.free.iter().zip(out) {
            *out = ((wish[*d] - self.low[*d]) / (self.high[*d] - self.low[*d])).clamp(0.0, 1.0);
        }
    }

    /// Steps between references that bring the linear blend of features near the class's own blend: rest,
    /// the smallest and the largest motion; more where the places of joints are curved in the pose.
    pub fn steps(&self) -> usize {
        let curved = self.space.tangent_len() != self.space.len();
        match (curved, self.parameters()) {
            (true, 0..=1) => 6,
            (true, 2) => 4,
            _ => 2,
        }
    }

    /// The class for the search, with references at `steps` steps per parameter and `frames` frames.
    ///
    /// # Errors
    /// Features that cannot be used.
    pub fn search_class(&self, frames: usize, steps: usize) -> Result<SearchClass, FeatureError> {
        let cyclic = self.kind == ClipKind::Cycle;
        let spec = ClassSpec {
            frames,
            height_m: self.space.size_m(),
            ..ClassSpec::new(&self.name, cyclic, self.space.points())
        };
        SearchClass::subdivided(&spec, self.parameters(), steps, self)
    }

    /// Weights of the clips.
    fn clip_weights(&self, parameters: &[f64]) -> Vec<f64> {
        let mut weights = vec![0.0; self.clips.len()];
        let wish = self.wish(parameters);
        let moving = self.weights.len();
        self.weights.at(wish, &mut weights[..moving]);
        if let Some(rest) = weights.get(moving) {
            debug_assert_eq!(*rest, 0.0, "nothing weighs the rest clip yet");
            let share = (wish[0] / self.least_amplitude.max(1e-9)).clamp(0.0, 1.0);
            weights.iter_mut().for_each(|w| *w *= share);
            weights[moving] = 1.0 - share;
        }
        weights
    }

    /// The pose at `t`, blended as in the animator's steady state.
    fn pose(&self, parameters: &[f64], t: f64, out: &mut [f64]) {
        let weights = self.clip_weights(parameters);
        let limbs = self.offsets.iter().flatten().map(Vec::len).max();
        let timeline: Vec<f64> = (0..limbs.unwrap_or(0))
            .map(|limb| {
                let (mut sin, mut cos) = (0.0, 0.0);
                for (offsets, weight) in self.offsets.iter().zip(&weights) {
                    if let Some(offsets) = offsets {
                        sin += weight * offsets[limb].sin();
                        cos += weight * offsets[limb].cos();
                    }
                }
                sin.atan2(cos)
            })
            .collect();
        let len = self.space.len();
        let mut sampled = vec![0.0; self.clips.len() * len];
        for (e, pose) in sampled.chunks_exact_mut(len.max(1)).enumerate() {
            if weights[e] == 0.0 {
                continue;
            }
            for (range, limb) in &self.runs {
                let shift = match (limb, &self.offsets[e]) {
                    (Some(limb), Some(offsets)) => timeline[*limb] - offsets[*limb],
                    _ => 0.0,
                };
                let into = &mut pose[range.clone()];
                self.clips[e].sample_range(t + shift / TAU, range.clone(), into);
            }
        }
        self.space.blend(&sampled, &weights, out);
        if let (Some(path), Some(amount)) = (&self.added, parameters.get(self.free.len())) {
            let (mut from, mut to) = (vec![0.0; len], vec![0.0; len]);
            path.pose(0.0, &mut from);
            path.pose(1.0, &mut to);
            let mut way = vec![0.0; self.space.tangent_len()];
            self.space.add_way(out, &from, &to, *amount, &mut way);
        }
    }
}

impl Synthesis for ClipBlend {
    fn width(&self) -> usize {
        self.space.features()
    }

    fn duration_s(&self, parameters: &[f64]) -> f64 {
        match self.kind {
            ClipKind::Cycle => 1.0 / self.wish(parameters)[1].max(1e-3),
            ClipKind::Path => {
                // As the animator plays it: a blend of paths takes the blend of their durations.
                let weights = self.clip_weights(parameters);
                let takes_s: f64 = (self.clips.iter().zip(weights))
                    .map(|(clip, weight)| weight * clip.duration_s)
                    .sum();
                if takes_s > 0.0 { takes_s } else { PATH_S }
            }
        }
    }

    fn features(&self, parameters: &[f64], t: f64, out: &mut [f64]) {
        let mut pose = vec![0.0; self.space.len()];
        self.pose(parameters, t, &mut pose);
        self.space.embed(&pose, out);
    }

    fn root(&self, parameters: &[f64], t: f64) -> Option<[f64; 3]> {
        let (mut forward, mut left, mut yaw) = (0.0, 0.0, 0.0);
        for (clip, weight) in self.clips.iter().zip(self.clip_weights(parameters)) {
            forward += weight * clip.root.forward_m;
            left += weight * clip.root.left_m;
            yaw += weight * clip.root.yaw_rad;
        }
        // At constant speed along an arc.
        let turned = yaw * t;
        let (ahead, aside) = if turned.abs() > 1e-9 {
            (turned.sin() / turned, (1.0 - turned.cos()) / turned)
        } else {
            (1.0, 0.5 * turned)
        };
        let (x, y) = (forward * t, left * t);
        Some([x * ahead - y * aside, x * aside + y * ahead, turned])
    }

    fn name(&self, parameters: &[f64]) -> String {
        let weights = self.clip_weights(parameters);
        let added = parameters.get(self.free.len()).copied().unwrap_or(0.0);
        let pure = weights.iter().position(|w| *w > 1.0 - 1e-6);
        let base = match pure {
            Some(clip) => self.clips[clip].name.clone(),
            None => {
                let wish = self.wish(parameters);
                let (amplitude, frequency_hz) = (wish[0], wish[1]);
                format!("{amplitude:.2} at {frequency_hz:.2} Hz")
            }
        };
        match &self.added {
            Some(path) if added > 0.0 => format!("{base} + {added:.2} {}", path.name),
            _ => base,
        }
    }
}
