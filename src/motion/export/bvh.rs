//! A skeleton's take as BVH: axes and unit of the skeleton's own file, rotations in the order z, x, y.
//!
//! At rest every BVH rotation is zero, so bones point as the skeleton's rest pose has them: with the
//! world rotation at rest `W`, joint `i` below `p` turns by `W_p R_i W_i^-1`.

use super::{ExportError, check_frames, root_in_world};
use crate::body::Skeleton;
use crate::motion::take::{Take, TakeBody};
use nalgebra::{Quaternion, Rotation3, UnitQuaternion, Vector3};
use std::fmt::Write;

/// A joint that turns less than this never turns, rad.
const STILL: f64 = 1e-7;

/// The text of a BVH file of `take`.
///
/// # Errors
/// A take of a robot, or without frames.
pub fn to_bvh(take: &Take) -> Result<String, ExportError> {
    check_frames(take)?;
    let TakeBody::Skeleton(skeleton) = &take.body else {
        return Err(ExportError::Body {
            take: take.name.clone(),
            found: "a robot's joints",
            format: "BVH",
            allowed: "BVH holds skeletons; write CSV, or glTF with the URDF",
        });
    };
    let tree = Tree::of(skeleton, take);
    let mut text = String::from("HIERARCHY\n");
    tree.joint(0, 0, &mut text);
    let _ = writeln!(text, "MOTION\nFrames: {}", take.len());
    let _ = writeln!(text, "Frame Time: {:.9}", take.dt_s);
    let mut last: Vec<[f64; 3]> = vec![[0.0; 3]; skeleton.len()];
    for (pose, root) in take.poses.iter().zip(&take.roots) {
        let world = root_in_world(pose, root);
        let place = tree.axes.inverse() * world.translation.vector / skeleton.unit_m;
        let _ = write!(text, "{:.8} {:.8} {:.8}", place.x, place.y, place.z);
        for i in &tree.written {
            let turn = match skeleton.joints[*i].parent {
                None => world.rotation * tree.rest[*i].inverse(),
                Some(p) => tree.rest[p] * Skeleton::rotation(pose, *i) * tree.rest[*i].inverse(),
            };
            let angles = zxy(&(tree.axes.inverse() * turn * tree.axes), last[*i]);
            last[*i] = angles;
            let [z, x, y] = angles.map(f64::to_degrees);
            let _ = write!(text, " {z:.8} {x:.8} {y:.8}");
        }
        text.push('\n');
    }
    Ok(text)
}

struct Tree<'a> {
    skeleton: &'a Skeleton,
    axes: UnitQuaternion<f64>,
    /// World rotation of each joint at rest.
    rest: Vec<UnitQuaternion<f64>>,
    children: Vec<Vec<usize>>,
    /// Tips that never turn are End Sites.
    is_end: Vec<bool>,
    /// Joints with channels, in the order of the file.
    written: Vec<usize>,
}

impl<'a> Tree<'a> {
    fn of(skeleton: &'a Skeleton, take: &Take) -> Self {
        let at_rest = skeleton.rest_pose([0.0; 3]);
        let mut rest: Vec<UnitQuaternion<f64>> = Vec::with_capacity(skeleton.len());
        let mut children = vec![Vec::new(); skeleton.len()];
        for (i, joint) in skeleton.joints.iter().enumerate() {
            let local = Skeleton::rotation(&at_rest, i);
            rest.push(match joint.parent {
                Some(p) => rest[p] * local,
                None => local,
            });
            if let Some(p) = joint.parent {
                children[p].push(i);
            }
        }
        let still = |i: usize| {
            let local = Skeleton::rotation(&at_rest, i);
            let mut poses = take.poses.iter();
            poses.all(|pose| Skeleton::rotation(pose, i).angle_to(&local) < STILL)
        };
        let is_end: Vec<bool> = (skeleton.joints.iter().enumerate())
            .map(|(i, joint)| {
                let parent = joint.parent.filter(|p| children[*p].len() == 1);
                let is_tip = parent.is_some_and(|p| {
                    let end = format!("{}_end", skeleton.joints[p].name);
                    joint.name.starts_with(&end)
                });
                is_tip && children[i].is_empty() && still(i)
            })
            .collect();
        let mut tree = Self {
            skeleton,
            axes: UnitQuaternion::new_normalize(Quaternion::from(skeleton.axes)),
            rest,
            children,
            is_end,
            written: Vec::new(),
        };
        let mut open = vec![0];
        while let Some(i) = open.pop() {
            if !tree.is_end[i] {
                tree.written.push(i);
            }
            open.extend(tree.children[i].iter().rev());
        }
        tree
    }

