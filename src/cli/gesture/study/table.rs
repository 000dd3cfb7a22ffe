//! The summary of a study: one line per estimator.

use crate::gesture::study::{Study, Subject};

/// A column of the summary: heading, unit, sequence, noise, metric.
type Column = (&'static str, &'static str, &'static str, f64, &'static str);

/// What matters most, at noises a good (0.03) and a poor (0.1) tracker has.
pub(super) const COLUMNS: [Column; 11] = [
    (
        "f settles",
        "s",
        "frequency-step-loop",
        0.03,
        "frequency_settling",
    ),
    (
        "f settles, noisy",
        "s",
        "frequency-step-loop",
        0.1,
        "frequency_settling",
    ),
    (
        "a settles",
        "s",
        "amplitude-step-loop",
        0.03,
        "amplitude_settling",
    ),
    (
        "a settles, noisy",
        "s",
        "amplitude-step-loop",
        0.1,
        "amplitude_settling",
    ),
    (
        "f error",
        "Hz",
        "frequency-step-loop",
        0.1,
        "steady_frequency_error",
    ),
    (
        "a error",
        "1",
        "frequency-step-loop",
        0.1,
        "steady_amplitude_error",
    ),
    (
        "phase error",
        "deg",
        "frequency-step-loop",
        0.1,
        "steady_phase_error",
    ),
    (
        "a error on a line",
        "1",
        "amplitude-step-line",
        0.03,
        "steady_amplitude_error",
    ),
    (
        "delay on a ramp",
        "s",
        "tempo-ramp",
        0.03,
        "frequency_delay",
    ),
    (
        "noise above 0.1",
        "1",
        "pure-noise-60hz",
        0.3,
        "share_above_0.1",
    ),
    ("held pose", "1", "held-pose", 0.0, "held_amplitude"),
];

/// One line of cells per estimator, the headings first.
pub(super) fn summary(study: &Study, subjects: &[Subject]) -> Vec<Vec<String>> {
    let head = COLUMNS.iter().map(|(name, unit, ..)| match *unit {
        "1" => (*name).to_owned(),
        unit => format!("{name} [{unit}]"),
    });
    let mut rows = vec![
        std::iter::once("estimator".to_owned())
            .chain(head)
            .collect(),
    ];
    for subject in subjects {
        let cells = COLUMNS.iter().map(|(_, unit, sequence, noise, metric)| {
            cell(study.value(sequence, subject.name, *noise, metric), unit)
        });
        rows.push(std::iter::once(label(*subject)).chain(cells).collect());
    }
    rows
}

/// The estimator's name with what readers know it by.
pub(super) fn label(subject: Subject) -> String {
    let mut label = subject.name.to_owned();
    if subject.name == "gabor" {
        label.push_str(" (thesis)");
    }
    if subject.is_default() {
        label.push_str(" *");
    }
    label
}

/// A number with as many digits as its unit deserves; `never` for what did not settle.
pub(super) fn cell(value: Option<f64>, unit: &str) -> String {
    match value {
        None => "-".into(),
        Some(value) if value.is_infinite() => "never".into(),
        Some(value) => match unit {
            "s" => format!("{value:.2}"),
            "deg" => format!("{value:.1}"),
            "%" => format!("{:.0} %", 100.0 * value),
            _ if value >= 1.0 => format!("{value:.2}"),
            _ => format!("{value:.4}"),
        },
    }
}

/// The lines as text in columns, for a terminal: one figure a line, one estimator a column, since
/// the headings are longer than the numbers.
pub(super) fn plain(rows: &[Vec<String>]) -> String {
    let count = rows.first().map_or(0, Vec::len);
    let width = |column: &Vec<String>| column.iter().map(String::len).max().unwrap_or(0);
    let widths: Vec<usize> = rows.iter().map(width).collect();
    let lines: Vec<String> = (0..count)
        .map(|line| {
            let cells = rows.iter().zip(&widths).enumerate();
            let text: Vec<String> = cells
                .map(|(index, (row, width))| match index {
                    0 => format!("{:<width$}", row[line]),
                    _ => format!("{:>width$}", row[line]),
                })
                .collect();
            text.join("  ")
        })
        .collect();
    lines.join("\n")
}

/// The lines as a Markdown table.
pub(super) fn markdown(rows: &[Vec<String>]) -> String {
    let mut text = String::new();
    for (index, row) in rows.iter().enumerate() {
        text.push_str(&format!("| {} |\n", row.join(" | ")));
        if index == 0 {
            text.push_str(&format!("|{}\n", "---|".repeat(row.len())));
        }
    }
    text
}
