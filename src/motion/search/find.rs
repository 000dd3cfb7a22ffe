//! The search itself: the cheapest pair of trellis nodes, exactly, with few pairs visited.

use super::blocks::{across_at, dot, row_times, without_spread};
use super::class::{FeatureError, SearchClass};
use super::side::{Side, cells_at_most};
use super::tables::{DistanceTables, Form};
use super::tree::Ball;
use super::{FRAMES_PER_SECOND, MAX_PARAMETERS, State};
use std::sync::Arc;

/// Nodes that a trellis may have at most, so that a request fits into memory.
const MOST_NODES: usize = 4_000_000;

/// How a transition is searched.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct SearchOptions {
    /// Depth of both trellises, steps (10).
    pub l_max: usize,
    /// Step of normalised time (0.1).
    pub delta_t: f64,
    /// Step of a parameter, as a part of its range (0.1).
    pub delta_w: f64,
    /// Cost of a frame of latency, at 25 frames a second (5).
    pub lambda: f64,
    /// Cost of a dissimilarity of 1; see [`super::calibrate()`].
    pub kappa: f64,
    /// Cost of a penalty of 1 at either node (0: penalties are not looked at).
    pub mu: f64,
    /// Least similarity of a transition, 0..1; below it none is made (0).
    pub s_min: f64,
    /// Longest latency allowed, seconds.
    pub max_latency_s: Option<f64>,
    /// How similarity is had.
    pub form: Form,
}

impl Default for SearchOptions {
    fn default() -> Self {
        Self {
            l_max: 10,
            delta_t: 0.1,
            delta_w: 0.1,
            lambda: 5.0,
            kappa: 1000.0,
            mu: 0.0,
            s_min: 0.0,
            max_latency_s: None,
            form: Form::Exact,
        }
    }
}

/// An option that cannot be used, or classes that do not fit.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum OptionsError {
    /// A number out of range.
    #[error("transition search: {what} is {value}; {allowed}")]
    Range {
        /// Which option.
        what: &'static str,
        /// What it is.
        value: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// A trellis that does not fit into memory.
    #[error(
        "transition search: class {class} has {parameters} parameters, at depth {l_max} and step {delta_w} that is {nodes} nodes, at most {MOST_NODES}; take a larger delta_w or a smaller l_max"
    )]
    TooLarge {
        /// Class.
        class: String,
        /// Its parameters.
        parameters: usize,
        /// Depth.
        l_max: usize,
        /// Step of a parameter.
        delta_w: f64,
        /// Nodes there would be.
        nodes: usize,
    },
    /// Classes that cannot be compared.
    #[error(transparent)]
    Classes(#[from] FeatureError),
}

/// Where to arrive.
#[derive(Copy, Clone, Debug, PartialEq)]
pub enum Target {
    /// A state of the target class; the way to it within that class counts as latency (the paper).
    State(State),
    /// With these parameters, entering at any frame between two normalised times, which costs nothing:
    /// for motions that are then played from there.
    Entry {
        /// Parameters of the target class.
        parameters: [f64; MAX_PARAMETERS],
        /// First and last time at which it may be entered, 0..1.
        between: [f64; 2],
    },
}

/// The weighted terms of a transition's cost.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Cost {
    /// `E_S = kappa (1 - s)`.
    pub similarity: f64,
    /// `lambda E_L`, E_L in frames of 1/25 s.
    pub latency: f64,
    /// `mu` times the penalties of exit and entry.
    pub penalty: f64,
}

impl Cost {
    /// Sum of the terms.
    pub fn total(&self) -> f64 {
        self.similarity + self.latency + self.penalty
    }
}

/// A transition.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Found {
    /// Where the source class is left.
    pub exit: State,
    /// Where the target class is entered.
    pub entry: State,
    /// Steps of the source's route, and of the target's.
    pub depths: (usize, usize),
    /// Similarity at the jump, 0..1.
    pub similarity: f64,
    /// Squared distance at the jump, m^2.
    pub distance: f64,
    /// Time from the present to the exit, seconds.
    pub exit_after_s: f64,
    /// Time from the present to the target state, seconds.
    pub latency_s: f64,
    /// What it costs.
    pub cost: Cost,
}

