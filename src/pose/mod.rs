//! Tracked poses: streams, importers, removal of global motion.

mod sample;

pub use sample::{PoseHeader, PoseSample};
