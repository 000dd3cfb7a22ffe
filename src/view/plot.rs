//! Plots as SVG text: panels with axes, lines, points, bars and shaded spans, one shared legend.
//!
//! Colours are those of Okabe and Ito, which colour-blind readers can tell apart; sizes are made for
//! a README's width. Numbers in, text out: nothing here reads or writes a file.

use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Colours of series, in order: black (for truth), blue, vermilion, green, purple, sky, orange, grey.
const PALETTE: [RGBColor; 8] = [
    RGBColor(0, 0, 0),
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(120, 120, 120),
];

/// Font size of labels, of titles; plotters divides by 1.24 on the way to SVG.
const LABEL: u32 = 16;
const TITLE: u32 = 19;
/// Width of a character as a share of the font size, generous.
const CHARACTER: f64 = 0.47;
/// Height of a row of the legend, and of a figure's title, in pixels.
const LEGEND_ROW: u32 = 24;
const TITLE_ROW: u32 = 34;
/// Height of a panel's title, and width of the numbers and the label on its left, in pixels.
const CAPTION: u32 = 30;
const LEFT: u32 = 66;

/// How a series is drawn.
#[derive(Copy, Clone, Debug, PartialEq)]
pub enum Style {
    /// A line through all points.
    Line,
    /// A wider, lighter line, for what others are compared with.
    Wide,
    /// A line with a dot on every point.
    Dotted,
    /// A large ring on every point, no line.
    Ring,
    /// A bar from zero to every point, this wide, this far right of its place.
    Bars {
        /// Width in units of x.
        width: f64,
        /// Distance of the bar's middle from the point's x.
        shift: f64,
    },
}

/// One series of a panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend; the same name in several panels appears once. Empty: not in the legend.
    pub name: String,
    /// Index of the colour, see the module's text.
    pub color: usize,
    /// How it is drawn.
    pub style: Style,
    /// The points. A point that is not finite interrupts a line.
    pub points: Vec<(f64, f64)>,
}

/// One axis of a panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// What is along it, with the unit.
    pub label: String,
    /// From where to where.
    pub range: (f64, f64),
    /// Logarithmic.
    pub log: bool,
    /// Names at 0, 1, 2 ... instead of numbers.
    pub names: Vec<String>,
}

impl Axis {
    /// A linear axis.
    pub fn linear(label: &str, from: f64, to: f64) -> Self {
        Self {
            label: label.into(),
            range: (from, to),
            log: false,
            names: Vec::new(),
        }
    }

    /// A logarithmic axis; both ends above zero.
    pub fn log(label: &str, from: f64, to: f64) -> Self {
        Self {
            log: true,
            ..Self::linear(label, from, to)
        }
    }

    /// Where a logarithmic axis has lines: at 1, 2 and 5 of every decade, only at 1 over more than
    /// two decades.
    fn log_ticks(&self) -> Vec<f64> {
        if !self.log {
            return Vec::new();
        }
        let (from, to) = self.range;
        let (first, last) = (from.log10().floor() as i32, to.log10().ceil() as i32);
        let shares: &[u32] = if to > 100.0 * from { &[1] } else { &[1, 2, 5] };
        (first..=last)
            .flat_map(|decade| shares.iter().map(move |share| (decade, share)))
            // Read from text, so that it prints as written.
            .filter_map(|(decade, share)| format!("{share}e{decade}").parse().ok())
            .filter(|value| (from..=to).contains(value))
            .collect()
    }

    /// An axis with names in place of numbers.
    pub fn names(label: &str, names: Vec<String>) -> Self {
        Self {
            range: (-0.5, names.len() as f64 - 0.5),
            names,
            ..Self::linear(label, 0.0, 1.0)
        }
    }
}

/// A span of x that is shaded, over a share of the panel's height.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Span {
    /// From where to where on x.
    pub x: (f64, f64),
    /// Index of the colour.
    pub color: usize,
}

/// One panel of a figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Title above it.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Shaded spans, behind everything.
    pub spans: Vec<Span>,
    /// What is drawn, in order.
    pub series: Vec<Series>,
}

/// A figure: panels in rows of `columns`, with a title and one legend for all.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Title on top.
    pub title: String,
    /// Width of the whole figure and height of one panel, in pixels.
    pub size: (u32, u32),
    /// Panels in a row.
    pub columns: usize,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
}

