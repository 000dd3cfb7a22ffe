//! The motion graph: which class is played, and transitions between classes.
//!
//! Rhodin 2016, section 9.5.1: a transition starts when the gesture of the target class rises above
//! 0.2, succeeds when that of the source class has fallen below 0.2, and is aborted when the target's
//! sinks below 0.1; the blend takes half a second. The thesis blends linearly; a linear weight steps
//! the joints' speed at both ends, so the weight here is eased over the same time.
//!
//! A class without an edge from the present one is reached through others. A class may say when it can
//! be left; until then the wish waits. A transition whose target was given up for a third class is
//! interrupted: the third class is entered at once, and what that leaves of a jump is faded by the animator.

mod routes;

use super::smooth::ease;
pub use routes::Routes;

/// Thresholds and times of the graph.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct GraphOptions {
    /// Activation of the target class that starts a transition (0.2).
    pub rise: f64,
    /// Activation of the target class below which a transition is aborted (0.1).
    pub abort: f64,
    /// Activation of the source class below which a transition succeeds (0.2).
    pub release: f64,
    /// Least length of a blend, seconds (0.5).
    pub blend_s: f64,
    /// After this long with no gesture performed the start class is played again, seconds.
    pub idle_s: f64,
}

impl Default for GraphOptions {
    fn default() -> Self {
        Self {
            rise: 0.2,
            abort: 0.1,
            release: 0.2,
            blend_s: 0.5,
            idle_s: 1.0,
        }
    }
}

/// What a class asks for in one step.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Ask {
    /// How much its gesture asks for it, 0..1.
    pub activation: f64,
    /// How much it is held on to while another is asked for, 0..1: its activation, but for a class that plays
    /// once, which goes on by itself and yet gives way where it may be left.
    pub hold: f64,
    /// It is at a point where it may be left.
    pub may_leave: bool,
    /// It has played to its end and waits to be left.
    pub done: bool,
}

impl Ask {
    /// A class that can be left at any time.
    pub fn with(activation: f64) -> Self {
        Self {
            activation,
            hold: activation,
            may_leave: true,
            done: false,
        }
    }
}

/// How a transition between two classes is to be made.
#[derive(Copy, Clone, Debug, PartialEq)]
pub enum Plan {
    /// Both classes play; the weight moves over in this time, seconds.
    Blend {
        /// Least length of the blend that the joints allow, seconds.
        span_s: f64,
    },
    /// The source plays on for this time, then the target is entered at once.
    Jump {
        /// Until the jump, seconds.
        wait_s: f64,
    },
    /// Nothing in the target is like the source now: stay.
    Refuse,
}

/// What happened in a step that the animator must act on.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// Nothing but the passing of time.
    None,
    /// A transition began.
    Began {
        /// The class being entered.
        to: usize,
    },
    /// The class `to` is played from now on, without a blend.
    Jumped {
        /// The new class.
        to: usize,
    },
}

/// A transition in progress.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Transition {
    /// Class being left.
    pub from: usize,
    /// Class being entered.
    pub to: usize,
    /// Class that the way leads to in the end; `to` when there is a direct edge.
    pub goal: usize,
    /// Time along the blend, seconds; goes back when aborted.
    pub along_s: f64,
    /// Length of the blend, seconds.
    pub span_s: f64,
    /// The target's gesture was given up: the blend runs backwards.
    pub aborting: bool,
    /// Time until the target is entered at once, seconds; `None`: a blend.
    pub jump_in_s: Option<f64>,
    /// How fast the blend goes on, -1 (backwards) to 1.
    rate: f64,
}

/// The graph and where in it the puppet is.
#[derive(Clone, Debug)]
pub struct Graph {
    options: GraphOptions,
    routes: Routes,
    nodes: usize,
    start: usize,
    active: usize,
    transition: Option<Transition>,
    /// A class that waits until the active one may be left.
    queued: Option<usize>,
    idle_for_s: f64,
    /// After a refusal nothing is planned for this long, seconds.
    refused_for_s: f64,
    counts: TransitionCounts,
}

/// How many transitions there were.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub struct TransitionCounts {
    /// Completed.
    pub completed: u32,
    /// Started and given up.
    pub aborted: u32,
    /// Broken off for a third class.
    pub interrupted: u32,
    /// Not begun, since nothing in the target was like the source.
    pub refused: u32,
}

