//! A set of gestures: what a performer defined, complete in itself.

use super::About;
use crate::pose::{GlobalOptions, PoseHeader};

/// Whether a gesture repeats.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum GestureKind {
    /// Performed over and over: gives amplitude, frequency and phase.
    Cyclic,
    /// Performed to an extent and held: gives a progression from rest (0) to extreme (1).
    NonCyclic,
}

impl GestureKind {
    /// The name used in files and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cyclic => "cyclic",
            Self::NonCyclic => "non-cyclic",
        }
    }
}

/// Settings of planes and estimators, kept with the gestures.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct GestureOptions {
    /// Width of the estimator's window in periods (standard deviation), 0.1..2; default 2/3.
    /// 0.5 reacts faster and is noisier: right where a robot follows.
    pub lambda: f64,
    /// Standard deviation of the causal smoothing of amplitude and frequency in seconds, 0..2;
    /// default 0.2.
    pub smoothing_s: f64,
    /// Time constant with which the phase follows its estimate in seconds, 0..5; default 0.35.
    pub fusion_s: f64,
    /// Standard deviation of the causal smoothing of a progression in seconds, 0..2; default 0.05.
    pub progression_smoothing_s: f64,
    /// Regularisation of the planes (sigma_n of eq. 9.2), above 0; default 0.05. Larger: less noise
    /// gets through, gestures separate less sharply.
    pub ridge: f64,
    /// Whether motions on a line (raising and lowering an arm) weigh the component that the pose
    /// does tell more; default true.
    pub under_constrained: bool,
}

impl Default for GestureOptions {
    fn default() -> Self {
        Self {
            lambda: 2.0 / 3.0,
            smoothing_s: 0.2,
            fusion_s: 0.35,
            progression_smoothing_s: 0.05,
            ridge: 0.05,
            under_constrained: true,
        }
    }
}

impl GestureOptions {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Key, value found and values allowed.
    pub fn check(&self) -> Result<(), (&'static str, f64, &'static str)> {
        let within = |key, value: f64, low: f64, high: f64, allowed| {
            if value >= low && value <= high {
                Ok(())
            } else {
                Err((key, value, allowed))
            }
        };
        within("lambda", self.lambda, 0.1, 2.0, "0.1 to 2")?;
        within("smoothing_s", self.smoothing_s, 0.0, 2.0, "0 to 2")?;
        within("fusion_s", self.fusion_s, 0.0, 5.0, "0 to 5")?;
        within(
            "progression_smoothing_s",
            self.progression_smoothing_s,
            0.0,
            2.0,
            "0 to 2",
        )?;
        within("ridge", self.ridge, 1e-6, 100.0, "0.000001 to 100")
    }
}

/// One gesture as it was shown: the frames of one period, or from rest to extreme.
#[derive(Clone, Debug, PartialEq)]
pub struct Gesture {
    /// Its name, unique in the set.
    pub name: String,
    /// Whether it repeats.
    pub kind: GestureKind,
    /// Length of one period, or time from rest to extreme, in seconds.
    pub duration_s: f64,
    /// Where it came from, for people.
    pub source: String,
    /// Time of each frame since the first, in seconds, within 0..=duration.
    pub times_s: Vec<f64>,
    /// One row per frame, one place per point, metres, with global motion.
    pub frames: Vec<Vec<[f64; 3]>>,
}

/// Gestures over one set of points.
#[derive(Clone, Debug, PartialEq)]
pub struct GestureSet {
    /// Points and dimension; no channels.
    pub header: PoseHeader,
    /// What counts as global motion.
    pub global: GlobalOptions,
    /// The frame to which global motion is fitted: one place per point, metres.
    pub reference: Vec<[f64; 3]>,
    /// Settings of planes and estimators.
    pub options: GestureOptions,
    /// The gestures in the order of the file.
    pub gestures: Vec<Gesture>,
    /// Author, licence and note of the file.
    pub about: About,
}

impl GestureSet {
    /// A set without gestures over the points of `header`, fitted to `reference`.
    pub fn new(header: &PoseHeader, reference: Vec<[f64; 3]>) -> Self {
        Self {
            header: PoseHeader {
                points: header.points.clone(),
                dim: header.dim,
                channels: Vec::new(),
            },
            global: GlobalOptions::default(),
            reference,
            options: GestureOptions::default(),
            gestures: Vec::new(),
            about: About::default(),
        }
    }

    /// Adds a gesture, or replaces the one of the same name; true when it replaced one.
    ///
    /// All gestures share one reference frame; a set without one takes the gesture's first frame.
    pub fn put(&mut self, gesture: Gesture) -> bool {
        if self.reference.is_empty()
            && let Some(first) = gesture.frames.first()
        {
            self.reference.clone_from(first);
        }
        match self.gestures.iter_mut().find(|g| g.name == gesture.name) {
            Some(old) => {
                *old = gesture;
                true
            }
            None => {
                self.gestures.push(gesture);
                false
            }
        }
    }

    /// Index of the gesture called `name`.
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.gestures.iter().position(|g| g.name == name)
    }
}
