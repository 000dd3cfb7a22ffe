//! Gestures: definition from one example, planes, wave estimators.
//!
//! The way of a pose: [`FrontEnd::push`] mends what the tracker got wrong and removes the pose's
//! global motion, every gesture's [`Plane`] maps what is left to one complex number (or a
//! progression), and an [`Estimator`] reads amplitude, frequency and phase off that number's recent
//! past. After Rhodin 2016, chapter 9.

mod channel;
mod confusion;
mod define;
mod feature;
mod figure;
mod file;
mod foreign;
mod frames;
mod front;
mod library;
mod period;
mod plane;
mod separability;
mod set;
pub mod study;
mod teach;
mod teach_guidance;
mod teach_search;
mod teach_words;
mod tracker;
mod wave;

pub use channel::{DerivedChannel, DerivedChannelError, LONGEST_SMOOTHING_S};
pub use confusion::{Confusion, Reading, STARTS, Verdict, confusion, confusion_of, sizes_m};
pub use define::{
    CyclicMarks, DefineError, Definition, NonCyclicMarks, define_cyclic, define_non_cyclic,
};
pub use feature::{FeatureError, FeatureSpec, KERNEL_SIGMAS, PoseFeatures};
pub use file::{GestureFileError, VERSION};
pub use front::{FrontEnd, FrontEndError, FrontEndOptions, GestureEstimate};
pub use library::{About, LibraryError};
pub use period::{PeriodEstimate, find_period};
pub use plane::{Plane, References};
pub use separability::{Response, responses};
pub use set::{Gesture, GestureKind, GestureOptions, GestureSet};
pub use teach::Teacher;
pub use teach_guidance::{Guidance, Novelty};
pub use teach_words::{Mark, TeachError, TeachOptions, TeachPhase, TeachView};
pub use tracker::{PerformerScale, TrackingCounts};
pub use wave::{
    CorrelationEstimator, DirectEstimator, Estimator, EstimatorKind, FastEstimator, GaborEstimator,
    LONGEST_GAP_S, LeastSquaresEstimator, PlanePoint, Shape, WaveEstimate,
};
