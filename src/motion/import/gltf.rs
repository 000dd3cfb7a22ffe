//! glTF 2.0 (.gltf, .glb, .vrm): skeleton, animations and skinned mesh.
//!
//! The skeleton is the smallest tree that holds the joints of all skins. Nodes above its root fold into
//! it, and so do joints at the top that never move. Bones keep the length they have at rest: where an
//! animation moves a joint in its parent, a warning says how far. Keys are sampled evenly.

mod buffers;
mod mesh;
mod tracks;
mod tree;

use super::axes::{Axes, Axis};
use super::error::ImportFault;
use super::raw::{Raw, RawFrame, RawJoint};
use super::{ImportOptions, check_size};
use crate::base::suggest::hint;
use crate::body::{Skeleton, SkinnedMesh};
use crate::motion::take::Take;
use buffers::Buffers;
use nalgebra::Vector3;
use std::path::Path;
use std::sync::Arc;
use tracks::Animation;
use tree::{Joints, Nodes};

/// At which rate keys are sampled where nothing is told, Hz.
const DEFAULT_RATE_HZ: f64 = 60.0;
/// A joint that moves less than this share of the skeleton's size in its parent does not move.
const STILL: f64 = 1e-4;
/// Sizes between which a unit is believed without a word, metres.
const USUAL_SIZES_M: (f64, f64) = (0.05, 10.0);

/// What a glTF file holds for an animator.
#[derive(Clone, Debug)]
pub struct GltfFile {
    /// Its skeleton.
    pub skeleton: Arc<Skeleton>,
    /// One take per animation, or the one selected; none for a file without animations.
    pub takes: Vec<Take>,
    /// The surface on the skeleton, where there is one.
    pub skin: Option<SkinnedMesh>,
    /// What was guessed or left out.
    pub warnings: Vec<String>,
}

impl GltfFile {
    /// Reads a document from its bytes; `folder` is where its buffers lie, `name` what takes of unnamed
    /// animations are called after.
    ///
    /// # Errors
    /// No glTF 2.0, values outside of their buffers, joints without a common ancestor, scaled bones,
    /// an animation that is not there.
    pub fn parse(
        bytes: &[u8],
        name: &str,
        folder: Option<&Path>,
        options: &ImportOptions,
    ) -> Result<Self, ImportFault> {
        let (json, binary) = buffers::split(bytes)?;
        let document = gltf::Gltf::from_slice(json)?.document;
        let buffers = Buffers::load(&document, binary, folder)?;
        let nodes = Nodes::read(&document)?;
        let animations = document
            .animations()
            .map(|a| {
                let own = a.name().filter(|n| !n.is_empty());
                let own = own.map_or_else(|| format!("{name}_{}", a.index()), String::from);
                Animation::read(&a, own, nodes.parents.len(), &buffers)
            })
            .collect::<Result<Vec<_>, _>>()?;
        let joints = Joints::find(&document, &nodes, &animations)?;
        joints.check_scales(&nodes, &animations)?;
        let mut warnings = Vec::new();
        let wanted = select(&animations, options.animation.as_deref())?;
        let rate_hz = options.rate_hz.unwrap_or(DEFAULT_RATE_HZ);
        let mut raws = Vec::new();
        for animation in &wanted {
            raws.push(raw(animation, &joints, &nodes, rate_hz, &mut warnings)?);
        }
        let rest = rest(&joints, &nodes, name);
        let facing = raws.first().unwrap_or(&rest);
        let (axes, how) = Axes::find(
            options.up.unwrap_or(Axis::Y),
            options.forward,
            Axis::new(2, false),
            facing,
        )?;
        if options.forward.is_none() {
            warnings.push(format!("faces {} ({how})", axes.forward));
        }
        let unit_m = options.unit.map_or(1.0, |u| u.metres);
        let size_m = unit_m * extent(&rest);
        if options.unit.is_none() && !(USUAL_SIZES_M.0..=USUAL_SIZES_M.1).contains(&size_m) {
            warnings.push(format!(
                "the skeleton measures {size_m:.3} m in the format's unit, metres; --unit cm or another says otherwise"
            ));
        }
        let skeleton = Arc::new(rest.skeleton(axes, unit_m)?);
        let takes = raws
            .iter()
            .map(|r| r.take(&skeleton, axes, &options.origin));
        let takes = takes.collect();
        let skin = mesh::read(
            &document,
            &buffers,
            &nodes,
            &joints,
            &skeleton,
            &mut warnings,
        )?;
        Ok(Self {
            skeleton,
            takes,
            skin,
            warnings,
        })
    }
}

