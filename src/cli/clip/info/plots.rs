//! The plot of `handwave clip info`: contacts, foot heights, limbs and speed over one cycle.

use super::Findings;
use crate::motion::analysis::FootContact;
use crate::motion::take::TakeBody;
use crate::view::plot::{Axis, Figure, Panel, Series, Style};

/// Points along the cycle.
const POINTS: usize = 128;

/// Frames that are drawn: one cycle, or the whole take.
struct Window {
    from: f64,
    frames: f64,
}

impl Window {
    fn at(&self, point: usize) -> f64 {
        self.from + self.frames * point as f64 / POINTS as f64
    }

    /// (fraction, value) of a series over frames, linear between them.
    fn curve(&self, values: &[f64]) -> Vec<(f64, f64)> {
        (0..=POINTS)
            .map(|k| (k as f64 / POINTS as f64, between(values, self.at(k))))
            .collect()
    }
}

fn between(values: &[f64], at: f64) -> f64 {
    let last = values.len().saturating_sub(1);
    let k = (at.floor() as usize).min(last.saturating_sub(1));
    let w = (at - k as f64).clamp(0.0, 1.0);
    match (values.get(k), values.get(k + 1)) {
        (Some(a), Some(b)) => a + w * (b - a),
        (Some(a), None) => *a,
        _ => f64::NAN,
    }
}

pub(super) fn figure(findings: &Findings) -> Figure {
    let take = &findings.take;
    let (window, x) = match &findings.found.cycle {
        Some(c) => (
            Window {
                from: c.start as f64,
                frames: c.frames,
            },
            "fraction of the cycle",
        ),
        None => (
            Window {
                from: 0.0,
                frames: take.len().saturating_sub(1) as f64,
            },
            "fraction of the motion",
        ),
    };
    let axis = || Axis::linear(x, 0.0, 1.0);
    let mut panels = Vec::new();
    if !findings.found.feet.is_empty() {
        panels.push(contacts(findings, axis()));
        panels.push(heights(findings, &window, axis()));
    }
    panels.push(speed(findings, &window, axis()));
    panels.extend(limbs(findings, &window, axis));
    let cycle = findings
        .found
        .cycle
        .map_or("no cycle".into(), |c| format!("{:.2} Hz", c.frequency_hz));
    let gait = findings
        .found
        .gait
        .map_or(String::new(), |g| format!(", {g}"));
    Figure {
        title: format!(
            "{}: {cycle}, {:.2} m/s{gait}",
            take.name,
            findings.found.travel.speed_m_s()
        ),
        size: (1100, 250),
        columns: 2,
        panels,
    }
}

fn series(name: &str, color: usize, points: Vec<(f64, f64)>) -> Series {
    Series {
        name: name.into(),
        color,
        style: Style::Line,
        points,
    }
}

/// The y axis that holds all series, with some room.
fn fitted(label: &str, series: &[Series], floor: Option<f64>) -> Axis {
    let values = series.iter().flat_map(|s| &s.points).map(|p| p.1);
    let (low, high) = (values.filter(|v| v.is_finite()))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        });
    let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
    let low = floor.map_or(low, |f| low.min(f));
    let room = (0.08 * (high - low)).max(1e-3);
    Axis::linear(label, low - room, high + room)
}

/// Bars of contact, one row a foot, the first foot on top.
fn contacts(findings: &Findings, x: Axis) -> Panel {
    let feet = &findings.found.feet;
    let rows = feet.len() as f64;
    let bars = |(i, foot): (usize, &FootContact)| {
        let y = rows - 1.0 - i as f64;
        let shares = foot.over(findings.found.cycle.as_ref(), POINTS);
        let mut points = Vec::new();
        for (k, share) in shares.iter().enumerate() {
            let y = if *share >= 0.5 { y } else { f64::NAN };
            points.push((k as f64 / POINTS as f64, y));
            points.push(((k + 1) as f64 / POINTS as f64, y));
        }
        Series {
            style: Style::Wide,
            ..series(&foot.name, i + 1, points)
        }
    };
    Panel {
        title: "on the ground (legend from the top)".into(),
        x,
        y: Axis::linear("", -0.6, rows - 0.4),
        spans: vec![],
        series: feet.iter().enumerate().map(bars).collect(),
    }
}

fn heights(findings: &Findings, window: &Window, x: Axis) -> Panel {
    let feet = findings.found.feet.iter().enumerate();
    let series: Vec<Series> = feet
        .map(|(i, foot)| {
            let mm: Vec<f64> = foot.heights_m.iter().map(|h| 1e3 * h).collect();
            series(&foot.name, i + 1, window.curve(&mm))
        })
        .collect();
    Panel {
        title: "height of the feet".into(),
        x,
        y: fitted("mm", &series, Some(0.0)),
        spans: vec![],
        series,
    }
}

