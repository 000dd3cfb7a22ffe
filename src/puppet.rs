//! The pure step: (time, pose samples, joint states) -> joint targets.
//!
//! No I/O, no lock, no clock, and after the first cycles no allocation. Live runs, replays, tests
//! and benchmarks call this one function, so the same input gives the same bytes out.

mod gaps;
mod guided;

use crate::base::{JointState, Time};
use crate::gesture::{FrontEnd, GestureEstimate, GestureKind};
use crate::motion::class::{Drive, EXTRA};
use crate::motion::layer::{ChannelMap, LayerInput};
use crate::motion::mapping::Seen;
pub use crate::motion::node::ClassInput;
use crate::motion::{Animator, ease, eased_span_s};
use crate::pose::PoseSample;
use crate::robot::Envelope;
use gaps::{GAP_S, Join, Tempo};
use guided::Guidance;
use std::f64::consts::TAU;

/// What happens when poses have been missing for longer than `lost_s`.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum LostPolicy {
    /// Come to rest and wait for poses.
    Idle,
    /// Hold the pose and wait for poses.
    Hold,
    /// End the run: settle, lie down, torque off.
    Stop,
}

/// Times and policies of a puppet.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct PuppetOptions {
    /// Control cycle, seconds.
    pub dt_s: f64,
    /// Least time of the ramp from the present pose to the first pose, seconds.
    pub ramp_s: f64,
    /// Least time of the way into the end pose, seconds.
    pub end_ramp_s: f64,
    /// From a target's computation to the instant the servo acts on it, seconds.
    pub actuation_delay_s: f64,
    /// Age of the last pose up to which gestures go on in phase, seconds.
    pub coast_s: f64,
    /// Age of the last pose from which poses count as lost, seconds; until then motion is eased to
    /// a hold.
    pub lost_s: f64,
    /// What then happens.
    pub on_lost: LostPolicy,
}

/// Where in its run the puppet is.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub enum Stage {
    /// Not begun: targets are not to be sent.
    #[default]
    Waiting,
    /// From the present pose to the first pose.
    Rising,
    /// Gestures drive the robot.
    Playing,
    /// Gestures are released; motion comes to rest.
    Settling,
    /// Into the end pose.
    Lowering,
    /// In the end pose.
    Done,
}

/// What the puppet is given in a cycle.
#[derive(Copy, Clone, Debug)]
pub struct Inputs<'a> {
    /// Pose samples that arrived since the last cycle, oldest first; their `t` is on the clock of `now`.
    pub samples: &'a [PoseSample],
    /// Last known state of every joint.
    pub states: &'a [JointState],
    /// The performance is over (or the operator wants the end): come to rest and lie down.
    pub finish: bool,
}

/// What the puppet gives in a cycle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Targets {
    /// Joint positions after the envelope, rad, model order.
    pub positions: Vec<f64>,
    /// Joints that the envelope had to hold back in this cycle.
    pub held_back: usize,
    /// Where in its run the puppet is.
    pub stage: Stage,
    /// Age of the last pose, seconds; `None` before the first.
    pub pose_age_s: Option<f64>,
    /// Poses are older than the limit while they should be driving the robot.
    pub poses_lost: bool,
    /// Joints whose pose was no number in this cycle; the envelope brakes them.
    pub not_finite: usize,
}

/// A character that is being played: gesture front end, animator, envelope and the stages of a run.
pub struct Puppet {
    front: FrontEnd,
    animator: Animator,
    envelope: Envelope,
    class_inputs: Vec<ClassInput>,
    /// Joint positions where a run ends. The pose's first coordinates are the joints; what follows (the
    /// body over the ground) is the animator's alone.
    end_pose: Vec<f64>,
    options: PuppetOptions,
    stage: Stage,
    stage_since: Time,
    ramp: Ramp,
    playing_since: Option<Time>,
    tempo: Tempo,
    /// Per class.
    joins: Vec<Join>,
    rejected: u64,
    estimates: Vec<GestureEstimate>,
    drives: Vec<Drive>,
    /// Gestures as layers see them.
    waves: Vec<Drive>,
    channels: Vec<f64>,
    pose: Vec<f64>,
    last_pose: Vec<f64>,
    still_s: f64,
    guidance: Guidance,
    targets: Targets,
}

/// Gestures with all that a puppet needs to go by them: made anywhere, taken over in a cycle.
#[derive(Debug)]
pub struct Gestures {
    /// Reads the gestures.
    pub front: FrontEnd,
    gesture_of_class: Vec<Option<usize>>,
    estimates: Vec<GestureEstimate>,
    channels: Vec<f64>,
}

