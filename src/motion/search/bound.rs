//! Which pair is the cheapest, without visiting all: a separable lower bound (see [`Search::find`]).

use super::blocks::{across_at, dot, half_form, row_times, times_column, without_spread};
use super::find::Search;

/// Steps towards a better bound for two depths, at most.
const STEPS: usize = 12;

/// The best pair so far.
#[derive(Copy, Clone, Debug)]
pub(super) struct Best {
    pub(super) cost: f64,
    /// Row and cell of the source, then of the target.
    pub(super) at: Option<[usize; 4]>,
    /// Least distance of a pair that is soon enough, whether similar enough or not.
    pub(super) distance: f64,
}

impl Best {
    pub(super) fn none() -> Self {
        Self {
            cost: f64::INFINITY,
            at: None,
            distance: f64::INFINITY,
        }
    }
}

/// A pair of depths and the least that a pair of its nodes costs.
#[derive(Copy, Clone, Debug)]
pub(super) struct Depths {
    least: f64,
    s: u32,
    d: u32,
}

/// Work space for the bound of two depths.
#[derive(Debug)]
pub(super) struct Slopes {
    /// A blend of source nodes and one of target nodes: their difference is e.
    w: Vec<f64>,
    v: Vec<f64>,
    /// `B v` and `w B`, `D_s w` and `D_d v`.
    b_v: Vec<f64>,
    w_b: Vec<f64>,
    d_w: Vec<f64>,
    d_v: Vec<f64>,
    slope_s: Vec<f64>,
    slope_d: Vec<f64>,
    /// By cell: a node's own part of the bound.
    parts_s: Vec<f64>,
    parts_d: Vec<f64>,
    /// Nodes that are left: own part, cell, 1/2 w D w.
    left_s: Vec<(f64, usize, f64)>,
    left_d: Vec<(f64, usize, f64)>,
}

impl Slopes {
    /// Room for classes of so many references and cells.
    pub(super) fn new([n, m]: [usize; 2], [cells_s, cells_d]: [usize; 2]) -> Self {
        Self {
            w: vec![0.0; n],
            v: vec![0.0; m],
            b_v: vec![0.0; n],
            w_b: vec![0.0; m],
            d_w: vec![0.0; n],
            d_v: vec![0.0; m],
            slope_s: vec![0.0; n],
            slope_d: vec![0.0; m],
            parts_s: vec![0.0; cells_s],
            parts_d: vec![0.0; cells_d],
            left_s: Vec::with_capacity(cells_s),
            left_d: Vec::with_capacity(cells_d),
        }
    }
}

/// The bound of two depths at one e.
#[derive(Copy, Clone, Debug)]
struct Bound {
    /// No pair costs less.
    least: f64,
    /// Where the parts are least: cells, and the parts.
    cells: [usize; 2],
    parts: [f64; 2],
    /// Weight of distances times `|e|^2`.
    offset: f64,
    /// `|e|^2`.
    length: f64,
}

impl Search {
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

    /// Squared distance of two nodes without what the bound form adds.
    pub(super) fn distance(&mut self, s: usize, cell_s: usize, d: usize, cell_d: usize) -> f64 {
        let at = self.block_at(s, d);
        row_times(self.from.weights(cell_s), &self.blocks[at], &mut self.row);
        let (own_s, own_d) = (self.from.own(s, cell_s), self.to.own(d, cell_d));
        (dot(&self.row, self.to.weights(cell_d)) - own_s - own_d).max(0.0)
    }

    /// Takes a pair as the best if it is.
    fn offer(&self, best: &mut Best, at: [usize; 4], distance: f64) {
        let [s, cell_s, d, cell_d] = at;
        let (a, b) = (self.from.node(s, cell_s), self.to.node(d, cell_d));
        if let Some(most) = self.options.max_latency_s
            && self.from.latency_s[a] + self.to.latency_s[b] > most
        {
            return;
        }
        let whole = distance + self.from.extra[a] + self.to.extra[b];
        best.distance = best.distance.min(whole);
        let cost = self.from.cost[a] + self.to.cost[b] + self.distance_weight * distance;
        if cost < best.cost && whole <= self.most_distance {
            best.cost = cost;
            best.at = Some(at);
        }
    }

