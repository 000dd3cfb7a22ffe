//! The thesis's estimator: a bank of one-sided Gabor filters over the last five seconds.
//!
//! Rhodin 2016, section 9.4.2, equations 9.3 to 9.6, in seconds and on irregular time stamps.
//! Choices where the text is silent or damaged:
//! - Responses are normalised by the sum of the window, so a pure wave gives its own amplitude.
//!   Every sample weighs as the time it stands for (trapezoidal rule, at most 0.1 s), so bursts and
//!   dropped samples do not count twice or leave dents.
//! - Just after the start the window is not full; the response then counts only for the square of
//!   the covered share, which makes amplitude grow from zero and keeps slow filters from guessing.
//! - A gap of more than half a second ([`LONGEST_GAP_S`]) is such a start too: filters that reach
//!   back no farther than its end would take a held pose for a slow wave.
//! - The 50 periods are spaced logarithmically; the peak is refined by a parabola over the
//!   logarithm of frequency and the filter is evaluated once more there.
//! - Both senses of rotation are searched; the other sense must win by 10 %, because a gesture that
//!   moves on a line has no sense.
//! - The noise test compares with the modulus of the motion on the plane (eq. 9.5). When the
//!   components weigh differently (under-constrained input), a perfect wave's modulus has another
//!   mean, which is divided out.
//! - The damped amplitude below s = 1/3 is zero.
//!
//! Cost: slow filters read averages of neighbouring samples (blocks of at most 1/40 period), so a
//! filter takes some 80 to 160 samples whatever the rate.

use super::estimator::LONGEST_GAP_S;
use super::history::{HISTORY_S, History};
use super::kernel::Kernel;
use super::smooth::Smoother;
use super::{Estimator, PlanePoint, WaveEstimate};
use crate::base::angle::wrap_tau;
use crate::gesture::GestureOptions;

/// Filters in the bank.
const FILTERS: usize = 50;
/// Shortest and longest period in seconds (5 and 150 frames at 30 Hz).
const PERIODS_S: (f64, f64) = (1.0 / 6.0, 5.0);
/// The other sense of rotation must be stronger by this factor.
const SENSE_BIAS: f64 = 1.1;

/// One filter's answer, in both senses of rotation.
#[derive(Copy, Clone, Debug, Default)]
struct Response {
    /// Counter-clockwise: real and imaginary part.
    forward: [f64; 2],
    /// Clockwise.
    backward: [f64; 2],
    /// Mean modulus in the window, for the noise test.
    modulus: f64,
}

impl Response {
    fn of(&self, sense: f64) -> [f64; 2] {
        if sense > 0.0 {
            self.forward
        } else {
            self.backward
        }
    }
}

/// Bank of Gabor filters with smoothing and phase fusion.
#[derive(Clone, Debug)]
pub struct GaborEstimator {
    kernel: Kernel,
    frequencies_hz: [f64; FILTERS],
    under_constrained: bool,
    history: History,
    smoother: Smoother,
    raw: WaveEstimate,
    sense: f64,
}

impl GaborEstimator {
    /// An estimator without history. Allocates all it will ever need.
    pub fn new(options: &GestureOptions) -> Self {
        let (short, long) = PERIODS_S;
        let ratio = (long / short).ln() / (FILTERS - 1) as f64;
        Self {
            kernel: Kernel::new(options.lambda),
            frequencies_hz: std::array::from_fn(|i| 1.0 / (long * (-ratio * i as f64).exp())),
            under_constrained: options.under_constrained,
            history: History::new(),
            smoother: Smoother::new(options.smoothing_s, options.fusion_s),
            raw: WaveEstimate::default(),
            sense: 1.0,
        }
    }

    /// The estimate before smoothing and phase fusion.
    pub fn raw(&self) -> WaveEstimate {
        self.raw
    }

    /// Response of the filter of `frequency_hz` at `now`.
    fn filter(&self, frequency_hz: f64) -> Response {
        let reach = self.kernel.cut_cycles / frequency_hz;
        let (mut total, mut modulus) = (0.0, 0.0);
        let (mut rc, mut rs, mut ic, mut is) = (0.0, 0.0, 0.0, 0.0);
        let mut variance = [0.0; 2];
        for block in self.history.blocks(frequency_hz) {
            if block.lag_s > reach {
                break;
            }
            let tap = self.kernel.at(block.lag_s * frequency_hz);
            let (w, c, s) = (
                block.weight * tap.gauss,
                block.weight * tap.cos,
                block.weight * tap.sin,
            );
            total += w;
            modulus += w * block.modulus;
            rc += c * block.z[0];
            rs += s * block.z[0];
            ic += c * block.z[1];
            is += s * block.z[1];
            variance[0] += w * block.variance[0];
            variance[1] += w * block.variance[1];
        }
        if total <= 0.0 {
            return Response::default();
        }
        let [wr, wi] = if self.under_constrained {
            component_weights(variance)
        } else {
            [1.0, 1.0]
        };
        // The share of the window that history can cover at all is full; less is a start.
        let possible = (HISTORY_S * frequency_hz).min(self.kernel.cut_cycles);
        let covered = self.history.covered_s() * frequency_hz;
        let share = if covered >= possible {
            1.0
        } else {
            self.kernel.coverage(covered) / self.kernel.coverage(possible)
        };
        // Squared: well under a period, a held pose and a wave look alike.
        let scale = share * share / total;
        // A sample at lag l had the phase now minus 2 pi f l: turning it forward by that angle
        // brings it to now. exp(+i u) z for the forward sense, exp(-i u) z for the backward one.
        Response {
            forward: [scale * (wr * rc - wi * is), scale * (wr * rs + wi * ic)],
            backward: [scale * (wr * rc + wi * is), scale * (wi * ic - wr * rs)],
            modulus: modulus / total * mean_modulus(wr, wi),
        }
    }

