//! The study's plots: which series stand where.

use super::table::label;
use crate::base::angle::wrap_pi;
use crate::gesture::study::{
    Independence, STEP_NOISES, Study, Subject, TRADE_NOISE, Trace, default_lambda, wave_method,
};
use crate::view::plot::{Axis, Figure, Panel, Series, Span, Style};

/// Width of all figures in pixels.
const WIDTH: u32 = 880;
/// What never settled is drawn this high, in seconds: as long as was watched.
const WATCHED_S: f64 = 5.0;

/// All figures with their file names.
pub(super) fn figures(study: &Study, subjects: &[Subject]) -> Vec<(&'static str, Figure)> {
    let mut figures = vec![
        ("delay_error.svg", delay_error(study, subjects)),
        ("settling.svg", settling(study, subjects)),
        ("noise.svg", noise(study, subjects)),
        ("waves.svg", waves(study, subjects)),
    ];
    for independence in &study.independence {
        let (file, title) = match independence.name {
            "figure-9.15" => (
                "independence_hand.svg",
                "Gestures that share joints: a synthetic hand (figure 9.15)",
            ),
            _ => (
                "independence_recorded.svg",
                "The same methods on a recorded hand",
            ),
        };
        figures.push((file, activities(independence, title, subjects)));
    }
    figures
}

/// Colour of an estimator: its place in the list of all, whichever are shown.
fn color(subject: Subject) -> usize {
    let all = Subject::all();
    1 + all.iter().position(|s| *s == subject).unwrap_or(0)
}

fn series(subject: Subject, style: Style, points: Vec<(f64, f64)>) -> Series {
    Series {
        name: label(subject),
        color: color(subject),
        style,
        points,
    }
}

fn panel(title: &str, x: Axis, y: Axis, series: Vec<Series>) -> Panel {
    Panel {
        title: title.into(),
        x,
        y,
        spans: Vec::new(),
        series,
    }
}

/// A label with its unit, if it has one.
fn with_unit(label: &str, unit: &str) -> String {
    if unit == "1" {
        label.to_owned()
    } else {
        format!("{label} [{unit}]")
    }
}

/// The decades (or thirds of them) that hold all values of some series.
fn decades(series: &[Series]) -> (f64, f64) {
    let values = || {
        series
            .iter()
            .flat_map(|s| &s.points)
            .filter(|(x, y)| x.is_finite() && y.is_finite() && *y > 1e-6)
            .map(|(_, y)| *y)
    };
    let low = values().fold(f64::INFINITY, f64::min);
    let high = values().fold(0.0, f64::max);
    if low > high {
        return (0.001, 1.0);
    }
    let third = |value: f64, round: fn(f64) -> f64| 10_f64.powf(round(value.log10() * 3.0) / 3.0);
    (third(0.9 * low, f64::floor), third(1.1 * high, f64::ceil))
}

/// Steady error against settling, every estimator a curve over its window.
fn delay_error(study: &Study, subjects: &[Subject]) -> Figure {
    let build = |title: &str, sequence: &str, settling: &str, error: &str, unit: &str| {
        let mut drawn = Vec::new();
        let mut rings = Vec::new();
        for subject in subjects {
            let value = |lambda: f64, metric: &str| {
                study
                    .rows
                    .iter()
                    .find(|row| {
                        row.sequence == sequence
                            && row.estimator == subject.name
                            && row.noise == TRADE_NOISE
                            && row.metric == metric
                            && row.lambda == lambda
                    })
                    .map_or(f64::NAN, |row| row.value)
            };
            let mut lambdas: Vec<f64> = study.rows.iter().map(|row| row.lambda).collect();
            lambdas.sort_by(f64::total_cmp);
            lambdas.dedup();
            let point = |lambda: f64| (value(lambda, settling), value(lambda, error));
            let points: Vec<_> = lambdas.iter().map(|lambda| point(*lambda)).collect();
            rings.push(point(default_lambda()));
            drawn.push(series(*subject, Style::Dotted, points));
        }
        let y = decades(&drawn);
        drawn.push(Series {
            name: "window as shipped".into(),
            color: 0,
            style: Style::Ring,
            points: rings,
        });
        panel(
            title,
            Axis::log("settling after the step [s]", 0.08, 6.0),
            Axis::log(&with_unit("steady error", unit), y.0, y.1),
            drawn,
        )
    };
    Figure {
        title: format!("Error against delay over the window, noise {TRADE_NOISE} per component"),
        size: (WIDTH, 360),
        columns: 2,
        panels: vec![
            build(
                "frequency, 1 to 2 Hz",
                "frequency-step-loop",
                "frequency_settling",
                "steady_frequency_error",
                "Hz",
            ),
            build(
                "amplitude, 1 to 0.5",
                "amplitude-step-loop",
                "amplitude_settling",
                "steady_amplitude_error",
                "1",
            ),
        ],
    }
}

