//! `handwave graph check`: what is broken in a motion graph, and what will not look good.

use super::classes::{Edge, FRAMES, classes, edges};
use super::load;
use crate::cli::{ExitStatus, Failure, say, warn};
use crate::config::Character;
use crate::gesture::GestureKind;
use crate::motion::search::reach::reach;
use serde_json::json;
use std::path::Path;

/// A gesture performed this much quicker or slower than it was shown is still a stretch.
const TEMPO_RANGE: f64 = 3.0;

/// One finding.
struct Finding {
    broken: bool,
    /// `unreachable`, `dead_end`, `dissimilar`, `far_apart`, `out_of_reach`.
    kind: &'static str,
    text: String,
}

pub(super) fn check(
    config: Option<&Path>,
    s_min: f64,
    far_mm: f64,
    json: bool,
) -> Result<ExitStatus, Failure> {
    if !(0.0..=1.0).contains(&s_min) {
        return Err(Failure::input(format!("--s-min {s_min} must lie in 0..1")));
    }
    if !(far_mm > 0.0) {
        return Err(Failure::input(format!("--far-mm {far_mm} must be above 0")));
    }
    let character = load(config)?;
    let classes = classes(&character, FRAMES)?;
    let edges = edges(&character, &classes)?;
    let mut findings = shape(&character);
    findings.extend(overlap(&character, &edges, s_min, far_mm));
    findings.extend(parameters(&character));
    let broken = findings.iter().any(|f| f.broken);
    if json {
        say_json(&character, &edges, &findings, broken);
    } else {
        say_text(&character, &edges, &findings);
    }
    if broken {
        let list: Vec<&str> = findings
            .iter()
            .filter(|f| f.broken)
            .map(|f| f.text.as_str())
            .collect();
        return Err(Failure::input(format!(
            "{}: graph.edges: {}",
            character.config_name,
            list.join("; ")
        )));
    }
    Ok(ExitStatus::Done)
}

fn shape(character: &Character) -> Vec<Finding> {
    let (start, edges) = character.graph();
    let reach = reach(character.classes.len(), start, edges);
    let name = |node: &usize| character.classes[*node].name.as_str();
    let start = name(&start);
    let unreachable = reach.unreachable.iter().map(|node| Finding {
        broken: true,
        kind: "unreachable",
        text: format!(
            "class {:?} is never played: no way leads to it from the start, {start:?}; add an edge to it",
            name(node)
        ),
    });
    let dead_ends = reach.dead_ends.iter().map(|node| Finding {
        broken: true,
        kind: "dead_end",
        text: format!(
            "class {:?} is a dead end: no way leads from it back to the start, {start:?}, other than doing nothing; add an edge from it",
            name(node)
        ),
    });
    unreachable.chain(dead_ends).collect()
}

fn overlap(character: &Character, edges: &[Edge], s_min: f64, far_mm: f64) -> Vec<Finding> {
    let mut findings = Vec::new();
    for edge in edges {
        let best = &edge.best;
        let (from, to) = (
            &character.classes[edge.from].name,
            &character.classes[edge.to].name,
        );
        let where_ = format!(
            "best from {} at {:.2} to {} at {:.2}",
            best.exit.0, best.exit.1, best.entry.0, best.entry.1
        );
        if best.similarity < s_min {
            findings.push(Finding {
                broken: false,
                kind: "dissimilar",
                text: format!(
                    "{from} -> {to}: no pose of one is like a pose of the other: similarity {:.3}, below {s_min} ({where_}); the transition will be seen",
                    best.similarity
                ),
            });
        }
        if best.distance_mm > far_mm {
            findings.push(Finding {
                broken: false,
                kind: "far_apart",
                text: format!(
                    "{from} -> {to}: the nearest poses are {:.1} mm apart, more than {far_mm} mm ({where_}); add a clip between them",
                    best.distance_mm
                ),
            });
        }
    }
    findings
}

/// Clips that the gesture cannot bring out.
fn parameters(character: &Character) -> Vec<Finding> {
    let mut findings = Vec::new();
    for class in character.classes.iter().filter(|c| c.map.is_none()) {
        let Some(gesture) = class
            .gesture
            .and_then(|g| character.gestures.gestures.get(g))
        else {
            continue;
        };
        let shown_hz = 1.0 / gesture.duration_s.max(1e-3);
        for example in class.examples() {
            let (amplitude, frequency_hz) = (example.parameters[0], example.parameters[1]);
            let clip = &example.clip.name;
            if amplitude > 1.0 {
                findings.push(Finding {
                    broken: false,
                    kind: "out_of_reach",
                    text: format!(
                        "class {}: clip {clip} has amplitude {amplitude}; a gesture counts up to 1, so it is never played pure",
                        class.name
                    ),
                });
            }
            let tempo = frequency_hz / shown_hz;
            let cyclic = gesture.kind == GestureKind::Cyclic && amplitude > 0.0;
            if cyclic && !(1.0 / TEMPO_RANGE..=TEMPO_RANGE).contains(&tempo) {
                findings.push(Finding {
                    broken: false,
                    kind: "out_of_reach",
                    text: format!(
                        "class {}: clip {clip} is for {frequency_hz} Hz, gesture {} was shown at {shown_hz:.2} Hz; nobody performs it {TEMPO_RANGE} times quicker or slower",
                        class.name, gesture.name
                    ),
                });
            }
        }
    }
    findings
}

fn say_text(character: &Character, edges: &[Edge], findings: &[Finding]) {
    let (start, all) = character.graph();
    say(format_args!(
        "{}: {} class(es), {} edge(s), start {}",
        character.config_name,
        character.classes.len(),
        all.len(),
        character.classes[start].name
    ));
    for edge in edges {
        let best = &edge.best;
        say(format_args!(
            "  {} -> {}: best similarity {:.3}, {:.1} mm (of {:.1} mm at most): {} at {:.2} to {} at {:.2}",
            character.classes[edge.from].name,
            character.classes[edge.to].name,
            best.similarity,
            best.distance_mm,
            best.largest_mm,
            best.exit.0,
            best.exit.1,
            best.entry.0,
            best.entry.1
        ));
    }
    for finding in findings.iter().filter(|f| !f.broken) {
        warn(format_args!("warning: {}", finding.text));
    }
    if findings.is_empty() {
        say(format_args!("nothing to complain about"));
    }
}

fn say_json(character: &Character, edges: &[Edge], findings: &[Finding], broken: bool) {
    let (start, all) = character.graph();
    let name = |node: usize| character.classes[node].name.as_str();
    let edges: Vec<_> = edges
        .iter()
        .map(|edge| {
            let best = &edge.best;
            json!({
                "from": name(edge.from), "to": name(edge.to),
                "best_similarity": best.similarity,
                "distance_mm": best.distance_mm, "largest_mm": best.largest_mm,
                "exit_clip": best.exit.0, "exit_t": best.exit.1,
                "entry_clip": best.entry.0, "entry_t": best.entry.1,
            })
        })
        .collect();
    let list = |wanted: bool| -> Vec<_> {
        findings
            .iter()
            .filter(|f| f.broken == wanted)
            .map(|f| json!({"kind": f.kind, "text": f.text}))
            .collect()
    };
    let summary = json!({
        "config": character.config_name,
        "ok": !broken,
        "classes": character.classes.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(),
        "start": name(start),
        "edge_count": all.len(),
        "edges": edges,
        "broken": list(true),
        "warnings": list(false),
    });
    say(format_args!("{summary}"));
}
