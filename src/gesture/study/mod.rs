//! The study: all wave estimators on the same sequences, and figures 9.5 and 9.15 of the thesis.
//!
//! Synthetic performers move points in waves ([`Performer`]); gestures are defined from one clean
//! period of theirs, scripts ([`Script`]) say what they perform, and the whole front end reads it,
//! so what is measured is what `handwave gesture estimate` prints, each estimator with its own
//! smoothing. [`study()`] runs everything and is pure: the same options give the same study.

mod correlate;
mod independence;
mod metrics;
mod performer;
mod recorded;
mod scenes;
mod script;
mod suite;
mod svm;

pub use correlate::{Match, Poses, Template};
pub use independence::{Independence, Method, wave_method};
pub use metrics::{
    ABORT_AMPLITUDE, START_AMPLITUDE, activations, best_lag, median, reaching_s, rms,
    rms_phase_deg, settling_s, share_above,
};
pub use performer::{Doing, Performer};
pub use recorded::{Part, RealPerformance};
pub use scenes::{SIGNAL_TO_NOISE, STEP_NOISES, figure_9_5};
pub use script::{Curve, Moment, Player, Role, Script, Trace, Waves, rehearse};
pub use suite::{
    Row, Study, StudyError, StudyOptions, Subject, TRADE_NOISE, default_lambda, study,
};
pub use svm::Lesson;
