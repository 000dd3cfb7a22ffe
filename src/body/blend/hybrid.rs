//! Hybrid blending: the quick mean plus tabulated differences to the correct one.
//!
//! Casas 2013, eq. 3.6 to 3.8. With the references `r` of the cell that holds the weights `w` and
//! their hat weights `g`: `M(w) = M_L(w) + sum g(w, r) D(r)`, `D(r)` the difference of the non-linear to the linear
//! blend at `r`. The paper adds `D` to the linear blends at the references, which for points is the same.

use super::mean::NonLinear;
use super::simplex::Cells;
use crate::body::{Feet, PoseSpace};
use std::collections::HashMap;
use std::ops::Range;

/// Gives the example poses of a frame, by its number and the weights.
type Sample<'a> = dyn FnMut(usize, &[f64], &mut [f64]) + 'a;

/// How far the weight space is cut.
#[derive(Copy, Clone, Debug, PartialEq)]
pub enum Refine {
    /// Until no tested place is farther from the non-linear blend than this, metres.
    Until {
        /// Largest distance, metres, above zero.
        epsilon_m: f64,
        /// References between the corners at most.
        most: usize,
    },
    /// Every cell so many times: with two poses 1 makes one reference in the middle, 2 three.
    Times(u32),
}

/// What a table came to.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct HybridReport {
    /// References between the corners.
    pub references: usize,
    /// Cells.
    pub cells: usize,
    /// Differences of joints that were kept, over all references.
    pub kept: usize,
    /// Memory of the differences, bytes.
    pub bytes: usize,
    /// Largest distance of a tested place to the non-linear blend, metres.
    pub worst_m: f64,
    /// `worst_m` is below what was asked for.
    pub reached: bool,
}

/// The table of one class.
#[derive(Clone, Debug)]
pub struct Hybrid {
    cells: Cells,
    /// Per reference its differences; empty at the corners.
    tables: Vec<Table>,
    frames: usize,
    periodic: bool,
    report: HybridReport,
    // Work space, so that a step allocates nothing.
    corners: Vec<usize>,
    shares: Vec<f64>,
    difference: Vec<f64>,
}

/// Differences at one reference: only of joints that matter.
#[derive(Clone, Debug, Default)]
struct Table {
    /// Coordinates of a difference that are kept.
    kept: Vec<Range<usize>>,
    /// Numbers per frame.
    width: usize,
    /// Frames x width.
    values: Vec<f64>,
}

/// A cell's error is tested at these parts of every edge: the middle alone would miss an S shape.
const TESTED: [f64; 3] = [0.25, 0.5, 0.75];
/// Part of epsilon that dropped differences may use up.
const DROPPED: f64 = 0.25;
/// Cells are cut until the tested places keep this part of epsilon, since others lie between them.
const KEPT: f64 = 0.9;

impl Hybrid {
    /// Builds the table from example poses.
    ///
    /// `frames`: poses at evenly spaced places of the class's cycle (`periodic`: the last is followed by the
    /// first) or way; each holds one pose per clip, one after the other. `mean` is what the table has to match: on
    /// a skeleton in the places of its joints, on a robot in those of the ends that `mean` keeps, or without
    /// ends in its lever arms. Costs one non-linear blend per frame and tested weight.
    pub fn new(
        space: &dyn PoseSpace,
        mean: &NonLinear,
        frames: &[Vec<f64>],
        periodic: bool,
        refine: Refine,
    ) -> Self {
        let poses = frames.first().map_or(0, |f| f.len() / space.len().max(1));
        let size = [frames.len(), poses];
        Self::sampled(space, mean, size, periodic, refine, &mut |k, _, out| {
            out.copy_from_slice(&frames[k]);
        })
    }

