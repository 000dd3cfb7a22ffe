//! Figure 9.15: do gestures that share joints disturb each other? Waves, cross-correlation, SVM.

use super::correlate::{Poses, Template, between};
use super::metrics::START_AMPLITUDE;
use super::performer::Performer;
use super::script::{Curve, Role, Script, rehearse};
use super::suite::{Row, StudyError, Subject, default_lambda};
use super::svm::{Lesson, activities};
use crate::gesture::{
    EstimatorKind, FrontEnd, FrontEndError, FrontEndOptions, GestureKind, GestureSet, References,
};
use crate::pose::{PoseHeader, PoseSample, Recording};

/// Rate at which the baselines look, as in the thesis.
pub(super) const RATE_HZ: f64 = 30.0;
/// After a change of what is performed, nothing is judged for this long: all methods look back.
const SETTLING_S: f64 = 1.5;
/// A lesson of the support vector machine, in seconds.
pub(super) const LESSON_S: f64 = 4.0;

/// How one method sees the gestures.
#[derive(Clone, Debug, PartialEq)]
pub struct Method {
    /// Its name.
    pub name: String,
    /// Above this the gesture counts as detected.
    pub threshold: f64,
    /// Per gesture and time: amplitude, correlation or share of detections.
    pub activity: Vec<Vec<f64>>,
    /// Per gesture and time the frequency in Hz; empty for methods that tell none.
    pub frequency_hz: Vec<Vec<f64>>,
}

/// One performance of several gestures and what each method makes of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Independence {
    /// The sequence's name.
    pub name: &'static str,
    /// Names of the gestures.
    pub gestures: Vec<String>,
    /// Times in seconds, uniform.
    pub t: Vec<f64>,
    /// Per gesture and time whether it is performed.
    pub performed: Vec<Vec<bool>>,
    /// The methods.
    pub methods: Vec<Method>,
}

impl Independence {
    /// What is performed at sample `k`: `rest`, a gesture's name, or several joined by `+`.
    pub fn performed_at(&self, k: usize) -> String {
        let names: Vec<&str> = (self.gestures.iter().zip(&self.performed))
            .filter(|(_, performed)| performed[k])
            .map(|(name, _)| name.as_str())
            .collect();
        if names.is_empty() {
            "rest".into()
        } else {
            names.join("+")
        }
    }

    /// Every state of the performance once, in the order of its first appearance, with the samples
    /// that are judged in it: not those just after a change.
    pub fn states(&self) -> Vec<(String, Vec<usize>)> {
        let mut states: Vec<(String, Vec<usize>)> = Vec::new();
        let (mut last, mut since) = (String::new(), f64::NEG_INFINITY);
        for (k, t) in self.t.iter().enumerate() {
            let state = self.performed_at(k);
            if state != last {
                since = *t;
                last.clone_from(&state);
            }
            let index = match states.iter().position(|(name, _)| *name == state) {
                Some(index) => index,
                None => {
                    states.push((state, Vec::new()));
                    states.len() - 1
                }
            };
            if t - since >= SETTLING_S {
                states[index].1.push(k);
            }
        }
        states
    }

    /// Adds the mean activity and the share of detections of every method and gesture, state by
    /// state, to `rows`.
    pub fn rows(&self, rows: &mut Vec<Row>) {
        let states = self.states();
        for method in &self.methods {
            for (gesture, activity) in self.gestures.iter().zip(&method.activity) {
                for (state, samples) in &states {
                    let count = samples.len() as f64;
                    let mean = samples.iter().map(|k| activity[*k]).sum::<f64>() / count;
                    let detected = samples
                        .iter()
                        .filter(|k| activity[**k] > method.threshold)
                        .count() as f64;
                    for (metric, value) in [("mean", mean), ("detected", detected / count)] {
                        rows.push(Row {
                            sequence: self.name.into(),
                            estimator: method.name.clone(),
                            lambda: default_lambda(),
                            noise: 0.0,
                            metric: format!("{metric}_{gesture}_during_{state}"),
                            value,
                            unit: "1",
                        });
                    }
                }
            }
        }
    }
}

