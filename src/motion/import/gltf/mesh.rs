//! The skinned meshes of a glTF file as one surface on the skeleton.

use super::super::error::ImportFault;
use super::buffers::Buffers;
use super::tree::{Joints, Nodes};
use crate::body::{Influence, Skeleton, SkinBone, SkinnedMesh};
use gltf::Semantic;
use gltf::mesh::Mode;
use nalgebra::{Matrix4, Point3};

/// Vertices a surface may have.
const MAX_VERTICES: usize = 10_000_000;

/// What is gathered over all primitives.
#[derive(Default)]
struct Surface {
    positions: Vec<Point3<f64>>,
    triangles: Vec<[u32; 3]>,
    bones: Vec<SkinBone>,
    influences: Vec<[Influence; 4]>,
}

/// From the file's axes and unit to ours.
struct Scale {
    turn: Matrix4<f64>,
    unit_m: f64,
}

/// Reads the surface; `None` where no mesh has a skin.
pub(super) fn read(
    document: &gltf::Document,
    buffers: &Buffers,
    nodes: &Nodes,
    joints: &Joints,
    skeleton: &Skeleton,
    warnings: &mut Vec<String>,
) -> Result<Option<SkinnedMesh>, ImportFault> {
    let scale = Scale {
        turn: nalgebra::UnitQuaternion::new_normalize(skeleton.axes.into()).to_homogeneous(),
        unit_m: skeleton.unit_m,
    };
    let mut surface = Surface::default();
    let (mut skipped, mut fifth) = (0, 0);
    for node in document.nodes() {
        let (Some(mesh), Some(skin)) = (node.mesh(), node.skin()) else {
            continue;
        };
        let first_bone = surface.bones.len();
        surface
            .bones
            .extend(bones(&skin, buffers, nodes, joints, &scale)?);
        for primitive in mesh.primitives() {
            if primitive.mode() != Mode::Triangles {
                skipped += 1;
                continue;
            }
            fifth += surface.add(&primitive, buffers, first_bone, &scale)?;
        }
    }
    if skipped > 0 {
        warnings.push(format!(
            "{skipped} primitives that are no triangles were left out"
        ));
    }
    if fifth > 0 {
        warnings.push(format!(
            "{fifth} vertices have more than four bones; the four strongest were kept"
        ));
    }
    if surface.positions.is_empty() {
        return Ok(None);
    }
    surface.mind_folded(joints, document, nodes, warnings);
    let Surface {
        positions,
        triangles,
        bones,
        influences,
    } = surface;
    let mesh = SkinnedMesh::new(skeleton, positions, triangles, bones, influences)?;
    Ok(Some(mesh))
}

/// The bones of a skin, in the order of its joints.
fn bones(
    skin: &gltf::Skin<'_>,
    buffers: &Buffers,
    nodes: &Nodes,
    joints: &Joints,
    scale: &Scale,
) -> Result<Vec<SkinBone>, ImportFault> {
    let matrices = match skin.inverse_bind_matrices() {
        Some(accessor) => buffers.numbers(&accessor, 16)?,
        None => Vec::new(),
    };
    let world = |node: usize| nodes.world(node, |n| nodes.rest[n]);
    let root = world(joints.nodes[0]);
    let mut bones = Vec::new();
    for (i, joint) in skin.joints().enumerate() {
        let mut bind = match matrices.get(16 * i..16 * i + 16) {
            Some(m) => Matrix4::from_column_slice(m),
            None if matrices.is_empty() => Matrix4::identity(),
            None => {
                return Err(ImportFault::element(
                    format!("skin {}", skin.index()),
                    format!("{} inverse bind matrices", matrices.len() / 16),
                    "one for each joint",
                ));
            }
        };
        let index = match joints.of_node(joint.index()) {
            Some(index) => index,
            None => {
                // Folded into the root: what hangs on it follows the root, from where both rest.
                let to_root = root
                    .matrix()
                    .try_inverse()
                    .unwrap_or_else(Matrix4::identity);
                bind = to_root * world(joint.index()).matrix() * bind;
                0
            }
        };
        // In the file v' = T R s B v; ours has frames without scale, in metres: the scale and the unit
        // go into the bind matrix, and the turn of the axes out of the reference surface.
        let metres = Matrix4::new_scaling(scale.unit_m * root.scale);
        let back = scale.turn.transpose() * Matrix4::new_scaling(1.0 / scale.unit_m);
        bones.push(SkinBone {
            joint: index,
            inverse_bind: metres * bind * back,
        });
    }
    Ok(bones)
}

