//! The study's report in Markdown: the figures in tables, the plots, how to repeat it.

use super::table::{cell, label, markdown, summary};
use crate::gesture::study::{Independence, SIGNAL_TO_NOISE, Study, StudyOptions, Subject};

/// Text of `report.md`, next to the plots named `plots`.
pub(super) fn report(study: &Study, options: &StudyOptions, plots: &[&str]) -> String {
    let mut text = String::from("# Wave estimators compared\n\n");
    text.push_str(
        "All estimators read the same synthetic performers through the whole front end, each with its own \
         smoothing. Noise is white, per component of the gesture's plane, where the gesture itself has \
         amplitude 1. Settling is the last time more than 10 % off the new value. Figures are medians over \
         repeats. `*` is the default estimator; `never` did not settle in the 5 s that were watched.\n\n",
    );
    if options.quick {
        text.push_str(
            "**A quick look**: one repeat of each, half a minute of noise. Leave out `--quick` to measure.\n\n",
        );
    }
    text.push_str("## In short\n\n");
    text.push_str(&markdown(&turned(&summary(study, &options.subjects))));
    text.push_str(
        "\nf: frequency 1 to 2 Hz, a: amplitude 1 to 0.5, at noise 0.03 (noisy: 0.1); errors at noise 0.1 in steady \
         state; the delay is the lag at which the frequency follows a ramp from 0.5 to 2.5 Hz best; noise above \
         0.1: share of the time that pure noise of 0.3 holds the amplitude above the abort threshold, 60 Hz.\n\n",
    );
    text.push_str(&words(study, &options.subjects));
    for (title, rows) in sections(study, &options.subjects) {
        text.push_str(&format!("\n## {title}\n\n{}", markdown(&rows)));
    }
    for independence in &study.independence {
        text.push_str(&confusion(independence));
    }
    if !plots.is_empty() {
        text.push_str("\n## Plots\n\n");
    }
    for plot in plots {
        text.push_str(&format!("![{}]({plot})\n\n", caption(plot)));
    }
    text.push_str("## Again\n\n");
    let names: Vec<&str> = options.subjects.iter().map(|s| s.name).collect();
    text.push_str(&format!(
        "    handwave gesture study --out DIR --seed {}{} --estimators {}\n\nAll figures, and more noises and \
         windows, are in `study.csv`.\n",
        options.seed,
        if options.quick { " --quick" } else { "" },
        names.join(",")
    ));
    text
}

fn caption(plot: &str) -> &'static str {
    match plot {
        "delay_error.svg" => {
            "Steady error against settling, every estimator a curve over its window"
        }
        "settling.svg" => "Settling after steps of frequency and amplitude",
        "noise.svg" => "Steady errors against noise",
        "waves.svg" => "Figure 9.5: amplitude, frequency and phase of an arm wave as read",
        "independence_hand.svg" => "Figure 9.15: thumb and whole hand, three methods",
        _ => "Drumming and splaying of a recorded hand, three methods",
    }
}

/// Rows become columns: many figures, few estimators.
fn turned(rows: &[Vec<String>]) -> Vec<Vec<String>> {
    let count = rows.first().map_or(0, Vec::len);
    (0..count)
        .map(|line| rows.iter().map(|row| row[line].clone()).collect())
        .collect()
}

/// Every estimator against the thesis's in a sentence.
fn words(study: &Study, subjects: &[Subject]) -> String {
    let of = |name: &str, sequence: &str, metric: &str| study.value(sequence, name, 0.1, metric);
    let mut text = String::new();
    for subject in subjects.iter().filter(|s| s.name != "gabor") {
        let ratio = |sequence, metric| {
            let (own, thesis) = (
                of(subject.name, sequence, metric)?,
                of("gabor", sequence, metric)?,
            );
            (own.is_finite() && thesis > 0.0).then(|| own / thesis)
        };
        if let (Some(delay), Some(error)) = (
            ratio("frequency-step-loop", "frequency_settling"),
            ratio("frequency-step-loop", "steady_frequency_error"),
        ) {
            text.push_str(&format!(
                "- `{}` settles on a new frequency in {delay:.2} times the time of the thesis's Gabor bank, with \
                 {error:.2} times its steady error (noise 0.1).\n",
                subject.name
            ));
        }
    }
    text
}

/// A table of the study: title, and per column heading, unit, sequence, noise, metric.
type Table = (
    &'static str,
    &'static [(&'static str, &'static str, &'static str, f64, &'static str)],
);