/// A figure that could not be drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("plot {title:?} cannot be drawn: {problem}")]
pub struct PlotError {
    /// The figure's title.
    pub title: String,
    /// What the drawing library says.
    pub problem: String,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Drawn = Result<(), Box<dyn std::error::Error>>;

impl Figure {
    /// The figure as SVG text.
    ///
    /// # Errors
    /// An axis without extent, or a logarithmic one that reaches zero.
    pub fn svg(&self) -> Result<String, PlotError> {
        let failed = |problem: String| PlotError {
            title: self.title.clone(),
            problem,
        };
        for axis in self.panels.iter().flat_map(|panel| [&panel.x, &panel.y]) {
            let (from, to) = axis.range;
            let lowest = if axis.log { 0.0 } else { f64::NEG_INFINITY };
            if !(from > lowest && to > from && to.is_finite()) {
                let what = format!("axis {:?} runs from {from} to {to}", axis.label);
                return Err(failed(what));
            }
        }
        let legend = self.legend_rows();
        let rows = self.panels.len().div_ceil(self.columns.max(1)).max(1);
        let head = TITLE_ROW + LEGEND_ROW * legend.len() as u32;
        let (width, height) = (self.size.0, head + self.size.1 * rows as u32);
        let mut text = String::new();
        {
            let root = SVGBackend::with_string(&mut text, (width, height)).into_drawing_area();
            self.draw(&root, &legend, head, rows)
                .map_err(|error| failed(error.to_string()))?;
        }
        Ok(text)
    }

    fn draw(&self, root: &Area, legend: &[Vec<&Series>], head: u32, rows: usize) -> Drawn {
        root.fill(&WHITE)?;
        let title = ("sans-serif", TITLE).into_font().style(FontStyle::Bold);
        root.draw(&Text::new(self.title.clone(), (12, 10), title))?;
        for (row, entries) in legend.iter().enumerate() {
            let y = (TITLE_ROW + LEGEND_ROW * row as u32) as i32;
            let mut x = 14;
            for series in entries {
                draw_key(root, (x, y + 9), series)?;
                let font = ("sans-serif", LABEL).into_font();
                root.draw(&Text::new(series.name.clone(), (x + 30, y + 2), font))?;
                x += entry_width(&series.name);
            }
        }
        let (_, below) = root.split_vertically(head);
        let areas = below.split_evenly((rows, self.columns.max(1)));
        for (area, panel) in areas.iter().zip(&self.panels) {
            let (x, y) = (&panel.x.range, &panel.y.range);
            let (lx, ly) = (
                RangedCoordf64::from(x.0..x.1),
                RangedCoordf64::from(y.0..y.1),
            );
            match (panel.x.log, panel.y.log) {
                (false, false) => draw_panel(area, panel, lx, ly)?,
                (true, false) => draw_panel(area, panel, (x.0..x.1).log_scale(), ly)?,
                (false, true) => draw_panel(area, panel, lx, (y.0..y.1).log_scale())?,
                (true, true) => {
                    draw_panel(area, panel, (x.0..x.1).log_scale(), (y.0..y.1).log_scale())?;
                }
            }
        }
        root.present()?;
        Ok(())
    }

