//! What trackers get wrong, mended before anything is read from a pose: swapped sides, points that
//! jump for a sample, points that are not seen, performers of another size.
//!
//! All of it works sample by sample on the stamps as they come, looks only back, adds no delay to
//! a good sample and leaves a clean one bit for bit as it was.

mod missing;
mod outlier;
mod scale;
mod swap;
mod track;

pub(super) use missing::Completion;
pub(super) use outlier::OutlierFilter;
pub use scale::PerformerScale;
pub(super) use scale::RestMeasure;
pub(super) use swap::SideSwaps;

/// What had to be mended so far.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub struct TrackingCounts {
    /// Points that were taken as not seen for a sample, because they had jumped.
    pub outliers: u64,
    /// Samples in which left and right were put back into their places.
    pub swapped: u64,
    /// Points that were not seen (outliers included) or not trusted in full, and were filled in.
    pub filled: u64,
}

impl std::fmt::Display for TrackingCounts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} points rejected, {} filled in, left and right put back in {} samples",
            self.outliers, self.filled, self.swapped
        )
    }
}