/// Settling under every noise, as bars.
fn settling(study: &Study, subjects: &[Subject]) -> Figure {
    let noises: Vec<f64> = STEP_NOISES
        .into_iter()
        .filter(|noise| {
            study
                .rows
                .iter()
                .any(|r| r.sequence == "frequency-step-loop" && r.noise == *noise)
        })
        .collect();
    let build = |title: &str, sequence: &str, metric: &str| {
        let width = 0.8 / subjects.len().max(1) as f64;
        let bars: Vec<Series> = subjects
            .iter()
            .enumerate()
            .map(|(index, subject)| {
                let points = noises.iter().enumerate().map(|(place, noise)| {
                    let value = study.value(sequence, subject.name, *noise, metric);
                    (place as f64, value.unwrap_or(f64::NAN).min(WATCHED_S))
                });
                let shift = (index as f64 - 0.5 * (subjects.len() - 1) as f64) * width;
                let style = Style::Bars {
                    width: 0.9 * width,
                    shift,
                };
                series(*subject, style, points.collect())
            })
            .collect();
        let names = noises.iter().map(|noise| format!("{noise}")).collect();
        panel(
            title,
            Axis::names("noise per component", names),
            Axis::linear("settling [s]", 0.0, WATCHED_S),
            bars,
        )
    };
    Figure {
        title: "Settling to within 10 % (5 s: not settled while watched)".into(),
        size: (WIDTH, 280),
        columns: 2,
        panels: vec![
            build(
                "frequency 1 to 2 Hz, loop",
                "frequency-step-loop",
                "frequency_settling",
            ),
            build(
                "amplitude 1 to 0.5, loop",
                "amplitude-step-loop",
                "amplitude_settling",
            ),
            build(
                "frequency 1 to 2 Hz, line",
                "frequency-step-line",
                "frequency_settling",
            ),
            build(
                "amplitude 1 to 0.5, line",
                "amplitude-step-line",
                "amplitude_settling",
            ),
        ],
    }
}

/// Steady errors against noise.
fn noise(study: &Study, subjects: &[Subject]) -> Figure {
    let build = |title: &str, metric: &str, unit: &str| {
        let lines: Vec<Series> = subjects
            .iter()
            .map(|subject| {
                let points = study
                    .rows
                    .iter()
                    .filter(|row| {
                        row.sequence == "noise-sweep"
                            && row.estimator == subject.name
                            && row.metric == metric
                    })
                    .map(|row| (row.noise, row.value))
                    .collect();
                series(*subject, Style::Dotted, points)
            })
            .collect();
        let y = decades(&lines);
        panel(
            title,
            Axis::log("noise per component", 0.009, 0.35),
            Axis::log(&with_unit("error", unit), y.0, y.1),
            lines,
        )
    };
    Figure {
        title: "Steady errors against noise, 1 Hz at 60 samples a second".into(),
        size: (WIDTH, 320),
        columns: 3,
        panels: vec![
            build("amplitude", "steady_amplitude_error", "1"),
            build("frequency", "steady_frequency_error", "Hz"),
            build("phase", "steady_phase_error", "deg"),
        ],
    }
}