    /// All pairs of depths that may be looked at, the soonest first.
    fn depths(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (rows_s, rows_d, is_loop) = (self.from.rows.len(), self.to.rows.len(), self.is_loop);
        (0..rows_s + rows_d - 1)
            .flat_map(move |sum| (0..=sum.min(rows_s - 1)).map(move |s| (s, sum - s)))
            .filter(move |(s, d)| *d < rows_d && !(is_loop && s + d == 0))
    }

    /// Visits all pairs.
    pub(super) fn all_pairs(&mut self, best: &mut Best) {
        self.from.fill_own();
        self.to.fill_own();
        for (s, d) in self.depths() {
            self.prepare(s, d);
            let block = self.block_at(s, d);
            let (cells_s, cells_d) = (self.from.rows[s].cells, self.to.rows[d].cells);
            for cell_s in cells_s.lines(self.from.strides).flat_map(|(line, _)| line) {
                let weights = self.from.weights(cell_s);
                row_times(weights, &self.blocks[block.clone()], &mut self.row);
                let own_s = self.from.own[self.from.node(s, cell_s)];
                for (line, _) in cells_d.lines(self.to.strides) {
                    for cell_d in line {
                        let own_d = self.to.own[self.to.node(d, cell_d)];
                        let product = dot(&self.row, self.to.weights(cell_d));
                        let distance = (product - own_s - own_d).max(0.0);
                        self.offer(best, [s, cell_s, d, cell_d], distance);
                    }
                }
            }
        }
    }

    /// Finds the cheapest pair.
    pub(super) fn cheapest(&mut self, best: &mut Best) {
        // Rounding must not cut off the best pair.
        let slack = 1e-12 * (1.0 + self.options.kappa);
        self.pairs.clear();
        for (s, d) in self.depths() {
            let (cost_s, cost_d) = (self.from.rows[s].cost, self.to.rows[d].cost);
            if !(cost_s + cost_d < best.cost) {
                continue;
            }
            self.prepare(s, d);
            self.begin(s, d);
            let bound = self.bound(s, d, best);
            let least = bound.least - slack;
            if least < best.cost {
                self.pairs.push(Depths {
                    least,
                    s: s as u32,
                    d: d as u32,
                });
            }
        }
        self.pairs
            .sort_unstable_by(|a, b| a.least.total_cmp(&b.least));
        for pair in 0..self.pairs.len() {
            let Depths { least, s, d } = self.pairs[pair];
            if least >= best.cost {
                break;
            }
            self.settle(s as usize, d as usize, slack, best);
        }
    }

    /// Starts with the cheapest node of either side.
    fn begin(&mut self, s: usize, d: usize) {
        let (first_s, first_d) = (self.from.rows[s].first, self.to.rows[d].first);
        self.slopes.w.copy_from_slice(self.from.weights(first_s));
        self.slopes.v.copy_from_slice(self.to.weights(first_d));
    }

    /// The bound at e of the two blends; its corner is offered as a pair.
    fn bound(&mut self, s: usize, d: usize, best: &mut Best) -> Bound {
        let block = self.block_at(s, d);
        let block = &self.blocks[block];
        let k = self.distance_weight;
        let at = &mut self.slopes;
        times_column(block, &at.v, &mut at.b_v);
        row_times(&at.w, block, &mut at.w_b);
        times_column(self.from.within(s), &at.w, &mut at.d_w);
        times_column(self.to.within(d), &at.v, &mut at.d_v);
        let length = dot(&at.w, &at.b_v) - 0.5 * dot(&at.w, &at.d_w) - 0.5 * dot(&at.v, &at.d_v);
        // 2 e.(x - x_e) + |e|^2 is linear in the weights of x: x's distance to the one blend less that
        // to the other. Constants cancel between the two sides.
        for ((slope, b), d) in at.slope_s.iter_mut().zip(&at.b_v).zip(&at.d_w) {
            *slope = k * (b - d);
        }
        for ((slope, b), d) in at.slope_d.iter_mut().zip(&at.w_b).zip(&at.d_v) {
            *slope = k * (b - d);
        }
        let (part_s, cell_s) = self.from.tangent(s, &at.slope_s, &mut at.parts_s);
        let (part_d, cell_d) = self.to.tangent(d, &at.slope_d, &mut at.parts_d);
        let distance = self.distance(s, cell_s, d, cell_d);
        self.offer(best, [s, cell_s, d, cell_d], distance);
        Bound {
            least: part_s + part_d - k * length,
            cells: [cell_s, cell_d],
            parts: [part_s, part_d],
            offset: k * length,
            length,
        }
    }

