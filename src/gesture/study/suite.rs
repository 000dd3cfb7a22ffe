//! Runs every estimator over every sequence and gathers the rows.

use super::independence::{Independence, hand_independence};
use super::metrics::{median, rms, rms_phase_deg};
use super::performer::Performer;
use super::recorded::{RealPerformance, real_independence};
use super::scenes::{Cast, Scene, before_s, figure_9_5, scenes, steps};
use super::script::{Player, Trace, rehearse};
use crate::gesture::{DefineError, EstimatorKind, FrontEndError};

/// Windows in periods over which error is traded for delay.
const LAMBDAS: [f64; 6] = [0.25, 0.35, 0.5, 2.0 / 3.0, 0.9, 1.2];
/// The stretch of the recorded performance that is enough for a quick look.
const QUICK_S: (f64, f64) = (30.0, 50.0);
/// The noise at which error is set against delay.
pub const TRADE_NOISE: f64 = 0.1;

/// One figure of the study.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The sequence.
    pub sequence: String,
    /// The estimator or other method.
    pub estimator: String,
    /// Its window in periods.
    pub lambda: f64,
    /// Noise on each component of the plane, standard deviation.
    pub noise: f64,
    /// What was measured.
    pub metric: String,
    /// Median over the repeats; infinite where it never settled.
    pub value: f64,
    /// Unit of the value; `1` for ratios and counts.
    pub unit: &'static str,
}

/// An estimator under its name.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Subject {
    /// Name as on the command line.
    pub name: &'static str,
    /// The estimator.
    pub kind: EstimatorKind,
}

impl Subject {
    /// Every estimator there is, each once: `default` is one of the others.
    pub fn all() -> Vec<Self> {
        EstimatorKind::NAMES
            .iter()
            .filter(|name| **name != "default")
            .filter_map(|name| EstimatorKind::from_name(name).map(|kind| Self { name, kind }))
            .collect()
    }

    /// Whether this is what `default` stands for.
    pub fn is_default(&self) -> bool {
        self.kind == EstimatorKind::default()
    }
}

/// What to study.
#[derive(Clone, Debug)]
pub struct StudyOptions {
    /// Start of all noise and phases.
    pub seed: u64,
    /// Fewer repeats, shorter noise: a look, not a measurement.
    pub quick: bool,
    /// The estimators to compare.
    pub subjects: Vec<Subject>,
    /// A recorded performance to try them on.
    pub real: Option<RealPerformance>,
}

/// Why the study could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StudyError {
    /// A synthetic performer's movement made no gesture.
    #[error("a synthetic gesture cannot be defined: {0}")]
    Define(#[from] DefineError),
    /// Gestures and stream do not fit.
    #[error(transparent)]
    FrontEnd(#[from] FrontEndError),
    /// A support vector machine needs examples of what it looks for and of something else.
    #[error(
        "the support vector machine cannot be trained: {of_class} of {samples} samples are of its class; it needs some, and some others"
    )]
    OneClass {
        /// Samples in all.
        samples: usize,
        /// Samples of the class.
        of_class: usize,
    },
}

