//! An avatar: its skeleton and its clips, read from the files of other programs.

use super::error::{ConfigError, Pointer};
use super::file::AvatarEntry;
use super::files::Files;
use crate::base::suggest::hint;
use crate::body::{Feet, PoseSpace, Skeleton, SkeletonEnds};
use crate::motion::clip::{ClipFile, ClipKind, Segment};
use crate::motion::import::gltf::GltfFile;
use crate::motion::import::{self, ImportOptions};
use crate::motion::take::{Take, TakeBody};
use crate::pose::bvh::LengthUnit;
use std::f64::consts::TAU;
use std::path::PathBuf;
use std::sync::Arc;

/// A skeleton that is played, with its limbs.
#[derive(Clone, Debug)]
pub struct Avatar {
    /// Bones and joints.
    pub skeleton: Arc<Skeleton>,
    /// Ends of limbs that stand on the ground, in the order of the configuration.
    pub feet: SkeletonEnds,
    limbs: Vec<(String, Vec<String>)>,
    unit_m: Option<f64>,
    /// Whether feet in contact stay where they are.
    pub(super) pin_feet: bool,
}

/// Frames of a clip per second of an imported motion, and least and most of them.
const FRAMES_PER_S: f64 = 30.0;
const FRAMES: (f64, f64) = (24.0, 600.0);
/// A foot is low in this part of its way up and down.
const LOW: f64 = 0.35;
/// A foot that moves by less than this part of its leg stands.
const STANDS: f64 = 0.02;

impl Avatar {
    /// Reads the model that `entry` names.
    pub(super) fn load(
        files: &Files,
        entry: &AvatarEntry,
        at: &Pointer<'_>,
    ) -> Result<Self, ConfigError> {
        let key = "avatar.model";
        let name = entry.model.get_ref();
        let bad = |problem: String| at.at(entry.model.span(), key, problem);
        let (path, bytes) = motion_file(files, name).map_err(&bad)?;
        let options = options(entry.unit_m);
        let is_gltf = [".glb", ".gltf", ".vrm"].iter().any(|e| name.ends_with(e));
        let skeleton = if is_gltf {
            let file = path.display();
            let read = GltfFile::parse(&bytes, "model", path.parent(), &options)
                .map_err(|e| bad(format!("{file}: {e}")))?;
            read.skeleton
        } else {
            let read =
                import::open_bytes(&path, &bytes, &options).map_err(|e| bad(e.to_string()))?;
            match read.takes.into_iter().next().map(|take| take.body) {
                Some(TakeBody::Skeleton(skeleton)) => skeleton,
                _ => {
                    return Err(bad(format!(
                        "{name} has no skeleton; give a glTF, BVH or AMC file"
                    )));
                }
            }
        };
        let mut feet = SkeletonEnds::new(Arc::clone(&skeleton));
        let mut limbs = Vec::new();
        for limb in &entry.limb {
            let end = limb.end.get_ref();
            let strange = |problem: String| at.at(limb.end.span(), "avatar.limb.end", problem);
            let names = || skeleton.joints.iter().map(|j| j.name.as_str());
            let Some(mut joint) = skeleton.joint(end) else {
                let all: Vec<&str> = names().collect();
                return Err(strange(format!(
                    "{name} has no joint {end:?}{} Joints: {}",
                    hint(end, names()),
                    all.join(", ")
                )));
            };
            feet = feet
                .with_limb(&limb.name, end, limb.joints)
                .ok_or_else(|| {
                    strange(format!(
                        "limb {}: joints = {}, and so many must lie above {end} (at least 1)",
                        limb.name, limb.joints
                    ))
                })?;
            let mut own = vec![end.clone()];
            for _ in 0..limb.joints {
                joint = skeleton.joints[joint].parent.unwrap_or(0);
                own.push(skeleton.joints[joint].name.clone());
            }
            limbs.push((limb.name.clone(), own));
        }
        Ok(Self {
            skeleton,
            feet,
            limbs,
            unit_m: entry.unit_m,
            pin_feet: entry.pin_feet && !entry.limb.is_empty(),
        })
    }

