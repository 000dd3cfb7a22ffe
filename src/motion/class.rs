//! Motion classes: a space of example clips, played by a gesture's amplitude, frequency and phase.
//!
//! Rhodin 2016, section 9.5.2. A cyclic class blends its clips at a common phase that is locked to
//! the gesture's; every limb keeps its own timeline (eq. 9.7). A path class is driven by progression.

use super::clip::{Clip, ClipKind, RootAdvance};
use super::limbs::timelines;
use super::range::{JointRange, Steepness};
use super::smooth::Follower;
use super::weights::{Parameters, Weights, WeightsError};
use crate::base::angle::{wrap_pi, wrap_tau};
use crate::body::PoseSpace;
use std::f64::consts::TAU;

/// What drives a class at one instant.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Drive {
    /// Amplitude of the gesture (1 = as large as shown), or progression of a non-cyclic one.
    pub amplitude: f64,
    /// Frequency, Hz; negative when performed in the opposite sense.
    pub frequency_hz: f64,
    /// Phase at this instant, rad.
    pub phase_rad: f64,
}

/// An example clip with its parameters.
#[derive(Clone, Debug)]
pub struct Example {
    /// The clip.
    pub clip: Clip,
    /// Amplitude and frequency at which it is played pure.
    pub parameters: Parameters,
}

/// Why a class cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum ClassError {
    /// Cycles and paths in one class.
    #[error(
        "class {class}: clip {clip} is a {found}, the others are not; a class has clips of one kind"
    )]
    MixedKinds {
        /// Class name.
        class: String,
        /// The odd clip.
        clip: String,
        /// Its kind.
        found: &'static str,
    },
    /// Parameters that span no space.
    #[error("class {class}: {source}")]
    Weights {
        /// Class name.
        class: String,
        /// What is wrong with the parameters.
        source: WeightsError,
    },
    /// Limbs differ between clips.
    #[error(
        "class {class}: clip {clip} has no segment {segment}, other clips have; author all clips of a class for the same legs"
    )]
    Limbs {
        /// Class name.
        class: String,
        /// The odd clip.
        clip: String,
        /// The missing limb.
        segment: String,
    },
}

/// Below this amplitude the pose is the rest pose whatever the phase.
const AT_REST: f64 = 1e-6;
/// Movements smaller than this part of the gesture are taken for rest: tremor does not move the puppet.
const REST_AMPLITUDE: f64 = 0.04;
/// From here on amplitude counts in full.
const FULL_FROM_AMPLITUDE: f64 = 0.15;
/// Share of the joints' speed and acceleration that a steady cycle may use; the rest is for changes
/// of weights, timelines and phase.
const RANGE_SHARE: f64 = 0.65;
/// The stride is shortened to this part before phase lock is given up.
const LEAST_STRIDE: f64 = 0.4;
/// The phase may gain or lose this part of the tempo to meet the gesture's: out of phase by half a
/// turn at the onset, it locks within two periods.
const CATCH_UP: f64 = 0.4;
/// Share of the joints' speed and acceleration that catching up may use.
const CATCH_UP_SHARE: f64 = 0.8;
/// Limbs may gain or lose this part of the phase advance against the body (thesis: 0.95..1.05).
const LIMB_ADVANCE: f64 = 0.05;

/// A class and its state while it is played.
#[derive(Clone, Debug)]
pub struct MotionClass {
    /// Class name.
    pub name: String,
    examples: Vec<Example>,
    kind: ClipKind,
    /// Weights of the moving examples; `moving[i]` is the example of weight i.
    weights_map: Weights,
    moving: Vec<usize>,
    /// The example at amplitude 0, and the least amplitude of a moving one.
    rest: Option<usize>,
    least_amplitude: f64,
    steepness: Steepness,
    ranges: Vec<JointRange>,
    /// Joints x 1: limb of each joint.
    limb_of: Vec<Option<usize>>,
    /// Examples x limbs: offset of the limb's timeline against the reference clip, rad; `None` for a
    /// clip without moving limbs.
    offsets: Vec<Option<Vec<f64>>>,
    lock_rate: f64,
    state: State,
    // Work space, so that a step allocates nothing.
    sampled: Vec<f64>,
    moving_weights: Vec<f64>,
    weights: Vec<f64>,
}