    /// The same for example poses that depend on the weights, as limbs with timelines of their own do.
    /// `size`: frames, and poses in each; `poses(k, weights, out)` gives those of frame `k`.
    pub fn sampled(
        space: &dyn PoseSpace,
        mean: &NonLinear,
        [frames, poses]: [usize; 2],
        periodic: bool,
        refine: Refine,
        sample: &mut Sample<'_>,
    ) -> Self {
        let mut hybrid = Self {
            cells: Cells::new(poses),
            tables: vec![Table::default(); poses],
            frames,
            periodic,
            report: HybridReport::default(),
            corners: vec![0; poses],
            shares: vec![0.0; poses],
            difference: vec![0.0; space.tangent_len()],
        };
        let mut builder = Builder {
            space,
            mean: mean.clone(),
            frames,
            frame: vec![0.0; poses * space.len()],
            sample,
            drop_m: 0.0,
            tested: HashMap::new(),
        };
        let limit_m = match refine {
            Refine::Times(times) => {
                for _ in 0..times {
                    builder.cut_all(&mut hybrid);
                }
                f64::INFINITY
            }
            Refine::Until { epsilon_m, most } => {
                builder.drop_m = DROPPED * epsilon_m;
                builder.cut_until(&mut hybrid, KEPT * epsilon_m, most);
                epsilon_m
            }
        };
        let leaves: Vec<Vec<usize>> = hybrid.cells.leaves().map(<[usize]>::to_vec).collect();
        let worst_m = leaves
            .iter()
            .map(|leaf| builder.worst(&mut hybrid, leaf))
            .fold(0.0, f64::max);
        hybrid.report = HybridReport {
            references: hybrid.cells.references.len() - poses,
            cells: leaves.len(),
            kept: hybrid.tables.iter().map(|t| t.kept.len()).sum(),
            bytes: hybrid
                .tables
                .iter()
                .map(|t| size_of_val(&t.values[..]))
                .sum(),
            worst_m,
            reached: worst_m <= limit_m,
        };
        hybrid
    }

    /// What the table came to.
    pub fn report(&self) -> HybridReport {
        self.report
    }

    /// Weights of all references, the corners first.
    pub fn references(&self) -> &[Vec<f64>] {
        &self.cells.references
    }

    /// Weighted mean of `poses` at `u`, 0..1 of the class, into `out`. Allocates nothing.
    pub fn blend(
        &mut self,
        space: &dyn PoseSpace,
        u: f64,
        poses: &[f64],
        weights: &[f64],
        out: &mut [f64],
    ) {
        space.blend(poses, weights, out);
        if self.frames == 0 || weights.len() != self.shares.len() {
            return;
        }
        self.cells
            .locate(weights, &mut self.corners, &mut self.shares);
        self.difference.fill(0.0);
        let frames = around(u, self.frames, self.periodic);
        let mut any = false;
        for (corner, share) in self.corners.iter().zip(&self.shares) {
            let table = &self.tables[*corner];
            if *share > 0.0 && table.width > 0 {
                any = true;
                for (frame, weight) in frames {
                    if weight != 0.0 {
                        table.add(frame, share * weight, &mut self.difference);
                    }
                }
            }
        }
        if any {
            space.add(out, &self.difference, 1.0);
        }
    }
}

impl Table {
    /// Adds `share` times the differences of `frame` to `out`.
    fn add(&self, frame: usize, share: f64, out: &mut [f64]) {
        let mut row = self.values[frame * self.width..(frame + 1) * self.width].iter();
        for range in &self.kept {
            for (out, value) in out[range.clone()].iter_mut().zip(row.by_ref()) {
                *out += share * value;
            }
        }
    }
}

