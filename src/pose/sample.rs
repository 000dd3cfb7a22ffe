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

impl PoseHeader {
    /// Index in a sample of this stream of each of `names`: among its points, or among its channels where
    /// it has no points (a face, whose channels are read as points, [`super::channel_as_point`]).
    ///
    /// # Errors
    /// The names that the stream does not have.
    pub fn columns_of(&self, names: &[String]) -> Result<Vec<usize>, Vec<String>> {
        let places = if self.points.is_empty() {
            &self.channels
        } else {
            &self.points
        };
        let find = |name: &String| places.iter().position(|place| place == name);
        let found: Option<Vec<usize>> = names.iter().map(find).collect();
        found.ok_or_else(|| {
            let missing = names.iter().filter(|name| find(name).is_none());
            missing.cloned().collect()
        })
    }
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
