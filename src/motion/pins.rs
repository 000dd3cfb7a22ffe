//! Foot pinning: a foot on the ground stays where it is until it is lifted.
//!
//! Rhodin 2016, section 9.5.2: a foot newly in contact is pinned where it is, at ground height; a pinned
//! foot stays; one in flight follows the unconstrained motion, its speed within 0.5 to 1.5 of that one's.

use super::smooth::Follower;
use crate::body::{Feet, RootPose};
use nalgebra::{Point3, Vector3};

/// Votes above this put a foot on the ground; below `RELEASE` it is lifted.
const CONTACT: f64 = 0.9;
const RELEASE: f64 = 0.8;
/// Where the motion does not tell its contacts: lower than this part of the leg's reach above the
/// ground, and slower than this part of it in a second.
const LOW: f64 = 0.04;
const SLOW_PER_S: f64 = 0.4;
/// How fast what a pin left of an offset is taken back in flight, 1/s.
const RETURN_RATE: f64 = 14.0;
/// How fast a foot comes to rest at touch-down, 1/s: what it still moves is a 60th of its speed.
const LANDING_RATE: f64 = 60.0;
/// A foot that comes down faster is braked harder, so that it slides no further than this, metres, ...
const LANDING_M: f64 = 0.0015;
/// ... up to this rate, 1/s.
const HARDEST_LANDING_RATE: f64 = 110.0;
/// How fast it comes to ground height, 1/s, and with what acceleration at most, m/s^2: a foot that is put down
/// from high up (a paw that was held out) must not be snatched.
const SETTLING_RATE: f64 = 40.0;
const SETTLING_M_S2: f64 = 5.0;
/// In flight an offset is taken back at most with this part of the foot's own speed, so that the shown
/// foot keeps between half and one and a half of it.
const FLIGHT_SPEED: f64 = 0.5;
/// And at least this fast, m/s: a foot that hovers must come back too.
const LEAST_RETURN_M_S: f64 = 0.05;
/// A leg that is this much too short moves its pin, metres.
const OUT_OF_REACH_M: f64 = 1e-4;

/// How often the body may give way to legs that do not reach, in one step.
const BODY_ROUNDS: usize = 4;

/// One foot's state, in the world.
#[derive(Clone, Debug, Default)]
struct Pin {
    on_ground: bool,
    /// Where the foot is.
    at: Point3<f64>,
    /// How it moves, m/s.
    velocity: Vector3<f64>,
    /// Height over the ground while it stands.
    height: Follower,
    settling_rate: f64,
    landing_rate: f64,
    /// In flight: from the unconstrained foot to the shown one.
    offset: Offset,
    /// Where the unconstrained foot was.
    free: Point3<f64>,
}

/// A difference that is taken back like a critically damped follower, alike in all directions: which way
/// the body faces must not matter.
#[derive(Copy, Clone, Debug, Default)]
struct Offset {
    value: Vector3<f64>,
    speed: Vector3<f64>,
}

impl Offset {
    /// One step towards nothing, not faster than `bound` (m/s).
    fn step(&mut self, bound: f64, dt_s: f64) {
        let k = RETURN_RATE * dt_s;
        self.speed = (self.speed - RETURN_RATE * k * self.value) / (1.0 + 2.0 * k + k * k);
        let fast = self.speed.norm();
        if fast > bound {
            self.speed *= bound / fast;
        }
        self.value += self.speed * dt_s;
    }
}

impl Pin {
    /// Lands or stands: what moved the foot in flight ebbs away, then it stays.
    fn stand(&mut self, ground_m: f64, dt_s: f64) {
        if !self.on_ground {
            self.height = Follower::moving(self.at.z, self.velocity.z);
            let fast_m_s = self.velocity.xy().norm();
            self.landing_rate = (fast_m_s / LANDING_M).clamp(LANDING_RATE, HARDEST_LANDING_RATE);
            let drop_m = (self.at.z - ground_m).abs().max(1e-9);
            self.settling_rate = SETTLING_RATE.min((SETTLING_M_S2 / drop_m).sqrt());
        }
        self.velocity *= (-self.landing_rate * dt_s).exp();
        self.at.x += self.velocity.x * dt_s;
        self.at.y += self.velocity.y * dt_s;
        self.at.z = (self.height).step(ground_m, self.settling_rate, 1e3, dt_s);
        self.velocity.z = self.height.speed();
    }