#[derive(Clone, Debug)]
struct State {
    amplitude: Follower,
    frequency: Follower,
    phase: f64,
    /// Phase speed, rad/s.
    rate: f64,
    /// Limb timelines against the common phase, rad.
    limb_shift: Vec<f64>,
    locked: bool,
    stride: f64,
}

/// What a class did in one step, for the view and for tests.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Played {
    /// Phase of the class, rad; progression of a path.
    pub phase_rad: f64,
    /// Frequency being played, Hz.
    pub frequency_hz: f64,
    /// Amplitude after smoothing.
    pub amplitude: f64,
    /// Part of the stride that the joints allow at this frequency, 0.4..1.
    pub stride: f64,
    /// False when the gesture is faster than the joints can follow: the phase runs free.
    pub locked: bool,
    /// Travel of the body per second, in its own frame.
    pub root_velocity: RootAdvance,
    /// Of a pose map, 0..1: how much a pair at the present pose would teach it; 0 for clips.
    pub uncertainty: f64,
}

impl MotionClass {
    /// Builds a class from examples for joints with the given ranges.
    pub fn new(
        name: &str,
        examples: Vec<Example>,
        ranges: Vec<JointRange>,
    ) -> Result<Self, ClassError> {
        let rest = examples.iter().position(|e| e.parameters[0] == 0.0);
        let mut moving: Vec<usize> = (0..examples.len())
            .filter(|i| examples[*i].parameters[0] > 0.0)
            .collect();
        if moving.is_empty() {
            moving.extend(0..examples.len());
        }
        let parameters: Vec<Parameters> = moving.iter().map(|i| examples[*i].parameters).collect();
        let weights_map = Weights::new(&parameters).map_err(|source| ClassError::Weights {
            class: name.into(),
            source,
        })?;
        let least_amplitude = parameters
            .iter()
            .map(|p| p[0])
            .fold(f64::INFINITY, f64::min);
        let kind = examples[0].clip.kind;
        if let Some(odd) = examples.iter().find(|e| e.clip.kind != kind) {
            return Err(ClassError::MixedKinds {
                class: name.into(),
                clip: odd.clip.name.clone(),
                found: match odd.clip.kind {
                    ClipKind::Cycle => "cycle",
                    ClipKind::Path => "path",
                },
            });
        }
        let joints = examples[0].clip.joints();
        let clips: Vec<&Clip> = examples.iter().map(|e| &e.clip).collect();
        let steepness = Steepness::of(&clips);
        let (limb_of, offsets) = timelines(name, &clips, joints)?;
        let limbs = offsets.iter().flatten().map(Vec::len).max().unwrap_or(0);
        let count = examples.len();
        let frequency = weights_map.frequencies().0;
        Ok(Self {
            name: name.into(),
            examples,
            kind,
            moving_weights: vec![0.0; moving.len()],
            weights_map,
            moving,
            rest,
            least_amplitude,
            steepness,
            ranges,
            limb_of,
            offsets,
            lock_rate: 4.0,
            state: State {
                amplitude: Follower::at(0.0),
                frequency: Follower::at(frequency),
                phase: 0.0,
                rate: 0.0,
                limb_shift: vec![0.0; limbs],
                locked: true,
                stride: 1.0,
            },
            sampled: vec![0.0; count * joints],
            weights: vec![0.0; count],
        })
    }

    /// Whether the class repeats.
    pub fn kind(&self) -> ClipKind {
        self.kind
    }

    /// Blend weight of every example in the last step.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Pose at rest: amplitude or progression zero, into `out`.
    pub fn rest_pose(&mut self, space: &dyn PoseSpace, out: &mut [f64]) {
        let (lowest, _) = self.weights_map.frequencies();
        match self.kind {
            ClipKind::Cycle => self.weigh([0.0, lowest].into(), 1.0),
            ClipKind::Path => self.weigh([1.0, 0.0].into(), 1.0),
        }
        self.sample(space, 0.0, out);
    }

    /// Sets the weights for a wish, with the motion scaled to `stride` of its size.
    ///
    /// Between rest and the smallest moving example the motion grows in proportion to amplitude, so
    /// that amplitude 0 is the rest pose at every frequency and phase.
    fn weigh(&mut self, wish: Parameters, stride: f64) {
        self.weights_map.at(wish, &mut self.moving_weights);
        self.weights.fill(0.0);
        let share = match self.rest {
            Some(_) if self.least_amplitude > 0.0 => {
                stride * (wish[0] / self.least_amplitude).clamp(0.0, 1.0)
            }
            _ => 1.0,
        };
        for (example, weight) in self.moving.iter().zip(&self.moving_weights) {
            self.weights[*example] = share * weight;
        }
        if let Some(rest) = self.rest {
            self.weights[rest] += 1.0 - share;
        }
    }

