//! The default estimator: a wave fit that stays locked, and notices at once when its wave is over.
//!
//! In lock, one Gauss-Newton step per sample keeps amplitude, frequency, phase and centre fitted to a
//! window of lambda periods ([`super::fit`]). How much of the recent past that wave leaves unexplained is
//! held against what it used to leave (the noise, learnt while in lock): when the last third of a period
//! fits clearly worse, the past before it is cut off. The short window that remains is fitted with the
//! centre and shape known from before, so it reads a new tempo after a fraction of a period, and grows
//! again as long as it fits. Two banks of recursive fits ([`super::bank`]) seed and supervise the lock.

use super::bank::{Bank, Candidate};
use super::fit::{Fit, Prior, Task, Wave};
use super::history::History;
use super::lsq::{BANK_HZ, LEAST_SAMPLES, RANGE_HZ, gate};
use super::output::Output;
use super::shape::{C, Shape};
use super::{Estimator, LONGEST_GAP_S, PlanePoint, WaveEstimate};
use crate::base::angle::wrap_tau;
use crate::gesture::GestureOptions;
use std::f64::consts::TAU;

/// Lines of each bank.
const LINES: usize = 28;
/// Window of the quick bank, periods.
const QUICK_LAMBDA: f64 = 0.3;

/// What a wave leaves of the newest past.
#[derive(Copy, Clone, Debug, Default)]
struct Left {
    /// Mean square, both components.
    square: f64,
    /// The part of it that changes from sample to sample: half the mean square of the changes.
    white: f64,
    /// Samples.
    count: f64,
}

/// A wave being followed.
#[derive(Copy, Clone, Debug)]
struct Lock {
    /// As of the last sample.
    wave: Wave,
    /// Usual mean square of what is left, both components,
    noise: f64,
    /// and the part of it that changes from sample to sample.
    white: f64,
    /// Samples in a period.
    rate: f64,
    /// Periods over which the noise was learnt.
    learnt: f64,
    /// The window ends here (time).
    since: f64,
    /// Centre believed in, once a whole period was seen.
    centre: Option<C>,
    /// How far the performer's figure departs from the one that was shown.
    bend: f64,
    /// Amplitude before the last cut.
    size: f64,
    /// The wave before the last cut, carried on to now.
    before: Wave,
    /// Share of the amplitude that is believed.
    share: f64,
    /// How long a bank has known better; beyond 1 it is believed.
    doubt: f64,
}

/// Locked wave fit with change detection.
#[derive(Clone, Debug)]
pub struct FastEstimator {
    history: History,
    slow: Bank,
    quick: Bank,
    shape: Shape,
    lambda: f64,
    lock: Option<Lock>,
    last_t: f64,
    /// How far the last point's motion is the gesture's own.
    trust: f64,
    /// How full the lock's window is, 0..1.
    full: f64,
    raw: WaveEstimate,
    output: Output,
}

impl FastEstimator {
    /// An estimator without history for a gesture of this shape. Allocates all it will ever need.
    pub fn new(options: &GestureOptions, shape: Shape) -> Self {
        let (low, high) = BANK_HZ;
        Self {
            history: History::new(),
            slow: Bank::new(LINES, low, high, options.lambda, shape),
            quick: Bank::new(LINES, low, high, QUICK_LAMBDA, shape),
            shape,
            lambda: options.lambda,
            lock: None,
            last_t: 0.0,
            trust: 1.0,
            full: 0.0,
            raw: WaveEstimate::default(),
            output: Output::default(),
        }
    }

    /// The estimate before smoothing.
    pub fn raw(&self) -> WaveEstimate {
        self.raw
    }

