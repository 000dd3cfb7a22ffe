//! From a configuration to checked parts: every file read, every name resolved, every number in range.

use super::body::Body;
use super::channel::{self, ChannelParts, channel_parts};
use super::class::{ClassParts, class_parts};
use super::error::{ConfigError, Pointer};
use super::file::{CharacterFile, GestureEntry};
use super::files::Files;
use super::gestures::{GestureFiles, Reader, merged};
use super::layer::{LayerParts, layer_parts};
use super::motion::{GraphParts, clip, graph_parts, neighbourhoods, read};
use super::numbers::check_numbers;
use super::parts::{Parts, parts};
use super::record::{RecordOptions, record_options};
use super::safety::Safety;
use super::search::{SearchParts, search_parts};
use super::servos::check_stopping;
use crate::bus::BusAddress;
use crate::bus::dynamixel::ServoSpec;
use crate::gesture::{
    EstimatorKind, FeatureSpec, FrontEnd, FrontEndOptions, GestureSet, PerformerScale,
};
use crate::motion::Animator;
use crate::motion::class::MotionClass;
use crate::motion::clip::{Clip, ClipKind};
use crate::motion::gait_frames::outside_limits;
use crate::motion::graph::Graph;
use crate::motion::mapping::DirectClass;
use crate::motion::node::ClassInput;
use crate::motion::node::Node;
use crate::motion::range::JointRange;
use crate::pose::PoseHeader;
use crate::robot::{Envelope, JointEnvelope, RobotModel};

/// A checked character: everything but the pose stream and the bus.
#[derive(Debug)]
pub struct Character {
    /// Name for people.
    pub name: String,
    /// The configuration's name for messages.
    pub config_name: String,
    /// The configuration's name among its files.
    pub config_file: String,
    /// Where its files are.
    pub files: Files,
    /// Pose source as written, such as `file:performances/x.csv`.
    pub source: String,
    /// The robot; `None` for an avatar.
    pub model: Option<RobotModel>,
    /// Its poses and feet.
    pub body: Body,
    /// What is driven, in model order: joints of a robot, coordinates of an avatar (`hips.qx`).
    pub joints: Vec<String>,
    /// Servos in model order.
    pub servos: Vec<ServoSpec>,
    /// Gestures.
    pub gestures: GestureSet,
    /// How gestures are read.
    pub front_options: FrontEndOptions,
    /// Whether changed gesture files are loaded while a run goes on; `None`: with live sources.
    pub reload: Option<bool>,
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
    /// What is kept of runs.
    pub record: RecordOptions,
    graph: GraphParts,
    search: Option<SearchParts>,
    layers: Vec<LayerParts>,
    channels: Vec<ChannelParts>,
    /// Paths of the gesture files, and what stood in them.
    gesture_texts: (Vec<String>, Vec<String>),
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

