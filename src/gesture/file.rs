//! The gesture file: TOML, complete in itself, written by `handwave gesture define`.
//!
//! ```toml
//! handwave = "gestures"
//! version = 1
//! author = "A. Performer"                       # who made it, the terms, a note: optional, for people
//! licence = "CC-BY-4.0"
//! note = "right hand, seated"
//! points = ["palm", "thumb_tip", "index_tip"]   # what is tracked, by name
//! dim = 3                                       # coordinates per point, 2 or 3
//! # The frame to which global motion is fitted: x, y, z of every point in metres.
//! reference = [0.0131, 0.1869, 0.0144, -0.0692, 0.1825, 0.0051, -0.0494, 0.2033, -0.0571]
//!
//! # What counts as global motion (all optional).
//! [global]
//! anchor = "palm"      # the point that is the body; default: palm, else wrist, else the centroid
//! yaw = true           # remove yaw; default: yes in 3-D with three points or more
//! height = true        # remove height; default: yes with an anchor, no without
//!
//! # Settings of planes and estimators (all optional, here with their defaults).
//! [options]
//! lambda = 0.666667                # window in periods; 0.5 for a robot: faster, noisier
//! smoothing_s = 0.2                # of amplitude and frequency
//! fusion_s = 0.35                  # how fast the phase follows its estimate
//! progression_smoothing_s = 0.05   # of non-cyclic gestures
//! ridge = 0.05                     # regularisation of the planes
//! under_constrained = true         # weigh components on motions that run on a line
//!
//! [[gesture]]
//! name = "drum"
//! kind = "cyclic"                  # or "non-cyclic"
//! duration_s = 1.083               # one period, or the time from rest to extreme
//! source = "waiting.csv from 0.52 s"
//! # One row per frame: seconds since the first frame, then x, y, z of every point in metres.
//! frames = [
//!   [0.0, 0.0131, 0.1869, 0.0144, -0.0692, 0.1825, 0.0051, -0.0494, 0.2033, -0.0571],
//!   # ...
//! ]
//! ```
//! Unknown keys are errors. Lengths are written to 0.01 mm, times to 0.1 ms.

use super::{About, Gesture, GestureKind, GestureOptions, GestureSet};
use crate::pose::{GlobalOptions, PoseHeader};
use serde::Deserialize;
use std::path::Path;

/// Format version this program reads and writes.
pub const VERSION: u64 = 1;

