//! From the parameters of a class to convex blend weights of its clips or references.

use super::MAX_PARAMETERS;
use crate::motion::weights::{Parameters, Weights};

/// Leads from parameters to blend weights. Called by the search, so it must not allocate.
pub trait WeightMap: Send + Sync {
    /// Number of free parameters, 0..=[`MAX_PARAMETERS`].
    fn parameters(&self) -> usize;

    /// Number of clips or references, at least 1.
    fn references(&self) -> usize;

    /// Weights at `parameters` (each 0..1, [`WeightMap::parameters`] of them) into `out`: not negative,
    /// sum 1.
    fn weights(&self, parameters: &[f64], out: &mut [f64]);
}

/// Multilinear hat weights on a regular lattice of references: the paper's weights between 2^P corner
/// clips (`steps = 1`), and with more steps its in-between references (section 3.3.3).
///
/// Reference `(k_0, k_1, ...)` has index `k_0 + (steps + 1) (k_1 + (steps + 1) k_2 ...)` and sits at
/// parameters `k / steps`.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Hat {
    parameters: usize,
    steps: usize,
}

impl Hat {
    /// Hat weights over `(steps + 1)^parameters` references. Both are brought into their range:
    /// parameters 0..=4, steps at least 1.
    pub fn new(parameters: usize, steps: usize) -> Self {
        Self {
            parameters: parameters.min(MAX_PARAMETERS),
            steps: steps.max(1),
        }
    }

    /// Corner clips alone.
    pub fn corners(parameters: usize) -> Self {
        Self::new(parameters, 1)
    }

    /// Parameters of reference `index`.
    pub fn place(&self, index: usize) -> [f64; MAX_PARAMETERS] {
        let mut rest = index;
        let mut place = [0.0; MAX_PARAMETERS];
        for value in place.iter_mut().take(self.parameters) {
            *value = (rest % (self.steps + 1)) as f64 / self.steps as f64;
            rest /= self.steps + 1;
        }
        place
    }
}

impl WeightMap for Hat {
    fn parameters(&self) -> usize {
        self.parameters
    }

    fn references(&self) -> usize {
        (self.steps + 1).pow(self.parameters as u32)
    }

    fn weights(&self, parameters: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        let mut cell = [0_usize; MAX_PARAMETERS];
        let mut part = [0.0; MAX_PARAMETERS];
        for (d, p) in parameters.iter().enumerate().take(self.parameters) {
            let at = p.clamp(0.0, 1.0) * self.steps as f64;
            cell[d] = (at.floor() as usize).min(self.steps - 1);
            part[d] = at - cell[d] as f64;
        }
        for corner in 0..1_usize << self.parameters {
            let (mut weight, mut index, mut stride) = (1.0, 0, 1);
            for d in 0..self.parameters {
                let up = corner >> d & 1;
                weight *= if up == 1 { part[d] } else { 1.0 - part[d] };
                index += stride * (cell[d] + up);
                stride *= self.steps + 1;
            }
            if let Some(out) = out.get_mut(index) {
                *out += weight;
            }
        }
    }
}

/// The weights of a motion class of the animator ([`Weights`]): parameter 0 is amplitude, parameter 1
/// frequency, each scaled to 0..1 over the range of the examples.
#[derive(Clone, Debug)]
pub struct RbfMap {
    weights: Weights,
    low: Parameters,
    high: Parameters,
    /// Which of amplitude and frequency are free.
    free: Vec<usize>,
}

impl RbfMap {
    /// A map over the given ranges of amplitude and frequency; one without extent is no parameter.
    pub fn new(weights: Weights, low: Parameters, high: Parameters) -> Self {
        let free = (0..2).filter(|d| high[*d] > low[*d]).collect();
        Self {
            weights,
            low,
            high,
            free,
        }
    }
}

impl WeightMap for RbfMap {
    fn parameters(&self) -> usize {
        self.free.len()
    }

    fn references(&self) -> usize {
        self.weights.len()
    }

    fn weights(&self, parameters: &[f64], out: &mut [f64]) {
        let mut wish = self.low;
        for (d, p) in self.free.iter().zip(parameters) {
            wish = wish.with(
                *d,
                self.low[*d] + p.clamp(0.0, 1.0) * (self.high[*d] - self.low[*d]),
            );
        }
        self.weights.at(wish, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_hat_is_one_at_its_own_reference() {
        for (parameters, steps) in [(0, 1), (1, 1), (1, 4), (2, 2), (3, 1), (4, 1)] {
            let hat = Hat::new(parameters, steps);
            let mut out = vec![0.0; hat.references()];
            for index in 0..hat.references() {
                hat.weights(&hat.place(index)[..parameters], &mut out);
                let mut expected = vec![0.0; hat.references()];
                expected[index] = 1.0;
                assert_eq!(out, expected, "P={parameters}, steps={steps}, {index}");
            }
        }
    }

    proptest! {
        #[test]
        fn hats_are_convex_and_reproduce_the_parameters(
            p in prop::array::uniform3(-0.2..1.2f64), steps in 1_usize..5
        ) {
            let hat = Hat::new(3, steps);
            let mut out = vec![0.0; hat.references()];
            hat.weights(&p, &mut out);
            prop_assert!(out.iter().all(|w| *w >= 0.0));
            prop_assert!((out.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            for d in 0..3 {
                let mean: f64 = out.iter().enumerate().map(|(k, w)| w * hat.place(k)[d]).sum();
                prop_assert!((mean - p[d].clamp(0.0, 1.0)).abs() < 1e-12, "axis {d}: {mean}");
            }
        }
    }
}
