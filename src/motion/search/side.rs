//! One trellis: forwards from the present state of the source, or backwards from that of the target.
//!
//! All states of one depth have the same time. Parameters stay or move to a neighbouring level, so the
//! nodes of a depth are a box of levels. Since the duration of a step depends on the parameters, routes to
//! a node differ in latency; the least is found by dynamic programming over depths (the paper takes any
//! route, whose length in steps is the same).

use super::blocks::{dot, half_form, row_times, within_at};
use super::boxes::{LevelBox, Levels};
use super::class::{Between, SearchClass};
use super::{FRAMES_PER_SECOND, Form, MAX_PARAMETERS, SearchOptions, State};

/// Ends of a range are met within this.
const NEAR: f64 = 1e-9;

/// Nodes of one depth.
#[derive(Copy, Clone, Debug)]
pub(super) struct Row {
    pub(super) t: f64,
    pub(super) at: Between,
    pub(super) cells: LevelBox,
    /// Cost of its cheapest node; infinite when none is soon enough.
    pub(super) cost: f64,
}

/// A trellis with room for the largest request, filled anew by every one.
#[derive(Debug)]
pub(super) struct Side {
    pub(super) rows: Vec<Row>,
    /// Number of references.
    pub(super) references: usize,
    /// Values of each axis; one value for axes that the class does not have.
    axes: [Vec<f64>; MAX_PARAMETERS],
    pub(super) strides: [usize; MAX_PARAMETERS],
    /// Number of cells, product of the axes' lengths.
    stride: usize,
    /// Cells x references, and references x cells.
    weights: Vec<f64>,
    columns: Vec<f64>,
    /// Cells: length of the blend, s.
    durations_s: Vec<f64>,
    // Rows x cells: latency (s), predecessor, cost without the pair's distance, distance added by the
    // bound, 1/2 w D w (only after `fill_own`).
    pub(super) latency_s: Vec<f64>,
    back: Vec<u32>,
    pub(super) cost: Vec<f64>,
    pub(super) extra: Vec<f64>,
    pub(super) own: Vec<f64>,
    /// Rows x references.
    spread: Vec<f64>,
    /// Rows x references x references: squared distances at the row's time.
    within: Vec<f64>,
    // Work space: references; cells of two stages of the least predecessor.
    row: Vec<f64>,
    least: [Vec<(f64, u32)>; 2],
}

/// What a trellis of `class` needs room for.
pub(super) fn cells_at_most(class: &SearchClass, delta_w: f64) -> usize {
    let levels = (1.0 / delta_w).ceil() as usize + 2;
    levels.saturating_pow(class.parameters() as u32)
}

impl Side {
    /// Room for trellises of `class` with up to `rows` depths.
    pub(super) fn new(class: &SearchClass, rows: usize, options: &SearchOptions) -> Self {
        let n = class.references();
        let cells = cells_at_most(class, options.delta_w);
        let levels = (1.0 / options.delta_w).ceil() as usize + 2;
        // Free entries have one cell a row, and as many rows as the class has frames.
        let nodes = (rows * cells).max(class.frames());
        let rows = rows.max(class.frames());
        Self {
            rows: Vec::with_capacity(rows),
            references: n,
            axes: std::array::from_fn(|_| Vec::with_capacity(levels)),
            strides: [1; MAX_PARAMETERS],
            stride: 1,
            weights: vec![0.0; cells * n],
            columns: vec![0.0; cells * n],
            durations_s: vec![0.0; cells],
            latency_s: vec![0.0; nodes],
            back: vec![0; nodes],
            cost: vec![0.0; nodes],
            extra: vec![0.0; nodes],
            own: vec![0.0; nodes],
            spread: vec![0.0; rows * n],
            within: vec![0.0; rows * n * n],
            row: vec![0.0; n],
            least: std::array::from_fn(|_| vec![(0.0, 0); cells]),
        }
    }

    /// Index of a node in the tables of rows x cells.
    pub(super) fn node(&self, row: usize, cell: usize) -> usize {
        row * self.stride + cell
    }

