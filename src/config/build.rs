//! From a configuration to checked parts: every file read, every name resolved, every number in range.

use super::error::{ConfigError, Pointer};
use super::file::{CharacterFile, JointEntry, LayerEntry, OnExit, OnLost};
use super::files::Files;
use crate::base::suggest::nearest;
use crate::body::JointSpace;
use crate::bus::address::BusAddress;
use crate::bus::dynamixel::{Direction, Model, ServoSpec};
use crate::gesture::{EstimatorKind, FrontEnd, FrontEndOptions, GestureSet};
use crate::motion::Animator;
use crate::motion::class::{Example, MotionClass};
use crate::motion::clip::{Clip, ClipFile, ClipKind};
use crate::motion::graph::{Graph, GraphOptions};
use crate::motion::layer::{ChannelMap, Layer};
use crate::motion::range::JointRange;
use crate::robot::{Envelope, JointEnvelope, RobotModel};
use std::ops::Range;

/// A servo of the joint map, in model order.
pub type ServoEntry = ServoSpec;

/// A checked character: everything but the pose stream and the bus.
#[derive(Debug)]
pub struct Character {
    /// Name for people.
    pub name: String,
    /// The configuration's name for messages.
    pub config_name: String,
    /// Where its files are.
    pub files: Files,
    /// Pose source as written, such as `file:performances/x.csv`.
    pub source: String,
    /// The robot.
    pub model: RobotModel,
    /// Joint names in model order.
    pub joints: Vec<String>,
    /// Servos in model order.
    pub servos: Vec<ServoEntry>,
    /// Gestures.
    pub gestures: GestureSet,
    /// How gestures are read.
    pub front_options: FrontEndOptions,
    /// Envelope limits in model order.
    pub limits: Vec<JointEnvelope>,
    /// Class names with the gesture that drives each, in node order.
    pub classes: Vec<ClassParts>,
    /// Bus as written.
    pub bus: BusAddress,
    /// Baud rate of the simulated line.
    pub sim_baud: u32,
    /// Control cycles per second.
    pub rate_hz: f64,
    /// Servo-side watchdog, ms; 0 is off.
    pub watchdog_ms: u32,
    /// Where a run ends, rad, model order; `None` is the rest pose.
    pub end_pose: Option<Vec<f64>>,
    /// Ramps and policies.
    pub safety: Safety,
    /// Pictures per second of the terminal view.
    pub view_hz: f64,
    graph: (usize, Vec<(usize, usize)>, GraphOptions),
    layers: Vec<LayerParts>,
}

/// Ramps and policies, checked.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Safety {
    /// Least time to the first pose, seconds.
    pub ramp_s: f64,
    /// Least time into the end pose, seconds.
    pub end_ramp_s: f64,
    /// Prediction to the instant the servo acts, seconds.
    pub actuation_delay_s: f64,
    /// Age of poses up to which gestures go on, seconds.
    pub coast_s: f64,
    /// Age of poses from which they are lost, seconds.
    pub lost_s: f64,
    /// What then happens.
    pub on_lost: OnLost,
    /// Torque at the end.
    pub on_exit: OnExit,
}

/// A class before it is built.
#[derive(Clone, Debug)]
pub struct ClassParts {
    /// Class name.
    pub name: String,
    /// Index of its gesture in the gesture set.
    pub gesture: usize,
    examples: Vec<Example>,
}

impl ClassParts {
    /// Names of the example clips, in the order of the class's weights.
    pub fn clip_names(&self) -> Vec<String> {
        self.examples.iter().map(|e| e.clip.name.clone()).collect()
    }
}

#[derive(Clone, Debug)]
struct LayerParts {
    name: String,
    channel: String,
    map: ChannelMap,
    clip: Clip,
}

