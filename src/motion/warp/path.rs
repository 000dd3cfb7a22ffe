//! The cheapest monotone path through a table of frame pairs, with key pairs it must pass.

use super::WarpError;

/// Cost of pairing frame a of one clip with frame b of another.
#[derive(Clone, Debug, PartialEq)]
pub struct CostTable {
    costs: Vec<f64>,
    rows: usize,
    columns: usize,
}

impl CostTable {
    /// `rows` x `columns` costs from `cost(a, b)`; at least one of each.
    pub fn from_fn(rows: usize, columns: usize, mut cost: impl FnMut(usize, usize) -> f64) -> Self {
        let (rows, columns) = (rows.max(1), columns.max(1));
        let mut costs = Vec::with_capacity(rows * columns);
        for a in 0..rows {
            for b in 0..columns {
                costs.push(cost(a, b));
            }
        }
        Self {
            costs,
            rows,
            columns,
        }
    }

    /// Cost of the pair (a, b).
    pub fn at(&self, a: usize, b: usize) -> f64 {
        self.costs[a * self.columns + b]
    }

    /// Frames of the first clip.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Frames of the second clip.
    pub fn columns(&self) -> usize {
        self.columns
    }
}

/// A path and what it costs.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// Pairs of frames from (0, 0) on; each step adds 1 to one index or to both.
    pub pairs: Vec<(usize, usize)>,
    /// Sum of the costs of all pairs.
    pub cost: f64,
}

/// The cheapest path from (0, 0) through all `keys` to the far corner, or, with `open_end`, to the
/// cheapest cell of the last row or column.
///
/// Moves are (1,0), (0,1) and (1,1). Each key splits the problem into independent rectangles; keys
/// must increase strictly in both indices. Time and memory O(rows x columns).
pub fn cheapest_path(
    table: &CostTable,
    keys: &[(usize, usize)],
    open_end: bool,
) -> Result<Path, WarpError> {
    let last = (table.rows - 1, table.columns - 1);
    for (pair, &(a, b)) in keys.iter().enumerate() {
        if a > last.0 || b > last.1 {
            return Err(WarpError::KeyOutside {
                pair,
                a,
                b,
                last_a: last.0,
                last_b: last.1,
            });
        }
    }
    let mut stops = vec![(0, 0)];
    for (index, key) in keys.iter().enumerate() {
        if index == 0 && *key == (0, 0) {
            continue;
        }
        after(&stops, *key)?;
        stops.push(*key);
    }
    let open = open_end && stops.last() != Some(&last);
    if !open && stops.last() != Some(&last) {
        // One row or one column is a legal clip pair of the table, though not of a warp.
        if last.0 > 0 && last.1 > 0 {
            after(&stops, last)?;
        }
        stops.push(last);
    }
    let mut path = Path {
        pairs: vec![(0, 0)],
        cost: table.at(0, 0),
    };
    for corners in stops.windows(2) {
        extend(table, corners[0], corners[1], false, &mut path);
    }
    if open {
        let from = stops[stops.len() - 1];
        extend(table, from, last, true, &mut path);
    }
    Ok(path)
}

fn after(stops: &[(usize, usize)], key: (usize, usize)) -> Result<(), WarpError> {
    let before = stops[stops.len() - 1];
    if key.0 > before.0 && key.1 > before.1 {
        return Ok(());
    }
    Err(WarpError::KeyOrder {
        a: key.0,
        b: key.1,
        before_a: before.0,
        before_b: before.1,
    })
}