/// A point of a route.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Waypoint {
    /// State of the class.
    pub state: State,
    /// Seconds after the request; between two points time and weights go linearly.
    pub at_s: f64,
}

/// Nothing is similar enough, or soon enough.
#[derive(Copy, Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "no transition: best similarity within reach {best_similarity:.3}, needed {s_min:.3}{}",
    .max_latency_s.map_or(String::new(), |s| format!(", within {s:.2} s"))
)]
pub struct NoTransition {
    /// Best similarity of all pairs that are soon enough.
    pub best_similarity: f64,
    /// Similarity asked for.
    pub s_min: f64,
    /// Latency allowed.
    pub max_latency_s: Option<f64>,
}

/// The best pair so far.
#[derive(Copy, Clone, Debug)]
struct Best {
    cost: f64,
    /// Row and cell of the source, then of the target.
    at: Option<[usize; 4]>,
    /// Least distance of a pair that is soon enough, whether similar enough or not.
    distance: f64,
}

/// A pair of depths and the least that a pair of its nodes costs.
#[derive(Copy, Clone, Debug)]
struct Depths {
    least: f64,
    s: u32,
    d: u32,
}

/// Searches transitions over one edge. All room is taken at the beginning: a request allocates nothing.
#[derive(Debug)]
pub struct Search {
    source: Arc<SearchClass>,
    target: Arc<SearchClass>,
    tables: Arc<DistanceTables>,
    options: SearchOptions,
    is_loop: bool,
    from: Side,
    to: Side,
    /// Rows x rows x references x references.
    blocks: Vec<f64>,
    pairs: Vec<Depths>,
    stack: Vec<(usize, usize)>,
    /// `w B` of the source node at hand.
    row: Vec<f64>,
    source_route: Vec<Waypoint>,
    target_route: Vec<Waypoint>,
}

impl Search {
    /// A search over the edge from `source` to `target`; the same class twice is a loop.
    ///
    /// # Errors
    /// Options out of range; more nodes than fit into memory.
    pub fn new(
        source: Arc<SearchClass>,
        target: Arc<SearchClass>,
        tables: Arc<DistanceTables>,
        options: SearchOptions,
    ) -> Result<Self, OptionsError> {
        check(&options)?;
        source.comparable(&target)?;
        for class in [&source, &target] {
            let nodes = cells_at_most(class, options.delta_w).saturating_mul(options.l_max + 1);
            if nodes > MOST_NODES {
                return Err(OptionsError::TooLarge {
                    class: class.name.clone(),
                    parameters: class.parameters(),
                    l_max: options.l_max,
                    delta_w: options.delta_w,
                    nodes,
                });
            }
        }
        let rows = options.l_max + 1;
        let rows_d = rows.max(target.frames());
        let cells = source.references() * target.references();
        Ok(Self {
            is_loop: Arc::ptr_eq(&source, &target),
            from: Side::new(&source, rows, &options),
            to: Side::new(&target, rows, &options),
            blocks: vec![0.0; rows * rows_d * cells],
            pairs: Vec::with_capacity(rows * rows_d),
            stack: Vec::with_capacity(1024),
            row: vec![0.0; target.references()],
            source_route: Vec::with_capacity(rows),
            target_route: Vec::with_capacity(rows),
            source,
            target,
            tables,
            options,
        })
    }

    /// The options.
    pub fn options(&self) -> &SearchOptions {
        &self.options
    }

    /// Sets kappa, lambda, mu, s_min and the longest latency; depth and steps stay as they are, since
    /// room was taken for them.
    ///
    /// # Errors
    /// Options out of range.
    pub fn set_weights(&mut self, options: &SearchOptions) -> Result<(), OptionsError> {
        let SearchOptions {
            l_max,
            delta_t,
            delta_w,
            ..
        } = self.options;
        let options = SearchOptions {
            l_max,
            delta_t,
            delta_w,
            ..*options
        };
        check(&options)?;
        self.options = options;
        Ok(())
    }

    /// The source class.
    pub fn source(&self) -> &Arc<SearchClass> {
        &self.source
    }

