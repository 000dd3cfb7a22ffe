//! Robots that gaits are authored for, and what a clip does with their feet.
#![allow(dead_code, reason = "each test program uses a part")]

use crate::support::data::shared_data;
use handwave::motion::clip::{Clip, ClipFile};
use handwave::motion::gait::{GaitDescription, GaitName};
use handwave::motion::gait_frames::{Authored, Walker, author};
use handwave::motion::range::JointRange;
use handwave::robot::{Facing, Leg, RobotModel};
use nalgebra::{Isometry2, Isometry3, Point3, Translation3, UnitQuaternion, Vector2};
use std::path::{Path, PathBuf};

/// A gait that goes somewhere: forwards and to the left (m), turning (rad), per cycle.
pub fn way(gait: GaitName, [forward, left, turn]: [f64; 3]) -> GaitDescription {
    let mut description = GaitDescription::preset(gait.name(), gait);
    description.stride_m = Some(forward);
    description.left_m = left;
    description.turn_rad = turn;
    description
}

pub struct Robot {
    pub name: &'static str,
    pub model: RobotModel,
    pub legs: Vec<Leg>,
    pub facing: Facing,
    pub ranges: Vec<JointRange>,
}

impl Robot {
    pub fn from_text(name: &'static str, text: &str) -> Self {
        let model = RobotModel::from_urdf(text).unwrap_or_else(|e| panic!("{name}: {e}"));
        Self::of(name, model)
    }

    pub fn of(name: &'static str, model: RobotModel) -> Self {
        let (legs, facing) =
            Leg::find_all_facing(&model, None).unwrap_or_else(|e| panic!("{name}: {e}"));
        let ranges = model
            .limits()
            .iter()
            .map(|l| JointRange {
                velocity: l.velocity,
                acceleration: 120.0,
            })
            .collect();
        Self {
            name,
            model,
            legs,
            facing,
            ranges,
        }
    }

    pub fn walker(&self) -> Walker<'_> {
        Walker {
            model: &self.model,
            legs: &self.legs,
            facing: self.facing,
            ranges: &self.ranges,
        }
    }

    #[track_caller]
    pub fn author(&self, description: &GaitDescription) -> Authored {
        author(description, self.walker(), false).unwrap_or_else(|e| panic!("{}: {e}", self.name))
    }

    /// Presets that fit its legs, without `stand`.
    pub fn gaits(&self) -> Vec<GaitName> {
        GaitName::for_legs(self.legs.len())
            .into_iter()
            .filter_map(GaitName::by_name)
            .collect()
    }
}

pub fn bundled(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("configs/robots")
        .join(name);
    std::fs::read_to_string(path).expect("a bundled URDF")
}

/// Quadrupeds beside the repository: name, file, and the speed that replaces placeholder limits.
pub const STRANGERS: [(&str, &str, f64); 5] = [
    ("a1", "robots/a1/a1.urdf", f64::INFINITY),
    ("anymal_b", "robots/anymal_b/anymal.urdf", f64::INFINITY),
    ("anymal_c", "robots/anymal_c/anymal.urdf", f64::INFINITY),
    ("laikago", "robots/laikago/laikago.urdf", f64::INFINITY),
    ("solo12", "robots/solo12/solo12.urdf", 8.0),
];

pub fn stranger(name: &str) -> Option<PathBuf> {
    let (_, path, _) = STRANGERS.iter().find(|(n, ..)| *n == name)?;
    shared_data(path)
}

/// The bundled robots, and those that are found beside the repository.
pub fn robots() -> Vec<Robot> {
    let mut all = vec![
        Robot::from_text("pup", &bundled("pup.urdf")),
        Robot::from_text("phantomx", &bundled("phantomx.urdf")),
    ];
    for (name, path, velocity) in STRANGERS {
        if let Some(path) = shared_data(path) {
            let text = std::fs::read_to_string(path).expect("a readable URDF");
            let mut model = RobotModel::from_urdf(&text).unwrap_or_else(|e| panic!("{name}: {e}"));
            model.cap_velocity(velocity);
            all.push(Robot::of(name, model));
        }
    }
    all
}

