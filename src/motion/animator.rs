//! The animator: gesture waves and channels in, one pose out.

use super::class::{Drive, Played};
use super::edge::{Choice, EdgeSearch};
use super::graph::{Ask, Event, Graph, Plan, Transition, TransitionCounts};
use super::inertia::Inertia;
use super::layer::{Layer, LayerInput};
use super::mapping::Seen;
use super::node::Node;
use super::pins::Pins;
use super::range::JointRange;
use super::smooth::eased_span_s;
use crate::body::{Feet, PoseSpace, RootAdvance, RootPose};

/// Classes, the graph between them, and layers on top; all state of the character's motion.
pub struct Animator {
    space: Box<dyn PoseSpace>,
    classes: Vec<Node>,
    graph: Graph,
    layers: Vec<Layer>,
    pins: Option<PinnedFeet>,
    /// Nodes x nodes: searches of the edges that have one.
    searches: Vec<Option<Box<EdgeSearch>>>,
    /// What the last search chose.
    choice: Option<Choice>,
    inertia: Inertia,
    /// What each coordinate of a difference may be moved by transitions, per second and squared.
    fastest: Vec<(f64, f64)>,
    played: Vec<Played>,
    asks: Vec<Ask>,
    /// One pose per class, of this step and of the last.
    poses: Vec<f64>,
    last_poses: Vec<f64>,
    /// Two poses one after the other: of the class being left and of the one being entered.
    pair: Vec<f64>,
    /// What was shown before layers and pins, in the last step and the one before it.
    shown: Vec<f64>,
    shown_before: Vec<f64>,
    difference: Vec<f64>,
    last_dt_s: f64,
    root: RootPose,
    /// How the body travelled in the last step, and what a jump left of it, per second.
    root_velocity: RootAdvance,
    root_carry: RootAdvance,
}

/// Feet that stay where they stand, and which limb of each class they belong to.
struct PinnedFeet {
    pins: Pins,
    /// Classes x feet: index of the limb in the class.
    limbs: Vec<Option<usize>>,
    votes: Vec<f64>,
}

/// Share of the joints' speed and acceleration that the way from one class to another may use.
const TRANSITION_SHARE: f64 = 0.4;

impl Animator {
    /// An animator of `classes` (in the order of the graph's nodes) with `layers` on top. `ranges`: what the
    /// first coordinates of a difference may do; transitions take as long as they need.
    pub fn new(
        space: Box<dyn PoseSpace>,
        classes: Vec<Node>,
        graph: Graph,
        layers: Vec<Layer>,
        ranges: &[JointRange],
    ) -> Self {
        let (n, len) = (classes.len(), space.len());
        let fastest = ranges
            .iter()
            .map(|r| {
                (
                    TRANSITION_SHARE * r.velocity,
                    TRANSITION_SHARE * r.acceleration,
                )
            })
            .collect();
        Self {
            inertia: Inertia::new(space.as_ref()),
            fastest,
            pins: None,
            searches: (0..n * n).map(|_| None).collect(),
            choice: None,
            played: vec![Played::default(); n],
            asks: vec![Ask::with(0.0); n],
            classes,
            graph,
            layers,
            poses: vec![0.0; n * len],
            last_poses: vec![0.0; n * len],
            pair: vec![0.0; 2 * len],
            shown: vec![0.0; len],
            shown_before: vec![0.0; len],
            difference: vec![0.0; space.tangent_len()],
            space,
            last_dt_s: 0.0,
            root: RootPose::default(),
            root_velocity: RootAdvance::default(),
            root_carry: RootAdvance::default(),
        }
    }

    /// Keeps `feet` where they stand while the motion has them on the ground.
    pub fn with_pinned_feet(mut self, feet: Box<dyn Feet>) -> Self {
        // Clips tell how the body stands; a pose map knows of joints alone.
        let told = self.classes.iter().position(|c| c.clips().is_some());
        let node = told.unwrap_or_else(|| self.graph.active());
        let mut standing = vec![0.0; self.space.len()];
        self.classes[node].rest_pose(self.space.as_ref(), &mut standing);
        let limbs = (self.classes.iter())
            .flat_map(|class| {
                (0..feet.count())
                    .map(|f| class.limb(feet.name(f)))
                    .collect::<Vec<_>>()
            })
            .collect();
        self.pins = Some(PinnedFeet {
            limbs,
            votes: vec![0.0; feet.count()],
            pins: Pins::new(feet, &standing),
        });
        self
    }

    /// Starts the way at `root`.
    pub fn with_root(mut self, root: RootPose) -> Self {
        self.root = root;
        self
    }

