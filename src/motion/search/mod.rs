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
//! All is done on plain arrays of Euclidean features, so that any body can use it: [`class`] holds the
//! features of a class and its distances within, [`weight_map`] leads from parameters to blend weights,
//! [`tables`] has the distances of an edge and the two forms of the similarity of blends, [`find`] is
//! the search, [`stored`] the baseline with transition points fixed beforehand, [`calibrate`] finds kappa.
//!
//! Every blend weight of a node is convex, so a node is a point of a Euclidean space of which only
//! mutual distances are known. That is enough for an exact search without visiting all pairs: nodes of
//! equal depth are kept in a tree of balls, and a pair of balls is left out when the least distance
//! between them and the least latency cost already more than the best pair found.

mod blocks;
pub mod calibrate;
pub mod class;
pub mod find;
pub mod reach;
pub mod robot;
mod side;
pub mod stored;
pub mod study;
pub mod tables;
mod tree;
pub mod weight_map;

pub use calibrate::{Calibration, calibrate};
pub use class::{ClassSpec, ClipFeatures, FeatureError, SearchClass, Synthesis};
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
