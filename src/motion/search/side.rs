//! One trellis: forwards from the present state of the source, or backwards from that of the target.
//!
//! All states of one depth have the same time. Parameters stay or move to a neighbouring level, so the
//! nodes of a depth are a box of levels. Since the duration of a step depends on the parameters, routes to
//! a node differ in latency; the least is found by dynamic programming over depths (the paper takes any
//! route, whose length in steps is the same).

use super::blocks::{dot, row_times, within_at};
use super::class::{Between, SearchClass};
use super::tree::{Ball, LevelBox, Levels};
use super::{FRAMES_PER_SECOND, Form, MAX_PARAMETERS, SearchOptions, State};

/// Boxes of at most this many nodes are not divided further.
const LEAF_CELLS: usize = 4;
/// Ends of a range are met within this.
const NEAR: f64 = 1e-9;

/// Nodes of one depth.
#[derive(Copy, Clone, Debug)]
pub(super) struct Row {
    pub(super) t: f64,
    pub(super) at: Between,
    /// Its ball of all nodes.
    pub(super) root: usize,
    cells: LevelBox,
}

/// A trellis with room for the largest request, filled anew by every one.
#[derive(Debug)]
pub(super) struct Side {
    pub(super) rows: Vec<Row>,
    pub(super) balls: Vec<Ball>,
    /// Number of references.
    pub(super) references: usize,
    /// Values of each axis; one value for axes that the class does not have.
    axes: [Vec<f64>; MAX_PARAMETERS],
    strides: [usize; MAX_PARAMETERS],
    /// Number of cells, product of the axes' lengths.
    stride: usize,
    /// Cells x references.
    weights: Vec<f64>,
    /// Cells: length of the blend, s.
    durations_s: Vec<f64>,
    // Rows x cells: latency (s), predecessor, cost without the pair's distance, 1/2 w D w, distance
    // added by the bound.
    pub(super) latency_s: Vec<f64>,
    back: Vec<u32>,
    pub(super) cost: Vec<f64>,
    pub(super) own: Vec<f64>,
    pub(super) extra: Vec<f64>,
    /// Rows x references.
    spread: Vec<f64>,
    // Work space: references x references, and references.
    within: Vec<f64>,
    row: Vec<f64>,
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
            balls: Vec::with_capacity(2 * nodes),
            references: n,
            axes: std::array::from_fn(|_| Vec::with_capacity(levels)),
            strides: [1; MAX_PARAMETERS],
            stride: 1,
            weights: vec![0.0; cells * n],
            durations_s: vec![0.0; cells],
            latency_s: vec![0.0; nodes],
            back: vec![0; nodes],
            cost: vec![0.0; nodes],
            own: vec![0.0; nodes],
            extra: vec![0.0; nodes],
            spread: vec![0.0; rows * n],
            within: vec![0.0; n * n],
            row: vec![0.0; n],
        }
    }

    /// Cell of levels.
    pub(super) fn cell(&self, levels: &Levels) -> usize {
        (0..MAX_PARAMETERS)
            .map(|d| usize::from(levels[d]) * self.strides[d])
            .sum()
    }

    /// Index of a node in the tables of rows x cells.
    pub(super) fn node(&self, row: usize, cell: usize) -> usize {
        row * self.stride + cell
    }

    /// Blend weights of a cell.
    pub(super) fn weights(&self, cell: usize) -> &[f64] {
        &self.weights[cell * self.references..(cell + 1) * self.references]
    }

    /// Spread of every reference at a row's time, see [`within_at`].
    pub(super) fn spread(&self, row: usize) -> &[f64] {
        &self.spread[row * self.references..(row + 1) * self.references]
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
        let mut cells = LevelBox {
            low: origin,
            high: origin,
        };
        self.push_row(class, t, cells);
        let first = self.cell(&origin);
        self.latency_s[first] = 0.0;
        self.back[first] = first as u32;
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
            self.relax(depth, &before, &cells, step);
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
        let origin = self.set_axes(class, parameters, None);
        self.rows.clear();
        let cells = LevelBox {
            low: origin,
            high: origin,
        };
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
                    let down = ((p - NEAR) / step).ceil().max(0.0) as u16;
                    let up = ((1.0 - p - NEAR) / step).ceil().max(0.0) as u16;
                    let below = (1..=down).rev().map(|k| (p - f64::from(k) * step).max(0.0));
                    axis.extend(below);
                    axis.push(p);
                    axis.extend((1..=up).map(|k| (p + f64::from(k) * step).min(1.0)));
                    // A remainder within rounding belongs to the end.
                    if down > 0 && axis[0] < NEAR {
                        axis[0] = 0.0;
                    }
                    origin[d] = down;
                }
                _ => axis.push(p),
            }
            self.strides[d] = self.stride;
            self.stride *= axis.len();
        }
        let mut state = State::default();
        for cell in 0..self.stride {
            for d in 0..MAX_PARAMETERS {
                state.parameters[d] = self.axes[d][cell / self.strides[d] % self.axes[d].len()];
            }
            let at = cell * self.references..(cell + 1) * self.references;
            class.weights(&state, &mut self.weights[at.clone()]);
            self.durations_s[cell] = class.duration_s(&self.weights[at]);
        }
        origin
    }

    fn push_row(&mut self, class: &SearchClass, t: f64, cells: LevelBox) {
        self.rows.push(Row {
            t,
            at: class.between(t),
            root: 0,
            cells,
        });
    }

    /// Least latency of every node of a depth from those of the depth before. A step is played at the
    /// mean duration of its two ends, since `w` and with it `T(w)` is linear within the step.
    fn relax(&mut self, depth: usize, before: &LevelBox, cells: &LevelBox, step: f64) {
        for levels in cells.iter() {
            let cell = self.cell(&levels);
            // Staying comes first, so that it wins among equals.
            let stays = before.holds(&levels).then_some(levels);
            let mut around = *before;
            for d in 0..MAX_PARAMETERS {
                around.low[d] = around.low[d].max(levels[d].saturating_sub(1));
                around.high[d] = around.high[d].min(levels[d] + 1);
            }
            let mut best = (f64::INFINITY, 0);
            for from in stays.into_iter().chain(around.iter()) {
                let from = self.cell(&from);
                let mean_s = 0.5 * (self.durations_s[from] + self.durations_s[cell]);
                let latency = self.latency_s[self.node(depth - 1, from)] + step * mean_s;
                if latency < best.0 {
                    best = (latency, from);
                }
            }
            let node = self.node(depth, cell);
            self.latency_s[node] = best.0;
            self.back[node] = best.1 as u32;
        }
    }

    /// Costs, distances and balls of all rows.
    fn finish(&mut self, class: &SearchClass, options: &SearchOptions, distance_weight: f64) {
        self.balls.clear();
        let n = self.references;
        for row in 0..self.rows.len() {
            let Row { at, cells, .. } = self.rows[row];
            let spread = &mut self.spread[row * n..(row + 1) * n];
            within_at(class, at, spread, &mut self.within);
            let scale = self.within.iter().copied().fold(0.0, f64::max);
            let penalties = (options.mu > 0.0).then(|| {
                let (here, there) = (class.penalty(at.frame), class.penalty(at.next));
                (here, there)
            });
            for levels in cells.iter() {
                let cell = self.cell(&levels);
                let node = self.node(row, cell);
                let w = &self.weights[cell * n..(cell + 1) * n];
                row_times(w, &self.within, &mut self.row);
                let own = 0.5 * dot(&self.row, w);
                let spread = &self.spread[row * n..(row + 1) * n];
                let extra = match options.form {
                    Form::Exact => 0.0,
                    Form::Bound => own + dot(spread, w),
                };
                let penalty = penalties.map_or(0.0, |(here, there)| {
                    (1.0 - at.part) * dot(here, w) + at.part * dot(there, w)
                });
                self.own[node] = own;
                self.extra[node] = extra;
                self.cost[node] = options.lambda * FRAMES_PER_SECOND * self.latency_s[node]
                    + distance_weight * extra
                    + options.mu * penalty;
            }
            self.rows[row].root = self.balls.len();
            self.plant(row, cells, scale);
        }
    }

    /// The tree of balls of one row.
    fn plant(&mut self, row: usize, cells: LevelBox, scale: f64) {
        let first = self.balls.len();
        let ball = self.ball(row, cells, scale);
        self.balls.push(ball);
        let mut next = first;
        while next < self.balls.len() {
            let cells = self.balls[next].cells;
            if cells.cells() > LEAF_CELLS
                && let Some((below, above)) = cells.halves()
            {
                self.balls[next].child = Some(self.balls.len());
                for half in [below, above] {
                    let ball = self.ball(row, half, scale);
                    self.balls.push(ball);
                }
            }
            next += 1;
        }
    }

    fn ball(&mut self, row: usize, cells: LevelBox, scale: f64) -> Ball {
        let n = self.references;
        let centre = self.cell(&cells.middle());
        let w = &self.weights[centre * n..(centre + 1) * n];
        row_times(w, &self.within, &mut self.row);
        let own = self.own[self.node(row, centre)];
        let mut ball = Ball {
            cells,
            centre,
            radius: 0.0,
            cost: f64::INFINITY,
            latency_s: f64::INFINITY,
            extra: f64::INFINITY,
            child: None,
        };
        let mut farthest: f64 = 0.0;
        for levels in cells.iter() {
            let cell = self.cell(&levels);
            let node = self.node(row, cell);
            let distance = dot(&self.row, self.weights(cell)) - own - self.own[node];
            farthest = farthest.max(distance);
            ball.cost = ball.cost.min(self.cost[node]);
            ball.latency_s = ball.latency_s.min(self.latency_s[node]);
            ball.extra = ball.extra.min(self.extra[node]);
        }
        // A little larger than it is: what cancels in the difference must not make it too small.
        ball.radius = (farthest + 1e-14 * scale).sqrt();
        ball
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