    /// Chooses transitions from node `from` to node `to` by `search`, in place of a blend.
    pub fn with_search(mut self, from: usize, to: usize, search: EdgeSearch) -> Self {
        let nodes = self.classes.len();
        if from < nodes && to < nodes {
            self.searches[from * nodes + to] = Some(Box::new(search));
        }
        self
    }

    /// What the last transition search chose, while its transition is awaited or just made.
    pub fn choice(&self) -> Option<Choice> {
        self.choice
    }

    /// The body's pose space.
    pub fn space(&self) -> &dyn PoseSpace {
        self.space.as_ref()
    }

    /// Number of coordinates of a pose.
    pub fn coordinates(&self) -> usize {
        self.space.len()
    }

    /// The pose with nothing performed, into `out`: where a run starts.
    pub fn rest_pose(&mut self, out: &mut [f64]) {
        let active = self.graph.active();
        self.classes[active].rest_pose(self.space.as_ref(), out);
        if let (None, Some(feet)) = (self.classes[active].clips(), &self.pins) {
            feet.pins.lower_to_ground(out);
        }
    }

    /// Shows the performer's pose to `node`, if it is one that maps poses; before [`Animator::step`].
    pub fn see(&mut self, node: usize, seen: Seen<'_>) {
        if let Some(Node::Direct(class)) = self.classes.get_mut(node) {
            class.see(seen);
        }
    }

    /// One step of `dt_s`. `drives`: one per class; `input`: what drives the layers. The pose goes into
    /// `out`. Allocates nothing.
    pub fn step(&mut self, drives: &[Drive], input: &LayerInput<'_>, dt_s: f64, out: &mut [f64]) {
        self.play_classes(drives, dt_s);
        let event = self.step_graph(drives, dt_s);
        let len = self.space.len();
        let active = self.graph.active();
        let entering = self.graph.entering();
        let blend = self.graph.blend();
        let of = |node: usize| node * len..(node + 1) * len;
        match entering {
            Some(to) => {
                self.pair[..len].copy_from_slice(&self.poses[of(active)]);
                self.pair[len..].copy_from_slice(&self.poses[of(to)]);
                self.space.blend(&self.pair, &[1.0 - blend, blend], out);
            }
            None => out.copy_from_slice(&self.poses[of(active)]),
        }
        if let Event::Jumped { to } = event {
            self.take_up_jump(to, &drives[to], dt_s, out);
        }
        self.inertia.step(self.space.as_ref(), dt_s, out);
        if dt_s > 0.0 {
            std::mem::swap(&mut self.shown, &mut self.shown_before);
            self.shown.copy_from_slice(out);
            if self.last_dt_s == 0.0 {
                self.shown_before.copy_from_slice(out);
            }
            self.last_dt_s = dt_s;
        }
        for layer in &mut self.layers {
            layer.step(self.space.as_ref(), input, dt_s, out);
        }
        self.advance_root(active, entering, blend, dt_s);
        self.pin_feet(active, entering, blend, dt_s, out);
    }

    /// Every class follows its gesture, so that one entered is already in phase.
    fn play_classes(&mut self, drives: &[Drive], dt_s: f64) {
        std::mem::swap(&mut self.poses, &mut self.last_poses);
        let len = self.space.len();
        let entering = self.graph.entering();
        for (node, class) in self.classes.iter_mut().enumerate() {
            let shown = node == self.graph.active() || Some(node) == entering;
            class.show(shown, &drives[node]);
            let pose = &mut self.poses[node * len..(node + 1) * len];
            self.played[node] = class.step(self.space.as_ref(), drives[node], dt_s, pose);
            if let (None, Some(feet)) = (class.clips(), &self.pins) {
                feet.pins.lower_to_ground(pose);
            }
            let number = |v: f64| if v.is_finite() { v } else { 0.0 };
            self.asks[node] = Ask {
                activation: number(class.activation(&drives[node])),
                hold: number(class.hold(&drives[node])),
                may_leave: class.may_leave(),
                done: class.done(),
            };
        }
    }

    fn step_graph(&mut self, drives: &[Drive], dt_s: f64) -> Event {
        let len = self.space.len();
        let nodes = self.classes.len();
        let Self {
            graph,
            asks,
            poses,
            space,
            difference,
            fastest,
            searches,
            choice,
            classes,
            ..
        } = self;
        let mut plan = |from: usize, to: usize| {
            let both = (classes[from].clips(), classes[to].clips());
            if let (Some(search), (Some(source), Some(target))) =
                (&mut searches[from * nodes + to], both)
            {
                let (t, now) = source.now();
                *choice = search.choose(t, now, target.wanted(&drives[to])).ok();
                return choice.map_or(Plan::Refuse, |c| Plan::Jump { wait_s: c.wait_s });
            }
            space.diff(
                &poses[from * len..(from + 1) * len],
                &poses[to * len..(to + 1) * len],
                difference,
            );
            let ways = difference.iter().zip(fastest.iter());
            Plan::Blend {
                span_s: ways.fold(0.0, |most, (way, (v, a))| {
                    eased_span_s(*way, *v, *a).max(most)
                }),
            }
        };
        let waited = graph.transition();
        let event = graph.step(asks, dt_s, &mut plan);
        self.follow_routes(event, waited);
        event
    }

