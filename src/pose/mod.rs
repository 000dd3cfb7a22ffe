//! Tracked poses: streams, importers, removal of global motion, composed performances.
//!
//! A source yields lines; [`json`] and [`csv`] turn one line into one [`PoseSample`];
//! [`Validator`] decides whether that sample may pass. [`PoseReader`] ties the three together for
//! files and pipes, a network source does the same with its datagrams.

pub mod aframe;
pub mod bvh;
pub mod compose;
pub mod csv;
mod error;
pub mod global;
pub mod import;
pub mod json;
pub mod leap;
pub mod live_link;
mod reader;
mod recording;
mod sample;
mod select;
pub mod table;
mod validate;
mod write;

pub use error::{LineFault, PoseError};
pub use global::{GlobalFit, GlobalMotion, GlobalOptions};
pub use reader::{PoseFormat, PoseReader};
pub use recording::Recording;
pub use sample::{PoseHeader, PoseSample};
pub use select::{CHANNEL_STROKE_M, channel_as_point};
pub use validate::{
    BadSample, FaultCounts, LONGEST_JUMP_S, LONGEST_STEP_S, MAX_BAD_IN_A_ROW, MAX_LINE_BYTES,
    SampleFault, Validator,
};
pub use write::PoseWriter;
