//! The TOML of a character, as a user writes it. Every key is commented in `configs/quadruped.toml`,
//! `[[channel]]` in `configs/face.toml`, `map` in `configs/arm.toml`.

mod record;
mod robot;
mod safety;

pub use record::RecordEntry;
pub use robot::{BusEntry, JointEntry, RobotEntry};
pub use safety::{OnExit, OnLost, OnServoFault, SafetyEntry};

use serde::Deserialize;
use std::collections::BTreeMap;
use toml::Spanned;

/// A whole character.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CharacterFile {
    /// Name for people.
    pub name: String,
    /// Where poses come from.
    pub input: Input,
    /// Gesture files; none where a pose map alone drives the character.
    #[serde(default)]
    pub gesture: Vec<GestureEntry>,
    /// Motion classes, the nodes of the graph.
    pub class: Vec<ClassEntry>,
    /// Channels mixed from those of the pose stream.
    #[serde(default)]
    pub channel: Vec<ChannelEntry>,
    /// Additive layers.
    #[serde(default)]
    pub layer: Vec<LayerEntry>,
    /// Edges and thresholds.
    #[serde(default)]
    pub graph: GraphEntry,
    /// The robot; it needs a bus.
    pub robot: Option<RobotEntry>,
    /// The bus.
    pub bus: Option<BusEntry>,
    /// Instead of robot and bus: an avatar.
    pub avatar: Option<AvatarEntry>,
    /// Ramps, safe states, what to do when something is lost.
    #[serde(default)]
    pub safety: SafetyEntry,
    /// The terminal view.
    #[serde(default)]
    pub view: ViewEntry,
    /// What is kept of runs.
    #[serde(default)]
    pub record: RecordEntry,
}

/// Where poses come from.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// `file:PATH`, `udp://[ADDRESS:]PORT` or `-`.
    pub source: Spanned<String>,
    /// Estimator of waves.
    #[serde(default)]
    pub estimator: Option<Spanned<String>>,
    /// Window of the wave filters in periods.
    #[serde(default)]
    pub window: Option<f64>,
    /// Changed gesture files are loaded while a run goes on.
    #[serde(default)]
    pub reload: Option<bool>,
    /// Size of the gestures' reference by the performer's: a number, or `"rest"`.
    #[serde(default)]
    pub scale: Option<Spanned<toml::Value>>,
}

/// A file of gestures.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GestureEntry {
    /// Path of the gestures file.
    pub file: Spanned<String>,
}

/// A motion class.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassEntry {
    /// Class name.
    pub name: Spanned<String>,
    /// The gesture that drives it; with a map: that activates it.
    pub gesture: Option<Spanned<String>>,
    /// Its example clips.
    #[serde(default)]
    pub clip: Vec<ClipEntry>,
    /// Instead of clips, path of a pose map: the pose itself drives the body.
    pub map: Option<Spanned<String>>,
    /// Instead of a gesture: the channel that drives it.
    pub channel: Option<DrivingChannelEntry>,
    /// The gesture is to be performed in the opposite sense.
    #[serde(default)]
    pub reverse: bool,
    /// What moves it along: `gesture` (phase or progression), `once` (the clock, whenever the gesture is
    /// performed anew) or `loop` (the clock, round and round).
    pub play: Option<Spanned<String>>,
    /// Windows of phase or progression, 0 to 1, in which it may be left; at any time when not given.
    pub leave: Option<Spanned<Vec<[f64; 2]>>>,
    /// Part of the phase advance that a limb may gain or lose against the body; 0.05 when not given.
    pub limb_advance: Option<Spanned<f64>>,
    /// How parameters become weights.
    pub weights: Option<Spanned<String>>,
    /// How poses are blended: `linear` (default), `non_linear` or `hybrid`; for avatars and arms.
    pub blending: Option<Spanned<String>>,
    /// With `hybrid`: how far it may be from `non_linear`, metres (0.002).
    pub tolerance_m: Option<Spanned<f64>>,
    /// End links of an arm (limbs of an avatar) that stay on the blend of their own places; default: an arm's
    /// leaf links.
    pub ends: Option<Vec<Spanned<String>>>,
    /// Parameters beside amplitude and frequency.
    #[serde(default)]
    pub parameter: Vec<ParameterEntry>,
}

/// A channel that drives a class in place of a gesture.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DrivingChannelEntry {
    /// Channel name.
    pub name: Spanned<String>,
    /// Channel values at 0 and at 1 of the class's amplitude or progression.
    pub range: Spanned<[f64; 2]>,
    /// Part of the range that counts as nothing.
    #[serde(default)]
    pub dead_zone: f64,
}

/// A parameter of a class that a channel drives.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterEntry {
    /// Its name, as clips give it in `at`.
    pub name: Spanned<String>,
    /// The channel that drives it.
    pub channel: Spanned<String>,
    /// Channel values at -1 (or 0 when `one_sided`) and at 1.
    pub range: Spanned<[f64; 2]>,
    /// The parameter runs from 0 to 1 instead of -1 to +1.
    #[serde(default)]
    pub one_sided: bool,
    /// Part of the range that counts as nothing.
    #[serde(default)]
    pub dead_zone: f64,
}

/// An example clip of a class.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClipEntry {
    /// Path of the clip.
    pub file: Spanned<String>,
    /// Gesture amplitude at which it is played pure.
    #[serde(default = "one")]
    pub amplitude: f64,
    /// Gesture frequency at which it is played pure, Hz.
    #[serde(default)]
    pub frequency_hz: f64,
    /// Its further parameters, by name; 0 when not given.
    #[serde(default)]
    pub at: BTreeMap<String, f64>,
}

