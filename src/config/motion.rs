//! Classes, graph and layers of a configuration, checked and resolved to indices.

use super::error::{ConfigError, Pointer};
use super::file::{CharacterFile, ClassEntry, LayerEntry};
use super::files::Files;
use super::map::{MapParts, load_map};
use crate::base::suggest::hint;
use crate::gesture::{GestureKind, GestureSet};
use crate::motion::class::Example;
use crate::motion::clip::{Clip, ClipFile, ClipKind};
use crate::motion::graph::GraphOptions;
use crate::motion::layer::ChannelMap;
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
    pub(super) examples: Vec<Example>,
}

impl ClassParts {
    /// Example clips with their parameters; none for a pose map.
    pub fn examples(&self) -> &[Example] {
        &self.examples
    }

    /// Names of the example clips, in the order of the class's weights.
    pub fn clip_names(&self) -> Vec<String> {
        self.examples.iter().map(|e| e.clip.name.clone()).collect()
    }
}

#[derive(Clone, Debug)]
pub(super) struct LayerParts {
    pub(super) name: String,
    pub(super) channel: String,
    /// Line of the channel in the configuration, for messages.
    pub(super) line: usize,
    pub(super) map: ChannelMap,
    pub(super) clip: Clip,
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

/// The clip that `path` names, in the order of `joints`.
pub(super) fn clip(
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

/// Classes in node order, with their clips.
pub(super) fn class_parts(
    files: &Files,
    file: &CharacterFile,
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
        let gesture = gesture_index(class, gestures, at)?;
        if let Some(path) = &class.map {
            parts.push(direct_parts(
                files, file, class, path, joints, limits, gesture, at,
            )?);
            continue;
        }
        let (Some(gesture), Some(wanted)) = (gesture, &class.gesture) else {
            return Err(at.at(
                class.name.span(),
                "class.gesture",
                "a class of clips needs a gesture that drives it; only a class with `map` may be without",
            ));
        };
        let wanted = wanted.get_ref();
        if class.clip.is_empty() {
            return Err(at.at(
                class.name.span(),
                "class.clip",
                "neither clips nor a map; give clip = [{ file = ... }] or map = \"maps/NAME.toml\"",
            ));
        }
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
            let repeats = gestures.gestures[gesture].kind == GestureKind::Cyclic;
            if repeats != (clip.kind == ClipKind::Cycle) {
                return Err(at.at(
                    entry.file.span(),
                    "class.clip",
                    format!(
                        "clip {} is a {}, gesture {wanted:?} is {}; cyclic gestures drive cycles, non-cyclic ones paths",
                        clip.name,
                        if clip.kind == ClipKind::Cycle { "cycle" } else { "path" },
                        gestures.gestures[gesture].kind.name(),
                    ),
                ));
            }
            examples.push(Example {
                clip,
                parameters: [entry.amplitude, entry.frequency_hz],
            });
        }
        let at_rest = examples.iter().filter(|e| e.parameters[0] == 0.0).count();
        let cyclic = examples.iter().any(|e| e.clip.kind == ClipKind::Cycle);
        if cyclic && at_rest != 1 {
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
            gesture: Some(gesture),
            map: None,
            examples,
        });
    }
    Ok(parts)
}

/// Index of the gesture that a class names.
fn gesture_index(
    class: &ClassEntry,
    gestures: &GestureSet,
    at: &Pointer<'_>,
) -> Result<Option<usize>, ConfigError> {
    let Some(entry) = &class.gesture else {
        return Ok(None);
    };
    let wanted = entry.get_ref();
    let names = || gestures.gestures.iter().map(|g| g.name.as_str());
    let found = names().position(|g| g == wanted).ok_or_else(|| {
        let hint = hint(wanted, names());
        let all: Vec<&str> = names().collect();
        at.at(
            entry.span(),
            "class.gesture",
            format!("no gesture {wanted:?}{hint} Gestures: {}", all.join(", ")),
        )
    })?;
    Ok(Some(found))
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

/// A layer, not yet bound to its channel.
pub(super) fn layer_parts(
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
        line: at.line_of(entry.channel.span().start),
        map: ChannelMap {
            low,
            high,
            one_sided: entry.one_sided,
            dead_zone: entry.dead_zone,
        },
        clip,
    })
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
