//! A gesture from one example and its marks (Rhodin 2016, section 9.3).

use super::frames::{distance, frames_of, local_of, resampled, spread};
use super::period::{PeriodEstimate, find_period};
use super::{Gesture, GestureKind, GestureSet};
use crate::pose::Recording;

/// Autocorrelation below which a motion has no period worth the name.
const PERIODIC: f64 = 0.5;
/// Half width of the stretch that is compared when looking for the end, in periods.
const COMPARED: f64 = 0.15;
/// A gesture needs this many frames.
pub(super) const FEWEST_FRAMES: usize = 4;
/// The periods the estimators can follow, in seconds.
const PERIODS_S: (f64, f64) = (1.0 / 6.0, 5.0);

/// Marks of a cyclic gesture, in seconds on the recording's clock.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct CyclicMarks {
    /// Where one period starts.
    pub start_s: f64,
    /// Where it ends; found when not given.
    pub end_s: Option<f64>,
}

/// Marks of a non-cyclic gesture, in seconds on the recording's clock.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct NonCyclicMarks {
    /// Where the pose is at rest.
    pub rest_s: f64,
    /// Where it is at its extreme; may come before the rest.
    pub extreme_s: f64,
}

/// A gesture with what its definition found out.
#[derive(Clone, Debug, PartialEq)]
pub struct Definition {
    /// The gesture, ready for [`GestureSet::put`].
    pub gesture: Gesture,
    /// Normalised autocorrelation at the period, where the period was looked for.
    pub periodicity: Option<f64>,
    /// Distance between the poses at start and end over the motion's own size (root mean square
    /// distance from its mean): 0 closes perfectly. Zero for non-cyclic gestures.
    pub closure: f64,
}

/// Why marks and recording make no gesture.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DefineError {
    /// A mark lies outside the recording, or is not a number.
    #[error(
        "--{mark} {found} s lies outside the recording, which runs from {from:.3} s to {to:.3} s"
    )]
    OutsideRecording {
        /// The mark's name.
        mark: &'static str,
        /// Its value.
        found: f64,
        /// Start of the recording.
        from: f64,
        /// End of the recording.
        to: f64,
    },
    /// The marks are in the wrong order or too close.
    #[error(
        "{frames} frames between --{first} and --{second}; a gesture needs at least {FEWEST_FRAMES}: move the marks apart, the earlier one first for cyclic gestures"
    )]
    TooShort {
        /// Name of one mark.
        first: &'static str,
        /// Name of the other.
        second: &'static str,
        /// Frames between.
        frames: usize,
    },
    /// Nothing repeats after the start mark.
    #[error(
        "a gesture without a period: after --start {start_s} s nothing repeats (autocorrelation {periodicity:.2}, needed {PERIODIC}); show two or three periods at a steady speed, or mark the end of one with --end, or use --rest and --extreme for a movement that does not repeat"
    )]
    NoPeriod {
        /// The start mark.
        start_s: f64,
        /// Highest autocorrelation found.
        periodicity: f64,
    },
    /// One period is shorter or longer than the estimators can follow.
    #[error("a period of {period_s:.3} s; allowed: {:.3} s to {} s (0.2 to 6 Hz): show it faster or slower, or correct --end", PERIODS_S.0, PERIODS_S.1)]
    PeriodOutOfRange {
        /// The period.
        period_s: f64,
    },
    /// The pose hardly differs between the marks.
    #[error(
        "the pose hardly moves between the marks ({moved_mm:.2} mm, the tracked body measures {size_mm:.0} mm): move the marks to where the gesture is performed"
    )]
    NoMotion {
        /// How far it moves, root mean square over the points, millimetres.
        moved_mm: f64,
        /// Size of the pose in millimetres.
        size_mm: f64,
    },
    /// A point of the recording is never seen.
    #[error(
        "point `{point}` is never seen in the recording; choose a recording in which every point is seen"
    )]
    NeverSeen {
        /// The point.
        point: String,
    },
    /// The recording has channels only.
    #[error(
        "the recording has no points, only channels; make points of those that the gesture moves: `handwave poses import RECORDING --as-points A,B,... --out POINTS.csv`"
    )]
    NoPoints,
    /// The set has a point that the recording does not have.
    #[error(
        "the recording has no point `{point}`, which the gesture file names; use recordings of one tracker, or start a new gesture file"
    )]
    MissingPoint {
        /// The point.
        point: String,
    },
    /// The set's anchor is none of its points.
    #[error("the gesture file's global.anchor `{anchor}` is none of its points")]
    Anchor {
        /// The anchor's name.
        anchor: String,
    },
    /// Dimension 2 against 3.
    #[error("the recording is {found}-dimensional, the gesture file {expected}-dimensional")]
    Dimension {
        /// Of the recording.
        found: usize,
        /// Of the set.
        expected: usize,
    },
}

