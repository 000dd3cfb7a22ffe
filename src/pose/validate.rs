//! What makes a sample bad, how bad samples are counted, and when there are too many of them.

use super::PoseSample;
use std::fmt;

/// Longest line (or datagram) that is read as a sample, in bytes, without the line end.
pub const MAX_LINE_BYTES: usize = 64 * 1024;

/// This many bad samples in a row end the stream with an error.
pub const MAX_BAD_IN_A_ROW: u32 = 10;

/// Why one sample was dropped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SampleFault {
    /// The line is longer than [`MAX_LINE_BYTES`].
    #[error("the line is longer than 64 KiB")]
    LineTooLong,
    /// The line is not a sample of this stream's format.
    #[error("not a sample: {detail}")]
    Malformed {
        /// What the parser did not like.
        detail: String,
    },
    /// The number of points (or confidences, or columns) is not the header's.
    #[error("{found} points, the header names {expected}")]
    PointCount {
        /// Points in the sample.
        found: usize,
        /// Points in the header.
        expected: usize,
    },
    /// A time, coordinate, confidence or channel is NaN or infinite.
    #[error("a number is not finite")]
    NonFinite,
    /// The time is not later than that of the last good sample.
    #[error("time runs backwards: {t} s after {last} s")]
    TimeBackwards {
        /// Time of the sample in seconds.
        t: f64,
        /// Time of the last good sample in seconds.
        last: f64,
    },
    /// So few points were seen that the pose cannot be told.
    #[error("only {seen} of {needed} needed points were seen")]
    TooFewPoints {
        /// Points seen.
        seen: usize,
        /// Points needed.
        needed: usize,
    },
}

/// How many samples were dropped, by reason.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub struct FaultCounts {
    /// Lines over 64 KiB.
    pub line_too_long: u64,
    /// Lines that are no sample.
    pub malformed: u64,
    /// Samples with another number of points than the header.
    pub point_count: u64,
    /// Samples with a NaN or infinite number.
    pub non_finite: u64,
    /// Samples not later than the one before.
    pub time_backwards: u64,
    /// Samples with too few points seen.
    pub too_few_points: u64,
}

impl FaultCounts {
    /// Counts one dropped sample.
    pub fn add(&mut self, fault: &SampleFault) {
        *match fault {
            SampleFault::LineTooLong => &mut self.line_too_long,
            SampleFault::Malformed { .. } => &mut self.malformed,
            SampleFault::PointCount { .. } => &mut self.point_count,
            SampleFault::NonFinite => &mut self.non_finite,
            SampleFault::TimeBackwards { .. } => &mut self.time_backwards,
            SampleFault::TooFewPoints { .. } => &mut self.too_few_points,
        } += 1;
    }

    /// Reason and count, in a fixed order.
    pub fn by_reason(&self) -> [(&'static str, u64); 6] {
        [
            ("line_too_long", self.line_too_long),
            ("malformed", self.malformed),
            ("point_count", self.point_count),
            ("non_finite", self.non_finite),
            ("time_backwards", self.time_backwards),
            ("too_few_points", self.too_few_points),
        ]
    }

    /// All dropped samples.
    pub fn total(&self) -> u64 {
        self.by_reason().iter().map(|(_, count)| count).sum()
    }
}

impl fmt::Display for FaultCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut first = true;
        for (reason, count) in self.by_reason() {
            if count > 0 {
                write!(f, "{}{count} {reason}", if first { "" } else { ", " })?;
                first = false;
            }
        }
        if first { f.write_str("none") } else { Ok(()) }
    }
}

/// A dropped sample and where it stood.
#[derive(Clone, Debug, PartialEq)]
pub struct BadSample {
    /// Line (or datagram) number, from 1.
    pub line: u64,
    /// Why it was dropped.
    pub fault: SampleFault,
}

/// Judges samples one by one; every source uses one, so all sources drop for the same reasons.
#[derive(Clone, Debug)]
pub struct Validator {
    points: usize,
    last_t: Option<f64>,
    accepted: u64,
    counts: FaultCounts,
    in_a_row: u32,
    first_bad: Option<BadSample>,
}

impl Validator {
    /// A validator for samples of `points` points.
    pub fn new(points: usize) -> Self {
        Self {
            points,
            last_t: None,
            accepted: 0,
            counts: FaultCounts::default(),
            in_a_row: 0,
            first_bad: None,
        }
    }

    /// Whether `sample` may follow what was admitted so far. Changes nothing, allocates nothing.
    ///
    /// # Errors
    /// Point count, non-finite number, or a time that is not later than the last admitted one.
    pub fn check(&self, sample: &PoseSample) -> Result<(), SampleFault> {
        if sample.points.len() != self.points {
            return Err(SampleFault::PointCount {
                found: sample.points.len(),
                expected: self.points,
            });
        }
        if !sample.confidence.is_empty() && sample.confidence.len() != self.points {
            return Err(SampleFault::PointCount {
                found: sample.confidence.len(),
                expected: self.points,
            });
        }
        let finite = sample.t.is_finite()
            && sample
                .points
                .iter()
                .flatten()
                .flatten()
                .chain(&sample.confidence)
                .chain(sample.channels.iter().flatten())
                .all(|value| value.is_finite());
        if !finite {
            return Err(SampleFault::NonFinite);
        }
        match self.last_t {
            Some(last) if sample.t <= last => Err(SampleFault::TimeBackwards { t: sample.t, last }),
            _ => Ok(()),
        }
    }

    /// Records the outcome for the sample at `line`: [`check`](Self::check)'s, or the parser's.
    ///
    /// Returns whether the sample passes.
    ///
    /// # Errors
    /// The first bad sample of the row, when this was the tenth in a row.
    pub fn note(
        &mut self,
        line: u64,
        outcome: Result<f64, SampleFault>,
    ) -> Result<bool, BadSample> {
        match outcome {
            Ok(t) => {
                self.last_t = Some(t);
                self.accepted += 1;
                self.in_a_row = 0;
                self.first_bad = None;
                Ok(true)
            }
            Err(fault) => {
                self.counts.add(&fault);
                self.in_a_row += 1;
                let first = self.first_bad.get_or_insert(BadSample { line, fault });
                if self.in_a_row >= MAX_BAD_IN_A_ROW {
                    return Err(first.clone());
                }
                Ok(false)
            }
        }
    }

    /// Samples that passed.
    pub fn accepted(&self) -> u64 {
        self.accepted
    }

    /// Samples that were dropped, by reason.
    pub fn counts(&self) -> &FaultCounts {
        &self.counts
    }

    /// Time of the last sample that passed, in seconds.
    pub fn last_t(&self) -> Option<f64> {
        self.last_t
    }
}
