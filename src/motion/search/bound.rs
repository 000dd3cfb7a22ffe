//! Which pair is the cheapest, without visiting all: a separable lower bound (see [`Search::find`]).

use super::blocks::{across_at, dot, row_times, times_column, without_spread};
use super::boxes::LevelBox;
use super::find::Search;
use super::side::Side;

/// Steps towards a better bound for two depths, at most.
const STEPS: usize = 4;
/// So many pairs are visited rather than bounded again.
const FEW_PAIRS: usize = 256;

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
    /// Nodes that are left: own part, cell; and `1/2 v D v` of the target's.
    left_s: Vec<(f64, usize)>,
    left_d: Vec<(f64, usize)>,
    own: Vec<f64>,
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
            own: Vec::with_capacity(cells_d),
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
    /// Squared distance of the two cells.
    distance: f64,
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
            let boxes = [self.from.rows[s].cells, self.to.rows[d].cells];
            if self.begin(s, d, &boxes).is_none() {
                continue;
            }
            let bound = self.bound(s, d, &boxes, best);
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

    /// Starts at the middle of two boxes, or at their cheapest nodes when the middle is too late; the costs
    /// there. `None` when all nodes of a box are too late.
    fn begin(&mut self, s: usize, d: usize, boxes: &[LevelBox; 2]) -> Option<f64> {
        let at = &mut self.slopes;
        let mut base = 0.0;
        for (side, row, cells, weights, parts) in [
            (&self.from, s, &boxes[0], &mut at.w, &mut at.parts_s),
            (&self.to, d, &boxes[1], &mut at.v, &mut at.parts_d),
        ] {
            let mut cell = cells.middle(side.strides);
            let mut cost = side.cost[side.node(row, cell)];
            if !cost.is_finite() {
                (cost, cell) = side.tangent(row, cells, &[], parts);
                if !cost.is_finite() {
                    return None;
                }
            }
            weights.copy_from_slice(side.weights(cell));
            base += cost;
        }
        Some(base)
    }

    /// The bound of the nodes in two boxes at e of the two blends; its corner is offered as a pair.
    fn bound(&mut self, s: usize, d: usize, boxes: &[LevelBox; 2], best: &mut Best) -> Bound {
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
        let (part_s, cell_s) = self
            .from
            .tangent(s, &boxes[0], &at.slope_s, &mut at.parts_s);
        let (part_d, cell_d) = self.to.tangent(d, &boxes[1], &at.slope_d, &mut at.parts_d);
        let distance = self.distance(s, cell_s, d, cell_d);
        self.offer(best, [s, cell_s, d, cell_d], distance);
        Bound {
            least: part_s + part_d - k * length,
            cells: [cell_s, cell_d],
            parts: [part_s, part_d],
            distance,
            length,
        }
    }

    /// One conditional gradient step on `base + k |e|^2`: towards the corner of the bound. Returns the
    /// new base; `None` when there is little to gain.
    fn improve(&mut self, s: usize, d: usize, base: f64, bound: &Bound) -> Option<f64> {
        let k = self.distance_weight;
        let [cell_s, cell_d] = bound.cells;
        let corner =
            self.from.cost[self.from.node(s, cell_s)] + self.to.cost[self.to.node(d, cell_d)];
        let parts = bound.parts[0] + bound.parts[1];
        let falls = base + 2.0 * k * bound.length - parts;
        if !(falls > 1e-3 * (base + k * bound.length)) {
            return None;
        }
        let along = (parts - corner) / k - 2.0 * bound.length;
        let apart = bound.distance - bound.length - along;
        let step = if apart > 0.0 {
            (0.5 * falls / (k * apart)).clamp(0.0, 1.0)
        } else {
            1.0
        };
        let at = &mut self.slopes;
        for (w, to) in at.w.iter_mut().zip(self.from.weights(cell_s)) {
            *w += step * (to - *w);
        }
        for (v, to) in at.v.iter_mut().zip(self.to.weights(cell_d)) {
            *v += step * (to - *v);
        }
        Some(base + step * (corner - base))
    }

    /// Finds the best pair of two depths, if it is better than the best so far: boxes of nodes are
    /// shrunk to what the bound leaves and divided, until few pairs are left to visit.
    fn settle(&mut self, s: usize, d: usize, slack: f64, best: &mut Best) {
        self.stack.clear();
        self.stack
            .push([self.from.rows[s].cells, self.to.rows[d].cells]);
        while let Some(boxes) = self.stack.pop() {
            let Some(mut base) = self.begin(s, d, &boxes) else {
                continue;
            };
            let mut bound = self.bound(s, d, &boxes, best);
            for _ in 0..STEPS {
                if bound.least - slack >= best.cost || self.distance_weight == 0.0 {
                    break;
                }
                let Some(better) = self.improve(s, d, base, &bound) else {
                    break;
                };
                base = better;
                bound = self.bound(s, d, &boxes, best);
            }
            if bound.least - slack >= best.cost {
                continue;
            }
            let left = self.leave(&boxes, &bound, slack, best);
            let pairs = self.slopes.left_s.len() * self.slopes.left_d.len();
            if pairs == 0 {
                continue;
            }
            let wider = usize::from(left[1].extent() > left[0].extent());
            match left[wider].halves() {
                Some(halves) if pairs > FEW_PAIRS => {
                    for half in halves {
                        let mut boxes = left;
                        boxes[wider] = half;
                        self.stack.push(boxes);
                    }
                }
                _ => self.visit_left(s, d, &bound, slack, best),
            }
        }
    }

    /// Collects the nodes whose own part of the bound leaves them a chance; the boxes around them.
    fn leave(
        &mut self,
        boxes: &[LevelBox; 2],
        bound: &Bound,
        slack: f64,
        best: &Best,
    ) -> [LevelBox; 2] {
        let limit = best.cost + self.distance_weight * bound.length + slack;
        let at = &mut self.slopes;
        [
            collect(
                &self.from,
                &boxes[0],
                &at.parts_s,
                limit - bound.parts[1],
                &mut at.left_s,
            ),
            collect(
                &self.to,
                &boxes[1],
                &at.parts_d,
                limit - bound.parts[0],
                &mut at.left_d,
            ),
        ]
    }

    /// Visits the pairs of the nodes that are left.
    fn visit_left(&mut self, s: usize, d: usize, bound: &Bound, slack: f64, best: &mut Best) {
        let at = &mut self.slopes;
        at.own.clear();
        at.left_d.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        for (_, cell_d) in &at.left_d {
            at.own.push(self.to.own(d, *cell_d));
        }
        let offset = self.distance_weight * bound.length + slack;
        let block = self.block_at(s, d);
        for a in 0..self.slopes.left_s.len() {
            let (part_s, cell_s) = self.slopes.left_s[a];
            let least_d = self.slopes.left_d.first().map_or(f64::INFINITY, |l| l.0);
            if part_s + least_d - offset >= best.cost {
                continue;
            }
            let own_s = self.from.own(s, cell_s);
            let weights = self.from.weights(cell_s);
            row_times(weights, &self.blocks[block.clone()], &mut self.row);
            for b in 0..self.slopes.left_d.len() {
                let (part_d, cell_d) = self.slopes.left_d[b];
                if part_s + part_d - offset >= best.cost {
                    break;
                }
                let product = dot(&self.row, self.to.weights(cell_d));
                let distance = (product - own_s - self.slopes.own[b]).max(0.0);
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

/// Nodes of a box whose part is below a limit, into `left`; the box around them.
fn collect(
    side: &Side,
    cells: &LevelBox,
    parts: &[f64],
    limit: f64,
    left: &mut Vec<(f64, usize)>,
) -> LevelBox {
    left.clear();
    let mut around: Option<LevelBox> = None;
    for (line, levels) in cells.lines(side.strides) {
        for (along, cell) in line.enumerate() {
            if parts[cell] < limit {
                left.push((parts[cell], cell));
                let mut here = levels;
                here[0] += along as u16;
                around = Some(around.map_or(LevelBox::at(here), |a| a.with(here)));
            }
        }
    }
    around.unwrap_or(*cells)
}
