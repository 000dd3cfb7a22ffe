//! Scripts: what a synthetic performer does over time, played through the front end.

use super::performer::{Doing, Performer};
use crate::base::random::SplitMix;
use crate::gesture::{EstimatorKind, FrontEnd, FrontEndError, FrontEndOptions};
use std::f64::consts::TAU;

/// A value over time: linear between knots (time, value), held before the first and after the last.
///
/// Two knots at one time are a step; from that time on the later one counts.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve(pub Vec<(f64, f64)>);

impl Curve {
    /// The same at all times.
    pub fn constant(value: f64) -> Self {
        Self(vec![(0.0, value)])
    }

    /// One value before time 0 and another from 0 on.
    pub fn step(before: f64, after: f64) -> Self {
        Self(vec![(0.0, before), (0.0, after)])
    }

    /// The value at `t`; zero for a curve without knots.
    pub fn at(&self, t: f64) -> f64 {
        let next = self.0.partition_point(|(time, _)| *time <= t);
        match (
            next.checked_sub(1).map(|k| self.0[k]),
            self.0.get(next).copied(),
        ) {
            (None, None) => 0.0,
            (Some((_, value)), None) | (None, Some((_, value))) => value,
            (Some((t0, v0)), Some((t1, v1))) => v0 + (v1 - v0) * (t - t0) / (t1 - t0),
        }
    }
}

/// What one gesture of the performer does.
#[derive(Clone, Debug, PartialEq)]
pub struct Role {
    /// Size, 1 = as shown.
    pub amplitude: Curve,
    /// Frequency in Hz, negative in the opposite sense.
    pub frequency_hz: Curve,
}

impl Role {
    /// Not performed.
    pub fn silent() -> Self {
        Self::steady(0.0, 1.0)
    }

    /// The same size and frequency all the time.
    pub fn steady(amplitude: f64, frequency_hz: f64) -> Self {
        Self {
            amplitude: Curve::constant(amplitude),
            frequency_hz: Curve::constant(frequency_hz),
        }
    }
}

/// A performance to play.
#[derive(Clone, Debug, PartialEq)]
pub struct Script {
    /// One role per gesture of the performer.
    pub roles: Vec<Role>,
    /// Displacement of the first gesture's movement that is held, 1 = as far as it goes.
    pub offset: Curve,
    /// Second harmonic of the first gesture as a share of its amplitude.
    pub harmonic: f64,
    /// First and last time in seconds; the event is at 0.
    pub span_s: (f64, f64),
    /// Samples a second.
    pub rate_hz: f64,
    /// Share of the samples that are lost, at random.
    pub lost: f64,
    /// From when to when no sample arrives at all, in seconds.
    pub hole_s: Option<(f64, f64)>,
    /// Noise on each component of the first gesture's plane, standard deviation.
    pub noise: f64,
}

impl Script {
    /// One gesture at 60 Hz, nothing lost, no noise.
    pub fn of(role: Role, span_s: (f64, f64)) -> Self {
        Self {
            roles: vec![role],
            offset: Curve::constant(0.0),
            harmonic: 0.0,
            span_s,
            rate_hz: 60.0,
            lost: 0.0,
            hole_s: None,
            noise: 0.0,
        }
    }
}

/// Amplitude, frequency and phase over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Waves {
    /// Amplitude, 1 = as shown.
    pub amplitude: Vec<f64>,
    /// Hz.
    pub frequency_hz: Vec<f64>,
    /// Radians.
    pub phase_rad: Vec<f64>,
}

impl Waves {
    fn push(&mut self, amplitude: f64, frequency_hz: f64, phase_rad: f64) {
        self.amplitude.push(amplitude);
        self.frequency_hz.push(frequency_hz);
        self.phase_rad.push(phase_rad);
    }
}

/// What was performed and what was read, sample by sample.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// Times in seconds.
    pub t: Vec<f64>,
    /// Per gesture what the performer did.
    pub truth: Vec<Waves>,
    /// Per gesture what the front end said, smoothing included.
    pub estimate: Vec<Waves>,
}

impl Trace {
    /// Range of the samples from `from_s` to `to_s`.
    pub fn range(&self, from_s: f64, to_s: f64) -> std::ops::Range<usize> {
        let start = self.t.partition_point(|t| *t < from_s);
        start..self.t.partition_point(|t| *t <= to_s).max(start)
    }
}

/// A front end that plays scripts of one performer with one estimator.
#[derive(Debug)]
pub struct Player<'a> {
    performer: &'a Performer,
    front: FrontEnd,
}

impl<'a> Player<'a> {
    /// For `performer`'s gestures, read by `estimator` with window `lambda` (the default when `None`).
    ///
    /// # Errors
    /// A window out of range.
    pub fn new(
        performer: &'a Performer,
        estimator: EstimatorKind,
        lambda: Option<f64>,
    ) -> Result<Self, FrontEndError> {
        let options = FrontEndOptions {
            estimator,
            lambda,
            // Its filter of jumps would take part of the noise away, which is to reach the plane
            // exactly as asked.
            trust_tracker: true,
            ..FrontEndOptions::default()
        };
        Ok(Self {
            performer,
            front: FrontEnd::new(&performer.set, &performer.header, options)?,
        })
    }