    /// The target class.
    pub fn target(&self) -> &Arc<SearchClass> {
        &self.target
    }

    /// The tables of the edge.
    pub fn tables(&self) -> &Arc<DistanceTables> {
        &self.tables
    }

    /// Route of the last transition found in the source class, from the present state to the exit.
    pub fn source_route(&self) -> &[Waypoint] {
        &self.source_route
    }

    /// Route of the last transition found in the target class, from the entry to the target state; the
    /// first point is at the time of the exit.
    pub fn target_route(&self) -> &[Waypoint] {
        &self.target_route
    }

    /// The cheapest transition from `source` to `target`. Allocates nothing.
    ///
    /// Costs as much as [`Search::exhaustive`] finds, always: what is left out cannot cost less. States
    /// outside 0..1 are brought to the edge, not-a-number is taken for 0.
    ///
    /// # Errors
    /// [`NoTransition`] when no pair is similar and soon enough.
    pub fn find(&mut self, source: &State, target: &Target) -> Result<Found, NoTransition> {
        self.grow(source, target);
        let mut best = Best {
            cost: f64::INFINITY,
            at: None,
            distance: f64::INFINITY,
        };
        self.pairs.clear();
        for s in 0..self.from.rows.len() {
            for d in 0..self.to.rows.len() {
                self.prepare(s, d);
                // The middle of each depth gives a first good pair, and with the radii the least cost.
                let (a, b) = (self.from.rows[s].root, self.to.rows[d].root);
                let (a, b) = (self.from.balls[a], self.to.balls[b]);
                let between = self.distance(s, a.centre, d, b.centre);
                self.offer(&mut best, [s, a.centre, d, b.centre], between);
                if let Some(least) = self.least(&best, &a, &b, between) {
                    self.pairs.push(Depths {
                        least,
                        s: s as u32,
                        d: d as u32,
                    });
                }
            }
        }
        self.pairs
            .sort_unstable_by(|a, b| a.least.total_cmp(&b.least));
        for pair in 0..self.pairs.len() {
            let Depths { least, s, d } = self.pairs[pair];
            if least >= best.cost {
                break;
            }
            self.descend(s as usize, d as usize, &mut best);
        }
        self.conclude(&best)
    }

    /// The same by visiting all pairs of nodes: the judge of [`Search::find`].
    ///
    /// # Errors
    /// As [`Search::find`].
    pub fn exhaustive(&mut self, source: &State, target: &Target) -> Result<Found, NoTransition> {
        self.grow(source, target);
        let mut best = Best {
            cost: f64::INFINITY,
            at: None,
            distance: f64::INFINITY,
        };
        for s in 0..self.from.rows.len() {
            for d in 0..self.to.rows.len() {
                self.prepare(s, d);
                let (a, b) = (self.from.rows[s].root, self.to.rows[d].root);
                let (a, b) = (self.from.balls[a], self.to.balls[b]);
                self.visit(s, d, &a, &b, &mut best);
            }
        }
        self.conclude(&best)
    }

    /// Cost of a dissimilarity, per m^2.
    fn distance_weight(&self) -> f64 {
        if self.tables.d_max() > 0.0 {
            self.options.kappa / self.tables.d_max()
        } else {
            0.0
        }
    }

    /// Largest distance that is similar enough.
    fn most_distance(&self) -> f64 {
        // What rounding may add to the distance of equal poses.
        (1.0 - self.options.s_min) * self.tables.d_max() * (1.0 + 1e-12)
    }

    fn grow(&mut self, source: &State, target: &Target) {
        let weight = self.distance_weight();
        let options = &self.options;
        self.from.grow(&self.source, source, true, options, weight);
        match target {
            Target::State(state) => self.to.grow(&self.target, state, false, options, weight),
            Target::Entry {
                parameters,
                between,
            } => {
                let class = &self.target;
                self.to.enter(class, parameters, *between, options, weight);
            }
        }
    }

    fn block_at(&self, s: usize, d: usize) -> std::ops::Range<usize> {
        let cells = self.from.references * self.to.references;
        let at = (s * self.to.rows.len() + d) * cells;
        at..at + cells
    }