    /// Sends the source of a transition on its way when one began, and off it when it is over.
    fn follow_routes(&mut self, event: Event, waited: Option<Transition>) {
        let nodes = self.classes.len();
        let waits = self.graph.transition().filter(|t| t.jump_in_s.is_some());
        if let (Event::Began { to }, Some(_)) = (event, waits) {
            let from = self.graph.active();
            if let (Some(search), Some(class)) = (
                &self.searches[from * nodes + to],
                self.classes[from].clips_mut(),
            ) {
                search.route(class.route_mut());
                class.follow_route();
            }
        } else if let (Some(before), None) = (waited, waits)
            && let Some(class) = self.classes[before.from].clips_mut()
        {
            class.leave_route();
            if event != (Event::Jumped { to: before.to }) {
                // Given up: what was chosen is of no use to another transition.
                self.choice = None;
            }
        }
    }

    /// Fades what entering `to` at once leaves between what was shown and `pose`, the pose now played.
    fn take_up_jump(&mut self, to: usize, drive: &Drive, dt_s: f64, pose: &mut [f64]) {
        let len = self.space.len();
        let of = to * len..(to + 1) * len;
        if let (Some(choice), Some(class)) = (self.choice.take(), self.classes[to].clips_mut()) {
            class.enter(choice.entry);
            class.show(true, drive);
            // The step before the entry does not show; it tells how fast the entered motion goes.
            class.step(
                self.space.as_ref(),
                *drive,
                0.0,
                &mut self.last_poses[of.clone()],
            );
            self.played[to] = class.step(self.space.as_ref(), *drive, dt_s, pose);
            self.poses[of.clone()].copy_from_slice(pose);
        }
        // Where the entered motion would have been one step earlier.
        let before = &mut self.pair[..len];
        before.copy_from_slice(&self.last_poses[of.clone()]);
        if dt_s > 0.0 {
            self.space.diff(before, pose, &mut self.difference);
            let back = -self.last_dt_s / dt_s;
            self.space.add(before, &self.difference, back);
        }
        self.root_carry = self.root_velocity;
        self.root_carry.add(self.played[to].root_velocity, -1.0);
        self.inertia.take_up(
            self.space.as_ref(),
            (&self.shown, &self.shown_before),
            (&self.last_poses[of], before),
            self.last_dt_s,
            self.graph.blend_s(),
            &self.fastest,
        );
    }

    fn advance_root(&mut self, active: usize, entering: Option<usize>, blend: f64, dt_s: f64) {
        let mut velocity = RootAdvance::default();
        let parts = [(Some(active), 1.0 - blend), (entering, blend)];
        for (node, share) in parts.into_iter().filter_map(|(n, s)| n.map(|n| (n, s))) {
            velocity.add(self.played[node].root_velocity, share);
        }
        // The body does not stop at a jump either.
        velocity.add(self.root_carry, self.inertia.left());
        if dt_s > 0.0 {
            self.root_velocity = velocity;
        }
        self.root.travel(velocity.scaled(dt_s));
    }

    fn pin_feet(
        &mut self,
        active: usize,
        entering: Option<usize>,
        blend: f64,
        dt_s: f64,
        out: &mut [f64],
    ) {
        let Some(feet) = &mut self.pins else { return };
        let count = feet.votes.len();
        let fades = self.inertia.active();
        for (foot, vote) in feet.votes.iter_mut().enumerate() {
            let of = |node: usize| {
                feet.limbs[node * count + foot].map_or(self.classes[node].stands(), |limb| {
                    self.classes[node].contact(limb)
                })
            };
            *vote = match entering {
                Some(to) => (1.0 - blend) * of(active) + blend * of(to),
                // After a jump a foot in the air lands when it gets there.
                None if fades && !feet.pins.on_ground(foot) => f64::NAN,
                None => of(active),
            };
        }
        feet.pins.step(&feet.votes, &self.root, dt_s, out);
    }

    /// Feet that are pinned, where the body has some.
    pub fn pins(&self) -> Option<&Pins> {
        self.pins.as_ref().map(|p| &p.pins)
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
