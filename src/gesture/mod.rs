//! Gestures: definition from one example, planes, wave estimators.
//!
//! The way of a pose: [`FrontEnd::push`] removes its global motion, every gesture's [`Plane`] maps
//! what is left to one complex number (or a progression), and an [`Estimator`] reads amplitude,
//! frequency and phase off that number's recent past. After Rhodin 2016, chapter 9.

mod define;
mod estimator;
mod file;
mod front;
mod gabor;
mod kernel;
mod period;
mod plane;
mod separability;
mod set;
mod smooth;
mod window;

pub use define::{
    CyclicMarks, DefineError, Definition, NonCyclicMarks, define_cyclic, define_non_cyclic,
};
pub use estimator::{Estimator, EstimatorKind, LONGEST_GAP_S, PlanePoint, WaveEstimate};
pub use file::{GestureFileError, VERSION};
pub use front::{FrontEnd, FrontEndError, FrontEndOptions, GestureEstimate};
pub use gabor::GaborEstimator;
pub use period::{PeriodEstimate, find_period};
pub use plane::{Plane, References};
pub use separability::{Response, responses};
pub use set::{Gesture, GestureKind, GestureOptions, GestureSet};
