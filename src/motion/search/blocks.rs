//! Distances between clips at times between frames, from tables at frames.
//!
//! Features between two frames are interpolated linearly, which is a blend of the two frames. With the
//! exact form (see [`super::tables`]) the distances of such blends follow from the tables, so the rest
//! of the search works as if every class had a frame at exactly the time that is asked for.

use super::class::{Between, SearchClass};
use super::tables::DistanceTables;

/// Distances within `class` at one time: `out` references x references; `spread[i]` is what clip i's
/// own interpolation takes off a distance, `f (1 - f) |x_i(k) - x_i(k + 1)|^2`.
pub(super) fn within_at(class: &SearchClass, at: Between, spread: &mut [f64], out: &mut [f64]) {
    let n = class.references();
    let (here, there) = (class.within(at.frame), class.within(at.next));
    let cross = class.to_next(at.frame);
    let f = at.part;
    let both = f * (1.0 - f);
    for (i, spread) in spread.iter_mut().enumerate().take(n) {
        *spread = both * cross[i * n + i];
    }
    for i in 0..n {
        for j in 0..n {
            let ij = i * n + j;
            let mixed = (1.0 - f) * (1.0 - f) * here[ij]
                + both * (cross[ij] + cross[j * n + i])
                + f * f * there[ij];
            out[ij] = (mixed - spread[i] - spread[j]).max(0.0);
        }
    }
}

/// Bilinear distances of source clips (rows) to target clips (columns) at two times.
pub(super) fn across_at(tables: &DistanceTables, s: Between, d: Between, out: &mut [f64]) {
    let (fs, fd) = (s.part, d.part);
    let corners = [
        ((1.0 - fs) * (1.0 - fd), tables.block(s.frame, d.frame)),
        ((1.0 - fs) * fd, tables.block(s.frame, d.next)),
        (fs * (1.0 - fd), tables.block(s.next, d.frame)),
        (fs * fd, tables.block(s.next, d.next)),
    ];
    let [(a, p), (b, q), (c, r), (e, u)] = corners;
    for ((((out, p), q), r), u) in out.iter_mut().zip(p).zip(q).zip(r).zip(u) {
        *out = a * p + b * q + c * r + e * u;
    }
}

/// Takes off what interpolation in time takes off, so that `out` holds the distances of the
/// interpolated clips themselves.
pub(super) fn without_spread(spread_s: &[f64], spread_d: &[f64], out: &mut [f64]) {
    let columns = spread_d.len().max(1);
    for (row, s) in out.chunks_exact_mut(columns).zip(spread_s) {
        for (value, d) in row.iter_mut().zip(spread_d) {
            *value = (*value - s - d).max(0.0);
        }
    }
}

/// `w M`, a row times a matrix of `out.len()` columns.
pub(super) fn row_times(w: &[f64], matrix: &[f64], out: &mut [f64]) {
    out.fill(0.0);
    let columns = out.len().max(1);
    for (w, row) in w.iter().zip(matrix.chunks_exact(columns)) {
        for (out, m) in out.iter_mut().zip(row) {
            *out += w * m;
        }
    }
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `M v`, a matrix of `v.len()` columns times a column.
pub(super) fn times_column(matrix: &[f64], v: &[f64], out: &mut [f64]) {
    for (out, row) in out.iter_mut().zip(matrix.chunks_exact(v.len().max(1))) {
        *out = dot(row, v);
    }
}

/// `1/2 w M w`.
pub(super) fn half_form(w: &[f64], matrix: &[f64]) -> f64 {
    let rows = matrix.chunks_exact(w.len().max(1));
    0.5 * w
        .iter()
        .zip(rows)
        .map(|(w_i, row)| w_i * dot(row, w))
        .sum::<f64>()
}