    /// The motion `name`, `FILE[#ANIMATION][@FROM..TO]`, as a clip of `kind`: by default a cycle where it ends
    /// as it began. A part from `@FROM` to `TO` seconds is a path; where both are one, a still pose.
    pub(super) fn clip_file(
        &self,
        files: &Files,
        name: &str,
        kind: Option<ClipKind>,
    ) -> Result<ClipFile, String> {
        let (file, part) = split_part(name)?;
        let (path, bytes) = motion_file(files, file)?;
        let read =
            import::open_bytes(&path, &bytes, &options(self.unit_m)).map_err(|e| e.to_string())?;
        let names: Vec<String> = read.takes.iter().map(|t| t.name.clone()).collect();
        let Ok([take]) = <[Take; 1]>::try_from(read.takes) else {
            return Err(format!(
                "{file} has {} animations; choose one: {file}#NAME. Animations: {}",
                names.len(),
                names.join(", ")
            ));
        };
        let take = match part {
            Some((from, to)) if !(from >= 0.0 && from <= to && to <= take.duration_s()) => {
                return Err(format!(
                    "@{from}..{to}: must lie in 0..{:.3} s, the length of {}, in this order",
                    take.duration_s(),
                    take.name
                ));
            }
            Some((from, to)) => {
                let frames = ((to - from) * FRAMES_PER_S).round() as usize + 8;
                take.part(from, to, frames)
            }
            None => take,
        };
        let still = part.is_some_and(|(from, to)| from == to);
        let kind = kind.unwrap_or(if take.wraps {
            ClipKind::Cycle
        } else {
            ClipKind::Path
        });
        if kind == ClipKind::Cycle && !take.wraps && !still {
            return Err(format!(
                "{} does not end as it began, so it is no cycle; cut it to one cycle (`handwave clip import`), or take a still pose: @0..0",
                take.name
            ));
        }
        let frames = (take.duration_s() * FRAMES_PER_S)
            .round()
            .clamp(FRAMES.0, FRAMES.1);
        let mut clip = take.to_clip(kind, frames as usize);
        if still {
            clip.frequency_hz = 0.0;
        }
        self.finish(&mut clip);
        Ok(clip)
    }

    /// Signs, limbs and travel of an imported clip.
    fn finish(&self, clip: &mut ClipFile) {
        // One hemisphere for all clips, so that no quaternion changes its sign when another clip leads.
        for joint in 0..self.skeleton.len() {
            let at = 3 + 4 * joint;
            let rest = self.skeleton.joints[joint].rest;
            let dot: f64 = (clip.frames.iter())
                .flat_map(|f| f[at..at + 4].iter().zip(&rest).map(|(a, b)| a * b))
                .sum();
            if dot < 0.0 {
                for frame in &mut clip.frames {
                    frame[at..at + 4].iter_mut().for_each(|v| *v = -*v);
                }
            }
        }
        if self.limbs.is_empty() {
            return;
        }
        let mut steps: Vec<Step> = (0..self.limbs.len()).map(|f| self.step(clip, f)).collect();
        let moves = steps.iter().any(|s| s.duty < 1.0);
        let travels =
            clip.root.forward_m.hypot(clip.root.left_m) > 1e-3 || clip.root.yaw_rad.abs() > 1e-3;
        if clip.kind == ClipKind::Cycle && moves && !travels {
            // In place: the cycle begins where the first limb touches down, the same in all clips of a class,
            // and the ground moves as fast as the feet that stand on it.
            let n = clip.frames.len();
            let start = (steps[0].phase * n as f64).round() as usize % n;
            clip.frames.rotate_left(start);
            clip.way.clear();
            steps.iter_mut().for_each(|s| s.turn(start));
            clip.root.forward_m = travel(&steps, n);
        }
        clip.segments = (self.limbs.iter().zip(&steps))
            .map(|((name, joints), step)| Segment {
                name: name.clone(),
                joints: joints.clone(),
                phase: step.phase,
                duty: step.duty,
            })
            .collect();
    }