    fn analyse(&self) -> (WaveEstimate, f64) {
        let mut moduli = [[0.0_f64; FILTERS]; 2];
        for (index, frequency) in self.frequencies_hz.iter().enumerate() {
            let response = self.filter(*frequency);
            moduli[0][index] = length(response.forward);
            moduli[1][index] = length(response.backward);
        }
        let peak = |row: &[f64; FILTERS]| {
            (0..FILTERS).fold(
                0,
                |best, index| {
                    if row[index] > row[best] { index } else { best }
                },
            )
        };
        let peaks = [peak(&moduli[0]), peak(&moduli[1])];
        let heights = [moduli[0][peaks[0]], moduli[1][peaks[1]]];
        let sense = if self.sense > 0.0 {
            if heights[1] > SENSE_BIAS * heights[0] {
                -1.0
            } else {
                1.0
            }
        } else if heights[0] > SENSE_BIAS * heights[1] {
            1.0
        } else {
            -1.0
        };
        let side = usize::from(sense < 0.0);
        let (row, index) = (&moduli[side], peaks[side]);
        let mut frequency = self.frequencies_hz[index];
        if index > 0 && index + 1 < FILTERS {
            let (a, b, c) = (row[index - 1], row[index], row[index + 1]);
            let bend = a - 2.0 * b + c;
            if bend < 0.0 {
                let offset = (0.5 * (a - c) / bend).clamp(-0.5, 0.5);
                frequency *= (self.frequencies_hz[1] / self.frequencies_hz[0]).powf(offset);
            }
        }
        let response = self.filter(frequency);
        let r = response.of(sense);
        let amplitude = length(r);
        let quality = if response.modulus > 1e-12 {
            (amplitude / response.modulus).min(1.0)
        } else {
            0.0
        };
        let damping = if quality >= 5.0 / 6.0 {
            1.0
        } else {
            (2.0 * (quality - 1.0 / 3.0)).max(0.0)
        };
        (
            WaveEstimate {
                amplitude: amplitude * damping,
                frequency_hz: sense * frequency,
                phase_rad: wrap_tau(r[1].atan2(r[0])),
                quality,
            },
            sense,
        )
    }
}

fn length(z: [f64; 2]) -> f64 {
    z[0].hypot(z[1])
}

/// Reciprocals of the variances, brought to the sum 2, with both ends made firm.
///
/// On a loop the two variances take turns and a one-sided window does not quite average them out;
/// on a line a trace of the blind component remains. So a mild imbalance (up to 1.3 : 0.7) counts
/// as none and a strong one (from 1.5 : 0.5, half of what a perfect line has) as complete, linear
/// between.
fn component_weights(variance: [f64; 2]) -> [f64; 2] {
    let [vr, vi] = variance;
    let sum = vr + vi;
    if sum <= 0.0 {
        return [1.0, 1.0];
    }
    let lean = (vi - vr) / sum;
    let firm = ((lean.abs() - 0.3) / 0.2).clamp(0.0, 1.0).copysign(lean);
    [1.0 + firm, 1.0 - firm]
}

/// A perfect wave's mean modulus per unit of response when its components weigh `wr` and `wi`.
///
/// A loop (equal weights) has 1; a line, of which one component is seen, 2 / pi.
fn mean_modulus(wr: f64, wi: f64) -> f64 {
    let lean = 0.5 * (wr - wi).abs();
    1.0 + lean * (0.5 * std::f64::consts::PI - 1.0)
}

impl Estimator for GaborEstimator {
    fn push(&mut self, t: f64, point: PlanePoint) {
        if self.history.push(t, point, LONGEST_GAP_S) {
            self.smoother.reset();
            self.raw = WaveEstimate::default();
            self.sense = 1.0;
        }
        let (raw, sense) = self.analyse();
        self.raw = raw;
        self.sense = sense;
        self.smoother.push(t, raw);
    }

    fn estimate(&self) -> WaveEstimate {
        self.smoother.estimate()
    }

    fn reset(&mut self) {
        self.history.clear();
        self.smoother.reset();
        self.raw = WaveEstimate::default();
        self.sense = 1.0;
    }
}
