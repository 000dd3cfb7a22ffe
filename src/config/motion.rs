//! Clips and the graph of a configuration, checked and resolved to indices.

use super::body::Body;
use super::class::ClassParts;
use super::error::{ConfigError, Pointer};
use super::file::CharacterFile;
use super::files::Files;
use crate::base::suggest::hint;
use crate::motion::clip::{Clip, ClipKind};
use crate::motion::graph::GraphOptions;
use std::ops::Range;

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
    use crate::motion::class::ClassOptions;

    #[test]
    fn a_neighbourhood_reaches_two_edges_far_in_both_directions() {
        let class = |gesture: usize| ClassParts {
            name: gesture.to_string(),
            gesture: Some(gesture),
            map: None,
            options: ClassOptions::default(),
            reverse: false,
            channel: None,
            blend: crate::config::blending::BlendParts::default(),
            blending: crate::body::Blending::Linear,
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