/// The frames around `u` with their weights: a cubic through four of them, so that speed is continuous.
fn around(u: f64, frames: usize, periodic: bool) -> [(usize, f64); 4] {
    let last = frames - 1;
    let x = if periodic {
        u.rem_euclid(1.0) * frames as f64
    } else {
        u.clamp(0.0, 1.0) * last as f64
    };
    let at = (x as usize).min(last);
    let w = x - at as f64;
    let frame = |k: usize| {
        // k counts from one before.
        if periodic {
            (at + frames + k - 1) % frames
        } else {
            (at + k).saturating_sub(1).min(last)
        }
    };
    let (w2, w3) = (w * w, w * w * w);
    [
        (frame(0), 0.5 * (2.0 * w2 - w - w3)),
        (frame(1), 0.5 * (2.0 - 5.0 * w2 + 3.0 * w3)),
        (frame(2), 0.5 * (w + 4.0 * w2 - 3.0 * w3)),
        (frame(3), 0.5 * (w3 - w2)),
    ]
}

/// What building needs.
struct Builder<'a> {
    space: &'a dyn PoseSpace,
    mean: NonLinear,
    frames: usize,
    /// Room for the poses of a frame.
    frame: Vec<f64>,
    sample: &'a mut Sample<'a>,
    /// Differences may be dropped that move nothing farther than this together, metres.
    drop_m: f64,
    /// Worst distance of every tested weight, by its bits. A cell's weights are tested again only when it is new.
    tested: HashMap<Vec<u64>, f64>,
}