/// Poses without global motion at a uniform 30 Hz, from samples at any times, all points seen.
fn uniform(references: &References, header: &PoseHeader, samples: Vec<PoseSample>) -> Poses {
    let recording = Recording {
        header: header.clone(),
        samples,
    };
    // A point that is never seen stays where it is not: at the origin.
    let frames = recording.filled().unwrap_or_default();
    let rows: Vec<Vec<f64>> = frames
        .iter()
        .map(|frame| {
            let mut local = frame.clone();
            references.fit.remove(frame, None, &mut local);
            local.as_flattened().to_vec()
        })
        .collect();
    let (from, to) = recording.span_s();
    let times: Vec<f64> = recording.samples.iter().map(|sample| sample.t).collect();
    let steps = ((to - from) * RATE_HZ + 1e-6).floor() as usize;
    let rows = (0..=steps)
        .map(|k| {
            let t = from + k as f64 / RATE_HZ;
            let after = times.partition_point(|time| *time <= t).max(1);
            let (start, end) = (times[after - 1], times.get(after));
            let u = end.map_or(0.0, |end| (t - start) / (end - start));
            between(&rows, (after - 1) as f64 + u)
        })
        .collect();
    Poses {
        step_s: 1.0 / RATE_HZ,
        rows,
    }
}

/// All methods on one performance of `set`'s gestures.
pub(super) fn compare(
    name: &'static str,
    set: &GestureSet,
    recording: &Recording,
    lessons: &[Lesson],
    performed: &dyn Fn(f64) -> Vec<bool>,
    subjects: &[Subject],
) -> Result<Independence, StudyError> {
    let references = References::new(set).map_err(|anchor| FrontEndError::Anchor { anchor })?;
    let live = uniform(&references, &recording.header, recording.samples.clone());
    let (from, _) = recording.span_s();
    let t: Vec<f64> = (0..live.rows.len())
        .map(|k| from + k as f64 / RATE_HZ)
        .collect();
    let mut methods = Vec::new();
    for subject in subjects {
        let (activity, frequency_hz) = waves(set, recording, subject.kind, &t)?;
        methods.push(Method {
            name: wave_method(subject.name),
            threshold: START_AMPLITUDE,
            activity,
            frequency_hz,
        });
    }
    let matches: Vec<_> = (set.gestures.iter().zip(&references.local))
        .map(|(gesture, local)| {
            let rows: Vec<Vec<f64>> = local.iter().map(|row| row.as_slice().to_vec()).collect();
            let cyclic = gesture.kind == GestureKind::Cyclic;
            let last = rows.len() as f64 - if cyclic { 0.0 } else { 1.0 };
            Template::new(gesture.duration_s, cyclic, |u| between(&rows, u * last)).matches(&live)
        })
        .collect();
    for (name, threshold, of) in [
        (
            "cross-correlation",
            0.5,
            (|m| m.coefficient) as fn(&super::correlate::Match) -> f64,
        ),
        ("cross-correlation, size", START_AMPLITUDE, |m| m.amplitude),
    ] {
        methods.push(Method {
            name: name.into(),
            threshold,
            activity: matches
                .iter()
                .map(|row| row.iter().map(of).collect())
                .collect(),
            frequency_hz: Vec::new(),
        });
    }
    methods.push(Method {
        name: "svm".into(),
        threshold: 0.5,
        activity: activities(lessons, &live)?,
        frequency_hz: Vec::new(),
    });
    let states: Vec<Vec<bool>> = t.iter().map(|t| performed(*t)).collect();
    Ok(Independence {
        name,
        gestures: set.gestures.iter().map(|g| g.name.clone()).collect(),
        performed: (0..set.gestures.len())
            .map(|g| states.iter().map(|state| state[g]).collect())
            .collect(),
        t,
        methods,
    })
}

/// Name of the method that reads waves with an estimator.
pub fn wave_method(estimator: &str) -> String {
    format!("waves ({estimator})")
}

/// Per gesture a value over time.
type PerGesture = Vec<Vec<f64>>;