    fn task(&self, omega: f64, since_s: f64, variance: f64, prior: Prior) -> Task<'_> {
        Task {
            blocks: self.history.blocks(omega.abs() / TAU),
            shape: &self.shape,
            lambda: self.lambda,
            least_s: LEAST_SAMPLES * self.history.step_s(),
            since_s,
            variance,
            prior,
        }
    }

    /// Sum of squares of what `wave` leaves of the last `since_s` seconds, without the worst sample: one
    /// alone, which a tracker may have got wrong, is no change.
    fn misfit(&self, wave: &Wave, since_s: f64) -> f64 {
        let recent = self.history.samples().iter();
        let (mut sum, mut worst) = (0.0, 0.0_f64);
        for sample in recent.take_while(|sample| sample.lag_s <= since_s + 1e-9) {
            let z = C::new(sample.z[0], sample.z[1]);
            let left = (z - wave.at(&self.shape, sample.lag_s)).norm_sqr();
            sum += left;
            worst = worst.max(left);
        }
        sum - worst
    }

    /// What `wave` leaves of the newest third of a period.
    fn recent(&self, wave: &Wave, since_s: f64) -> Left {
        let reach = (RECENT * TAU / wave.omega.abs()).min(since_s);
        let mut left = Left::default();
        let mut newer: Option<C> = None;
        for sample in self.history.samples() {
            if sample.lag_s > reach && (left.count >= LEAST_RECENT || sample.lag_s > since_s) {
                break;
            }
            let z = C::new(sample.z[0], sample.z[1]);
            let rest = z - wave.at(&self.shape, sample.lag_s);
            left.square += rest.norm_sqr();
            if let Some(newer) = newer {
                left.white += 0.5 * (newer - rest).norm_sqr();
            }
            newer = Some(rest);
            left.count += 1.0;
        }
        left.square /= f64::max(left.count, 1.0);
        left.white /= f64::max(left.count - 1.0, 1.0);
        left
    }

    /// Share of a first amplitude that is believed after so many periods: a line must have been there and
    /// back, a loop shows itself earlier.
    fn seen(&self, periods: f64) -> f64 {
        let least = 0.6 - 0.25 * self.shape.roundness();
        ((periods - least) / 0.25).clamp(0.0, 1.0)
    }

    /// What is believed of a locked wave: centre and figure stay, of the frequency `omega`.
    fn prior(&self, lock: &Lock, omega: f64) -> Prior {
        let size = lock.size.max(0.05);
        Prior {
            a: 0.5 + 2.0 * size,
            b: 0.1 * size + 1.5 * lock.bend,
            c: lock.centre.map(|_| 0.06 * size),
            omega,
        }
    }

    fn variance(&self, lock: &Lock) -> f64 {
        // On a line nearly all noise lies in the one component that the pose tells.
        let lean = 1.0 - 0.5 * self.shape.roundness();
        // What is left and hangs together from sample to sample (harmonics, a hand's own way) tells
        // less than its samples are many.
        let white = lock.white.min(lock.noise);
        let tied = (lock.noise - 1.3 * white).max(0.0) * (lock.rate * TIED).max(1.0);
        lean * (white.max(lock.noise.min(1.3 * white)) + tied) + (FLOOR * lock.size).powi(2)
    }

    /// Fits the lock's wave to now; cuts the past off where it no longer fits.
    fn follow(&self, mut lock: Lock, t: f64) -> Option<(Lock, Fit)> {
        let dt = t - self.last_t;
        let prior = self.prior(&lock, FREE);
        let variance = self.variance(&lock);
        let mut start = lock.wave.ahead(dt);
        if let Some(centre) = lock.centre {
            start.c = centre;
        }
        let since_s = t - lock.since;
        let mut fit = self
            .task(start.omega, since_s, variance, prior)
            .step(&start, true)?;
        lock.before = lock.before.ahead(dt);
        let period = TAU / start.omega.abs();
        let short = since_s < SHORT * period;
        let left = self.recent(&fit.wave, since_s);
        let usual = lock.noise + (FLOOR * lock.size).powi(2);
        let surprised = left.square > (1.0 + SURPRISE / left.count.sqrt()) * usual;
        if !short && surprised && lock.learnt > LEARNT {
            // Is there a wave that explains the newest past much better than the old one does?
            let mut fresh = lock;
            fresh.before = start;
            fresh.size = start.a.norm();
            if let Some((gain, found, cut)) = self.cut(&fresh, &start, t, &WIDE)
                && gain > PROOF
            {
                return Some((found, cut));
            }
        } else if short {
            // Where exactly the change was shows only now; the frequency may still be far off.
            let here = self.search(&lock, &fit.wave, t, &NEAR);
            let gain = here.map(|here| self.gain(&lock, &here, t));
            if let Some((other, found, cut)) = self.cut(&lock, &fit.wave, t, &NEAR)
                && gain.is_none_or(|gain| other > gain)
            {
                return Some((found, cut));
            }
            fit = here?;
        }
        Some((lock, fit))
    }

    /// By how much `fit` explains the lock's window better than the wave before it, in variances.
    fn gain(&self, lock: &Lock, fit: &Fit, t: f64) -> f64 {
        self.misfit(&lock.before, t - lock.since) / self.variance(lock) - fit.cost
    }

    /// The likeliest place to cut the past off, of those in [`KEPT`] that are nearer than the present one:
    /// gain, lock and fit.
    fn cut(&self, lock: &Lock, start: &Wave, t: f64, factors: &[f64]) -> Option<(f64, Lock, Fit)> {
        let period = TAU / lock.before.omega.abs();
        let mut best: Option<(f64, Lock, Fit)> = None;
        for kept in KEPT {
            let kept_s = (kept * period).max(LEAST_KEPT * self.history.step_s());
            let shorter = Lock {
                since: t - kept_s,
                ..*lock
            };
            if shorter.since <= lock.since {
                continue;
            }
            let Some(fit) = self.search(&shorter, start, t, factors) else {
                continue;
            };
            let gain = self.gain(&shorter, &fit, t);
            if best.as_ref().is_none_or(|(most, ..)| gain > *most) {
                best = Some((gain, shorter, fit));
            }
        }
        best
    }

    /// The likeliest wave in the lock's window: at the tempo there was before the cut, or at another one,
    /// looked for at `factors` times the frequency of `start`.
    fn search(&self, lock: &Lock, start: &Wave, t: f64, factors: &[f64]) -> Option<Fit> {
        let kept = self.tuned(lock, lock.before.omega, KEPT_TEMPO, t);
        let others = (factors.iter())
            .filter_map(|factor| self.tuned(lock, start.omega * factor, FREE, t))
            .map(|mut fit| {
                fit.cost += NEW_TEMPO;
                fit
            });
        (kept.into_iter().chain(others)).min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// A wave of about `omega`, which it may leave by `deviation` of itself.
    fn tuned(&self, lock: &Lock, omega: f64, deviation: f64, t: f64) -> Option<Fit> {
        if !(omega.abs() >= RANGE_HZ.0 * TAU && omega.abs() <= RANGE_HZ.1 * TAU) {
            return None;
        }
        let prior = self.prior(lock, deviation);
        let task = self.task(omega, t - lock.since, self.variance(lock), prior);
        let centre = lock.centre.unwrap_or_default();
        let seed = Wave {
            omega,
            c: centre,
            ..Wave::default()
        };
        let first = task.step(&seed, false)?;
        let mut fit = task.step(
            &Wave {
                c: centre,
                ..first.wave
            },
            true,
        )?;
        let off = (fit.wave.omega / omega - 1.0) / deviation;
        fit.cost += off * off;
        Some(fit)
    }

    /// The bank's best proposal.
    fn candidate(&self) -> Option<Candidate> {
        let slow = self.slow.best(|c| c.periods > 0.4 && c.explained > 0.5);
        // Less than half a period of a line could be anything.
        let least = 0.2 + 0.3 * (1.0 - self.shape.roundness());
        let quick = self.quick.best(|c| c.periods > least && c.explained > 0.7);
        match (slow, quick) {
            (Some(slow), Some(quick)) if quick.power > 1.5 * slow.power => Some(quick),
            (Some(slow), _) => Some(slow),
            (None, quick) => quick,
        }
    }

    fn seed(&self, candidate: &Candidate, t: f64) -> Option<(Lock, Fit)> {
        let omega = TAU * candidate.frequency_hz;
        let prior = Prior {
            a: 1.0,
            b: 0.3,
            c: None,
            omega: 0.3,
        };
        let since_s = 1.0 / candidate.frequency_hz.abs();
        let fit = self
            .task(omega, since_s, 0.01, prior)
            .at_frequency(omega, C::default(), 2)?;
        let lock = Lock {
            wave: fit.wave,
            noise: fit.residual,
            white: fit.residual,
            rate: 1.0,
            learnt: 0.0,
            since: t - since_s.min(self.history.covered_s()),
            centre: None,
            bend: 0.0,
            size: fit.wave.a.norm(),
            before: fit.wave,
            share: 0.0,
            doubt: 0.0,
        };
        Some((lock, fit))
    }

    fn update(&mut self, t: f64, dt: f64) {
        let mut held = self.lock.take().and_then(|lock| self.follow(lock, t));
        if let Some(candidate) = self.candidate() {
            let doubt = held.as_mut().map(|(lock, fit)| {
                let power = fit.wave.a.norm_sqr() * self.shape.power();
                let pace = TAU * candidate.frequency_hz / fit.wave.omega;
                let alike = (0.8..1.25).contains(&pace)
                    && (0.6..1.7).contains(&(power / candidate.power.max(1e-12)));
                let poor = fit.explained() < 0.5;
                if alike && !poor {
                    lock.doubt = 0.0;
                } else {
                    let urgency = if poor { 1.0 / DOUBT[0] } else { 1.0 / DOUBT[1] };
                    lock.doubt += urgency * dt * candidate.frequency_hz.abs();
                }
                lock.doubt
            });
            if doubt.is_none_or(|doubt| doubt > 1.0)
                && let Some((mut lock, fit)) = self.seed(&candidate, t)
            {
                match &held {
                    None => held = Some((lock, fit)),
                    Some((old, held_fit)) if likelier(&fit, held_fit) => {
                        lock.share = old.share;
                        lock.noise = lock.noise.max(old.noise);
                        lock.white = lock.noise;
                        held = Some((lock, fit));
                    }
                    Some(_) => {}
                }
            }
        }
        self.raw = WaveEstimate::default();
        let Some((mut lock, fit)) = held else {
            return;
        };
        let hz = fit.wave.omega / TAU;
        if !(hz.abs() >= RANGE_HZ.0 && hz.abs() <= RANGE_HZ.1) {
            return;
        }
        lock.wave = fit.wave;
        let periods = dt * hz.abs();
        let since_s = t - lock.since;
        let explained = fit.explained();
        if since_s * hz.abs() > 0.8 {
            let pace = (periods / lock.learnt.clamp(0.3, 1.0)).min(1.0);
            let left = self.recent(&fit.wave, since_s);
            let most = if lock.learnt > LEARNT {
                3.0 * lock.noise + 1e-6
            } else {
                f64::INFINITY
            };
            lock.noise += pace * (left.square.min(most) - lock.noise);
            lock.white += pace * (left.white.min(most) - lock.white);
            lock.rate = 1.0 / (hz.abs() * self.history.step_s()).max(1e-3);
            lock.learnt += periods;
            let centre = lock.centre.get_or_insert(fit.wave.c);
            *centre += (fit.wave.c - *centre) * periods.min(1.0);
            lock.bend += (fit.wave.b.norm() - lock.bend) * periods.min(1.0);
            let size = fit.wave.a.norm();
            lock.size += (size - lock.size) * periods.min(1.0);
        } else if lock.learnt <= LEARNT {
            // The wave turned out slower than it was taken for: nothing is known of it yet.
            lock.learnt = 0.0;
            lock.centre = None;
            lock.size = fit.wave.a.norm();
        }
        self.full = (since_s * hz.abs() / (2.0 * self.lambda)).min(1.0);
        let short = since_s * hz.abs() < SHORT;
        // After a change few samples prove little; whether the wave goes on they tell all the same.
        let mut share = if short && lock.learnt > LEARNT {
            self.trust * gate(explained, f64::INFINITY)
        } else {
            self.trust * gate(explained, fit.evidence()) * sure(&fit)
        };
        if lock.centre.is_none() {
            share *= self.seen(since_s.min(self.history.covered_s()) * hz.abs());
        }
        let falling = share < lock.share && short;
        let pace = periods / if falling { 0.5 } else { 0.1 };
        lock.share += pace.min(1.0) * (share - lock.share);
        self.raw = WaveEstimate {
            amplitude: lock.share * fit.wave.a.norm(),
            frequency_hz: hz,
            phase_rad: wrap_tau(fit.wave.a.arg()),
            quality: explained,
        };
        self.lock = Some(lock);
    }
}