impl Builder<'_> {
    fn cut_all(&mut self, hybrid: &mut Hybrid) {
        let leaves: Vec<Vec<usize>> = hybrid.cells.leaves().map(<[usize]>::to_vec).collect();
        for leaf in leaves {
            // It may have been cut with a neighbour.
            if hybrid.cells.leaves().any(|l| l == leaf) {
                self.cut(hybrid, &leaf);
            }
        }
    }

    fn cut_until(&mut self, hybrid: &mut Hybrid, goal_m: f64, most: usize) {
        let corners = hybrid.tables.len();
        let mut good: Vec<Vec<usize>> = Vec::new();
        while hybrid.tables.len() - corners < most {
            let next = hybrid.cells.leaves().find(|l| !good.iter().any(|g| g == l));
            let Some(leaf) = next.map(<[usize]>::to_vec) else {
                return;
            };
            if self.worst(hybrid, &leaf) > goal_m {
                self.cut(hybrid, &leaf);
            } else {
                good.push(leaf);
            }
        }
    }

    fn cut(&mut self, hybrid: &mut Hybrid, leaf: &[usize]) {
        if let Some(edge) = hybrid.cells.longest_edge(leaf) {
            let middle = hybrid.cells.bisect(edge);
            let table = self.table(&hybrid.cells.references[middle]);
            hybrid.tables.push(table);
            self.tested.clear();
        }
    }

    /// Differences of the non-linear to the linear blend at `weights`, less what does not matter.
    fn table(&mut self, weights: &[f64]) -> Table {
        let space = self.space;
        let tangent = space.tangent_len();
        let mut linear = vec![0.0; space.len()];
        let mut correct = linear.clone();
        let mut rows = vec![0.0; self.frames * tangent];
        for (k, row) in rows.chunks_exact_mut(tangent.max(1)).enumerate() {
            (self.sample)(k, weights, &mut self.frame);
            space.blend(&self.frame, weights, &mut linear);
            self.mean.blend(space, &self.frame, weights, &mut correct);
            space.diff(&linear, &correct, row);
        }
        // How far each part's difference moves anything, in the frame where it is largest.
        let mut moved: Vec<(f64, Range<usize>)> = Vec::new();
        for part in space.parts() {
            let range = part.tangent.clone();
            let size = |row: &[f64]| row[range.clone()].iter().map(|v| v * v).sum::<f64>();
            let mut largest = (0.0, 0);
            for (k, row) in rows.chunks_exact(tangent.max(1)).enumerate() {
                if size(row) > largest.0 {
                    largest = (size(row), k);
                }
            }
            if largest.0 <= 1e-24 {
                continue;
            }
            (self.sample)(largest.1, weights, &mut self.frame);
            space.blend(&self.frame, weights, &mut linear);
            let mut only = vec![0.0; tangent];
            only[range.clone()].copy_from_slice(&rows[largest.1 * tangent..][range.clone()]);
            correct.copy_from_slice(&linear);
            space.add(&mut correct, &only, 1.0);
            moved.push((self.distance(&linear, &correct), range));
        }
        moved.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.start.cmp(&b.1.start)));
        let mut dropped = 0.0;
        moved.retain(|(distance, _)| {
            dropped += distance;
            dropped > self.drop_m
        });
        let mut kept: Vec<Range<usize>> = moved.into_iter().map(|(_, range)| range).collect();
        kept.sort_by_key(|range| range.start);
        let values: Vec<f64> = (rows.chunks_exact(tangent.max(1)))
            .flat_map(|row| {
                kept.iter()
                    .flat_map(|range| row[range.clone()].iter().copied())
            })
            .collect();
        Table {
            width: kept.iter().map(Range::len).sum(),
            kept,
            values,
        }
    }

    /// Largest distance to the non-linear blend at a cell's tested weights, metres.
    fn worst(&mut self, hybrid: &mut Hybrid, leaf: &[usize]) -> f64 {
        let references = &hybrid.cells.references;
        let mut points: Vec<Vec<f64>> = Vec::new();
        for (k, a) in leaf.iter().enumerate() {
            for b in &leaf[k + 1..] {
                for share in TESTED {
                    let (x, y) = (&references[*a], &references[*b]);
                    let mix = |(x, y): (&f64, &f64)| x + share * (y - x);
                    points.push(x.iter().zip(y).map(mix).collect());
                }
            }
        }
        let centre = |i: usize| {
            let sum: f64 = leaf.iter().map(|r| references[*r][i]).sum();
            sum / leaf.len().max(1) as f64
        };
        points.push((0..leaf.len()).map(centre).collect());
        points
            .iter()
            .map(|weights| self.error(hybrid, weights))
            .fold(0.0, f64::max)
    }

    fn error(&mut self, hybrid: &mut Hybrid, weights: &[f64]) -> f64 {
        let key: Vec<u64> = weights.iter().map(|w| w.to_bits()).collect();
        if let Some(known) = self.tested.get(&key) {
            return *known;
        }
        let mut correct = vec![0.0; self.space.len()];
        let mut quick = correct.clone();
        let mut worst = 0.0_f64;
        let places = if hybrid.periodic {
            self.frames
        } else {
            self.frames.max(2) - 1
        };
        for k in 0..self.frames {
            (self.sample)(k, weights, &mut self.frame);
            let frame = &self.frame;
            self.mean.blend(self.space, frame, weights, &mut correct);
            let u = k as f64 / places as f64;
            hybrid.blend(self.space, u, frame, weights, &mut quick);
            worst = worst.max(self.distance(&correct, &quick));
        }
        self.tested.insert(key, worst);
        worst
    }

    fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        distance(self.space, self.mean.ends().map(AsRef::as_ref), a, b)
    }
}

/// Largest distance between the places of two poses, metres: joints of a skeleton and ends; of a robot the
/// ends, or without ends the lever arms.
fn distance(space: &dyn PoseSpace, ends: Option<&dyn Feet>, a: &[f64], b: &[f64]) -> f64 {
    let skeleton = space.parts().iter().any(|p| p.coordinates.len() == 4);
    let mut worst = 0.0_f64;
    if let Some(ends) = ends {
        for end in 0..ends.count() {
            worst = worst.max((ends.position(a, end) - ends.position(b, end)).norm());
        }
    }
    if skeleton || ends.is_none() {
        let mut embedded = vec![0.0; 2 * space.features()];
        let (x, y) = embedded.split_at_mut(space.features());
        space.embed(a, x);
        space.embed(b, y);
        let group = if skeleton { 3 } else { 1 };
        for (x, y) in x.chunks(group).zip(y.chunks(group)) {
            let squared: f64 = x.iter().zip(y).map(|(x, y)| (x - y).powi(2)).sum();
            worst = worst.max(squared.sqrt());
        }
    }
    worst
}
