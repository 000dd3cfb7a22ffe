//! A direct node of the motion graph: the performer's pose itself drives the body through a map.

use super::map::PoseMap;
use crate::base::angle::wrap_pi;
use crate::motion::class::Played;
use crate::motion::clip::RootAdvance;
use crate::motion::range::JointRange;
use crate::motion::smooth::ease;

/// How fast joints close in on the mapped pose, 1/s: 40 ms behind a moving one.
const FOLLOW_RATE: f64 = 25.0;
/// How fast a joint's speed follows what the way asks for, 1/s. Four times the other: no overshoot.
const SPEED_RATE: f64 = 4.0 * FOLLOW_RATE;
/// Share of the joints' speed and acceleration that following may use; the rest is for blends.
const RANGE_SHARE: f64 = 0.65;
/// Braking counts on this part of the acceleration, so that it is never found too little.
const BRAKE_SHARE: f64 = 0.5;
/// From nothing to the whole mapped pose when poses begin or come back, seconds.
const ENTER_S: f64 = 0.6;

/// What a direct node is shown of the performer in one step.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Seen<'a> {
    /// Feature of the last pose; `None` before the first.
    pub feature: Option<&'a [f64]>,
    /// Yaw of the performer, rad.
    pub yaw_rad: f64,
    /// 1 while poses come, falling to 0 when they are missing or released.
    pub share: f64,
}

/// A pose map as a class of the graph, with the state of its followers.
#[derive(Clone, Debug)]
pub struct DirectClass {
    /// Class name.
    pub name: String,
    /// Whether no gesture activates it: it is played while nothing else is performed.
    pub always: bool,
    map: PoseMap,
    ranges: Vec<JointRange>,
    rest: Vec<f64>,
    mapped: Vec<f64>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    /// Part of the mapped pose that shows, before easing.
    entered: f64,
    share: f64,
    yaw_rad: f64,
    last_yaw_rad: Option<f64>,
    uncertainty: (f64, f64),
}

impl DirectClass {
    /// A node for joints with the given ranges, at rest in the volume's mean pose.
    pub fn new(name: &str, map: PoseMap, ranges: Vec<JointRange>, always: bool) -> Self {
        let joints = map.joints();
        let mut rest = vec![0.0; joints];
        let mut origin = vec![0.0; map.volume().dimensions()];
        map.volume().confine(&mut origin, &mut rest);
        Self {
            name: name.into(),
            always,
            mapped: rest.clone(),
            position: rest.clone(),
            velocity: vec![0.0; joints],
            rest,
            map,
            ranges,
            entered: 0.0,
            share: 0.0,
            yaw_rad: 0.0,
            last_yaw_rad: None,
            uncertainty: (0.0, 0.0),
        }
    }

    /// The map.
    pub fn map(&self) -> &PoseMap {
        &self.map
    }

    /// Uncertainty q of the map at the last pose, and the same as a bar 0..1 (section 8.3).
    pub fn uncertainty(&self) -> (f64, f64) {
        self.uncertainty
    }

    /// Pose at rest: the mean of the target motion.
    pub fn rest_pose(&self, out: &mut [f64]) {
        out.copy_from_slice(&self.rest);
    }

    /// Shows the performer's pose to the node. Allocates nothing.
    pub fn see(&mut self, seen: Seen<'_>) {
        let usable = seen.feature.filter(|f| f.iter().all(|v| v.is_finite()));
        self.share = if usable.is_some() && seen.share > 0.0 {
            seen.share.min(1.0)
        } else {
            0.0
        };
        if let Some(feature) = usable {
            self.map.apply(feature, &mut self.mapped);
            self.uncertainty = self.map.uncertainty(feature);
        }
        if seen.yaw_rad.is_finite() {
            self.yaw_rad = seen.yaw_rad;
        }
    }

    /// One step of `dt_s`; the pose goes into `out`. Allocates nothing.
    ///
    /// Joints follow the mapped pose critically damped, within a share of their speed and acceleration,
    /// so nothing jumps when poses begin, come back after a loss, or leap.
    pub fn step(&mut self, dt_s: f64, out: &mut [f64]) -> Played {
        let rise = dt_s / ENTER_S;
        self.entered = if self.share > 0.0 {
            (self.entered + rise).min(1.0)
        } else {
            0.0
        };
        let shown = ease(self.entered) * self.share;
        // At a low control rate the gains of a step are bounded, or it would overshoot.
        let follow_rate = FOLLOW_RATE.min(0.4 / dt_s);
        for (joint, out) in out.iter_mut().enumerate() {
            let goal = self.rest[joint] + shown * (self.mapped[joint] - self.rest[joint]);
            let range = self.ranges[joint];
            let most_velocity = RANGE_SHARE * range.velocity;
            let most_gain = RANGE_SHARE * range.acceleration * dt_s;
            let way = goal - self.position[joint];
            let braking = (2.0 * BRAKE_SHARE * RANGE_SHARE * range.acceleration * way.abs()).sqrt();
            let wanted = (follow_rate * way.abs())
                .min(braking)
                .min(most_velocity)
                .copysign(way);
            let gain = (wanted - self.velocity[joint]) * (SPEED_RATE * dt_s).min(1.0);
            self.velocity[joint] += gain.clamp(-most_gain, most_gain);
            self.position[joint] += self.velocity[joint] * dt_s;
            *out = self.position[joint];
        }
        let [forward_m, left_m] = self.map.root_velocity(&self.velocity);
        let turn = self
            .last_yaw_rad
            .map_or(0.0, |last| wrap_pi(self.yaw_rad - last));
        let seen = self.share > 0.0;
        self.last_yaw_rad = seen.then_some(self.yaw_rad);
        Played {
            amplitude: shown,
            stride: 1.0,
            locked: true,
            root_velocity: RootAdvance {
                forward_m,
                left_m,
                yaw_rad: if seen {
                    self.map.yaw_ratio() * turn / dt_s
                } else {
                    0.0
                },
            },
            uncertainty: self.uncertainty.1,
            ..Played::default()
        }
    }
}