    /// One step of `dt_s` under `drive`; the pose goes into `out`. Allocates nothing.
    pub fn step(
        &mut self,
        space: &dyn PoseSpace,
        drive: Drive,
        dt_s: f64,
        out: &mut [f64],
    ) -> Played {
        match self.kind {
            ClipKind::Cycle => self.step_cycle(space, drive, dt_s, out),
            ClipKind::Path => self.step_path(space, drive, dt_s, out),
        }
    }

    fn step_cycle(
        &mut self,
        space: &dyn PoseSpace,
        drive: Drive,
        dt_s: f64,
        out: &mut [f64],
    ) -> Played {
        let (lowest_hz, highest_hz) = self.weights_map.frequencies();
        // A gesture in the opposite sense is another gesture, not this one played backwards.
        let performed = drive.frequency_hz > 0.0 && drive.amplitude.is_finite();
        let wanted = if performed {
            awake(drive.amplitude)
        } else {
            0.0
        };
        let state = &mut self.state;
        let amplitude = state
            .amplitude
            .step(wanted.min(1.0), 9.0, 1.7, dt_s)
            .max(0.0);
        let mut coming_hz: f64 = 0.0;
        if performed && drive.frequency_hz.is_finite() && wanted > 0.0 {
            let goal = drive.frequency_hz.clamp(0.2 * lowest_hz, 3.0 * highest_hz);
            if amplitude < AT_REST {
                // Nothing moves yet: begin at the tempo that is shown.
                state.frequency = Follower::at(goal);
            }
            state.frequency.step(goal, 10.0, 4.0, dt_s);
            coming_hz = goal;
        }
        let frequency_hz = state.frequency.value;
        let wish = [amplitude, frequency_hz].into();

        // Range: shorten the stride first, then hold the highest frequency and give up the lock.
        self.weigh(wish, 1.0);
        let rate = TAU * frequency_hz;
        let allowed = self.steepness.scale_limit(
            &self.weights,
            // Where the tempo is going counts too: the stride is short before the legs are fast.
            rate.max(self.state.rate).max(TAU * coming_hz),
            &self.ranges,
            RANGE_SHARE,
        );
        let state = &mut self.state;
        let stride_goal = allowed.clamp(LEAST_STRIDE, 1.0);
        // Shorten at once, lengthen at leisure: the limit is the joints', the comfort ours.
        let follow = if stride_goal < state.stride {
            0.05
        } else {
            0.3
        };
        state.stride += (stride_goal - state.stride) * (dt_s / follow).min(1.0);
        let highest_rate = if allowed < LEAST_STRIDE {
            self.steepness
                .rate_limit(&self.weights, LEAST_STRIDE, &self.ranges, RANGE_SHARE)
        } else {
            f64::INFINITY
        };
        state.locked = rate <= highest_rate;

        let goal_rate = if state.locked {
            // Second-order lock: feed-forward of the gesture's frequency, correction of the phase.
            let lag = wrap_pi(drive.phase_rad - (state.phase + rate * dt_s));
            let bound = CATCH_UP * rate;
            let correction = if wanted > 0.0 && lag.is_finite() {
                (self.lock_rate * lag).clamp(-bound, bound)
            } else {
                0.0
            };
            // Catching up may use more of the joints than a steady cycle, but not all of them.
            let most = self.steepness.rate_limit(
                &self.weights,
                state.stride,
                &self.ranges,
                CATCH_UP_SHARE,
            );
            rate + correction.min((most - rate).max(0.0))
        } else {
            highest_rate
        };
        let follow = 1.0 - (-dt_s / 0.06).exp();
        state.rate += (goal_rate - state.rate) * follow;
        let at_rest = amplitude < AT_REST;
        if at_rest {
            // Standing still: nobody sees the phase, so it may be right when the first step comes.
            state.rate = goal_rate;
            state.phase = drive.phase_rad;
            if !state.phase.is_finite() {
                state.phase = 0.0;
            }
        }
        let advance = state.rate * dt_s;
        state.phase = wrap_tau(state.phase + advance);
        self.weigh(wish, self.state.stride);
        self.shift_limbs(advance, at_rest);

        let phase = self.state.phase;
        self.sample(space, phase, out);
        let mut velocity = RootAdvance::default();
        let per_second = self.state.rate / TAU;
        for (example, weight) in self.examples.iter().zip(&self.weights) {
            velocity.forward_m += weight * example.clip.root.forward_m * per_second;
            velocity.left_m += weight * example.clip.root.left_m * per_second;
            velocity.yaw_rad += weight * example.clip.root.yaw_rad * per_second;
        }
        Played {
            phase_rad: phase,
            frequency_hz: self.state.rate / TAU,
            amplitude,
            stride: self.state.stride,
            locked: self.state.locked,
            root_velocity: velocity,
            uncertainty: 0.0,
        }
    }