/// A blend that turns round does so in this time, seconds: its speed must not step.
const TURN_S: f64 = 0.15;
/// After a refusal the next plan is made so much later, seconds.
const REFUSED_S: f64 = 0.1;

impl Graph {
    /// A graph of `nodes` classes. `edges` are (from, to, cost): the cost of a way decides where it leads
    /// through; out-of-range ones are left out.
    pub fn new(
        nodes: usize,
        start: usize,
        edges: &[(usize, usize, f64)],
        options: GraphOptions,
    ) -> Self {
        Self {
            options,
            routes: Routes::new(nodes, edges),
            nodes,
            start,
            active: start,
            transition: None,
            queued: None,
            idle_for_s: 0.0,
            refused_for_s: 0.0,
            counts: TransitionCounts::default(),
        }
    }

    /// The class being played (or left).
    pub fn active(&self) -> usize {
        self.active
    }

    /// The transition in progress.
    pub fn transition(&self) -> Option<Transition> {
        self.transition
    }

    /// The class that is being blended in; none while a jump is waited for.
    pub fn entering(&self) -> Option<usize> {
        (self.transition.filter(|t| t.jump_in_s.is_none())).map(|t| t.to)
    }

    /// A class that was asked for and waits until the active one may be left.
    pub fn queued(&self) -> Option<usize> {
        self.queued
    }

    /// Least length of a blend, seconds.
    pub fn blend_s(&self) -> f64 {
        self.options.blend_s
    }

    /// Weight of the transition's target, 0..1, eased.
    pub fn blend(&self) -> f64 {
        self.transition.map_or(0.0, |t| ease(t.along_s / t.span_s))
    }

    /// Transitions so far.
    pub fn counts(&self) -> TransitionCounts {
        self.counts
    }

    /// One step: `asks` holds what each class asks for; `plan(from, to)` says how a transition is to be
    /// made. Allocates nothing.
    pub fn step(
        &mut self,
        asks: &[Ask],
        dt_s: f64,
        plan: &mut dyn FnMut(usize, usize) -> Plan,
    ) -> Event {
        let idle = asks.iter().all(|a| !(a.activation > self.options.abort));
        self.idle_for_s = if idle { self.idle_for_s + dt_s } else { 0.0 };
        self.refused_for_s = (self.refused_for_s - dt_s).max(0.0);
        match self.transition {
            Some(transition) => self.go_on(transition, asks, dt_s, plan),
            None => self.look_out(asks, plan),
        }
    }

    /// Is there a way from the active class to `to`.
    fn reaches(&self, to: usize) -> bool {
        self.routes.next(self.active, to).is_some()
    }

    /// The class that is most asked for among those that `allowed` lets through.
    fn strongest(&self, asks: &[Ask], allowed: impl Fn(usize) -> bool) -> Option<usize> {
        (0..self.nodes)
            .filter(|to| asks[*to].activation > self.options.rise && allowed(*to))
            .max_by(|a, b| {
                let (x, y) = (asks[*a].activation, asks[*b].activation);
                // The first of equals, as classes are listed.
                x.total_cmp(&y).then(b.cmp(a))
            })
    }

    fn look_out(&mut self, asks: &[Ask], plan: &mut dyn FnMut(usize, usize) -> Plan) -> Event {
        let here = asks[self.active];
        // While the active class is performed it is left only for a stronger one.
        let best = self.strongest(asks, |to| self.reaches(to)).filter(|to| {
            here.done || !(here.hold >= self.options.release) || asks[*to].activation > here.hold
        });
        let back = self.active != self.start
            && self.reaches(self.start)
            && (here.done || self.idle_for_s > self.options.idle_s);
        let goal = best.or_else(|| back.then_some(self.start));
        self.queued = goal.filter(|_| !here.may_leave);
        match goal {
            Some(goal) if here.may_leave => self.begin(goal, plan),
            _ => Event::None,
        }
    }

