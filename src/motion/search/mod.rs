//! Online transition search of a parametric motion graph: where to leave one class, where to enter another.
//!
//! D. Casas, *Interactive Video-Realistic Character Animation from 4D Performance Capture*, PhD thesis,
//! University of Surrey 2013, chapter 4. A class is a continuous space of motions over normalised time
//! `t` (0..1) and up to [`MAX_PARAMETERS`] parameters (each 0..1). An edge stores no transition points:
//! when a transition is asked for, a trellis grows forwards from the present state of the source and
//! one backwards from the wished state of the target, and the cheapest pair of nodes is the jump.
//!
//! ```text
//! cost = kappa (1 - s) + lambda * 25 * latency_s  (+ mu * penalty of both nodes)       (4.2), (4.6)
//! s    = 1 - d / d_max,   d = |x_s - x_d|^2 / n,   x = [positions; sqrt(lambda_v) velocities]   (4.3), (4.4)
//! ```
//!
//! The paper minimises a similarity in (4.6); it can only mean a dissimilarity, so `E_S = kappa (1 - s)`.
//!
//! All is done on plain arrays of Euclidean features, so that any body can use it: [`clips`] are
//! what goes in, [`class`] holds the features of a class and its distances within, [`weight_map`] leads from parameters to blend weights,
//! [`tables`] has the distances of an edge and the two forms of the similarity of blends, [`find`] is
//! the search, [`stored`] the baseline with transition points fixed beforehand, [`calibrate()`] finds kappa.
//!
//! The search is exact and visits few pairs ([`Search::find`] says how); [`Search::exhaustive`] visits all.
//!
//! ```
//! use handwave::motion::search::*;
//! use std::sync::Arc;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // Two clips of one feature each, slow and quick, as a class with one parameter.
//! let wave = |size: f64| -> Vec<f64> { (0..20).map(|k| size * (0.314 * k as f64).sin()).collect() };
//! let (small, large) = (wave(0.1), wave(0.3));
//! let clip = |positions, duration_s| ClipFeatures {
//!     name: "clip", duration_s, width: 1, positions, root: &[], penalty: &[],
//! };
//! let clips = [clip(&small, 0.5), clip(&large, 1.0)];
//! let spec = ClassSpec::new("walk", true, 1);
//! let walk = Arc::new(SearchClass::new(&spec, &clips, Arc::new(Hat::corners(1)))?);
//! let spec = ClassSpec::new("bow", false, 1);
//! let bow = Arc::new(SearchClass::new(&spec, &clips[..1], Arc::new(Hat::corners(0)))?);
//! let tables = Arc::new(DistanceTables::new(&walk, &bow)?);
//! // Once per edge; a request then allocates nothing.
//! let mut search = Search::new(walk, bow, tables, SearchOptions::default())?;
//! let now = State::new(0.3, &[0.5]);
//! let found = search.find(&now, &Target::Entry { parameters: [0.0; 4], between: [0.0, 0.5] })?;
//! println!("leave at {:.2} in {:.2} s, enter at {:.2}", found.exit.t, found.exit_after_s, found.entry.t);
//! for point in search.source_route() { println!("{:.2} s: {:?}", point.at_s, point.state); }
//! # Ok(())
//! # }
//! ```

mod blocks;
mod bound;
mod boxes;
pub mod calibrate;
pub mod class;
pub mod clip_blend;
pub mod clips;
pub mod find;
pub mod reach;
mod side;
pub mod stored;
pub mod study;
pub mod tables;
pub mod weight_map;

pub use calibrate::{Calibration, calibrate};
pub use class::SearchClass;
pub use clips::{ClassSpec, ClipFeatures, FeatureError, Synthesis};
pub use find::{Cost, Found, NoTransition, OptionsError, Search, SearchOptions, Target, Waypoint};
pub use stored::{StoredFound, StoredPoint, StoredTransitions};
pub use tables::{DistanceTables, Form};
pub use weight_map::{Hat, RbfMap, WeightMap};

/// Most free parameters of a class.
pub const MAX_PARAMETERS: usize = 4;

/// Frames per second in which latency is counted, as in the paper.
pub const FRAMES_PER_SECOND: f64 = 25.0;

/// A state of a class: where in normalised time, and with which parameters.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Normalised time, 0..1; cyclic classes wrap, open ones go from 0 to 1.
    pub t: f64,
    /// Parameters, each 0..1; those that the class does not have are ignored.
    pub parameters: [f64; MAX_PARAMETERS],
}

impl State {
    /// A state from its time and the parameters that the class has; more than four are ignored.
    pub fn new(t: f64, parameters: &[f64]) -> Self {
        let mut state = Self {
            t,
            ..Self::default()
        };
        for (to, from) in state.parameters.iter_mut().zip(parameters) {
            *to = *from;
        }
        state
    }
}
