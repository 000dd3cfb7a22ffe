//! The weight space of a class cut into cells: a simplex, bisected edge by edge.

/// Cells over the weights of `n` poses, and the references at their corners.
///
/// Cells stay conforming: an edge is cut in all cells that have it, so what is interpolated between the
/// corners is continuous everywhere.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    /// Weights of every reference; the first `n` are the corners.
    pub(super) references: Vec<Vec<f64>>,
    cells: Vec<Cell>,
}

#[derive(Clone, Debug)]
struct Cell {
    /// References at the corners.
    corners: Vec<usize>,
    split: Option<Split>,
}

/// Where a cell was cut.
#[derive(Copy, Clone, Debug)]
struct Split {
    /// Corners of the edge, as places in the cell's list.
    edge: [usize; 2],
    /// Reference in the middle of it.
    middle: usize,
    /// The cells that keep the first and the second corner.
    halves: [usize; 2],
}

impl Cells {
    /// One cell whose corners are the poses themselves.
    pub(super) fn new(n: usize) -> Self {
        let corner = |i: usize| (0..n).map(|j| f64::from(u8::from(i == j))).collect();
        Self {
            references: (0..n).map(corner).collect(),
            cells: vec![Cell {
                corners: (0..n).collect(),
                split: None,
            }],
        }
    }

    /// Corners of the cells that are not cut.
    pub(super) fn leaves(&self) -> impl Iterator<Item = &[usize]> {
        let whole = self.cells.iter().filter(|c| c.split.is_none());
        whole.map(|c| c.corners.as_slice())
    }

    /// The longest edge of a cell; of equals the first.
    pub(super) fn longest_edge(&self, corners: &[usize]) -> Option<[usize; 2]> {
        let mut longest = None;
        for (k, a) in corners.iter().enumerate() {
            for b in &corners[k + 1..] {
                let (x, y) = (&self.references[*a], &self.references[*b]);
                let length: f64 = x.iter().zip(y).map(|(x, y)| (x - y).powi(2)).sum();
                if longest.is_none_or(|(best, _)| length > best) {
                    longest = Some((length, [*a, *b]));
                }
            }
        }
        longest.map(|(_, edge)| edge)
    }

    /// Cuts an edge in the middle, in every cell that has it. Returns the new reference.
    pub(super) fn bisect(&mut self, edge: [usize; 2]) -> usize {
        let [a, b] = edge;
        let middle = self.references.len();
        let weights = self.references[a].iter().zip(&self.references[b]);
        let weights = weights.map(|(x, y)| 0.5 * (x + y)).collect();
        self.references.push(weights);
        for index in 0..self.cells.len() {
            let cell = &self.cells[index];
            let place = |r: usize| cell.corners.iter().position(|c| *c == r);
            let (None, Some(at_a), Some(at_b)) = (cell.split, place(a), place(b)) else {
                continue;
            };
            let half = |replaced: usize| {
                let mut corners = cell.corners.clone();
                corners[replaced] = middle;
                Cell {
                    corners,
                    split: None,
                }
            };
            let halves = [half(at_b), half(at_a)];
            let next = self.cells.len();
            self.cells.extend(halves);
            self.cells[index].split = Some(Split {
                edge: [at_a, at_b],
                middle,
                halves: [next, next + 1],
            });
        }
        middle
    }

    /// The references around `weights`, and the share of each (hat weights): not negative, sum as the
    /// weights'. `corners` and `shares` are as long as the weights. Allocates nothing.
    pub(super) fn locate(&self, weights: &[f64], corners: &mut [usize], shares: &mut [f64]) {
        for (k, corner) in corners.iter_mut().enumerate() {
            *corner = k;
        }
        shares.copy_from_slice(weights);
        let mut at = 0;
        while let Some(split) = self.cells[at].split {
            let [a, b] = split.edge;
            // The point is x A + y B with the middle M = (A + B) / 2: the smaller share goes to M twice.
            let (keep, give, half) = if shares[a] >= shares[b] {
                (a, b, 0)
            } else {
                (b, a, 1)
            };
            shares[keep] -= shares[give];
            shares[give] *= 2.0;
            corners[give] = split.middle;
            at = split.halves[half];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::SplitMix;

    #[test]
    fn shares_rebuild_the_weights_and_borders_are_shared() {
        let mut cells = Cells::new(4);
        for _ in 0..20 {
            let corners = cells.leaves().last().expect("a cell").to_vec();
            let edge = cells.longest_edge(&corners).expect("an edge");
            cells.bisect(edge);
        }
        let mut random = SplitMix::new(1);
        let (mut corners, mut shares) = ([0; 4], [0.0; 4]);
        for _ in 0..10_000 {
            let mut weights = [0; 4].map(|_| random.unit());
            let sum: f64 = weights.iter().sum();
            weights.iter_mut().for_each(|w| *w /= sum);
            cells.locate(&weights, &mut corners, &mut shares);
            let sum: f64 = shares.iter().sum();
            assert!(
                (sum - 1.0).abs() < 1e-12 && shares.iter().all(|s| *s >= 0.0),
                "{shares:?}"
            );
            for (i, weight) in weights.iter().enumerate() {
                let rebuilt: f64 = (corners.iter().zip(&shares))
                    .map(|(c, s)| s * cells.references[*c][i])
                    .sum();
                assert!((rebuilt - weight).abs() < 1e-12, "{rebuilt} for {}", weight);
            }
        }
        let references = cells.references.clone();
        for (k, reference) in references.iter().enumerate() {
            cells.locate(reference, &mut corners, &mut shares);
            let own: f64 = (corners.iter().zip(&shares))
                .filter(|(c, _)| **c == k)
                .map(|(_, s)| s)
                .sum();
            assert!(
                (own - 1.0).abs() < 1e-12,
                "reference {k}: {corners:?} {shares:?}"
            );
        }
    }
}
