//! Weights inverse to the distance to the nearest examples, smooth where the set of nearest changes.

use super::parameters::MOST_DIMENSIONS;
use super::radial::distance_sq;

type Point = [f64; MOST_DIMENSIONS];

/// Distances that are kept in order: `nearest` + 1 of them.
pub(super) const MOST_NEAREST: usize = 7;
/// The edge of the support is at least this many squared distances of the nearest example away, so
/// that where all examples are equally far none loses its weight.
const LEAST_EDGE_SQ: f64 = 1.5 * 1.5;

/// Raw weights `(d_1 / d_i) (1 - d_i^2 / R^2)^2` with `R` the distance of the example after the
/// `nearest` ones (Rhodin 2016, 9.5.2, with the cut-off made smooth); their sum is above 0.
///
/// Between two examples with nothing else near, the weights are linear in the distance.
#[inline]
pub(super) fn at(centres: &[Point], nearest: usize, p: &Point, out: &mut [f64]) {
    let kept = nearest.min(MOST_NEAREST) + 1;
    let mut order = [f64::INFINITY; MOST_NEAREST + 1];
    for (centre, out) in centres.iter().zip(out.iter_mut()) {
        let d = distance_sq(p, centre);
        *out = d;
        if d < order[kept - 1] {
            let mut k = kept - 1;
            while k > 0 && order[k - 1] > d {
                order[k] = order[k - 1];
                k -= 1;
            }
            order[k] = d;
        }
    }
    let least = order[0];
    if least == 0.0 {
        for w in out {
            *w = if *w == 0.0 { 1.0 } else { 0.0 };
        }
        return;
    }
    // Fewer examples than `nearest`: no edge, all of them count.
    let edge = order[kept - 1].max(LEAST_EDGE_SQ * least);
    for w in out {
        let fall = (1.0 - *w / edge).max(0.0);
        *w = (least / *w).sqrt() * fall * fall;
    }
}
