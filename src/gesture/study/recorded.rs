//! The comparison of figure 9.15 on a recorded hand, and the errors of the waves read from it.

use super::correlate::{Poses, between};
use super::independence::{Independence, LESSON_S, RATE_HZ, compare, wave_method};
use super::metrics::rms;
use super::suite::{Row, StudyError, Subject, default_lambda};
use super::svm::Lesson;
use crate::base::random::SplitMix;
use crate::gesture::{FrontEndError, GestureKind, GestureSet, References};
use crate::pose::Recording;

/// In a recorded performance the estimates count this long after a change.
const STEADY_S: f64 = 2.0;
/// Tracker noise in lessons made from reference frames, metres.
const LESSON_NOISE_M: f64 = 0.0005;

/// A stretch of a recorded performance whose truth is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Start in seconds.
    pub from_s: f64,
    /// End in seconds.
    pub to_s: f64,
    /// The gesture performed; `None` for rest.
    pub gesture: Option<usize>,
    /// Its size (cyclic gestures).
    pub amplitude: f64,
    /// Its frequency in Hz (cyclic gestures).
    pub frequency_hz: f64,
}

/// A recorded performance with its gestures and what was performed when.
#[derive(Clone, Debug, PartialEq)]
pub struct RealPerformance {
    /// The gestures.
    pub set: GestureSet,
    /// The recording.
    pub recording: Recording,
    /// What was performed; stretches in between are not judged.
    pub parts: Vec<Part>,
}

/// Rows of the bundled recipe `configs/performances/drum_and_splay.toml`: from, to, what (0 drum,
/// 1 splay), size, frequency. Joins between segments belong to none.
const DRUM_AND_SPLAY: [(f64, f64, Option<usize>, f64, f64); 10] = [
    (0.0, 3.5, None, 0.0, 0.0),
    (3.5, 11.5, Some(0), 0.7, 0.735 / 1.05),
    (11.5, 19.5, Some(0), 1.0, 1.0 / 1.05),
    (19.5, 27.5, Some(0), 0.9, 1.575 / 1.05),
    (27.5, 33.5, Some(0), 0.7, 1.995 / 1.05),
    (33.5, 38.0, None, 0.0, 0.0),
    (38.0, 44.16, Some(1), 1.0, 0.0),
    (44.16, 46.66, None, 0.0, 0.0),
    (46.66, 52.66, Some(0), 1.0, 1.155 / 1.05),
    (52.66, 55.7, None, 0.0, 0.0),
];

impl RealPerformance {
    /// The bundled performance: gestures `drum` and `splay`, made by the recipe in
    /// `configs/performances/drum_and_splay.toml` from recordings of a real hand.
    pub fn drum_and_splay(set: GestureSet, recording: Recording) -> Self {
        let parts = DRUM_AND_SPLAY
            .iter()
            .map(|(from_s, to_s, gesture, amplitude, frequency_hz)| Part {
                from_s: *from_s,
                to_s: *to_s,
                gesture: *gesture,
                amplitude: *amplitude,
                frequency_hz: *frequency_hz,
            })
            .collect();
        Self {
            set,
            recording,
            parts,
        }
    }

    fn performed(&self, t: f64) -> Vec<bool> {
        (0..self.set.gestures.len())
            .map(|gesture| {
                self.parts.iter().any(|part| {
                    part.gesture == Some(gesture) && (part.from_s..part.to_s).contains(&t)
                })
            })
            .collect()
    }

    /// A stretch of the performance with only every `step`-th sample, for a quick look.
    pub fn excerpt(mut self, from_s: f64, to_s: f64, step: usize) -> Self {
        let samples = std::mem::take(&mut self.recording.samples);
        self.recording.samples = samples
            .into_iter()
            .filter(|sample| (from_s..to_s).contains(&sample.t))
            .step_by(step.max(1))
            .collect();
        self
    }

    /// Adds the errors of the first gesture as read in `seen`, and its amplitude when it is not
    /// performed, to `rows`.
    pub fn measure(&self, seen: &Independence, subjects: &[Subject], rows: &mut Vec<Row>) {
        for subject in subjects {
            let name = wave_method(subject.name);
            let Some(method) = seen.methods.iter().find(|method| method.name == name) else {
                continue;
            };
            let (mut amplitude, mut frequency) = (Vec::new(), Vec::new());
            let (mut silent, mut other) = (0.0_f64, 0.0_f64);
            for (k, t) in seen.t.iter().enumerate() {
                let start = seen.t.first().copied().unwrap_or(0.0);
                let judged =
                    |part: &&Part| *t >= part.from_s.max(start) + STEADY_S && *t < part.to_s;
                let (size, hz) = (method.activity[0][k], method.frequency_hz[0][k]);
                match self.parts.iter().find(judged) {
                    Some(part) if part.gesture == Some(0) => {
                        amplitude.push(size - part.amplitude);
                        frequency.push(hz - part.frequency_hz);
                    }
                    Some(part) if part.gesture.is_none() => silent = silent.max(size),
                    Some(_) => other = other.max(size),
                    None => {}
                }
            }
            for (metric, unit, value) in [
                ("amplitude_error", "1", rms(amplitude.into_iter())),
                ("frequency_error", "Hz", rms(frequency.into_iter())),
                ("largest_at_rest", "1", silent),
                ("largest_during_other", "1", other),
            ] {
                rows.push(Row {
                    sequence: seen.name.into(),
                    estimator: subject.name.into(),
                    lambda: default_lambda(),
                    noise: 0.0,
                    metric: metric.into(),
                    value,
                    unit,
                });
            }
        }
    }
}