    /// Distances of all references at the times of two depths.
    fn prepare(&mut self, s: usize, d: usize) {
        let at = self.block_at(s, d);
        let block = &mut self.blocks[at];
        let (row_s, row_d) = (self.from.rows[s].at, self.to.rows[d].at);
        across_at(&self.tables, row_s, row_d, block);
        if row_s.part > 0.0 || row_d.part > 0.0 {
            without_spread(self.from.spread(s), self.to.spread(d), block);
        }
    }

    /// Squared distance of two nodes without what the bound adds.
    fn distance(&mut self, s: usize, cell_s: usize, d: usize, cell_d: usize) -> f64 {
        let at = self.block_at(s, d);
        row_times(self.from.weights(cell_s), &self.blocks[at], &mut self.row);
        self.distance_from_row(s, cell_s, d, cell_d)
    }

    /// The same when `row` is `w B` of the source node already.
    fn distance_from_row(&self, s: usize, cell_s: usize, d: usize, cell_d: usize) -> f64 {
        let own_s = self.from.own[self.from.node(s, cell_s)];
        let own_d = self.to.own[self.to.node(d, cell_d)];
        (dot(&self.row, self.to.weights(cell_d)) - own_s - own_d).max(0.0)
    }

    /// Takes a pair as the best if it is.
    fn offer(&self, best: &mut Best, at: [usize; 4], distance: f64) {
        let [s, cell_s, d, cell_d] = at;
        if self.is_loop && s == 0 && d == 0 {
            return;
        }
        let (a, b) = (self.from.node(s, cell_s), self.to.node(d, cell_d));
        if let Some(most) = self.options.max_latency_s
            && self.from.latency_s[a] + self.to.latency_s[b] > most
        {
            return;
        }
        let whole = distance + self.from.extra[a] + self.to.extra[b];
        best.distance = best.distance.min(whole);
        let cost = self.from.cost[a] + self.to.cost[b] + self.distance_weight() * distance;
        if cost < best.cost && whole <= self.most_distance() {
            best.cost = cost;
            best.at = Some(at);
        }
    }

    /// The least cost of a pair of nodes in two balls with centres `between` apart (squared); `None`
    /// when no pair in them can be better than the best, or allowed.
    fn least(&self, best: &Best, a: &Ball, b: &Ball, between: f64) -> Option<f64> {
        if let Some(most) = self.options.max_latency_s
            && a.latency_s + b.latency_s > most
        {
            return None;
        }
        let gap = (between.sqrt() - a.radius - b.radius).max(0.0);
        let gap = gap * gap;
        let least = a.cost + b.cost + self.distance_weight() * gap;
        // A hair less, so that rounding cannot cut off the best pair.
        let least = least - 1e-12 * least.abs();
        let distance = gap + a.extra + b.extra;
        if distance > self.most_distance() && (best.at.is_some() || distance >= best.distance) {
            return None;
        }
        (least < best.cost).then_some(least)
    }

    /// All pairs of two balls.
    fn visit(&mut self, s: usize, d: usize, a: &Ball, b: &Ball, best: &mut Best) {
        let block = self.block_at(s, d);
        for levels_s in a.cells.iter() {
            let cell_s = self.from.cell(&levels_s);
            row_times(
                self.from.weights(cell_s),
                &self.blocks[block.clone()],
                &mut self.row,
            );
            for levels_d in b.cells.iter() {
                let cell_d = self.to.cell(&levels_d);
                let distance = self.distance_from_row(s, cell_s, d, cell_d);
                self.offer(best, [s, cell_s, d, cell_d], distance);
            }
        }
    }

