//! Left and right exchanged: mirroring poses and takes in the plane y = 0, and how symmetric a motion is.

use super::{AnalysisError, BodyModel, Cycle};
use crate::base::random::SplitMix;
use crate::body::{PoseSpace, RootPose, Skeleton, mirrored};
use crate::motion::take::{Take, TakeBody};
use crate::robot::{Leg, RobotModel};
use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};
use std::sync::Arc;

/// How poses of a body are mirrored.
#[derive(Clone, Debug)]
pub struct Mirror {
    /// For each joint its partner on the other side, itself in the middle.
    pub partners: Vec<usize>,
    joints: Joints,
}

#[derive(Clone, Debug)]
enum Joints {
    /// Sign of each joint.
    Robot { signs: Vec<f64>, floating: bool },
    /// Of each joint the reflection from its partner's frame into its own.
    Skeleton {
        skeleton: Arc<Skeleton>,
        reflections: Vec<Matrix3<f64>>,
    },
}

/// Feet of a mirrored pose are at most this far from the mirrored feet, as a share of the leg.
const SAME_PLACE: f64 = 0.02;
/// A frame this near an axis frame is one: cosine of 15 degrees.
const NEAR_AXIS: f64 = 0.966;

impl Mirror {
    /// The mirror of `take`'s body. Partners are found by name.
    ///
    /// A skeleton's joints may have any axes: how those of the left lie to those of the right is found
    /// from the mean pose of the take, which should be a whole number of cycles, or at rest. A robot needs
    /// its model: which joints change sign is found by forward kinematics, so that mirrored feet are
    /// mirrored.
    ///
    /// # Errors
    /// A robot without model, or whose legs are no mirror images of each other.
    pub fn of(take: &Take, body: &BodyModel) -> Result<Self, AnalysisError> {
        let bad = |problem: &str| AnalysisError::Take {
            take: take.name.clone(),
            problem: problem.into(),
        };
        match &take.body {
            TakeBody::Skeleton(skeleton) => {
                let names: Vec<&str> = skeleton.joints.iter().map(|j| j.name.as_str()).collect();
                let mut partners = mirrored(&names);
                // Partners of another depth would break the tree.
                for i in 0..names.len() {
                    let parent = |j: usize| skeleton.joints[j].parent;
                    let fits = match (parent(i), parent(partners[i])) {
                        (Some(a), Some(b)) => partners[a] == b,
                        (a, b) => a == b,
                    };
                    if !fits {
                        partners[i] = i;
                    }
                }
                for i in 0..names.len() {
                    if partners[partners[i]] != i {
                        partners[i] = i;
                    }
                }
                let reflections = reflections(skeleton, &partners, &take.poses);
                Ok(Self {
                    partners,
                    joints: Joints::Skeleton {
                        skeleton: Arc::clone(skeleton),
                        reflections,
                    },
                })
            }
            TakeBody::Joints(names) | TakeBody::Floating(names) => {
                let model = body
                    .model()
                    .ok_or_else(|| bad("a robot is mirrored with its URDF only"))?;
                let partners = mirrored(names);
                let signs = signs(model, &partners).map_err(|p| bad(&p))?;
                Ok(Self {
                    partners,
                    joints: Joints::Robot {
                        signs,
                        floating: matches!(take.body, TakeBody::Floating(_)),
                    },
                })
            }
        }
    }

    /// The mirrored pose.
    pub fn pose(&self, pose: &[f64]) -> Vec<f64> {
        match &self.joints {
            Joints::Robot { signs, floating } => {
                let mut out = pose.to_vec();
                for (i, partner) in self.partners.iter().enumerate() {
                    out[i] = signs[i] * pose[*partner];
                }
                if *floating {
                    // Left, roll and yaw of the body change sign.
                    for i in [1, 3, 5] {
                        out[signs.len() + i] *= -1.0;
                    }
                }
                out
            }
            Joints::Skeleton {
                skeleton,
                reflections,
            } => {
                let mut frames = vec![Isometry3::identity(); skeleton.len()];
                skeleton.frames(pose, &mut frames);
                let mut out = pose.to_vec();
                out[1] = -pose[1];
                let mut world: Vec<UnitQuaternion<f64>> = Vec::with_capacity(skeleton.len());
                for (i, partner) in self.partners.iter().enumerate() {
                    let turned = side()
                        * frames[*partner].rotation.to_rotation_matrix().matrix()
                        * reflections[i].transpose();
                    let turned = rotation(turned);
                    let local = match skeleton.joints[i].parent {
                        Some(p) => world[p].inverse() * turned,
                        None => turned,
                    };
                    let before = Skeleton::rotation(pose, i);
                    // Next to the sign of its own past, so that takes stay continuous.
                    let local = if local.coords.dot(&before.coords) < 0.0 {
                        UnitQuaternion::new_unchecked(-local.into_inner())
                    } else {
                        local
                    };
                    Skeleton::set_rotation(&mut out, i, &local);
                    world.push(turned);
                }
                out
            }
        }
    }

