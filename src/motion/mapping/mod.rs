//! Direct pose mapping: the performer's pose itself drives the body, learned from 4 to 8 pairs.
//!
//! Rhodin 2016, chapter 8. [`LatentVolume`] bounds the target poses, [`Regression`] leads from
//! features of the source pose into it, [`RootMap`] from the change of pose to travel, [`candidates`]
//! tell which pair would teach most; [`PoseMap`] is the whole, [`DirectClass`] its node in the motion
//! graph, [`MapFile`] its file. Features come from the gesture floor, through the puppet.

mod body;
mod error;
pub mod file;
mod guide;
mod map;
mod node;
mod regression;
mod root;
pub mod study;
mod volume;
mod write;

pub use body::{learn_volume, target_frames};
pub use error::MappingError;
pub use file::{MapFile, MapFileError};
pub use guide::{CANDIDATE_APART_S, CANDIDATES, Candidate, candidates};
pub use map::{MapOptions, Pair, PoseMap, SCALED_SQUARE, scaled, spread_m};
pub use node::{DirectClass, Seen};
pub use regression::{NOISE_VARIANCE, Regression, Uncertainty};
pub use root::{ROOT_RIDGE, RootMap};
pub use volume::{LatentVolume, MOST_AXES};
