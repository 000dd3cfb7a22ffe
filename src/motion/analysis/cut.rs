//! Making clips of takes: one cycle resampled to phase, its seam closed; reversed takes.

use super::{AnalysisError, BodyModel, Cycle, FootContact};
use crate::body::{PoseSpace, RootAdvance, RootPose};
use crate::motion::clip::{ClipFile, ClipKind, Segment};
use crate::motion::take::{Take, TakeBody};

/// How a cycle is cut.
#[derive(Clone, Debug)]
pub struct CutOptions {
    /// Name of the clip; that of the take by default.
    pub name: Option<String>,
    /// Frames of the clip, evenly over the cycle; at least 8.
    pub frames: usize,
    /// Largest seam that is closed, as a share of the motion's extent.
    pub most_seam: f64,
}

impl Default for CutOptions {
    /// 64 frames, seams of up to half the motion's extent.
    fn default() -> Self {
        Self {
            name: None,
            frames: 64,
            most_seam: 0.5,
        }
    }
}

/// How far the ends of a cycle were apart before they were joined.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Seam {
    /// Root mean square distance over the features of the body, metres.
    pub distance_m: f64,
    /// The same as a share of the motion's extent.
    pub share: f64,
    /// Farthest that closing moved a coordinate of a difference, radians or metres.
    pub moved: f64,
}

/// A clip that was cut, and what it took.
#[derive(Clone, Debug)]
pub struct Cut {
    /// The clip, ready to be written.
    pub clip: ClipFile,
    /// The seam as it was found.
    pub seam: Seam,
}

/// The pose of a take at frame `at`, with fractions: along the geodesic between its neighbours (for
/// rotations the spherical linear interpolation).
pub fn pose_at(take: &Take, space: &dyn PoseSpace, at: f64) -> Vec<f64> {
    let last = take.len().saturating_sub(1);
    let at = at.clamp(0.0, last as f64);
    let k = (at.floor() as usize).min(last.saturating_sub(1));
    let mut pose = take.poses[k].clone();
    let share = at - k as f64;
    if share > 0.0 && k < last {
        let mut way = vec![0.0; space.tangent_len()];
        space.diff(&take.poses[k], &take.poses[k + 1], &mut way);
        space.add(&mut pose, &way, share);
    }
    pose
}

/// The root of a take at frame `at`, with fractions: along the arc between its neighbours.
pub fn root_at(take: &Take, at: f64) -> RootPose {
    let last = take.len().saturating_sub(1);
    let at = at.clamp(0.0, last as f64);
    let k = (at.floor() as usize).min(last.saturating_sub(1));
    let mut root = take.roots[k];
    if k < last {
        root.travel(root.advance_to(&take.roots[k + 1]).scaled(at - k as f64));
    }
    root
}

/// Cuts one cycle of a take and closes it.
///
/// The difference of the ends is spread linearly over the cycle, half of it at either end, so that they
/// meet; what is left of the difference of their speeds is spread as a parabola that is zero at both ends,
/// so that slopes meet too. Travel becomes the clip's `root`, what is uneven in it `way`. `feet` give the
/// clip's segments.
///
/// # Errors
/// Fewer than 8 frames; a cycle that is not inside the take; ends that are too far apart.
pub fn cycle(
    take: &Take,
    body: &BodyModel,
    cycle: &Cycle,
    feet: &[FootContact],
    options: &CutOptions,
) -> Result<Cut, AnalysisError> {
    take.check(body)?;
    let n = options.frames;
    if !(8..=100_000).contains(&n) {
        return Err(AnalysisError::Options(format!(
            "{n} frames: a cycle needs 8 to 100000"
        )));
    }
    let (start, end) = (cycle.start as f64, cycle.start as f64 + cycle.frames);
    if !(cycle.frames > 2.0 && end < take.len() as f64) {
        return Err(AnalysisError::Options(format!(
            "cycle from frame {start} to {end:.1} is not inside the {} frames of {}",
            take.len(),
            take.name
        )));
    }
    let space = body.space();
    let at = |u: f64| start + u * cycle.frames;
    let mut poses: Vec<Vec<f64>> = (0..n)
        .map(|k| pose_at(take, space, at(k as f64 / n as f64)))
        .collect();
    let extent_m = super::cycle::Features::of(take, space).extent_m();
    let seam = close(space, &mut poses, &pose_at(take, space, end), extent_m);
    if seam.share > options.most_seam {
        return Err(AnalysisError::Seam {
            take: take.name.clone(),
            seam_m: seam.distance_m,
            share: 100.0 * seam.share,
            most: 100.0 * options.most_seam,
        });
    }
    let first = root_at(take, start);
    let way: Vec<RootPose> = (0..n)
        .map(|k| relative(&first, &root_at(take, at(k as f64 / n as f64))))
        .collect();
    let total = RootPose::default().advance_to(&relative(&first, &root_at(take, end)));
    let name = options.name.clone().unwrap_or_else(|| take.name.clone());
    let mut clip = file(take, name, ClipKind::Cycle, &poses, &way, total);
    clip.frequency_hz = cycle.frequency_hz;
    clip.segments = (feet.iter().zip(body.limbs()))
        .filter_map(|(foot, joints)| {
            Some(Segment {
                name: foot.name.clone(),
                joints: joints.clone(),
                phase: foot.phase?,
                duty: foot.duty,
            })
        })
        .collect();
    Ok(Cut { clip, seam })
}

