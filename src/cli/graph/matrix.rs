//! The similarity matrix of an edge as an SVG heat map.

use super::classes::BestPair;
use super::draw::escaped;
use crate::motion::search::{DistanceTables, SearchClass};
use std::fmt::Write;

/// The longer side of the matrix, px.
const LONGER: f64 = 640.0;
/// A cell is not larger than this, px, and the matrix has at least this side.
const CELL: f64 = 12.0;
const LEAST: f64 = 150.0;
/// Colours of the scale; neighbours of equal colour are drawn as one.
const SHADES: usize = 48;

/// Anchors of a scale that grows evenly brighter, from 0 to 1 (those of viridis).
const SCALE: [[f64; 3]; 9] = [
    [68.0, 1.0, 84.0],
    [71.0, 45.0, 123.0],
    [59.0, 82.0, 139.0],
    [44.0, 114.0, 142.0],
    [33.0, 145.0, 140.0],
    [40.0, 174.0, 128.0],
    [94.0, 201.0, 98.0],
    [173.0, 220.0, 48.0],
    [253.0, 231.0, 37.0],
];

fn color(shade: usize) -> String {
    let at = shade as f64 / (SHADES - 1) as f64 * (SCALE.len() - 1) as f64;
    let k = (at.floor() as usize).min(SCALE.len() - 2);
    let part = at - k as f64;
    let mixed = [0, 1, 2].map(|c| (1.0 - part) * SCALE[k][c] + part * SCALE[k + 1][c]);
    let [r, g, b] = mixed.map(|v| v.round() as u8);
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Rows: poses of `source`, clip by clip; columns: poses of `target`.
pub(super) fn matrix_svg(
    source: &SearchClass,
    target: &SearchClass,
    tables: &DistanceTables,
    best: &BestPair,
) -> String {
    let (rows, columns) = (
        source.references() * source.frames(),
        target.references() * target.frames(),
    );
    // Each axis has its own scale: a class of one clip beside one of nine is still to be read.
    let side = |count: usize| (CELL * count as f64).min(LONGER).max(LEAST);
    let (high, wide) = (side(rows), side(columns));
    let (cell_h, cell_w) = (high / rows as f64, wide / columns as f64);
    let longest = |class: &SearchClass| {
        let chars = class.clips.iter().map(|c| c.chars().count()).max();
        7.0 * chars.unwrap_or(0) as f64
    };
    let (left, top) = (longest(source) + 74.0, 92.0);
    let below = longest(target).max(60.0) + 60.0;
    let width = (left + wide + 130.0).max(560.0);
    let height = top + high + below;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"16\" y=\"28\" font-size=\"18\" font-weight=\"bold\">Similarity: {} to {}</text>\n\
         <text x=\"16\" y=\"50\">best {:.3} ({:.1} mm): {} at {:.2} to {} at {:.2}; similarity 0 is {:.1} mm</text>\n",
        escaped(&source.name),
        escaped(&target.name),
        best.similarity,
        best.distance_mm,
        escaped(&best.exit.0),
        best.exit.1,
        escaped(&best.entry.0),
        best.entry.1,
        best.largest_mm,
    );
    let shade = |row: usize, column: usize| {
        let (i, ks) = (row / source.frames(), row % source.frames());
        let (j, kd) = (column / target.frames(), column % target.frames());
        let d = tables.block(ks, kd)[i * target.references() + j];
        let s = tables.similarity_of(d).clamp(0.0, 1.0);
        (s * (SHADES - 1) as f64).round() as usize
    };
    // Writing into a string does not fail.
    for row in 0..rows {
        let y = top + cell_h * row as f64;
        let mut from = 0;
        for column in 1..=columns {
            if column == columns || shade(row, column) != shade(row, from) {
                let _ = writeln!(
                    svg,
                    "<rect x=\"{:.2}\" y=\"{y:.2}\" width=\"{:.2}\" height=\"{:.2}\" fill=\"{}\"/>",
                    left + cell_w * from as f64,
                    // A hair wider, so that no line shows between cells.
                    cell_w * (column - from) as f64 + 0.3,
                    cell_h + 0.3,
                    color(shade(row, from))
                );
                from = column;
            }
        }
    }
    axes(&mut svg, source, target, [left, top, wide, high]);
    mark_best(&mut svg, source, target, best, [left, top, cell_w, cell_h]);
    scale(&mut svg, left + wide + 34.0, top);
    svg.push_str("</svg>\n");
    svg
}

