//! Draws one cycle: gestures, motion, joints, bus, safety.

use super::watch::{Names, Watch, safety};
use crate::bus::dynamixel::model::Effort;
use crate::gesture::{GestureEstimate, GestureKind};
use crate::live::CycleRecord;
use crate::puppet::Stage;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style, Stylize};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph};

/// Draws the whole view.
pub fn draw(frame: &mut Frame<'_>, names: &Names, watch: &Watch, record: &CycleRecord) {
    let gestures = names.gestures.len() as u16 + 2;
    let motion = (names.classes.len().max(names.layers.len() + 1)) as u16 + 3;
    // An avatar has no servos to show.
    let joints = match names.joints.len() as u16 {
        0 => 0,
        n => n + 2,
    };
    let [head, top, middle, bottom, foot] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(gestures),
        Constraint::Length(motion),
        Constraint::Length(joints),
        Constraint::Min(5),
    ])
    .areas(frame.area());
    let title = Line::from(vec![
        Span::from(" handwave ").black().on_cyan(),
        Span::from(format!("  {}  ", names.character)).bold(),
        Span::from(format!("{:7.2} s  ", record.t_s)),
        Span::from(names.source.clone()).dim(),
        Span::from("   q stops").dim(),
    ]);
    frame.render_widget(Paragraph::new(title), head);
    panel(frame, top, "gestures", gesture_lines(names, record));
    panel(frame, middle, "motion", motion_lines(names, record));
    panel(
        frame,
        bottom,
        "joints   target | measured",
        joint_lines(names, record, bottom.width),
    );
    panel(frame, foot, "bus and loop", bus_lines(watch, record));
}

fn panel(frame: &mut Frame<'_>, area: Rect, title: &str, lines: Vec<Line<'_>>) {
    let block = Block::bordered()
        .border_style(Style::new().dark_gray())
        .title(format!(" {title} ").cyan());
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

fn bar(share: f64, width: usize) -> String {
    let cells = (share.clamp(0.0, 1.0) * width as f64 * 8.0).round() as usize;
    let eighths = [' ', '▏', '▎', '▍', '▌', '▋', '▊', '▉'];
    (0..width)
        .map(|i| match cells.saturating_sub(i * 8) {
            0 => ' ',
            n if n >= 8 => '█',
            n => eighths[n],
        })
        .collect()
}

/// The phase as a hand on a clock face, counter-clockwise from the right.
fn hand(phase_rad: f64) -> &'static str {
    const HANDS: [&str; 8] = ["→", "↗", "↑", "↖", "←", "↙", "↓", "↘"];
    let eighth = (phase_rad / std::f64::consts::TAU * 8.0).round() as i64;
    HANDS[eighth.rem_euclid(8) as usize]
}

fn gesture_lines(names: &Names, record: &CycleRecord) -> Vec<Line<'static>> {
    let line = |(name, g): (&String, &GestureEstimate)| {
        let performed = g.amplitude > 0.2;
        let colour = if performed {
            Color::Green
        } else {
            Color::DarkGray
        };
        let reading = match g.kind {
            // The frequency of what is hardly there means nothing.
            GestureKind::Cyclic if g.amplitude < 0.05 => format!(" a {:4.2}", g.amplitude),
            GestureKind::Cyclic => format!(
                " a {:4.2}  f {:5.2} Hz  {} {:3.0}°  quality {:.2}",
                g.amplitude,
                g.frequency_hz,
                hand(g.phase_rad),
                g.phase_rad.to_degrees(),
                g.quality
            ),
            GestureKind::NonCyclic => format!(" progression {:4.2}", g.amplitude),
        };
        Line::from(vec![
            Span::from(format!("{name:<12}")).bold(),
            Span::styled(
                bar(g.amplitude, 24),
                Style::new().fg(colour).bg(Color::Black),
            ),
            Span::from(reading),
        ])
    };
    names
        .gestures
        .iter()
        .zip(&record.gestures)
        .map(line)
        .collect()
}

