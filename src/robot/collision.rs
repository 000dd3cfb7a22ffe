//! Self-collision and keep-out: how near the links of a robot come to each other and to boxes in its world.
//!
//! Shapes are the `<collision>` elements of the URDF: boxes, cylinders, spheres and capsules as they are, meshes by
//! the box around them. Links that hang together by one joint or are rigidly joined are not compared, nor are pairs
//! that are named, nor pairs that are near each other already in the poses in which the robot rests.
//! Distances come from the crate `parry3d`; where shapes overlap it is 0, whatever the depth.

mod guard;
mod shapes;

use super::model::{JointKind, RobotModel};
pub use guard::CollisionGuard;
use nalgebra::{Isometry3, Point3};
use shapes::{Solid, pose};
use std::path::Path;

/// What to compare.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CollisionOptions {
    /// Nearest that two links may come, metres.
    pub margin_m: f64,
    /// Pairs of links that are not compared.
    pub ignore: Vec<[String; 2]>,
    /// Boxes in the root link's frame that no link may enter.
    pub keep_out: Vec<KeepOut>,
}

/// A box in the root link's frame, its edges along the axes.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct KeepOut {
    /// Corner with the least coordinates, metres.
    pub least: Point3<f64>,
    /// Corner with the greatest, metres.
    pub greatest: Point3<f64>,
}

/// Why collisions cannot be looked for.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CollisionError {
    /// The margin is no distance.
    #[error("margin_m is {margin_m}, expected a distance from 0 to 1 m")]
    Margin {
        /// As given.
        margin_m: f64,
    },
    /// A link that is to be ignored is not there.
    #[error("no link {name:?} in the URDF{}", suggestion.as_deref().map_or(String::new(), |s| format!(" (did you mean {s:?}?)")))]
    UnknownLink {
        /// As given.
        name: String,
        /// The nearest name.
        suggestion: Option<String>,
    },
    /// A keep-out box has no inside.
    #[error(
        "keep-out box {index} (from 1): {least:?} to {greatest:?} is no box; give the corner with the least coordinates, then that with the greatest, in metres"
    )]
    KeepOut {
        /// Which, from 1.
        index: usize,
        /// As given.
        least: [f64; 3],
        /// As given.
        greatest: [f64; 3],
    },
    /// A shape has no size.
    #[error("link {link}: its collision {shape} needs finite sizes above zero")]
    Shape {
        /// The link.
        link: String,
        /// Box, cylinder, sphere or capsule.
        shape: &'static str,
    },
    /// The URDF cannot be read.
    #[error("not a readable URDF: {0}")]
    Urdf(String),
    /// There is nothing to compare.
    #[error("the URDF has no pair of links with <collision> shapes that could meet")]
    NoPairs,
}

/// Who a shape belongs to.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
enum Owner {
    Link(usize),
    KeepOut(usize),
}

/// One shape of a link, or a keep-out box.
#[derive(Debug)]
struct Part {
    owner: Owner,
    solid: Solid,
    /// In the frame of the link, or of the root.
    place: Isometry3<f64>,
}

/// Two shapes that are compared.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
struct Pair(usize, usize);

/// The two that are nearest each other.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Nearest {
    /// Which pair; [`CollisionModel::names`] says whose.
    pub pair: usize,
    /// Distance, metres; 0 when they overlap.
    pub distance_m: f64,
}

/// Room for one comparison, made once.
#[derive(Clone, Debug)]
pub struct Scratch {
    links: Vec<Isometry3<f64>>,
    parts: Vec<Isometry3<f64>>,
}

/// The shapes of a robot and the pairs of them that are compared.
#[derive(Debug)]
pub struct CollisionModel {
    model: RobotModel,
    /// Joints, those nearer the root first.
    order: Vec<usize>,
    parts: Vec<Part>,
    pairs: Vec<Pair>,
    margin_m: f64,
    notes: Vec<String>,
}