fn speed(findings: &Findings, window: &Window, x: Axis) -> Panel {
    let take = &findings.take;
    let step = |k: usize| {
        let k = k.min(take.len().saturating_sub(2));
        let way = take.roots[k].advance_to(&take.roots[k + 1]);
        [way.forward_m, way.left_m, way.yaw_rad].map(|v| v / take.dt_s)
    };
    let rates: Vec<[f64; 3]> = (0..take.len()).map(step).collect();
    let of = |i: usize| window.curve(&rates.iter().map(|r| r[i]).collect::<Vec<f64>>());
    let series = vec![
        series("root forwards, m/s", 5, of(0)),
        series("root left, m/s", 6, of(1)),
        series("root turn, rad/s", 7, of(2)),
    ];
    Panel {
        title: "speed of the root".into(),
        x,
        y: fitted("", &series, Some(0.0)),
        spans: vec![],
        series,
    }
}

/// One panel per limb: its joints over the cycle, with limits as wide lines where they are near.
fn limbs(findings: &Findings, window: &Window, x: impl Fn() -> Axis) -> Vec<Panel> {
    const SHOWN: usize = 4;
    let take = &findings.take;
    let parts = findings.body.space().parts();
    let known: Vec<(String, Vec<String>)> = (findings.found.feet.iter())
        .zip(findings.body.limbs())
        .map(|(foot, joints)| (foot.name.clone(), joints.clone()))
        .collect();
    let known = if known.is_empty() {
        let names = parts.iter().filter(|p| p.tangent.len() != 6);
        let names: Vec<String> = names.map(|p| p.name.clone()).collect();
        names
            .chunks(SHOWN)
            .map(|c| ("joints".to_string(), c.to_vec()))
            .collect()
    } else {
        known
    };
    let limits = findings.body.model().map(|m| {
        let limits = m.limits();
        m.joint_names().into_iter().zip(limits).collect::<Vec<_>>()
    });
    let ball = matches!(take.body, TakeBody::Skeleton(_));
    let mut panels = Vec::new();
    for (limb, joints) in known.into_iter().take(6) {
        let mut drawn = Vec::new();
        for (i, joint) in joints.iter().take(SHOWN).enumerate() {
            let Some(part) = parts.iter().find(|p| p.name == *joint) else {
                continue;
            };
            let values: Vec<f64> = if ball {
                turned(findings, part.tangent.clone())
            } else {
                take.poses
                    .iter()
                    .map(|p| p[part.coordinates.start])
                    .collect()
            };
            drawn.push(series("", i + 1, window.curve(&values)));
        }
        let mut y = fitted("rad", &drawn, None);
        for (i, joint) in joints.iter().take(SHOWN).enumerate() {
            let all = limits.iter().flatten();
            let Some((_, limit)) = all.into_iter().find(|(name, _)| name == joint) else {
                continue;
            };
            let room = 0.25 * (y.range.1 - y.range.0);
            for v in [limit.lower, limit.upper] {
                if v > y.range.0 - room && v < y.range.1 + room {
                    y.range = (y.range.0.min(v - 0.1), y.range.1.max(v + 0.1));
                    drawn.push(Series {
                        style: Style::Wide,
                        ..series("", i + 1, vec![(0.0, v), (1.0, v)])
                    });
                }
            }
        }
        let colours = ["blue", "vermilion", "green", "purple"];
        let legend: Vec<String> = (joints.iter().zip(colours))
            .map(|(joint, colour)| {
                // The panel is named by the limb; twice its name would not fit.
                let short = joint.strip_prefix(limb.as_str());
                let short = short.map_or(joint.as_str(), |rest| rest.trim_start_matches('_'));
                format!("{} {colour}", if short.is_empty() { joint } else { short })
            })
            .collect();
        panels.push(Panel {
            title: format!("{limb}: {}", legend.join(", ")),
            x: x(),
            y,
            spans: vec![],
            series: drawn,
        });
    }
    panels
}

/// How far a ball joint is turned from the first pose about the axis it turns about most, rad.
fn turned(findings: &Findings, tangent: std::ops::Range<usize>) -> Vec<f64> {
    let space = findings.body.space();
    let take = &findings.take;
    let rows: Vec<Vec<f64>> = (take.poses.iter())
        .map(|pose| {
            let mut way = vec![0.0; space.tangent_len()];
            space.diff(&take.poses[0], pose, &mut way);
            way[tangent.clone()].to_vec()
        })
        .collect();
    let width = tangent.len();
    let spread = |c: usize| {
        let values = rows.iter().map(|r| r[c]);
        values.clone().fold(f64::NEG_INFINITY, f64::max) - values.fold(f64::INFINITY, f64::min)
    };
    let most = (0..width)
        .max_by(|a, b| spread(*a).total_cmp(&spread(*b)))
        .unwrap_or(0);
    rows.iter().map(|r| r[most]).collect()
}
