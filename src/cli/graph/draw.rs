//! A motion graph as an SVG picture: boxes on a ring, arrows between them.

use std::f64::consts::{PI, TAU};
use std::fmt::Write;

/// A node.
pub(super) struct Box {
    pub(super) title: String,
    pub(super) lines: Vec<String>,
    /// Played while nothing is performed.
    pub(super) start: bool,
}

/// An edge.
pub(super) struct Arrow {
    pub(super) from: usize,
    pub(super) to: usize,
    pub(super) label: String,
}

/// Width of a character of the text in a box, px.
const CHARACTER: f64 = 7.2;
const LINE: f64 = 19.0;
const MARGIN: f64 = 24.0;
const HEAD: f64 = 46.0;

/// Replaces what has a meaning in SVG.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// The picture.
pub(super) fn graph_svg(title: &str, boxes: &[Box], arrows: &[Arrow]) -> String {
    let size = |b: &Box| {
        let widest = b.lines.iter().map(|l| l.chars().count()).max().unwrap_or(0);
        let widest = widest.max(b.title.chars().count() + 10) as f64;
        (
            CHARACTER * widest + 24.0,
            LINE * (b.lines.len() as f64 + 1.0) + 20.0,
        )
    };
    let sizes: Vec<(f64, f64)> = boxes.iter().map(size).collect();
    let (wide, high) = sizes
        .iter()
        .fold((0.0_f64, 0.0_f64), |(w, h), s| (w.max(s.0), h.max(s.1)));
    // On a ring wide enough that neighbours and their arrows have room; two boxes lie side by side.
    let n = boxes.len().max(1) as f64;
    let chord = 2.0 * (PI / n).sin();
    let (rx, ry) = match boxes.len() {
        0 | 1 => (0.0, 0.0),
        2 => (0.5 * (wide + 150.0), 0.0),
        _ => (
            (wide + 150.0) / chord.max(0.5),
            (high + 90.0) / chord.max(0.5),
        ),
    };
    let (width, height) = (
        (2.0 * (rx + MARGIN) + wide).max(480.0),
        2.0 * (ry + MARGIN) + high + HEAD + if boxes.len() == 2 { 60.0 } else { 0.0 },
    );
    let middle = (0.5 * width, HEAD + 0.5 * (height - HEAD));
    let places: Vec<(f64, f64)> = (0..boxes.len())
        .map(|k| {
            let angle = PI + TAU * k as f64 / n;
            (middle.0 + rx * angle.cos(), middle.1 + ry * angle.sin())
        })
        .collect();
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\">\n\
         <defs><marker id=\"tip\" viewBox=\"0 0 10 10\" refX=\"9\" refY=\"5\" markerWidth=\"9\" markerHeight=\"9\" orient=\"auto\"><path d=\"M0 0L10 5L0 10z\" fill=\"#555\"/></marker></defs>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"{MARGIN}\" y=\"28\" font-size=\"18\" font-weight=\"bold\">{}</text>\n",
        escaped(title)
    );
    for arrow in arrows {
        draw_arrow(&mut svg, arrow, &places, &sizes);
    }
    for ((node, place), size) in boxes.iter().zip(&places).zip(&sizes) {
        draw_box(&mut svg, node, *place, *size);
    }
    svg.push_str("</svg>\n");
    svg
}

fn draw_box(svg: &mut String, node: &Box, (x, y): (f64, f64), (w, h): (f64, f64)) {
    let (left, top) = (x - 0.5 * w, y - 0.5 * h);
    let (ink, stroke, fill) = if node.start {
        ("#0072b2", 3.5, "#eaf4fb")
    } else {
        ("#555", 1.5, "#f7f7f7")
    };
    let mark = if node.start { "  (start)" } else { "" };
    // Writing into a string does not fail.
    let _ = writeln!(
        svg,
        "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{w:.1}\" height=\"{h:.1}\" rx=\"10\" fill=\"{fill}\" stroke=\"{ink}\" stroke-width=\"{stroke}\"/>\n\
         <text x=\"{:.1}\" y=\"{:.1}\" font-size=\"16\" font-weight=\"bold\">{}{mark}</text>",
        left + 12.0,
        top + 24.0,
        escaped(&node.title)
    );
    for (k, line) in node.lines.iter().enumerate() {
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" font-size=\"13\" fill=\"#333\">{}</text>",
            left + 12.0,
            top + 24.0 + LINE * (k + 1) as f64,
            escaped(line)
        );
    }
}

fn draw_arrow(svg: &mut String, arrow: &Arrow, places: &[(f64, f64)], sizes: &[(f64, f64)]) {
    let (Some(a), Some(b)) = (places.get(arrow.from), places.get(arrow.to)) else {
        return;
    };
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let length = dx.hypot(dy);
    if length < 1.0 {
        return;
    }
    // Bent to the left of its way, so that there and back are two arrows.
    let side = (dy / length, -dx / length);
    let bend = 0.5 * (70.0 + 0.12 * length);
    let control = (
        0.5 * (a.0 + b.0) + 2.0 * bend * side.0,
        0.5 * (a.1 + b.1) + 2.0 * bend * side.1,
    );
    let from = border(*a, sizes[arrow.from], control);
    let to = border(*b, sizes[arrow.to], control);
    // A third of the way along, for in the middle of the ring many arrows cross.
    let [p, q, r] = [0.49, 0.42, 0.09];
    let top = (
        p * from.0 + q * control.0 + r * to.0 + 4.0 * side.0,
        p * from.1 + q * control.1 + r * to.1 + 4.0 * side.1,
    );
    let _ = writeln!(
        svg,
        "<path d=\"M{:.1} {:.1}Q{:.1} {:.1} {:.1} {:.1}\" fill=\"none\" stroke=\"#555\" stroke-width=\"1.8\" marker-end=\"url(#tip)\"/>\n\
         <text x=\"{:.1}\" y=\"{:.1}\" font-size=\"12\" fill=\"#555\" text-anchor=\"middle\" dominant-baseline=\"middle\" stroke=\"white\" stroke-width=\"5\" paint-order=\"stroke\">{}</text>",
        from.0,
        from.1,
        control.0,
        control.1,
        to.0,
        to.1,
        top.0,
        top.1,
        escaped(&arrow.label)
    );
}

/// Where the line from the middle of a box towards a point leaves it, a little outside.
fn border(middle: (f64, f64), size: (f64, f64), towards: (f64, f64)) -> (f64, f64) {
    let (dx, dy) = (towards.0 - middle.0, towards.1 - middle.1);
    let half = (0.5 * size.0 + 4.0, 0.5 * size.1 + 4.0);
    let scale = (dx.abs() / half.0).max(dy.abs() / half.1).max(1e-9);
    (middle.0 + dx / scale, middle.1 + dy / scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_node_and_arrow_is_drawn_and_names_are_escaped() {
        for count in [1, 2, 3, 7] {
            let boxes: Vec<Box> = (0..count)
                .map(|k| Box {
                    title: format!("class <{k}>"),
                    lines: vec!["gesture a & b".into()],
                    start: k == 0,
                })
                .collect();
            let arrows: Vec<Arrow> = (1..count)
                .map(|to| Arrow {
                    from: 0,
                    to,
                    label: "s 0.9".into(),
                })
                .collect();
            let svg = graph_svg("x", &boxes, &arrows);
            assert_eq!(svg.matches("rx=\"10\"").count(), count);
            assert_eq!(svg.matches("marker-end").count(), count - 1);
            assert!(
                svg.contains("class &lt;0&gt;") && !svg.contains("NaN"),
                "{svg}"
            );
        }
    }
}
