//! `handwave graph show`: the motion graph as text or as pictures.

use super::classes::{Edge, classes, edges};
use super::draw::{Arrow, Box as NodeBox, graph_svg};
use super::matrix::matrix_svg;
use super::{load, make_folder};
use crate::cli::disk::write;
use crate::cli::{ExitStatus, Failure, say};
use crate::config::Character;
use crate::motion::class::Play;
use crate::motion::clip::ClipKind;
use std::path::Path;

/// Frames per clip of a matrix: enough to see where it is bright.
const MATRIX_FRAMES: usize = 20;

pub(super) fn show(config: Option<&Path>, out: Option<&Path>) -> Result<ExitStatus, Failure> {
    let character = load(config)?;
    let classes = classes(&character, MATRIX_FRAMES)?;
    let edges = edges(&character, &classes)?;
    let Some(out) = out else {
        say_text(&character, &edges);
        return Ok(ExitStatus::Done);
    };
    if out.extension().is_none_or(|e| e != "svg") {
        return Err(Failure::input(format!(
            "--out {}: the picture is SVG; give it a name that ends in .svg",
            out.display()
        )));
    }
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    let folder = out.with_file_name(format!("{stem}_edges"));
    write(
        out,
        graph_svg(
            &character.name,
            &boxes(&character),
            &arrows(&character, &edges),
        ),
    )?;
    say(format_args!("{}", out.display()));
    if edges.is_empty() {
        return Ok(ExitStatus::Done);
    }
    make_folder(&folder)?;
    for edge in &edges {
        let (Some(source), Some(target)) = (&classes[edge.from], &classes[edge.to]) else {
            continue;
        };
        let path = folder.join(format!(
            "{}_to_{}.svg",
            file_name(&source.name),
            file_name(&target.name)
        ));
        write(&path, matrix_svg(source, target, &edge.tables, &edge.best))?;
        say(format_args!("{}", path.display()));
    }
    Ok(ExitStatus::Done)
}

/// A class name as part of a file's.
fn file_name(class: &str) -> String {
    let plain = |c: char| {
        if c.is_alphanumeric() || c == '-' {
            c
        } else {
            '_'
        }
    };
    class.chars().map(plain).collect()
}

/// What a node plays, line by line.
fn lines(character: &Character, node: usize) -> Vec<String> {
    let class = &character.classes[node];
    let mut lines = Vec::new();
    lines.push(class.driven_by(&character.gestures));
    if class.map.is_some() {
        lines.push("pose map: the pose itself drives it".into());
    }
    for example in class.examples() {
        let (amplitude, frequency_hz) = (example.parameters[0], example.parameters[1]);
        let name = &example.clip.name;
        let further: String = (class
            .options
            .extra
            .iter()
            .zip(example.parameters.as_slice().iter().skip(2)))
        .filter(|(_, v)| **v != 0.0)
        .map(|(name, v)| format!(", {name} {v}"))
        .collect();
        lines.push(match example.clip.kind {
            ClipKind::Path if class.options.play == Play::Once => {
                format!("{name}: a path, once, by the clock{further}")
            }
            ClipKind::Path => format!("{name}: a path, progression 0 to 1{further}"),
            ClipKind::Cycle if amplitude == 0.0 => format!("{name}: at rest{further}"),
            ClipKind::Cycle => {
                format!("{name}: amplitude {amplitude}, {frequency_hz} Hz{further}")
            }
        });
    }
    lines
}

fn boxes(character: &Character) -> Vec<NodeBox> {
    let (start, _) = character.graph();
    (0..character.classes.len())
        .map(|node| NodeBox {
            title: character.classes[node].name.clone(),
            lines: lines(character, node),
            start: node == start,
        })
        .collect()
}

fn arrows(character: &Character, edges: &[Edge]) -> Vec<Arrow> {
    character
        .graph()
        .1
        .iter()
        .map(|(from, to)| {
            let measured = edges.iter().find(|e| (e.from, e.to) == (*from, *to));
            Arrow {
                from: *from,
                to: *to,
                // Only what is not as good as equal is worth a word.
                label: measured
                    .filter(|e| e.best.similarity < 0.995)
                    .map_or(String::new(), |e| format!("s {:.2}", e.best.similarity)),
            }
        })
        .collect()
}

fn say_text(character: &Character, edges: &[Edge]) {
    let (start, all) = character.graph();
    say(format_args!("{}", character.name));
    for node in 0..character.classes.len() {
        say(format_args!(
            "\n{}{}",
            character.classes[node].name,
            if node == start { "  (start)" } else { "" }
        ));
        for line in lines(character, node) {
            say(format_args!("    {line}"));
        }
        for (_, to) in all.iter().filter(|(from, _)| *from == node) {
            let name = &character.classes[*to].name;
            let measured = edges.iter().find(|e| (e.from, e.to) == (node, *to));
            match measured.map(|e| &e.best) {
                Some(best) => say(format_args!(
                    "  -> {name}: best similarity {:.3}, from {} at {:.2} to {} at {:.2}, {:.1} mm apart",
                    best.similarity,
                    best.exit.0,
                    best.exit.1,
                    best.entry.0,
                    best.entry.1,
                    best.distance_mm
                )),
                None => say(format_args!("  -> {name}")),
            }
        }
    }
}
