//! The baseline: a few transition points fixed beforehand, as motion graphs usually have them.
//!
//! Casas 2013, Table 4.2. The most similar pairs of states on a grid are stored; at run time the source is
//! played on to a stored exit and the target from the stored entry to where it is wanted.

use super::blocks::{dot, row_times, within_at, without_spread};
use super::class::SearchClass;
use super::find::{Cost, SearchOptions};
use super::tables::{DistanceTables, Form};
use super::weight_map::{Hat, WeightMap};
use super::{FRAMES_PER_SECOND, MAX_PARAMETERS, State};
use std::sync::Arc;

/// Exits closer than this, in time or in any parameter, count as one; less when too few are left.
const SPREAD: f64 = 0.25;

/// A stored transition.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct StoredPoint {
    /// Where the source is left.
    pub exit: State,
    /// Where the target is entered.
    pub entry: State,
    /// Squared distance, m^2.
    pub distance: f64,
}

/// A transition over a stored point.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct StoredFound {
    /// The point.
    pub point: StoredPoint,
    /// Its similarity, 0..1.
    pub similarity: f64,
    /// From the present state over the point to the target state, seconds.
    pub latency_s: f64,
    /// What it costs.
    pub cost: Cost,
}

/// The stored transitions of an edge.
#[derive(Debug)]
pub struct StoredTransitions {
    source: Arc<SearchClass>,
    target: Arc<SearchClass>,
    tables: Arc<DistanceTables>,
    options: SearchOptions,
    points: Vec<StoredPoint>,
    weights: Vec<f64>,
}

impl StoredTransitions {
    /// The `count` most similar pairs of states, their exits spread apart. Times are multiples of
    /// `delta_t`; parameters lie on 11 levels each, 5 for three or more parameters.
    pub fn new(
        source: Arc<SearchClass>,
        target: Arc<SearchClass>,
        tables: Arc<DistanceTables>,
        count: usize,
        options: &SearchOptions,
    ) -> Self {
        let mut candidates = candidates(&source, &target, &tables, options);
        candidates.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        let mut points: Vec<StoredPoint> = Vec::new();
        let mut apart = SPREAD;
        while points.len() < count.min(candidates.len()) && apart > 1e-3 {
            for candidate in &candidates {
                let near = |p: &StoredPoint| gap(&source, &p.exit, &candidate.exit) < apart;
                if points.len() < count && !points.iter().any(near) {
                    points.push(*candidate);
                }
            }
            apart *= 0.5;
        }
        let references = source.references().max(target.references());
        Self {
            weights: vec![0.0; references],
            source,
            target,
            tables,
            options: *options,
            points,
        }
    }

    /// The stored points, the most similar first.
    pub fn points(&self) -> &[StoredPoint] {
        &self.points
    }

    /// The cheapest way over a stored point; `None` when an open class has passed them all. Allocates
    /// nothing.
    pub fn find(&mut self, source: &State, target: &State) -> Option<StoredFound> {
        let mut best: Option<StoredFound> = None;
        for index in 0..self.points.len() {
            let point = self.points[index];
            let similarity = self.tables.similarity_of(point.distance);
            let mut way = |class: &SearchClass, from: &State, to: &State| {
                let weights = &mut self.weights[..class.references()];
                walk_s(class, from, to, &self.options, weights)
            };
            let Some(exit_s) = way(&self.source, source, &point.exit) else {
                continue;
            };
            let Some(entry_s) = way(&self.target, &point.entry, target) else {
                continue;
            };
            let latency_s = exit_s + entry_s;
            let cost = Cost {
                similarity: self.options.kappa * (1.0 - similarity),
                latency: self.options.lambda * FRAMES_PER_SECOND * latency_s,
                penalty: 0.0,
            };
            if best.is_none_or(|b| cost.total() < b.cost.total()) {
                best = Some(StoredFound {
                    point,
                    similarity,
                    latency_s,
                    cost,
                });
            }
        }
        best
    }
}