/// The front end's amplitudes and frequencies at times `t`.
fn waves(
    set: &GestureSet,
    recording: &Recording,
    estimator: EstimatorKind,
    t: &[f64],
) -> Result<(PerGesture, PerGesture), FrontEndError> {
    let options = FrontEndOptions {
        estimator,
        ..FrontEndOptions::default()
    };
    let mut front = FrontEnd::new(set, &recording.header, options)?;
    let mut amplitude = vec![Vec::with_capacity(t.len()); set.gestures.len()];
    let mut frequency = amplitude.clone();
    let mut next = recording.samples.iter().peekable();
    for t in t {
        while let Some(sample) = next.next_if(|sample| sample.t <= t + 1e-9) {
            // A sample with too few points leaves the last estimates standing.
            let _refused = front.push(sample).is_err();
        }
        for (index, estimate) in front.estimates().iter().enumerate() {
            amplitude[index].push(estimate.amplitude.abs());
            frequency[index].push(estimate.frequency_hz);
        }
    }
    Ok((amplitude, frequency))
}

/// From when to when the synthetic hand's thumb, and its whole hand, are performed.
const THUMB_S: [(f64, f64); 2] = [(2.0, 7.0), (16.0, 21.0)];
const HAND_S: [(f64, f64); 2] = [(9.0, 14.0), (16.0, 21.0)];
const HAND_END_S: f64 = 23.0;
/// Noise on the thumb's plane: that of a good hand tracker.
const HAND_NOISE: f64 = 0.05;

fn performed_in(spans: &[(f64, f64)], t: f64) -> bool {
    spans.iter().any(|(from, to)| (*from..*to).contains(&t))
}

/// A synthetic hand rotates its thumb, then all fingers, then both at once.
///
/// The performance is quicker and a little smaller than what was shown; the support vector machine
/// learns from four seconds of each gesture as shown, and as much rest.
///
/// # Errors
/// See [`StudyError`].
pub fn hand_independence(subjects: &[Subject], seed: u64) -> Result<Independence, StudyError> {
    let performer = Performer::hand()?;
    let references =
        References::new(&performer.set).map_err(|anchor| FrontEndError::Anchor { anchor })?;
    let burst = |spans: &[(f64, f64)], size: f64| {
        let mut knots = Vec::new();
        for (from, to) in spans {
            knots.extend([
                (*from, 0.0),
                (from + 0.3, size),
                (to - 0.3, size),
                (*to, 0.0),
            ]);
        }
        Curve(knots)
    };
    let record = |script: &Script, seed| {
        let mut samples = Vec::new();
        rehearse(&performer, script, seed, |moment| {
            samples.push(moment.sample.clone());
        });
        samples
    };
    let mut script = Script::of(
        Role {
            amplitude: burst(&THUMB_S, 0.9),
            frequency_hz: Curve::constant(1.3),
        },
        (0.0, HAND_END_S),
    );
    script.roles.push(Role {
        amplitude: burst(&HAND_S, 0.9),
        frequency_hz: Curve::constant(1.6),
    });
    script.noise = HAND_NOISE;
    script.rate_hz = RATE_HZ;
    let recording = Recording {
        header: performer.header.clone(),
        samples: record(&script, seed),
    };
    let lessons: Vec<Lesson> = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
        .into_iter()
        .enumerate()
        .map(|(index, (thumb, hand))| {
            let mut script = Script::of(Role::steady(thumb, 1.0), (0.0, LESSON_S));
            script.roles.push(Role::steady(hand, 1.0));
            script.noise = HAND_NOISE;
            let samples = record(&script, seed.wrapping_add(1 + index as u64));
            Lesson {
                poses: uniform(&references, &performer.header, samples),
                performed: vec![thumb > 0.0, hand > 0.0],
            }
        })
        .collect();
    compare(
        "figure-9.15",
        &performer.set,
        &recording,
        &lessons,
        &|t| vec![performed_in(&THUMB_S, t), performed_in(&HAND_S, t)],
        subjects,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_not_judged_while_methods_still_look_back() {
        let t: Vec<f64> = (0..60).map(|k| f64::from(k) * 0.1).collect();
        let performed = vec![t.iter().map(|t| (2.0..4.0).contains(t)).collect()];
        let seen = Independence {
            name: "test",
            gestures: vec!["wave".into()],
            t,
            performed,
            methods: Vec::new(),
        };
        let states = seen.states();
        let names: Vec<&str> = states.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["rest", "wave"]);
        // Rest: from 1.5 s on, and what is left 1.5 s after it is taken up again.
        assert_eq!(states[0].1.len(), 5 + 5);
        assert_eq!(states[1].1, (35..40).collect::<Vec<_>>());
    }
}
