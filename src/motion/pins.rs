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
/// How fast a foot comes to rest at touch-down, and to ground height, 1/s.
const LANDING_RATE: f64 = 60.0;
/// In flight a foot may be slower or faster than the unconstrained one by this part of its speed.
const FLIGHT_SPEED: f64 = 0.5;
/// A leg that is this much too short moves its pin, metres.
const OUT_OF_REACH_M: f64 = 1e-4;

/// One foot's state.
#[derive(Clone, Debug, Default)]
struct Pin {
    on_ground: bool,
    /// Where the foot is, in the world.
    at: Point3<f64>,
    /// How it still moves while landing, m/s.
    velocity: Vector3<f64>,
    /// From the unconstrained foot to the shown one, per axis, in the world.
    offset: [Follower; 3],
    /// Where the unconstrained foot was, in the world.
    free: Point3<f64>,
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

    /// The feet.
    pub fn feet(&self) -> &dyn Feet {
        self.feet.as_ref()
    }

    /// Whether each foot is on the ground.
    pub fn on_ground(&self, foot: usize) -> bool {
        self.pins[foot].on_ground
    }

    /// Where each foot is in the world, metres.
    pub fn place(&self, foot: usize) -> Point3<f64> {
        self.pins[foot].at
    }

    /// One step: `votes` says for each foot how much of the motion has it on the ground, 0..1 (not a
    /// number: the motion does not tell). Moves the
    /// legs of `pose`, whose body is at `root`. Allocates nothing.
    pub fn step(&mut self, votes: &[f64], root: &RootPose, dt_s: f64, pose: &mut [f64]) {
        for (i, pin) in self.pins.iter_mut().enumerate() {
            let free = root.to_world(self.feet.position(pose, i));
            if !self.begun {
                pin.at = free;
                pin.free = free;
            }
            let way = free - pin.free;
            pin.free = free;
            let wanted = if pin.on_ground { RELEASE } else { CONTACT };
            let down = if votes[i].is_finite() {
                votes[i] > wanted
            } else {
                // The motion does not tell: low and slow is on the ground.
                let reach_m = self.feet.reach_m(i);
                let low = free.z - self.ground_m[i] < LOW * reach_m;
                low && way.norm() < SLOW_PER_S * reach_m * dt_s
            };
            let before = pin.at;
            if down {
                // What moved the foot in flight ebbs away.
                let fade = (-LANDING_RATE * dt_s).exp();
                pin.velocity *= fade;
                pin.velocity.z = 0.0;
                pin.at += pin.velocity * dt_s;
                pin.at.z += (1.0 - fade) * (self.ground_m[i] - pin.at.z);
                for (axis, offset) in pin.offset.iter_mut().enumerate() {
                    *offset = Follower::at(pin.at[axis] - free[axis]);
                }
            } else {
                for offset in &mut pin.offset {
                    offset.step(0.0, RETURN_RATE, 1e3, dt_s);
                }
                let goal = free + shift(&pin.offset);
                pin.at = before + clamp_speed(goal - before, way);
                // What the clamp held back is still to be made up for.
                for (axis, offset) in pin.offset.iter_mut().enumerate() {
                    offset.value = pin.at[axis] - free[axis];
                }
                if dt_s > 0.0 {
                    pin.velocity = (pin.at - before) / dt_s;
                }
            }
            pin.on_ground = down;
            if (pin.at - free).norm() > 1e-9 {
                let left = self.feet.place(pose, i, root.to_local(pin.at));
                if left > OUT_OF_REACH_M {
                    pin.at = root.to_world(self.feet.position(pose, i));
                }
            }
        }
        self.begun = true;
    }
}

fn shift(offset: &[Follower; 3]) -> Vector3<f64> {
    Vector3::new(offset[0].value, offset[1].value, offset[2].value)
}

/// `way` of one step, not faster or slower than the unconstrained way allows.
fn clamp_speed(way: Vector3<f64>, free: Vector3<f64>) -> Vector3<f64> {
    let (speed, wanted) = (way.norm(), free.norm());
    if speed < 1e-12 || wanted < 1e-6 {
        return way;
    }
    let allowed = speed.clamp((1.0 - FLIGHT_SPEED) * wanted, (1.0 + FLIGHT_SPEED) * wanted);
    way * (allowed / speed)
}
