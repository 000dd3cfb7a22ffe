//! A node of the motion graph: a class of clips, or a pose map that drives the body directly.

use super::class::{Drive, MotionClass, Played};
use super::mapping::DirectClass;
use crate::body::PoseSpace;

/// What a node of the graph plays.
#[derive(Clone, Debug)]
pub enum Node {
    /// Clips, driven by a gesture's wave.
    Clips(Box<MotionClass>),
    /// A pose map, driven by the pose itself.
    Direct(Box<DirectClass>),
}

impl Node {
    /// Class name.
    pub fn name(&self) -> &str {
        match self {
            Node::Clips(class) => &class.name,
            Node::Direct(class) => &class.name,
        }
    }

    /// Blend weight of every example in the last step; empty without examples.
    pub fn weights(&self) -> &[f64] {
        match self {
            Node::Clips(class) => class.weights(),
            Node::Direct(_) => &[],
        }
    }

    /// Pose with nothing performed, into `out`.
    pub fn rest_pose(&mut self, space: &dyn PoseSpace, out: &mut [f64]) {
        match self {
            Node::Clips(class) => class.rest_pose(space, out),
            Node::Direct(class) => class.rest_pose(out),
        }
    }

    /// How much `drive` asks for this node, for the graph.
    pub(super) fn activation(&self, drive: &Drive) -> f64 {
        match self {
            // Played while nothing else is: it asks for nothing itself.
            Node::Direct(class) if class.always => 0.0,
            // A gesture in the opposite sense does not activate the class.
            _ if drive.frequency_hz < 0.0 => 0.0,
            _ => drive.amplitude,
        }
    }

    /// One step of `dt_s` under `drive`; the pose goes into `out`. Allocates nothing.
    pub fn step(
        &mut self,
        space: &dyn PoseSpace,
        drive: Drive,
        dt_s: f64,
        out: &mut [f64],
    ) -> Played {
        match self {
            Node::Clips(class) => class.step(space, drive, dt_s, out),
            Node::Direct(class) => class.step(dt_s, out),
        }
    }
}

impl From<MotionClass> for Node {
    fn from(class: MotionClass) -> Self {
        Node::Clips(Box::new(class))
    }
}

impl From<DirectClass> for Node {
    fn from(class: DirectClass) -> Self {
        Node::Direct(Box::new(class))
    }
}
