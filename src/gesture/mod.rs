//! Gestures: definition from one example, planes, wave estimators.
//!
//! The way of a pose: [`FrontEnd::push`] mends what the tracker got wrong and removes the pose's
//! global motion, every gesture's [`Plane`] maps what is left to one complex number (or a
//! progression), and an [`Estimator`] reads amplitude, frequency and phase off that number's recent
//! past. After Rhodin 2016, chapter 9.

mod channel;
mod define;
mod feature;
mod file;
mod foreign;
mod front;
mod period;
mod plane;
mod separability;
mod set;
pub mod study;
mod tracker;
mod wave;

pub use channel::{DerivedChannel, DerivedChannelError, LONGEST_SMOOTHING_S};
pub use define::{
    CyclicMarks, DefineError, Definition, NonCyclicMarks, define_cyclic, define_non_cyclic,
};
pub use feature::{FeatureError, FeatureSpec, KERNEL_SIGMAS, PoseFeatures};
pub use file::{GestureFileError, VERSION};
pub use front::{FrontEnd, FrontEndError, FrontEndOptions, GestureEstimate};
pub use period::{PeriodEstimate, find_period};
pub use plane::{Plane, References};
pub use separability::{Response, responses};
pub use set::{Gesture, GestureKind, GestureOptions, GestureSet};
pub use tracker::{PerformerScale, TrackingCounts};
pub use wave::{
    CorrelationEstimator, DirectEstimator, Estimator, EstimatorKind, FastEstimator, GaborEstimator,
    LONGEST_GAP_S, LeastSquaresEstimator, PlanePoint, Shape, WaveEstimate,
};