    /// Blend weights of a cell.
    pub(super) fn weights(&self, cell: usize) -> &[f64] {
        &self.weights[cell * self.references..(cell + 1) * self.references]
    }

    /// Weights of one reference, by cell.
    pub(super) fn column(&self, reference: usize) -> &[f64] {
        &self.columns[reference * self.stride..(reference + 1) * self.stride]
    }

    /// Spread of every reference at a row's time, see [`within_at`].
    pub(super) fn spread(&self, row: usize) -> &[f64] {
        &self.spread[row * self.references..(row + 1) * self.references]
    }

    /// Squared distances of the references at a row's time.
    pub(super) fn within(&self, row: usize) -> &[f64] {
        let cells = self.references * self.references;
        &self.within[row * cells..(row + 1) * cells]
    }

    /// `1/2 w D w` of a node.
    pub(super) fn own(&self, row: usize, cell: usize) -> f64 {
        half_form(self.weights(cell), self.within(row))
    }

    /// The state of a node.
    pub(super) fn state(&self, row: usize, cell: usize) -> State {
        let mut state = State {
            t: self.rows[row].t,
            ..State::default()
        };
        for (d, value) in state.parameters.iter_mut().enumerate() {
            *value = self.axes[d][cell / self.strides[d] % self.axes[d].len()];
        }
        state
    }

    /// The node before this one on the quickest route.
    pub(super) fn before(&self, row: usize, cell: usize) -> usize {
        self.back[self.node(row, cell)] as usize
    }

    /// Fills the trellis from `state`, forwards or backwards in time.
    pub(super) fn grow(
        &mut self,
        class: &SearchClass,
        state: &State,
        forwards: bool,
        options: &SearchOptions,
        distance_weight: f64,
    ) {
        let origin = self.set_axes(class, &state.parameters, Some(options.delta_w));
        self.rows.clear();
        let mut t = start_of(class, state.t);
        let mut cells = LevelBox::at(origin);
        self.push_row(class, t, cells);
        for (line, _) in cells.lines(self.strides) {
            self.latency_s[line.start] = 0.0;
            self.back[line.start] = line.start as u32;
        }
        for depth in 1..=options.l_max {
            let Some((after, step)) = advance(class, t, options.delta_t, forwards) else {
                break;
            };
            t = after;
            let before = cells;
            for d in 0..MAX_PARAMETERS {
                cells.low[d] = cells.low[d].saturating_sub(1);
                cells.high[d] = (cells.high[d] + 1).min(self.axes[d].len() as u16 - 1);
            }
            self.push_row(class, t, cells);
            self.relax(class.parameters(), depth, before, step);
        }
        self.finish(class, options, distance_weight);
    }

    /// Fills the trellis with free entries: all frames between two times, at no cost.
    pub(super) fn enter(
        &mut self,
        class: &SearchClass,
        parameters: &[f64; MAX_PARAMETERS],
        range: [f64; 2],
        options: &SearchOptions,
        distance_weight: f64,
    ) {
        let cells = LevelBox::at(self.set_axes(class, parameters, None));
        self.rows.clear();
        for frame in 0..class.frames() {
            let t = class.time_of(frame);
            if (range[0] - NEAR..=range[1] + NEAR).contains(&t) {
                self.push_row(class, t, cells);
            }
        }
        if self.rows.is_empty() {
            self.push_row(class, start_of(class, range[0]), cells);
        }
        for row in 0..self.rows.len() {
            self.latency_s[row] = 0.0;
            self.back[row] = 0;
        }
        self.finish(class, options, distance_weight);
    }

