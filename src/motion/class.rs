//! Motion classes: a space of example clips, played by a gesture's amplitude, frequency and phase.
//!
//! Rhodin 2016, section 9.5.2. A cyclic class blends its clips at a common phase that is locked to
//! the gesture's; every limb keeps its own timeline (eq. 9.7). A path class is driven by progression,
//! or plays by the clock once it is asked for.

mod blending;
mod build;
mod cycle;
mod path;

use super::clip::{Clip, ClipKind, Limb, RootAdvance};
use super::edge::RoutePoint;
use super::range::{JointRange, Steepness};
use super::smooth::Follower;
use super::weights::{Parameters, Weights};
use crate::body::PoseSpace;
use crate::body::blend::Blending;
pub use blending::{BlendSpec, MOST_HYBRID_CLIPS};
pub(super) use build::runs;
pub use build::{ClassError, ClassOptions};
use std::f64::consts::TAU;
use std::ops::Range;

/// Most parameters of a class beside amplitude and frequency.
pub const EXTRA: usize = 2;

/// What drives a class at one instant.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Drive {
    /// Amplitude of the gesture (1 = as large as shown), or progression of a non-cyclic one.
    pub amplitude: f64,
    /// Frequency, Hz; negative when performed in the opposite sense.
    pub frequency_hz: f64,
    /// Phase at this instant, rad.
    pub phase_rad: f64,
    /// The class's further parameters (turn rate, emotion); not finite: as at rest.
    pub extra: [f64; EXTRA],
}

/// What moves a class along.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub enum Play {
    /// The gesture: its phase, or its progression.
    #[default]
    Gesture,
    /// The clock, from the start of a path to its end, whenever the gesture is performed anew.
    Once,
    /// The clock, round and round.
    Loop,
}

/// An example clip with its parameters.
#[derive(Clone, Debug)]
pub struct Example {
    /// The clip.
    pub clip: Clip,
    /// Amplitude, frequency and further parameters at which it is played pure.
    pub parameters: Parameters,
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

/// How fast further parameters follow, 1/s, and at most how fast they change, 1/s.
const EXTRA_RATE: f64 = 6.0;
const EXTRA_SPEED: f64 = 2.0;

/// A class and its state while it is played.
#[derive(Clone, Debug)]
pub struct MotionClass {
    /// Class name.
    pub name: String,
    examples: Vec<Example>,
    kind: ClipKind,
    options: ClassOptions,
    /// Weights of the moving examples; `moving[i]` is the example of weight i.
    weights_map: Weights,
    moving: Vec<usize>,
    /// The example at amplitude 0, and the least amplitude of a moving one.
    rest: Option<usize>,
    least_amplitude: f64,
    steepness: Steepness,
    ranges: Vec<JointRange>,
    /// Coordinates of a pose in runs that belong to one limb (or to none).
    runs: Vec<(Range<usize>, Option<usize>)>,
    /// Names of the limbs.
    limbs: Vec<String>,
    /// Examples x limbs: offset of the limb's timeline against the reference clip, rad; `None` for a
    /// clip without moving limbs.
    offsets: Vec<Option<Vec<f64>>>,
    /// Examples x limbs: the limb in the clip; `None` where the clip does not move on it, but stands.
    contacts: Vec<Option<Limb>>,
    state: State,
    /// The way to the exit of a transition that was chosen, while it is followed.
    route: Route,
    /// How the clips' poses become one.
    blending: Blending,
    /// The class is active or being entered.
    shown: bool,
    // Work space, so that a step allocates nothing.
    sampled: Vec<f64>,
    moving_weights: Vec<f64>,
    weights: Vec<f64>,
}

/// A way through amplitude and frequency to the point where the class is left.
#[derive(Clone, Debug, Default)]
struct Route {
    points: Vec<RoutePoint>,
    at_s: f64,
}

impl Route {
    /// Most points of a way.
    const MOST: usize = 64;

    /// Amplitude and frequency `dt_s` further on; `None` when no way is followed.
    fn step(&mut self, dt_s: f64) -> Option<(f64, f64)> {
        let last = *self.points.last()?;
        self.at_s += dt_s;
        let after = self.points.iter().position(|p| p.0 > self.at_s);
        let (a, b) = match after {
            Some(0) => (self.points[0], self.points[0]),
            Some(k) => (self.points[k - 1], self.points[k]),
            None => (last, last),
        };
        let share = if b.0 > a.0 {
            (self.at_s - a.0) / (b.0 - a.0)
        } else {
            0.0
        };
        Some((a.1 + share * (b.1 - a.1), a.2 + share * (b.2 - a.2)))
    }
}

#[derive(Clone, Debug)]
struct State {
    amplitude: Follower,
    frequency: Follower,
    extra: [Follower; EXTRA],
    phase: f64,
    /// Phase speed, rad/s.
    rate: f64,
    /// Limb timelines against the common phase, rad.
    limb_shift: Vec<f64>,
    locked: bool,
    stride: f64,
    /// Of a class that plays once: where it is, whether it is at its end, and whether its gesture was released
    /// since it began.
    progress: f64,
    ended: bool,
    fresh: bool,
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
    /// Whether the class repeats.
    pub fn kind(&self) -> ClipKind {
        self.kind
    }

