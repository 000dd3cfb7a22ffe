//! The CSV form of a pose stream: a header row, one sample a row, metres.
//!
//! ```text
//! t,wrist.x,wrist.y,wrist.z,thumb_tip.x,thumb_tip.y,thumb_tip.z,ch.emotion
//! 0.0000,0.1,0.2,0.3,,,,0.4
//! ```
//! Two columns a point (`x`, `y`) make a 2-D stream. An empty cell: not seen. A stream may have
//! channels alone: `t,ch.JawOpen`.

use super::json::{HeaderFault, check_names, shown};
use super::{PoseHeader, PoseSample, SampleFault};

const EXAMPLE: &str = "t,NAME.x,NAME.y[,NAME.z],...[,ch.CHANNEL,...], all points with the same axes, channels last; other recordings come in with `handwave poses import`";

/// Reads the header row.
///
/// # Errors
/// What was found and what is allowed.
pub fn parse_header(line: &str) -> Result<PoseHeader, HeaderFault> {
    let fault = |found: String| HeaderFault {
        found,
        allowed: EXAMPLE.into(),
    };
    let mut cells = line.trim_start_matches('\u{feff}').split(',').map(unquote);
    if cells.next() != Some("t") {
        return Err(fault(format!(
            "{} (the first column is not t)",
            shown(line)
        )));
    }
    let mut header = PoseHeader {
        points: Vec::new(),
        dim: 0,
        channels: Vec::new(),
    };
    // Axes seen of the point that is being read.
    let mut axes = 0;
    let close = |header: &mut PoseHeader, axes: usize| -> Result<(), HeaderFault> {
        if header.points.is_empty() {
            return Ok(());
        }
        if header.dim == 0 {
            header.dim = axes;
        }
        if axes != header.dim || !(2..=3).contains(&axes) {
            let name = header.points.last().map_or("", String::as_str);
            return Err(fault(format!("{axes} axes of point {name}")));
        }
        Ok(())
    };
    for cell in cells {
        if let Some(channel) = cell.strip_prefix("ch.") {
            header.channels.push(channel.into());
            continue;
        }
        let Some((name, axis)) = cell.rsplit_once('.') else {
            return Err(fault(format!("column `{cell}`")));
        };
        if !header.channels.is_empty() {
            return Err(fault(format!("point column `{cell}` after a channel")));
        }
        if axis == "x" {
            close(&mut header, axes)?;
            header.points.push(name.into());
            axes = 1;
            continue;
        }
        let expected = ["x", "y", "z"].get(axes).copied().unwrap_or("");
        if axis != expected || header.points.last().map(String::as_str) != Some(name) {
            return Err(fault(format!("column `{cell}` out of order")));
        }
        axes += 1;
    }
    close(&mut header, axes)?;
    if header.points.is_empty() {
        if header.channels.is_empty() {
            return Err(fault("no points and no channels".into()));
        }
        header.dim = 3;
    }
    check_names(&header.points).map_err(fault)?;
    check_names(&header.channels).map_err(fault)?;
    Ok(header)
}

fn unquote(cell: &str) -> &str {
    let cell = cell.trim();
    cell.strip_prefix('"')
        .and_then(|inner| inner.strip_suffix('"'))
        .unwrap_or(cell)
}

/// Reads one row into `sample` (re-using its memory).
///
/// # Errors
/// Wrong number of cells, a cell that is no number.
pub fn parse_sample(
    line: &str,
    header: &PoseHeader,
    sample: &mut PoseSample,
) -> Result<(), SampleFault> {
    let columns = 1 + header.points.len() * header.dim + header.channels.len();
    let found = line.split(',').count();
    if found != columns {
        let beside = 1 + header.channels.len();
        return Err(SampleFault::PointCount {
            found: found.saturating_sub(beside) / header.dim.max(1),
            expected: header.points.len(),
        });
    }
    let mut cells = line.split(',').map(|cell| {
        let cell = unquote(cell);
        if cell.is_empty() {
            return Ok(None);
        }
        cell.parse::<f64>()
            .map(Some)
            .map_err(|_| SampleFault::Malformed {
                detail: format!("{} is not a number", shown(cell)),
            })
    });
    let mut next = || cells.next().unwrap_or(Ok(None));
    sample.t = next()?.ok_or_else(|| SampleFault::Malformed {
        detail: "no time".into(),
    })?;
    sample.points.clear();
    for _ in &header.points {
        let mut place = Some([0.0; 3]);
        for axis in 0..header.dim {
            match (&mut place, next()?) {
                (Some(place), Some(value)) => place[axis] = value,
                _ => place = None,
            }
        }
        sample.points.push(place);
    }
    sample.confidence.clear();
    sample.channels.clear();
    for _ in &header.channels {
        sample.channels.push(next()?);
    }
    Ok(())
}