    /// Levels of every axis around `parameters`; returns where these are. Without a step: they alone.
    fn set_axes(
        &mut self,
        class: &SearchClass,
        parameters: &[f64; MAX_PARAMETERS],
        step: Option<f64>,
    ) -> Levels {
        let mut origin = [0; MAX_PARAMETERS];
        self.stride = 1;
        for d in 0..MAX_PARAMETERS {
            let axis = &mut self.axes[d];
            axis.clear();
            // Not-a-number is taken for 0.
            let p = parameters[d].max(0.0).min(1.0);
            match step {
                Some(step) if d < class.parameters() => {
                    // A remainder within rounding belongs to the end.
                    let down = ((p - NEAR) / step).ceil().max(0.0) as u16;
                    let up = ((1.0 - p - NEAR) / step).ceil().max(0.0) as u16;
                    let below = |k: u16| {
                        if k == down {
                            0.0
                        } else {
                            p - f64::from(k) * step
                        }
                    };
                    let above = |k: u16| {
                        if k == up {
                            1.0
                        } else {
                            p + f64::from(k) * step
                        }
                    };
                    axis.extend((1..=down).rev().map(below));
                    axis.push(p);
                    axis.extend((1..=up).map(above));
                    origin[d] = down;
                }
                _ => axis.push(p),
            }
            self.strides[d] = self.stride;
            self.stride *= axis.len();
        }
        let n = self.references;
        let mut state = State::default();
        for cell in 0..self.stride {
            let mut rest = cell;
            for d in 0..class.parameters() {
                let axis = &self.axes[d];
                state.parameters[d] = axis[rest % axis.len()];
                rest /= axis.len();
            }
            let weights = &mut self.weights[cell * n..(cell + 1) * n];
            class.weights(&state, weights);
            self.durations_s[cell] = class.duration_s(weights);
            for (j, w) in weights.iter().enumerate() {
                self.columns[j * self.stride + cell] = *w;
            }
        }
        origin
    }

    fn push_row(&mut self, class: &SearchClass, t: f64, cells: LevelBox) {
        self.rows.push(Row {
            t,
            at: class.between(t),
            cells,
            cost: f64::INFINITY,
        });
    }

    /// Least latency of every node of a depth from those of the depth before. A step is played at the
    /// mean duration of its two ends, since `w` and with it `T(w)` is linear within the step. The least
    /// predecessor in a box around a cell is had axis by axis.
    fn relax(&mut self, parameters: usize, depth: usize, before: LevelBox, step: f64) {
        let (above, here) = ((depth - 1) * self.stride, depth * self.stride);
        let [now, next] = &mut self.least;
        for (line, _) in before.lines(self.strides) {
            for cell in line {
                let latency = self.latency_s[above + cell];
                now[cell] = (latency + 0.5 * step * self.durations_s[cell], cell as u32);
            }
        }
        let mut reached = before;
        for d in 0..parameters {
            let (low, high) = (reached.low[d], reached.high[d]);
            reached.low[d] = low.saturating_sub(1);
            reached.high[d] = (high + 1).min(self.axes[d].len() as u16 - 1);
            let stride = self.strides[d];
            for (line, levels) in reached.lines(self.strides) {
                for (along, cell) in line.enumerate() {
                    let level = levels[d] + if d == 0 { along as u16 } else { 0 };
                    // Staying comes first, so that it wins among equals.
                    let mut best = (f64::INFINITY, 0);
                    if (low..=high).contains(&level) {
                        best = now[cell];
                    }
                    if level > low && now[cell - stride].0 < best.0 {
                        best = now[cell - stride];
                    }
                    if level < high && now[cell + stride].0 < best.0 {
                        best = now[cell + stride];
                    }
                    next[cell] = best;
                }
            }
            std::mem::swap(now, next);
        }
        for (line, _) in reached.lines(self.strides) {
            for cell in line {
                let (latency, from) = now[cell];
                self.latency_s[here + cell] = latency + 0.5 * step * self.durations_s[cell];
                self.back[here + cell] = from;
            }
        }
    }