fn axes(svg: &mut String, source: &SearchClass, target: &SearchClass, at: [f64; 4]) {
    let [left, top, wide, high] = at;
    let step = high / source.references() as f64;
    for (i, clip) in source.clips.iter().enumerate() {
        let y = top + step * i as f64;
        let _ = writeln!(
            svg,
            "<line x1=\"{left:.1}\" y1=\"{y:.1}\" x2=\"{:.1}\" y2=\"{y:.1}\" stroke=\"white\" stroke-width=\"1.5\"/>\n\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            left + wide,
            left - 8.0,
            y + 0.5 * step + 4.0,
            escaped(clip)
        );
    }
    let step = wide / target.references() as f64;
    for (j, clip) in target.clips.iter().enumerate() {
        let x = left + step * j as f64;
        let (tx, ty) = (x + 0.5 * step, top + high + 14.0);
        let _ = writeln!(
            svg,
            "<line x1=\"{x:.1}\" y1=\"{top:.1}\" x2=\"{x:.1}\" y2=\"{:.1}\" stroke=\"white\" stroke-width=\"1.5\"/>\n\
             <text x=\"{tx:.1}\" y=\"{ty:.1}\" text-anchor=\"end\" transform=\"rotate(-55 {tx:.1} {ty:.1})\">{}</text>",
            top + high,
            escaped(clip)
        );
    }
    let time = |cyclic: bool| {
        if cyclic {
            "phase 0 to 1"
        } else {
            "progression 0 to 1"
        }
    };
    let (x, y) = (18.0, top + 0.5 * high);
    let _ = writeln!(
        svg,
        "<text x=\"{x}\" y=\"{y:.1}\" text-anchor=\"middle\" transform=\"rotate(-90 {x} {y:.1})\">{}: per clip {}, downwards</text>\n\
         <text x=\"{left:.1}\" y=\"{:.1}\">{}: per clip {}, to the right</text>",
        escaped(&source.name),
        time(source.cyclic),
        top - 12.0,
        escaped(&target.name),
        time(target.cyclic)
    );
}

/// A ring around the most similar pair.
fn mark_best(
    svg: &mut String,
    source: &SearchClass,
    target: &SearchClass,
    best: &BestPair,
    at: [f64; 4],
) {
    let [left, top, cell_w, cell_h] = at;
    let index = |class: &SearchClass, (clip, t): &(String, f64)| {
        let reference = class.clips.iter().position(|c| c == clip)?;
        let frame = (0..class.frames()).find(|k| class.time_of(*k) == *t)?;
        Some((reference * class.frames() + frame) as f64 + 0.5)
    };
    if let (Some(row), Some(column)) = (index(source, &best.exit), index(target, &best.entry)) {
        let _ = writeln!(
            svg,
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"7\" fill=\"none\" stroke=\"#d55e00\" stroke-width=\"2.5\"/>",
            left + cell_w * column,
            top + cell_h * row
        );
    }
}

/// The colour scale with its numbers.
fn scale(svg: &mut String, x: f64, top: f64) {
    let height = 150.0;
    let step = height / SHADES as f64;
    for shade in 0..SHADES {
        let _ = writeln!(
            svg,
            "<rect x=\"{x:.1}\" y=\"{:.2}\" width=\"16\" height=\"{:.2}\" fill=\"{}\"/>",
            top + height - step * (shade + 1) as f64,
            step + 0.3,
            color(shade)
        );
    }
    for tick in 0..=4 {
        let s = 0.25 * f64::from(tick);
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\">{s:.2}</text>",
            x + 22.0,
            top + height * (1.0 - s) + 4.0
        );
    }
}
