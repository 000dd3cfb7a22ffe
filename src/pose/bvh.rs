//! BVH motion capture: skeleton and frames as they stand in the file, in the file's own unit.
//!
//! ```text
//! HIERARCHY
//! ROOT Hips
//! {
//!   OFFSET 0 90 0
//!   CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
//!   JOINT Chest
//!   {
//!     OFFSET 0 20 0
//!     CHANNELS 3 Zrotation Xrotation Yrotation
//!     End Site
//!     {
//!       OFFSET 0 30 0
//!     }
//!   }
//! }
//! MOTION
//! Frames: 1
//! Frame Time: 0.0333333
//! 0 90 0 0 0 0 0 0 0
//! ```
//! The format was never standardised; what is read here:
//! - rotations in degrees, applied in the order of the joint's channels: `Zrotation Xrotation
//!   Yrotation` is the matrix product Rz Rx Ry;
//! - a position channel **replaces** that coordinate of the joint's OFFSET, of any joint, not only
//!   of the root;
//! - a frame is one line. Frames and values are counted, never believed;
//! - lengths have no unit: see [`LengthUnit`]. Right-handed, y up, as everybody writes it.
//!
//! [`BvhFile`] keeps what was read; `forward` turns it into places of joints.

mod forward;
mod parse;
mod stream;
mod unit;

pub use forward::JointPlace;
pub(super) use stream::BvhStream;
pub use stream::{BvhOptions, to_recording};
pub use unit::{LengthUnit, UnitGuess};

/// Joints (with End Sites) a file may have.
pub const MAX_JOINTS: usize = 1000;

/// How deep joints may be nested.
pub const MAX_DEPTH: usize = 200;

/// Largest file that is read, in bytes: over two hours of a hundred joints at 60 frames per second.
pub const MAX_BYTES: u64 = 1 << 30;

/// What one number of a frame is, for its joint.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Position along an axis (0 is x, 1 y, 2 z), in the file's unit; replaces the offset.
    Position(usize),
    /// Rotation about an axis (0 is x, 1 y, 2 z), degrees.
    Rotation(usize),
}

impl Channel {
    /// Every channel with its name in a file.
    const NAMES: [(&'static str, Channel); 6] = [
        ("Xposition", Channel::Position(0)),
        ("Yposition", Channel::Position(1)),
        ("Zposition", Channel::Position(2)),
        ("Xrotation", Channel::Rotation(0)),
        ("Yrotation", Channel::Rotation(1)),
        ("Zrotation", Channel::Rotation(2)),
    ];

    /// The channel of that name, whatever its case.
    fn of(name: &str) -> Option<Self> {
        Self::NAMES
            .iter()
            .find(|(known, _)| known.eq_ignore_ascii_case(name))
            .map(|(_, channel)| *channel)
    }
}

/// A joint of the skeleton, or the End Site of one.
#[derive(Clone, Debug, PartialEq)]
pub struct BvhJoint {
    /// Its name, unique in the file; an End Site's is its parent's with `_end`.
    pub name: String,
    /// Index of the parent, always smaller than the joint's own; `None` for a root.
    pub parent: Option<usize>,
    /// Place in the parent's frame at rest, in the file's unit.
    pub offset: [f64; 3],
    /// Its numbers in a frame, in their order.
    pub channels: Vec<Channel>,
    /// Index of the first of them in a frame.
    pub first_channel: usize,
    /// Whether this is an End Site: the tip of its parent, without channels.
    pub is_end: bool,
}

/// A BVH file: the skeleton and its frames.
#[derive(Clone, Debug, PartialEq)]
pub struct BvhFile {
    /// Joints, every parent before its children.
    pub joints: Vec<BvhJoint>,
    /// From frame to frame, seconds.
    pub frame_time_s: f64,
    /// Numbers in a frame.
    pub channels: usize,
    /// Frames one after another, `channels` numbers each; positions in the file's unit, degrees.
    pub values: Vec<f64>,
    /// Line of the first frame, from 1.
    pub first_frame_line: u64,
}

impl BvhFile {
    /// How many frames there are; at least one after parsing.
    pub fn frames(&self) -> usize {
        self.values.len() / self.channels.max(1)
    }

    /// The numbers of frame `index`; empty when there is no such frame.
    pub fn frame(&self, index: usize) -> &[f64] {
        let from = index.saturating_mul(self.channels);
        self.values
            .get(from..from.saturating_add(self.channels))
            .unwrap_or(&[])
    }
}