/// Seconds from one state of a class to another, parameters moving by at most `delta_w` per `delta_t`:
/// the shorter of moving them at once and as late as possible. `None` when an open class is past it.
/// A cyclic class goes round again when there is too little time for the parameters.
fn walk_s(
    class: &SearchClass,
    from: &State,
    to: &State,
    options: &SearchOptions,
    weights: &mut [f64],
) -> Option<f64> {
    let axes = class.parameters();
    let farthest = (0..axes)
        .map(|d| (to.parameters[d] - from.parameters[d]).abs())
        .fold(0.0, f64::max);
    let needed = farthest / options.delta_w * options.delta_t;
    let mut way = to.t - from.t;
    if class.cyclic {
        way = way.rem_euclid(1.0);
        way += (needed - way - 1e-9).max(0.0).ceil();
    } else if way < needed - 1e-9 {
        return None;
    }
    let steps = (way / options.delta_t - 1e-9).ceil().max(0.0) as usize;
    let mut duration = |at: f64, late: bool| {
        // How far the parameters have come: they move during `needed` of the way.
        let moved = if late { at - (way - needed) } else { at };
        let part = if needed > 0.0 {
            (moved / needed).clamp(0.0, 1.0)
        } else {
            1.0
        };
        let mut state = State::default();
        for d in 0..axes {
            state.parameters[d] =
                from.parameters[d] + part * (to.parameters[d] - from.parameters[d]);
        }
        class.weights(&state, weights);
        class.duration_s(weights)
    };
    let mut shortest = f64::INFINITY;
    for late in [false, true] {
        let (mut at, mut sum) = (0.0, 0.0);
        let mut before = duration(0.0, late);
        for _ in 0..steps {
            let next = (at + options.delta_t).min(way);
            let after = duration(next, late);
            sum += (next - at) * 0.5 * (before + after);
            (at, before) = (next, after);
        }
        shortest = shortest.min(sum);
    }
    Some(shortest)
}

/// The larger of the distances of two states in time and in every parameter.
fn gap(class: &SearchClass, a: &State, b: &State) -> f64 {
    let mut t = (a.t - b.t).abs();
    if class.cyclic {
        t = t.min(1.0 - t);
    }
    (0..class.parameters())
        .map(|d| (a.parameters[d] - b.parameters[d]).abs())
        .fold(t, f64::max)
}

/// One time of a class: the states on its grid of parameters, with what distances need.
struct Slice {
    t: f64,
    spread: Vec<f64>,
    states: Vec<(State, Vec<f64>, f64)>,
}

fn slices(class: &SearchClass, options: &SearchOptions) -> Vec<Slice> {
    let steps = (1.0 / options.delta_t).round().max(1.0) as usize;
    let count = if class.cyclic { steps } else { steps + 1 };
    let axes = class.parameters();
    let grid = Hat::new(axes, if axes < 3 { 10 } else { 4 });
    let n = class.references();
    let mut slices = Vec::new();
    for k in 0..count {
        let t = k as f64 / steps as f64;
        let (mut spread, mut within) = (vec![0.0; n], vec![0.0; n * n]);
        within_at(class, class.between(t), &mut spread, &mut within);
        let states = (0..grid.references())
            .map(|index| {
                let mut parameters = [0.0; MAX_PARAMETERS];
                parameters[..axes].copy_from_slice(&grid.place(index)[..axes]);
                let state = State { t, parameters };
                let (mut weights, mut row) = (vec![0.0; n], vec![0.0; n]);
                class.weights(&state, &mut weights);
                row_times(&weights, &within, &mut row);
                let own = 0.5 * dot(&row, &weights);
                (state, weights, own)
            })
            .collect();
        slices.push(Slice { t, spread, states });
    }
    slices
}

fn candidates(
    source: &SearchClass,
    target: &SearchClass,
    tables: &DistanceTables,
    options: &SearchOptions,
) -> Vec<StoredPoint> {
    let (from, to) = (slices(source, options), slices(target, options));
    let mut block = vec![0.0; source.references() * target.references()];
    let mut row = vec![0.0; target.references()];
    let mut points = Vec::new();
    for a in &from {
        for b in &to {
            let (at_a, at_b) = (source.between(a.t), target.between(b.t));
            super::blocks::across_at(tables, at_a, at_b, &mut block);
            if options.form == Form::Exact {
                without_spread(&a.spread, &b.spread, &mut block);
            }
            for (exit, w, own_a) in &a.states {
                row_times(w, &block, &mut row);
                // The best entry for this exit is all that can be chosen: exits are spread apart.
                let best = b.states.iter().map(|(entry, v, own_b)| {
                    let own = match options.form {
                        Form::Exact => own_a + own_b,
                        Form::Bound => 0.0,
                    };
                    (entry, (dot(&row, v) - own).max(0.0))
                });
                if let Some((entry, distance)) = best.min_by(|x, y| x.1.total_cmp(&y.1)) {
                    points.push(StoredPoint {
                        exit: *exit,
                        entry: *entry,
                        distance,
                    });
                }
            }
        }
    }
    points
}