/// Loads the configuration `name` from `files` and checks all of it.
pub fn load(files: Files, name: &str) -> Result<Character, ConfigError> {
    let text = files.read(name)?;
    let file_name = files.name(name);
    let at = Pointer {
        file: &file_name,
        text: &text,
    };
    let file: CharacterFile = toml::from_str(&text).map_err(|e| at.toml(&e))?;
    check_numbers(&file, &at)?;

    let model = RobotModel::from_urdf(&read(&files, &file.robot.urdf, "robot.urdf", &at)?)
        .map_err(|e| at.at(file.robot.urdf.span(), "robot.urdf", e))?;
    let joints = model.joint_names();
    let limits = envelope_limits(&file, &model);
    let servos = servo_map(&file, &model, &at)?;
    let ranges = joint_ranges(&limits);
    let gestures = gesture_set(&files, &file, &at)?;
    let classes = class_parts(&files, &file, &joints, &gestures, &at)?;
    for class in &classes {
        MotionClass::new(&class.name, class.examples.clone(), ranges.clone())
            .map_err(|e| at.key("class.name", e))?;
    }
    let graph = graph_parts(&file, &classes, &at)?;
    let layers = file
        .layer
        .iter()
        .map(|entry| layer_parts(&files, entry, &joints, &at))
        .collect::<Result<_, _>>()?;
    let end_pose = match &file.safety.end_clip {
        Some(path) => {
            let clip = clip(&files, path, "safety.end_clip", &joints, &at)?;
            let mut pose = vec![0.0; joints.len()];
            clip.pose(1.0, &mut pose);
            Some(pose)
        }
        None => None,
    };
    let estimator = match &file.input.estimator {
        Some(name) => EstimatorKind::from_name(name.get_ref()).ok_or_else(|| {
            at.at(
                name.span(),
                "input.estimator",
                format!(
                    "unknown estimator {:?}. Allowed: {}",
                    name.get_ref(),
                    EstimatorKind::NAMES.join(", ")
                ),
            )
        })?,
        None => EstimatorKind::default(),
    };
    let bus = file.bus.bus.parse().map_err(|e| at.key("bus.bus", e))?;
    let safety = &file.safety;
    Ok(Character {
        name: file.name.clone(),
        config_name: file_name.clone(),
        source: file.input.source.get_ref().clone(),
        front_options: FrontEndOptions {
            estimator,
            lambda: file.input.window,
        },
        safety: Safety {
            ramp_s: safety.ramp_s,
            end_ramp_s: safety.end_ramp_s,
            actuation_delay_s: safety.actuation_delay_s,
            coast_s: safety.coast_s,
            lost_s: safety.lost_s,
            on_lost: safety.on_lost,
            on_exit: safety.on_exit,
        },
        bus,
        sim_baud: file.bus.baud,
        rate_hz: file.bus.rate_hz,
        watchdog_ms: file.bus.watchdog_ms,
        view_hz: file.view.refresh_hz,
        files,
        model,
        joints,
        servos,
        gestures,
        limits,
        classes,
        end_pose,
        graph,
        layers,
    })
}

impl Character {
    /// The animator, with layers bound to the channels of `front`.
    pub fn animator(&self, front: &FrontEnd) -> Result<Animator, ConfigError> {
        let ranges = joint_ranges(&self.limits);
        let wrong = |key: &str, problem: String| ConfigError {
            file: self.config_name.clone(),
            line: None,
            key: key.into(),
            problem,
        };
        let classes = self
            .classes
            .iter()
            .map(|c| {
                MotionClass::new(&c.name, c.examples.clone(), ranges.clone())
                    .map_err(|e| wrong("class", e.to_string()))
            })
            .collect::<Result<Vec<_>, _>>()?;
        let mut layers = Vec::new();
        for parts in &self.layers {
            let channel = front.channel_index(&parts.channel).ok_or_else(|| {
                let names = front.channel_names();
                let hint = nearest(&parts.channel, names.iter().map(String::as_str))
                    .map(|n| format!("; did you mean {n:?}?"))
                    .unwrap_or_default();
                wrong(
                    "layer.channel",
                    format!(
                        "layer {}: the pose stream has no channel {:?}{hint} It has: {}",
                        parts.name,
                        parts.channel,
                        names.join(", ")
                    ),
                )
            })?;
            let layer = Layer::new(&parts.name, channel, parts.map, parts.clip.clone(), &ranges)
                .ok_or_else(|| {
                    wrong(
                        "layer.clip",
                        format!("layer {}: a layer needs a path, not a cycle", parts.name),
                    )
                })?;
            layers.push(layer);
        }
        let (start, edges, options) = &self.graph;
        let graph = Graph::new(classes.len(), *start, edges, *options);
        Ok(Animator::new(
            Box::new(JointSpace::new(self.joints.len())),
            classes,
            graph,
            layers,
        ))
    }

    /// The envelope for cycles of `dt_s`.
    pub fn envelope(&self, dt_s: f64) -> Envelope {
        Envelope::new(self.limits.clone(), dt_s)
    }

    /// Names of the layers, in order.
    pub fn layer_names(&self) -> Vec<String> {
        self.layers.iter().map(|l| l.name.clone()).collect()
    }
}