/// Why a gesture file cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum GestureFileError {
    /// The file cannot be opened or read.
    #[error("{file}: cannot be read: {source}; `handwave gesture define` makes one")]
    Read {
        /// The file as the user named it.
        file: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file cannot be written.
    #[error("{file}: cannot be written: {source}; check the folder and its permissions")]
    Write {
        /// The file as the user named it.
        file: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// Not TOML, an unknown key or a value of the wrong type; the message has line and column.
    #[error("{file}: {message}")]
    Syntax {
        /// The file as the user named it.
        file: String,
        /// Where and what.
        message: String,
    },
    /// A value that is not allowed.
    #[error("{file}: {key}: found {found}; allowed: {allowed}")]
    Value {
        /// The file as the user named it.
        file: String,
        /// The key, as `gesture \"drum\".frames row 3`.
        key: String,
        /// What stands there.
        found: String,
        /// What may stand there.
        allowed: String,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SetTable {
    handwave: String,
    version: u64,
    author: Option<String>,
    licence: Option<String>,
    note: Option<String>,
    points: Vec<String>,
    #[serde(default = "three")]
    dim: usize,
    reference: Vec<f64>,
    #[serde(default)]
    global: GlobalTable,
    #[serde(default)]
    options: OptionsTable,
    #[serde(default)]
    gesture: Vec<GestureTable>,
}

fn three() -> usize {
    3
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct GlobalTable {
    anchor: Option<String>,
    yaw: Option<bool>,
    height: Option<bool>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct OptionsTable {
    lambda: Option<f64>,
    smoothing_s: Option<f64>,
    fusion_s: Option<f64>,
    progression_smoothing_s: Option<f64>,
    ridge: Option<f64>,
    under_constrained: Option<bool>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GestureTable {
    name: String,
    kind: KindName,
    duration_s: f64,
    #[serde(default)]
    source: String,
    frames: Vec<Vec<f64>>,
}

#[derive(Copy, Clone, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum KindName {
    Cyclic,
    NonCyclic,
}

/// Turns a flat row into places; the row is as long as it should be.
fn places(row: &[f64], dim: usize) -> Vec<[f64; 3]> {
    row.chunks(dim)
        .map(|c| {
            let mut place = [0.0; 3];
            place[..c.len()].copy_from_slice(c);
            place
        })
        .collect()
}

impl GestureSet {
    /// Reads a gesture file.
    ///
    /// # Errors
    /// Unreadable file, TOML that is wrong, values that are not allowed: file, key, found, allowed.
    pub fn load(path: &Path) -> Result<Self, GestureFileError> {
        let file = path.display().to_string();
        match std::fs::read_to_string(path) {
            Ok(text) => Self::from_toml(&text, &file),
            Err(source) => Err(GestureFileError::Read { file, source }),
        }
    }

    /// Reads a gesture file from memory; `file` is its name in messages.
    ///
    /// # Errors
    /// As [`GestureSet::load`].
    pub fn from_toml(text: &str, file: &str) -> Result<Self, GestureFileError> {
        let table: SetTable = toml::from_str(text).map_err(|error| GestureFileError::Syntax {
            file: file.into(),
            message: error.to_string().trim_end().to_owned(),
        })?;
        let value = |key: &str, found: String, allowed: &str| GestureFileError::Value {
            file: file.into(),
            key: key.into(),
            found,
            allowed: allowed.into(),
        };
        if table.handwave != "gestures" {
            return Err(value(
                "handwave",
                format!("{:?}", table.handwave),
                "\"gestures\"",
            ));
        }
        if table.version != VERSION {
            return Err(value(
                "version",
                table.version.to_string(),
                "1; a newer version needs a newer handwave",
            ));
        }
        if !(2..=3).contains(&table.dim) {
            return Err(value("dim", table.dim.to_string(), "2 or 3"));
        }
        if table.points.is_empty() {
            return Err(value("points", "none".into(), "at least one name"));
        }
        for (index, name) in table.points.iter().enumerate() {
            if name.is_empty() || table.points[..index].contains(name) {
                let allowed = "different, non-empty names";
                return Err(value("points", format!("{name:?}"), allowed));
            }
        }
        if let Some(anchor) = &table.global.anchor
            && !table.points.contains(anchor)
        {
            let allowed = format!("one of the points: {}", table.points.join(", "));
            return Err(value("global.anchor", format!("{anchor:?}"), &allowed));
        }
        let width = table.points.len() * table.dim;
        let check_row = |key: &str, row: &[f64], width: usize, what: &str| {
            if row.len() != width {
                return Err(value(
                    key,
                    format!("{} numbers", row.len()),
                    &format!("{width} numbers: {what}"),
                ));
            }
            match row.iter().find(|v| !v.is_finite() || v.abs() > 1e6) {
                Some(bad) => Err(value(key, bad.to_string(), "finite numbers in metres")),
                None => Ok(()),
            }
        };
        let what = format!("{} coordinates of each point", table.dim);
        check_row("reference", &table.reference, width, &what)?;
        let given = table.options;
        let default = GestureOptions::default();
        let options = GestureOptions {
            lambda: given.lambda.unwrap_or(default.lambda),
            smoothing_s: given.smoothing_s.unwrap_or(default.smoothing_s),
            fusion_s: given.fusion_s.unwrap_or(default.fusion_s),
            progression_smoothing_s: given
                .progression_smoothing_s
                .unwrap_or(default.progression_smoothing_s),
            ridge: given.ridge.unwrap_or(default.ridge),
            under_constrained: given.under_constrained.unwrap_or(default.under_constrained),
        };
        options.check().map_err(|(key, found, allowed)| {
            value(&format!("options.{key}"), found.to_string(), allowed)
        })?;
        let mut set = Self {
            header: PoseHeader {
                points: table.points,
                dim: table.dim,
                channels: Vec::new(),
            },
            global: GlobalOptions {
                anchor: table.global.anchor,
                yaw: table.global.yaw,
                height: table.global.height,
            },
            reference: places(&table.reference, table.dim),
            options,
            gestures: Vec::new(),
            about: About {
                author: table.author,
                licence: table.licence,
                note: table.note,
            },
        };
        for gesture in table.gesture {
            let key = |part: &str| format!("gesture {:?}.{part}", gesture.name);
            if gesture.name.is_empty() || set.index_of(&gesture.name).is_some() {
                let allowed = "a name no other gesture has";
                return Err(value(
                    "gesture.name",
                    format!("{:?}", gesture.name),
                    allowed,
                ));
            }
            if !(gesture.duration_s > 0.0 && gesture.duration_s <= 600.0) {
                let found = gesture.duration_s.to_string();
                return Err(value(&key("duration_s"), found, "seconds, above 0 to 600"));
            }
            if gesture.frames.len() < 4 {
                let found = format!("{} rows", gesture.frames.len());
                return Err(value(&key("frames"), found, "at least 4 rows"));
            }
            let mut last = f64::NEG_INFINITY;
            for (index, row) in gesture.frames.iter().enumerate() {
                let key = key(&format!("frames row {}", index + 1));
                check_row(&key, row, width + 1, &format!("time, then {what}"))?;
                let t = row[0];
                if !(t > last && t >= 0.0 && t <= gesture.duration_s + 1e-3) {
                    let allowed = "times that rise from 0 to duration_s";
                    return Err(value(&key, format!("time {t}"), allowed));
                }
                last = t;
            }
            set.gestures.push(Gesture {
                kind: match gesture.kind {
                    KindName::Cyclic => GestureKind::Cyclic,
                    KindName::NonCyclic => GestureKind::NonCyclic,
                },
                duration_s: gesture.duration_s,
                times_s: gesture.frames.iter().map(|row| row[0]).collect(),
                frames: gesture
                    .frames
                    .iter()
                    .map(|row| places(&row[1..], set.header.dim))
                    .collect(),
                name: gesture.name,
                source: gesture.source,
            });
        }
        Ok(set)
    }

    /// The set as a gesture file, the same bytes for the same set.
    pub fn to_toml(&self) -> String {
        let mut text = String::from(
            "# Gestures, written by `handwave gesture define`. Lengths in metres, times in seconds.\n",
        );
        let mut line = |line: String| {
            text.push_str(&line);
            text.push('\n');
        };
        let quoted = |name: &str| toml::Value::from(name).to_string();
        line("handwave = \"gestures\"".into());
        line(format!("version = {VERSION}"));
        let about = &self.about;
        for (key, value) in [
            ("author", &about.author),
            ("licence", &about.licence),
            ("note", &about.note),
        ] {
            if let Some(value) = value {
                line(format!("{key} = {}", quoted(value)));
            }
        }
        let names: Vec<String> = self.header.points.iter().map(|name| quoted(name)).collect();
        line(format!("points = [{}]", names.join(", ")));
        line(format!("dim = {}", self.header.dim));
        line(format!("reference = [{}]", self.row(None, &self.reference)));
        let global = &self.global;
        if *global != GlobalOptions::default() {
            line("\n[global]".into());
            if let Some(anchor) = &global.anchor {
                line(format!("anchor = {}", quoted(anchor)));
            }
            for (key, value) in [("yaw", global.yaw), ("height", global.height)] {
                if let Some(value) = value {
                    line(format!("{key} = {value}"));
                }
            }
        }
        let o = &self.options;
        line("\n[options]".into());
        for (key, value) in [
            ("lambda", o.lambda),
            ("smoothing_s", o.smoothing_s),
            ("fusion_s", o.fusion_s),
            ("progression_smoothing_s", o.progression_smoothing_s),
            ("ridge", o.ridge),
        ] {
            line(format!("{key} = {}", decimal(value, 6)));
        }
        line(format!("under_constrained = {}", o.under_constrained));
        for gesture in &self.gestures {
            line("\n[[gesture]]".into());
            line(format!("name = {}", quoted(&gesture.name)));
            line(format!("kind = \"{}\"", gesture.kind.name()));
            line(format!("duration_s = {}", decimal(gesture.duration_s, 4)));
            line(format!("source = {}", quoted(&gesture.source)));
            line("frames = [".into());
            for (t, frame) in gesture.times_s.iter().zip(&gesture.frames) {
                line(format!("  [{}],", self.row(Some(*t), frame)));
            }
            line("]".into());
        }
        text
    }

    fn row(&self, t: Option<f64>, frame: &[[f64; 3]]) -> String {
        let places = frame.iter().flat_map(|place| &place[..self.header.dim]);
        let cells: Vec<String> = t
            .map(|t| decimal(t, 4))
            .into_iter()
            .chain(places.map(|v| decimal(*v, 5)))
            .collect();
        cells.join(", ")
    }

    /// Writes the set to a gesture file. The old file stays whole until the new one is complete.
    ///
    /// # Errors
    /// Unwritable file.
    pub fn save(&self, path: &Path) -> Result<(), GestureFileError> {
        let failed = |source| GestureFileError::Write {
            file: path.display().to_string(),
            source,
        };
        let mut name = path.as_os_str().to_owned();
        name.push(".part");
        std::fs::write(&name, self.to_toml()).map_err(failed)?;
        std::fs::rename(&name, path).map_err(failed)
    }
}

/// `value` with at most `decimals` decimals and at least one, as TOML wants its floats.
fn decimal(value: f64, decimals: usize) -> String {
    let mut text = format!("{value:.decimals$}");
    while text.ends_with('0') && !text.ends_with(".0") {
        text.pop();
    }
    if text == "-0.0" { "0.0".into() } else { text }
}
