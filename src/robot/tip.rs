//! Where a link ends: the far point of its shape, for feet that have no link of their own.

use super::model::RobotModel;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};
use urdf_rs::Geometry;

/// A mesh that a link is made of.
#[derive(Clone, Debug)]
pub(super) struct MeshShape {
    link: usize,
    file: String,
    place: Isometry3<f64>,
    scale: Vector3<f64>,
}

/// Far ends of the plain shapes per link, and the meshes of links that have no plain shape.
pub(super) fn shapes(urdf: &urdf_rs::Robot) -> (Vec<Option<Point3<f64>>>, Vec<MeshShape>) {
    let mut tips = Vec::new();
    let mut meshes = Vec::new();
    for (link, description) in urdf.links.iter().enumerate() {
        let collision = description.collision.iter();
        let visual = description.visual.iter();
        let parts: Vec<(&urdf_rs::Pose, &Geometry)> = collision
            .map(|c| (&c.origin, &c.geometry))
            .chain(visual.map(|v| (&v.origin, &v.geometry)))
            .collect();
        let mut tip: Option<Point3<f64>> = None;
        for (origin, geometry) in parts {
            let [roll, pitch, yaw] = origin.rpy.0;
            let place = Isometry3::from_parts(
                Translation3::from(Vector3::from(origin.xyz.0)),
                UnitQuaternion::from_euler_angles(roll, pitch, yaw),
            );
            let mut see = |point: Vector3<f64>| {
                let point = place * Point3::from(point);
                if tip.is_none_or(|t| t.coords.norm() < point.coords.norm()) {
                    tip = Some(point);
                }
            };
            match geometry {
                Geometry::Box { size } => {
                    for corner in 0..8 {
                        let sign = |bit: usize| if corner & bit == 0 { -0.5 } else { 0.5 };
                        see(Vector3::new(
                            sign(1) * size.0[0],
                            sign(2) * size.0[1],
                            sign(4) * size.0[2],
                        ));
                    }
                }
                Geometry::Cylinder { length, .. } | Geometry::Capsule { length, .. } => {
                    see(Vector3::z() * (0.5 * length));
                    see(Vector3::z() * (-0.5 * length));
                }
                Geometry::Sphere { .. } => see(Vector3::zeros()),
                Geometry::Mesh { filename, scale } => meshes.push(MeshShape {
                    link,
                    file: filename.clone(),
                    place,
                    scale: scale.map_or(Vector3::repeat(1.0), |s| Vector3::from(s.0)),
                }),
            }
        }
        tips.push(tip.filter(|t| t.coords.iter().all(|v| v.is_finite())));
    }
    (tips, meshes)
}

impl RobotModel {
    /// Reads the far ends of links that have only meshes, from binary STL files that can be found from
    /// `folder` (that of the URDF): `package://NAME/a/b.stl` is looked for as `a/b.stl` and `NAME/a/b.stl` in
    /// the folder and the two above it. What is not found is left out.
    pub fn read_mesh_tips(&mut self, folder: &Path) {
        for mesh in &self.meshes {
            if self.tips[mesh.link].is_some() {
                continue;
            }
            let Some(bytes) = find(folder, &mesh.file).and_then(|p| std::fs::read(p).ok()) else {
                continue;
            };
            self.tips[mesh.link] = stl_points(&bytes)
                .map(|p| mesh.place * Point3::from(p.component_mul(&mesh.scale)))
                .filter(|p| p.coords.iter().all(|v| v.is_finite()))
                .max_by(|a, b| a.coords.norm().total_cmp(&b.coords.norm()));
        }
    }
}

fn find(folder: &Path, file: &str) -> Option<PathBuf> {
    let name = file.split_once("://").map_or(file, |(_, rest)| rest);
    let inside = name.split_once('/').map_or(name, |(_, rest)| rest);
    folder
        .ancestors()
        .take(3)
        .flat_map(|f| [f.join(name), f.join(inside)])
        .find(|p| p.is_file())
}

/// Corners of a binary STL: 80 bytes, the count, then 50 bytes per triangle (normal, three corners,
/// two bytes). Nothing from a file that is not one.
fn stl_points(bytes: &[u8]) -> impl Iterator<Item = Vector3<f64>> + '_ {
    let count = bytes
        .get(80..84)
        .and_then(|b| b.try_into().ok())
        .map_or(0, u32::from_le_bytes) as usize;
    let whole = bytes.len() >= 84 && (bytes.len() - 84) / 50 >= count;
    let body = if whole {
        &bytes[84..84 + 50 * count]
    } else {
        &[]
    };
    body.chunks_exact(50)
        .flat_map(|triangle| {
            (0..3).map(move |corner| {
                let value = |axis: usize| {
                    let at = 12 + 12 * corner + 4 * axis;
                    let b = &triangle[at..at + 4];
                    f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                };
                Vector3::new(value(0), value(1), value(2))
            })
        })
        .filter(|p| p.iter().all(|v| v.is_finite()))
}

/// Centre and size of the box around a mesh, in the mesh's frame, scaled; `None` when the file is not found from
/// `folder` or is no binary STL.
#[cfg(feature = "collision")]
pub(super) fn mesh_box(
    folder: Option<&Path>,
    file: &str,
    scale: &Vector3<f64>,
) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let bytes = std::fs::read(find(folder?, file)?).ok()?;
    let mut corners: Option<(Vector3<f64>, Vector3<f64>)> = None;
    for point in stl_points(&bytes) {
        let point = point.component_mul(scale);
        let (least, greatest) = corners.get_or_insert((point, point));
        *least = least.inf(&point);
        *greatest = greatest.sup(&point);
    }
    let (least, greatest) = corners?;
    Some((0.5 * (least + greatest), greatest - least))
}