/// The animations to read.
fn select<'a>(
    animations: &'a [Animation],
    name: Option<&str>,
) -> Result<Vec<&'a Animation>, ImportFault> {
    let Some(name) = name else {
        return Ok(animations.iter().collect());
    };
    let found: Vec<&Animation> = animations.iter().filter(|a| a.name == name).collect();
    if found.is_empty() {
        let names: Vec<&str> = animations.iter().map(|a| a.name.as_str()).collect();
        return Err(ImportFault::element(
            "the animations",
            format!("none called {name:?}{}", hint(name, names.iter().copied())),
            if names.is_empty() {
                "nothing: the file has no animation".to_owned()
            } else {
                names.join(", ")
            },
        ));
    }
    Ok(found)
}

/// The skeleton at rest, without frames.
fn rest(joints: &Joints, nodes: &Nodes, name: &str) -> Raw {
    let root = joints.nodes[0];
    let world = nodes.world(root, |n| nodes.rest[n]);
    let list = joints.nodes.iter().enumerate().map(|(i, node)| {
        let local = &nodes.rest[*node];
        let parent = nodes.parents[*node].and_then(|p| joints.of_node(p));
        RawJoint {
            name: nodes.names[*node].clone(),
            parent: if i == 0 { None } else { parent },
            offset: local.translation * world.scale,
            rest: if i == 0 {
                world.rotation
            } else {
                local.rotation
            },
        }
    });
    Raw {
        name: name.to_owned(),
        joints: list.collect(),
        dt_s: 1.0 / DEFAULT_RATE_HZ,
        frames: Vec::new(),
        wraps: false,
    }
}

/// Largest distance of a joint from the root at rest, file units.
fn extent(rest: &Raw) -> f64 {
    let places = rest.rest_places();
    places.iter().fold(0.0, |m: f64, p| m.max(p.norm()))
}

/// Samples an animation evenly; its first frame at the first key, its last at the last.
fn raw(
    animation: &Animation,
    joints: &Joints,
    nodes: &Nodes,
    rate_hz: f64,
    warnings: &mut Vec<String>,
) -> Result<Raw, ImportFault> {
    let mut raw = rest(joints, nodes, &animation.name);
    let duration_s = animation.end_s - animation.start_s;
    let intervals = (duration_s * rate_hz).round().max(1.0);
    if !(intervals < super::MAX_FRAMES as f64) {
        check_size(super::MAX_FRAMES + 1, 1)?;
    }
    check_size(intervals as usize + 1, joints.nodes.len())?;
    raw.dt_s = if duration_s > 0.0 {
        duration_s / intervals
    } else {
        1.0 / rate_hz
    };
    let size = extent(&raw);
    let mut moved = vec![0.0_f64; joints.nodes.len()];
    for k in 0..=intervals as usize {
        let t_s = animation.start_s + duration_s * k as f64 / intervals;
        let local = |n: usize| animation.local(n, &nodes.rest[n], t_s);
        let world = nodes.world(joints.nodes[0], local);
        let mut rotations = vec![world.rotation];
        for (i, node) in joints.nodes.iter().enumerate().skip(1) {
            let there = local(*node);
            rotations.push(there.rotation);
            let off = (there.translation * world.scale - raw.joints[i].offset).norm();
            moved[i] = moved[i].max(off);
        }
        raw.frames.push(RawFrame {
            place: world.place,
            rotations,
        });
    }
    let (most, off) = (moved.iter().enumerate())
        .max_by(|a, b| a.1.total_cmp(b.1))
        .map_or((0, 0.0), |(i, off)| (i, *off));
    if off > STILL * size {
        warnings.push(format!(
            "{}: joint {} moves {off:.4} units in its parent ({:.1} % of the skeleton); bones keep their length at rest",
            animation.name,
            raw.joints[most].name,
            100.0 * off / size
        ));
    }
    raw.wraps = raw.ends_where_it_began()
        && {
            let rise = |v: &Vector3<f64>| v.y;
            let places = (raw.frames.first(), raw.frames.last());
            matches!(places, (Some(a), Some(b)) if (rise(&a.place) - rise(&b.place)).abs() < 1e-2 * size)
        };
    Ok(raw)
}
