//! The weight of similarity against latency, chosen by what random requests cost.

use super::find::{OptionsError, Search, SearchOptions, Target};
use super::{MAX_PARAMETERS, State};
use crate::base::random::SplitMix;

/// Between these the ratio of `E_S` to `lambda E_L` at the optimum lies in the paper's Table 4.2.
pub const RATIO: [f64; 2] = [1.0, 2.5];
/// The ratio aimed at, the geometric mean of the two.
const AIM: f64 = 1.58;

/// A kappa and what it leads to.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Cost of a dissimilarity of 1.
    pub kappa: f64,
    /// Mean `E_S` over mean `lambda E_L` at the optimum.
    pub ratio: f64,
}

impl Calibration {
    /// Whether the ratio lies where the paper's does, 1 to 2.5. It cannot for every pair of classes:
    /// where the poses differ by little, no kappa makes waiting worth it.
    pub fn in_range(&self) -> bool {
        (RATIO[0]..=RATIO[1]).contains(&self.ratio)
    }
}

/// Random requests between two classes: present state, target state. The same seed gives the same.
pub fn random_requests(search: &Search, count: usize, seed: u64) -> Vec<(State, State)> {
    let mut random = SplitMix::new(seed);
    let mut state = |parameters: usize| {
        let mut state = State {
            t: random.unit(),
            parameters: [0.0; MAX_PARAMETERS],
        };
        for value in state.parameters.iter_mut().take(parameters) {
            *value = random.unit();
        }
        state
    };
    let (from, to) = (search.source().parameters(), search.target().parameters());
    (0..count).map(|_| (state(from), state(to))).collect()
}

/// Finds the kappa of a data set: from a fixed ladder (four steps a decade, 10 to 10^6) the one whose
/// ratio over `requests` is nearest to 1.6. Kappa is left set in `search`.
///
/// # Errors
/// None for a search that was made; passed on from [`Search::set_weights`].
pub fn calibrate(
    search: &mut Search,
    requests: &[(State, State)],
) -> Result<Calibration, OptionsError> {
    let mut best = Calibration {
        kappa: search.options().kappa,
        ratio: f64::NAN,
    };
    let mut nearest = f64::INFINITY;
    for step in 0..=20 {
        let kappa = 10_f64.powf(1.0 + 0.25 * f64::from(step));
        let options = SearchOptions {
            kappa,
            ..*search.options()
        };
        search.set_weights(&options)?;
        let (mut similarity, mut latency) = (0.0, 0.0);
        for (from, to) in requests {
            if let Ok(found) = search.find(from, &Target::State(*to)) {
                similarity += found.cost.similarity;
                latency += found.cost.latency;
            }
        }
        let ratio = similarity / latency;
        let off = (ratio / AIM).ln().abs();
        if off < nearest {
            nearest = off;
            best = Calibration { kappa, ratio };
        }
    }
    let options = SearchOptions {
        kappa: best.kappa,
        ..*search.options()
    };
    search.set_weights(&options)?;
    Ok(best)
}
