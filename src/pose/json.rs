//! The JSON Lines form of a pose stream: one object a line, a header object first.
//!
//! ```text
//! {"handwave":"poses","version":1,"points":["wrist","thumb_tip"],"dim":3,"unit":"m"}
//! {"t":0.0000,"p":[[0.1,0.2,0.3],null],"c":[1.0,0.0],"ch":{"emotion":0.4}}
//! ```
//! `unit` is `m` (default) or `mm`; lengths are metres after parsing. A `null` point was not seen.
//! The header may list extra scalar channels as `"channels":["emotion"]`; names that only turn
//! up in a sample's `ch` are added as they come. A stream may have channels alone (`"points":[]`,
//! blendshapes of a face): its samples need no `p`.

use super::{PoseHeader, PoseSample, SampleFault};
use serde::Deserialize;
use std::collections::BTreeMap;

/// Format version this program reads and writes.
pub const VERSION: u64 = 1;

/// Channels a stream may have; names beyond are ignored, so a hostile stream cannot grow memory.
const MAX_CHANNELS: usize = 64;

/// A header line that is not one: what was found, what is allowed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeaderFault {
    /// What stands in the line.
    pub found: String,
    /// What may stand there.
    pub allowed: String,
}

/// A parsed header: names and dimension, and metres per unit of length.
#[derive(Clone, Debug, PartialEq)]
pub struct JsonHeader {
    /// Names and dimension.
    pub header: PoseHeader,
    /// 1 for metres, 0.001 for millimetres.
    pub metres_per_unit: f64,
}

fn fault(found: impl Into<String>, allowed: impl Into<String>) -> HeaderFault {
    HeaderFault {
        found: found.into(),
        allowed: allowed.into(),
    }
}

/// At most 60 characters of a line, for messages.
pub(super) fn shown(line: &str) -> String {
    let cut: String = line.chars().take(60).collect();
    if cut.len() < line.len() {
        format!("`{cut}...`")
    } else {
        format!("`{cut}`")
    }
}

/// Whether `line` claims to be a header (it has the key `handwave`).
pub fn looks_like_header(line: &str) -> bool {
    line.trim_start().starts_with('{') && line.contains("\"handwave\"")
}

/// Reads the header line.
///
/// # Errors
/// What was found and what is allowed: not JSON, another kind of file, a newer version, no or
/// repeated point names, a dimension other than 2 and 3, an unknown unit.
pub fn parse_header(line: &str) -> Result<JsonHeader, HeaderFault> {
    let example = r#"a first line like {"handwave":"poses","version":1,"points":["palm"],"dim":3,"unit":"m"}"#;
    let value: serde_json::Value =
        serde_json::from_str(line).map_err(|_| fault(shown(line), example))?;
    match value.get("handwave").and_then(|kind| kind.as_str()) {
        Some("poses") => {}
        Some(other) => return Err(fault(format!("handwave = {other:?}"), "\"poses\"")),
        None => return Err(fault(shown(line), example)),
    }
    if value.get("version").and_then(serde_json::Value::as_u64) != Some(VERSION) {
        let found = value
            .get("version")
            .map_or("no version".into(), |v| format!("version {v}"));
        return Err(fault(
            found,
            "version 1; a newer version needs a newer handwave",
        ));
    }
    let names = |key: &str| -> Result<Vec<String>, HeaderFault> {
        let allowed = format!("{key}: a list of different, non-empty names");
        let Some(list) = value.get(key) else {
            return Ok(Vec::new());
        };
        let list: Vec<String> = Vec::deserialize(list)
            .map_err(|_| fault(format!("{key} = {}", shown(&list.to_string())), &allowed))?;
        check_names(&list).map_err(|found| fault(found, allowed))?;
        Ok(list)
    };
    let points = names("points")?;
    let mut channels = names("channels")?;
    if points.is_empty() && channels.is_empty() {
        return Err(fault(
            "no points",
            "points: at least one name, or none and the names of channels",
        ));
    }
    channels.truncate(MAX_CHANNELS);
    let dim = match value.get("dim").map_or(Some(3), serde_json::Value::as_u64) {
        Some(dim @ (2 | 3)) => dim as usize,
        _ => {
            let found = value
                .get("dim")
                .map(ToString::to_string)
                .unwrap_or_default();
            return Err(fault(format!("dim = {found}"), "2 or 3"));
        }
    };
    let metres_per_unit = match value.get("unit") {
        None => 1.0,
        Some(unit) => match unit.as_str() {
            Some("m") => 1.0,
            Some("mm") => 0.001,
            _ => {
                return Err(fault(
                    format!("unit = {unit}"),
                    "\"m\" (metres) or \"mm\" (millimetres)",
                ));
            }
        },
    };
    Ok(JsonHeader {
        header: PoseHeader {
            points,
            dim,
            channels,
        },
        metres_per_unit,
    })
}

