//! Transitions chosen at run time: when to leave a class and where to enter the next, by likeness and latency.

use super::search::clip_blend::ClipBlend;
use super::search::{MAX_PARAMETERS, NoTransition, Search, State, Target};
use super::weights::Parameters;

/// The search of one edge of the graph, in the terms of the classes' own parameters.
#[derive(Debug)]
pub struct EdgeSearch {
    search: Search,
    from: ClipBlend,
    to: ClipBlend,
    /// Part of the target at which it may be entered.
    entry: [f64; 2],
}

/// What a search chose.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Choice {
    /// The source plays on for this long, seconds.
    pub wait_s: f64,
    /// And is left at this fraction of its cycle.
    pub exit: f64,
    /// The target is entered at this fraction of its cycle or path.
    pub entry: f64,
    /// Similarity of the two poses, 0..1.
    pub similarity: f64,
}

/// A point of the way through the source: seconds from now, amplitude and frequency.
pub type RoutePoint = (f64, f64, f64);

impl EdgeSearch {
    /// From what `from` and `to` blend, over which `search` was made. The target is entered between the two
    /// fractions `entry` of its cycle or path.
    pub fn new(search: Search, from: ClipBlend, to: ClipBlend, entry: [f64; 2]) -> Self {
        Self {
            search,
            from,
            to,
            entry,
        }
    }

    /// The best transition from the source at fraction `t` with parameters `now` to the target with `wish`.
    /// Allocates nothing.
    ///
    /// # Errors
    /// Nothing is similar and soon enough.
    pub fn choose(
        &mut self,
        t: f64,
        now: Parameters,
        wish: Parameters,
    ) -> Result<Choice, NoTransition> {
        let mut source = State::new(t, &[]);
        self.from.normalised(now, &mut source.parameters);
        let mut parameters = [0.0; MAX_PARAMETERS];
        self.to.normalised(wish, &mut parameters);
        let target = Target::Entry {
            parameters,
            between: self.entry,
        };
        let found = self.search.find(&source, &target)?;
        Ok(Choice {
            wait_s: found.exit_after_s,
            exit: found.exit.t,
            entry: found.entry.t,
            similarity: found.similarity,
        })
    }

    /// The way of the last choice through the source, into `out`: its points, as many as find room.
    pub fn route(&self, out: &mut Vec<RoutePoint>) {
        out.clear();
        for point in self.search.source_route().iter().take(out.capacity()) {
            let wish = self.from.wish(&point.state.parameters);
            out.push((point.at_s, wish[0], wish[1]));
        }
    }
}
