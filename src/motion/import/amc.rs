//! Acclaim motion (.amc) on its skeleton (.asf): CMU motion capture.

use super::asf::{Asf, Bone, Dof};
use super::axes::{Axes, Axis};
use super::error::ImportFault;
use super::raw::{Raw, RawFrame};
use super::text::{fault, lines, number, shown};
use super::{ImportOptions, Imported, check_size};
use crate::pose::LineFault;
use nalgebra::{UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// CMU's rate; the files do not tell.
const DEFAULT_RATE_HZ: f64 = 120.0;

/// Angles may leave the limits by this much without a word, degrees.
const LIMIT_SLACK_DEG: f64 = 1.0;

/// The skeleton of a motion file: as told, else of the same name, else of the name before the last `_`,
/// else the only one in the folder.
pub(super) fn skeleton_beside(
    path: &Path,
    options: &ImportOptions,
) -> Result<PathBuf, ImportFault> {
    if let Some(told) = &options.skeleton {
        return Ok(told.clone());
    }
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned());
    let stem = stem.unwrap_or_default();
    let subject = stem.rsplit_once('_').map_or(stem.as_str(), |(s, _)| s);
    for name in [stem.as_str(), subject] {
        let candidate = path.with_file_name(format!("{name}.asf"));
        if candidate.exists() {
            return Ok(candidate);
        }
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let entries = std::fs::read_dir(folder.unwrap_or_else(|| Path::new(".")))?;
    let is_asf = |p: &PathBuf| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("asf"));
    let found: Vec<PathBuf> = (entries.flatten().map(|e| e.path()))
        .filter(is_asf)
        .collect();
    match &found[..] {
        [only] => Ok(only.clone()),
        _ => Err(ImportFault::element(
            "the skeleton",
            format!(
                "{} .asf files beside it, none called {stem}.asf or {subject}.asf",
                found.len()
            ),
            "--skeleton FILE.asf",
        )),
    }
}

/// Reads the text of an AMC file on `skeleton`.
pub(super) fn parse(
    text: &str,
    skeleton: &Asf,
    name: &str,
    options: &ImportOptions,
) -> Result<Imported, ImportFault> {
    let (joints, bones) = skeleton.joints();
    let (frames, beyond) = frames(text, skeleton, &bones)?;
    let mut warnings = Vec::new();
    if beyond > 0 {
        warnings.push(format!(
            "{beyond} angles lie over {LIMIT_SLACK_DEG} degrees outside of the limits of their bones"
        ));
    }
    if options.rate_hz.is_none() {
        warnings.push(format!(
            "taken for {DEFAULT_RATE_HZ} frames a second, CMU's rate; --fps says otherwise"
        ));
    }
    let raw = Raw {
        name: name.to_owned(),
        joints,
        dt_s: 1.0 / options.rate_hz.unwrap_or(DEFAULT_RATE_HZ),
        frames,
        wraps: false,
    };
    let up = options.up.unwrap_or(Axis::Y);
    let (axes, how) = Axes::find(up, options.forward, Axis::new(2, false), &raw)?;
    if options.forward.is_none() {
        warnings.push(format!("faces {} ({how})", axes.forward));
    }
    let unit_m = options.unit.map_or(skeleton.unit_m, |u| u.metres);
    let body = Arc::new(raw.skeleton(axes, unit_m)?);
    Ok(Imported {
        takes: vec![raw.take(&body, axes, &options.origin)],
        warnings,
    })
}

