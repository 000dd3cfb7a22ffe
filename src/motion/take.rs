//! A take: a motion as it was recorded, sampled evenly in time, before it becomes a clip.

use crate::body::{RootPose, Skeleton};
use std::sync::Arc;

/// Evenly sampled poses of a body and its way over the ground.
///
/// What importers give and exporters write; analysis and cutting work on it. Frames are at
/// `0, dt_s, 2 dt_s, ...`; metres, radians, x forward, y left, z up.
#[derive(Clone, Debug)]
pub struct Take {
    /// Name of the motion, usually that of its file.
    pub name: String,
    /// Where it comes from: author, recording, licence.
    pub origin: String,
    /// Time between frames, seconds, above zero.
    pub dt_s: f64,
    /// What the coordinates of a pose are.
    pub body: TakeBody,
    /// One pose per frame, free of the root's place and heading.
    pub poses: Vec<Vec<f64>>,
    /// The root's place and heading, one per frame; heading without jumps of a full turn.
    pub roots: Vec<RootPose>,
    /// The last frame is the first one, a cycle later.
    pub wraps: bool,
}

/// The body of a take.
#[derive(Clone, Debug)]
pub enum TakeBody {
    /// Joint positions of a robot that is bolted down.
    Joints(Vec<String>),
    /// Joint positions, then the six coordinates of the body over the ground
    /// (see [`crate::body::JointSpace`]).
    Floating(Vec<String>),
    /// Poses of a skeleton (see [`crate::body::SkeletonSpace`]).
    Skeleton(Arc<Skeleton>),
}

impl Take {
    /// Number of frames.
    pub fn len(&self) -> usize {
        self.poses.len()
    }

    /// Whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.poses.is_empty()
    }

    /// Time from the first to the last frame, seconds.
    pub fn duration_s(&self) -> f64 {
        self.dt_s * self.len().saturating_sub(1) as f64
    }
}