/// The whole study.
#[derive(Clone, Debug)]
pub struct Study {
    /// All figures, in the order they were made.
    pub rows: Vec<Row>,
    /// Figure 9.5: every estimator's trace of the same performance.
    pub waves: Vec<(&'static str, Trace)>,
    /// What the plane reads during it: time and both components.
    pub plane: Vec<(f64, [f64; 2])>,
    /// Figure 9.15 and the same on real hands.
    pub independence: Vec<Independence>,
}

impl Study {
    /// The value of one figure at the default window.
    pub fn value(&self, sequence: &str, estimator: &str, noise: f64, metric: &str) -> Option<f64> {
        let lambda = default_lambda();
        self.rows
            .iter()
            .find(|row| {
                row.sequence == sequence
                    && row.estimator == estimator
                    && row.noise == noise
                    && row.metric == metric
                    && row.lambda == lambda
            })
            .map(|row| row.value)
    }
}

/// The window in periods that gestures have when nothing else is said.
pub fn default_lambda() -> f64 {
    crate::gesture::GestureOptions::default().lambda
}

/// Runs the study. `progress` hears what is done now and which share of all is behind.
///
/// Pure: the same options give the same study, bit for bit on one build.
///
/// # Errors
/// See [`StudyError`]; none of them depends on the seed.
pub fn study(
    options: &StudyOptions,
    progress: &mut dyn FnMut(&str, f64),
) -> Result<Study, StudyError> {
    let performers = Performers {
        arm_loop: Performer::arm_loop()?,
        arm_line: Performer::arm_line()?,
        two_arms: Performer::two_arms()?,
    };
    let scenes = scenes(options.quick);
    let lambdas: Vec<f64> = LAMBDAS
        .into_iter()
        .filter(|lambda| *lambda != default_lambda() && (!options.quick || *lambda == 0.35))
        .collect();
    let trade = trade_scenes(options.quick);
    let jobs = |scene: &Scene| {
        let (from, to) = scene.script.span_s;
        (to - from) * scene.script.rate_hz * (scene.noises.len() * scene.repeats) as f64
    };
    let of_scenes: f64 = scenes.iter().map(jobs).sum();
    let of_trade: f64 = trade.iter().map(jobs).sum::<f64>() * lambdas.len() as f64;
    let total = (of_scenes + of_trade) * options.subjects.len() as f64;
    let mut done = 0.0;
    let mut result = Study {
        rows: Vec::new(),
        waves: Vec::new(),
        plane: Vec::new(),
        independence: Vec::new(),
    };
    for scene in &scenes {
        for subject in &options.subjects {
            progress(
                &format!("{} with {}", scene.name, subject.name),
                done / total,
            );
            run_scene(
                options,
                &performers,
                scene,
                *subject,
                None,
                &mut result.rows,
            )?;
            done += jobs(scene);
        }
    }
    for subject in &options.subjects {
        for lambda in &lambdas {
            let what = format!("window {lambda} with {}", subject.name);
            progress(&what, done / total);
            for scene in &trade {
                let rows = &mut result.rows;
                run_scene(options, &performers, scene, *subject, Some(*lambda), rows)?;
                done += jobs(scene);
            }
        }
    }
    progress("figures 9.5 and 9.15", 1.0);
    waves(options, &performers.arm_loop, &mut result)?;
    result
        .independence
        .push(hand_independence(&options.subjects, options.seed)?);
    if let Some(real) = &options.real {
        let real = if options.quick {
            real.clone().excerpt(QUICK_S.0, QUICK_S.1, 3)
        } else {
            real.clone()
        };
        let seen = real_independence(&real, &options.subjects, options.seed)?;
        real.measure(&seen, &options.subjects, &mut result.rows);
        result.independence.push(seen);
    }
    for independence in &result.independence {
        independence.rows(&mut result.rows);
    }
    Ok(result)
}

struct Performers {
    arm_loop: Performer,
    arm_line: Performer,
    two_arms: Performer,
}

impl Performers {
    fn of(&self, cast: Cast) -> &Performer {
        match cast {
            Cast::Loop => &self.arm_loop,
            Cast::Line => &self.arm_line,
            Cast::TwoArms => &self.two_arms,
        }
    }
}

/// The steps once more, at the noise at which windows are compared.
fn trade_scenes(quick: bool) -> [Scene; 2] {
    steps(Cast::Loop, before_s(quick)).map(|mut scene| {
        scene.noises = vec![TRADE_NOISE];
        scene.repeats = if quick { 1 } else { scene.repeats };
        scene
    })
}

/// Plays a scene under all its noises and adds the medians to `rows`.
fn run_scene(
    options: &StudyOptions,
    performers: &Performers,
    scene: &Scene,
    subject: Subject,
    lambda: Option<f64>,
    rows: &mut Vec<Row>,
) -> Result<(), StudyError> {
    let mut player = Player::new(performers.of(scene.cast), subject.kind, lambda)?;
    for noise in &scene.noises {
        let mut script = scene.script.clone();
        script.noise = *noise;
        let runs: Vec<_> = (0..scene.repeats as u64)
            .map(|repeat| {
                let seed = options.seed.wrapping_mul(1000).wrapping_add(repeat);
                (scene.measure)(&player.play(&script, seed))
            })
            .collect();
        let Some(first) = runs.first() else { continue };
        for (index, (metric, unit, _)) in first.iter().enumerate() {
            let values: Vec<f64> = runs.iter().map(|run| run[index].2).collect();
            rows.push(Row {
                sequence: scene.name.into(),
                estimator: subject.name.into(),
                lambda: lambda.unwrap_or(default_lambda()),
                noise: *noise,
                metric: (*metric).into(),
                value: median(&values),
                unit,
            });
        }
    }
    Ok(())
}

/// The errors of figure 9.5 count from here on, in seconds: the start is shown, not judged.
const STARTED_S: f64 = 2.0;

/// Figure 9.5: one performance, all estimators, errors over all of it but the start.
fn waves(
    options: &StudyOptions,
    performer: &Performer,
    study: &mut Study,
) -> Result<(), StudyError> {
    let script = figure_9_5();
    rehearse(performer, &script, options.seed, |moment| {
        let points = super::performer::places(moment.sample);
        let point = performer.on_plane(0, &points);
        study.plane.push((moment.sample.t, point));
    });
    for subject in &options.subjects {
        let trace = Player::new(performer, subject.kind, None)?.play(&script, options.seed);
        let (truth, estimate) = (&trace.truth[0], &trace.estimate[0]);
        let judged = trace.range(STARTED_S, f64::INFINITY);
        let difference = |a: &[f64], b: &[f64]| rms(judged.clone().map(|k| a[k] - b[k]));
        for (metric, unit, value) in [
            (
                "amplitude_error",
                "1",
                difference(&estimate.amplitude, &truth.amplitude),
            ),
            (
                "frequency_error",
                "Hz",
                difference(&estimate.frequency_hz, &truth.frequency_hz),
            ),
            (
                "phase_error",
                "deg",
                rms_phase_deg(
                    &estimate.phase_rad[judged.clone()],
                    &truth.phase_rad[judged.clone()],
                ),
            ),
        ] {
            study.rows.push(Row {
                sequence: "figure-9.5".into(),
                estimator: subject.name.into(),
                lambda: default_lambda(),
                noise: script.noise,
                metric: metric.into(),
                value,
                unit,
            });
        }
        study.waves.push((subject.name, trace));
    }
    Ok(())
}