    /// Lifts off or flies: goes over into the unconstrained motion without a step in place or speed.
    fn fly(&mut self, free: Point3<f64>, free_velocity: Vector3<f64>, dt_s: f64) {
        if self.on_ground {
            self.offset = Offset {
                value: self.at - self.free,
                speed: self.velocity - free_velocity,
            };
        }
        // A bound that falls must not brake the foot at once.
        let bound = (FLIGHT_SPEED * free_velocity.norm())
            .max(LEAST_RETURN_M_S)
            .max(0.95 * self.offset.speed.norm());
        self.offset.step(bound, dt_s);
        let next = free + self.offset.value;
        if dt_s > 0.0 {
            self.velocity = (next - self.at) / dt_s;
        }
        self.at = next;
    }
}

/// Pins of all feet of a body.
pub struct Pins {
    feet: Box<dyn Feet>,
    pins: Vec<Pin>,
    /// Height of each foot when it stands.
    ground_m: Vec<f64>,
    begun: bool,
}

impl Pins {
    /// Pins for `feet`, which stand on the ground in the pose `standing`.
    pub fn new(feet: Box<dyn Feet>, standing: &[f64]) -> Self {
        let count = feet.count();
        Self {
            ground_m: (0..count).map(|i| feet.position(standing, i).z).collect(),
            pins: vec![Pin::default(); count],
            feet,
            begun: false,
        }
    }

    /// Moves the body of `pose` up or down until the lowest foot stands on the ground: for a motion that does
    /// not tell where its body is.
    pub(super) fn lower_to_ground(&self, pose: &mut [f64]) {
        let over = |i: usize| self.feet.position(pose, i).z - self.ground_m[i];
        let lowest = (0..self.pins.len()).map(over).fold(f64::INFINITY, f64::min);
        if lowest.is_finite() {
            self.feet.shift(pose, Vector3::new(0.0, 0.0, -lowest));
        }
    }

    /// The feet.
    pub fn feet(&self) -> &dyn Feet {
        self.feet.as_ref()
    }

    /// Whether each foot is on the ground.
    pub fn on_ground(&self, foot: usize) -> bool {
        self.pins[foot].on_ground
    }

    /// The feet on the ground, one bit each; those beyond 64 are not told.
    pub fn grounded(&self) -> u64 {
        (self.pins.iter().take(64).enumerate())
            .filter(|(_, pin)| pin.on_ground)
            .fold(0, |bits, (foot, _)| bits | 1 << foot)
    }

    /// Where each foot is in the world, metres.
    pub fn place(&self, foot: usize) -> Point3<f64> {
        self.pins[foot].at
    }

    /// One step: `votes` says for each foot how much of the motion has it on the ground, 0..1 (not a
    /// number: the motion does not tell). Moves the legs of `pose`, whose body is at `root`. Allocates
    /// nothing.
    pub fn step(&mut self, votes: &[f64], root: &RootPose, dt_s: f64, pose: &mut [f64]) {
        for (i, pin) in self.pins.iter_mut().enumerate() {
            let free = root.to_world(self.feet.position(pose, i));
            if !self.begun {
                (pin.at, pin.free) = (free, free);
            }
            let way = free - pin.free;
            let free_velocity = if dt_s > 0.0 {
                way / dt_s
            } else {
                Vector3::zeros()
            };
            let wanted = if pin.on_ground { RELEASE } else { CONTACT };
            let down = if self.begun && !(dt_s > 0.0) {
                // No time has passed: nothing lands, nothing lifts off.
                pin.on_ground
            } else if votes[i].is_finite() {
                votes[i] > wanted
            } else {
                // The motion does not tell: low and slow is on the ground.
                let reach_m = self.feet.reach_m(i);
                let low = free.z - self.ground_m[i] < LOW * reach_m;
                low && free_velocity.norm() < SLOW_PER_S * reach_m
            };
            if down {
                pin.stand(self.ground_m[i], dt_s);
            } else {
                pin.fly(free, free_velocity, dt_s);
            }
            pin.on_ground = down;
            pin.free = free;
        }
        self.begun = true;
        self.place_feet(root, pose);
    }

    /// Puts the feet where they are to be. Where a leg that stands is too short (or cannot fold so far) the
    /// body gives way; what then is still missing moves the pin.
    fn place_feet(&mut self, root: &RootPose, pose: &mut [f64]) {
        for round in 0..=BODY_ROUNDS {
            let mut missing = Vector3::zeros();
            for (i, pin) in self.pins.iter_mut().enumerate() {
                let goal = root.to_local(pin.at);
                let here = self.feet.position(pose, i);
                if (goal - here).norm() < 1e-9 {
                    continue;
                }
                if self.feet.place(pose, i, goal) < OUT_OF_REACH_M {
                    continue;
                }
                let here = self.feet.position(pose, i);
                if round == BODY_ROUNDS || !pin.on_ground {
                    pin.at = root.to_world(here);
                } else if (goal - here).norm() > missing.norm() {
                    missing = goal - here;
                }
            }
            if missing == Vector3::zeros() {
                return;
            }
            self.feet.shift(pose, missing);
        }
    }
}
