//! `[record]` as a user writes it: what is kept of runs.

use serde::Deserialize;
use toml::Spanned;

/// What is kept of runs, as MCAP files.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordEntry {
    /// Every run is recorded whole into this file, as by `--record`; a run overwrites the last one.
    pub file: Option<String>,
    /// The latest past is written to a file when something went wrong: by default in runs on real servos.
    pub on_fault: Option<bool>,
    /// The folder of such files; by default the one the program was started in.
    pub folder: Option<String>,
    /// Memory for the latest past, megabytes (64: a quarter of an hour of twelve servos at 200 Hz).
    pub ring_mb: Option<f64>,
    /// Messages a second of gestures, graph, joints and bus (50). A replay gives every cycle again.
    pub telemetry_hz: Option<f64>,
    /// What is written in words beside what a replay needs: `poses`, `gestures`, `graph`, `joints`, `bus`,
    /// `frames` (all).
    pub channels: Option<Vec<Spanned<String>>>,
}
