//! Building a class: kinds checked, weights fitted, limbs and contacts brought together.

use super::{Example, MotionClass, Play, Route, State};
use crate::body::Blending;
use crate::motion::clip::{Clip, ClipKind, Limb};
use crate::motion::limbs::timelines;
use crate::motion::range::{JointRange, Steepness};
use crate::motion::smooth::Follower;
use crate::motion::weights::{Parameters, WeightKind, Weights, WeightsError};
use std::ops::Range;

/// Why a class cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum ClassError {
    /// No example.
    #[error("class {class} has no clip; give it at least one")]
    Empty {
        /// Class name.
        class: String,
    },
    /// Cycles and paths in one class.
    #[error(
        "class {class}: clip {clip} is a {found}, the others are not; a class has clips of one kind"
    )]
    MixedKinds {
        /// Class name.
        class: String,
        /// The odd clip.
        clip: String,
        /// Its kind.
        found: &'static str,
    },
    /// A way of playing that the clips do not allow.
    #[error("class {class}: play = \"{play}\" needs {needed}, and its clips are {found}s")]
    Play {
        /// Class name.
        class: String,
        /// As written in a configuration.
        play: &'static str,
        /// What it would need.
        needed: &'static str,
        /// What the clips are.
        found: &'static str,
    },
    /// A window that is none.
    #[error(
        "class {class}: leave = [{from}, {to}]: both must lie in 0..1, fractions of the cycle or path"
    )]
    Window {
        /// Class name.
        class: String,
        /// Start as given.
        from: f64,
        /// End as given.
        to: f64,
    },
    /// A limb's advance that is none.
    #[error("class {class}: limb_advance {found} is not in 0..1")]
    Advance {
        /// Class name.
        class: String,
        /// As given.
        found: f64,
    },
    /// Parameters that span no space.
    #[error("class {class}: {source}")]
    Weights {
        /// Class name.
        class: String,
        /// What is wrong with the parameters.
        source: WeightsError,
    },
    /// More clips than a table is made for.
    #[error(
        "class {class}: blending = \"hybrid\" is for at most {most} clips, and there are {found}; take \"non_linear\", or make two classes of it"
    )]
    HybridClips {
        /// Class name.
        class: String,
        /// Clips given.
        found: usize,
        /// Clips allowed.
        most: usize,
    },
    /// A table that stays too coarse.
    #[error(
        "class {class}: blending = \"hybrid\": tolerance_m = {asked_m} is not reached, {references} references leave {worst_m:.4} m; ask for more, or take \"non_linear\""
    )]
    HybridTolerance {
        /// Class name.
        class: String,
        /// Asked for, metres.
        asked_m: f64,
        /// Largest distance to the correct blend, metres.
        worst_m: f64,
        /// References that were made.
        references: usize,
    },
    /// Limbs differ between clips.
    #[error(
        "class {class}: clip {clip} has no segment {segment}, other clips have; author all clips of a class for the same legs"
    )]
    Limbs {
        /// Class name.
        class: String,
        /// The odd clip.
        clip: String,
        /// The missing limb.
        segment: String,
    },
}

/// How a class is played.
#[derive(Clone, Debug, PartialEq)]
pub struct ClassOptions {
    /// What moves it along.
    pub play: Play,
    /// Windows of phase or progression (0..1) in which it may be left; none: at any time.
    pub leave: Vec<[f64; 2]>,
    /// Part of the phase advance that a limb may gain or lose against the body: 0.05, so that it stays
    /// between 0.95 and 1.05 of it (eq. 9.7). Larger values let limbs change their phase sooner and slide more;
    /// 0 gives limbs no timelines of their own: clips blend at the common phase, whatever their legs do then.
    pub limb_advance: f64,
    /// How parameters become weights.
    pub weights: WeightKind,
    /// Names of the parameters beside amplitude and frequency, two at most, for messages.
    pub extra: Vec<String>,
}

impl Default for ClassOptions {
    fn default() -> Self {
        Self {
            play: Play::Gesture,
            leave: Vec::new(),
            limb_advance: 0.05,
            weights: WeightKind::default(),
            extra: Vec::new(),
        }
    }
}

fn name_of(kind: ClipKind) -> &'static str {
    match kind {
        ClipKind::Cycle => "cycle",
        ClipKind::Path => "path",
    }
}

