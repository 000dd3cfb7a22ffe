//! Tracked poses: streams, importers, removal of global motion, composed performances.
//!
//! A source yields lines; [`json`] and [`csv`] turn one line into one [`PoseSample`];
//! [`Validator`] decides whether that sample may pass. [`PoseReader`] ties the three together for
//! files and pipes, a network source does the same with its datagrams.

pub mod compose;
pub mod csv;
mod error;
pub mod global;
pub mod json;
pub mod leap;
mod reader;
mod recording;
mod sample;
mod validate;
mod write;

pub use error::PoseError;
pub use global::{GlobalFit, GlobalMotion, GlobalOptions};
pub use reader::{PoseFormat, PoseReader};
pub use recording::Recording;
pub use sample::{PoseHeader, PoseSample};
pub use validate::{
    BadSample, FaultCounts, LONGEST_JUMP_S, LONGEST_STEP_S, MAX_BAD_IN_A_ROW, MAX_LINE_BYTES,
    SampleFault, Validator,
};
pub use write::PoseWriter;
