//! Boxes of parameter levels, and balls around the nodes in them.

use super::MAX_PARAMETERS;

/// Levels per axis as small numbers.
pub(super) type Levels = [u16; MAX_PARAMETERS];

/// A box of levels, both ends included.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub(super) struct LevelBox {
    pub(super) low: Levels,
    pub(super) high: Levels,
}

impl LevelBox {
    pub(super) fn cells(&self) -> usize {
        (0..MAX_PARAMETERS)
            .map(|d| usize::from(self.high[d] - self.low[d]) + 1)
            .product()
    }

    /// The level in the middle.
    pub(super) fn middle(&self) -> Levels {
        std::array::from_fn(|d| self.low[d] + (self.high[d] - self.low[d]) / 2)
    }

    pub(super) fn holds(&self, levels: &Levels) -> bool {
        (0..MAX_PARAMETERS).all(|d| (self.low[d]..=self.high[d]).contains(&levels[d]))
    }

    /// Two halves along the longest axis; `None` for a single cell.
    pub(super) fn halves(&self) -> Option<(Self, Self)> {
        let longest = (0..MAX_PARAMETERS).max_by_key(|d| self.high[*d] - self.low[*d])?;
        if self.high[longest] == self.low[longest] {
            return None;
        }
        let (mut below, mut above) = (*self, *self);
        below.high[longest] = self.middle()[longest];
        above.low[longest] = below.high[longest] + 1;
        Some((below, above))
    }

    /// All levels of the box; the first axis runs fastest.
    pub(super) fn iter(&self) -> impl Iterator<Item = Levels> + use<> {
        let LevelBox { low, high } = *self;
        let mut next = Some(low);
        std::iter::from_fn(move || {
            let now = next?;
            let mut after = now;
            next = None;
            for d in 0..MAX_PARAMETERS {
                if after[d] < high[d] {
                    after[d] += 1;
                    next = Some(after);
                    break;
                }
                after[d] = low[d];
            }
            Some(now)
        })
    }
}

/// Nodes of one depth in a box of levels, and what holds for all of them.
#[derive(Copy, Clone, Debug)]
pub(super) struct Ball {
    pub(super) cells: LevelBox,
    /// Cell of the node in the middle.
    pub(super) centre: usize,
    /// No node is farther from the middle than this, m.
    pub(super) radius: f64,
    /// Least cost, latency (s) and added distance (m^2) of its nodes.
    pub(super) cost: f64,
    pub(super) latency_s: f64,
    pub(super) extra: f64,
    /// Index of the first of two children; `None` for a leaf.
    pub(super) child: Option<usize>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_visits_every_cell_once_and_its_halves_share_none() {
        let whole = LevelBox {
            low: [1, 0, 2, 0],
            high: [3, 4, 2, 1],
        };
        let all: Vec<Levels> = whole.iter().collect();
        assert_eq!(all.len(), whole.cells());
        assert_eq!(whole.cells(), 3 * 5 * 2);
        let (below, above) = whole.halves().expect("more than one cell");
        assert_eq!(below.cells() + above.cells(), whole.cells());
        for levels in &all {
            assert!(whole.holds(levels));
            assert!(below.holds(levels) != above.holds(levels), "{levels:?}");
        }
        let one = LevelBox::default();
        assert_eq!((one.cells(), one.halves()), (1, None));
    }
}
