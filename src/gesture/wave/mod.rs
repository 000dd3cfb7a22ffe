//! Wave estimators: points of a plane in, amplitude, frequency and phase out.
//!
//! All stand behind one trait, [`Estimator`], take irregular time stamps and allocate nothing after
//! construction.

mod bank;
mod correlation;
mod direct;
mod estimator;
mod fast;
mod fit;
mod gabor;
mod history;
mod kernel;
mod lsq;
mod output;
mod shape;
mod smooth;
mod window;

pub use correlation::CorrelationEstimator;
pub use direct::DirectEstimator;
pub use estimator::{Estimator, EstimatorKind, LONGEST_GAP_S, PlanePoint, WaveEstimate};
pub use fast::FastEstimator;
pub use gabor::GaborEstimator;
pub use lsq::LeastSquaresEstimator;
pub use shape::Shape;
pub(super) use smooth::ProgressionSmoother;
