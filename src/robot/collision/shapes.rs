//! Shapes from the URDF's `<collision>` elements, for the collision crate.

use super::{CollisionError, KeepOut, Owner, Part};
use crate::robot::model::RobotModel;
use crate::robot::tip;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use parry3d_f64::math::{Pose, Rotation, Vector};
use parry3d_f64::query::{self, details};
use parry3d_f64::shape::{Ball, Capsule, Cuboid, Cylinder, Shape};
use std::f64::consts::FRAC_PI_2;
use std::fmt;
use std::path::Path;
use urdf_rs::Geometry;

/// A convex shape.
pub(super) enum Solid {
    Ball(Ball),
    Cuboid(Cuboid),
    Capsule(Capsule),
    Cylinder(Cylinder),
}

impl Solid {
    fn shape(&self) -> &dyn Shape {
        match self {
            Solid::Ball(ball) => ball,
            Solid::Cuboid(cuboid) => cuboid,
            Solid::Capsule(capsule) => capsule,
            Solid::Cylinder(cylinder) => cylinder,
        }
    }

    /// Distance from this one at `here` to `other` at `there`; 0 when they overlap.
    ///
    /// By GJK. The crate's own way for two boxes is not taken: it begins at one corner, and where edges are nearly
    /// parallel its answer is some millimetres too long.
    pub(super) fn distance(&self, here: &Pose, other: &Solid, there: &Pose) -> f64 {
        match (self, other) {
            (Solid::Cuboid(a), Solid::Cuboid(b)) => {
                details::distance_support_map_support_map(&here.inv_mul(there), a, b)
            }
            // The crate knows all of these, so it has an answer. None would count as a touch.
            _ => query::distance(here, self.shape(), there, other.shape())
                .map_or(0.0, |found| found.distance),
        }
    }

    /// Radius of the ball about its origin that it fits into.
    pub(super) fn radius(&self) -> f64 {
        match self {
            Solid::Ball(ball) => ball.radius,
            Solid::Cuboid(cuboid) => cuboid.half_extents.length(),
            Solid::Capsule(capsule) => capsule.half_height() + capsule.radius,
            Solid::Cylinder(cylinder) => cylinder.half_height.hypot(cylinder.radius),
        }
    }
}

impl fmt::Debug for Solid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, radius) = match self {
            Solid::Ball(_) => ("ball", self.radius()),
            Solid::Cuboid(_) => ("box", self.radius()),
            Solid::Capsule(_) => ("capsule", self.radius()),
            Solid::Cylinder(_) => ("cylinder", self.radius()),
        };
        write!(f, "{name} within {radius} m")
    }
}

/// A pose in the types of the collision crate.
pub(super) fn pose(pose: &Isometry3<f64>) -> Pose {
    let (at, turn) = (&pose.translation.vector, &pose.rotation.coords);
    Pose::from_parts(
        Vector::new(at.x, at.y, at.z),
        Rotation::from_xyzw(turn.x, turn.y, turn.z, turn.w),
    )
}

fn cuboid(size: Vector3<f64>) -> Option<Solid> {
    let half = 0.5 * size;
    half.iter()
        .all(|v| v.is_finite() && *v > 0.0)
        .then(|| Solid::Cuboid(Cuboid::new(Vector::new(half.x, half.y, half.z))))
}

/// The shapes of all links of `model`, whose text is `urdf`.
pub(super) fn of_links(
    model: &RobotModel,
    urdf: &str,
    folder: Option<&Path>,
    notes: &mut Vec<String>,
) -> Result<Vec<Part>, CollisionError> {
    let urdf = urdf_rs::read_from_string(urdf).map_err(|e| CollisionError::Urdf(e.to_string()))?;
    let mut parts = Vec::new();
    for description in &urdf.links {
        let Some(link) = model.link(&description.name) else {
            continue;
        };
        for collision in &description.collision {
            let [roll, pitch, yaw] = collision.origin.rpy.0;
            let mut place = Isometry3::from_parts(
                Translation3::from(Vector3::from(collision.origin.xyz.0)),
                UnitQuaternion::from_euler_angles(roll, pitch, yaw),
            );
            let positive = |values: &[f64]| values.iter().all(|v| v.is_finite() && *v > 0.0);
            let (solid, shape) = match &collision.geometry {
                Geometry::Box { size } => (cuboid(Vector3::from(size.0)), "box"),
                Geometry::Sphere { radius } => {
                    let ball = positive(&[*radius]).then(|| Solid::Ball(Ball::new(*radius)));
                    (ball, "sphere")
                }
                Geometry::Cylinder { radius, length } => {
                    // A URDF's cylinder lies along z, the crate's along y.
                    place.rotation *=
                        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
                    let cylinder = positive(&[*radius, *length])
                        .then(|| Solid::Cylinder(Cylinder::new(0.5 * length, *radius)));
                    (cylinder, "cylinder")
                }
                Geometry::Capsule { radius, length } => {
                    let capsule = positive(&[*radius, *length])
                        .then(|| Solid::Capsule(Capsule::new_z(0.5 * length, *radius)));
                    (capsule, "capsule")
                }
                Geometry::Mesh { filename, scale } => {
                    let scale = scale.map_or(Vector3::repeat(1.0), |s| Vector3::from(s.0));
                    let Some((centre, size)) = tip::mesh_box(folder, filename, &scale) else {
                        notes.push(format!(
                            "collision: link {} is the mesh {filename}, which cannot be read (binary STL beside the URDF); it is not looked at",
                            description.name
                        ));
                        continue;
                    };
                    notes.push(format!(
                        "collision: link {} is a mesh; the box around it stands for it",
                        description.name
                    ));
                    place *= Translation3::from(centre);
                    // A flat mesh has a thickness of its own: a tenth of a millimetre.
                    (cuboid(size.map(|v| v.max(1e-4))), "mesh")
                }
            };
            let finite = place.to_matrix().iter().all(|v| v.is_finite());
            let solid = solid
                .filter(|_| finite)
                .ok_or_else(|| CollisionError::Shape {
                    link: description.name.clone(),
                    shape,
                })?;
            parts.push(Part {
                owner: Owner::Link(link),
                solid,
                place,
            });
        }
    }
    Ok(parts)
}

/// Keep-out box number `index`.
pub(super) fn of_keep_out(index: usize, keep_out: &KeepOut) -> Result<Part, CollisionError> {
    let solid =
        cuboid(keep_out.greatest - keep_out.least).ok_or_else(|| CollisionError::KeepOut {
            index: index + 1,
            least: keep_out.least.coords.into(),
            greatest: keep_out.greatest.coords.into(),
        })?;
    let centre = nalgebra::center(&keep_out.least, &keep_out.greatest);
    Ok(Part {
        owner: Owner::KeepOut(index),
        solid,
        place: Isometry3::from_parts(centre.coords.into(), UnitQuaternion::identity()),
    })
}
