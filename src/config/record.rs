//! `[record]`, checked: files, memory, channels of recordings.

use super::error::{ConfigError, Pointer};
use super::file::RecordEntry;
use super::files::Files;
use crate::base::suggest::hint;
use std::path::PathBuf;

/// What is kept of runs, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordOptions {
    /// The file of whole runs.
    pub file: Option<PathBuf>,
    /// Whether the latest past is written after a fault; `None`: in runs on real servos.
    pub on_fault: Option<bool>,
    /// Where to; the working folder when empty.
    pub folder: PathBuf,
    /// Memory for the latest past, bytes of logs.
    pub ring_bytes: usize,
    /// Messages a second of gestures, graph, joints and bus.
    pub telemetry_hz: f64,
    /// Names of what is written in words; `None`: all.
    pub channels: Option<Vec<String>>,
}

/// What may be chosen.
const CHANNELS: [&str; 6] = ["poses", "gestures", "graph", "joints", "bus", "frames"];

/// Checks `[record]`; its paths are relative to the configuration's folder.
pub(super) fn record_options(
    entry: &RecordEntry,
    files: &Files,
    at: &Pointer<'_>,
) -> Result<RecordOptions, ConfigError> {
    let place = |path: &String| match files.place() {
        Files::Folder(folder) => folder.join(path),
        Files::Embedded | Files::Kept(_) => PathBuf::from(path),
    };
    let ring_mb = entry.ring_mb.unwrap_or(64.0);
    let telemetry_hz = entry.telemetry_hz.unwrap_or(50.0);
    for (key, value, low, high) in [
        ("record.ring_mb", ring_mb, 1.0, 4096.0),
        ("record.telemetry_hz", telemetry_hz, 0.1, 2000.0),
    ] {
        if !(value >= low && value <= high) {
            return Err(at.key(key, format!("{value} is not in {low}..{high}")));
        }
    }
    for channel in entry.channels.iter().flatten() {
        let name = channel.get_ref();
        if !CHANNELS.contains(&name.as_str()) {
            let problem = format!(
                "no channel {name:?}{} Allowed: {}",
                hint(name, CHANNELS.iter().copied()),
                CHANNELS.join(", ")
            );
            return Err(at.at(channel.span(), "record.channels", problem));
        }
    }
    let chosen = entry.channels.as_ref();
    Ok(RecordOptions {
        file: entry.file.as_ref().map(place),
        on_fault: entry.on_fault,
        folder: entry.folder.as_ref().map(place).unwrap_or_default(),
        ring_bytes: (ring_mb * 1e6) as usize,
        telemetry_hz,
        channels: chosen.map(|list| list.iter().map(|c| c.get_ref().clone()).collect()),
    })
}