/// Figure 9.5: a performance on the plane, and its amplitude, frequency and phase as read.
fn waves(study: &Study, subjects: &[Subject]) -> Figure {
    let end = study.plane.last().map_or(1.0, |(t, _)| *t);
    let time = || Axis::linear("time [s]", 0.0, end);
    let component = |index: usize, name: &str, color: usize| Series {
        name: name.into(),
        color,
        style: Style::Line,
        points: study.plane.iter().map(|(t, z)| (*t, z[index])).collect(),
    };
    let truth = |of: &dyn Fn(&Trace) -> Vec<(f64, f64)>| Series {
        name: "performed".into(),
        color: 0,
        style: Style::Wide,
        points: study
            .waves
            .first()
            .map_or_else(Vec::new, |(_, trace)| of(trace)),
    };
    // The first in the list on top: what is compared with, and the best, come first there.
    let read = |of: &dyn Fn(&Trace) -> Vec<(f64, f64)>| -> Vec<Series> {
        let traces = study.waves.iter().rev();
        traces
            .filter_map(|(name, trace)| {
                let subject = subjects.iter().find(|s| s.name == *name)?;
                Some(series(*subject, Style::Line, of(trace)))
            })
            .collect()
    };
    let zip = |t: &[f64], values: &[f64]| t.iter().copied().zip(values.iter().copied()).collect();
    let with_truth = |truth: Series, read: Vec<Series>| {
        let mut all = vec![truth];
        all.extend(read);
        all
    };
    let amplitude = with_truth(
        truth(&|trace| zip(&trace.t, &trace.truth[0].amplitude)),
        read(&|trace| zip(&trace.t, &trace.estimate[0].amplitude)),
    );
    let frequency = with_truth(
        truth(&|trace| zip(&trace.t, &trace.truth[0].frequency_hz)),
        read(&|trace| zip(&trace.t, &trace.estimate[0].frequency_hz)),
    );
    let phase = read(&|trace| {
        let mut points: Vec<(f64, f64)> = Vec::new();
        for ((t, e), truth) in trace
            .t
            .iter()
            .zip(&trace.estimate[0].phase_rad)
            .zip(&trace.truth[0].phase_rad)
        {
            let error = wrap_pi(e - truth).to_degrees();
            // Round the back of the circle: no line across the panel.
            if points
                .last()
                .is_some_and(|(_, last)| (last - error).abs() > 180.0)
            {
                points.push((*t, f64::NAN));
            }
            points.push((*t, error));
        }
        points
    });
    Figure {
        title: "An arm wave with white noise, power ratio 93.8, 30 Hz (figure 9.5)".into(),
        size: (WIDTH, 230),
        columns: 1,
        panels: vec![
            panel(
                "on the plane",
                time(),
                Axis::linear("component", -1.4, 1.4),
                vec![
                    component(0, "real part", 7),
                    component(1, "imaginary part", 6),
                ],
            ),
            panel(
                "amplitude",
                time(),
                Axis::linear("amplitude", 0.0, 1.4),
                amplitude,
            ),
            panel(
                "frequency",
                time(),
                Axis::linear("frequency [Hz]", 0.0, 3.0),
                frequency,
            ),
            panel(
                "phase error",
                time(),
                Axis::linear("error [deg]", -180.0, 180.0),
                phase,
            ),
        ],
    }
}

/// Figure 9.15: what each method makes of each gesture; shaded where it is performed.
fn activities(independence: &Independence, title: &str, subjects: &[Subject]) -> Figure {
    let (start, end) = match independence.t[..] {
        [start, .., end] => (start, end),
        _ => (0.0, 1.0),
    };
    // The thesis's estimator and the default are enough; the CSV has them all.
    let shown: Vec<Subject> = subjects
        .iter()
        .copied()
        .filter(|s| s.name == "gabor" || s.is_default() || subjects.len() == 1)
        .collect();
    let panels = independence
        .gestures
        .iter()
        .enumerate()
        .rev()
        .map(|(index, gesture)| {
            let line = |method: &str, name: &str, color: usize| {
                let found = independence.methods.iter().find(|m| m.name == method);
                found.map(|method| Series {
                    name: name.into(),
                    color,
                    style: Style::Line,
                    points: (independence.t.iter().copied())
                        .zip(method.activity[index].iter().copied())
                        .collect(),
                })
            };
            let mut series: Vec<Series> = [
                ("cross-correlation", "cross-correlation [coefficient]", 7),
                ("svm", "SVM [share of 30 frames]", 6),
            ]
            .into_iter()
            .filter_map(|(method, name, color)| line(method, name, color))
            .collect();
            for subject in &shown {
                let method = wave_method(subject.name);
                let name = format!("waves, {} [amplitude]", label(*subject));
                series.extend(line(&method, &name, color(*subject)));
            }
            Panel {
                spans: spans(&independence.t, &independence.performed[index]),
                ..panel(
                    &format!("{gesture}: shaded where it is performed"),
                    Axis::linear("time [s]", start, end),
                    Axis::linear("activity", 0.0, 1.25),
                    series,
                )
            }
        })
        .collect();
    Figure {
        title: title.into(),
        size: (WIDTH, 260),
        columns: 1,
        panels,
    }
}

/// The stretches of time in which a flag is set.
fn spans(t: &[f64], flags: &[bool]) -> Vec<Span> {
    let mut spans: Vec<Span> = Vec::new();
    let mut before = false;
    for (t, flag) in t.iter().zip(flags) {
        if *flag && !before {
            spans.push(Span {
                x: (*t, *t),
                color: 3,
            });
        }
        if let Some(last) = spans.last_mut().filter(|_| *flag) {
            last.x.1 = *t;
        }
        before = *flag;
    }
    spans
}
