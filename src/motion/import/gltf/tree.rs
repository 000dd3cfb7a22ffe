//! Nodes of a glTF file that form a skeleton: the joints of its skins, or what is animated.

use super::super::error::ImportFault;
use super::tracks::{Animation, Local, rotation_of};
use nalgebra::{Matrix4, UnitQuaternion, Vector3};

/// Every node of a document, by index.
pub(super) struct Nodes {
    pub parents: Vec<Option<usize>>,
    pub rest: Vec<Local>,
    pub names: Vec<String>,
}

impl Nodes {
    pub fn read(document: &gltf::Document) -> Result<Self, ImportFault> {
        let count = document.nodes().len();
        let mut parents = vec![None; count];
        let (mut rest, mut names) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for node in document.nodes() {
            let index = node.index();
            let (t, r, s) = node.transform().decomposed();
            let local = Local {
                translation: Vector3::from(t.map(f64::from)),
                rotation: rotation_of(r.map(f64::from)),
                scale: Vector3::from(s.map(f64::from)),
            };
            let numbers = local.translation.iter().chain(local.scale.iter());
            if numbers
                .chain(r.map(f64::from).iter())
                .any(|v| !v.is_finite())
            {
                return Err(ImportFault::element(
                    format!("node {index}"),
                    "a place, rotation or scale that is not finite",
                    "finite numbers",
                ));
            }
            rest.push(local);
            let name = node.name().map(str::trim).filter(|n| !n.is_empty());
            let mut name =
                name.map_or_else(|| format!("node_{index}"), |n| n.replace([',', '"'], "_"));
            if names.contains(&name) {
                name = format!("{name}_{index}");
            }
            names.push(name);
            for child in node.children() {
                parents[child.index()] = Some(index);
            }
        }
        let nodes = Self {
            parents,
            rest,
            names,
        };
        // A node that is its own ancestor would be walked up for ever.
        for node in 0..count {
            let up = std::iter::successors(Some(node), |n| nodes.parents[*n]);
            if up.take(count + 1).count() > count {
                return Err(ImportFault::element(
                    format!("node {node}"),
                    "a node below itself",
                    "a tree of nodes",
                ));
            }
        }
        Ok(nodes)
    }

    /// The node and its ancestors up to the top.
    pub fn up(&self, node: usize) -> impl Iterator<Item = usize> + '_ {
        std::iter::successors(Some(node), |n| self.parents[*n])
    }

    /// Place, rotation and uniform scale of a node in the world, by its `locals`.
    pub fn world(&self, node: usize, local: impl Fn(usize) -> Local) -> World {
        let mut chain: Vec<usize> = self.up(node).collect();
        chain.reverse();
        let mut world = World {
            place: Vector3::zeros(),
            rotation: UnitQuaternion::identity(),
            scale: 1.0,
        };
        for node in chain {
            let l = local(node);
            world.place += world.rotation * (l.translation * world.scale);
            world.rotation *= l.rotation;
            world.scale *= l.scale.x;
        }
        world
    }
}

/// A node in the world, file axes and units.
#[derive(Copy, Clone, Debug)]
pub(super) struct World {
    pub place: Vector3<f64>,
    pub rotation: UnitQuaternion<f64>,
    pub scale: f64,
}

impl World {
    pub fn matrix(&self) -> Matrix4<f64> {
        let rotation = self.rotation.to_homogeneous();
        Matrix4::new_translation(&self.place) * rotation * Matrix4::new_scaling(self.scale)
    }
}

/// The nodes that are joints, parents first.
pub(super) struct Joints {
    /// Node of each joint; the first is the root.
    pub nodes: Vec<usize>,
    /// Joints of the skin above the root that never move; what hangs on them is put on the root.
    pub folded: Vec<usize>,
}

