//! Wave estimators: points of a plane in, amplitude, frequency and phase out.
//!
//! All stand behind one trait, [`Estimator`], take irregular time stamps and allocate nothing after
//! construction.

mod estimator;
mod gabor;
mod kernel;
mod smooth;
mod window;

pub use estimator::{Estimator, EstimatorKind, LONGEST_GAP_S, PlanePoint, WaveEstimate};
pub use gabor::GaborEstimator;
pub(super) use smooth::ProgressionSmoother;
