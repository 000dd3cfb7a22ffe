//! One parameter: a table along the clips, ordered by their own values, made monotone.

use super::{InverseError, InverseOptions, NotMonotone};

/// Whether a parameter is monotone along the clips.
#[derive(Copy, Clone, Debug, PartialEq)]
pub enum Monotone {
    /// It is.
    Yes,
    /// It was not; only this range is used.
    Restricted {
        /// Lowest value used.
        from: f64,
        /// Highest value used.
        to: f64,
        /// Lowest and highest value that blends reach in all.
        reached: (f64, f64),
    },
    /// It was not; the nearest monotone function is used, which differs by at most this share of the range.
    Isotonic {
        /// Largest change as a share of the range.
        change: f64,
    },
}

/// Values below this share of the range are rounding, not a way back.
const SLACK: f64 = 1e-9;

#[derive(Clone, Debug)]
pub(super) struct Chain {
    /// Clips in the order of their values.
    order: Vec<usize>,
    /// Place along the chain (whole part: clip, rest: share of the next) and value there, both growing.
    table: Vec<(f64, f64)>,
    monotone: Monotone,
}

impl Chain {
    pub(super) fn new(
        examples: usize,
        options: &InverseOptions,
        mut value: impl FnMut(&[f64]) -> Result<f64, InverseError>,
    ) -> Result<Self, InverseError> {
        let mut w = vec![0.0; examples];
        let mut corners = Vec::with_capacity(examples);
        for clip in 0..examples {
            w.fill(0.0);
            w[clip] = 1.0;
            corners.push((clip, value(&w)?));
        }
        corners.sort_by(|a, b| a.1.total_cmp(&b.1));
        let span = corners[examples - 1].1 - corners[0].1;
        if !(span > 1e-12 * corners[0].1.abs().max(1e-6)) {
            return Err(InverseError::Flat {
                dimension: 0,
                value: corners[0].1,
            });
        }
        // Of clips with the same value one is enough.
        corners.dedup_by(|b, a| b.1 - a.1 <= SLACK * span);
        let order: Vec<usize> = corners.iter().map(|c| c.0).collect();
        let per_edge = options.samples.max(2);
        let mut table = vec![(0.0, corners[0].1)];
        for edge in 0..order.len() - 1 {
            for k in 1..=per_edge {
                let u = k as f64 / per_edge as f64;
                w.fill(0.0);
                w[order[edge]] = 1.0 - u;
                w[order[edge + 1]] = u;
                table.push((edge as f64 + u, value(&w)?));
            }
        }
        let (low, high) = table
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| {
                (l.min(t.1), h.max(t.1))
            });
        let falls = |t: &[(f64, f64)]| t[1].1 < t[0].1 - SLACK * span;
        let monotone = if !table.windows(2).any(falls) {
            Monotone::Yes
        } else if options.not_monotone == NotMonotone::Isotonic {
            Monotone::Isotonic {
                change: isotonic(&mut table) / (high - low),
            }
        } else {
            table = longest_rise(&table);
            Monotone::Restricted {
                from: table[0].1,
                to: table[table.len() - 1].1,
                reached: (low, high),
            }
        };
        Ok(Self {
            order,
            table,
            monotone,
        })
    }

    pub(super) fn range(&self) -> (f64, f64) {
        (self.table[0].1, self.table[self.table.len() - 1].1)
    }

    pub(super) fn monotone(&self) -> Monotone {
        self.monotone
    }

    pub(super) fn weights(&self, p: f64, out: &mut [f64]) {
        let last = self.table.len() - 1;
        let i = self.table[1..last].partition_point(|t| t.1 <= p);
        let ((x0, p0), (x1, p1)) = (self.table[i], self.table[i + 1]);
        let w = if p1 > p0 {
            ((p - p0) / (p1 - p0)).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let x = x0 + w * (x1 - x0);
        let edge = (x as usize).min(self.order.len() - 2);
        let u = x - edge as f64;
        out.fill(0.0);
        out[self.order[edge]] = 1.0 - u;
        out[self.order[edge + 1]] = u;
    }
}

/// The nearest growing function (least squares, pool adjacent violators), in place; the largest change.
fn isotonic(table: &mut [(f64, f64)]) -> f64 {
    let mut pools: Vec<(f64, usize)> = Vec::new();
    for (_, value) in table.iter() {
        pools.push((*value, 1));
        while let [.., (a, m), (b, n)] = pools[..]
            && a > b
        {
            let mean = (a * m as f64 + b * n as f64) / (m + n) as f64;
            pools.truncate(pools.len() - 2);
            pools.push((mean, m + n));
        }
    }
    let mut change: f64 = 0.0;
    let values = pools.iter().flat_map(|(v, n)| std::iter::repeat_n(*v, *n));
    for (entry, value) in table.iter_mut().zip(values) {
        change = change.max((entry.1 - value).abs());
        entry.1 = value;
    }
    change
}

/// The growing stretch with the widest range.
fn longest_rise(table: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut best = (0, 0);
    let mut from = 0;
    for k in 1..table.len() {
        if table[k].1 < table[k - 1].1 {
            from = k;
        }
        if table[k].1 - table[from].1 > table[best.1].1 - table[best.0].1 {
            best = (from, k);
        }
    }
    // The chain's ends differ, so some stretch grows.
    table[best.0..=best.1.max(best.0 + 1).min(table.len() - 1)].to_vec()
}