/// Whether a proposal takes over from the wave that is held: it explains more, or it explains as much by
/// the gesture's own figure instead of the orthogonal one (performed the other way round).
fn likelier(proposed: &Fit, held: &Fit) -> bool {
    let own = |fit: &Fit| fit.wave.a.norm_sqr();
    proposed.evidence() > held.evidence() + 2.0
        || (own(proposed) > 2.0 * own(held) && proposed.explained() > held.explained() - 0.05)
}

/// Share of an amplitude that is believed by how well it is known: all up to a deviation of a quarter,
/// nothing from a half.
fn sure(fit: &Fit) -> f64 {
    let relative = fit.deviation / fit.wave.a.norm().max(1e-9);
    ((0.5 - relative) / 0.25).clamp(0.0, 1.0)
}

/// The newest part of the past that is watched for changes, periods.
const RECENT: f64 = 0.3;
/// Fewest samples of it.
const LEAST_RECENT: f64 = 6.0;
/// What may be kept of the past when the wave has changed, periods.
const KEPT: [f64; 3] = [0.06, 0.12, 0.3];
/// Deviation of a tempo that was kept, as a share of it.
const KEPT_TEMPO: f64 = 0.06;
/// Deviation of any other, about where it is looked for.
const FREE: f64 = 0.3;
/// What another tempo must gain, in variances.
const NEW_TEMPO: f64 = 9.0;
/// Where another tempo is looked for when the wave has changed, times the last one,
const WIDE: [f64; 8] = [1.0, 1.3, 1.7, 2.2, 2.8, 0.75, 0.55, 0.4];
/// and while the window is short.
const NEAR: [f64; 3] = [1.0, 1.3, 0.75];
/// Fewest steps that are kept.
const LEAST_KEPT: f64 = 2.5;
/// A window shorter than this, in periods, is searched again with every sample.
const SHORT: f64 = 0.4;
/// Periods of noise learnt before changes are looked for.
const LEARNT: f64 = 1.0;
/// Periods for which a bank must know better before it is believed: against a wave that hardly explains
/// the past, and against one that does.
const DOUBT: [f64; 2] = [0.5, 1.2];
/// Standard deviations of surprise at which a change is looked for.
const SURPRISE: f64 = 1.5;
/// By how much a new wave must fit better than the old one, in variances, to be a change.
const PROOF: f64 = 36.0;
/// How long what is left hangs together, periods.
const TIED: f64 = 0.125;
/// Departures from the wave that are never a surprise, as a share of the amplitude.
const FLOOR: f64 = 0.02;

impl Estimator for FastEstimator {
    fn push(&mut self, t: f64, point: PlanePoint) {
        if self.history.push(t, point, LONGEST_GAP_S) {
            self.slow.clear();
            self.quick.clear();
            self.lock = None;
            self.output.reset();
            self.last_t = t;
        }
        let dt = t - self.last_t;
        self.trust = point.trust;
        let z = C::new(point.z[0], point.z[1]);
        self.slow.push(t, z);
        self.quick.push(t, z);
        self.update(t, dt);
        self.output.push(dt, self.raw, self.full);
        self.last_t = t;
    }

    fn estimate(&self) -> WaveEstimate {
        self.output.estimate()
    }

    fn reset(&mut self) {
        self.history.clear();
        self.slow.clear();
        self.quick.clear();
        self.lock = None;
        self.raw = WaveEstimate::default();
        self.output.reset();
        self.last_t = 0.0;
    }
}