impl Gestures {
    /// `gesture_of_class`: per class of the animator the index of its gesture in `front`.
    pub fn new(front: FrontEnd, gesture_of_class: Vec<Option<usize>>) -> Self {
        Self {
            estimates: front.estimates().to_vec(),
            channels: vec![f64::NAN; front.channel_names().len()],
            front,
            gesture_of_class,
        }
    }
}

/// An eased way between two poses.
#[derive(Clone, Debug, Default)]
struct Ramp {
    from: Vec<f64>,
    to: Vec<f64>,
    /// Room for both, where poses hold rotations and are blended by the body; else empty.
    pair: Vec<f64>,
    seconds: f64,
}

/// Share of a joint's speed and acceleration that ramps use.
const RAMP_SHARE: f64 = 0.5;
/// A class of lower amplitude stands still for all one can see.
const MOVING: f64 = 1e-3;
/// Slower than this counts as still, rad/s.
const STILL_RAD_S: f64 = 0.02;
/// The end is not waited for longer than this after gestures were released, seconds.
const SETTLE_AT_MOST_S: f64 = 4.0;

impl Puppet {
    /// Puts the parts together. `class_inputs`: per animator class what drives it; `end_pose`: where a
    /// run ends, rad, model order.
    pub fn new(
        front: FrontEnd,
        animator: Animator,
        envelope: Envelope,
        class_inputs: Vec<ClassInput>,
        end_pose: Vec<f64>,
        options: PuppetOptions,
    ) -> Self {
        let (joints, coordinates) = (end_pose.len(), animator.coordinates());
        let parts = animator.space().parts().iter();
        let rotations = parts
            .clone()
            .any(|p| p.coordinates.len() != p.tangent.len());
        let estimates = front.estimates().to_vec();
        let channels = vec![f64::NAN; front.channel_names().len()];
        Self {
            joins: vec![Join::default(); class_inputs.len()],
            drives: vec![Drive::default(); class_inputs.len()],
            waves: vec![Drive::default(); estimates.len()],
            estimates,
            channels,
            front,
            animator,
            envelope,
            class_inputs,
            end_pose,
            options,
            stage: Stage::Waiting,
            stage_since: Time::ZERO,
            ramp: Ramp {
                from: vec![0.0; joints],
                to: vec![0.0; joints],
                pair: vec![0.0; if rotations { 2 * joints } else { 0 }],
                seconds: 0.0,
            },
            playing_since: None,
            tempo: Tempo::default(),
            rejected: 0,
            pose: vec![0.0; coordinates],
            last_pose: vec![0.0; coordinates],
            still_s: 0.0,
            guidance: Guidance::new(joints),
            targets: Targets {
                positions: vec![0.0; joints],
                ..Targets::default()
            },
        }
    }

    /// Begins a run at `now` from the present joint positions (rad, model order).
    pub fn begin(&mut self, now: Time, present: &[f64]) {
        self.envelope.start(present);
        self.targets.positions.copy_from_slice(present);
        self.animator.rest_pose(&mut self.pose);
        self.last_pose.copy_from_slice(&self.pose);
        let joints = self.end_pose.len();
        self.ramp.to.copy_from_slice(&self.pose[..joints]);
        self.start_ramp(self.options.ramp_s);
        self.enter(Stage::Rising, now);
    }

    /// One control cycle at `now`. The returned targets have passed the envelope.
    ///
    /// Before [`Puppet::begin`] the targets must not be sent: the present position is not known.
    pub fn step(&mut self, now: Time, inputs: &Inputs<'_>) -> &Targets {
        for sample in inputs.samples {
            if self.front.push(sample).is_err() {
                self.rejected += 1;
            }
        }
        self.targets.poses_lost = false;
        match self.stage {
            Stage::Waiting => return &self.targets,
            Stage::Rising => {
                if self.follow_ramp(now) {
                    self.playing_since = Some(now);
                    self.enter(Stage::Playing, now);
                }
                if inputs.finish {
                    self.lower(now);
                }
            }
            Stage::Playing => {
                self.play(now, self.guidance.vigour);
                if inputs.finish
                    || (self.targets.poses_lost && self.options.on_lost == LostPolicy::Stop)
                {
                    self.still_s = 0.0;
                    self.enter(Stage::Settling, now);
                }
            }
            Stage::Settling => {
                self.play(now, 0.0);
                if self.still_s > 0.2 || now.secs_since(self.stage_since) > SETTLE_AT_MOST_S {
                    self.lower(now);
                }
            }
            Stage::Lowering => {
                if self.follow_ramp(now) {
                    self.enter(Stage::Done, now);
                }
            }
            Stage::Done => self.pose[..self.end_pose.len()].copy_from_slice(&self.end_pose),
        }
        let joints = self.end_pose.len();
        let asked = self.guidance.apply(now, &self.pose[..joints]);
        self.targets.not_finite = asked.iter().filter(|p| !p.is_finite()).count();
        self.targets.held_back = (self.envelope).pass(asked, &mut self.targets.positions);
        self.targets.stage = self.stage;
        &self.targets
    }