impl CollisionModel {
    /// Reads the shapes of `model` from its `urdf`; meshes are looked for from `folder`, that of the URDF.
    ///
    /// `resting`: poses (rad, model order) in which the robot rests. Links that are nearer than the margin in one of
    /// them are not compared, and [`notes`](Self::notes) names them.
    pub fn new(
        model: &RobotModel,
        urdf: &str,
        folder: Option<&Path>,
        options: &CollisionOptions,
        resting: &[&[f64]],
    ) -> Result<Self, CollisionError> {
        let margin_m = options.margin_m;
        if !(0.0..=1.0).contains(&margin_m) {
            return Err(CollisionError::Margin { margin_m });
        }
        let mut notes = Vec::new();
        let mut parts = shapes::of_links(model, urdf, folder, &mut notes)?;
        for (index, keep_out) in options.keep_out.iter().enumerate() {
            parts.push(shapes::of_keep_out(index, keep_out)?);
        }
        let mut ignored = Vec::new();
        for names in &options.ignore {
            let [a, b] = names.each_ref().map(|name| link(model, name));
            ignored.push((a?, b?));
        }
        let group = rigid_groups(model);
        let mut this = Self {
            order: outwards(model),
            model: model.clone(),
            pairs: Vec::new(),
            parts,
            margin_m,
            notes,
        };
        for a in 0..this.parts.len() {
            for b in a + 1..this.parts.len() {
                if this.may_meet(this.parts[a].owner, this.parts[b].owner, &group, &ignored) {
                    this.pairs.push(Pair(a, b));
                }
            }
        }
        this.leave_out_near(resting);
        if this.pairs.is_empty() {
            return Err(CollisionError::NoPairs);
        }
        Ok(this)
    }

    fn may_meet(&self, a: Owner, b: Owner, group: &[usize], ignored: &[(usize, usize)]) -> bool {
        match (a, b) {
            (Owner::Link(a), Owner::Link(b)) => {
                let named = ignored.iter().any(|&pair| pair == (a, b) || pair == (b, a));
                let hang_together = self.model.joints.iter().any(|joint| {
                    let (parent, child) = (group[joint.parent], group[joint.child]);
                    (parent, child) == (group[a], group[b])
                        || (parent, child) == (group[b], group[a])
                });
                group[a] != group[b] && !named && !hang_together
            }
            // What cannot move cannot be kept out.
            (Owner::Link(link), Owner::KeepOut(_)) => group[link] != group[self.model.root],
            (Owner::KeepOut(_), _) => false,
        }
    }

    /// Leaves out pairs of links that are near each other in a pose in which the robot rests.
    fn leave_out_near(&mut self, resting: &[&[f64]]) {
        let mut scratch = self.scratch();
        let mut near = vec![f64::INFINITY; self.pairs.len()];
        let mut found = vec![f64::INFINITY; self.pairs.len()];
        for pose in resting {
            self.distances(pose, self.margin_m, &mut scratch, &mut found);
            for (near, found) in near.iter_mut().zip(&found) {
                *near = near.min(*found);
            }
        }
        let owners = |pair: &Pair| (self.parts[pair.0].owner, self.parts[pair.1].owner);
        let mut left_out: Vec<(Owner, Owner)> = Vec::new();
        for (pair, near) in self.pairs.iter().zip(&near) {
            let pair = owners(pair);
            if *near < self.margin_m && !left_out.contains(&pair) {
                left_out.push(pair);
                let (a, b) = (self.name(pair.0), self.name(pair.1));
                self.notes.push(format!(
                    "collision: {a} and {b} are {:.1} mm apart at rest and are not compared",
                    1e3 * near
                ));
            }
        }
        let parts = &self.parts;
        self.pairs
            .retain(|pair| !left_out.contains(&(parts[pair.0].owner, parts[pair.1].owner)));
    }

    /// How many pairs of shapes are compared.
    pub fn pairs(&self) -> usize {
        self.pairs.len()
    }

    /// Nearest that two links may come, metres.
    pub fn margin_m(&self) -> f64 {
        self.margin_m
    }

    /// What is not looked at, for the reader.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The two whom pair `pair` compares.
    pub fn names(&self, pair: usize) -> (String, String) {
        let Pair(a, b) = self.pairs[pair];
        (
            self.name(self.parts[a].owner),
            self.name(self.parts[b].owner),
        )
    }