fn check_mark(recording: &Recording, mark: &'static str, found: f64) -> Result<(), DefineError> {
    let (from, to) = recording.span_s();
    // Half a millisecond of grace: marks are often typed as they were printed.
    if found >= from - 5e-4 && found <= to + 5e-4 {
        Ok(())
    } else {
        Err(DefineError::OutsideRecording {
            mark,
            found,
            from,
            to,
        })
    }
}

/// Index of the sample nearest to `t`.
fn nearest(recording: &Recording, t: f64) -> usize {
    let after = recording.samples.partition_point(|sample| sample.t < t);
    let distance = |k: usize| {
        recording
            .samples
            .get(k)
            .map_or(f64::INFINITY, |sample| (sample.t - t).abs())
    };
    if after > 0 && distance(after - 1) <= distance(after) {
        after - 1
    } else {
        after.min(recording.samples.len().saturating_sub(1))
    }
}

fn check_motion(set: &GestureSet, moved: f64, frame: &[[f64; 3]]) -> Result<(), DefineError> {
    let moved = moved / (set.header.points.len().max(1) as f64).sqrt();
    let size = crate::pose::global::size_of(frame);
    if moved > 1e-3 * size.max(1e-4) {
        return Ok(());
    }
    Err(DefineError::NoMotion {
        moved_mm: 1e3 * moved,
        size_mm: 1e3 * size,
    })
}

/// A cyclic gesture: one period from the start mark.
///
/// Without an end mark, the period comes first, by autocorrelation of the mean-removed pose after
/// the start (the highest peak); then the end is the pose most similar to the start pose between
/// 2/3 and 4/3 of that period. Short stretches around the two are compared rather than single
/// poses: a motion on a line passes every pose twice, and only its surroundings tell which way.
///
/// # Errors
/// Marks outside the recording or too close, no period, a period that cannot be followed, a pose
/// that does not move, points that do not match the set.
pub fn define_cyclic(
    set: &GestureSet,
    recording: &Recording,
    name: &str,
    source: &str,
    marks: CyclicMarks,
) -> Result<Definition, DefineError> {
    check_mark(recording, "start", marks.start_s)?;
    match marks.end_s {
        Some(end_s) => with_end(set, recording, name, source, marks.start_s, end_s),
        None => {
            let example = Example::new(set, recording, marks.start_s)?;
            let found = example.period(marks.start_s)?;
            example.by_period(name, source, found)
        }
    }
}

/// A cyclic gesture between two marks.
pub(super) fn with_end(
    set: &GestureSet,
    recording: &Recording,
    name: &str,
    source: &str,
    start_s: f64,
    end_s: f64,
) -> Result<Definition, DefineError> {
    let example = Example::new(set, recording, start_s)?;
    check_mark(recording, "end", end_s)?;
    example.cut(name, source, end_s - example.times[example.start], None)
}

/// A cyclic gesture from its start and a period that is known already; its end is found near it.
pub(super) fn with_period(
    set: &GestureSet,
    recording: &Recording,
    name: &str,
    source: &str,
    start_s: f64,
    found: PeriodEstimate,
) -> Result<Definition, DefineError> {
    Example::new(set, recording, start_s)?.by_period(name, source, found)
}

/// A recording with the start of one period in it.
struct Example<'a> {
    set: &'a GestureSet,
    recording: &'a Recording,
    frames: Vec<Vec<[f64; 3]>>,
    local: Vec<Vec<f64>>,
    times: Vec<f64>,
    start: usize,
}

impl<'a> Example<'a> {
    fn new(
        set: &'a GestureSet,
        recording: &'a Recording,
        start_s: f64,
    ) -> Result<Self, DefineError> {
        let frames = frames_of(set, recording)?;
        let start = nearest(recording, start_s);
        Ok(Self {
            set,
            recording,
            local: local_of(set, &frames, start)?,
            frames,
            times: recording.samples.iter().map(|sample| sample.t).collect(),
            start,
        })
    }

    /// Mean step of the samples from the start on, seconds.
    fn step(&self) -> f64 {
        let samples = (self.times.len() - self.start).max(2);
        let last = self.times[self.times.len() - 1];
        ((last - self.times[self.start]) / (samples - 1) as f64).max(1e-4)
    }

    fn period(&self, start_s: f64) -> Result<PeriodEstimate, DefineError> {
        let step = self.step();
        let uniform = resampled(self.recording, &self.local, self.start, step);
        check_motion(self.set, spread(&uniform), &self.frames[self.start])?;
        let found = find_period(&uniform, step);
        found
            .filter(|found| found.periodicity >= PERIODIC)
            .ok_or(DefineError::NoPeriod {
                start_s,
                periodicity: found.map_or(0.0, |found| found.periodicity),
            })
    }

