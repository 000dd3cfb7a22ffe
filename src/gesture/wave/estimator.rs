//! What every wave estimator offers: points of a plane in, amplitude, frequency and phase out.

use super::{
    CorrelationEstimator, DirectEstimator, FastEstimator, GaborEstimator, LeastSquaresEstimator,
    Shape,
};
use crate::gesture::GestureOptions;

/// After a gap in the samples longer than this, in seconds, an estimator begins anew.
///
/// Whatever moved before the gap says nothing about what is held or performed after it. Shorter
/// gaps are bridged: the wave runs on in phase.
pub const LONGEST_GAP_S: f64 = 0.5;

/// One pose on a gesture's plane.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct PlanePoint {
    /// Place on the plane; the reference runs on the unit circle, counter-clockwise.
    pub z: [f64; 2],
    /// How little the pose tells about each component (average pairwise distance of the targets of
    /// the nearest reference frames); `[1, 1]` when nothing is known.
    pub variance: [f64; 2],
    /// How far the motion on the plane is the gesture's own, 0..1: less where the gesture's points do
    /// what no gesture does. Estimators may scale what they believe by it.
    pub trust: f64,
}

impl Default for PlanePoint {
    fn default() -> Self {
        Self {
            z: [0.0; 2],
            variance: [1.0; 2],
            trust: 1.0,
        }
    }
}

/// Amplitude, frequency and phase of one cyclic gesture.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct WaveEstimate {
    /// 0 = not performed, 1 = as large as the reference; not clamped.
    pub amplitude: f64,
    /// Cycles per second; negative when performed in the opposite sense.
    pub frequency_hz: f64,
    /// Position in the cycle, [0, 2 pi); zero at the reference's frame farthest from its mean.
    pub phase_rad: f64,
    /// How much of the motion on the plane is that wave, 0..1.
    pub quality: f64,
}

/// Estimates a wave from points on a plane, one at a time.
///
/// `push` and `estimate` allocate nothing. Times are seconds and strictly increase; the caller has
/// checked that all numbers are finite.
pub trait Estimator: Send {
    /// Takes the next point; more than [`LONGEST_GAP_S`] after the last one it is a first point.
    fn push(&mut self, t: f64, point: PlanePoint);
    /// The estimate at the time of the last point; all zero before the first.
    fn estimate(&self) -> WaveEstimate;
    /// Forgets everything.
    fn reset(&mut self);
}

/// The estimators one can choose.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub enum EstimatorKind {
    /// The thesis's bank of one-sided Gabor filters (Rhodin 2016, section 9.4.2).
    Gabor,
    /// Weighted least-squares wave fit in its place, smoothed alike.
    LeastSquares,
    /// Locked wave fit with change detection: quick after a change, steady otherwise. The default.
    #[default]
    Fast,
    /// Baseline: modulus and argument of the present point.
    Direct,
    /// Baseline: auto- and cross-correlation (Shiratori and Hodgins 2008).
    Correlation,
}

impl EstimatorKind {
    /// All estimators, in the order in which comparisons list them.
    pub const ALL: [Self; 5] = [
        Self::Gabor,
        Self::LeastSquares,
        Self::Fast,
        Self::Direct,
        Self::Correlation,
    ];

    /// Names that [`EstimatorKind::from_name`] knows.
    pub const NAMES: [&'static str; 6] = ["default", "gabor", "lsq", "fast", "direct", "xcorr"];

    /// The estimator of that name; `default` is the best one there is.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "default" => Some(Self::default()),
            _ => Self::ALL.into_iter().find(|kind| kind.name() == name),
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gabor => "gabor",
            Self::LeastSquares => "lsq",
            Self::Fast => "fast",
            Self::Direct => "direct",
            Self::Correlation => "xcorr",
        }
    }

    /// Whether it reads [`PlanePoint::variance`], which costs a search of the reference per sample.
    pub fn reads_variance(self) -> bool {
        self == Self::Gabor
    }

    /// A new estimator of this kind for a gesture whose reference draws `shape` on its plane.
    pub fn build(self, options: &GestureOptions, shape: Shape) -> Box<dyn Estimator> {
        match self {
            Self::Gabor => Box::new(GaborEstimator::new(options)),
            Self::LeastSquares => Box::new(LeastSquaresEstimator::new(options, shape)),
            Self::Fast => Box::new(FastEstimator::new(options, shape)),
            Self::Direct => Box::new(DirectEstimator::new(options)),
            Self::Correlation => Box::new(CorrelationEstimator::new(options, shape)),
        }
    }
}