    fn name(&self, owner: Owner) -> String {
        match owner {
            Owner::Link(link) => self.model.links[link].clone(),
            Owner::KeepOut(index) => format!("keep-out box {}", index + 1),
        }
    }

    /// Room for comparisons.
    pub fn scratch(&self) -> Scratch {
        Scratch {
            links: vec![Isometry3::identity(); self.model.links.len()],
            parts: vec![Isometry3::identity(); self.parts.len()],
        }
    }

    /// The pair that is nearest at `positions` (rad, model order), and its distance. No allocation.
    pub fn nearest(&self, positions: &[f64], scratch: &mut Scratch) -> Option<Nearest> {
        self.place(positions, scratch);
        let mut best: Option<Nearest> = None;
        for (pair, &Pair(a, b)) in self.pairs.iter().enumerate() {
            let limit = best.map_or(f64::INFINITY, |best| best.distance_m);
            let distance_m = self.distance(a, b, limit, scratch);
            if distance_m < limit {
                best = Some(Nearest { pair, distance_m });
            }
        }
        best
    }

    /// The distance of every pair at `positions` into `out`, metres; infinite where it is surely above `limit_m`.
    /// No allocation.
    pub fn distances(
        &self,
        positions: &[f64],
        limit_m: f64,
        scratch: &mut Scratch,
        out: &mut [f64],
    ) {
        self.place(positions, scratch);
        for (&Pair(a, b), out) in self.pairs.iter().zip(out) {
            *out = self.distance(a, b, limit_m, scratch);
        }
    }

    /// Places all shapes.
    fn place(&self, positions: &[f64], scratch: &mut Scratch) {
        scratch.links[self.model.root] = Isometry3::identity();
        for &joint in &self.order {
            let (parent, child) = {
                let joint = &self.model.joints[joint];
                (joint.parent, joint.child)
            };
            scratch.links[child] =
                scratch.links[parent] * self.model.joint_transform(joint, positions);
        }
        for (part, place) in self.parts.iter().zip(&mut scratch.parts) {
            *place = match part.owner {
                Owner::Link(link) => scratch.links[link] * part.place,
                Owner::KeepOut(_) => part.place,
            };
        }
    }

    /// Distance of two placed shapes; infinite where the balls around them are at least `limit_m` apart.
    fn distance(&self, a: usize, b: usize, limit_m: f64, scratch: &Scratch) -> f64 {
        let (first, second) = (&scratch.parts[a], &scratch.parts[b]);
        let (a, b) = (&self.parts[a].solid, &self.parts[b].solid);
        let apart = (first.translation.vector - second.translation.vector).norm();
        if apart - a.radius() - b.radius() >= limit_m {
            return f64::INFINITY;
        }
        a.distance(&pose(first), b, &pose(second))
    }
}

fn link(model: &RobotModel, name: &str) -> Result<usize, CollisionError> {
    model.link(name).ok_or_else(|| CollisionError::UnknownLink {
        name: name.into(),
        suggestion: crate::base::suggest::nearest(name, model.links.iter().map(String::as_str))
            .map(str::to_owned),
    })
}

/// Per link the first link of those it is rigidly joined to.
fn rigid_groups(model: &RobotModel) -> Vec<usize> {
    (0..model.links.len())
        .map(|link| {
            let mut at = link;
            while let Some(joint) = model.parent_joint[at] {
                if model.joints[joint].kind != JointKind::Fixed {
                    break;
                }
                at = model.joints[joint].parent;
            }
            at
        })
        .collect()
}

/// All joints, those nearer the root first.
fn outwards(model: &RobotModel) -> Vec<usize> {
    let depth = |joint: usize| {
        std::iter::successors(model.parent_joint[model.joints[joint].parent], |&above| {
            model.parent_joint[model.joints[above].parent]
        })
        .count()
    };
    let mut order: Vec<usize> = (0..model.joints.len()).collect();
    order.sort_by_key(|&joint| depth(joint));
    order
}