/// The same comparison on a recorded performance.
///
/// The support vector machine learns from the gestures' own reference frames: a cyclic one repeated,
/// a non-cyclic one performed and held, and the pose in which each begins as rest.
///
/// # Errors
/// See [`StudyError`].
pub fn real_independence(
    real: &RealPerformance,
    subjects: &[Subject],
    seed: u64,
) -> Result<Independence, StudyError> {
    let set = &real.set;
    let references = References::new(set).map_err(|anchor| FrontEndError::Anchor { anchor })?;
    let mut random = SplitMix::new(seed);
    let mut lessons = Vec::new();
    for (index, gesture) in set.gestures.iter().enumerate() {
        let rows: Vec<Vec<f64>> = (references.local[index].iter())
            .map(|row| row.as_slice().to_vec())
            .collect();
        let rest = match gesture.kind {
            GestureKind::Cyclic => references.mean[index].as_slice().to_vec(),
            GestureKind::NonCyclic => between(&rows, 0.0),
        };
        let mut lesson = |at: &dyn Fn(f64) -> Vec<f64>, performed: Vec<bool>| {
            let rows = (0..(LESSON_S * RATE_HZ) as usize)
                .map(|k| {
                    let mut row = at(k as f64 / RATE_HZ);
                    for value in &mut row {
                        *value += LESSON_NOISE_M * random.normal();
                    }
                    row
                })
                .collect();
            let step_s = 1.0 / RATE_HZ;
            let poses = Poses { step_s, rows };
            lessons.push(Lesson { poses, performed });
        };
        let only = (0..set.gestures.len())
            .map(|other| other == index)
            .collect();
        let count = rows.len() as f64;
        match gesture.kind {
            GestureKind::Cyclic => lesson(
                &|t| between(&rows, (t / gesture.duration_s).fract() * count),
                only,
            ),
            // There and back at a quarter of the speed, held in between.
            GestureKind::NonCyclic => lesson(
                &|t| {
                    let u = (t.min(LESSON_S - t) / (4.0 * gesture.duration_s)).min(1.0);
                    between(&rows, u * (count - 1.0))
                },
                only,
            ),
        }
        lesson(&|_| rest.clone(), vec![false; set.gestures.len()]);
    }
    compare(
        "recorded-hand",
        set,
        &real.recording,
        &lessons,
        &|t| real.performed(t),
        subjects,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_of_the_recorded_performance_are_those_of_its_recipe() {
        let recipe = include_str!("../../../configs/performances/drum_and_splay.toml");
        let recipe: toml::Table = recipe.parse().expect("TOML");
        let mut from = 0.0;
        for segment in recipe["segment"].as_array().expect("segments") {
            let number = |key: &str| segment.get(key).and_then(toml::Value::as_float);
            let kind = segment["kind"].as_str().expect("a kind");
            let speed = number("speed").unwrap_or(1.0);
            let duration = number("duration_s").unwrap_or_else(|| {
                let length = number("to").expect("an end") - number("from").expect("a start");
                length.abs() / speed
            });
            // The middle of the segment: joins and rounding are at its ends.
            let middle = from + 0.5 * duration;
            let told_s = DRUM_AND_SPLAY.last().map_or(0.0, |row| row.1);
            if middle > told_s {
                // What follows shows the animator's other classes; the study ends before it.
                break;
            }
            let row = DRUM_AND_SPLAY
                .iter()
                .find(|(start, end, ..)| (*start..*end).contains(&middle))
                .unwrap_or_else(|| panic!("no part at {middle:.2} s"));
            let splay = segment["source"].as_str() == Some("splay");
            match kind {
                "loop" => {
                    assert_eq!(row.2, Some(0), "at {middle:.2} s");
                    assert!(
                        (row.0 - from).abs() < 0.02,
                        "starts at {from:.3} s: {row:?}"
                    );
                    assert_eq!(row.3, number("size").unwrap_or(1.0), "at {middle:.2} s");
                    assert!((row.4 - speed / 1.05).abs() < 1e-9, "at {middle:.2} s");
                }
                "cut" => assert_eq!(row.2, Some(1), "at {middle:.2} s"),
                _ if splay && middle > 38.0 => assert_eq!(row.2, Some(1), "at {middle:.2} s"),
                _ => assert_eq!(row.2, None, "at {middle:.2} s"),
            }
            from += duration;
        }
        assert!((from - 55.67).abs() < 0.05, "the recipe lasts {from:.2} s");
    }
}
