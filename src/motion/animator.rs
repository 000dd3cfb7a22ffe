//! The animator: gesture waves and channels in, one pose out.

use super::class::{Drive, Played};
use super::graph::{Graph, Transition, TransitionCounts};
use super::layer::Layer;
use super::mapping::Seen;
use super::node::Node;
use crate::body::{PoseSpace, RootAdvance, RootPose};

/// Classes, the graph between them, and layers on top; all state of the character's motion.
pub struct Animator {
    space: Box<dyn PoseSpace>,
    classes: Vec<Node>,
    graph: Graph,
    layers: Vec<Layer>,
    played: Vec<Played>,
    activation: Vec<f64>,
    /// Two poses one after the other: of the active class and of the one being entered.
    pair: Vec<f64>,
    root: RootPose,
}

impl Animator {
    /// An animator of `classes` (in the order of the graph's nodes) with `layers` on top.
    pub fn new(
        space: Box<dyn PoseSpace>,
        classes: Vec<Node>,
        graph: Graph,
        layers: Vec<Layer>,
    ) -> Self {
        let (n, len) = (classes.len(), space.len());
        Self {
            space,
            played: vec![Played::default(); n],
            activation: vec![0.0; n],
            classes,
            graph,
            layers,
            pair: vec![0.0; 2 * len],
            root: RootPose::default(),
        }
    }

    /// Number of coordinates of a pose.
    pub fn coordinates(&self) -> usize {
        self.space.len()
    }

    /// The pose with nothing performed, into `out`: where a run starts.
    pub fn rest_pose(&mut self, out: &mut [f64]) {
        let active = self.graph.active();
        self.classes[active].rest_pose(self.space.as_ref(), out);
    }

    /// Shows the performer's pose to `node`, if it is one that maps poses; before [`Animator::step`].
    pub fn see(&mut self, node: usize, seen: Seen<'_>) {
        if let Some(Node::Direct(class)) = self.classes.get_mut(node) {
            class.see(seen);
        }
    }

    /// One step of `dt_s`. `drives`: one per class; `channels`: values by channel index. The pose goes
    /// into `out`. Allocates nothing.
    pub fn step(&mut self, drives: &[Drive], channels: &[f64], dt_s: f64, out: &mut [f64]) {
        for ((activation, drive), class) in
            (self.activation.iter_mut().zip(drives)).zip(&self.classes)
        {
            *activation = class.activation(drive);
        }
        self.graph.step(&self.activation, dt_s);
        let len = self.space.len();
        let active = self.graph.active();
        let entering = self.graph.transition().map(|t| t.to);
        let space = self.space.as_ref();
        let (first, second) = self.pair.split_at_mut(len);
        for (node, class) in self.classes.iter_mut().enumerate() {
            // All classes follow their gestures, so that one entered is already in phase; only the
            // two that show are worth a pose of their own.
            let pose = if Some(node) == entering {
                &mut *second
            } else if node == active {
                &mut *first
            } else {
                &mut *out
            };
            self.played[node] = class.step(space, drives[node], dt_s, pose);
        }
        let blend = self.graph.blend();
        if entering.is_some() {
            space.blend(&self.pair, &[1.0 - blend, blend], out);
        } else {
            out.copy_from_slice(&self.pair[..len]);
        }
        for layer in &mut self.layers {
            let value = channels.get(layer.channel).copied().unwrap_or(f64::NAN);
            layer.step(space, value, dt_s, out);
        }
        self.advance_root(active, entering, blend, dt_s);
    }

    fn advance_root(&mut self, active: usize, entering: Option<usize>, blend: f64, dt_s: f64) {
        let mut velocity = RootAdvance::default();
        let parts = [(Some(active), 1.0 - blend), (entering, blend)];
        for (node, share) in parts.into_iter().filter_map(|(n, s)| n.map(|n| (n, s))) {
            velocity.add(self.played[node].root_velocity, share);
        }
        self.root.travel(velocity.scaled(dt_s));
    }

    /// Classes, in node order.
    pub fn classes(&self) -> &[Node] {
        &self.classes
    }

    /// Layers on top.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// What each class did in the last step, in node order.
    pub fn played(&self) -> &[Played] {
        &self.played
    }

    /// Node of the class being played.
    pub fn active(&self) -> usize {
        self.graph.active()
    }

    /// The transition in progress and the weight of its target.
    pub fn transition(&self) -> Option<(Transition, f64)> {
        self.graph.transition().map(|t| (t, self.graph.blend()))
    }

    /// Transitions so far.
    pub fn counts(&self) -> TransitionCounts {
        self.graph.counts()
    }

    /// Travelled way.
    pub fn root(&self) -> RootPose {
        self.root
    }
}