fn motion_lines(names: &Names, record: &CycleRecord) -> Vec<Line<'static>> {
    let class = |node: usize| names.classes.get(node).cloned().unwrap_or_default();
    let mut lines = vec![match record.transition {
        Some((t, weight)) => Line::from(vec![
            Span::from(format!("{} ", class(t.from))),
            Span::from(bar(weight, 12)).yellow(),
            Span::from(format!(
                " {}{}",
                class(t.to),
                if t.aborting { " (given up)" } else { "" }
            ))
            .yellow(),
        ]),
        None => Line::from(vec![
            Span::from(format!("{}  ", class(record.active)))
                .green()
                .bold(),
            Span::from(clip_shares(names, record)).green(),
        ]),
    }];
    for (node, played) in record.played.iter().enumerate() {
        let shown = node == record.active || record.transition.is_some_and(|(t, _)| t.to == node);
        let text = format!(
            "  {:<12} {:4.2}  {:5.2} Hz  {} {}{}",
            class(node),
            played.amplitude,
            played.frequency_hz,
            hand(played.phase_rad),
            if played.stride < 0.995 {
                format!("stride {:.0} %  ", played.stride * 100.0)
            } else {
                String::new()
            },
            if played.locked {
                ""
            } else {
                "faster than the joints: phase not locked"
            },
        );
        let text = if names.clips.get(node).is_some_and(Vec::is_empty) {
            // A pose map; large where a pair would teach it much (Rhodin 2016, section 8.3).
            format!(
                "  {:<12} {:4.2}  unsure {}",
                class(node),
                played.amplitude,
                bar(played.uncertainty, 12)
            )
        } else {
            text
        };
        lines.push(if shown {
            Line::from(text)
        } else {
            Line::from(text).dim()
        });
    }
    let layers: Vec<String> = names
        .layers
        .iter()
        .zip(&record.layers)
        .map(|(name, weight)| format!("{name} {weight:+.2}"))
        .collect();
    lines.push(Line::from(format!(
        "  {}   walked {:.2} m",
        layers.join("  "),
        record.root.x_m.hypot(record.root.y_m)
    )));
    lines
}

/// The clips being blended, largest share first: `walk_long 62 %  trot_long 38 %`.
fn clip_shares(names: &Names, record: &CycleRecord) -> String {
    let Some(clips) = names.clips.get(record.active) else {
        return String::new();
    };
    let mut shares: Vec<(&String, f64)> = clips
        .iter()
        .zip(record.clips.iter().copied())
        .filter(|(_, weight)| *weight > 0.005)
        .collect();
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    let texts: Vec<String> = shares
        .iter()
        .map(|(name, weight)| format!("{name} {:.0} %", weight * 100.0))
        .collect();
    texts.join("  ")
}

fn joint_lines(names: &Names, record: &CycleRecord, width: u16) -> Vec<Line<'static>> {
    let track = usize::from(width.saturating_sub(52)).clamp(10, 60);
    let place = |value: f64, (low, high): (f64, f64)| {
        let share = (value - low) / (high - low);
        ((share.clamp(0.0, 1.0) * (track - 1) as f64).round()) as usize
    };
    let line = |(i, (name, id)): (usize, &(String, u8))| {
        let (Some(target), Some(state)) = (record.targets.get(i), record.states.get(i)) else {
            return Line::default();
        };
        let limits = names.limits[i];
        let mut cells = vec!['·'; track];
        cells[place(state.position, limits)] = '○';
        cells[place(*target, limits)] = '┃';
        let effort = match names.efforts.get(i) {
            Some(Effort::Current) => format!("{:+4.1} A", state.effort),
            Some(Effort::Load) | None => format!("{:+4.0} %", state.effort * 100.0),
        };
        let silent = record.bus.silent_mask >> i & 1 == 1;
        let alert = record.bus.alert_mask >> i & 1 == 1;
        let note = if silent {
            " SILENT".red()
        } else if alert {
            " ERROR".red()
        } else {
            Span::default()
        };
        Line::from(vec![
            Span::from(format!("{id:>3} {name:<18}")),
            Span::from(cells.into_iter().collect::<String>()).light_blue(),
            Span::from(format!(
                " {target:+6.3} | {:+6.3} rad {effort}",
                state.position
            )),
            note,
        ])
    };
    names.joints.iter().enumerate().map(line).collect()
}

fn bus_lines(watch: &Watch, record: &CycleRecord) -> Vec<Line<'static>> {
    let percentiles: Vec<String> = watch
        .percentiles()
        .iter()
        .map(|(name, p)| format!("{name} p50 {} p99 {} max {} us", p.p50, p.p99, p.max))
        .collect();
    let calm = matches!(
        record.stage,
        Stage::Playing | Stage::Rising | Stage::Lowering | Stage::Done
    ) && !record.poses_lost
        && record.bus.silent_mask == 0
        && record.bus.alert_mask == 0;
    let state = safety(record);
    vec![
        Line::from(percentiles.join("   ")),
        Line::from(format!(
            "cycles {}  overruns {}  replies missing {}  damage {}  envelope acted {}",
            watch.cycles, record.overruns, watch.silent, watch.damaged, watch.held_back
        )),
        Line::from(vec![
            Span::from("safety  "),
            if calm {
                state.green()
            } else {
                state.yellow().bold()
            },
            Span::from(match record.pose_age_s {
                Some(age) => format!("   last pose {:.0} ms ago", age * 1e3),
                None => "   no pose yet".into(),
            }),
        ]),
    ]
}
