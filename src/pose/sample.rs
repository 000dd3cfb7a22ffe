//! One tracked pose with its time, and what all poses of a stream have in common.

/// What every sample of a pose stream shares.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseHeader {
    /// Point names, in the order of [`PoseSample::points`].
    pub points: Vec<String>,
    /// Coordinates per point: 3, or 2 for image landmarks (the third is then zero).
    pub dim: usize,
    /// Names of the extra scalar channels, in the order of [`PoseSample::channels`].
    pub channels: Vec<String>,
}

/// One tracked pose. Right-handed, y up, metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseSample {
    /// Time in seconds on the clock of the stream.
    pub t: f64,
    /// One position per point of the header, `None` where the tracker did not see it.
    pub points: Vec<Option<[f64; 3]>>,
    /// Confidence per point, 0..1; empty when the tracker gives none. How far gestures believe a
    /// point against what the others tell of it; below 0.1 it counts as not seen.
    pub confidence: Vec<f64>,
    /// One value per channel of the header, `None` where the sample carries none.
    pub channels: Vec<Option<f64>>,
}