/// Dynamic programme over one rectangle; adds its path without the first corner.
fn extend(
    table: &CostTable,
    from: (usize, usize),
    to: (usize, usize),
    open: bool,
    path: &mut Path,
) {
    let (rows, columns) = (to.0 - from.0 + 1, to.1 - from.1 + 1);
    let mut sums = vec![f64::INFINITY; rows * columns];
    // 1: from the row above, 2: from the column before, 3: from both.
    let mut moves = vec![0u8; rows * columns];
    sums[0] = 0.0;
    for a in 0..rows {
        for b in 0..columns {
            if a + b == 0 {
                continue;
            }
            // The diagonal first: of equal ways it is the straightest. Costs that are no numbers decide
            // nothing, but a way there is.
            let mut best = match (a, b) {
                (0, _) => (sums[b - 1], 2),
                (_, 0) => (sums[(a - 1) * columns], 1),
                _ => (sums[(a - 1) * columns + b - 1], 3),
            };
            if a > 0 && sums[(a - 1) * columns + b] < best.0 {
                best = (sums[(a - 1) * columns + b], 1);
            }
            if b > 0 && sums[a * columns + b - 1] < best.0 {
                best = (sums[a * columns + b - 1], 2);
            }
            sums[a * columns + b] = best.0 + table.at(from.0 + a, from.1 + b);
            moves[a * columns + b] = best.1;
        }
    }
    let mut end = (rows - 1, columns - 1);
    if open {
        let last_row = (0..columns).map(|b| (rows - 1, b));
        let last_column = (0..rows).map(|a| (a, columns - 1));
        for cell in last_row.chain(last_column) {
            if sums[cell.0 * columns + cell.1] < sums[end.0 * columns + end.1] {
                end = cell;
            }
        }
    }
    path.cost += sums[end.0 * columns + end.1];
    let begin = path.pairs.len();
    let mut at = end;
    while at != (0, 0) {
        path.pairs.push((from.0 + at.0, from.1 + at.1));
        match moves[at.0 * columns + at.1] {
            1 => at.0 -= 1,
            2 => at.1 -= 1,
            _ => at = (at.0 - 1, at.1 - 1),
        }
    }
    path.pairs[begin..].reverse();
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Every monotone path from `at` to an end, the least cost of them.
    fn brute(table: &CostTable, at: (usize, usize), open: bool, keys: &[(usize, usize)]) -> f64 {
        let last = (table.rows() - 1, table.columns() - 1);
        if at.0 > last.0 || at.1 > last.1 {
            return f64::INFINITY;
        }
        // A key in whose row or column we are must be the cell itself or lie strictly ahead.
        let (passed, ahead): (Vec<_>, Vec<_>) = keys.iter().partition(|k| **k == at);
        let _: Vec<(usize, usize)> = passed;
        if ahead.iter().any(|k: &(usize, usize)| {
            let done = k.0 <= at.0 && k.1 <= at.1;
            let possible = k.0 >= at.0 && k.1 >= at.1;
            !done && !possible
        }) {
            return f64::INFINITY;
        }
        let here = table.at(at.0, at.1);
        let ends = if open {
            (at.0 == last.0 || at.1 == last.1) && ahead.iter().all(|k| k.0 <= at.0 && k.1 <= at.1)
        } else {
            at == last
        };
        let mut least = if ends { 0.0 } else { f64::INFINITY };
        for step in [(1, 0), (0, 1), (1, 1)] {
            let next = (at.0 + step.0, at.1 + step.1);
            // A key may not be stepped over by a diagonal: then it lies behind without being met.
            if keys.iter().any(|k| {
                *k != at
                    && *k != next
                    && k.0 <= next.0
                    && k.1 <= next.1
                    && (k.0 >= at.0 && k.1 >= at.1)
            }) {
                continue;
            }
            least = least.min(brute(table, next, open, keys));
        }
        here + least
    }

    proptest! {
        #[test]
        fn the_path_costs_what_brute_force_finds_on_six_by_six(
            costs in prop::collection::vec(0.0..1.0f64, 36),
            open in any::<bool>(),
            key in prop::option::of((1..5usize, 1..5usize)),
        ) {
            let table = CostTable::from_fn(6, 6, |a, b| costs[6 * a + b]);
            let keys: Vec<(usize, usize)> = key.into_iter().collect();
            let path = cheapest_path(&table, &keys, open).expect("a lawful key");
            let truth = brute(&table, (0, 0), open, &keys);
            prop_assert!((path.cost - truth).abs() < 1e-12, "{} against {}", path.cost, truth);
            let sum: f64 = path.pairs.iter().map(|(a, b)| table.at(*a, *b)).sum();
            prop_assert!((path.cost - sum).abs() < 1e-12, "{} is not the path's {}", path.cost, sum);
            prop_assert!(keys.iter().all(|k| path.pairs.contains(k)), "a key is missed");
            for w in path.pairs.windows(2) {
                let step = (w[1].0 - w[0].0, w[1].1 - w[0].1);
                prop_assert!([(1, 0), (0, 1), (1, 1)].contains(&step), "step {:?}", step);
            }
        }
    }

    #[test]
    fn costs_that_are_no_numbers_still_give_a_path() {
        for wrong in [f64::NAN, f64::INFINITY] {
            let table = CostTable::from_fn(5, 7, |a, b| if a == b { wrong } else { 1.0 });
            let path = cheapest_path(&table, &[], false).expect("no keys");
            assert_eq!(path.pairs.last(), Some(&(4, 6)), "{path:?}");
        }
    }

    #[test]
    fn keys_out_of_order_or_outside_are_refused_with_both_pairs() {
        let table = CostTable::from_fn(10, 10, |_, _| 1.0);
        let back = cheapest_path(&table, &[(4, 5), (6, 5)], false).expect_err("same column");
        assert_eq!(
            back,
            WarpError::KeyOrder {
                a: 6,
                b: 5,
                before_a: 4,
                before_b: 5
            }
        );
        let outside = cheapest_path(&table, &[(4, 10)], false)
            .expect_err("frame 10 of 10")
            .to_string();
        assert!(outside.contains("0..=9"), "{outside}");
        let edge =
            cheapest_path(&table, &[(0, 3)], false).expect_err("the first frames are a pair");
        assert!(
            matches!(edge, WarpError::KeyOrder { a: 0, b: 3, .. }),
            "{edge}"
        );
        assert!(cheapest_path(&table, &[(0, 0), (3, 4), (9, 9)], false).is_ok());
    }
}
