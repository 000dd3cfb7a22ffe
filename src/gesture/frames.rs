//! A recording's frames as a gesture set sees them: its points, no gaps, no global motion, even steps.

use super::{DefineError, GestureSet};
use crate::pose::{GlobalFit, PoseHeader, Recording};

/// Longest stretch after the start mark that is looked at, in seconds: several of the longest
/// periods.
const STRETCH_S: f64 = 20.0;

/// Index in a stream with `header` of each point of the set.
pub(super) fn columns_of(set: &GestureSet, header: &PoseHeader) -> Result<Vec<usize>, DefineError> {
    if header.points.is_empty() {
        return Err(DefineError::NoPoints);
    }
    if header.dim != set.header.dim {
        return Err(DefineError::Dimension {
            found: header.dim,
            expected: set.header.dim,
        });
    }
    let find = |name: &String| {
        let missing = || DefineError::MissingPoint {
            point: name.clone(),
        };
        header
            .points
            .iter()
            .position(|p| p == name)
            .ok_or_else(missing)
    };
    set.header.points.iter().map(find).collect()
}

/// The recording's frames in the order of the set's points, gaps filled.
pub(super) fn frames_of(
    set: &GestureSet,
    recording: &Recording,
) -> Result<Vec<Vec<[f64; 3]>>, DefineError> {
    let columns = columns_of(set, &recording.header)?;
    let filled = recording
        .filled()
        .map_err(|point| DefineError::NeverSeen { point })?;
    Ok(filled
        .into_iter()
        .map(|row| columns.iter().map(|column| row[*column]).collect())
        .collect())
}

/// Poses without global motion, flat, fitted to the frame at `reference`.
pub(super) fn local_of(
    set: &GestureSet,
    frames: &[Vec<[f64; 3]>],
    reference: usize,
) -> Result<Vec<Vec<f64>>, DefineError> {
    let home = frames.get(reference).map_or(&[][..], Vec::as_slice);
    let fit = GlobalFit::new(&set.header, home, &set.global)
        .map_err(|anchor| DefineError::Anchor { anchor })?;
    let mut out = vec![[0.0; 3]; set.header.points.len()];
    Ok(frames
        .iter()
        .map(|frame| {
            fit.remove(frame, None, &mut out);
            out.iter().flatten().copied().collect()
        })
        .collect())
}

pub(super) fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// The local poses at uniform steps from sample `from` on.
pub(super) fn resampled(
    recording: &Recording,
    local: &[Vec<f64>],
    from: usize,
    step: f64,
) -> Vec<Vec<f64>> {
    let start = recording.samples[from].t;
    let end = recording.span_s().1.min(start + STRETCH_S);
    let count = ((end - start) / step) as usize + 1;
    let mut k = from;
    (0..count)
        .map(|i| {
            let t = start + i as f64 * step;
            while k + 2 < recording.samples.len() && recording.samples[k + 1].t <= t {
                k += 1;
            }
            let next = (k + 1).min(local.len() - 1);
            let span = recording.samples[next].t - recording.samples[k].t;
            let u = if span > 0.0 {
                ((t - recording.samples[k].t) / span).clamp(0.0, 1.0)
            } else {
                0.0
            };
            (local[k].iter().zip(&local[next]))
                .map(|(a, b)| a + u * (b - a))
                .collect()
        })
        .collect()
}

/// Root mean square distance of rows from their mean.
pub(super) fn spread(rows: &[Vec<f64>]) -> f64 {
    let dim = rows.first().map_or(0, Vec::len);
    let n = rows.len().max(1) as f64;
    let mean: Vec<f64> = (0..dim)
        .map(|axis| rows.iter().map(|row| row[axis]).sum::<f64>() / n)
        .collect();
    (rows.iter().map(|row| distance(row, &mean)).sum::<f64>() / n).sqrt()
}