/// The whole take as a path of `frames` frames.
///
/// # Errors
/// Fewer than 2 frames; a take that does not fit its body.
pub fn path(take: &Take, body: &BodyModel, frames: usize) -> Result<ClipFile, AnalysisError> {
    take.check(body)?;
    if !(2..=100_000).contains(&frames) {
        return Err(AnalysisError::Options(format!(
            "{frames} frames: a path needs 2 to 100000"
        )));
    }
    let last = (take.len() - 1) as f64;
    let at = |k: usize| last * k as f64 / (frames - 1) as f64;
    let poses: Vec<Vec<f64>> = (0..frames)
        .map(|k| pose_at(take, body.space(), at(k)))
        .collect();
    let way: Vec<RootPose> = (0..frames)
        .map(|k| relative(&take.roots[0], &root_at(take, at(k))))
        .collect();
    let total = way
        .last()
        .map(|end| RootPose::default().advance_to(end))
        .unwrap_or_default();
    let mut clip = file(
        take,
        take.name.clone(),
        ClipKind::Path,
        &poses,
        &way,
        total,
    );
    clip.duration_s = take.duration_s();
    Ok(clip)
}

/// The take backwards: the body goes the way it came.
pub fn reversed(take: &Take) -> Take {
    Take {
        poses: take.poses.iter().rev().cloned().collect(),
        roots: take.roots.iter().rev().copied().collect(),
        ..take.clone()
    }
}

/// `root` seen from `first`.
fn relative(first: &RootPose, root: &RootPose) -> RootPose {
    let place = first.to_local(nalgebra::Point3::new(root.x_m, root.y_m, 0.0));
    RootPose {
        x_m: place.x,
        y_m: place.y,
        yaw_rad: root.yaw_rad - first.yaw_rad,
    }
}

/// Closes `poses`, evenly over a cycle whose last pose would be `end`, one step after the last of them.
fn close(space: &dyn PoseSpace, poses: &mut [Vec<f64>], end: &[f64], extent_m: f64) -> Seam {
    let n = poses.len();
    let width = space.tangent_len();
    let between = |a: &[f64], b: &[f64]| {
        let mut way = vec![0.0; width];
        space.diff(a, b, &mut way);
        way
    };
    // The clip's first frame again should be `end`: this is missing.
    let gap = between(end, &poses[0]);
    let distance_m = space.distance(end, &poses[0]);
    // Slopes per cycle at either end, once the gap is closed.
    let (after, before) = (between(&poses[0], &poses[1]), between(&poses[n - 1], end));
    let kink: Vec<f64> = (after.iter().zip(before))
        .map(|(a, b)| (a - b) * n as f64)
        .collect();
    let mut moved = 0.0_f64;
    for (k, pose) in poses.iter_mut().enumerate() {
        let u = k as f64 / n as f64;
        let correction: Vec<f64> = (gap.iter().zip(&kink))
            .map(|(gap, kink)| gap * (u - 0.5) + kink * 0.5 * u * (u - 1.0))
            .collect();
        moved = correction.iter().fold(moved, |m, v| m.max(v.abs()));
        space.add(pose, &correction, 1.0);
    }
    Seam {
        distance_m,
        share: distance_m / extent_m.max(1e-9),
        moved,
    }
}

fn file(
    take: &Take,
    name: String,
    kind: ClipKind,
    poses: &[Vec<f64>],
    way: &[RootPose],
    root: RootAdvance,
) -> ClipFile {
    let (joints, skeleton) = match &take.body {
        TakeBody::Joints(names) | TakeBody::Floating(names) => (names.clone(), None),
        TakeBody::Skeleton(skeleton) => (
            skeleton.joints.iter().map(|j| j.name.clone()).collect(),
            Some((**skeleton).clone()),
        ),
    };
    let floating = matches!(take.body, TakeBody::Floating(_));
    let body = poses
        .iter()
        .filter(|_| floating)
        .filter_map(|pose| pose.get(joints.len()..)?.try_into().ok())
        .collect();
    let frames = (poses.iter())
        .map(|pose| match floating {
            true => pose[..joints.len()].to_vec(),
            false => pose.clone(),
        })
        .collect();
    let moves = way.iter().any(|r| r.x_m != 0.0 || r.y_m != 0.0 || r.yaw_rad != 0.0);
    ClipFile {
        handwave: "clip".into(),
        version: 1,
        name,
        origin: take.origin.clone(),
        kind,
        joints,
        frequency_hz: 0.0,
        duration_s: 0.0,
        root,
        segments: Vec::new(),
        skeleton,
        body,
        way: match moves {
            true => way.iter().map(|r| [r.x_m, r.y_m, r.yaw_rad]).collect(),
            false => Vec::new(),
        },
        frames,
    }
}
