//! Transition search of a configuration: checked, and made for the edges it is for.

use super::class::ClassParts;
use super::error::{ConfigError, Pointer};
use super::file::CharacterFile;
use crate::body::PoseSpace;
use crate::motion::class::Play;
use crate::motion::clip::ClipKind;
use crate::motion::edge::EdgeSearch;
use crate::motion::search::calibrate::random_requests;
use crate::motion::search::clip_blend::ClipBlend;
use crate::motion::search::{DistanceTables, Search, SearchClass, SearchOptions, calibrate};
use std::sync::Arc;

/// How transitions are chosen, checked.
#[derive(Clone, Debug)]
pub(super) struct SearchParts {
    options: SearchOptions,
    /// Kappa is found from random requests.
    calibrated: bool,
    /// Edges it is for; `None`: all that it can be for.
    edges: Option<Vec<(usize, usize)>>,
}

/// Frames per clip.
const FRAMES: usize = 40;
/// Random requests that kappa is found from, and their seed.
const REQUESTS: (usize, u64) = (20, 7);
/// A path may be entered up to here: what it shows must not be lost.
const PATH_ENTRY: f64 = 0.2;
/// Longest way to a transition when none is given, seconds.
const LATENCY_S: f64 = 1.0;

/// Checks `[graph.search]`.
pub(super) fn search_parts(
    file: &CharacterFile,
    classes: &[ClassParts],
    at: &Pointer<'_>,
) -> Result<Option<SearchParts>, ConfigError> {
    let Some(entry) = &file.graph.search else {
        return Ok(None);
    };
    let depth = entry.depth.unwrap_or(10);
    let step = entry.step.unwrap_or(0.1);
    let checks = [
        ("graph.search.depth", depth as f64, 1.0, 20.0),
        ("graph.search.step", step, 0.02, 0.5),
        ("graph.search.lambda", entry.lambda.unwrap_or(5.0), 0.0, 1e6),
        ("graph.search.kappa", entry.kappa.unwrap_or(1.0), 1e-6, 1e9),
        ("graph.search.s_min", entry.s_min.unwrap_or(0.0), 0.0, 0.999),
        (
            "graph.search.latency_s",
            entry.latency_s.unwrap_or(LATENCY_S),
            0.05,
            10.0,
        ),
    ];
    for (key, value, low, high) in checks {
        if !(value >= low && value <= high) {
            return Err(at.key(key, format!("{value} is not in {low}..{high}")));
        }
    }
    let find = |name: &str, span: std::ops::Range<usize>| {
        let names: Vec<&str> = classes.iter().map(|c| c.name.as_str()).collect();
        names.iter().position(|n| *n == name).ok_or_else(|| {
            let problem = format!("no class {name:?}. Classes: {}", names.join(", "));
            at.at(span, "graph.search.edges", problem)
        })
    };
    let edges = match &entry.edges {
        None => None,
        Some(list) => {
            let mut edges = Vec::new();
            for edge in list {
                let [from, to] = edge.get_ref();
                let pair = (find(from, edge.span())?, find(to, edge.span())?);
                if !can_search(&classes[pair.0], &classes[pair.1]) {
                    let problem = format!(
                        "{from} to {to}: a search leaves a class of cycles and enters a class of clips; others are blended"
                    );
                    return Err(at.at(edge.span(), "graph.search.edges", problem));
                }
                edges.push(pair);
            }
            Some(edges)
        }
    };
    Ok(Some(SearchParts {
        options: SearchOptions {
            l_max: depth,
            delta_t: step,
            delta_w: step,
            lambda: entry.lambda.unwrap_or(5.0),
            kappa: entry.kappa.unwrap_or(SearchOptions::default().kappa),
            s_min: entry.s_min.unwrap_or(0.0),
            max_latency_s: Some(entry.latency_s.unwrap_or(LATENCY_S)),
            ..SearchOptions::default()
        },
        calibrated: entry.kappa.is_none(),
        edges,
    }))
}

/// A source must go on by itself, so that its poses to come are known: cycles do, paths are where their
/// gesture puts them.
fn can_search(from: &ClassParts, to: &ClassParts) -> bool {
    let kind = |class: &ClassParts| class.examples().first().map(|e| e.clip.kind);
    kind(from) == Some(ClipKind::Cycle) && kind(to).is_some()
}

impl SearchParts {
    /// A search for each of `edges` that has one: (from, to, search).
    pub(super) fn make(
        &self,
        classes: &[ClassParts],
        edges: &[(usize, usize)],
        space: &Arc<dyn PoseSpace>,
    ) -> Result<Vec<(usize, usize, EdgeSearch)>, String> {
        let mut made: Vec<Option<(ClipBlend, Arc<SearchClass>)>> = Vec::new();
        let wanted = |from: usize, to: usize| {
            (self.edges.as_ref()).is_none_or(|list| list.contains(&(from, to)))
                && can_search(&classes[from], &classes[to])
        };
        for (node, class) in classes.iter().enumerate() {
            let used = edges
                .iter()
                .any(|(a, b)| (*a == node || *b == node) && wanted(*a, *b));
            // A class in which nothing moves, or a pose map, has nothing to search.
            let blend = used
                .then(|| ClipBlend::new(&class.name, class.examples(), space).ok())
                .flatten();
            made.push(match blend {
                Some(blend) => {
                    let search = blend.search_class(FRAMES, blend.steps());
                    Some((blend, Arc::new(search.map_err(|e| e.to_string())?)))
                }
                None => None,
            });
        }
        let mut searches = Vec::new();
        for (from, to) in edges.iter().copied() {
            let (Some(source), Some(target)) = (&made[from], &made[to]) else {
                continue;
            };
            if !wanted(from, to) {
                continue;
            }
            let tables = DistanceTables::new(&source.1, &target.1).map_err(|e| e.to_string())?;
            let (a, b) = (Arc::clone(&source.1), Arc::clone(&target.1));
            let mut search =
                Search::new(a, b, Arc::new(tables), self.options).map_err(|e| e.to_string())?;
            if self.calibrated {
                let requests = random_requests(&search, REQUESTS.0, REQUESTS.1);
                calibrate(&mut search, &requests).map_err(|e| e.to_string())?;
            }
            let whole = classes[to].options.play != Play::Once
                && classes[to]
                    .examples()
                    .iter()
                    .all(|e| e.clip.kind == ClipKind::Cycle);
            let entry = if whole { [0.0, 1.0] } else { [0.0, PATH_ENTRY] };
            searches.push((
                from,
                to,
                EdgeSearch::new(search, source.0.clone(), target.0.clone(), entry),
            ));
        }
        Ok(searches)
    }
}
