//! Curves as an SVG picture.

use plotters::prelude::*;

/// Draws named curves over common axes.
///
/// # Errors
/// What the plotting crate says.
pub(super) fn curves(
    title: &str,
    x: &str,
    y: &str,
    curves: &[(String, Vec<(f64, f64)>)],
) -> Result<String, String> {
    let points = || curves.iter().flat_map(|(_, points)| points);
    let range = |pick: fn(&(f64, f64)) -> f64| {
        let (low, high) = points()
            .map(pick)
            .filter(|v| v.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
                (l.min(v), h.max(v))
            });
        let margin = 0.05 * (high - low).max(1e-6);
        low - margin..high + margin
    };
    let mut text = String::new();
    draw(
        &mut text,
        title,
        (x, y),
        (range(|p| p.0), range(|p| p.1)),
        curves,
    )
    .map_err(|e| e.to_string())?;
    Ok(text)
}

fn draw(
    text: &mut String,
    title: &str,
    (x, y): (&str, &str),
    (across, up): (std::ops::Range<f64>, std::ops::Range<f64>),
    curves: &[(String, Vec<(f64, f64)>)],
) -> Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::with_string(text, (900, 560)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(title, ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(56)
        .build_cartesian_2d(across, up)?;
    chart.configure_mesh().x_desc(x).y_desc(y).draw()?;
    for (index, (name, points)) in curves.iter().enumerate() {
        let colour = Palette99::pick(index).to_rgba();
        chart
            .draw_series(LineSeries::new(
                points.iter().copied(),
                colour.stroke_width(2),
            ))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .background_style(WHITE.mix(0.85))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    root.present()?;
    Ok(())
}