    /// When one foot stands, over a cycle.
    fn step(&self, clip: &ClipFile, foot: usize) -> Step {
        let n = clip.frames.len();
        let places: Vec<_> = (clip.frames.iter())
            .map(|f| self.feet.position(f, foot))
            .collect();
        let range = |of: fn(&nalgebra::Point3<f64>) -> f64| {
            let all = places.iter().map(of);
            let low = all.clone().fold(f64::INFINITY, f64::min);
            (low, all.fold(f64::NEG_INFINITY, f64::max))
        };
        let (low, high) = range(|p| p.z);
        let (back, front) = range(|p| p.x);
        let moved = (front - back).max(high - low);
        if clip.kind == ClipKind::Path || moved < STANDS * self.feet.reach_m(foot) {
            return Step {
                phase: 0.0,
                duty: 1.0,
                back_m: vec![0.0; n],
                stands: vec![true; n],
            };
        }
        let back_m: Vec<f64> = (0..n)
            .map(|k| 0.5 * (places[(k + n - 1) % n].x - places[(k + 1) % n].x))
            .collect();
        let stands: Vec<bool> = (0..n)
            .map(|k| places[k].z < low + LOW * (high - low) && back_m[k] > 0.0)
            .collect();
        let (mut sin, mut cos, mut count) = (0.0, 0.0, 0.0);
        for (k, _) in stands.iter().enumerate().filter(|(_, s)| **s) {
            let angle = TAU * k as f64 / n as f64;
            sin += angle.sin();
            cos += angle.cos();
            count += 1.0;
        }
        let duty = (count / n as f64).clamp(0.02, 0.98);
        Step {
            phase: (sin.atan2(cos) / TAU - 0.5 * duty).rem_euclid(1.0) % 1.0,
            duty,
            back_m,
            stands,
        }
    }
}

/// When a foot stands.
struct Step {
    /// Touch-down and share of the cycle on the ground.
    phase: f64,
    duty: f64,
    /// How far it goes backwards from frame to frame, metres.
    back_m: Vec<f64>,
    stands: Vec<bool>,
}

impl Step {
    /// The cycle begins `start` frames later.
    fn turn(&mut self, start: usize) {
        let n = self.stands.len();
        self.back_m.rotate_left(start);
        self.stands.rotate_left(start);
        self.phase = (self.phase - start as f64 / n as f64).rem_euclid(1.0) % 1.0;
    }
}

/// How far a body goes in a cycle when the feet that stand do not slip: metres.
fn travel(steps: &[Step], frames: usize) -> f64 {
    let mut speeds = Vec::new();
    for k in 0..frames {
        let on_ground = steps.iter().filter(|s| s.duty < 1.0 && s.stands[k]);
        let (sum, count) = on_ground.fold((0.0, 0.0), |(s, c), step| (s + step.back_m[k], c + 1.0));
        if count > 0.0 {
            speeds.push(sum / count);
        }
    }
    // In flight the body keeps its speed.
    speeds.iter().sum::<f64>() / speeds.len().max(1) as f64 * frames as f64
}

fn options(unit_m: Option<f64>) -> ImportOptions {
    ImportOptions {
        unit: unit_m.map(|metres| LengthUnit { metres }),
        ..ImportOptions::default()
    }
}

/// A motion file, which may end in `#NAME`, as a path and its content.
fn motion_file(files: &Files, name: &str) -> Result<(PathBuf, Vec<u8>), String> {
    let file = name.split_once('#').map_or(name, |(file, _)| file);
    let path = match files.place() {
        Files::Folder(folder) => folder.join(name),
        Files::Embedded => return Err(format!("{name}: motion files are not part of the program")),
        Files::Kept(_) => PathBuf::from(name),
    };
    let bytes = files.bytes(file).map_err(|e| e.to_string())?;
    Ok((path, bytes))
}

/// A part of a motion, seconds.
type Part = (f64, f64);

/// `FILE@FROM..TO` as file and seconds.
fn split_part(name: &str) -> Result<(&str, Option<Part>), String> {
    let Some((file, part)) = name.rsplit_once('@') else {
        return Ok((name, None));
    };
    let numbers = part.split_once("..").and_then(|(from, to)| {
        let number = |text: &str| text.trim().parse::<f64>().ok();
        Some((number(from)?, number(to)?))
    });
    match numbers {
        Some(part) => Ok((file, Some(part))),
        None => Err(format!(
            "{name}: after @ two times in seconds are needed, such as @0.5..1.2"
        )),
    }
}

/// Names of a skeleton's coordinates, for messages and the bus.
pub(super) fn coordinate_names(space: &dyn PoseSpace) -> Vec<String> {
    let names = space.parts().iter().flat_map(|part| {
        let axes: &[&str] = if part.coordinates.len() == 4 {
            &["qx", "qy", "qz", "qw"]
        } else {
            &["x", "y", "z"]
        };
        axes.iter().map(move |axis| format!("{}.{axis}", part.name))
    });
    names.collect()
}