    /// The mirrored take: what went left goes right.
    pub fn take(&self, take: &Take) -> Take {
        let mut poses: Vec<Vec<f64>> = take.poses.iter().map(|p| self.pose(p)).collect();
        if matches!(self.joints, Joints::Skeleton { .. }) {
            for k in 1..poses.len() {
                let (before, after) = poses.split_at_mut(k);
                let pairs = after[0][3..].chunks_exact_mut(4);
                for (q, last) in pairs.zip(before[k - 1][3..].chunks_exact(4)) {
                    if q.iter().zip(last).map(|(a, b)| a * b).sum::<f64>() < 0.0 {
                        q.iter_mut().for_each(|v| *v = -*v);
                    }
                }
            }
        }
        Take {
            poses,
            roots: (take.roots.iter())
                .map(|r| RootPose {
                    y_m: -r.y_m,
                    yaw_rad: -r.yaw_rad,
                    ..*r
                })
                .collect(),
            ..take.clone()
        }
    }
}

/// The reflection that exchanges left and right.
fn side() -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0))
}

fn rotation(matrix: Matrix3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix))
}

/// Reflections `L` with `W_i L = S W_j` in a symmetric pose: orthogonal, determinant -1, that of a
/// partner the transpose, that of a joint in the middle its own.
fn reflections(skeleton: &Skeleton, partners: &[usize], poses: &[Vec<f64>]) -> Vec<Matrix3<f64>> {
    let n = skeleton.len();
    let mut mean = vec![Matrix3::zeros(); n];
    let mut frames = vec![Isometry3::identity(); n];
    for pose in poses {
        skeleton.frames(pose, &mut frames);
        for (sum, frame) in mean.iter_mut().zip(&frames) {
            *sum += frame.rotation.to_rotation_matrix().matrix();
        }
    }
    let scale = poses.len().max(1) as f64;
    mean.iter_mut().for_each(|m| *m /= scale);
    let mut found = vec![Matrix3::identity(); n];
    for i in 0..n {
        let j = partners[i];
        if j < i {
            found[i] = found[j].transpose();
            continue;
        }
        // What the mean pose says, and what bones say that have a partner: their offsets are mirrored.
        let mut wanted = mean[i].transpose() * side() * mean[j];
        let bones: Vec<(Vector3<f64>, Vector3<f64>)> = (0..n)
            .filter(|c| skeleton.joints[*c].parent == Some(i))
            .map(|c| {
                let of = |c: usize| Vector3::from(skeleton.joints[c].offset_m);
                (of(c), of(partners[c]))
            })
            .filter(|(a, b)| a.norm() > 1e-6 && b.norm() > 1e-6)
            .collect();
        let longest = bones.iter().map(|(a, _)| a.norm()).fold(1e-9, f64::max);
        for (own, other) in &bones {
            wanted += 4.0 * own * other.transpose() / (longest * longest);
        }
        if i == j {
            wanted = 0.5 * (wanted + wanted.transpose());
        }
        found[i] = snapped(nearest_reflection(wanted, i == j), &bones, longest);
    }
    found
}

/// The reflection next to `wanted`; for a joint in the middle one that is its own inverse.
fn nearest_reflection(wanted: Matrix3<f64>, own: bool) -> Matrix3<f64> {
    if own {
        // The mirror plane's normal is the direction that `wanted` turns round the most.
        let eigen = wanted.symmetric_eigen();
        let normal = eigen
            .eigenvectors
            .column(eigen.eigenvalues.imin())
            .into_owned();
        return Matrix3::identity() - 2.0 * normal * normal.transpose();
    }
    let svd = wanted.svd(true, true);
    let (Some(u), Some(v)) = (svd.u, svd.v_t) else {
        return side();
    };
    let mut flip = Matrix3::identity();
    let weakest = svd.singular_values.imin();
    if (u * v).determinant() > 0.0 {
        flip[(weakest, weakest)] = -1.0;
    }
    u * flip * v
}

