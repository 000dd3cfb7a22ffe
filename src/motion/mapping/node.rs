//! A direct node of the motion graph: the performer's pose itself drives the body through a map.

use super::map::PoseMap;
use crate::base::angle::wrap_pi;
use crate::motion::class::Played;
use crate::motion::clip::RootAdvance;
use crate::motion::range::JointRange;
use crate::motion::smooth::ease;

/// How fast joints close in on the mapped pose, 1/s: 40 ms behind a moving one.
const FOLLOW_RATE: f64 = 25.0;
/// How fast their waypoint closes in on it, 1/s: smooths the steps of the tracker.
const WAYPOINT_RATE: f64 = 100.0;
/// Share of the joints' speed and acceleration that following may use; the rest is for blends.
const RANGE_SHARE: f64 = 0.65;
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
    goal: Vec<f64>,
    /// Where the joints are heading: an admissible pose on the way to the goal.
    waypoint: Vec<f64>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    /// Rate at which, with the waypoint at rest, speeds would stay as they are, 1/s.
    steady: f64,
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
            goal: rest.clone(),
            waypoint: rest.clone(),
            position: rest.clone(),
            steady: FOLLOW_RATE,
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
    /// Joints ease towards the mapped pose within a share of their speed and acceleration, so nothing
    /// jumps when poses begin, come back after a loss, or leap; and they never leave the volume.
    pub fn step(&mut self, dt_s: f64, out: &mut [f64]) -> Played {
        if !(dt_s > 0.0) {
            // The puppet's time stands still while a pose is held.
            out.copy_from_slice(&self.position);
            return Played {
                amplitude: ease(self.entered) * self.share,
                stride: 1.0,
                locked: true,
                uncertainty: self.uncertainty.1,
                ..Played::default()
            };
        }
        let rise = dt_s / ENTER_S;
        self.entered = if self.share > 0.0 {
            (self.entered + rise).min(1.0)
        } else {
            0.0
        };
        let shown = ease(self.entered) * self.share;
        for ((goal, rest), mapped) in self.goal.iter_mut().zip(&self.rest).zip(&self.mapped) {
            *goal = rest + shown * (mapped - rest);
        }
        self.follow(dt_s);
        out.copy_from_slice(&self.position);
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

    /// Moves the joints towards the goal.
    ///
    /// The waypoint goes a part of the way to the goal, the joints a part of the way to the waypoint,
    /// all joints by the same part: so all that is passed through lies between admissible poses, and
    /// the volume is convex. The parts are chosen so that every joint keeps its speed and acceleration:
    /// closing in at rate r on a gap d a joint has the speed r d and, left alone, brakes with r^2 d. Both
    /// are held within the joint's range for the gap that is made; so to go on as before, with the
    /// waypoint at rest, is always allowed, and what is allowed beyond that is used.
    fn follow(&mut self, dt_s: f64) {
        // At a low control rate the part per step is bounded, or joints would pass the waypoint.
        let follow_rate = FOLLOW_RATE.min(0.4 / dt_s);
        let mut wanted = follow_rate;
        let (mut slowest, mut most, mut change) = (f64::INFINITY, follow_rate, f64::INFINITY);
        for (joint, range) in self.ranges.iter().enumerate() {
            let velocity = RANGE_SHARE * range.velocity;
            let acceleration = RANGE_SHARE * range.acceleration;
            let way = (self.goal[joint] - self.position[joint]).abs();
            let gap = (self.waypoint[joint] - self.position[joint]).abs();
            // A long way is gone at a low rate, which leaves time to brake from a high speed.
            wanted = wanted.min((acceleration / way).sqrt());
            slowest = slowest.min(acceleration / velocity);
            most = most.min((acceleration / gap).sqrt()).min(velocity / gap);
            change = change.min(acceleration * dt_s / self.velocity[joint].abs());
        }
        if self.velocity.iter().any(|v| *v != 0.0) {
            most = most.min((1.0 + change) * self.steady);
        }
        let least = (1.0 - change).max(0.0) * self.steady;
        let rate = wanted.max(slowest).max(least).min(most);
        let mut part = 1.0 - (-WAYPOINT_RATE * dt_s).exp();
        for (joint, range) in self.ranges.iter().enumerate() {
            let velocity = RANGE_SHARE * range.velocity;
            let acceleration = RANGE_SHARE * range.acceleration;
            let gap = self.waypoint[joint] - self.position[joint];
            let way = self.goal[joint] - self.waypoint[joint];
            let bound = (velocity / rate).min(acceleration / (rate * rate));
            let room = if way > 0.0 {
                bound.min((self.velocity[joint] + acceleration * dt_s) / rate) - gap
            } else {
                (-bound).max((self.velocity[joint] - acceleration * dt_s) / rate) - gap
            };
            if way != 0.0 {
                part = part.min((room / way).max(0.0));
            }
        }
        for joint in 0..self.ranges.len() {
            self.waypoint[joint] += part * (self.goal[joint] - self.waypoint[joint]);
            self.velocity[joint] = rate * (self.waypoint[joint] - self.position[joint]);
            self.position[joint] += self.velocity[joint] * dt_s;
        }
        self.steady = rate / (1.0 - rate * dt_s);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{MapOptions, Pair, learn_volume};
    use super::*;
    use crate::motion::clip::{Clip, ClipFile};
    use proptest::prelude::*;
    use std::f64::consts::{PI, TAU};

    const WALK: &str = include_str!("../../../configs/clips/walk_long.json");
    const RANGE: JointRange = JointRange {
        velocity: 5.0,
        acceleration: 80.0,
    };

    fn walk() -> Clip {
        let file = ClipFile::from_json(WALK).expect("a bundled clip");
        let joints = file.joints.clone();
        file.for_body(&joints).expect("its own joints")
    }

    /// The feature of a source that goes round once per cycle, with overtones as a hand has them.
    fn feature(phase: f64, hz: f64) -> Vec<f64> {
        let (mut places, mut velocities) = (Vec::new(), Vec::new());
        for (overtone, size) in [(1.0, 0.08), (2.0, 0.05), (3.0, 0.03)] {
            let (sin, cos) = (overtone * phase).sin_cos();
            let w = 0.1 * TAU * hz * overtone;
            places.extend([size * cos, size * sin]);
            velocities.extend([-w * size * sin, w * size * cos]);
        }
        [places, velocities].concat()
    }

    fn node(yaw_ratio: f64) -> DirectClass {
        let clip = walk();
        let pairs: Vec<Pair> = (0..8)
            .map(|k| {
                let mut target = vec![0.0; clip.coordinates()];
                clip.pose(f64::from(k) / 8.0, &mut target);
                Pair {
                    label: format!("pair {k}"),
                    source: feature(TAU * f64::from(k) / 8.0, 0.8),
                    target,
                }
            })
            .collect();
        let (volume, root) = learn_volume(&[clip], 50).expect("a clip that moves");
        let options = MapOptions {
            yaw_ratio,
            ..MapOptions::default()
        };
        let map = PoseMap::learn(&pairs, 0.1, volume, root, options).expect("good pairs");
        let joints = map.joints();
        DirectClass::new("walk", map, vec![RANGE; joints], true)
    }

    #[test]
    fn the_body_travels_as_fast_as_its_clip_at_the_clips_tempo() {
        let clip = walk();
        let expected = clip.root.forward_m * clip.frequency_hz;
        let mut node = node(0.0);
        let mut out = vec![0.0; 12];
        let (mut way, mut still) = (0.0, 0.0);
        for step in 0..4000 {
            let t = f64::from(step) * 0.005;
            // Ten seconds of going round, then the source stands still.
            let phase = TAU * clip.frequency_hz * t.min(10.0);
            let hz = if t < 10.0 { clip.frequency_hz } else { 0.0 };
            let feature = feature(phase, hz);
            node.see(Seen {
                feature: Some(&feature),
                yaw_rad: 0.0,
                share: 1.0,
            });
            let forward = node.step(0.005, &mut out).root_velocity.forward_m;
            if (2.0..10.0).contains(&t) {
                way += forward * 0.005;
            } else if t > 15.0 {
                still += forward * 0.005;
            }
        }
        let speed = way / 8.0;
        // The pose of a linear map is smoother than the clip, so it changes more slowly.
        let share = speed / expected;
        assert!(
            (0.6..1.2).contains(&share),
            "{speed:.3} m/s, the clip travels {expected:.3} m/s"
        );
        assert!(still.abs() < 1e-6, "travels {still} m while it stands");
    }

    #[test]
    fn the_root_turns_by_the_ratio_of_the_performers_yaw() {
        let mut node = node(0.5);
        let mut out = vec![0.0; 12];
        let feature = feature(0.0, 0.8);
        let mut turned = 0.0;
        for step in 0..=200 {
            // One turn to the left, across the seam at pi.
            let yaw_rad = wrap_pi(0.5 + TAU * f64::from(step) / 200.0);
            node.see(Seen {
                feature: Some(&feature),
                yaw_rad,
                share: 1.0,
            });
            turned += node.step(0.005, &mut out).root_velocity.yaw_rad * 0.005;
        }
        assert!(
            (turned - PI).abs() < 1e-9,
            "turned {turned} rad for half a turn"
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// Poses that leap, vanish and come back, at any control rate: speed, acceleration and volume hold.
        #[test]
        fn nothing_jumps_whatever_is_shown(
            shown in prop::collection::vec((0.0..TAU, -3.0..3.0f64, 0u8..4), 2..30),
            rate_hz in 10.0..1000.0f64,
            seconds in 0.01..0.6f64,
        ) {
            let mut node = node(1.0);
            let dt = 1.0 / rate_hz;
            let mut out = vec![0.0; 12];
            node.rest_pose(&mut out);
            let (mut last, mut velocity) = (out.clone(), vec![0.0; 12]);
            let volume = node.map().volume().clone();
            let mut coefficients = vec![0.0; volume.dimensions()];
            let mut outside: f64 = 0.0;
            for (phase, hz, what) in shown {
                let mut feature = feature(phase, hz);
                match what {
                    0 => feature[0] = f64::NAN,
                    1 => feature[1] = 1e300,
                    _ => {}
                }
                for _ in 0..(seconds * rate_hz) as usize + 1 {
                    node.see(Seen {
                        feature: (what < 3).then_some(&feature),
                        yaw_rad: phase,
                        share: if what == 2 { 0.5 } else { 1.0 },
                    });
                    node.step(dt, &mut out);
                    for joint in 0..12 {
                        let v = (out[joint] - last[joint]) / dt;
                        let a = (v - velocity[joint]) / dt;
                        prop_assert!(v.abs() <= RANGE.velocity + 1e-6, "speed {v} rad/s");
                        prop_assert!(a.abs() <= RANGE.acceleration + 1e-3, "acceleration {a} rad/s^2");
                        velocity[joint] = v;
                    }
                    last.copy_from_slice(&out);
                    volume.project(&out, &mut coefficients);
                    for (c, (low, high)) in coefficients.iter().zip(volume.low.iter().zip(&volume.high)) {
                        outside = outside.max((low - c).max(c - high) / (high - low));
                    }
                }
            }
            prop_assert!(outside < 1e-9, "{outside} of an interval outside the volume");
        }
    }
}