    /// What moves it along.
    pub fn play(&self) -> Play {
        self.options.play
    }

    /// The example clips with their parameters.
    pub fn examples(&self) -> &[Example] {
        &self.examples
    }

    /// Names of the limbs that have timelines of their own.
    pub fn limbs(&self) -> &[String] {
        &self.limbs
    }

    /// Blend weight of every example in the last step.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Pose at rest: amplitude or progression zero, into `out`.
    pub fn rest_pose(&mut self, space: &dyn PoseSpace, out: &mut [f64]) {
        let (lowest, _) = self.weights_map.frequencies();
        match self.kind {
            ClipKind::Cycle => self.weigh(self.wish(0.0, lowest), 1.0),
            ClipKind::Path => self.weigh(self.wish(1.0, 0.0), 1.0),
        }
        self.sample(space, 0.0, out);
    }

    /// Whether the class is at a point where it may be left: in one of its windows of phase or
    /// progression, if it has any; a class that plays once, at its end.
    pub fn may_leave(&self) -> bool {
        let at = match (self.options.play, self.kind) {
            (Play::Once, _) => self.state.progress,
            (_, ClipKind::Cycle) => self.state.phase / TAU,
            (_, ClipKind::Path) => self.state.amplitude.value,
        };
        let windows = &self.options.leave;
        if windows.is_empty() {
            return self.options.play != Play::Once
                || self.state.ended
                || self.state.progress == 0.0;
        }
        // Standing still there is no point of the motion to wait for.
        let still = self.options.play == Play::Gesture && self.state.amplitude.value < AT_REST;
        still || self.state.ended || windows.iter().any(|w| inside(*w, at))
    }

    /// Of a class that plays once: it has reached its end.
    pub fn done(&self) -> bool {
        self.options.play == Play::Once && self.state.ended
    }

    /// How much `drive` asks for the class.
    pub(super) fn activation(&self, drive: &Drive) -> f64 {
        match self.options.play {
            // A gesture in the opposite sense does not activate the class.
            _ if drive.frequency_hz < 0.0 => 0.0,
            // Once begun it is played whatever the gesture does; ended, it waits for the next time.
            Play::Once if self.state.ended => 0.0,
            Play::Once if self.state.progress > 0.0 => 1.0,
            Play::Once if !self.state.fresh => 0.0,
            _ => drive.amplitude,
        }
    }

    /// How much the class is held on to while another is asked for.
    pub(super) fn hold(&self, drive: &Drive) -> f64 {
        match self.options.play {
            // It goes on by itself up to where it may be left; there its gesture decides.
            Play::Once if !self.state.ended && drive.frequency_hz >= 0.0 => drive.amplitude,
            _ => self.activation(drive),
        }
    }

    /// Tells a class whether it shows (is active or being entered): only then the clock moves it.
    pub(super) fn show(&mut self, shown: bool, drive: &Drive) {
        if self.options.play == Play::Once {
            if shown && !self.shown {
                self.state.fresh = false;
            }
            // The gesture was released: the next one plays it anew.
            self.state.fresh |= !(drive.amplitude > FULL_FROM_AMPLITUDE);
            if !shown {
                (self.state.progress, self.state.ended) = (0.0, false);
            }
        }
        self.shown = shown;
    }

    /// Where the class is: fraction of its cycle or path, and its parameters.
    pub(super) fn now(&self) -> (f64, Parameters) {
        let amplitude = match self.kind {
            ClipKind::Cycle => self.state.amplitude.value,
            ClipKind::Path => 1.0,
        };
        let wish = self.wish(amplitude, self.state.frequency.value);
        (self.shown_phase() / TAU, wish)
    }

    /// The parameters that `drive` asks for.
    pub(super) fn wanted(&self, drive: &Drive) -> Parameters {
        match self.kind {
            ClipKind::Cycle => self.wish(awake(drive.amplitude).min(1.0), drive.frequency_hz),
            ClipKind::Path => self.wish(1.0, 0.0),
        }
    }

    /// Room for the way to an exit; to be filled, then [`MotionClass::follow_route`].
    pub(super) fn route_mut(&mut self) -> &mut Vec<RoutePoint> {
        &mut self.route.points
    }

    /// Goes along the way that was put into [`MotionClass::route_mut`], by the clock.
    pub(super) fn follow_route(&mut self) {
        self.route.at_s = 0.0;
    }

    /// Is driven as ever again.
    pub(super) fn leave_route(&mut self) {
        self.route.points.clear();
    }