/// A reflection that nearly exchanges or turns round axes does so exactly, where the bones allow it.
fn snapped(
    found: Matrix3<f64>,
    bones: &[(Vector3<f64>, Vector3<f64>)],
    longest: f64,
) -> Matrix3<f64> {
    let axes = found.map(f64::round);
    let clean = axes * axes.transpose() == Matrix3::identity()
        && (0..3).all(|c| axes.column(c).dot(&found.column(c)) > NEAR_AXIS);
    let off = |l: &Matrix3<f64>| {
        (bones.iter())
            .map(|(own, other)| (own - l * other).norm())
            .fold(0.0, f64::max)
    };
    if clean && off(&axes) <= off(&found) + 0.05 * longest {
        axes
    } else {
        found
    }
}

/// Signs of a robot's joints. Legs: those with which a mirrored foot is where the mirrored leg's foot is;
/// other joints: by the direction of their axes at position zero.
fn signs(model: &RobotModel, partners: &[usize]) -> Result<Vec<f64>, String> {
    let zero = vec![0.0; model.actuated.len()];
    let axis = |j: usize| {
        let joint = &model.joints[model.actuated[j]];
        model.link_pose(joint.child, &zero).rotation * joint.axis.into_inner()
    };
    // A rotation's axis is mirrored as a pseudo-vector.
    let mut signs: Vec<f64> = (partners.iter().enumerate())
        .map(|(i, j)| {
            let other = axis(*j);
            let seen = Vector3::new(-other.x, other.y, -other.z);
            if axis(i).dot(&seen) < 0.0 { -1.0 } else { 1.0 }
        })
        .collect();
    let legs = Leg::find_all(model).unwrap_or_default();
    let mut random = SplitMix::new(1);
    for leg in &legs {
        let other = legs.iter().find(|l| {
            (leg.joints.iter().zip(l.joints)).all(|(i, j)| partners[*i] == j) && l.name != leg.name
        });
        let Some(other) = other else {
            return Err(format!("leg {} has no partner on the other side", leg.name));
        };
        let samples: Vec<Vec<f64>> = (0..6)
            .map(|_| zero.iter().map(|_| random.unit() - 0.5).collect())
            .collect();
        let off = |choice: [f64; 3]| -> f64 {
            (samples.iter())
                .map(|sample| {
                    let mut mirrored = zero.clone();
                    for (c, (i, j)) in leg.joints.iter().zip(other.joints).enumerate() {
                        mirrored[*i] = choice[c] * sample[j];
                    }
                    let mut seen = other.foot_position(model, sample);
                    seen.y = -seen.y;
                    (leg.foot_position(model, &mirrored) - seen).norm()
                })
                .fold(0.0, f64::max)
        };
        let choices =
            (0..8_u8).map(|bits| [0, 1, 2].map(|c| if bits >> c & 1 == 1 { -1.0 } else { 1.0 }));
        let best = choices.min_by(|a, b| off(*a).total_cmp(&off(*b)));
        let best = best.unwrap_or([1.0; 3]);
        if off(best) > SAME_PLACE * leg.length(model) {
            return Err(format!(
                "legs {} and {} are no mirror images: feet {:.0} mm apart",
                leg.name,
                other.name,
                1e3 * off(best)
            ));
        }
        for (c, i) in leg.joints.iter().enumerate() {
            signs[*i] = best[c];
        }
    }
    Ok(signs)
}

/// A pair of joints and how alike they move.
#[derive(Clone, Debug, PartialEq)]
pub struct Symmetry {
    /// The limb of the left side, named by its first joint.
    pub left: usize,
    /// The limb of the right side.
    pub right: usize,
    /// How much the one mirrored is the other, at the best shift: 1 is the same.
    pub likeness: f64,
    /// That shift, as a fraction of the cycle, 0..0.5: half a cycle for limbs that move in turn.
    pub shift: f64,
}

