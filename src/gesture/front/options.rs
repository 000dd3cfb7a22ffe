//! What a front end may be told, and why it cannot be made.

use crate::gesture::{EstimatorKind, PerformerScale};

/// What may differ between uses of the same gesture file.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct FrontEndOptions {
    /// Which estimator reads the waves.
    pub estimator: EstimatorKind,
    /// Window in periods instead of the file's; 0.5 for a robot.
    pub lambda: Option<f64>,
    /// The performer's size against the gesture file's.
    pub scale: PerformerScale,
    /// Takes every point as the tracker gives it: jumps are not filtered, exchanged sides not undone.
    pub trust_tracker: bool,
}

/// Why gestures and stream do not fit together.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FrontEndError {
    /// The set has no gesture.
    #[error("the gesture file has no gesture; add one with `handwave gesture define`")]
    NoGestures,
    /// The stream lacks points of the set.
    #[error("the pose stream has no point {}; the gestures were defined with {}; use the same tracker, or define the gestures again", missing.join(", "), needed.join(", "))]
    MissingPoints {
        /// Points the stream lacks.
        missing: Vec<String>,
        /// All points of the set.
        needed: Vec<String>,
    },
    /// Dimension 2 against 3.
    #[error(
        "the pose stream is {found}-dimensional, the gestures are {expected}-dimensional; define them again with this tracker"
    )]
    Dimension {
        /// Of the stream.
        found: usize,
        /// Of the set.
        expected: usize,
    },
    /// The anchor is none of the set's points.
    #[error("global.anchor `{anchor}` is none of the gesture file's points")]
    Anchor {
        /// The anchor's name.
        anchor: String,
    },
    /// An option out of range.
    #[error("option {key}: found {found}; allowed: {allowed}")]
    Option {
        /// The key.
        key: &'static str,
        /// Its value.
        found: f64,
        /// Values allowed.
        allowed: &'static str,
    },
}
