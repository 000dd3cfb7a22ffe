//! The motion graph: which class is played, and transitions between classes.
//!
//! Rhodin 2016, section 9.5.1: a transition starts when the gesture of the target class rises above
//! 0.2, succeeds when that of the source class has fallen below 0.2, and is aborted when the target's
//! sinks below 0.1; the blend takes half a second. The thesis blends linearly; a linear weight steps
//! the joints' speed at both ends, so the weight here is eased over the same time.

use super::smooth::ease;

/// Thresholds and times of the graph.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct GraphOptions {
    /// Activation of the target class that starts a transition (0.2).
    pub rise: f64,
    /// Activation of the target class below which a transition is aborted (0.1).
    pub abort: f64,
    /// Activation of the source class below which a transition succeeds (0.2).
    pub release: f64,
    /// Length of a blend, seconds (0.5).
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

/// A transition in progress.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Transition {
    /// Class being left.
    pub from: usize,
    /// Class being entered.
    pub to: usize,
    /// Time along the blend, seconds; goes back when aborted.
    pub along_s: f64,
    /// The target's gesture was given up: the blend runs backwards.
    pub aborting: bool,
}

/// The graph and where in it the puppet is.
#[derive(Clone, Debug)]
pub struct Graph {
    options: GraphOptions,
    /// Nodes x nodes: is there an edge.
    edges: Vec<bool>,
    nodes: usize,
    start: usize,
    active: usize,
    transition: Option<Transition>,
    idle_for_s: f64,
    counts: TransitionCounts,
}

/// How many transitions there were.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub struct TransitionCounts {
    /// Completed.
    pub completed: u32,
    /// Started and given up.
    pub aborted: u32,
}

impl Graph {
    /// A graph of `nodes` classes. `edges` are (from, to) pairs; out-of-range ones are ignored.
    pub fn new(
        nodes: usize,
        start: usize,
        edges: &[(usize, usize)],
        options: GraphOptions,
    ) -> Self {
        let mut matrix = vec![false; nodes * nodes];
        for (from, to) in edges
            .iter()
            .filter(|(f, t)| *f < nodes && *t < nodes && f != t)
        {
            matrix[from * nodes + to] = true;
        }
        Self {
            options,
            edges: matrix,
            nodes,
            start,
            active: start,
            transition: None,
            idle_for_s: 0.0,
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

    /// Weight of the transition's target, 0..1, eased.
    pub fn blend(&self) -> f64 {
        self.transition
            .map_or(0.0, |t| ease(t.along_s / self.options.blend_s))
    }

    /// Transitions so far.
    pub fn counts(&self) -> TransitionCounts {
        self.counts
    }

    /// One step: `activation` holds each class's gesture amplitude or progression.
    pub fn step(&mut self, activation: &[f64], dt_s: f64) {
        match self.transition {
            Some(transition) => self.go_on(transition, activation, dt_s),
            None => self.look_out(activation, dt_s),
        }
    }

    fn look_out(&mut self, activation: &[f64], dt_s: f64) {
        let mut best: Option<usize> = None;
        for to in 0..self.nodes {
            if self.edges[self.active * self.nodes + to]
                && activation[to] > self.options.rise
                && best.is_none_or(|b| activation[to] > activation[b])
            {
                best = Some(to);
            }
        }
        // While the active class is performed it is left only for a stronger one.
        let best = best.filter(|to| {
            activation[self.active] < self.options.release
                || activation[*to] > activation[self.active]
        });
        let idle = activation.iter().all(|a| !(*a > self.options.abort));
        self.idle_for_s = if idle { self.idle_for_s + dt_s } else { 0.0 };
        let target = best.or_else(|| {
            (self.active != self.start && self.idle_for_s > self.options.idle_s)
                .then_some(self.start)
        });
        if let Some(to) = target {
            self.transition = Some(Transition {
                from: self.active,
                to,
                along_s: 0.0,
                aborting: false,
            });
        }
    }

    fn go_on(&mut self, mut transition: Transition, activation: &[f64], dt_s: f64) {
        let to_idle = transition.to == self.start && self.idle_for_s > self.options.idle_s;
        if !to_idle && activation[transition.to] < self.options.abort {
            transition.aborting = true;
        } else if activation[transition.to] > self.options.rise {
            transition.aborting = false;
        }
        let step = if transition.aborting { -dt_s } else { dt_s };
        transition.along_s = (transition.along_s + step).clamp(0.0, self.options.blend_s);
        self.transition = Some(transition);
        if transition.aborting && transition.along_s <= 0.0 {
            self.transition = None;
            self.counts.aborted += 1;
        } else if !transition.aborting
            && transition.along_s >= self.options.blend_s
            && (to_idle || activation[transition.from] < self.options.release)
        {
            self.active = transition.to;
            self.transition = None;
            self.idle_for_s = 0.0;
            self.counts.completed += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 0.005;

    fn graph() -> Graph {
        Graph::new(2, 0, &[(0, 1), (1, 0)], GraphOptions::default())
    }

    fn run(graph: &mut Graph, activation: [f64; 2], seconds: f64) {
        for _ in 0..(seconds / DT).round() as usize {
            graph.step(&activation, DT);
        }
    }

    #[test]
    fn a_transition_starts_above_the_threshold_and_takes_half_a_second() {
        let mut g = graph();
        run(&mut g, [0.0, 0.19], 1.0);
        assert_eq!((g.active(), g.transition()), (0, None));
        run(&mut g, [0.0, 0.21], 0.45);
        assert!(g.transition().is_some_and(|t| t.to == 1));
        assert!(g.blend() > 0.9, "blend {}", g.blend());
        run(&mut g, [0.0, 0.21], 0.1);
        assert_eq!((g.active(), g.transition()), (1, None));
        assert_eq!(
            g.counts(),
            TransitionCounts {
                completed: 1,
                aborted: 0
            }
        );
    }

    #[test]
    fn it_waits_for_the_source_and_is_aborted_when_the_target_sinks() {
        let mut g = graph();
        run(&mut g, [0.3, 0.8], 2.0);
        assert_eq!(g.active(), 0, "the source gesture is still performed");
        assert!((g.blend() - 1.0).abs() < 1e-9, "blend {}", g.blend());
        run(&mut g, [0.3, 0.05], 0.6);
        assert_eq!((g.active(), g.transition()), (0, None));
        assert_eq!(g.counts().aborted, 1);
    }

    #[test]
    fn with_nothing_performed_the_start_class_comes_back() {
        let mut g = graph();
        run(&mut g, [0.0, 1.0], 1.0);
        assert_eq!(g.active(), 1);
        run(&mut g, [0.0, 0.0], 1.7);
        assert_eq!(g.active(), 0);
        run(&mut g, [f64::NAN, f64::NAN], 3.0);
        assert_eq!(g.active(), 0, "not-a-number must not activate anything");
    }
}