fn joint_ranges(limits: &[JointEnvelope]) -> Vec<JointRange> {
    limits
        .iter()
        .map(|l| JointRange {
            velocity: l.velocity,
            acceleration: l.acceleration,
        })
        .collect()
}

fn check_numbers(file: &CharacterFile, at: &Pointer<'_>) -> Result<(), ConfigError> {
    let s = &file.safety;
    let g = &file.graph;
    let checks = [
        ("input.window", file.input.window, 0.1, 2.0),
        (
            "robot.acceleration_rad_s2",
            Some(file.robot.acceleration_rad_s2),
            1.0,
            1e5,
        ),
        (
            "robot.velocity_share",
            Some(file.robot.velocity_share),
            0.01,
            1.0,
        ),
        ("bus.rate_hz", Some(file.bus.rate_hz), 10.0, 2000.0),
        ("bus.baud", Some(f64::from(file.bus.baud)), 9600.0, 4.5e6),
        (
            "bus.watchdog_ms",
            Some(f64::from(file.bus.watchdog_ms)),
            0.0,
            2540.0,
        ),
        ("safety.ramp_s", Some(s.ramp_s), 0.1, 60.0),
        ("safety.end_ramp_s", Some(s.end_ramp_s), 0.1, 60.0),
        (
            "safety.actuation_delay_s",
            Some(s.actuation_delay_s),
            0.0,
            0.5,
        ),
        ("safety.coast_s", Some(s.coast_s), 0.0, 10.0),
        ("safety.lost_s", Some(s.lost_s), s.coast_s + 0.05, 60.0),
        ("graph.rise", g.rise, 0.01, 1.0),
        ("graph.release", g.release, 0.01, 1.0),
        ("graph.abort", g.abort, 0.0, g.rise.unwrap_or(0.2)),
        ("graph.blend_s", g.blend_s, 0.1, 10.0),
        ("graph.idle_s", g.idle_s, 0.0, 60.0),
        ("view.refresh_hz", Some(file.view.refresh_hz), 1.0, 120.0),
    ];
    for (key, value, low, high) in checks {
        if let Some(v) = value
            && !(v >= low && v <= high)
        {
            return Err(at.key(key, format!("{v} is not in {low}..{high}")));
        }
    }
    Ok(())
}

fn read(
    files: &Files,
    path: &toml::Spanned<String>,
    key: &str,
    at: &Pointer<'_>,
) -> Result<String, ConfigError> {
    files
        .read(path.get_ref())
        .map_err(|e| at.at(path.span(), key, e))
}

fn clip(
    files: &Files,
    path: &toml::Spanned<String>,
    key: &str,
    joints: &[String],
    at: &Pointer<'_>,
) -> Result<Clip, ConfigError> {
    let text = read(files, path, key, at)?;
    ClipFile::from_json(&text)
        .and_then(|f| f.for_body(joints))
        .map_err(|e| {
            at.at(
                path.span(),
                key,
                format!("{}: {e}", files.name(path.get_ref())),
            )
        })
}

fn envelope_limits(file: &CharacterFile, model: &RobotModel) -> Vec<JointEnvelope> {
    model
        .limits()
        .iter()
        .map(|l| JointEnvelope {
            lower: l.lower,
            upper: l.upper,
            velocity: l.velocity * file.robot.velocity_share,
            acceleration: file.robot.acceleration_rad_s2,
        })
        .collect()
}