    /// Enters the class at fraction `at` of its cycle or path.
    pub(super) fn enter(&mut self, at: f64) {
        match (self.options.play, self.kind) {
            (Play::Once, _) => {
                self.state.progress = at.clamp(0.0, 1.0);
                self.state.ended = false;
            }
            (_, ClipKind::Cycle) => self.state.phase = TAU * at.rem_euclid(1.0),
            (_, ClipKind::Path) => self.state.amplitude = Follower::at(at.clamp(0.0, 1.0)),
        }
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

    /// Draws the class's further parameters towards what drives them.
    fn follow_extra(&mut self, drive: &Drive, dt_s: f64) {
        for (follower, goal) in self.state.extra.iter_mut().zip(drive.extra) {
            let goal = if goal.is_finite() { goal } else { 0.0 };
            follower.step(goal, EXTRA_RATE, EXTRA_SPEED, dt_s);
        }
    }

    /// The parameters of amplitude and frequency, with the class's others as they are now.
    fn wish(&self, amplitude: f64, frequency_hz: f64) -> Parameters {
        let [third, fourth] = &self.state.extra;
        match self.weights_map.dimensions() {
            0..=2 => [amplitude, frequency_hz].into(),
            3 => [amplitude, frequency_hz, third.value].into(),
            _ => [amplitude, frequency_hz, third.value, fourth.value].into(),
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
        match (self.options.play, self.kind) {
            (Play::Gesture, ClipKind::Path) => self.step_path(space, drive, dt_s, out),
            (Play::Once, _) => self.step_once(space, drive, dt_s, out),
            (Play::Gesture, ClipKind::Cycle) => self.step_cycle(space, drive, dt_s, out),
            (Play::Loop, _) => {
                // The clock performs the gesture.
                let frequency_hz = self.weights_map.frequencies().0;
                let clock = Drive {
                    amplitude: 1.0,
                    frequency_hz,
                    phase_rad: self.state.phase + TAU * frequency_hz * dt_s,
                    extra: drive.extra,
                };
                self.step_cycle(space, clock, dt_s, out)
            }
        }
    }

    /// The point of example `example` at which its limb (or what belongs to none) is, 0..1.
    fn point(&self, example: usize, limb: Option<usize>, phase: f64) -> f64 {
        let shift = match (limb, &self.offsets[example]) {
            (Some(limb), Some(offsets)) if self.kind == ClipKind::Cycle => {
                self.state.limb_shift[limb] - offsets[limb]
            }
            _ => 0.0,
        };
        (phase + shift) / TAU
    }

    /// Samples every example at its limbs' phases and blends them.
    fn sample(&mut self, space: &dyn PoseSpace, phase: f64, out: &mut [f64]) {
        self.sample_clips(phase, out.len());
        self.blending
            .blend(space, phase / TAU, &self.sampled, &self.weights, out);
    }

    /// Samples every example that has a weight at its limbs' phases.
    fn sample_clips(&mut self, phase: f64, len: usize) {
        for e in 0..self.examples.len() {
            if self.weights[e] == 0.0 {
                continue;
            }
            for (run, limb) in &self.runs {
                let u = self.point(e, *limb, phase);
                let into = e * len + run.start..e * len + run.end;
                let clip = &self.examples[e].clip;
                clip.sample_range(u, run.clone(), &mut self.sampled[into]);
            }
        }
    }

    /// Where the phase of the last sample is, for contacts.
    fn shown_phase(&self) -> f64 {
        match (self.options.play, self.kind) {
            (Play::Once, _) => self.state.progress * TAU,
            (_, ClipKind::Cycle) => self.state.phase,
            (_, ClipKind::Path) => self.state.amplitude.value.clamp(0.0, 1.0) * TAU,
        }
    }

    /// How much of the blend has limb `limb` on the ground, 0..1: a vote of the clips, each at the
    /// limb's own phase (section 9.5.2).
    pub fn contact(&self, limb: usize) -> f64 {
        let phase = self.shown_phase();
        let limbs = self.limbs.len();
        let mut vote = 0.0;
        for (e, weight) in self.weights.iter().enumerate() {
            let on = match &self.contacts[e * limbs + limb] {
                None => true,
                Some(there) => {
                    let u = self.point(e, Some(limb), phase);
                    // The end of a path is not its beginning.
                    let u = if self.kind == ClipKind::Path {
                        u.min(1.0 - 1e-9)
                    } else {
                        u
                    };
                    there.in_contact(u)
                }
            };
            vote += if on { *weight } else { 0.0 };
        }
        vote
    }
}

/// Whether `at` lies in a window of phase; one whose end comes before its start goes over the seam.
fn inside(window: [f64; 2], at: f64) -> bool {
    let [from, to] = window;
    if from <= to {
        (from..=to).contains(&at)
    } else {
        at >= from || at <= to
    }
}

/// Amplitude with tremor taken out: zero below 0.04, unchanged from 0.15 on.
fn awake(amplitude: f64) -> f64 {
    let u = (amplitude - REST_AMPLITUDE) / (FULL_FROM_AMPLITUDE - REST_AMPLITUDE);
    amplitude.max(0.0) * super::smooth::ease(u)
}