    /// Goes by other gestures from now on; `other` then holds the old ones. False, and nothing changed, when
    /// they are for another number of classes.
    ///
    /// The animator keeps its state, so the motion goes on: amplitude, tempo and phase are drawn to the new
    /// estimates as they are to any. Shown the same past, new gestures that are like the old ones read alike.
    /// Allocates and frees nothing.
    pub fn swap_gestures(&mut self, other: &mut Gestures) -> bool {
        if other.gesture_of_class.len() != self.class_inputs.len() {
            return false;
        }
        std::mem::swap(&mut self.front, &mut other.front);
        for (input, gesture) in self
            .class_inputs
            .iter_mut()
            .zip(&mut other.gesture_of_class)
        {
            std::mem::swap(&mut input.gesture, gesture);
        }
        std::mem::swap(&mut self.estimates, &mut other.estimates);
        std::mem::swap(&mut self.channels, &mut other.channels);
        for join in &mut self.joins {
            join.expect_a_jump();
        }
        true
    }

    /// Drives the animator from the gestures; `share` 0 releases them.
    fn play(&mut self, now: Time, share: f64) {
        let actuation = now.secs() + self.options.actuation_delay_s;
        let started = self.playing_since.map_or(now.secs(), Time::secs);
        let age = now.secs() - self.front.last_t().map_or(started, |t| t.max(started));
        self.targets.pose_age_s = self.front.last_t().map(|t| now.secs() - t);
        self.targets.poses_lost = share > 0.0 && age > self.options.lost_s;
        // The ladder: on in phase, then eased to a hold, then what the policy says.
        let fading = (age - self.options.coast_s) / (self.options.lost_s - self.options.coast_s);
        let holds = share > 0.0 && (fading < 1.0 || self.options.on_lost == LostPolicy::Hold);
        let share = if holds || fading < 1.0 { share } else { 0.0 };
        let goal = match (self.guidance.hold, holds) {
            (true, _) => 0.0,
            (false, true) => 1.0 - ease(fading),
            (false, false) => 1.0,
        };
        let dt_s = self.tempo.step(goal, self.options.dt_s);
        if fading <= 0.0 {
            self.tempo.held_s = 0.0;
            if self.guidance.slowed(dt_s < self.options.dt_s) {
                // Poses come, so gestures went on where time did not.
                for join in &mut self.joins {
                    join.fall_behind(self.options.dt_s - dt_s);
                }
            }
        } else {
            self.tempo.held_s += self.options.dt_s - dt_s;
        }
        self.front.set_active(self.animator.active());
        for (gesture, estimate) in self.estimates.iter_mut().enumerate() {
            *estimate = self.front.predict(gesture, actuation - self.tempo.held_s);
        }
        self.read_channels(share);
        self.drive_classes(share, age, dt_s);
        let input = LayerInput {
            channels: &self.channels,
            gestures: &self.waves,
        };
        self.animator
            .step(&self.drives, &input, dt_s, &mut self.pose);
        let fastest = self
            .pose
            .iter()
            .zip(&self.last_pose)
            .map(|(a, b)| (a - b).abs() / self.options.dt_s)
            .fold(0.0, f64::max);
        self.still_s = if fastest < STILL_RAD_S {
            self.still_s + self.options.dt_s
        } else {
            0.0
        };
        self.last_pose.copy_from_slice(&self.pose);
    }