impl Surface {
    /// Adds a primitive; returns how many of its vertices had to lose bones.
    fn add(
        &mut self,
        primitive: &gltf::Primitive<'_>,
        buffers: &Buffers,
        first_bone: usize,
        scale: &Scale,
    ) -> Result<usize, ImportFault> {
        let place = format!("primitive {}", primitive.index());
        let get = |semantic: Semantic, width: usize| match primitive.get(&semantic) {
            Some(accessor) => buffers.numbers(&accessor, width),
            None => Ok(Vec::new()),
        };
        let first = self.positions.len();
        let positions = get(Semantic::Positions, 3)?;
        let vertices = positions.len() / 3;
        if first + vertices > MAX_VERTICES {
            return Err(ImportFault::element(
                place,
                format!("over {MAX_VERTICES} vertices"),
                "a lighter mesh",
            ));
        }
        for p in positions.chunks_exact(3) {
            let p = Point3::new(p[0], p[1], p[2]) * scale.unit_m;
            self.positions.push(scale.turn.transform_point(&p));
        }
        let mut sets = Vec::new();
        for set in 0..2 {
            let (bones, weights) = (
                get(Semantic::Joints(set), 4)?,
                get(Semantic::Weights(set), 4)?,
            );
            let count = |list: &[f64]| list.len() / 4;
            if set == 0 || !bones.is_empty() {
                if count(&bones) != vertices || count(&weights) != vertices {
                    return Err(ImportFault::element(
                        place,
                        format!(
                            "{} joints and {} weights for {vertices} vertices (set {set})",
                            count(&bones),
                            count(&weights)
                        ),
                        "JOINTS and WEIGHTS for each vertex",
                    ));
                }
                sets.push((bones, weights));
            }
        }
        let mut reduced = 0;
        for v in 0..vertices {
            let mut all: Vec<Influence> = (sets.iter())
                .flat_map(|(bones, weights)| {
                    (4 * v..4 * v + 4).map(|at| Influence {
                        bone: (first_bone as f64 + bones[at]).min(f64::from(u16::MAX)) as u16,
                        weight: weights[at],
                    })
                })
                .collect();
            all.sort_by(|a, b| b.weight.total_cmp(&a.weight));
            reduced += usize::from(all.get(4).is_some_and(|i| i.weight > 1e-3));
            self.influences.push([all[0], all[1], all[2], all[3]]);
        }
        let corners: Vec<u32> = match primitive.indices() {
            Some(accessor) => (buffers.numbers(&accessor, 1)?.iter())
                .map(|i| (first as f64 + i).min(f64::from(u32::MAX)) as u32)
                .collect(),
            None => (first..first + vertices).map(|v| v as u32).collect(),
        };
        let triangles = corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]);
        self.triangles.extend(triangles);
        Ok(reduced)
    }

    /// Says so where a part of the surface hangs on a joint that was folded into the root.
    fn mind_folded(
        &self,
        joints: &Joints,
        document: &gltf::Document,
        nodes: &Nodes,
        warnings: &mut Vec<String>,
    ) {
        let skinned = document.nodes().filter(|n| n.mesh().is_some());
        let of_bones: Vec<usize> = skinned
            .filter_map(|n| n.skin())
            .flat_map(|s| s.joints().map(|j| j.index()).collect::<Vec<_>>())
            .collect();
        let hangs = |i: &Influence| {
            i.weight > 1e-3
                && of_bones
                    .get(usize::from(i.bone))
                    .is_some_and(|n| joints.folded.contains(n))
        };
        let count = self
            .influences
            .iter()
            .filter(|set| set.iter().any(hangs))
            .count();
        if count > 0 {
            let names: Vec<&str> = (joints.folded.iter())
                .map(|n| nodes.names[*n].as_str())
                .collect();
            warnings.push(format!(
                "{count} vertices hang on {}, which never move; they follow the root instead",
                names.join(", ")
            ));
        }
    }
}