fn frames(
    text: &str,
    skeleton: &Asf,
    bones: &[Option<usize>],
) -> Result<(Vec<RawFrame>, usize), ImportFault> {
    let mut beyond = 0;
    let mut degrees = skeleton.degrees;
    let mut frames: Vec<RawFrame> = Vec::new();
    let mut seen: Vec<bool> = Vec::new();
    let mut started = 0;
    let moving = |b: &Bone| !b.dofs.is_empty();
    let complete = |seen: &[bool], line: usize, frame: usize| {
        let missing = (skeleton.bones.iter().zip(seen)).find(|(b, seen)| moving(b) && !**seen);
        match missing {
            Some((bone, _)) => Err(fault(
                line,
                format!("frame {frame} without bone {}", bone.name),
                "every bone with degrees of freedom in each frame",
            )),
            None => Ok(()),
        }
    };
    for (line, text) in lines(text) {
        if let Some(word) = text.strip_prefix(':') {
            match word.trim().to_uppercase().as_str() {
                "DEGREES" => degrees = true,
                "RADIANS" => degrees = false,
                _ => {}
            }
            continue;
        }
        let mut words = text.split_whitespace();
        let head = words.next().unwrap_or_default();
        if head.bytes().all(|b| b.is_ascii_digit()) {
            if !frames.is_empty() {
                complete(&seen, started, frames.len())?;
            }
            check_size(frames.len() + 1, bones.len())?;
            frames.push(RawFrame {
                place: skeleton.position,
                rotations: vec![UnitQuaternion::identity(); bones.len()],
            });
            seen = vec![false; skeleton.bones.len()];
            started = line;
            continue;
        }
        let count = frames.len();
        let Some(frame) = frames.last_mut() else {
            return Err(fault(line, shown(head), "the number of the first frame").into());
        };
        let Some(b) = skeleton.bones.iter().position(|b| b.name == head) else {
            return Err(fault(
                line,
                format!("bone {}", shown(head)),
                "a bone of the skeleton; is this its .asf?",
            )
            .into());
        };
        if std::mem::replace(&mut seen[b], true) {
            return Err(fault(
                line,
                format!("bone {head} twice in frame {count}"),
                "every bone once",
            )
            .into());
        }
        let numbers = words
            .map(|w| number(line, w, head))
            .collect::<Result<Vec<f64>, LineFault>>()?;
        let bone = &skeleton.bones[b];
        if numbers.len() != bone.dofs.len() {
            return Err(fault(
                line,
                format!("{} numbers for {head}", numbers.len()),
                format!("{}, as the skeleton says", bone.dofs.len()),
            )
            .into());
        }
        beyond += bone.beyond_limits(&numbers, degrees);
        let (moved, turn) = bone.motion(&numbers, degrees);
        if b == 0 {
            frame.place = skeleton.position + moved;
        }
        if let Some(joint) = bones.iter().position(|j| *j == Some(b)) {
            frame.rotations[joint] = turn;
        }
    }
    check_size(frames.len(), bones.len())?;
    complete(&seen, started, frames.len())?;
    Ok((frames, beyond))
}

impl Bone {
    /// How many numbers lie well outside of the bone's limits, which are in the skeleton's unit of angles.
    fn beyond_limits(&self, numbers: &[f64], degrees: bool) -> usize {
        let slack = if degrees {
            LIMIT_SLACK_DEG
        } else {
            LIMIT_SLACK_DEG.to_radians()
        };
        let outside = |(v, (low, high)): (&f64, &(f64, f64))| *v < low - slack || *v > high + slack;
        numbers
            .iter()
            .zip(&self.limits)
            .filter(|p| outside(*p))
            .count()
    }

    /// Translation and rotation of the bone's joint by the numbers of a frame: `C M C^-1`, the first
    /// angle turned first.
    fn motion(&self, numbers: &[f64], degrees: bool) -> (Vector3<f64>, UnitQuaternion<f64>) {
        let (mut moved, mut turn) = (Vector3::zeros(), UnitQuaternion::identity());
        for (dof, value) in self.dofs.iter().zip(numbers) {
            match dof {
                Dof::Along(axis) => moved[*axis] = *value,
                Dof::About(axis) => {
                    let mut v = Vector3::zeros();
                    v[*axis] = if degrees { value.to_radians() } else { *value };
                    turn = UnitQuaternion::from_scaled_axis(v) * turn;
                }
                Dof::Length => {}
            }
        }
        (moved, self.axes * turn * self.axes.inverse())
    }
}