    fn by_period(
        &self,
        name: &str,
        source: &str,
        found: PeriodEstimate,
    ) -> Result<Definition, DefineError> {
        let (step, period, t0) = (self.step(), found.period_s, self.times[self.start]);
        // With what precedes the mark, as far as it is compared.
        let before = nearest(self.recording, t0 - COMPARED * period).min(self.start);
        let around = resampled(self.recording, &self.local, before, step);
        let first = ((t0 - self.times[before]) / step).round() as usize;
        let duration_s = end_of_period(&around, first, step, period);
        self.cut(name, source, duration_s, Some(found.periodicity))
    }

    fn cut(
        &self,
        name: &str,
        source: &str,
        duration_s: f64,
        periodicity: Option<f64>,
    ) -> Result<Definition, DefineError> {
        let (times, start) = (&self.times, self.start);
        let t0 = times[start];
        if !(PERIODS_S.0 * 0.97..=PERIODS_S.1 * 1.03).contains(&duration_s) {
            if duration_s <= 0.0 {
                return Err(DefineError::TooShort {
                    first: "start",
                    second: "end",
                    frames: 0,
                });
            }
            return Err(DefineError::PeriodOutOfRange {
                period_s: duration_s,
            });
        }
        let end = start + times[start..].partition_point(|t| *t < t0 + duration_s - 1e-9);
        if end - start < FEWEST_FRAMES {
            return Err(DefineError::TooShort {
                first: "start",
                second: "end",
                frames: end - start,
            });
        }
        let size = spread(&self.local[start..end]);
        check_motion(self.set, size, &self.frames[start])?;
        let closing = end.min(self.local.len() - 1);
        Ok(Definition {
            gesture: Gesture {
                name: name.into(),
                kind: GestureKind::Cyclic,
                duration_s,
                source: source.into(),
                times_s: times[start..end].iter().map(|t| t - t0).collect(),
                frames: self.frames[start..end].to_vec(),
            },
            periodicity,
            closure: distance(&self.local[start], &self.local[closing]).sqrt() / size.max(1e-12),
        })
    }
}

/// Time after row `first` at which the surroundings of that row come back.
fn end_of_period(rows: &[Vec<f64>], first: usize, step: f64, period: f64) -> f64 {
    let half = (COMPARED * period / step) as usize;
    let low = (2.0 / 3.0 * period / step).ceil() as usize;
    let high = ((4.0 / 3.0 * period / step) as usize).min(rows.len().saturating_sub(first + 1));
    let score = |lag: usize| -> f64 {
        let last = (first + half).min(rows.len() - 1 - lag);
        let stretch = first.saturating_sub(half)..=last;
        let pairs = stretch.clone().count().max(1) as f64;
        stretch
            .map(|k| distance(&rows[k], &rows[k + lag]))
            .sum::<f64>()
            / pairs
    };
    let best = (low..=high).min_by(|a, b| score(*a).total_cmp(&score(*b)));
    let Some(best) = best else {
        return period;
    };
    let mut offset = 0.0;
    if best > low && best < high {
        let (a, b, c) = (score(best - 1), score(best), score(best + 1));
        let bend = a - 2.0 * b + c;
        if bend > 0.0 {
            offset = (0.5 * (a - c) / bend).clamp(-0.5, 0.5);
        }
    }
    (best as f64 + offset) * step
}

/// A non-cyclic gesture: the frames from the rest mark to the extreme mark.
///
/// Where the extreme comes first in the recording, the frames are taken backwards in time.
///
/// # Errors
/// Marks outside the recording or too close, a pose that does not differ between them, points that
/// do not match the set.
pub fn define_non_cyclic(
    set: &GestureSet,
    recording: &Recording,
    name: &str,
    source: &str,
    marks: NonCyclicMarks,
) -> Result<Definition, DefineError> {
    check_mark(recording, "rest", marks.rest_s)?;
    check_mark(recording, "extreme", marks.extreme_s)?;
    let frames = frames_of(set, recording)?;
    let (rest, extreme) = (
        nearest(recording, marks.rest_s),
        nearest(recording, marks.extreme_s),
    );
    let count = rest.abs_diff(extreme) + 1;
    if count < FEWEST_FRAMES {
        return Err(DefineError::TooShort {
            first: "rest",
            second: "extreme",
            frames: count,
        });
    }
    let local = local_of(set, &frames, rest)?;
    check_motion(
        set,
        distance(&local[rest], &local[extreme]).sqrt(),
        &frames[rest],
    )?;
    let mut order: Vec<usize> = (rest.min(extreme)..=rest.max(extreme)).collect();
    if extreme < rest {
        order.reverse();
    }
    let t0 = recording.samples[rest].t;
    let times_s: Vec<f64> = order
        .iter()
        .map(|k| (recording.samples[*k].t - t0).abs())
        .collect();
    Ok(Definition {
        gesture: Gesture {
            name: name.into(),
            kind: GestureKind::NonCyclic,
            duration_s: times_s.last().copied().unwrap_or(0.0),
            source: source.into(),
            times_s,
            frames: order.iter().map(|k| frames[*k].clone()).collect(),
        },
        periodicity: None,
        closure: 0.0,
    })
}
