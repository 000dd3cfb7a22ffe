//! A node of the motion graph: a class of clips, or a pose map that drives the body directly.

use super::class::{Drive, EXTRA, MotionClass, Played};
use super::layer::ChannelMap;
use super::mapping::DirectClass;
use crate::body::PoseSpace;

/// What drives a class.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct ClassInput {
    /// Index of its gesture in the front end; `None` for a pose map that needs none.
    pub gesture: Option<usize>,
    /// The gesture is to be performed in the opposite sense.
    pub reverse: bool,
    /// The channel that drives it in place of a gesture, by index in the front end.
    pub channel: Option<(usize, ChannelMap)>,
    /// Index of its feature in the front end, for a pose map.
    pub feature: Option<usize>,
    /// Channels that drive its parameters beside amplitude and frequency, by index in the front end.
    pub extra: [Option<(usize, ChannelMap)>; EXTRA],
}

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
            Node::Direct(class) => {
                space.rest(out);
                class.rest_pose(&mut out[..class.map().joints()]);
            }
        }
    }

    /// Index of the limb `name` among those with timelines of their own.
    pub fn limb(&self, name: &str) -> Option<usize> {
        match self {
            Node::Clips(class) => class.limbs().iter().position(|l| l == name),
            Node::Direct(_) => None,
        }
    }

    /// How much of the motion has limb `limb` on the ground, 0..1.
    pub(super) fn contact(&self, limb: usize) -> f64 {
        match self {
            Node::Clips(class) => class.contact(limb),
            Node::Direct(_) => f64::NAN,
        }
    }

    /// The same for limbs that the class does not know: it stands on them, or cannot tell.
    pub(super) fn stands(&self) -> f64 {
        match self {
            Node::Clips(class) if class.limbs().is_empty() => 1.0,
            _ => f64::NAN,
        }
    }

    /// Whether the class may be left now.
    pub(super) fn may_leave(&self) -> bool {
        match self {
            Node::Clips(class) => class.may_leave(),
            Node::Direct(_) => true,
        }
    }

    /// Whether it has played to its end.
    pub(super) fn done(&self) -> bool {
        match self {
            Node::Clips(class) => class.done(),
            Node::Direct(_) => false,
        }
    }

    /// Tells the node whether it shows.
    pub(super) fn show(&mut self, shown: bool, drive: &Drive) {
        if let Node::Clips(class) = self {
            class.show(shown, drive);
        }
    }

    /// The class of clips, if it is one.
    pub(super) fn clips(&self) -> Option<&MotionClass> {
        match self {
            Node::Clips(class) => Some(class),
            Node::Direct(_) => None,
        }
    }

    /// The same, to be changed.
    pub(super) fn clips_mut(&mut self) -> Option<&mut MotionClass> {
        match self {
            Node::Clips(class) => Some(class),
            Node::Direct(_) => None,
        }
    }

    /// How much `drive` asks for this node, for the graph.
    pub(super) fn activation(&self, drive: &Drive) -> f64 {
        match self {
            Node::Clips(class) => class.activation(drive),
            // Played while nothing else is: it asks for nothing itself.
            Node::Direct(class) if class.always => 0.0,
            Node::Direct(_) if drive.frequency_hz < 0.0 => 0.0,
            Node::Direct(_) => drive.amplitude,
        }
    }

    /// How much it is held on to while another class is asked for.
    pub(super) fn hold(&self, drive: &Drive) -> f64 {
        match self {
            Node::Clips(class) => class.hold(drive),
            Node::Direct(_) => self.activation(drive),
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
            Node::Direct(class) => {
                space.rest(out);
                let joints = class.map().joints();
                class.step(dt_s, &mut out[..joints])
            }
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