    /// Every named series once, in the order of colours, in rows that fit the width.
    fn legend_rows(&self) -> Vec<Vec<&Series>> {
        let mut named: Vec<&Series> = Vec::new();
        for series in self.panels.iter().flat_map(|panel| &panel.series) {
            if !series.name.is_empty() && !named.iter().any(|known| known.name == series.name) {
                named.push(series);
            }
        }
        named.sort_by_key(|series| series.color);
        let mut rows: Vec<Vec<&Series>> = Vec::new();
        let mut x = u32::MAX;
        for series in named {
            let width = entry_width(&series.name) as u32;
            if x.saturating_add(width) > self.size.0 {
                rows.push(Vec::new());
                x = 14;
            }
            x += width;
            if let Some(row) = rows.last_mut() {
                row.push(series);
            }
        }
        rows
    }
}

fn color(index: usize) -> RGBColor {
    PALETTE[index % PALETTE.len()]
}

fn entry_width(name: &str) -> i32 {
    48 + (name.chars().count() as f64 * f64::from(LABEL) * CHARACTER) as i32
}

/// The sample of a series in the legend.
fn draw_key(root: &Area, (x, y): (i32, i32), series: &Series) -> Drawn {
    let ink = color(series.color);
    match series.style {
        Style::Bars { .. } => {
            root.draw(&Rectangle::new(
                [(x + 4, y - 6), (x + 22, y + 6)],
                ink.filled(),
            ))?;
        }
        Style::Ring => root.draw(&Circle::new((x + 12, y), 7, ink.stroke_width(2)))?,
        _ => {
            let stroke = stroke(series);
            root.draw(&PathElement::new(vec![(x, y), (x + 24, y)], stroke))?;
            if series.style == Style::Dotted {
                root.draw(&Circle::new((x + 12, y), 4, ink.filled()))?;
            }
        }
    }
    Ok(())
}

fn stroke(series: &Series) -> ShapeStyle {
    let ink = color(series.color);
    match series.style {
        Style::Wide => ink.mix(0.35).stroke_width(5),
        _ => ink.stroke_width(2),
    }
}

fn draw_panel<X, Y>(area: &Area, panel: &Panel, x: X, y: Y) -> Drawn
where
    X: AsRangedCoord<Value = f64>,
    Y: AsRangedCoord<Value = f64>,
    X::CoordDescType: ValueFormatter<f64>,
    Y::CoordDescType: ValueFormatter<f64>,
{
    let font = || ("sans-serif", LABEL).into_font();
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .margin_right(18)
        .margin_top(CAPTION)
        .x_label_area_size(44)
        .y_label_area_size(LEFT)
        .build_cartesian_2d(x, y)?;
    let (bottom, top) = panel.y.range;
    for span in &panel.spans {
        let ink = color(span.color).mix(0.16).filled();
        let corners = [(span.x.0, bottom), (span.x.1, top)];
        chart.draw_series(std::iter::once(Rectangle::new(corners, ink)))?;
    }
    let title = Text::new(panel.title.clone(), (LEFT as i32 + 9, 8), font());
    area.draw(&title)?;
    let named = !panel.x.names.is_empty();
    let grey = RGBColor(225, 225, 225);
    // Those of logarithmic axes are drawn below: the library knows powers of ten only.
    let numbers = |axis: &Axis| {
        let decimals = (!axis.log).then(|| decimals(axis));
        move |value: &f64| decimals.map_or(String::new(), |d| format!("{value:.d$}"))
    };
    let (x_numbers, y_numbers) = (numbers(&panel.x), numbers(&panel.y));
    let mut mesh = chart.configure_mesh();
    mesh.bold_line_style(grey)
        .light_line_style(TRANSPARENT)
        .label_style(font())
        .axis_desc_style(font())
        .x_label_formatter(&x_numbers)
        .y_label_formatter(&y_numbers)
        .x_labels(if named || panel.x.log { 0 } else { 8 })
        .y_labels(if panel.y.log { 0 } else { 6 })
        .x_desc(&panel.x.label)
        .y_desc(&panel.y.label);
    if named || panel.x.log {
        mesh.disable_x_mesh();
    }
    if panel.y.log {
        mesh.disable_y_mesh();
    }
    mesh.draw()?;
    let corner = area.get_base_pixel();
    // `backend_coord` counts from the figure's corner, drawing from the area's.
    let place = |(x, y): (i32, i32)| (x - corner.0, y - corner.1);
    for (axis, across) in [(&panel.x, false), (&panel.y, true)] {
        for value in axis.log_ticks() {
            let ends = if across {
                [(panel.x.range.0, value), (panel.x.range.1, value)]
            } else {
                [(value, bottom), (value, top)]
            };
            chart.draw_series(std::iter::once(PathElement::new(ends.to_vec(), grey)))?;
            let (x, y) = place(chart.backend_coord(&ends[0]));
            let (at, pos) = if across {
                ((x - 7, y), Pos::new(HPos::Right, VPos::Center))
            } else {
                ((x, y + 8), Pos::new(HPos::Center, VPos::Top))
            };
            let style = TextStyle::from(font()).pos(pos);
            area.draw(&Text::new(format!("{value}"), at, style))?;
        }
    }
    for series in &panel.series {
        let ink = color(series.color);
        match series.style {
            Style::Bars { width, shift } => {
                let bars = series.points.iter().filter(|(_, y)| y.is_finite());
                chart.draw_series(bars.map(|(x, y)| {
                    let (left, right) = (x + shift - 0.5 * width, x + shift + 0.5 * width);
                    Rectangle::new([(left, bottom), (right, *y)], ink.filled())
                }))?;
            }
            Style::Ring => {
                let points = series.points.iter().filter(|(x, y)| (x + y).is_finite());
                chart.draw_series(points.map(|p| Circle::new(*p, 8, ink.stroke_width(2))))?;
            }
            Style::Line | Style::Wide | Style::Dotted => {
                for piece in series.points.split(|(x, y)| !(x + y).is_finite()) {
                    chart.draw_series(LineSeries::new(piece.iter().copied(), stroke(series)))?;
                }
            }
        }
        if series.style == Style::Dotted {
            let points = series.points.iter().filter(|(x, y)| (x + y).is_finite());
            chart.draw_series(points.map(|p| Circle::new(*p, 4, ink.filled())))?;
        }
    }
    if named {
        let centred = TextStyle::from(font()).pos(Pos::new(HPos::Center, VPos::Top));
        for (index, name) in panel.x.names.iter().enumerate() {
            let (x, y) = place(chart.backend_coord(&(index as f64, bottom)));
            area.draw(&Text::new(name.clone(), (x, y + 7), centred.clone()))?;
        }
    }
    Ok(())
}

/// Decimals that tell the numbers along a linear axis apart.
fn decimals(axis: &Axis) -> usize {
    let extent = axis.range.1 - axis.range.0;
    (0.7 - extent.log10()).ceil().clamp(0.0, 6.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(x: Axis, y: Axis, points: Vec<(f64, f64)>) -> Figure {
        Figure {
            title: "test".into(),
            size: (600, 300),
            columns: 1,
            panels: vec![Panel {
                title: "panel".into(),
                x,
                y,
                spans: vec![Span {
                    x: (0.2, 0.4),
                    color: 1,
                }],
                series: vec![Series {
                    name: "a < b".into(),
                    color: 1,
                    style: Style::Dotted,
                    points,
                }],
            }],
        }
    }

    #[test]
    fn an_axis_without_extent_is_an_error_and_odd_points_are_left_out() {
        let flat = figure(
            Axis::linear("x", 1.0, 1.0),
            Axis::linear("y", 0.0, 1.0),
            vec![],
        );
        let error = flat.svg().expect_err("no extent").to_string();
        assert!(error.contains("axis \"x\" runs from 1 to 1"), "{error}");
        let zero = figure(
            Axis::linear("x", 0.0, 1.0),
            Axis::log("y", 0.0, 1.0),
            vec![],
        );
        assert!(zero.svg().is_err(), "a logarithm of zero");
        let odd = vec![
            (0.1, 0.5),
            (f64::NAN, 0.5),
            (0.3, f64::INFINITY),
            (0.5, 0.5),
        ];
        let text = figure(Axis::linear("x", 0.0, 1.0), Axis::log("y", 0.1, 1.0), odd)
            .svg()
            .expect("drawn");
        assert_eq!(
            text.matches("<circle").count(),
            3,
            "two dots, one in the legend"
        );
        assert!(text.contains("a &lt; b"), "names are escaped");
    }

    #[test]
    fn the_legend_breaks_into_rows_that_fit() {
        let mut wide = figure(
            Axis::linear("x", 0.0, 1.0),
            Axis::linear("y", 0.0, 1.0),
            vec![],
        );
        for k in 0..9 {
            let mut series = wide.panels[0].series[0].clone();
            series.name = format!("a rather long name {}", k % 8);
            wide.panels[0].series.push(series);
        }
        let rows = wide.legend_rows();
        assert_eq!(
            rows.iter().map(Vec::len).sum::<usize>(),
            9,
            "each name once"
        );
        for row in &rows {
            let width: i32 = row.iter().map(|s| entry_width(&s.name)).sum();
            assert!(width <= 600, "a row of {width} px");
        }
    }
}