    /// Plays `script` from its start with a fresh front end. The same seed gives the same samples,
    /// whatever the estimator; start phases, noise and losses come from it.
    pub fn play(&mut self, script: &Script, seed: u64) -> Trace {
        self.front.reset();
        let gestures = self.performer.set.gestures.len();
        let mut trace = Trace {
            truth: vec![Waves::default(); gestures],
            estimate: vec![Waves::default(); gestures],
            ..Trace::default()
        };
        rehearse(self.performer, script, seed, |moment| {
            if self.front.push(moment.sample).is_err() {
                return;
            }
            trace.t.push(moment.sample.t);
            for (index, doing) in moment.doing.iter().enumerate() {
                trace.truth[index].push(
                    doing.amplitude,
                    moment.frequencies_hz[index],
                    self.performer.plane_phase(index, doing.phase_rad),
                );
                let estimate = self.front.estimates()[index];
                trace.estimate[index].push(
                    estimate.amplitude,
                    estimate.frequency_hz,
                    estimate.phase_rad,
                );
            }
        });
        trace
    }
}

/// One sample of a script as the tracker delivers it, with what the performer meant.
#[derive(Copy, Clone, Debug)]
pub struct Moment<'a> {
    /// The noisy pose.
    pub sample: &'a crate::pose::PoseSample,
    /// Per gesture what the performer is doing.
    pub doing: &'a [Doing],
    /// Per gesture the frequency in Hz.
    pub frequencies_hz: &'a [f64],
}

/// Calls `each` with every sample of `script` that is not lost.
pub fn rehearse(
    performer: &Performer,
    script: &Script,
    seed: u64,
    mut each: impl FnMut(Moment<'_>),
) {
    let mut random = SplitMix::new(seed);
    let mut sample = performer.sample();
    let mut doing: Vec<Doing> = script
        .roles
        .iter()
        .map(|_| Doing {
            phase_rad: TAU * random.unit(),
            ..Doing::default()
        })
        .collect();
    doing.resize(performer.set.gestures.len(), Doing::default());
    let mut frequencies = vec![0.0; doing.len()];
    let (from, to) = script.span_s;
    let steps = ((to - from) * script.rate_hz).floor() as usize;
    for k in 0..=steps {
        let t = from + k as f64 / script.rate_hz;
        for ((role, doing), frequency) in script.roles.iter().zip(&mut doing).zip(&mut frequencies)
        {
            // The frequency of the middle of the step that leads here.
            if k > 0 {
                let middle = t - 0.5 / script.rate_hz;
                doing.phase_rad += TAU * role.frequency_hz.at(middle) / script.rate_hz;
            }
            doing.amplitude = role.amplitude.at(t);
            *frequency = role.frequency_hz.at(t);
        }
        if let Some(first) = doing.first_mut() {
            first.harmonic = script.harmonic;
            first.offset = script.offset.at(t);
        }
        performer.pose(t, &doing, &mut sample);
        performer.add_noise(0, script.noise, &mut random, &mut sample);
        // Drawn for every sample, so that the noise does not depend on what is lost.
        let dropped = random.unit() < script.lost
            || (script.hole_s).is_some_and(|(start, end)| t >= start && t < end);
        if !dropped {
            each(Moment {
                sample: &sample,
                doing: &doing,
                frequencies_hz: &frequencies,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_steps_and_ramps_and_holds_its_ends() {
        let step = Curve::step(1.0, 2.0);
        assert_eq!(
            [step.at(-1e-9), step.at(0.0), step.at(9.0)],
            [1.0, 2.0, 2.0]
        );
        let ramp = Curve(vec![(0.0, 0.5), (4.0, 2.5)]);
        assert_eq!([ramp.at(-1.0), ramp.at(1.0), ramp.at(8.0)], [0.5, 1.0, 2.5]);
        assert_eq!(Curve(Vec::new()).at(1.0), 0.0);
    }

    #[test]
    fn the_same_seed_gives_the_same_samples_and_another_seed_others() {
        let performer = Performer::arm_loop().expect("defined");
        let mut script = Script::of(Role::steady(1.0, 1.0), (0.0, 1.0));
        script.noise = 0.1;
        script.lost = 0.1;
        let bytes = |seed| {
            let mut bits = Vec::new();
            rehearse(&performer, &script, seed, |moment| {
                for place in moment.sample.points.iter().flatten().flatten() {
                    bits.push(place.to_bits());
                }
            });
            bits
        };
        assert_eq!(bytes(5), bytes(5));
        assert_ne!(bytes(5), bytes(6));
    }

    #[test]
    fn a_hole_and_losses_are_missing_from_the_trace() {
        let performer = Performer::arm_loop().expect("defined");
        let mut player =
            Player::new(&performer, EstimatorKind::default(), None).expect("fits itself");
        let mut script = Script::of(Role::steady(1.0, 1.0), (-1.0, 1.0));
        assert_eq!(player.play(&script, 1).t.len(), 121);
        script.hole_s = Some((0.0, 0.3));
        let trace = player.play(&script, 1);
        assert_eq!(trace.t.len(), 121 - 18, "18 samples in 300 ms");
        assert_eq!(trace.range(-0.5, 0.5).len(), 30 + 13);
    }
}