impl MotionClass {
    /// Builds a class from examples for joints with the given ranges.
    pub fn new(
        name: &str,
        examples: Vec<Example>,
        ranges: Vec<JointRange>,
        options: ClassOptions,
    ) -> Result<Self, ClassError> {
        let class = || name.to_string();
        let Some(first) = examples.first() else {
            return Err(ClassError::Empty { class: class() });
        };
        let kind = first.clip.kind;
        let coordinates = first.clip.coordinates();
        check_options(name, kind, &options)?;
        let rest = examples.iter().position(|e| e.parameters[0] == 0.0);
        let mut moving: Vec<usize> = (0..examples.len())
            .filter(|i| examples[*i].parameters[0] > 0.0)
            .collect();
        if moving.is_empty() {
            moving.extend(0..examples.len());
        }
        let parameters: Vec<Parameters> = moving.iter().map(|i| examples[*i].parameters).collect();
        let weights_map =
            dimensioned(&parameters, &options).map_err(|source| ClassError::Weights {
                class: class(),
                source,
            })?;
        let least_amplitude = parameters
            .iter()
            .map(|p| p[0])
            .fold(f64::INFINITY, f64::min);
        if let Some(odd) = examples.iter().find(|e| e.clip.kind != kind) {
            return Err(ClassError::MixedKinds {
                class: class(),
                clip: odd.clip.name.clone(),
                found: name_of(odd.clip.kind),
            });
        }
        let clips: Vec<&Clip> = examples.iter().map(|e| &e.clip).collect();
        let steepness = Steepness::of(&clips);
        let timelines = timelines(name, &clips, coordinates, options.limb_advance > 0.0)?;
        let contacts = contacts(&clips, &timelines.limbs);
        let (count, limbs) = (examples.len(), timelines.limbs.len());
        let frequency = weights_map.frequencies().0;
        Ok(Self {
            name: name.into(),
            kind,
            options,
            moving_weights: vec![0.0; moving.len()],
            weights_map,
            moving,
            rest,
            least_amplitude,
            steepness,
            ranges,
            runs: runs(&timelines.limb_of),
            limbs: timelines.limbs,
            offsets: timelines.offsets,
            contacts,
            state: State {
                amplitude: Follower::at(0.0),
                frequency: Follower::at(frequency),
                extra: Default::default(),
                phase: 0.0,
                rate: 0.0,
                limb_shift: vec![0.0; limbs],
                locked: true,
                stride: 1.0,
                progress: 0.0,
                ended: false,
                fresh: true,
            },
            sampled: vec![0.0; count * coordinates],
            weights: vec![0.0; count],
            route: Route {
                points: Vec::with_capacity(Route::MOST),
                at_s: 0.0,
            },
            blending: Blending::Linear,
            shown: false,
            examples,
        })
    }
}

/// The weights map, with the class's own names of its parameters.
fn dimensioned(parameters: &[Parameters], options: &ClassOptions) -> Result<Weights, WeightsError> {
    let names: Vec<&str> = ["amplitude", "frequency_hz"]
        .into_iter()
        .chain(options.extra.iter().map(String::as_str))
        .collect();
    Weights::named(parameters, options.weights, &names)
}

fn check_options(name: &str, kind: ClipKind, options: &ClassOptions) -> Result<(), ClassError> {
    let class = || name.to_string();
    let (play, needed) = match options.play {
        Play::Gesture => ("gesture", None),
        Play::Once => ("once", (kind != ClipKind::Path).then_some("paths")),
        Play::Loop => ("loop", (kind != ClipKind::Cycle).then_some("cycles")),
    };
    if let Some(needed) = needed {
        return Err(ClassError::Play {
            class: class(),
            play,
            needed,
            found: name_of(kind),
        });
    }
    for [from, to] in &options.leave {
        if !((0.0..=1.0).contains(from) && (0.0..=1.0).contains(to)) {
            return Err(ClassError::Window {
                class: class(),
                from: *from,
                to: *to,
            });
        }
    }
    if !(0.0..1.0).contains(&options.limb_advance) {
        return Err(ClassError::Advance {
            class: class(),
            found: options.limb_advance,
        });
    }
    Ok(())
}

/// Neighbouring coordinates of the same limb, as ranges.
pub(in crate::motion) fn runs(limb_of: &[Option<usize>]) -> Vec<(Range<usize>, Option<usize>)> {
    let mut runs: Vec<(Range<usize>, Option<usize>)> = Vec::new();
    for (i, limb) in limb_of.iter().enumerate() {
        match runs.last_mut() {
            Some((range, of)) if of == limb => range.end = i + 1,
            _ => runs.push((i..i + 1, *limb)),
        }
    }
    runs
}

/// Clips x limbs: each limb as the clip has it.
fn contacts(clips: &[&Clip], limbs: &[String]) -> Vec<Option<Limb>> {
    let of = |clip: &Clip, name: &String| clip.limbs.iter().find(|l| l.name == *name).cloned();
    (clips.iter())
        .flat_map(|clip| limbs.iter().map(|limb| of(clip, limb)))
        .collect()
}