    /// Offset of a joint in the file's axes and unit.
    fn offset(&self, i: usize) -> Vector3<f64> {
        let joint = &self.skeleton.joints[i];
        match joint.parent {
            None => Vector3::zeros(),
            Some(p) => {
                let world = self.rest[p] * Vector3::from(joint.offset_m);
                self.axes.inverse() * world / self.skeleton.unit_m
            }
        }
    }

    fn joint(&self, i: usize, depth: usize, text: &mut String) {
        let (tab, inner) = ("\t".repeat(depth), "\t".repeat(depth + 1));
        let plain = |c: char| {
            if c.is_whitespace() || "{},\"".contains(c) {
                '_'
            } else {
                c
            }
        };
        let name: String = self.skeleton.joints[i].name.chars().map(plain).collect();
        let offset = |o: Vector3<f64>| format!("OFFSET {:.8} {:.8} {:.8}", o.x, o.y, o.z);
        let kind = if depth == 0 { "ROOT" } else { "JOINT" };
        if self.is_end[i] {
            let _ = writeln!(text, "{tab}End Site\n{tab}{{");
            let _ = writeln!(text, "{inner}{}\n{tab}}}", offset(self.offset(i)));
            return;
        }
        let _ = writeln!(text, "{tab}{kind} {name}\n{tab}{{");
        let _ = writeln!(text, "{inner}{}", offset(self.offset(i)));
        let channels = if depth == 0 {
            "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
        } else {
            "CHANNELS 3 Zrotation Xrotation Yrotation"
        };
        let _ = writeln!(text, "{inner}{channels}");
        for child in &self.children[i] {
            self.joint(*child, depth + 1, text);
        }
        if self.children[i].is_empty() {
            // Readers expect an end; one of no length tells nothing that is not so.
            let zero = offset(Vector3::zeros());
            let _ = writeln!(
                text,
                "{inner}End Site\n{inner}{{\n{inner}\t{zero}\n{inner}}}"
            );
        }
        let _ = writeln!(text, "{tab}}}");
    }
}

/// Angles z, x, y with `R = Rz Rx Ry`, of the two triples (and full turns) the one next to `last`.
fn zxy(turn: &UnitQuaternion<f64>, last: [f64; 3]) -> [f64; 3] {
    let rotation: Rotation3<f64> = turn.to_rotation_matrix();
    let m = rotation.matrix();
    let cos = m[(0, 1)].hypot(m[(1, 1)]);
    let x = m[(2, 1)].atan2(cos);
    let (z, y) = if cos > 1e-7 {
        ((-m[(0, 1)]).atan2(m[(1, 1)]), (-m[(2, 0)]).atan2(m[(2, 2)]))
    } else {
        // Only the sum or difference of z and y is there: y stays at zero.
        (m[(1, 0)].atan2(m[(0, 0)]), 0.0)
    };
    let pi = std::f64::consts::PI;
    let near = |a: f64, b: f64| a + 2.0 * pi * ((b - a) / (2.0 * pi)).round();
    let next = |angles: [f64; 3]| [0, 1, 2].map(|i| near(angles[i], last[i]));
    let (one, other) = (next([z, x, y]), next([z + pi, pi - x, y + pi]));
    let off = |a: &[f64; 3]| a.iter().zip(last).map(|(a, l)| (a - l).abs()).sum::<f64>();
    if off(&other) < off(&one) - 1e-9 {
        other
    } else {
        one
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::random::SplitMix;

    #[test]
    fn angles_give_the_rotation_back_even_where_two_axes_fall_together() {
        let mut random = SplitMix::new(5);
        let mut worst = 0.0_f64;
        let right = std::f64::consts::FRAC_PI_2;
        for k in 0..2000 {
            let mut angle = || 6.0 * random.unit() - 3.0;
            let (z, y) = (angle(), angle());
            let x = match k % 4 {
                0 => right,
                1 => -right + 1e-6 * angle(),
                _ => angle(),
            };
            let about = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
            let turn = |[z, x, y]: [f64; 3]| {
                about(Vector3::z_axis(), z)
                    * about(Vector3::x_axis(), x)
                    * about(Vector3::y_axis(), y)
            };
            let goal = turn([z, x, y]);
            let found = turn(zxy(&goal, [angle(), angle(), angle()]));
            worst = worst.max(found.angle_to(&goal));
        }
        assert!(worst < 1e-6, "{worst} rad off");
    }
}