    /// What every class is driven by in this step.
    fn drive_classes(&mut self, share: f64, age: f64, dt_s: f64) {
        let channels = &self.channels;
        let weigh = |(channel, map): (usize, ChannelMap)| {
            map.weight(channels.get(channel).copied().unwrap_or(f64::NAN))
        };
        for (class, input) in self.class_inputs.iter().enumerate() {
            if let Some(features) = input.feature.and_then(|index| self.front.feature(index)) {
                let seen = Seen {
                    feature: features.feature(),
                    yaw_rad: features.yaw_rad(),
                    share,
                };
                self.animator.see(class, seen);
            }
            let drive = &mut self.drives[class];
            *drive = Drive::default();
            for (value, source) in drive.extra.iter_mut().zip(&input.extra) {
                *value = source.map_or(0.0, weigh);
            }
            let Some(gesture) = input.gesture else {
                // Without a channel it is played while nothing else is: it asks for nothing.
                drive.amplitude = input.channel.map_or(0.0, weigh);
                continue;
            };
            let mut estimate = self.estimates[gesture];
            if input.reverse {
                estimate.frequency_hz = -estimate.frequency_hz;
                estimate.phase_rad = TAU - estimate.phase_rad;
            }
            let moving = self.animator.played()[class].amplitude > MOVING;
            (drive.frequency_hz, drive.phase_rad) = match estimate.kind {
                GestureKind::Cyclic => self.joins[class].step(&estimate, age > GAP_S, moving, dt_s),
                GestureKind::NonCyclic => (0.0, estimate.phase_rad),
            };
            drive.amplitude = estimate.amplitude * share;
        }
    }

    /// Channels, and gestures as layers see them; with `share` 0 all are released.
    fn read_channels(&mut self, share: f64) {
        for (index, value) in self.channels.iter_mut().enumerate() {
            *value = if share > 0.0 {
                self.front.channel(index)
            } else {
                f64::NAN
            };
        }
        // Gestures that are learnt while a run goes on drive no layer, and find no room here; one that is gone
        // is not performed any more.
        self.waves.fill(Drive::default());
        for (wave, estimate) in self.waves.iter_mut().zip(&self.estimates) {
            *wave = Drive {
                amplitude: estimate.amplitude * share,
                frequency_hz: estimate.frequency_hz,
                phase_rad: estimate.phase_rad,
                extra: [0.0; EXTRA],
            };
        }
    }

    fn lower(&mut self, now: Time) {
        self.ramp.to.copy_from_slice(&self.end_pose);
        self.start_ramp(self.options.end_ramp_s);
        self.enter(Stage::Lowering, now);
    }

    /// A ramp from the last targets that keeps well inside every joint's limits.
    fn start_ramp(&mut self, least_s: f64) {
        self.ramp.from.copy_from_slice(&self.targets.positions);
        let mut seconds = least_s;
        for ((from, to), limit) in self
            .ramp
            .from
            .iter()
            .zip(&self.ramp.to)
            .zip(self.envelope.limits())
        {
            let share = RAMP_SHARE * self.guidance.vigour.max(0.1);
            let (velocity, acceleration) = (share * limit.velocity, share * limit.acceleration);
            seconds = seconds.max(eased_span_s(to - from, velocity, acceleration));
        }
        self.ramp.seconds = seconds;
    }

    /// Puts the ramp's pose at `now` into `pose`; true at its end.
    fn follow_ramp(&mut self, now: Time) -> bool {
        let u = now.secs_since(self.stage_since) / self.ramp.seconds.max(1e-9);
        let w = ease(u);
        if self.ramp.pair.is_empty() {
            for ((pose, from), to) in self.pose.iter_mut().zip(&self.ramp.from).zip(&self.ramp.to) {
                *pose = from + w * (to - from);
            }
        } else {
            let (from, to) = self.ramp.pair.split_at_mut(self.ramp.from.len());
            from.copy_from_slice(&self.ramp.from);
            to.copy_from_slice(&self.ramp.to);
            let weights = [1.0 - w, w];
            (self.animator.space()).blend(&self.ramp.pair, &weights, &mut self.pose);
        }
        u >= 1.0
    }

    fn enter(&mut self, stage: Stage, now: Time) {
        self.stage = stage;
        self.stage_since = now;
    }

    /// Where in its run the puppet is.
    pub fn stage(&self) -> Stage {
        self.stage
    }

    /// What the last step gave.
    pub fn targets(&self) -> &Targets {
        &self.targets
    }

    /// The animator's pose in the last step: joints before the envelope, then the body over the ground where
    /// it walks.
    pub fn pose(&self) -> &[f64] {
        &self.pose
    }

    /// Gestures as used in the last step, in file order.
    pub fn estimates(&self) -> &[GestureEstimate] {
        &self.estimates
    }

    /// The gesture front end.
    pub fn front(&self) -> &FrontEnd {
        &self.front
    }

    /// The animator.
    pub fn animator(&self) -> &Animator {
        &self.animator
    }

    /// What drives each class.
    pub fn class_inputs(&self) -> &[ClassInput] {
        &self.class_inputs
    }

    /// Samples that the front end could not use.
    pub fn rejected_samples(&self) -> u64 {
        self.rejected
    }
}
