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

    /// The smallest box around this one and a cell.
    pub(super) fn with(mut self, levels: Levels) -> Self {
        for d in 0..MAX_PARAMETERS {
            self.low[d] = self.low[d].min(levels[d]);
            self.high[d] = self.high[d].max(levels[d]);
        }
        self
    }

    /// Levels along the longest axis.
    pub(super) fn extent(&self) -> u16 {
        (0..MAX_PARAMETERS)
            .map(|d| self.high[d] - self.low[d])
            .max()
            .unwrap_or(0)
    }

    /// Two halves along the longest axis; `None` for a single cell.
    pub(super) fn halves(&self) -> Option<[Self; 2]> {
        let longest = (0..MAX_PARAMETERS).max_by_key(|d| self.high[*d] - self.low[*d])?;
        let extent = self.high[longest] - self.low[longest];
        if extent == 0 {
            return None;
        }
        let (mut below, mut above) = (*self, *self);
        below.high[longest] = self.low[longest] + extent / 2;
        above.low[longest] = below.high[longest] + 1;
        Some([below, above])
    }

    /// The cell in the middle.
    pub(super) fn middle(&self, strides: [usize; MAX_PARAMETERS]) -> usize {
        (0..MAX_PARAMETERS)
            .map(|d| usize::from(self.low[d] + (self.high[d] - self.low[d]) / 2) * strides[d])
            .sum()
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
        let [below, above] = cells.halves().expect("more than one cell");
        let halves = below
            .lines([1, 5, 30, 120])
            .chain(above.lines([1, 5, 30, 120]));
        let mut parts: Vec<usize> = halves.flat_map(|(line, _)| line).collect();
        parts.sort_unstable();
        assert_eq!(parts, all, "halves share nothing and leave nothing out");
        assert_eq!(LevelBox::default().halves(), None);
        assert_eq!(LevelBox::default().lines([1, 1, 1, 1]).count(), 1);
    }
}