    let Parts {
        model,
        body,
        joints,
        limits,
        servos,
        wire,
    } = parts(&files, &file, &at)?;
    let ranges = joint_ranges(&body, &limits);
    let (mut gestures, paths, texts) = gesture_set(&files, &file, &at)?;
    let mut classes = class_parts(
        &files,
        &file,
        &body,
        model.as_ref(),
        &joints,
        &limits,
        &gestures,
        &at,
    )?;
    if let (true, Some(map)) = (
        gestures.gestures.is_empty(),
        classes.iter().find_map(|c| c.map.as_ref()),
    ) {
        // Global motion is then what the map says it is.
        gestures.header = map.spec.header.clone();
        gestures.global = map.spec.global.clone();
        gestures.reference = map.spec.reference.clone();
    }
    for class in classes.iter_mut().filter(|c| c.map.is_none()) {
        for example in &class.examples {
            if let Some(problem) = outside(&example.clip, model.as_ref()) {
                return Err(at.key(
                    "class.clip",
                    format!("clip {}: {problem}", example.clip.name),
                ));
            }
        }
        let built = MotionClass::new(
            &class.name,
            class.examples.clone(),
            ranges.clone(),
            class.options.clone(),
        )
        .map_err(|e| at.key("class.name", e))?;
        class.blending = class.blend.of(&built, body.space.get(), &file_name)?;
    }
    let graph = graph_parts(&file, &classes, &at)?;
    let search = search_parts(&file, &classes, &at)?;
    let layers = file
        .layer
        .iter()
        .map(|entry| layer_parts(&files, entry, &body, &gestures, &at))
        .collect::<Result<_, _>>()?;
    let channels = channel_parts(&file, &at)?;
    let end_pose = match &file.safety.end_clip {
        Some(path) => {
            let clip = clip(
                &files,
                path,
                "safety.end_clip",
                &body,
                Some(ClipKind::Path),
                &at,
            )?;
            if clip.kind != ClipKind::Path {
                let problem = format!(
                    "clip {} is a cycle; the end pose is the end of a path",
                    clip.name
                );
                return Err(at.at(path.span(), "safety.end_clip", problem));
            }
            if let Some(problem) = outside(&clip, model.as_ref()) {
                let problem = format!("clip {}: {problem}", clip.name);
                return Err(at.at(path.span(), "safety.end_clip", problem));
            }
            let mut pose = vec![0.0; clip.coordinates()];
            clip.pose(1.0, &mut pose);
            pose.truncate(joints.len());
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
    let safety = &file.safety;
    check_stopping(&servos, safety.on_exit, wire.watchdog_ms, &at)?;
    let front_options = FrontEndOptions {
        estimator,
        lambda: file.input.window,
        scale: performer_scale(&file, &at)?,
        ..FrontEndOptions::default()
    };
    let character = Character {
        name: file.name.clone(),
        config_name: file_name.clone(),
        config_file: name.into(),
        source: file.input.source.get_ref().clone(),
        front_options,
        gesture_texts: (paths, texts),
        reload: file.input.reload,
        safety: Safety::of(safety),
        bus: wire.bus,
        sim_baud: wire.baud,
        rate_hz: wire.rate_hz,
        watchdog_ms: wire.watchdog_ms,
        view_hz: file.view.refresh_hz,
        record: record_options(&file.record, &files, &at)?,
        files,
        model,
        body,
        joints,
        servos,
        gestures,
        limits,
        classes,
        end_pose,
        graph,
        search,
        layers,
        channels,
    };
    character
        .check_watchdog(character.rate_hz)
        .map_err(|problem| at.key("bus.watchdog_ms", problem))?;
    Ok(character)
}

impl Character {
    /// Adds the derived channels to those of `front`.
    pub fn with_channels(&self, front: FrontEnd) -> Result<FrontEnd, ConfigError> {
        channel::bind(front, &self.channels, &self.config_name)
    }

    /// The animator, with layers bound to the channels of `front`.
    pub fn animator(&self, front: &FrontEnd) -> Result<Animator, ConfigError> {
        let ranges = joint_ranges(&self.body, &self.limits);
        let wrong = |key: &str, line: Option<usize>, problem: String| ConfigError {
            file: self.config_name.clone(),
            line,
            key: key.into(),
            problem,
        };
        let classes = self
            .classes
            .iter()
            .map(|c| match &c.map {
                Some(parts) => {
                    let (map, always) = (parts.map.clone(), c.gesture.is_none());
                    Ok(DirectClass::new(&c.name, map, ranges.clone(), always).into())
                }
                None => {
                    let (examples, options) = (c.examples.clone(), c.options.clone());
                    MotionClass::new(&c.name, examples, ranges.clone(), options)
                        .map(|class| Node::from(class.blended(c.blending.clone())))
                        .map_err(|e| wrong("class", None, e.to_string()))
                }
            })
            .collect::<Result<Vec<_>, _>>()?;
        let layers = (self.layers.iter())
            .map(|parts| parts.bind(front, &self.body, &ranges, &self.config_name))
            .collect::<Result<_, _>>()?;
        let (start, edges, options) = &self.graph;
        let edges: Vec<_> = edges.iter().map(|(from, to)| (*from, *to, 1.0)).collect();
        let graph = Graph::new(classes.len(), *start, &edges, *options);
        let space = self.body.space.boxed();
        let mut animator = Animator::new(space, classes, graph, layers, &ranges);
        if let Some(search) = &self.search {
            let made = search.make(&self.classes, &self.graph.1, &self.body.space.shared());
            for (from, to, search) in made.map_err(|e| wrong("graph.search", None, e))? {
                animator = animator.with_search(from, to, search);
            }
        }
        Ok(match self.body.pinned() {
            Some(feet) => animator.with_pinned_feet(feet),
            None => animator,
        })
    }

    /// Per class what drives it, bound to the channels of `front`; features are counted as in
    /// [`Character::features`].
    pub fn class_inputs(&self, front: &FrontEnd) -> Result<Vec<ClassInput>, ConfigError> {
        let mut features = 0..;
        (self.classes.iter())
            .map(|class| class.input(front, &mut features, &self.config_name))
            .collect()
    }

    /// The robot, for what works on robots alone.
    pub fn robot(&self) -> Result<&RobotModel, ConfigError> {
        self.model.as_ref().ok_or_else(|| ConfigError {
            file: self.config_name.clone(),
            line: None,
            key: "avatar".into(),
            problem: "this needs a robot with joints and limits; the character is an avatar".into(),
        })
    }

    /// Where an avatar stands before a run: as with nothing performed.
    pub fn standing(&self) -> Vec<f64> {
        let mut pose = vec![0.0; self.body.space.get().len()];
        self.body.space.get().rest(&mut pose);
        let (start, ..) = &self.graph;
        let examples = self.classes.get(*start).map_or(&[][..], |c| &c.examples);
        let still = examples.iter().find(|e| e.parameters[0] == 0.0);
        if let Some(example) = still.or(examples.first()) {
            example.clip.pose(0.0, &mut pose);
        }
        pose
    }

    /// Features of the pose maps, one per class that has one, in node order.
    pub fn features(&self) -> Vec<FeatureSpec> {
        let maps = self.classes.iter().filter_map(|c| c.map.as_ref());
        maps.map(|map| map.spec.clone()).collect()
    }

    /// Whether the servos' watchdog leaves room for cycles at `rate_hz`: one that runs out between two
    /// cycles would stop the robot again and again.
    pub fn check_watchdog(&self, rate_hz: f64) -> Result<(), String> {
        let least_ms = (3.0 * 1000.0 / rate_hz + 20.0).ceil();
        if self.watchdog_ms == 0 || f64::from(self.watchdog_ms) >= least_ms {
            return Ok(());
        }
        Err(format!(
            "at {rate_hz} Hz the servos' watchdog needs at least {least_ms} ms (three cycles and 20 ms); bus.watchdog_ms is {}. 0 turns it off",
            self.watchdog_ms
        ))
    }

    /// The envelope for cycles of `dt_s`.
    pub fn envelope(&self, dt_s: f64) -> Envelope {
        Envelope::new(self.limits.clone(), dt_s)
    }

    /// Per node of the motion graph the gestures that compete there, for
    /// [`FrontEnd::with_neighbourhoods`].
    pub fn neighbourhoods(&self) -> Vec<Vec<usize>> {
        neighbourhoods(&self.graph.1, &self.classes, self.gestures.gestures.len())
    }

    /// The gesture files, to be read again when they change.
    pub fn gesture_files(&self) -> GestureFiles {
        GestureFiles::new(
            &self.files,
            self.gesture_texts.clone(),
            &self.gestures,
            Reader {
                options: self.front_options,
                edges: self.graph.1.clone(),
                classes: self.classes.clone(),
                channels: self.channels.clone(),
                config_name: self.config_name.clone(),
            },
        )
    }

    /// Start node and edges (from, to) of the motion graph, as indices of [`Character::classes`].
    pub fn graph(&self) -> (usize, &[(usize, usize)]) {
        (self.graph.0, &self.graph.1)
    }

    /// The clip of the layer of this name.
    pub fn layer_clip(&self, name: &str) -> Option<&Clip> {
        let layer = self.layers.iter().find(|l| l.name == name)?;
        Some(&layer.clip)
    }

    /// Names of the layers, in order.
    pub fn layer_names(&self) -> Vec<String> {
        self.layers.iter().map(|l| l.name.clone()).collect()
    }
}

/// The scale of `[input] scale`: a number, or `"rest"`.
fn performer_scale(file: &CharacterFile, at: &Pointer<'_>) -> Result<PerformerScale, ConfigError> {
    let Some(value) = &file.input.scale else {
        return Ok(PerformerScale::default());
    };
    let written = match value.get_ref() {
        toml::Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    written
        .parse()
        .map_err(|problem: String| at.at(value.span(), "input.scale", problem))
}

/// What each joint may do; nothing is asked of an avatar's.
fn joint_ranges(body: &Body, limits: &[JointEnvelope]) -> Vec<JointRange> {
    if body.avatar.is_some() {
        return Vec::new();
    }
    limits
        .iter()
        .map(|l| JointRange {
            velocity: l.velocity,
            acceleration: l.acceleration,
        })
        .collect()
}

/// Where a clip leaves a robot's limits.
fn outside(clip: &Clip, model: Option<&RobotModel>) -> Option<String> {
    outside_limits(clip, model?).into_iter().next()
}

/// All gesture files as one set, with their paths and texts.
fn gesture_set(
    files: &Files,
    file: &CharacterFile,
    at: &Pointer<'_>,
) -> Result<(GestureSet, Vec<String>, Vec<String>), ConfigError> {
    let entries = &file.gesture;
    if entries.is_empty() && file.class.iter().any(|c| c.map.is_some()) {
        let header = PoseHeader {
            points: Vec::new(),
            dim: 3,
            channels: Vec::new(),
        };
        return Ok((GestureSet::new(&header, Vec::new()), Vec::new(), Vec::new()));
    }
    let text = |entry: &GestureEntry| read(files, &entry.file, "gesture.file", at);
    let texts = entries.iter().map(text).collect::<Result<Vec<_>, _>>()?;
    let path = |entry: &GestureEntry| entry.file.get_ref().clone();
    let paths: Vec<String> = entries.iter().map(path).collect();
    let set = merged(files, &paths, &texts)
        .map_err(|bad| at.at(entries[bad.index].file.span(), "gesture.file", bad.problem))?;
    let none = "no gesture file; give [[gesture]] file = \"gestures/hand.toml\" (only a character with a class with `map` may be without)";
    Ok((set.ok_or_else(|| at.key("gesture", none))?, paths, texts))
}