fn servo_map(
    file: &CharacterFile,
    model: &RobotModel,
    at: &Pointer<'_>,
) -> Result<Vec<ServoSpec>, ConfigError> {
    let joints = model.joint_names();
    let servo_model = Model::by_name(file.bus.model.get_ref()).ok_or_else(|| {
        let names: Vec<&str> = crate::bus::dynamixel::model::MODELS
            .iter()
            .map(|m| m.name)
            .collect();
        at.key(
            "bus.model",
            format!(
                "unknown servo model {:?}. Allowed: {}",
                file.bus.model.get_ref(),
                names.join(", ")
            ),
        )
    })?;
    let mut by_joint: Vec<Option<&JointEntry>> = vec![None; joints.len()];
    for entry in &file.robot.joint {
        let name = entry.name.get_ref();
        let Some(joint) = joints.iter().position(|j| j == name) else {
            let hint = nearest(name, joints.iter().map(String::as_str))
                .map(|n| format!("; did you mean {n:?}?"))
                .unwrap_or_default();
            return Err(at.at(
                entry.name.span(),
                "robot.joint.name",
                format!(
                    "{name:?} is not a moving joint of {}{hint} Joints: {}",
                    file.robot.urdf.get_ref(),
                    joints.join(", ")
                ),
            ));
        };
        if let Some(other) = by_joint
            .iter()
            .flatten()
            .find(|o| o.servo.get_ref() == entry.servo.get_ref())
        {
            return Err(at.at(
                entry.servo.span(),
                "robot.joint.servo",
                format!(
                    "servo {} is already given to joint {}; every joint needs its own",
                    entry.servo.get_ref(),
                    other.name.get_ref()
                ),
            ));
        }
        if by_joint[joint].replace(entry).is_some() {
            return Err(at.at(
                entry.name.span(),
                "robot.joint.name",
                format!("joint {name} is listed twice"),
            ));
        }
    }
    joints
        .iter()
        .zip(by_joint)
        .zip(model.limits())
        .map(|((joint, entry), limit)| {
            let entry = entry.ok_or_else(|| {
                at.key(
                    "robot.joint",
                    format!("joint {joint} has no servo; add {{ name = \"{joint}\", servo = ID }}"),
                )
            })?;
            servo_spec(entry, joint, servo_model, (limit.lower, limit.upper), at)
        })
        .collect()
}

fn servo_spec(
    entry: &JointEntry,
    joint: &str,
    model: &'static Model,
    (lower, upper): (f64, f64),
    at: &Pointer<'_>,
) -> Result<ServoSpec, ConfigError> {
    let direction = match entry.direction {
        1 => Direction::Forward,
        -1 => Direction::Reverse,
        other => {
            return Err(at.at(
                entry.name.span(),
                "robot.joint.direction",
                format!("{other} is not 1 or -1"),
            ));
        }
    };
    let [min_pulse, max_pulse] = *entry.range_pulse.get_ref();
    let spec = ServoSpec {
        id: *entry.servo.get_ref(),
        joint: joint.into(),
        model,
        zero_pulse: entry.zero_pulse,
        direction,
        min_pulse,
        max_pulse,
    };
    spec.check()
        .map_err(|e| at.at(entry.name.span(), "robot.joint", e))?;
    let ends = [spec.position_rad(min_pulse), spec.position_rad(max_pulse)];
    let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    if lower < low - 1e-3 || upper > high + 1e-3 {
        return Err(at.at(
            entry.name.span(),
            "robot.joint",
            format!(
                "joint {joint} moves in {lower:.3}..{upper:.3} rad, its servo only reaches {low:.3}..{high:.3} rad with zero_pulse {} and range_pulse {min_pulse}..{max_pulse}; correct these or narrow the URDF's limits",
                entry.zero_pulse
            ),
        ));
    }
    Ok(spec)
}

fn gesture_set(
    files: &Files,
    file: &CharacterFile,
    at: &Pointer<'_>,
) -> Result<GestureSet, ConfigError> {
    let entry = match file.gesture.as_slice() {
        [entry] => entry,
        other => {
            return Err(at.key(
                "gesture",
                format!(
                    "{} gesture files are named; give one [[gesture]] file, which may define many gestures",
                    other.len()
                ),
            ));
        }
    };
    let text = read(files, &entry.file, "gesture.file", at)?;
    GestureSet::from_toml(&text, &files.name(entry.file.get_ref()))
        .map_err(|e| at.at(entry.file.span(), "gesture.file", e))
}

