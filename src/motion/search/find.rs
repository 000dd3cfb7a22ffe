//! The search itself: the cheapest pair of trellis nodes, exactly, with few pairs visited.

use super::bound::{Best, Depths, Slopes};
use super::boxes::LevelBox;
use super::class::SearchClass;
use super::clips::FeatureError;
use super::side::{Side, cells_at_most};
use super::tables::{DistanceTables, Form};
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

/// Searches transitions over one edge. All room is taken at the beginning: a request allocates nothing.
#[derive(Debug)]
pub struct Search {
    source: Arc<SearchClass>,
    target: Arc<SearchClass>,
    pub(super) tables: Arc<DistanceTables>,
    pub(super) options: SearchOptions,
    pub(super) is_loop: bool,
    pub(super) from: Side,
    pub(super) to: Side,
    /// Rows x rows x references x references.
    pub(super) blocks: Vec<f64>,
    pub(super) pairs: Vec<Depths>,
    pub(super) slopes: Slopes,
    pub(super) stack: Vec<[LevelBox; 2]>,
    /// `w B` of the source node at hand.
    pub(super) row: Vec<f64>,
    /// Cost of a dissimilarity per m^2, and the largest distance that is similar enough.
    pub(super) distance_weight: f64,
    pub(super) most_distance: f64,
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
            slopes: Slopes::new(
                [source.references(), target.references()],
                [&source, &target].map(|class| cells_at_most(class, options.delta_w)),
            ),
            // A division leaves one half behind, and no box is divided more often than it has levels.
            stack: Vec::with_capacity(1024),
            row: vec![0.0; target.references()],
            distance_weight: 0.0,
            most_distance: 0.0,
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
    /// Costs as much as [`Search::exhaustive`] finds, always: what is left out cannot cost less. For two
    /// depths the nodes are points x, y of a Euclidean space with costs A, B, and for any e
    /// `A + B + K |x - y|^2 >= (A + 2 K e.x) + (B - 2 K e.y) - K |e|^2`: a bound in which source and target
    /// are apart, so its least value takes as many steps as there are nodes, not pairs. Depths whose bound
    /// is above the best pair so far are left out, and of the others the nodes whose own part is. e is
    /// improved by conditional gradient steps (Frank and Wolfe), whose corners are tried as pairs.
    ///
    /// States outside 0..1 are brought to the edge, not-a-number is taken for 0.
    ///
    /// # Errors
    /// [`NoTransition`] when no pair is similar and soon enough.
    pub fn find(&mut self, source: &State, target: &Target) -> Result<Found, NoTransition> {
        self.grow(source, target);
        let mut best = Best::none();
        if self.options.s_min > 0.0 {
            // First the most similar pair at all: without one that is similar enough there is no cost.
            self.nearest(&mut best);
            if best.at.is_none() {
                return self.conclude(&best);
            }
        }
        self.cheapest(&mut best);
        self.conclude(&best)
    }

    /// The same by visiting all pairs of nodes: the judge of [`Search::find`].
    ///
    /// # Errors
    /// As [`Search::find`].
    pub fn exhaustive(&mut self, source: &State, target: &Target) -> Result<Found, NoTransition> {
        self.grow(source, target);
        let mut best = Best::none();
        self.all_pairs(&mut best);
        self.conclude(&best)
    }

    fn grow(&mut self, source: &State, target: &Target) {
        let d_max = self.tables.d_max();
        let options = &self.options;
        self.distance_weight = if d_max > 0.0 {
            options.kappa / d_max
        } else {
            0.0
        };
        // What rounding may add to the distance of equal poses.
        self.most_distance = (1.0 - options.s_min) * d_max * (1.0 + 1e-12);
        let weight = self.distance_weight;
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
        let dissimilar = self.distance_weight * distance;
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
                        - self.distance_weight * (self.from.extra[a] + self.to.extra[b])
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
