//! BVH files as takes: the skeleton of the file, End Sites as joints at the tips.
//!
//! Rotations are the file's. A root that stays while its one child travels folds into the child. A joint
//! with position channels keeps the place of the first frame; where it moves, a warning says how far.

use super::axes::{Axes, Axis};
use super::error::ImportFault;
use super::raw::{Raw, RawFrame, RawJoint};
use super::{ImportOptions, Imported, check_size};
use crate::pose::bvh::{BvhFile, UnitGuess};
use nalgebra::UnitQuaternion;
use std::sync::Arc;

/// A joint that moves less than this share of the skeleton's size in its parent does not move.
const STILL: f64 = 1e-4;

/// Reads the text of a BVH file.
///
/// # Errors
/// A line that is no BVH ([`BvhFile::parse`]), several roots, too many frames.
pub(super) fn parse(
    text: &str,
    name: &str,
    options: &ImportOptions,
) -> Result<Imported, ImportFault> {
    let file = BvhFile::parse(text)?;
    let roots: Vec<&str> = (file.joints.iter())
        .filter(|j| j.parent.is_none())
        .map(|j| j.name.as_str())
        .collect();
    if roots.len() != 1 {
        return Err(ImportFault::element(
            "the hierarchy",
            format!("{} roots ({})", roots.len(), roots.join(", ")),
            "one ROOT; cut the file by character",
        ));
    }
    check_size(file.frames(), file.joints.len())?;
    let mut warnings = Vec::new();
    let raw = raw(&file, name, &mut warnings);
    let unit_m = options.unit.map_or_else(
        || {
            let guess = UnitGuess::of(&file);
            warnings.push(guess.to_string());
            guess.unit.metres
        },
        |u| u.metres,
    );
    let up = options.up.unwrap_or(Axis::Y);
    let (axes, how) = Axes::find(up, options.forward, Axis::new(2, false), &raw)?;
    if options.forward.is_none() {
        warnings.push(format!("faces {} ({how})", axes.forward));
    }
    let skeleton = Arc::new(raw.skeleton(axes, unit_m)?);
    Ok(Imported {
        takes: vec![raw.take(&skeleton, axes, &options.origin)],
        warnings,
    })
}

fn raw(file: &BvhFile, name: &str, warnings: &mut Vec<String>) -> Raw {
    let children = |of: usize| {
        let with_index = file.joints.iter().enumerate();
        let found = with_index.filter(move |(_, j)| j.parent == Some(of));
        found.map(|(i, _)| i).collect::<Vec<_>>()
    };
    let mut root = 0;
    while file.is_origin(root) {
        let [only] = children(root)[..] else { break };
        root = only;
    }
    // Parents come first in the file, so that all below the root follow it.
    let mut kept = vec![root];
    for (i, joint) in file.joints.iter().enumerate().skip(root + 1) {
        // An End Site of no length is there for the format's sake.
        let is_empty = joint.is_end && joint.offset == [0.0; 3];
        if !is_empty && joint.parent.is_some_and(|p| kept.contains(&p)) {
            kept.push(i);
        }
    }
    let joints: Vec<RawJoint> = (kept.iter())
        .map(|i| {
            let joint = &file.joints[*i];
            RawJoint {
                name: joint.name.clone(),
                parent: joint.parent.and_then(|p| kept.iter().position(|k| *k == p)),
                offset: joint.local(file.frame(0)).position,
                rest: UnitQuaternion::identity(),
            }
        })
        .collect();
    let mut moved = (0.0, 0);
    let mut places = Vec::new();
    let mut frames = Vec::with_capacity(file.frames());
    for k in 0..file.frames() {
        file.places(k, &mut places);
        let mut frame = RawFrame {
            place: places[root].position,
            rotations: vec![places[root].rotation],
        };
        for (i, joint) in kept.iter().enumerate().skip(1) {
            let local = file.joints[*joint].local(file.frame(k));
            frame.rotations.push(local.rotation);
            let off = (local.position - joints[i].offset).norm();
            if off > moved.0 {
                moved = (off, i);
            }
        }
        frames.push(frame);
    }
    let size = file.longest_path();
    if moved.0 > STILL * size {
        warnings.push(format!(
            "joint {} moves {:.4} units in its parent ({:.1} % of the skeleton); bones keep the length of the first frame",
            joints[moved.1].name,
            moved.0,
            100.0 * moved.0 / size.max(1e-9)
        ));
    }
    Raw {
        name: name.to_owned(),
        joints,
        dt_s: file.frame_time_s,
        frames,
        wraps: false,
    }
}
