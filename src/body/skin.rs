//! A skinned mesh: a surface that follows the joints of a skeleton, by linear blend skinning.

use super::Skeleton;
use nalgebra::{Isometry3, Matrix4, Point3, Vector3};

/// What part of a skin one joint carries.
#[derive(Clone, Debug, PartialEq)]
pub struct SkinBone {
    /// Joint of the skeleton.
    pub joint: usize,
    /// From the reference surface, in metres and our axes, into the joint's frame; affine.
    pub inverse_bind: Matrix4<f64>,
}

/// Triangles whose corners follow up to four bones each.
///
/// `v' = sum_b w_b X_joint(b) B_b v`, with `X` the frame of a joint and `B` the bone's inverse bind
/// matrix (representations, section 3). Where every joint stands as it was bound, `v' = v`.
#[derive(Clone, Debug, PartialEq)]
pub struct SkinnedMesh {
    positions: Vec<Point3<f64>>,
    triangles: Vec<[u32; 3]>,
    bones: Vec<SkinBone>,
    influences: Vec<[Influence; 4]>,
}

/// How much of a vertex one bone carries.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Influence {
    /// Index of the bone.
    pub bone: u16,
    /// 0..1; those of a vertex sum to one.
    pub weight: f64,
}

/// Why a surface cannot be skinned.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum SkinError {
    /// Lists of different lengths.
    #[error("{found} influences for {vertices} vertices; one set of four for each is needed")]
    Count {
        /// Sets of influences.
        found: usize,
        /// Vertices.
        vertices: usize,
    },
    /// A vertex that cannot be used.
    #[error("vertex {vertex}: {problem}")]
    Vertex {
        /// Its index.
        vertex: usize,
        /// What was found and what is allowed.
        problem: String,
    },
    /// A triangle or bone that points nowhere.
    #[error("{what} {index}: {found} is not one of {count}")]
    Index {
        /// `triangle` or `bone`.
        what: &'static str,
        /// Which one.
        index: usize,
        /// What it refers to.
        found: usize,
        /// How many there are.
        count: usize,
    },
}

impl SkinnedMesh {
    /// A checked mesh on `skeleton`; the weights of each vertex are scaled to a sum of one.
    ///
    /// # Errors
    /// Lists of different lengths, indices out of range, numbers that are not finite, negative
    /// weights, a vertex without any weight.
    pub fn new(
        skeleton: &Skeleton,
        positions: Vec<Point3<f64>>,
        triangles: Vec<[u32; 3]>,
        bones: Vec<SkinBone>,
        mut influences: Vec<[Influence; 4]>,
    ) -> Result<Self, SkinError> {
        let vertices = positions.len();
        if influences.len() != vertices {
            return Err(SkinError::Count {
                found: influences.len(),
                vertices,
            });
        }
        let index = |what, index, found, count| SkinError::Index {
            what,
            index,
            found,
            count,
        };
        for (i, triangle) in triangles.iter().enumerate() {
            if let Some(v) = triangle.iter().find(|v| **v as usize >= vertices) {
                return Err(index("triangle", i, *v as usize, vertices));
            }
        }
        for (i, bone) in bones.iter().enumerate() {
            if bone.joint >= skeleton.len() {
                return Err(index("bone", i, bone.joint, skeleton.len()));
            }
            if bone.inverse_bind.iter().any(|v| !v.is_finite()) {
                return Err(SkinError::Vertex {
                    vertex: 0,
                    problem: format!("the inverse bind matrix of bone {i} must be finite"),
                });
            }
        }
        for (vertex, set) in influences.iter_mut().enumerate() {
            let bad = |problem: String| Err(SkinError::Vertex { vertex, problem });
            let place = &positions[vertex];
            if place.iter().any(|v| !v.is_finite()) {
                return bad(format!("its place {:?} must be finite", place.coords));
            }
            if let Some(i) = set.iter().find(|i| !(i.weight >= 0.0 && i.weight < 1e6)) {
                return bad(format!("weight {} must not be negative", i.weight));
            }
            let sum: f64 = set.iter().map(|i| i.weight).sum();
            if !(sum > 1e-9) {
                return bad("no bone carries it; its weights must sum to one".into());
            }
            for influence in set.iter_mut() {
                influence.weight /= sum;
                let bone = usize::from(influence.bone);
                if influence.weight == 0.0 {
                    influence.bone = 0;
                } else if bone >= bones.len() {
                    return Err(index("bone of vertex", vertex, bone, bones.len()));
                }
            }
        }
        Ok(Self {
            positions,
            triangles,
            bones,
            influences,
        })
    }

    /// The reference surface, metres, our axes.
    pub fn positions(&self) -> &[Point3<f64>] {
        &self.positions
    }

    /// Corners of each triangle, counter-clockwise seen from outside.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The bones.
    pub fn bones(&self) -> &[SkinBone] {
        &self.bones
    }

    /// The four influences of each vertex.
    pub fn influences(&self) -> &[[Influence; 4]] {
        &self.influences
    }