const TABLES: [Table; 5] = [
    (
        "Pure noise of 0.3, gaps, onset and release",
        &[
            (
                "above 0.1, 60 Hz",
                "1",
                "pure-noise-60hz",
                0.3,
                "share_above_0.1",
            ),
            (
                "above 0.2, 60 Hz",
                "1",
                "pure-noise-60hz",
                0.3,
                "share_above_0.2",
            ),
            (
                "above 0.1, 30 Hz",
                "1",
                "pure-noise-30hz",
                0.3,
                "share_above_0.1",
            ),
            (
                "above 0.2, 30 Hz",
                "1",
                "pure-noise-30hz",
                0.3,
                "share_above_0.2",
            ),
            (
                "starts a minute, 30 Hz",
                "1",
                "pure-noise-30hz",
                0.3,
                "activations_per_minute",
            ),
            (
                "least amplitude around a 300 ms gap, 10 % lost",
                "1",
                "gap",
                0.03,
                "least_amplitude",
            ),
            (
                "largest phase error there [deg]",
                "deg",
                "gap",
                0.03,
                "largest_phase_error",
            ),
            (
                "onset to 0.2 [s]",
                "s",
                "onset-release",
                0.03,
                "onset_to_0.2",
            ),
            (
                "onset to 0.9 [s]",
                "s",
                "onset-release",
                0.03,
                "onset_to_0.9",
            ),
            (
                "release to 0.2 [s]",
                "s",
                "onset-release",
                0.03,
                "release_to_0.2",
            ),
            (
                "release to 0.1 [s]",
                "s",
                "onset-release",
                0.03,
                "release_to_0.1",
            ),
        ],
    ),
    (
        "Held poses, harmonics, the opposite sense",
        &[
            (
                "step to a held pose, largest amplitude",
                "1",
                "held-pose",
                0.0,
                "largest_amplitude",
            ),
            ("held pose", "1", "held-pose", 0.0, "held_amplitude"),
            (
                "wave on a held pose, a error",
                "1",
                "wave-on-held-pose",
                0.0,
                "steady_amplitude_error",
            ),
            (
                "wave on a held pose, phase error [deg]",
                "deg",
                "wave-on-held-pose",
                0.0,
                "steady_phase_error",
            ),
            (
                "second harmonic 0.5, a error",
                "1",
                "second-harmonic",
                0.0,
                "steady_amplitude_error",
            ),
            (
                "second harmonic 0.5, f error [Hz]",
                "Hz",
                "second-harmonic",
                0.0,
                "steady_frequency_error",
            ),
            (
                "opposite sense, a error",
                "1",
                "opposite-sense",
                0.0,
                "steady_amplitude_error",
            ),
            (
                "opposite sense, f error [Hz]",
                "Hz",
                "opposite-sense",
                0.0,
                "steady_frequency_error",
            ),
        ],
    ),
    (
        "Two gestures that share an arm",
        &[
            (
                "other one while the first is performed, mean",
                "1",
                "shared-joints-one",
                0.03,
                "interference_mean",
            ),
            (
                "same, largest",
                "1",
                "shared-joints-one",
                0.03,
                "interference_largest",
            ),
            (
                "first one while the other is performed, mean",
                "1",
                "shared-joints-other",
                0.03,
                "interference_mean",
            ),
            (
                "same, largest",
                "1",
                "shared-joints-other",
                0.03,
                "interference_largest",
            ),
            (
                "both at once, a error",
                "1",
                "shared-joints-both",
                0.03,
                "steady_amplitude_error",
            ),
            (
                "both at once, f error [Hz]",
                "Hz",
                "shared-joints-both",
                0.03,
                "steady_frequency_error",
            ),
        ],
    ),
    (
        "Figure 9.5: root mean square errors from 2 s on, changes included",
        &[
            ("a error", "1", "figure-9.5", f64::NAN, "amplitude_error"),
            (
                "f error [Hz]",
                "Hz",
                "figure-9.5",
                f64::NAN,
                "frequency_error",
            ),
            (
                "phase error [deg]",
                "deg",
                "figure-9.5",
                f64::NAN,
                "phase_error",
            ),
        ],
    ),
    (
        "A real hand drums and splays (bundled recording)",
        &[
            ("a error", "1", "recorded-hand", 0.0, "amplitude_error"),
            (
                "f error [Hz]",
                "Hz",
                "recorded-hand",
                0.0,
                "frequency_error",
            ),
            (
                "drum at rest, largest",
                "1",
                "recorded-hand",
                0.0,
                "largest_at_rest",
            ),
            (
                "drum while splaying, largest",
                "1",
                "recorded-hand",
                0.0,
                "largest_during_other",
            ),
        ],
    ),
];

fn sections(study: &Study, subjects: &[Subject]) -> Vec<(&'static str, Vec<Vec<String>>)> {
    let figure_noise = (0.5 / SIGNAL_TO_NOISE).sqrt();
    TABLES
        .iter()
        .map(|(title, lines)| {
            let mut rows = vec![std::iter::once(String::new()).collect::<Vec<_>>()];
            rows[0].extend(subjects.iter().map(|s| label(*s)));
            for (heading, unit, sequence, noise, metric) in *lines {
                let noise = if noise.is_nan() { figure_noise } else { *noise };
                let mut row = vec![(*heading).to_owned()];
                row.extend(
                    subjects
                        .iter()
                        .map(|s| cell(study.value(sequence, s.name, noise, metric), unit)),
                );
                rows.push(row);
            }
            (*title, rows)
        })
        .collect()
}

/// What every method detects in every state of the performance.
fn confusion(independence: &Independence) -> String {
    let states = independence.states();
    let title = match independence.name {
        "figure-9.15" => "Figure 9.15: thumb against whole hand, a synthetic hand of 21 points",
        _ => "The same on the recorded hand",
    };
    let mut head = vec!["method".to_owned(), "gesture".into()];
    head.extend(states.iter().map(|(state, _)| format!("during {state}")));
    let mut rows = vec![head];
    for method in &independence.methods {
        for (gesture, activity) in independence.gestures.iter().zip(&method.activity) {
            let mut row = vec![method.name.clone(), gesture.clone()];
            for (_, samples) in &states {
                let count = samples.len().max(1) as f64;
                let mean = samples.iter().map(|k| activity[*k]).sum::<f64>() / count;
                let detected = samples
                    .iter()
                    .filter(|k| activity[**k] > method.threshold)
                    .count() as f64;
                row.push(format!("{mean:.2} ({})", cell(Some(detected / count), "%")));
            }
            rows.push(row);
        }
    }
    format!(
        "\n## {title}\n\nMean activity, and in brackets the share of the time it counts as detected (amplitude above 0.2, \
         correlation above 0.5, more than half of the frames), once all methods have had 1.5 s to see a change.\n\n{}",
        markdown(&rows)
    )
}
