//! What makes a sample bad, how bad samples are counted, and when there are too many of them.

use super::PoseSample;
use std::fmt;

/// Longest line (or datagram) that is read as a sample, in bytes, without the line end.
pub const MAX_LINE_BYTES: usize = 64 * 1024;

/// This many bad samples in a row end the stream with an error.
pub const MAX_BAD_IN_A_ROW: u32 = 10;

/// A sample this much later than the last good one, in seconds, is dropped unless the next confirms
/// its time: by itself it is a wrong stamp, not a pause.
pub const LONGEST_JUMP_S: f64 = 30.0;

/// No tracker takes longer than this from sample to sample, in seconds: [`MAX_BAD_IN_A_ROW`] longer
/// steps in a row mean that the stamps are in another unit (milliseconds, microseconds).
pub const LONGEST_STEP_S: f64 = 2.0;

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
    /// The time is far later than that of the last good sample: over [`LONGEST_JUMP_S`] and not
    /// confirmed, or the last of many steps over [`LONGEST_STEP_S`].
    #[error("time jumps by {} s; t is in seconds", short(t - last))]
    TimeJump {
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

/// A number of seconds in few digits, however large.
fn short(seconds: f64) -> String {
    if seconds < 1e9 {
        ((seconds * 1e3).round() / 1e3).to_string()
    } else {
        format!("{seconds:.3e}")
    }
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
    /// Samples far later than the one before.
    pub time_jump: u64,
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
            SampleFault::TimeJump { .. } => &mut self.time_jump,
            SampleFault::TooFewPoints { .. } => &mut self.too_few_points,
        } += 1;
    }

    /// Reason and count, in a fixed order.
    pub fn by_reason(&self) -> [(&'static str, u64); 7] {
        [
            ("line_too_long", self.line_too_long),
            ("malformed", self.malformed),
            ("point_count", self.point_count),
            ("non_finite", self.non_finite),
            ("time_backwards", self.time_backwards),
            ("time_jump", self.time_jump),
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
///
/// Time must rise. A jump forward of over [`LONGEST_JUMP_S`] drops the sample; when the next one
/// stands at most [`LONGEST_JUMP_S`] after the dropped one, time goes on from there. So one wild
/// stamp costs one sample, and so does a long pause. Ten bad samples in a row end the stream, and so
/// do ten steps in a row of over [`LONGEST_STEP_S`], which is what stamps in milliseconds look like.
#[derive(Clone, Debug)]
pub struct Validator {
    points: usize,
    last_t: Option<f64>,
    /// Time of the jumped sample that the next one may confirm.
    jumped_t: Option<f64>,
    /// Time of the last sample that had a time, good or bad.
    stamp: Option<f64>,
    long_steps: u32,
    first_long: Option<BadSample>,
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
            jumped_t: None,
            stamp: None,
            long_steps: 0,
            first_long: None,
            accepted: 0,
            counts: FaultCounts::default(),
            in_a_row: 0,
            first_bad: None,
        }
    }

    /// Whether `sample` may follow what was admitted so far. Changes nothing, allocates nothing.
    ///
    /// # Errors
    /// Point count, non-finite number, a time that is not later than the last admitted one, or one
    /// that is over [`LONGEST_JUMP_S`] later and not confirmed.
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
        let t = sample.t;
        let follows = |earlier: f64| t > earlier && t - earlier <= LONGEST_JUMP_S;
        match self.last_t {
            Some(last) if t <= last => Err(SampleFault::TimeBackwards { t, last }),
            Some(last) if !follows(last) && !self.jumped_t.is_some_and(follows) => {
                Err(SampleFault::TimeJump { t, last })
            }
            _ => Ok(()),
        }
    }

    /// Records the outcome for the sample at `line`: [`check`](Self::check)'s, or the parser's.
    ///
    /// Returns whether the sample passes.
    ///
    /// # Errors
    /// The first bad sample of the row, when this was the tenth in a row; the first after a step of
    /// over [`LONGEST_STEP_S`], when this was the tenth such step in a row.
    pub fn note(
        &mut self,
        line: u64,
        outcome: Result<f64, SampleFault>,
    ) -> Result<bool, BadSample> {
        if let Some(first) = self.too_slow(line, &outcome) {
            self.counts.add(&first.fault);
            return Err(first);
        }
        match outcome {
            Ok(t) => {
                self.jumped_t = None;
                self.last_t = Some(t);
                self.accepted += 1;
                self.in_a_row = 0;
                self.first_bad = None;
                Ok(true)
            }
            Err(fault) => {
                self.counts.add(&fault);
                if let SampleFault::TimeJump { t, .. } = fault {
                    self.jumped_t = Some(t);
                }
                self.in_a_row += 1;
                let first = self.first_bad.get_or_insert(BadSample { line, fault });
                if self.in_a_row >= MAX_BAD_IN_A_ROW {
                    return Err(first.clone());
                }
                Ok(false)
            }
        }
    }

    /// Counts steps of over [`LONGEST_STEP_S`]; the first of the row when there are too many.
    fn too_slow(&mut self, line: u64, outcome: &Result<f64, SampleFault>) -> Option<BadSample> {
        let t = match outcome {
            Ok(t) | Err(SampleFault::TimeJump { t, .. } | SampleFault::TimeBackwards { t, .. }) => {
                *t
            }
            Err(_) => return None,
        };
        let last = self.stamp.replace(t)?;
        if t - last <= LONGEST_STEP_S {
            self.long_steps = 0;
            self.first_long = None;
            return None;
        }
        self.long_steps += 1;
        let fault = SampleFault::TimeJump { t, last };
        let first = self.first_long.get_or_insert(BadSample { line, fault });
        (self.long_steps >= MAX_BAD_IN_A_ROW).then(|| first.clone())
    }

    /// Forgets the time and the bad samples in a row, as for a new stream; the counts go on.
    pub fn begin_anew(&mut self) {
        *self = Self {
            accepted: self.accepted,
            counts: self.counts,
            ..Self::new(self.points)
        };
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Times that pass and the counts, or the first bad sample of the row that ended it.
    fn run(times: impl IntoIterator<Item = f64>) -> Result<(Vec<f64>, FaultCounts), BadSample> {
        let mut validator = Validator::new(0);
        let mut passed = Vec::new();
        for (line, t) in (1..).zip(times) {
            let sample = PoseSample {
                t,
                ..PoseSample::default()
            };
            let outcome = validator.check(&sample).map(|()| t);
            if validator.note(line, outcome)? {
                passed.push(t);
            }
        }
        Ok((passed, *validator.counts()))
    }

    #[test]
    fn one_wild_stamp_costs_one_sample() {
        for wild in [-1e300, -5.0, 31.0, 1e9, 1e300, f64::MAX] {
            let (passed, counts) =
                run([0.0, 0.1, wild, 0.2, 0.3, 0.4]).expect("never ten bad in a row");
            assert_eq!(passed, [0.0, 0.1, 0.2, 0.3, 0.4], "{wild:e}");
            assert_eq!(counts.time_jump, u64::from(wild > 0.0), "{counts}");
            assert_eq!(counts.total(), 1, "{counts}");
        }
    }

    #[test]
    fn a_long_pause_costs_one_sample_and_a_short_one_none() {
        let (passed, counts) = run([0.0, 0.1, 60.0, 60.1, 60.2]).expect("time is confirmed");
        assert_eq!(passed, [0.0, 0.1, 60.1, 60.2]);
        assert_eq!((counts.time_jump, counts.total()), (1, 1));
        let (passed, counts) = run([0.0, 0.1, 30.0, 30.1]).expect("a pause");
        assert_eq!((passed.len(), counts.total()), (4, 0));
    }

    #[test]
    fn stamps_in_another_unit_end_with_the_step() {
        // Milliseconds at 400, 108, 33 (on both sides of the limit) and 20 Hz, microseconds.
        for step in [2.5, 9.25, 30.5, 50.0, 9250.0, 33_333.0] {
            for jitter in [0.0, 0.08] {
                let times = (0..40).map(|k| {
                    let k = f64::from(k);
                    step * (k + jitter * (7.0 * k).sin())
                });
                let first = run(times).expect_err("no tracker is that slow");
                assert_eq!(first.line, 2, "{step}: {first:?}");
                let message = first.fault.to_string();
                assert!(message.ends_with("t is in seconds"), "{message}");
                if jitter == 0.0 {
                    assert!(message.contains(&format!("by {step} s")), "{message}");
                }
            }
        }
    }

    #[test]
    fn a_few_long_steps_are_pauses() {
        let times = (0..100).map(|k| f64::from(k) * 0.02 + f64::from(k / 9) * 5.0);
        let (passed, counts) = run(times).expect("pauses");
        assert_eq!((passed.len(), counts.total()), (100, 0));
    }

    #[test]
    fn a_huge_jump_is_said_in_few_digits() {
        let fault = SampleFault::TimeJump {
            t: 1e300,
            last: 0.0,
        };
        assert_eq!(
            fault.to_string(),
            "time jumps by 1.000e300 s; t is in seconds"
        );
    }
}