    /// Writes the matrix of every bone to `out` (one per bone), from the frames of the joints
    /// ([`Skeleton::frames`]). Allocates nothing.
    pub fn bone_matrices(&self, frames: &[Isometry3<f64>], out: &mut [Matrix4<f64>]) {
        for (out, bone) in out.iter_mut().zip(&self.bones) {
            *out = frames[bone.joint].to_homogeneous() * bone.inverse_bind;
        }
    }

    /// Writes the place of every vertex to `out` (one per vertex), metres, from the matrices of
    /// [`SkinnedMesh::bone_matrices`]. Allocates nothing.
    pub fn deform(&self, matrices: &[Matrix4<f64>], out: &mut [Point3<f64>]) {
        let vertices = self.positions.iter().zip(&self.influences);
        for (out, (place, set)) in out.iter_mut().zip(vertices) {
            let mut sum = Vector3::zeros();
            for influence in set {
                if influence.weight == 0.0 {
                    continue;
                }
                let m = &matrices[usize::from(influence.bone)];
                let moved = m.fixed_view::<3, 3>(0, 0) * place.coords
                    + m.fixed_view::<3, 1>(0, 3).into_owned();
                sum += influence.weight * moved;
            }
            *out = Point3::from(sum);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::SkeletonJoint;
    use nalgebra::UnitQuaternion;

    fn arm() -> Skeleton {
        let joint = |name: &str, parent, x: f64| SkeletonJoint {
            name: name.into(),
            parent,
            offset_m: [x, 0.0, 0.0],
            rest: [0.0, 0.0, 0.0, 1.0],
        };
        let joints = vec![joint("shoulder", None, 0.0), joint("elbow", Some(0), 1.0)];
        Skeleton::new(joints, UnitQuaternion::identity(), 1.0).expect("a good skeleton")
    }

    fn mesh(weights: [[f64; 2]; 2]) -> Result<SkinnedMesh, SkinError> {
        let bone = |joint, x: f64| SkinBone {
            joint,
            inverse_bind: Matrix4::new_translation(&Vector3::new(-x, 0.0, 0.0)),
        };
        let influence = |bone, weight| Influence { bone, weight };
        let none = Influence::default();
        SkinnedMesh::new(
            &arm(),
            vec![Point3::new(0.5, 0.1, 0.0), Point3::new(2.0, 0.0, 0.0)],
            vec![[0, 1, 0]],
            vec![bone(0, 0.0), bone(1, 1.0)],
            weights
                .map(|[a, b]| [influence(0, a), influence(1, b), none, none])
                .to_vec(),
        )
    }

    fn places(mesh: &SkinnedMesh, pose: &[f64]) -> Vec<Point3<f64>> {
        let mut frames = vec![Isometry3::identity(); 2];
        arm().frames(pose, &mut frames);
        let mut matrices = vec![Matrix4::zeros(); 2];
        mesh.bone_matrices(&frames, &mut matrices);
        let mut out = vec![Point3::origin(); 2];
        mesh.deform(&matrices, &mut out);
        out
    }

    #[test]
    fn vertices_without_a_bone_and_bones_that_are_not_there_are_named() {
        let message = mesh([[1.0, 0.0], [0.0, 0.0]])
            .expect_err("no weight")
            .to_string();
        assert!(message.starts_with("vertex 1: no bone"), "{message}");
        let message = mesh([[f64::NAN, 0.0], [0.0, 1.0]])
            .expect_err("not a number")
            .to_string();
        assert!(message.contains("vertex 0: weight NaN"), "{message}");
        let mut bad = mesh([[1.0, 0.0], [0.0, 1.0]]).expect("good");
        bad.influences[1][0] = Influence {
            bone: 7,
            weight: 1.0,
        };
        let message = SkinnedMesh::new(
            &arm(),
            bad.positions,
            bad.triangles,
            bad.bones,
            bad.influences,
        )
        .expect_err("no bone 7")
        .to_string();
        assert!(message.contains("7 is not one of 2"), "{message}");
    }

    #[test]
    fn the_bound_pose_gives_the_reference_and_a_bent_elbow_carries_the_hand() {
        // Weights of sum two are scaled to one.
        let mesh = mesh([[2.0, 0.0], [0.0, 1.0]]).expect("good");
        let mut pose = arm().rest_pose([0.0; 3]);
        let off = (places(&mesh, &pose).iter().zip(mesh.positions()))
            .map(|(a, b)| (a - b).norm())
            .fold(0.0, f64::max);
        assert!(off < 1e-12, "{off} m off the reference");
        let bend = UnitQuaternion::from_scaled_axis(Vector3::z() * std::f64::consts::FRAC_PI_2);
        Skeleton::set_rotation(&mut pose, 1, &bend);
        let bent = places(&mesh, &pose);
        let hand = (bent[1] - Point3::new(1.0, 1.0, 0.0)).norm();
        let arm = (bent[0] - mesh.positions()[0]).norm();
        assert!(
            hand < 1e-12 && arm < 1e-12,
            "hand {hand} m, upper arm {arm} m off"
        );
    }
}