/// A channel mixed from those of the pose stream: `offset` plus every channel times its weight,
/// limited to `range`, smoothed. A layer asks for it by its name like for any other.
///
/// ```toml
/// [[channel]]
/// name = "emotion"             # -1 sad to +1 happy, from the blendshapes of a face
/// weights = { MouthSmileLeft = 0.5, MouthSmileRight = 0.5, MouthFrownLeft = -0.5, MouthFrownRight = -0.5 }
/// offset = 0.0                 # value while all of them are 0
/// range = [-1.0, 1.0]          # never beyond
/// smoothing_s = 0.15           # standard deviation of the smoothing, 0 to 2 s
///
/// [[layer]]
/// name = "mood"
/// channel = "emotion"
/// clip = "clips/crouch.json"
/// range = [0.1, -0.8]          # the sadder, the lower
/// one_sided = true
/// ```
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelEntry {
    /// Channel name; none of the stream's.
    pub name: Spanned<String>,
    /// Channels and their weights: the stream's, `yaw`, `height`, `distance`, `x`, `z` of the global
    /// motion, and derived ones that stand before.
    pub weights: BTreeMap<String, f64>,
    /// Added to the mix.
    #[serde(default)]
    pub offset: f64,
    /// Lowest and highest value; unlimited when not given.
    #[serde(default)]
    pub range: Option<[f64; 2]>,
    /// Standard deviation of the smoothing, seconds.
    #[serde(default)]
    pub smoothing_s: f64,
}

/// An additive layer.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LayerEntry {
    /// Layer name.
    pub name: Spanned<String>,
    /// The channel that drives it.
    pub channel: Option<Spanned<String>>,
    /// Or the gesture that does: its amplitude or progression, and for a cycle its phase.
    pub gesture: Option<Spanned<String>>,
    /// Or the clock: a cycle goes round by itself (breathing).
    #[serde(default)]
    pub clock: bool,
    /// Path of the clip: the end of a path is weight 1; a cycle is scaled by the weight.
    pub clip: Spanned<String>,
    /// Channel values at the lowest and the highest weight.
    pub range: Option<Spanned<[f64; 2]>>,
    /// Joints that it may move; all when not given. `body` is the body over the ground.
    pub joints: Option<Vec<String>>,
    /// Cycles a second of a cycle that no gesture drives; as the clip was made when not given.
    pub frequency_hz: Option<f64>,
    /// Only while no gesture is performed.
    #[serde(default)]
    pub idle_only: bool,
    /// Weight runs from 0 to 1 instead of -1 to +1.
    #[serde(default)]
    pub one_sided: bool,
    /// Part of the range that counts as nothing.
    #[serde(default)]
    pub dead_zone: f64,
}

/// Edges and thresholds of the motion graph.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GraphEntry {
    /// Class played when nothing is performed; the first class when not given.
    pub start: Option<Spanned<String>>,
    /// Edges as `["from", "to"]`; all pairs when not given.
    pub edges: Option<Vec<Spanned<[String; 2]>>>,
    /// Activation that starts a transition.
    pub rise: Option<f64>,
    /// Activation below which it is aborted.
    pub abort: Option<f64>,
    /// Activation of the source below which it succeeds.
    pub release: Option<f64>,
    /// Length of a blend, seconds.
    pub blend_s: Option<f64>,
    /// Idle time before the start class comes back, seconds.
    pub idle_s: Option<f64>,
    /// Transitions between classes of clips are chosen at run time, by likeness and latency, in place of a blend.
    pub search: Option<SearchEntry>,
}

/// How transitions are chosen.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SearchEntry {
    /// Steps that are looked ahead (10).
    pub depth: Option<usize>,
    /// Length of a step, as a part of a cycle or path, and of a parameter's range (0.1).
    pub step: Option<f64>,
    /// Cost of a frame of latency, at 25 frames a second (5).
    pub lambda: Option<f64>,
    /// Cost of a dissimilarity of 1; found from random requests when not given.
    pub kappa: Option<f64>,
    /// Least similarity of a transition, 0..1 (0): without one the class is not left.
    pub s_min: Option<f64>,
    /// Longest way to a transition, seconds (1).
    pub latency_s: Option<f64>,
    /// Edges that it is for, as `["from", "to"]`; all that it can be for when not given.
    pub edges: Option<Vec<Spanned<[String; 2]>>>,
}

/// An avatar: a skeleton that is played without servos. Commented in `configs/fox.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AvatarEntry {
    /// Path of a file with the skeleton: glTF, BVH, AMC.
    pub model: Spanned<String>,
    /// Metres per unit of length of the model and of its clips; as the format says when not given.
    pub unit_m: Option<f64>,
    /// Control cycles per second.
    #[serde(default = "control_rate")]
    pub rate_hz: f64,
    /// Limbs that stand on the ground.
    #[serde(default)]
    pub limb: Vec<LimbEntry>,
    /// Feet that stand on the ground stay where they are, by turning the limb's joints; quick motion jerks.
    #[serde(default)]
    pub pin_feet: bool,
}

/// A limb of an avatar.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimbEntry {
    /// Limb name.
    pub name: String,
    /// The joint that touches the ground.
    pub end: Spanned<String>,
    /// How many joints above it the limb has.
    #[serde(default = "two_joints")]
    pub joints: usize,
}

/// The terminal view.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViewEntry {
    /// Pictures per second.
    #[serde(default = "refresh")]
    pub refresh_hz: f64,
}

impl Default for ViewEntry {
    fn default() -> Self {
        Self {
            refresh_hz: refresh(),
        }
    }
}

fn one() -> f64 {
    1.0
}
fn yes() -> bool {
    true
}
fn two_joints() -> usize {
    2
}
fn refresh() -> f64 {
    20.0
}
fn control_rate() -> f64 {
    200.0
}
