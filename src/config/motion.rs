//! Classes, graph and layers of a configuration, checked and resolved to indices.

use super::body::Body;
use super::error::{ConfigError, Pointer};
use super::file::{CharacterFile, ClassEntry, ClipEntry};
use super::files::Files;
use super::layer::channel_map;
use super::map::{MapParts, load_map};
use crate::base::suggest::hint;
use crate::gesture::{GestureKind, GestureSet};
use crate::motion::class::{ClassOptions, EXTRA, Example, Play};
use crate::motion::clip::{Clip, ClipKind};
use crate::motion::graph::GraphOptions;
use crate::motion::layer::ChannelMap;
use crate::motion::weights::{Parameters, WeightKind};
use crate::robot::JointEnvelope;
use std::ops::Range;

/// A class before it is built.
#[derive(Clone, Debug)]
pub struct ClassParts {
    /// Class name.
    pub name: String,
    /// Index of its gesture in the gesture set; `None` for a pose map that needs none.
    pub gesture: Option<usize>,
    /// The pose map, in place of clips.
    pub map: Option<MapParts>,
    /// How it is played.
    pub options: ClassOptions,
    /// Channels that drive its parameters beside amplitude and frequency.
    pub(super) extra: Vec<ExtraParts>,
    pub(super) examples: Vec<Example>,
}

/// A parameter of a class beside amplitude and frequency, not yet bound to its channel.
#[derive(Clone, Debug)]
pub(super) struct ExtraParts {
    pub(super) channel: String,
    pub(super) map: ChannelMap,
    /// Line in the configuration, for messages.
    pub(super) line: usize,
}

impl ClassParts {
    /// Names of the example clips, in the order of the class's weights.
    pub fn clip_names(&self) -> Vec<String> {
        self.examples.iter().map(|e| e.clip.name.clone()).collect()
    }
}

/// Text of the file that `path` names.
pub(super) fn read(
    files: &Files,
    path: &toml::Spanned<String>,
    key: &str,
    at: &Pointer<'_>,
) -> Result<String, ConfigError> {
    files
        .read(path.get_ref())
        .map_err(|e| at.at(path.span(), key, e))
}

/// The clip that `path` names, for `body`.
pub(super) fn clip(
    files: &Files,
    path: &toml::Spanned<String>,
    key: &str,
    body: &Body,
    kind: Option<ClipKind>,
    at: &Pointer<'_>,
) -> Result<Clip, ConfigError> {
    body.named_clip(files, path.get_ref(), kind)
        .map_err(|problem| at.at(path.span(), key, problem))
}

/// Classes in node order, with their clips.
pub(super) fn class_parts(
    files: &Files,
    file: &CharacterFile,
    body: &Body,
    joints: &[String],
    limits: &[JointEnvelope],
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
        let gesture = (class.gesture.as_ref())
            .map(|entry| gesture_named(entry, "class.gesture", gestures, at))
            .transpose()?;
        if let (Some(path), Some(_)) = (&class.map, &body.avatar) {
            let problem = "a pose map drives a robot; a class of an avatar has clips";
            return Err(at.at(path.span(), "class.map", problem));
        }
        if let Some(path) = &class.map {
            parts.push(direct_parts(
                files, file, class, path, joints, limits, gesture, at,
            )?);
            continue;
        }
        let play = play(class, at)?;
        let Some(gesture) = gesture.or((play == Play::Loop).then_some(NO_GESTURE)) else {
            return Err(at.at(
                class.name.span(),
                "class.gesture",
                "a class of clips needs a gesture that drives it; only one with `map`, or with play = \"loop\", may be without",
            ));
        };
        let gesture = (gesture != NO_GESTURE).then_some(gesture);
        if class.clip.is_empty() {
            return Err(at.at(
                class.name.span(),
                "class.clip",
                "neither clips nor a map; give clip = [{ file = ... }] or map = \"maps/NAME.toml\"",
            ));
        }
        let (extra, names) = extra_parts(class, at)?;
        let kind = match (gesture, play) {
            (_, Play::Loop) => Some(ClipKind::Cycle),
            (_, Play::Once) => Some(ClipKind::Path),
            (Some(gesture), Play::Gesture) => Some(match gestures.gestures[gesture].kind {
                GestureKind::Cyclic => ClipKind::Cycle,
                GestureKind::NonCyclic => ClipKind::Path,
            }),
            (None, Play::Gesture) => None,
        };
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
            let clip = clip(files, &entry.file, "class.clip.file", body, kind, at)?;
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
            if let (Some(gesture), Play::Gesture) = (gesture, play) {
                let gesture = &gestures.gestures[gesture];
                if (gesture.kind == GestureKind::Cyclic) != (clip.kind == ClipKind::Cycle) {
                    let kind = if clip.kind == ClipKind::Cycle {
                        "cycle"
                    } else {
                        "path"
                    };
                    return Err(at.at(
                        entry.file.span(),
                        "class.clip",
                        format!(
                            "clip {} is a {kind}, gesture {:?} is {}; cyclic gestures drive cycles, non-cyclic ones paths (or play = \"once\": the clock drives it)",
                            clip.name, gesture.name, gesture.kind.name(),
                        ),
                    ));
                }
            }
            examples.push(Example {
                clip,
                parameters: parameters(entry, &names, at)?,
            });
        }
        let at_rest = examples.iter().filter(|e| e.parameters[0] == 0.0).count();
        let cyclic = examples.iter().any(|e| e.clip.kind == ClipKind::Cycle);
        if cyclic && play == Play::Gesture && at_rest != 1 {
            return Err(at.at(
                class.name.span(),
                "class.clip",
                format!(
                    "{at_rest} clips have amplitude = 0; a cyclic class needs exactly one, which is played while nothing is performed (`handwave clip gait --gait stand` makes it)"
                ),
            ));
        }
        parts.push(ClassParts {
            name: name.clone(),
            gesture,
            map: None,
            options: ClassOptions {
                play,
                leave: class.leave.clone(),
                limb_advance: class
                    .limb_advance
                    .unwrap_or(ClassOptions::default().limb_advance),
                weights: weights(class, at)?,
                extra: names,
            },
            extra,
            examples,
        });
    }
    Ok(parts)
}