fn class_parts(
    files: &Files,
    file: &CharacterFile,
    joints: &[String],
    gestures: &GestureSet,
    at: &Pointer<'_>,
) -> Result<Vec<ClassParts>, ConfigError> {
    if file.class.is_empty() {
        return Err(at.key("class", "no motion class; add a [[class]] with clips"));
    }
    let mut parts: Vec<ClassParts> = Vec::new();
    for class in &file.class {
        let name = class.name.get_ref();
        if parts.iter().any(|p| p.name == *name) {
            return Err(at.at(
                class.name.span(),
                "class.name",
                format!("{name:?} is used twice"),
            ));
        }
        let wanted = class.gesture.get_ref();
        let names = || gestures.gestures.iter().map(|g| g.name.as_str());
        let gesture = names().position(|g| g == wanted).ok_or_else(|| {
            let hint = nearest(wanted, names())
                .map(|n| format!("; did you mean {n:?}?"))
                .unwrap_or_default();
            let all: Vec<&str> = names().collect();
            at.at(
                class.gesture.span(),
                "class.gesture",
                format!("no gesture {wanted:?}{hint} Gestures: {}", all.join(", ")),
            )
        })?;
        let mut examples = Vec::new();
        for entry in &class.clip {
            let in_range = (0.0..=10.0).contains(&entry.amplitude)
                && (0.0..=50.0).contains(&entry.frequency_hz);
            if !in_range {
                return Err(at.at(
                    entry.file.span(),
                    "class.clip",
                    format!(
                        "amplitude {} must lie in 0..10, frequency_hz {} in 0..50",
                        entry.amplitude, entry.frequency_hz
                    ),
                ));
            }
            let clip = clip(files, &entry.file, "class.clip.file", joints, at)?;
            if clip.kind == ClipKind::Cycle && entry.amplitude > 0.0 && entry.frequency_hz <= 0.0 {
                return Err(at.at(
                    entry.file.span(),
                    "class.clip.frequency_hz",
                    format!(
                        "clip {} is a cycle and needs a frequency above 0 Hz",
                        clip.name
                    ),
                ));
            }
            examples.push(Example {
                clip,
                parameters: [entry.amplitude, entry.frequency_hz],
            });
        }
        parts.push(ClassParts {
            name: name.clone(),
            gesture,
            examples,
        });
    }
    Ok(parts)
}

type GraphParts = (usize, Vec<(usize, usize)>, GraphOptions);

fn graph_parts(
    file: &CharacterFile,
    classes: &[ClassParts],
    at: &Pointer<'_>,
) -> Result<GraphParts, ConfigError> {
    let find = |name: &str, span: Range<usize>, key: &str| {
        classes.iter().position(|c| c.name == name).ok_or_else(|| {
            let names: Vec<&str> = classes.iter().map(|c| c.name.as_str()).collect();
            let hint = nearest(name, names.iter().copied())
                .map(|n| format!("; did you mean {n:?}?"))
                .unwrap_or_default();
            at.at(
                span,
                key,
                format!("no class {name:?}{hint} Classes: {}", names.join(", ")),
            )
        })
    };
    let graph = &file.graph;
    let start = match &graph.start {
        Some(name) => find(name.get_ref(), name.span(), "graph.start")?,
        None => 0,
    };
    let mut edges = Vec::new();
    match &graph.edges {
        Some(list) => {
            for edge in list {
                let [from, to] = edge.get_ref();
                edges.push((
                    find(from, edge.span(), "graph.edges")?,
                    find(to, edge.span(), "graph.edges")?,
                ));
            }
        }
        None => {
            for from in 0..classes.len() {
                edges.extend(
                    (0..classes.len())
                        .filter(|to| *to != from)
                        .map(|to| (from, to)),
                );
            }
        }
    }
    let standard = GraphOptions::default();
    let options = GraphOptions {
        rise: graph.rise.unwrap_or(standard.rise),
        abort: graph.abort.unwrap_or(standard.abort),
        release: graph.release.unwrap_or(standard.release),
        blend_s: graph.blend_s.unwrap_or(standard.blend_s),
        idle_s: graph.idle_s.unwrap_or(standard.idle_s),
    };
    Ok((start, edges, options))
}

fn layer_parts(
    files: &Files,
    entry: &LayerEntry,
    joints: &[String],
    at: &Pointer<'_>,
) -> Result<LayerParts, ConfigError> {
    let [low, high] = *entry.range.get_ref();
    if !(low.is_finite() && high.is_finite() && low != high) {
        return Err(at.at(
            entry.range.span(),
            "layer.range",
            format!("[{low}, {high}] must be two different finite numbers"),
        ));
    }
    if !(0.0..=0.9).contains(&entry.dead_zone) {
        return Err(at.at(
            entry.range.span(),
            "layer.dead_zone",
            format!("{} is not in 0..0.9", entry.dead_zone),
        ));
    }
    let clip = clip(files, &entry.clip, "layer.clip", joints, at)?;
    if clip.kind != ClipKind::Path {
        return Err(at.at(
            entry.clip.span(),
            "layer.clip",
            format!("clip {} is a cycle; a layer needs a path", clip.name),
        ));
    }
    Ok(LayerParts {
        name: entry.name.clone(),
        channel: entry.channel.get_ref().clone(),
        map: ChannelMap {
            low,
            high,
            one_sided: entry.one_sided,
            dead_zone: entry.dead_zone,
        },
        clip,
    })
}