    /// Branch and bound over the balls of two depths.
    fn descend(&mut self, s: usize, d: usize, best: &mut Best) {
        self.stack.clear();
        self.stack
            .push((self.from.rows[s].root, self.to.rows[d].root));
        while let Some((at_a, at_b)) = self.stack.pop() {
            let (a, b) = (self.from.balls[at_a], self.to.balls[at_b]);
            let between = self.distance(s, a.centre, d, b.centre);
            self.offer(best, [s, a.centre, d, b.centre], between);
            if self.least(best, &a, &b, between).is_none() {
                continue;
            }
            // The wider ball is divided; two leaves are visited.
            let divide_a = a
                .child
                .filter(|_| b.child.is_none() || a.radius >= b.radius);
            match (divide_a, b.child) {
                (Some(child), _) => {
                    self.stack.push((child, at_b));
                    self.stack.push((child + 1, at_b));
                }
                (None, Some(child)) => {
                    self.stack.push((at_a, child));
                    self.stack.push((at_a, child + 1));
                }
                (None, None) => self.visit(s, d, &a, &b, best),
            }
        }
    }

    fn conclude(&mut self, best: &Best) -> Result<Found, NoTransition> {
        self.source_route.clear();
        self.target_route.clear();
        let Some([s, cell_s, d, cell_d]) = best.at else {
            return Err(NoTransition {
                best_similarity: if best.distance.is_finite() {
                    self.tables.similarity_of(best.distance)
                } else {
                    0.0
                },
                s_min: self.options.s_min,
                max_latency_s: self.options.max_latency_s,
            });
        };
        let (a, b) = (self.from.node(s, cell_s), self.to.node(d, cell_d));
        let exit_after_s = self.from.latency_s[a];
        let latency_s = exit_after_s + self.to.latency_s[b];
        let (mut row, mut cell) = (s, cell_s);
        loop {
            self.source_route.push(Waypoint {
                state: self.from.state(row, cell),
                at_s: self.from.latency_s[self.from.node(row, cell)],
            });
            if row == 0 {
                break;
            }
            cell = self.from.before(row, cell);
            row -= 1;
        }
        self.source_route.reverse();
        let (mut row, mut cell) = (d, cell_d);
        loop {
            self.target_route.push(Waypoint {
                state: self.to.state(row, cell),
                at_s: latency_s - self.to.latency_s[self.to.node(row, cell)],
            });
            // Free entries have no way behind them.
            if row == 0 || self.to.latency_s[self.to.node(row, cell)] == 0.0 {
                break;
            }
            cell = self.to.before(row, cell);
            row -= 1;
        }
        let distance = self.distance(s, cell_s, d, cell_d) + self.from.extra[a] + self.to.extra[b];
        let similarity = self.tables.similarity_of(distance);
        let latency = self.options.lambda * FRAMES_PER_SECOND * latency_s;
        let dissimilar = self.distance_weight() * distance;
        Ok(Found {
            exit: self.from.state(s, cell_s),
            entry: self.to.state(d, cell_d),
            depths: (s, self.target_route.len() - 1),
            similarity,
            distance,
            exit_after_s,
            latency_s,
            cost: Cost {
                similarity: dissimilar,
                latency,
                penalty: if self.options.mu > 0.0 {
                    self.from.cost[a] + self.to.cost[b]
                        - latency
                        - self.distance_weight() * (self.from.extra[a] + self.to.extra[b])
                } else {
                    0.0
                },
            },
        })
    }
}

fn check(options: &SearchOptions) -> Result<(), OptionsError> {
    let at_least_0 = "finite and not negative";
    let checks = [
        ("l_max", options.l_max as f64, 0.0, 1000.0, "0 to 1000"),
        ("delta_t", options.delta_t, 1e-3, 1.0, "0.001 to 1"),
        ("delta_w", options.delta_w, 1e-3, 1.0, "0.001 to 1"),
        ("lambda", options.lambda, 0.0, f64::MAX, at_least_0),
        ("kappa", options.kappa, 0.0, f64::MAX, at_least_0),
        ("mu", options.mu, 0.0, f64::MAX, at_least_0),
        ("s_min", options.s_min, 0.0, 1.0, "0 to 1"),
        (
            "max_latency_s",
            options.max_latency_s.unwrap_or(0.0),
            0.0,
            f64::MAX,
            at_least_0,
        ),
    ];
    for (what, value, low, high, allowed) in checks {
        if !(low..=high).contains(&value) {
            return Err(OptionsError::Range {
                what,
                value,
                allowed,
            });
        }
    }
    Ok(())
}
