//! Which way a robot faces: from the axes of its root link to x forward, y left, z up.

use super::Leg;
use crate::robot::model::RobotModel;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Names of axes, as in `--forward` and `--up`.
pub const AXES: [(&str, [f64; 3]); 6] = [
    ("x", [1.0, 0.0, 0.0]),
    ("-x", [-1.0, 0.0, 0.0]),
    ("y", [0.0, 1.0, 0.0]),
    ("-y", [0.0, -1.0, 0.0]),
    ("z", [0.0, 0.0, 1.0]),
    ("-z", [0.0, 0.0, -1.0]),
];

/// Forward and up of a robot, as axes of its root link.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Facing {
    forward: usize,
    up: usize,
}

impl Default for Facing {
    fn default() -> Self {
        Self { forward: 0, up: 4 }
    }
}

impl Facing {
    /// From axis names; `None` unless both are known and at right angles.
    pub fn named(forward: &str, up: &str) -> Option<Self> {
        let find = |name: &str| AXES.iter().position(|(n, _)| *n == name);
        let (forward, up) = (find(forward)?, find(up)?);
        (forward / 2 != up / 2).then_some(Self { forward, up })
    }

    /// Name of the forward axis.
    pub fn forward(&self) -> &'static str {
        AXES[self.forward].0
    }

    /// Name of the up axis.
    pub fn up(&self) -> &'static str {
        AXES[self.up].0
    }

    /// Turns vectors of the root link into x forward, y left, z up.
    pub fn rotation(&self) -> UnitQuaternion<f64> {
        let forward = Vector3::from(AXES[self.forward].1);
        let up = Vector3::from(AXES[self.up].1);
        let rows = Matrix3::from_columns(&[forward, up.cross(&forward), up]).transpose();
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows))
    }

    /// Reads it off the legs.
    ///
    /// Up is the axis along which the hips spread least, away from the feet. Forward is the axis that
    /// the hips swing about (abduction), or along which they spread most (legs that sprawl); its sense
    /// follows from names such as `FL`, `rear_left`, `RF_HIP`, and is positive where names do not tell.
    pub(super) fn of_legs(model: &RobotModel, legs: &[Leg]) -> Self {
        let count = legs.len().max(1) as f64;
        let rests: Vec<[f64; 3]> = legs.iter().map(|l| l.chain.rest()).collect();
        let hips: Vec<Vector3<f64>> = legs
            .iter()
            .zip(&rests)
            .map(|(l, q)| l.chain.joint_frame(0, q).translation.vector)
            .collect();
        let middle = hips.iter().sum::<Vector3<f64>>() / count;
        let spread = hips
            .iter()
            .map(|h| (h - middle).map(|v| v * v))
            .sum::<Vector3<f64>>();
        let below = legs
            .iter()
            .zip(&rests)
            .map(|(l, q)| l.chain.foot(q).coords - middle)
            .sum::<Vector3<f64>>()
            / count;
        let up = spread.imin();
        // Feet at rest may lie level with the body; then up is positive.
        let up_sign = if below[up] > 0.02 { -1.0 } else { 1.0 };
        let swing = legs
            .iter()
            .zip(&rests)
            .filter_map(|(l, q)| {
                let step = l.chain.steps.first()?;
                Some((l.chain.joint_frame(0, q).rotation * step.axis.into_inner()).map(f64::abs))
            })
            .sum::<Vector3<f64>>();
        let mut by = if swing[up] > 0.7 * count {
            spread
        } else {
            swing
        };
        by[up] = -1.0;
        let forward = by.imax();
        let vote: f64 = legs
            .iter()
            .zip(&hips)
            .map(|(l, h)| f64::from(named_end(model, l)) * (h[forward] - middle[forward]))
            .sum();
        let index = |axis: usize, sign: f64| 2 * axis + usize::from(sign < 0.0);
        Self {
            forward: index(forward, if vote < -1e-9 { -1.0 } else { 1.0 }),
            up: index(up, up_sign),
        }
    }
}

/// +1 for a leg whose names say front, -1 for rear, 0 when they do not say.
fn named_end(model: &RobotModel, leg: &Leg) -> i8 {
    let hip = &model.joints[model.actuated[leg.joints[0]]];
    for name in [&model.links[leg.foot], &hip.name, &model.links[hip.child]] {
        let name = name.to_lowercase();
        let token = |known: &[&str]| {
            name.split(|c: char| !c.is_ascii_alphanumeric())
                .any(|t| known.contains(&t))
        };
        if name.contains("front") || token(&["fl", "fr", "lf", "rf"]) {
            return 1;
        }
        let rear = ["rl", "rr", "hl", "hr", "lh", "rh", "lr", "bl", "br"];
        if ["rear", "hind", "back"].iter().any(|w| name.contains(w)) || token(&rear) {
            return -1;
        }
    }
    0
}