/// How alike limbs of the two sides move: for each pair of partners, nearest to the root, the likeness of
/// the pair's joints and those of the mirrored take, at the shift where it is best.
pub fn symmetry(take: &Take, body: &BodyModel, mirror: &Mirror, cycle: &Cycle) -> Vec<Symmetry> {
    let space = body.space();
    let frames = cycle.frames.round() as usize;
    if frames < 4 || frames >= take.len() {
        return Vec::new();
    }
    let start_s = cycle.start as f64 * take.dt_s;
    let end_s = start_s + cycle.frames * take.dt_s;
    let one = take.part(start_s, end_s, frames + 1);
    let other = mirror.take(&one);
    // Differences from the first pose, in which joints can be compared one by one.
    let base = &one.poses[0];
    let seen = |poses: &[Vec<f64>]| -> Vec<Vec<f64>> {
        (poses[..frames].iter())
            .map(|p| {
                let mut way = vec![0.0; space.tangent_len()];
                space.diff(base, p, &mut way);
                way
            })
            .collect()
    };
    let (here, there) = (seen(&one.poses), seen(&other.poses));
    let part = |joint: usize| {
        let shift = usize::from(matches!(take.body, TakeBody::Skeleton(_)));
        space.parts()[joint + shift].tangent.clone()
    };
    limbs(take, mirror)
        .into_iter()
        .filter_map(|(pair, joints)| {
            let columns: Vec<usize> = joints.into_iter().flat_map(part).collect();
            let mean = |rows: &[Vec<f64>], c: usize| {
                rows.iter().map(|r| r[c]).sum::<f64>() / frames as f64
            };
            let mut apart = vec![0.0; frames];
            let mut energy = 0.0;
            for c in columns {
                let (a, b) = (mean(&here, c), mean(&there, c));
                for row in here.iter() {
                    energy += (row[c] - a).powi(2);
                }
                for row in there.iter() {
                    energy += (row[c] - b).powi(2);
                }
                for (shift, sum) in apart.iter_mut().enumerate() {
                    *sum += (0..frames)
                        .map(|k| (here[k][c] - a - there[(k + shift) % frames][c] + b).powi(2))
                        .sum::<f64>();
                }
            }
            let best = (0..frames).min_by(|a, b| apart[*a].total_cmp(&apart[*b]))?;
            let shift = best as f64 / frames as f64;
            (energy > 1e-6).then(|| Symmetry {
                left: pair.0,
                right: pair.1,
                likeness: 1.0 - apart[best] / energy,
                shift: shift.min(1.0 - shift),
            })
        })
        .collect()
}

type Limb = ((usize, usize), Vec<usize>);

/// Pairs of partners nearest to the root, with all joints of the first one's limb.
fn limbs(take: &Take, mirror: &Mirror) -> Vec<Limb> {
    let partners = &mirror.partners;
    match &take.body {
        TakeBody::Skeleton(skeleton) => {
            let parent = |j: usize| skeleton.joints[j].parent;
            let paired = |j: usize| partners[j] != j;
            (0..partners.len())
                .filter(|i| partners[*i] > *i && parent(*i).is_none_or(|p| !paired(p)))
                .map(|i| {
                    let below =
                        |j: usize| std::iter::successors(Some(j), |j| parent(*j)).any(|a| a == i);
                    let joints = (i..partners.len()).filter(|j| below(*j)).collect();
                    ((i, partners[i]), joints)
                })
                .collect()
        }
        // Joints of a robot's limb follow each other in the file.
        TakeBody::Joints(_) | TakeBody::Floating(_) => {
            let mut found: Vec<Limb> = Vec::new();
            for i in (0..partners.len()).filter(|i| partners[*i] > *i) {
                let next = found.last_mut().filter(|(pair, joints)| {
                    i == pair.0 + joints.len() && partners[i] == pair.1 + joints.len()
                });
                match next {
                    Some((_, joints)) => joints.push(i),
                    None => found.push(((i, partners[i]), vec![i])),
                }
            }
            found
        }
    }
}

/// Largest difference of two poses' coordinates in the tangent space; for tests and reports.
pub fn farthest(space: &dyn PoseSpace, a: &[f64], b: &[f64]) -> f64 {
    let mut way = vec![0.0; space.tangent_len()];
    space.diff(a, b, &mut way);
    way.iter().fold(0.0, |m, v| m.max(v.abs()))
}
