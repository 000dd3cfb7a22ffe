//! Boxes of parameter levels, walked line by line along the first axis.

use super::MAX_PARAMETERS;
use std::ops::Range;

/// Levels per axis as small numbers.
pub(super) type Levels = [u16; MAX_PARAMETERS];

/// A box of levels, both ends included.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub(super) struct LevelBox {
    pub(super) low: Levels,
    pub(super) high: Levels,
}

impl LevelBox {
    /// The box of one cell.
    pub(super) fn at(levels: Levels) -> Self {
        Self {
            low: levels,
            high: levels,
        }
    }

    /// All lines of the box along the first axis, whose stride is 1: their cells and the levels of their
    /// first cell.
    pub(super) fn lines(
        &self,
        strides: [usize; MAX_PARAMETERS],
    ) -> impl Iterator<Item = (Range<usize>, Levels)> + use<> {
        let LevelBox { low, high } = *self;
        let length = usize::from(high[0] - low[0]) + 1;
        let mut next = Some(low);
        std::iter::from_fn(move || {
            let now = next?;
            let mut after = now;
            next = None;
            for d in 1..MAX_PARAMETERS {
                if after[d] < high[d] {
                    after[d] += 1;
                    next = Some(after);
                    break;
                }
                after[d] = low[d];
            }
            let first: usize = (0..MAX_PARAMETERS)
                .map(|d| usize::from(now[d]) * strides[d])
                .sum();
            Some((first..first + length, now))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_visit_every_cell_of_a_box_once() {
        let cells = LevelBox {
            low: [1, 0, 2, 0],
            high: [3, 4, 2, 1],
        };
        // A lattice of 5 x 6 x 4 x 2 levels.
        let lines: Vec<_> = cells.lines([1, 5, 30, 120]).collect();
        assert_eq!(lines.len(), 5 * 2);
        let mut all: Vec<usize> = lines.iter().flat_map(|(line, _)| line.clone()).collect();
        assert_eq!(all.len(), 3 * 5 * 2);
        assert_eq!((all[0], all[all.len() - 1]), (61, 120 + 60 + 20 + 3));
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), 30, "a cell was visited twice");
        assert_eq!(LevelBox::default().lines([1, 1, 1, 1]).count(), 1);
    }
}
