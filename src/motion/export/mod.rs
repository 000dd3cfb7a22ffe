//! Takes as files of other programs: BVH, CSV, glTF.
//!
//! What [`super::import`] reads comes back as it was: axes and unit of a skeleton's own file in BVH,
//! metres and our axes in CSV, metres and y up (as its standard says) in glTF.

mod bvh;
mod csv;
mod gltf;

pub use bvh::to_bvh;
pub use csv::to_csv;
pub use gltf::{GltfScene, robot_to_gltf, skeleton_to_gltf};

use super::take::Take;
use crate::body::{RootPose, Skeleton};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

/// Why a take cannot be written.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum ExportError {
    /// Another body than the format can hold.
    #[error("{take}: {found} cannot be written as {format}; {allowed}")]
    Body {
        /// Name of the take.
        take: String,
        /// What body it has.
        found: &'static str,
        /// The format.
        format: &'static str,
        /// What can be done.
        allowed: &'static str,
    },
    /// A joint or bone that the other part lacks.
    #[error("{take}: {found}; {allowed}")]
    Joint {
        /// Name of the take.
        take: String,
        /// What is missing.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// No frame.
    #[error("{0}: no frame to write")]
    Empty(String),
}

/// The root joint's frame in the world.
fn root_in_world(pose: &[f64], root: &RootPose) -> Isometry3<f64> {
    let place = root.to_world(Point3::new(pose[0], pose[1], pose[2]));
    let heading = UnitQuaternion::from_scaled_axis(Vector3::z() * root.yaw_rad);
    Isometry3::from_parts(
        Translation3::from(place.coords),
        heading * Skeleton::rotation(pose, 0),
    )
}

/// The root link of a robot in the world, from the six coordinates of its body.
fn body_in_world(body: &[f64], root: &RootPose) -> (Point3<f64>, [f64; 3]) {
    let place = root.to_world(Point3::new(body[0], body[1], body[2]));
    (place, [body[3], body[4], root.yaw_rad + body[5]])
}

/// An error for a take without a frame.
fn check_frames(take: &Take) -> Result<(), ExportError> {
    if take.is_empty() {
        return Err(ExportError::Empty(take.name.clone()));
    }
    Ok(())
}