    /// Starts the way to `goal`.
    fn begin(&mut self, goal: usize, plan: &mut dyn FnMut(usize, usize) -> Plan) -> Event {
        if self.refused_for_s > 0.0 {
            return Event::None;
        }
        let Some(to) = self.routes.next(self.active, goal) else {
            return Event::None;
        };
        let (span_s, jump_in_s) = match plan(self.active, to) {
            Plan::Blend { span_s } => (span_s.max(self.options.blend_s), None),
            Plan::Jump { wait_s } => (self.options.blend_s, Some(wait_s)),
            Plan::Refuse => {
                self.counts.refused += 1;
                self.refused_for_s = REFUSED_S;
                return Event::None;
            }
        };
        self.transition = Some(Transition {
            from: self.active,
            to,
            goal,
            along_s: 0.0,
            span_s,
            aborting: false,
            jump_in_s,
            rate: 1.0,
        });
        Event::Began { to }
    }

    fn go_on(
        &mut self,
        mut transition: Transition,
        asks: &[Ask],
        dt_s: f64,
        plan: &mut dyn FnMut(usize, usize) -> Plan,
    ) -> Event {
        let asked = asks[transition.goal].activation;
        let to_start = transition.goal == self.start
            && (self.idle_for_s > self.options.idle_s || asks[transition.from].done);
        if !to_start && !(asked >= self.options.abort) {
            transition.aborting = true;
        } else if asked > self.options.rise {
            transition.aborting = false;
        }
        if let Some(wait_s) = transition.jump_in_s {
            return self.wait(transition, wait_s - dt_s);
        }
        if let Some(event) = self.interrupt(&mut transition, asks) {
            return event;
        }
        // The joints may need longer than they seemed to when the blend began.
        if let Plan::Blend { span_s } = plan(transition.from, transition.to)
            && span_s > transition.span_s
        {
            transition.along_s *= span_s / transition.span_s;
            transition.span_s = span_s;
        }
        let towards = if transition.aborting { -1.0 } else { 1.0 };
        let turn = 2.0 * dt_s / TURN_S;
        transition.rate += (towards - transition.rate).clamp(-turn, turn);
        transition.along_s =
            (transition.along_s + transition.rate * dt_s).clamp(0.0, transition.span_s);
        self.transition = Some(transition);
        if transition.aborting && transition.along_s <= 0.0 {
            self.transition = None;
            self.counts.aborted += 1;
        } else if !transition.aborting
            && transition.along_s >= transition.span_s
            && (to_start
                || transition.to != transition.goal
                || asks[transition.from].done
                || !(asks[transition.from].hold >= self.options.release))
        {
            self.arrive(transition);
        }
        Event::None
    }

    /// Plays the source until its jump; a wish that was given up before it is forgotten.
    fn wait(&mut self, mut transition: Transition, left_s: f64) -> Event {
        if transition.aborting {
            self.transition = None;
            self.counts.aborted += 1;
            return Event::None;
        }
        if left_s > 0.0 {
            transition.jump_in_s = Some(left_s);
            self.transition = Some(transition);
            return Event::None;
        }
        self.arrive(transition);
        Event::Jumped { to: transition.to }
    }

    /// A third class is asked for while the target is given up: enter it at once, or, where the way there leads
    /// through the target, go on to that.
    fn interrupt(&mut self, transition: &mut Transition, asks: &[Ask]) -> Option<Event> {
        if !transition.aborting {
            return None;
        }
        let others = |to: usize| to != transition.from && to != transition.to;
        let third = self.strongest(asks, |to| others(to) && self.reaches(to))?;
        if self.routes.next(transition.from, third) == Some(transition.to) {
            (transition.goal, transition.aborting) = (third, false);
            return None;
        }
        // From whichever of the two shows more.
        let shown = if self.blend() > 0.5 {
            transition.to
        } else {
            transition.from
        };
        let to = self.routes.next(shown, third)?;
        // Back to the source at once, too, when the way leads through it.
        self.transition = None;
        self.counts.interrupted += 1;
        self.active = to;
        Some(Event::Jumped { to })
    }

    fn arrive(&mut self, transition: Transition) {
        self.active = transition.to;
        self.transition = None;
        self.idle_for_s = if transition.to == transition.goal {
            0.0
        } else {
            self.idle_for_s
        };
        self.counts.completed += 1;
    }
}

#[cfg(test)]
mod tests;