/// Stands for the gesture of a class that needs none.
const NO_GESTURE: usize = usize::MAX;

/// What moves a class along.
fn play(class: &ClassEntry, at: &Pointer<'_>) -> Result<Play, ConfigError> {
    let Some(play) = &class.play else {
        return Ok(Play::Gesture);
    };
    Ok(match play.get_ref().as_str() {
        "gesture" => Play::Gesture,
        "once" => Play::Once,
        "loop" => Play::Loop,
        other => {
            let problem = format!("unknown {other:?}. Allowed: gesture, once, loop");
            return Err(at.at(play.span(), "class.play", problem));
        }
    })
}

/// How a class turns parameters into weights.
fn weights(class: &ClassEntry, at: &Pointer<'_>) -> Result<WeightKind, ConfigError> {
    let Some(name) = &class.weights else {
        return Ok(WeightKind::default());
    };
    WeightKind::by_name(name.get_ref()).ok_or_else(|| {
        let problem = format!(
            "unknown {:?}. Allowed: {}",
            name.get_ref(),
            WeightKind::NAMES.join(", ")
        );
        at.at(name.span(), "class.weights", problem)
    })
}

/// A class's parameters beside amplitude and frequency, and their names.
fn extra_parts(
    class: &ClassEntry,
    at: &Pointer<'_>,
) -> Result<(Vec<ExtraParts>, Vec<String>), ConfigError> {
    let (mut parts, mut names) = (Vec::new(), Vec::new());
    for entry in &class.parameter {
        let name = entry.name.get_ref();
        let taken = ["amplitude", "frequency_hz"].contains(&name.as_str()) || names.contains(name);
        if taken || names.len() == EXTRA {
            let problem = format!(
                "{name:?} cannot be added: a class has amplitude, frequency_hz and at most {EXTRA} parameters of other names"
            );
            return Err(at.at(entry.name.span(), "class.parameter", problem));
        }
        parts.push(ExtraParts {
            channel: entry.channel.get_ref().clone(),
            map: channel_map(
                &entry.range,
                entry.one_sided,
                entry.dead_zone,
                "class.parameter",
                at,
            )?,
            line: at.line_of(entry.channel.span().start),
        });
        names.push(name.clone());
    }
    Ok((parts, names))
}

/// Parameters at which a clip is played pure.
fn parameters(
    entry: &ClipEntry,
    names: &[String],
    at: &Pointer<'_>,
) -> Result<Parameters, ConfigError> {
    let mut values = vec![entry.amplitude, entry.frequency_hz];
    for name in names {
        let value = entry.at.get(name).copied().unwrap_or(0.0);
        if !(-10.0..=10.0).contains(&value) {
            let problem = format!("{name} = {value} is not in -10..10");
            return Err(at.at(entry.file.span(), "class.clip.at", problem));
        }
        values.push(value);
    }
    if let Some(strange) = entry.at.keys().find(|k| !names.contains(k)) {
        let hint = hint(strange, names.iter().map(String::as_str));
        let problem = format!("no parameter {strange:?}{hint} Name it in class.parameter first");
        return Err(at.at(entry.file.span(), "class.clip.at", problem));
    }
    Ok(Parameters::from_slice(&values).unwrap_or_default())
}

/// Index of the gesture that `entry` names.
pub(super) fn gesture_named(
    entry: &toml::Spanned<String>,
    key: &str,
    gestures: &GestureSet,
    at: &Pointer<'_>,
) -> Result<usize, ConfigError> {
    let wanted = entry.get_ref();
    let names = || gestures.gestures.iter().map(|g| g.name.as_str());
    names().position(|g| g == wanted).ok_or_else(|| {
        let hint = hint(wanted, names());
        let all: Vec<&str> = names().collect();
        let problem = format!("no gesture {wanted:?}{hint} Gestures: {}", all.join(", "));
        at.at(entry.span(), key, problem)
    })
}