/// Pose in the plane at `samples` instants of each of two cycles, by many small steps of the advance in
/// the body's own frame.
pub fn travelled(file: &ClipFile, samples: usize) -> Vec<Isometry2<f64>> {
    const STEPS: u32 = 20;
    let dt = 1.0 / (samples as f64 * f64::from(STEPS));
    let root = file.root;
    let (mut place, mut angle) = (Vector2::zeros(), 0.0);
    let mut all = Vec::new();
    for _ in 0..2 * samples {
        all.push(Isometry2::new(place, angle));
        for _ in 0..STEPS {
            let (sin, cos) = (angle + 0.5 * dt * root.yaw_rad).sin_cos();
            place.x += dt * (root.forward_m * cos - root.left_m * sin);
            place.y += dt * (root.forward_m * sin + root.left_m * cos);
            angle += dt * root.yaw_rad;
        }
    }
    all
}

/// The root link over the ground in the travelling frame at row `k` of the clip.
pub fn root_at(file: &ClipFile, k: usize) -> Isometry3<f64> {
    let [x, y, z, roll, pitch, yaw] = file.body[k];
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

/// What the feet do over a cycle.
#[derive(Debug, Default)]
pub struct Feet {
    /// Farthest that a foot in stance is from its spot in the world, metres.
    pub slip_m: f64,
    /// Farthest that a foot in stance is from the ground, metres.
    pub off_ground_m: f64,
    /// Least over the feet of the highest point of the swing, metres.
    pub clearance_m: f64,
    /// Deepest that a foot in swing goes below the ground, metres.
    pub scuff_m: f64,
}

/// Follows every foot through two cycles of the clip, the body level at its mean height between rows.
pub fn feet(robot: &Robot, file: &ClipFile) -> Feet {
    const SAMPLES: usize = 200;
    let clip = file.for_body(&file.joints).expect("own joints");
    let rows = file.body.len();
    let mut found = Feet {
        clearance_m: f64::INFINITY,
        ..Feet::default()
    };
    let mut pose = vec![0.0; file.joints.len()];
    let world = travelled(file, SAMPLES);
    for (leg, limb) in robot.legs.iter().zip(&clip.limbs) {
        let mut spot: Option<Vector2<f64>> = None;
        let mut highest: f64 = 0.0;
        for (k, world) in world.iter().enumerate() {
            let u = k as f64 / SAMPLES as f64;
            clip.pose(u, &mut pose);
            let row = (u.fract() * rows as f64).round() as usize % rows;
            let ground = root_at(file, row) * leg.foot_position(&robot.model, &pose);
            let in_world = world * nalgebra::Point2::new(ground.x, ground.y);
            if (u - limb.phase).rem_euclid(1.0) < limb.duty {
                let spot = *spot.get_or_insert(in_world.coords);
                found.slip_m = found.slip_m.max((in_world.coords - spot).norm());
                found.off_ground_m = found.off_ground_m.max(ground.z.abs());
            } else {
                // The first stance may have begun before the samples did: all the same spot.
                spot = None;
                highest = highest.max(ground.z);
                found.scuff_m = found.scuff_m.max(-ground.z);
            }
        }
        found.clearance_m = found.clearance_m.min(highest);
    }
    found
}

/// Speeds over limits at the frequency the clip was made for, and positions outside limits.
pub fn strain(robot: &Robot, file: &ClipFile, clip: &Clip) -> (f64, f64) {
    let (mut speed, mut outside): (f64, f64) = (0.0, 0.0);
    for (joint, limit) in robot.model.limits().iter().enumerate() {
        for k in 0..300 {
            let u = f64::from(k) / 300.0;
            let q = clip.sample(u, joint);
            let rate = (clip.sample(u + 5e-4, joint) - clip.sample(u - 5e-4, joint)) / 1e-3;
            speed = speed.max(rate.abs() * file.frequency_hz / limit.velocity);
            outside = outside.max(limit.lower - q).max(q - limit.upper);
        }
    }
    (speed, outside)
}

/// Goal in the root link's frame of every foot at a pose.
pub fn foot_points(robot: &Robot, pose: &[f64]) -> Vec<Point3<f64>> {
    robot
        .legs
        .iter()
        .map(|l| l.foot_position(&robot.model, pose))
        .collect()
}