    /// Costs of all nodes and distances of the references at all times.
    fn finish(&mut self, class: &SearchClass, options: &SearchOptions, distance_weight: f64) {
        let n = self.references;
        let per_second = options.lambda * FRAMES_PER_SECOND;
        let most_s = options.max_latency_s.unwrap_or(f64::INFINITY);
        for row in 0..self.rows.len() {
            let Row { at, cells, .. } = self.rows[row];
            let spread = &mut self.spread[row * n..(row + 1) * n];
            let within = &mut self.within[row * n * n..(row + 1) * n * n];
            within_at(class, at, spread, within);
            let mut best = f64::INFINITY;
            for (line, _) in cells.lines(self.strides) {
                for cell in line {
                    let node = row * self.stride + cell;
                    let w = &self.weights[cell * n..(cell + 1) * n];
                    let latency = self.latency_s[node];
                    let mut cost = per_second * latency;
                    self.extra[node] = 0.0;
                    if options.form == Form::Bound {
                        row_times(w, within, &mut self.row);
                        let extra = 0.5 * dot(&self.row, w) + dot(spread, w);
                        self.extra[node] = extra;
                        cost += distance_weight * extra;
                    }
                    if options.mu > 0.0 {
                        let (here, there) = (class.penalty(at.frame), class.penalty(at.next));
                        let penalty = (1.0 - at.part) * dot(here, w) + at.part * dot(there, w);
                        cost += options.mu * penalty;
                    }
                    if latency > most_s {
                        cost = f64::INFINITY;
                    }
                    self.cost[node] = cost;
                    best = best.min(cost);
                }
            }
            self.rows[row].cost = best;
        }
    }

    /// Fills [`Side::own`] for all nodes.
    pub(super) fn fill_own(&mut self) {
        for row in 0..self.rows.len() {
            for (line, _) in self.rows[row].cells.lines(self.strides) {
                for cell in line {
                    let node = self.node(row, cell);
                    self.own[node] = self.own(row, cell);
                }
            }
        }
    }

    /// Puts in place of every node's cost what `other(cost, extra)` says, keeping the costs aside.
    pub(super) fn swap_costs(&mut self, other: &dyn Fn(f64, f64) -> f64) {
        for row in 0..self.rows.len() {
            let mut best = f64::INFINITY;
            for (line, _) in self.rows[row].cells.lines(self.strides) {
                for cell in line {
                    let node = row * self.stride + cell;
                    self.own[node] = self.cost[node];
                    self.cost[node] = other(self.cost[node], self.extra[node]);
                    best = best.min(self.cost[node]);
                }
            }
            self.rows[row].cost = best;
        }
    }

    /// Undoes [`Side::swap_costs`].
    pub(super) fn restore_costs(&mut self) {
        for row in 0..self.rows.len() {
            let mut best = f64::INFINITY;
            for (line, _) in self.rows[row].cells.lines(self.strides) {
                for cell in line {
                    let node = row * self.stride + cell;
                    self.cost[node] = self.own[node];
                    best = best.min(self.cost[node]);
                }
            }
            self.rows[row].cost = best;
        }
    }

    /// `cost + gradient . w` of the nodes in a box of a row into `out` (by cell); the least and its cell.
    pub(super) fn tangent(
        &self,
        row: usize,
        cells: &LevelBox,
        gradient: &[f64],
        out: &mut [f64],
    ) -> (f64, usize) {
        let mut best = (f64::INFINITY, cells.middle(self.strides));
        for (line, _) in cells.lines(self.strides) {
            let out = &mut out[line.clone()];
            let node = row * self.stride;
            out.copy_from_slice(&self.cost[node + line.start..node + line.end]);
            for (j, g) in gradient.iter().enumerate() {
                for (out, w) in out.iter_mut().zip(&self.column(j)[line.clone()]) {
                    *out += g * w;
                }
            }
            for (along, value) in out.iter().enumerate() {
                if *value < best.0 {
                    best = (*value, line.start + along);
                }
            }
        }
        best
    }
}

/// A time within the class; not-a-number is taken for 0.
fn start_of(class: &SearchClass, t: f64) -> f64 {
    if !t.is_finite() {
        0.0
    } else if class.cyclic {
        t.rem_euclid(1.0)
    } else {
        t.clamp(0.0, 1.0)
    }
}

/// The time one step further and how long the step is; `None` at the end of an open class.
fn advance(class: &SearchClass, t: f64, delta_t: f64, forwards: bool) -> Option<(f64, f64)> {
    let signed = if forwards { delta_t } else { -delta_t };
    if class.cyclic {
        return Some(((t + signed).rem_euclid(1.0), delta_t));
    }
    let after = (t + signed).clamp(0.0, 1.0);
    let step = (after - t).abs();
    (step > NEAR).then_some((after, step))
}