    /// Finds the best pair of two depths, if it is better than the best so far.
    fn settle(&mut self, s: usize, d: usize, slack: f64, best: &mut Best) {
        self.begin(s, d);
        let k = self.distance_weight;
        let mut base = self.from.rows[s].cost + self.to.rows[d].cost;
        let mut bound = self.bound(s, d, best);
        for _ in 0..STEPS {
            if bound.least - slack >= best.cost {
                return;
            }
            // Line search towards the corner on base + k |e|^2.
            let [cell_s, cell_d] = bound.cells;
            let corner =
                self.from.cost[self.from.node(s, cell_s)] + self.to.cost[self.to.node(d, cell_d)];
            let falls = base + 2.0 * bound.offset - bound.parts[0] - bound.parts[1];
            if !(falls > 1e-3 * best.cost.min(1e12)) || k == 0.0 {
                break;
            }
            let along = (bound.parts[0] + bound.parts[1] - corner) / k - 2.0 * bound.length;
            let apart = self.distance(s, cell_s, d, cell_d) - bound.length - along;
            let step = if apart > 0.0 {
                (0.5 * falls / (k * apart)).clamp(0.0, 1.0)
            } else {
                1.0
            };
            base += step * (corner - base);
            let at = &mut self.slopes;
            for (w, to) in at.w.iter_mut().zip(self.from.weights(cell_s)) {
                *w += step * (to - *w);
            }
            for (v, to) in at.v.iter_mut().zip(self.to.weights(cell_d)) {
                *v += step * (to - *v);
            }
            bound = self.bound(s, d, best);
        }
        if bound.least - slack < best.cost {
            self.visit_left(s, d, &bound, slack, best);
        }
    }

    /// Visits the pairs of those nodes whose own part of the bound leaves them a chance.
    fn visit_left(&mut self, s: usize, d: usize, bound: &Bound, slack: f64, best: &mut Best) {
        let limit = best.cost + bound.offset + slack;
        let at = &mut self.slopes;
        for (left, parts, side, row, other) in [
            (&mut at.left_s, &at.parts_s, &self.from, s, bound.parts[1]),
            (&mut at.left_d, &at.parts_d, &self.to, d, bound.parts[0]),
        ] {
            left.clear();
            for (line, _) in side.rows[row].cells.lines(side.strides) {
                for cell in line {
                    if parts[cell] + other < limit {
                        let own = half_form(side.weights(cell), side.within(row));
                        left.push((parts[cell], cell, own));
                    }
                }
            }
            left.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        }
        let block = self.block_at(s, d);
        for a in 0..self.slopes.left_s.len() {
            let (part_s, cell_s, own_s) = self.slopes.left_s[a];
            let weights = self.from.weights(cell_s);
            row_times(weights, &self.blocks[block.clone()], &mut self.row);
            for b in 0..self.slopes.left_d.len() {
                let (part_d, cell_d, own_d) = self.slopes.left_d[b];
                if part_s + part_d - bound.offset - slack >= best.cost {
                    break;
                }
                let product = dot(&self.row, self.to.weights(cell_d));
                let distance = (product - own_s - own_d).max(0.0);
                self.offer(best, [s, cell_s, d, cell_d], distance);
            }
        }
    }

    /// Finds the most similar pair; if it is similar enough, it is the first best.
    pub(super) fn nearest(&mut self, best: &mut Best) {
        // The same with distance in place of cost: nothing but what the bound form adds counts.
        let kept = (self.distance_weight, self.options.kappa);
        let soon = |cost: f64, extra: f64| if cost.is_finite() { extra } else { cost };
        self.distance_weight = 1.0;
        self.options.kappa = self.tables.d_max();
        let most = std::mem::replace(&mut self.most_distance, f64::INFINITY);
        for side in [&mut self.from, &mut self.to] {
            side.swap_costs(&soon);
        }
        let mut nearest = Best::none();
        self.cheapest(&mut nearest);
        for side in [&mut self.from, &mut self.to] {
            side.restore_costs();
        }
        (self.distance_weight, self.options.kappa) = kept;
        self.most_distance = most;
        best.distance = nearest.distance;
        if let Some([s, cell_s, d, cell_d]) = nearest.at {
            let distance = self.distance(s, cell_s, d, cell_d);
            self.offer(best, [s, cell_s, d, cell_d], distance);
        }
    }
}
