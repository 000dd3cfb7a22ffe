//! Distances of all reference pairs of an edge, and the similarity of any two blends from them.
//!
//! Casas 2013, (4.3) to (4.5) and appendix A. With convex weights w, v the paper bounds
//! `d(w, v) <= w D_sd v` ([`Form::Bound`]). For a linear blend of Euclidean features the distance itself
//! follows from three tables, also with negative weights as long as they sum to one:
//! `d(w, v) = w D_sd v - 1/2 w D_ss w - 1/2 v D_dd v` ([`Form::Exact`]).

use super::State;
use super::blocks::{across_at, dot, row_times, within_at, without_spread};
use super::class::{SearchClass, squared};
use super::clips::FeatureError;

/// How the similarity of two blends is had from tables.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// The distance of linear blends itself; more references make it that of other blends.
    #[default]
    Exact,
    /// The paper's lower bound of the similarity, (4.5).
    Bound,
}

/// The tables of one edge.
#[derive(Clone, Debug, PartialEq)]
pub struct DistanceTables {
    /// Source frames x target frames x source references x target references.
    across: Vec<f64>,
    frames_d: usize,
    cells: usize,
    d_max: f64,
}

impl DistanceTables {
    /// Measures all pairs of references at all pairs of frames.
    ///
    /// # Errors
    /// Classes embedded in different ways.
    pub fn new(source: &SearchClass, target: &SearchClass) -> Result<Self, FeatureError> {
        source.comparable(target)?;
        let (n, m) = (source.references(), target.references());
        let (frames_s, frames_d) = (source.frames(), target.frames());
        let mut across = Vec::with_capacity(frames_s * frames_d * n * m);
        for ks in 0..frames_s {
            for kd in 0..frames_d {
                for i in 0..n {
                    let feature = source.feature(i, ks);
                    across.extend((0..m).map(|j| squared(feature, target.feature(j, kd))));
                }
            }
        }
        let d_max = across.iter().copied().fold(0.0, f64::max);
        Ok(Self {
            across,
            frames_d,
            cells: n * m,
            d_max,
        })
    }

    /// Largest distance of two references, m^2: similarity 0 (4.4). Zero when all poses are equal.
    pub fn d_max(&self) -> f64 {
        self.d_max
    }

    /// Distances of all references at two frames, source references x target references, m^2.
    pub fn block(&self, frame_s: usize, frame_d: usize) -> &[f64] {
        let at = (frame_s * self.frames_d + frame_d) * self.cells;
        &self.across[at..at + self.cells]
    }

    /// Similarity of a distance, (4.4); 1 when all poses are equal.
    pub fn similarity_of(&self, distance: f64) -> f64 {
        if self.d_max > 0.0 {
            1.0 - distance / self.d_max
        } else {
            1.0
        }
    }

    /// Squared distance of two states, m^2. Allocates; the search does the same without.
    pub fn distance(
        &self,
        source: &SearchClass,
        target: &SearchClass,
        from: &State,
        to: &State,
        form: Form,
    ) -> f64 {
        let (mut w, mut v) = (
            vec![0.0; source.references()],
            vec![0.0; target.references()],
        );
        source.weights(from, &mut w);
        target.weights(to, &mut v);
        self.distance_of_weights(source, target, (from.t, &w), (to.t, &v), form)
    }

    /// Squared distance of two blends, given as time and weights, m^2. The exact form holds for all
    /// weights that sum to one, the bound only when none is negative.
    pub fn distance_of_weights(
        &self,
        source: &SearchClass,
        target: &SearchClass,
        (t_s, w): (f64, &[f64]),
        (t_d, v): (f64, &[f64]),
        form: Form,
    ) -> f64 {
        let (n, m) = (w.len(), v.len());
        let (at_s, at_d) = (source.between(t_s), target.between(t_d));
        let mut block = vec![0.0; n * m];
        across_at(self, at_s, at_d, &mut block);
        let mut row = vec![0.0; m];
        if form == Form::Bound {
            row_times(w, &block, &mut row);
            return dot(&row, v);
        }
        let half = |class: &SearchClass, at, w: &[f64], spread: &mut [f64]| {
            let mut own = vec![0.0; w.len() * w.len()];
            within_at(class, at, spread, &mut own);
            let mut row = vec![0.0; w.len()];
            row_times(w, &own, &mut row);
            0.5 * dot(&row, w)
        };
        let (mut spread_s, mut spread_d) = (vec![0.0; n], vec![0.0; m]);
        let own_s = half(source, at_s, w, &mut spread_s);
        let own_d = half(target, at_d, v, &mut spread_d);
        without_spread(&spread_s, &spread_d, &mut block);
        row_times(w, &block, &mut row);
        (dot(&row, v) - own_s - own_d).max(0.0)
    }

    /// Similarity of two states, 0..1; see [`DistanceTables::distance`].
    pub fn similarity(
        &self,
        source: &SearchClass,
        target: &SearchClass,
        from: &State,
        to: &State,
        form: Form,
    ) -> f64 {
        self.similarity_of(self.distance(source, target, from, to, form))
    }
}