    fn step_path(
        &mut self,
        space: &dyn PoseSpace,
        drive: Drive,
        dt_s: f64,
        out: &mut [f64],
    ) -> Played {
        let wanted = if drive.amplitude.is_finite() {
            awake(drive.amplitude).min(1.0)
        } else {
            0.0
        };
        self.weigh([1.0, 0.0].into(), 1.0);
        // Steepness is kept per radian of phase; one progression is one turn of it.
        let fastest = self
            .steepness
            .rate_limit(&self.weights, 1.0, &self.ranges, RANGE_SHARE)
            / TAU;
        let progression = self
            .state
            .amplitude
            .step(wanted, 9.0_f64.min(2.0 * fastest), fastest.min(1e3), dt_s)
            .clamp(0.0, 1.0);
        self.sample(space, progression * TAU, out);
        Played {
            phase_rad: progression * TAU,
            frequency_hz: 0.0,
            amplitude: progression,
            stride: 1.0,
            locked: true,
            root_velocity: RootAdvance::default(),
            uncertainty: 0.0,
        }
    }

    /// Moves limb timelines towards the blend of the clips' offsets, at most 5 % of the advance.
    fn shift_limbs(&mut self, advance: f64, at_rest: bool) {
        let bound = LIMB_ADVANCE * advance.abs();
        for limb in 0..self.state.limb_shift.len() {
            let mut moving = 0.0;
            // The mean of angles is that of their unit vectors (eq. 9.7 is circular).
            let (mut sin, mut cos) = (0.0, 0.0);
            for (offsets, weight) in self.offsets.iter().zip(&self.weights) {
                if let Some(offsets) = offsets {
                    moving += weight;
                    sin += weight * offsets[limb].sin();
                    cos += weight * offsets[limb].cos();
                }
            }
            // Opposite offsets cancel out: then the limb stays with the timeline it has.
            if moving > 1e-9 && sin.hypot(cos) > 0.05 * moving {
                let shift = &mut self.state.limb_shift[limb];
                let gap = wrap_pi(sin.atan2(cos) - *shift);
                *shift += if at_rest {
                    gap
                } else {
                    gap.clamp(-bound, bound)
                };
            }
        }
    }

    /// Samples every example at its limbs' phases and blends them.
    fn sample(&mut self, space: &dyn PoseSpace, phase: f64, out: &mut [f64]) {
        let joints = out.len();
        for (e, example) in self.examples.iter().enumerate() {
            if self.weights[e] == 0.0 {
                continue;
            }
            for joint in 0..joints {
                let shift = match (self.limb_of[joint], &self.offsets[e]) {
                    (Some(limb), Some(offsets)) => self.state.limb_shift[limb] - offsets[limb],
                    _ => 0.0,
                };
                let u = match self.kind {
                    ClipKind::Cycle => (phase + shift) / TAU,
                    ClipKind::Path => phase / TAU,
                };
                self.sampled[e * joints + joint] = example.clip.sample(u, joint);
            }
        }
        space.blend(&self.sampled, &self.weights, out);
    }
}

/// Amplitude with tremor taken out: zero below 0.04, unchanged from 0.15 on.
fn awake(amplitude: f64) -> f64 {
    let u = (amplitude - REST_AMPLITUDE) / (FULL_FROM_AMPLITUDE - REST_AMPLITUDE);
    amplitude.max(0.0) * super::smooth::ease(u)
}
