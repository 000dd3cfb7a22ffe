//! Live Link Face recordings (CSV): the 52 ARKit blendshapes of a face as channels, no points.
//!
//! ```text
//! Timecode,BlendShapeCount,EyeBlinkLeft,...,TongueOut,HeadYaw,...,RightEyeRoll
//! 13:13:04:31.652,61,0.1236470118,...
//! ```
//! The time code is hours, minutes, seconds and frames of 1/60 s with a fraction, whatever the
//! rate of recording. Blendshapes are 0 at rest and 1 at their extreme; what the tracker lets run
//! over is clamped. Rotations of head and eyes (radians) are left out unless asked for: most takes
//! hold none.

use super::json::shown;
use super::{LineFault, PoseHeader, PoseSample, Recording};

/// Frames of the time code in a second.
const FRAMES_PER_S: f64 = 60.0;

/// The columns before the channels.
const FIRST_COLUMNS: [&str; 2] = ["Timecode", "BlendShapeCount"];

/// Ends of the names of columns that are angles, radians.
const ROTATIONS: [&str; 3] = ["Yaw", "Pitch", "Roll"];

/// Time codes of one day, seconds.
const DAY_S: f64 = 86_400.0;

/// Whether `text` looks like a Live Link Face recording.
pub fn is_live_link(text: &str) -> bool {
    let line = text.lines().next().unwrap_or_default();
    let mut cells = line.trim_start_matches('\u{feff}').split(',');
    FIRST_COLUMNS
        .iter()
        .all(|name| cells.next().is_some_and(|cell| cell.trim() == *name))
}

/// Reads a Live Link Face recording; with `rotations` also the angles of head and eyes.
///
/// Channels are named as in the file. Time starts at 0 and may pass midnight; rows not later than
/// the one before are dropped. A row without a face (no blendshapes counted) has no values.
///
/// # Errors
/// The first line that is not as it should be; another header; no row.
pub fn parse(text: &str, rotations: bool) -> Result<Recording, LineFault> {
    let fault = |line: usize, found: String, allowed: &str| LineFault {
        line: line as u64 + 1,
        found,
        allowed: allowed.into(),
    };
    let mut lines = text
        .trim_start_matches('\u{feff}')
        .lines()
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty());
    let (_, header) = lines.next().unwrap_or_default();
    if !is_live_link(header) {
        return Err(fault(
            0,
            shown(header),
            "a first line `Timecode,BlendShapeCount,EyeBlinkLeft,...` as Live Link Face writes it",
        ));
    }
    let names: Vec<&str> = header.split(',').map(str::trim).collect();
    let is_rotation = |name: &str| ROTATIONS.iter().any(|end| name.ends_with(end));
    let columns: Vec<usize> = (FIRST_COLUMNS.len()..names.len())
        .filter(|index| !names[*index].is_empty() && (rotations || !is_rotation(names[*index])))
        .collect();
    let mut samples: Vec<PoseSample> = Vec::new();
    let mut start = None;
    let mut days = 0.0;
    let mut last_stamp = f64::NEG_INFINITY;
    for (number, line) in lines {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let allowed = "hours:minutes:seconds:frames, such as 13:13:04:31.652, frames below 60";
        let stamp = timecode(cells[0]).ok_or_else(|| fault(number, shown(cells[0]), allowed))?;
        if stamp < last_stamp - 0.5 * DAY_S {
            days += 1.0;
        }
        last_stamp = stamp;
        let stamp = stamp + days * DAY_S;
        let t = stamp - *start.get_or_insert(stamp);
        if samples.last().is_some_and(|last| t <= last.t) {
            continue;
        }
        let count = cells.get(1).copied().unwrap_or_default();
        let channels = if count == "0" {
            vec![None; columns.len()]
        } else if cells.len() == names.len() {
            let value = |column: &usize| {
                let cell = cells[*column];
                let number = cell.parse().ok().filter(|value: &f64| value.is_finite());
                number
                    .map(|value| match is_rotation(names[*column]) {
                        true => Some(value),
                        false => Some(value.clamp(0.0, 1.0)),
                    })
                    .ok_or_else(|| format!("{} in column {}", shown(cell), names[*column]))
            };
            let read: Result<Vec<_>, String> = columns.iter().map(value).collect();
            read.map_err(|found| fault(number, found, "a number in every column"))?
        } else {
            return Err(fault(
                number,
                format!("{} columns", cells.len()),
                &format!("{} columns as in the first line", names.len()),
            ));
        };
        samples.push(PoseSample {
            t,
            points: Vec::new(),
            confidence: Vec::new(),
            channels,
        });
    }
    if samples.is_empty() {
        return Err(fault(0, "no row after the first line".into(), "rows"));
    }
    Ok(Recording {
        header: PoseHeader {
            points: Vec::new(),
            dim: 3,
            channels: columns.iter().map(|index| names[*index].into()).collect(),
        },
        samples,
    })
}

/// Seconds since midnight of a time code `HH:MM:SS:FF.fff`.
fn timecode(cell: &str) -> Option<f64> {
    let mut parts = cell.split(':');
    let mut seconds = 0.0;
    for (worth_s, below) in [(3600.0, 24.0), (60.0, 60.0), (1.0, 60.0)] {
        let value: u32 = parts.next()?.parse().ok()?;
        let value = f64::from(value);
        seconds += worth_s * Some(value).filter(|value| *value < below)?;
    }
    let frames: f64 = parts.next()?.parse().ok()?;
    let in_range = (0.0..FRAMES_PER_S).contains(&frames) && parts.next().is_none();
    in_range.then_some(seconds + frames / FRAMES_PER_S)
}