impl Joints {
    /// The smallest tree that holds the joints of all skins (without skin: all that is animated and
    /// what hangs on it), less what stands still above the node that first moves or branches.
    pub fn find(
        document: &gltf::Document,
        nodes: &Nodes,
        animations: &[Animation],
    ) -> Result<Self, ImportFault> {
        let mut wanted: Vec<usize> = document
            .skins()
            .flat_map(|s| s.joints().map(|j| j.index()).collect::<Vec<_>>())
            .collect();
        if wanted.is_empty() {
            let moved = |n: usize| animations.iter().any(|a| a.moves(n));
            let all = 0..nodes.parents.len();
            wanted = all.filter(|n| nodes.up(*n).any(moved)).collect();
        }
        let Some(first) = wanted.first() else {
            return Err(ImportFault::element(
                "the document",
                "no skin and no animated node",
                "a skin with joints, or an animation of nodes",
            ));
        };
        let common = |node: usize| wanted.iter().all(|w| nodes.up(*w).any(|up| up == node));
        let Some(top) = nodes.up(*first).find(|n| common(*n)) else {
            return Err(ImportFault::element(
                "the skins",
                "joints without a common ancestor",
                "one tree of joints; export one character at a time",
            ));
        };
        // Between a joint and the top every node counts, joint of a skin or not.
        let mut included = vec![false; nodes.parents.len()];
        included[top] = true;
        for w in &wanted {
            let mut node = *w;
            while !included[node] {
                included[node] = true;
                node = nodes.parents[node].unwrap_or(top);
            }
        }
        let children =
            |node: usize| (0..nodes.parents.len()).filter(move |n| nodes.parents[*n] == Some(node));
        let below = |node: usize| children(node).filter(|n| included[*n]).collect::<Vec<_>>();
        let (mut root, mut folded) = (top, Vec::new());
        while !animations.is_empty() && !animations.iter().any(|a| a.moves(root)) {
            let [only] = below(root)[..] else { break };
            folded.push(root);
            root = only;
        }
        let mut order = vec![root];
        let mut at = 0;
        while at < order.len() {
            order.extend(below(order[at]));
            at += 1;
            if order.len() > super::super::MAX_JOINTS {
                return Err(ImportFault::element(
                    "the skins",
                    format!("over {} joints", super::super::MAX_JOINTS),
                    "fewer; export a game skeleton",
                ));
            }
        }
        Ok(Self {
            nodes: order,
            folded,
        })
    }

    /// Index of the joint that is `node`.
    pub fn of_node(&self, node: usize) -> Option<usize> {
        self.nodes.iter().position(|n| *n == node)
    }

    /// Refuses scales that a skeleton of constant bones cannot have: any other than one, but for a
    /// uniform one at the root or above it.
    pub fn check_scales(&self, nodes: &Nodes, animations: &[Animation]) -> Result<(), ImportFault> {
        const SLACK: f64 = 1e-3;
        let Some(root) = self.nodes.first() else {
            return Ok(());
        };
        let above: Vec<usize> = nodes.up(*root).collect();
        for node in above.iter().chain(self.nodes.iter().skip(1)) {
            let rest = nodes.rest[*node].scale;
            let uniform = rest.x > 1e-6 && rest.iter().all(|s| (s / rest.x - 1.0).abs() < SLACK);
            let one = rest.iter().all(|s| (s - 1.0).abs() < SLACK);
            let name = &nodes.names[*node];
            if !(one || uniform && above.contains(node)) {
                return Err(ImportFault::element(
                    format!("node {name}"),
                    format!("scale {:.4}, {:.4}, {:.4}", rest.x, rest.y, rest.z),
                    "1, or a uniform scale at the root; apply scales before exporting",
                ));
            }
            for animation in animations {
                let moved = |s: &Vector3<f64>| (s - rest).norm() > SLACK * rest.norm();
                if let Some(s) = animation.scales(*node).iter().find(|s| moved(s)) {
                    return Err(ImportFault::element(
                        format!("animation {}, node {name}", animation.name),
                        format!("scale {:.4}, {:.4}, {:.4}", s.x, s.y, s.z),
                        "no animated scale: bones keep their length",
                    ));
                }
            }
        }
        Ok(())
    }
}