/// Refuses empty and repeated names; the error says which.
pub(super) fn check_names(names: &[String]) -> Result<(), String> {
    for (index, name) in names.iter().enumerate() {
        if name.trim().is_empty() {
            return Err("an empty name".into());
        }
        if names[..index].contains(name) {
            return Err(format!("`{name}` twice"));
        }
    }
    Ok(())
}

#[derive(Deserialize)]
struct SampleLine {
    t: f64,
    p: Option<Vec<Option<Vec<Option<f64>>>>>,
    c: Option<Vec<f64>>,
    ch: Option<BTreeMap<String, Option<f64>>>,
}

/// Reads one sample line into `sample` (re-using its memory).
///
/// Channel names unknown so far are appended to the header's channels.
///
/// # Errors
/// Not JSON or not a sample; wrong point count; a number JSON cannot hold (NaN, infinity, 1e999).
pub fn parse_sample(
    line: &str,
    stream: &mut JsonHeader,
    sample: &mut PoseSample,
) -> Result<(), SampleFault> {
    let parsed: SampleLine = serde_json::from_str(line).map_err(|error| {
        // JSON has no word for these; programs write them all the same.
        let text = error.to_string();
        if text.contains("number out of range") || line.contains("NaN") || line.contains("Infinity")
        {
            SampleFault::NonFinite
        } else {
            SampleFault::Malformed { detail: text }
        }
    })?;
    let header = &mut stream.header;
    let points = match parsed.p {
        Some(points) => points,
        // A stream of channels alone needs no points.
        None if header.points.is_empty() => Vec::new(),
        None => {
            return Err(SampleFault::Malformed {
                detail: "no `p`, the points".into(),
            });
        }
    };
    if points.len() != header.points.len() {
        return Err(SampleFault::PointCount {
            found: points.len(),
            expected: header.points.len(),
        });
    }
    sample.t = parsed.t;
    sample.points.clear();
    for (index, point) in points.iter().enumerate() {
        let Some(coordinates) = point else {
            sample.points.push(None);
            continue;
        };
        if coordinates.len() != header.dim {
            return Err(SampleFault::Malformed {
                detail: format!(
                    "point {} has {} coordinates, the header says {}",
                    header.points[index],
                    coordinates.len(),
                    header.dim
                ),
            });
        }
        // A page writes NaN as null: a point with such a coordinate was not seen.
        let mut place = Some([0.0; 3]);
        for (axis, coordinate) in coordinates.iter().enumerate() {
            match (&mut place, coordinate) {
                (Some(place), Some(value)) => place[axis] = value * stream.metres_per_unit,
                _ => place = None,
            }
        }
        sample.points.push(place);
    }
    sample.confidence.clear();
    sample.confidence.extend(parsed.c.iter().flatten());
    sample.channels.clear();
    sample.channels.resize(header.channels.len(), None);
    for (name, value) in parsed.ch.into_iter().flatten() {
        match header.channels.iter().position(|known| *known == name) {
            Some(index) => sample.channels[index] = value,
            None if header.channels.len() < MAX_CHANNELS && !name.trim().is_empty() => {
                header.channels.push(name);
                sample.channels.push(value);
            }
            None => {}
        }
    }
    Ok(())
}