/// A class that maps poses.
#[allow(clippy::too_many_arguments, reason = "what a class is checked against")]
fn direct_parts(
    files: &Files,
    file: &CharacterFile,
    class: &ClassEntry,
    path: &toml::Spanned<String>,
    joints: &[String],
    limits: &[JointEnvelope],
    gesture: Option<usize>,
    at: &Pointer<'_>,
) -> Result<ClassParts, ConfigError> {
    let name = class.name.get_ref();
    if !class.clip.is_empty() {
        let problem = "a class has clips or a map, not both; make two classes of it";
        return Err(at.at(path.span(), "class.map", problem));
    }
    // Without a gesture it would never let another class begin, so it is the one that plays meanwhile.
    let start = file.graph.start.as_ref().map(|s| s.get_ref());
    let starts = start.or(file.class.first().map(|c| c.name.get_ref())) == Some(name);
    if gesture.is_none() && !starts {
        let problem = format!(
            "class {name} maps poses and has no gesture: it is played while nothing is performed, so it must be graph.start; or give it a gesture that activates it"
        );
        return Err(at.at(class.name.span(), "class.map", problem));
    }
    let lower: Vec<f64> = limits.iter().map(|l| l.lower).collect();
    let upper: Vec<f64> = limits.iter().map(|l| l.upper).collect();
    let map = load_map(files, path.get_ref(), joints, &lower, &upper)
        .map_err(|e| at.at(path.span(), "class.map", e))?;
    Ok(ClassParts {
        name: name.clone(),
        gesture,
        map: Some(map),
        options: ClassOptions::default(),
        extra: Vec::new(),
        examples: Vec::new(),
    })
}

/// Start node, edges, options.
pub(super) type GraphParts = (usize, Vec<(usize, usize)>, GraphOptions);

/// Start node, edges and options.
pub(super) fn graph_parts(
    file: &CharacterFile,
    classes: &[ClassParts],
    at: &Pointer<'_>,
) -> Result<GraphParts, ConfigError> {
    let find = |name: &str, span: Range<usize>, key: &str| {
        classes.iter().position(|c| c.name == name).ok_or_else(|| {
            let names: Vec<&str> = classes.iter().map(|c| c.name.as_str()).collect();
            let hint = hint(name, names.iter().copied());
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
    if options.abort >= options.rise {
        return Err(at.key(
            "graph.abort",
            format!(
                "abort {} must lie below rise {}, or a transition is given up as soon as it starts",
                options.abort, options.rise
            ),
        ));
    }
    Ok((start, edges, options))
}

/// Edges that a neighbourhood reaches over (Rhodin 2016, section 9.4.1).
const NEIGHBOURHOOD_EDGES: usize = 2;

/// Per node the gestures of all nodes within two edges, and those that drive no class: they were
/// defined to be told apart from.
///
/// Edges count in both directions: the gesture that led here may still be under way.
pub(super) fn neighbourhoods(
    edges: &[(usize, usize)],
    classes: &[ClassParts],
    gestures: usize,
) -> Vec<Vec<usize>> {
    let drives_none = |gesture: &usize| classes.iter().all(|class| class.gesture != Some(*gesture));
    let everywhere: Vec<usize> = (0..gestures).filter(drives_none).collect();
    let around = |node: usize| {
        let mut near = vec![false; classes.len()];
        near[node] = true;
        for _ in 0..NEIGHBOURHOOD_EDGES {
            let reached = near.clone();
            for (from, to) in edges {
                near[*to] |= reached[*from];
                near[*from] |= reached[*to];
            }
        }
        let nodes = (0..classes.len()).filter(|other| near[*other]);
        let mut list = everywhere.clone();
        list.extend(nodes.filter_map(|other| classes[other].gesture));
        list.sort_unstable();
        list.dedup();
        list
    };
    (0..classes.len()).map(around).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_neighbourhood_reaches_two_edges_far_in_both_directions() {
        let class = |gesture: usize| ClassParts {
            name: gesture.to_string(),
            gesture: Some(gesture),
            map: None,
            options: ClassOptions::default(),
            extra: Vec::new(),
            examples: Vec::new(),
        };
        // A chain of five classes, driven by gestures 4 to 0; gesture 5 drives none.
        let classes: Vec<ClassParts> = (0..5).rev().map(class).collect();
        let chain = [(0, 1), (1, 2), (3, 2), (4, 3)];
        assert_eq!(
            neighbourhoods(&chain, &classes, 6),
            [
                vec![2, 3, 4, 5],
                vec![1, 2, 3, 4, 5],
                vec![0, 1, 2, 3, 4, 5],
                vec![0, 1, 2, 3, 5],
                vec![0, 1, 2, 5],
            ]
        );
        let all = (0..5).flat_map(|a| (0..5).map(move |b| (a, b)));
        let everywhere = neighbourhoods(&all.collect::<Vec<_>>(), &classes, 6);
        assert_eq!(everywhere, vec![vec![0, 1, 2, 3, 4, 5]; 5]);
        // Two classes may share a gesture; a class without edges has its own alone.
        let alone = neighbourhoods(&[], &[class(1), class(1), class(0)], 2);
        assert_eq!(alone, [vec![1], vec![1], vec![0]]);
    }
}
