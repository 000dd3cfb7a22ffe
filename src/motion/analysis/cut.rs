//! Making clips of takes: one cycle resampled to phase, its seam closed; reversed takes.

use super::{AnalysisError, BodyModel, Cycle, FootContact};
use crate::body::PoseSpace;
use crate::motion::clip::{ClipFile, ClipKind, Segment};
use crate::motion::take::Take;

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

/// Smoothing a kink moves a coordinate by at most this share of its range.
const MOST_BENT: f64 = 0.05;

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
    let mut part = take.part(start * take.dt_s, end * take.dt_s, n + 1);
    let extent_m = super::cycle::Features::of(take, body.space()).extent_m();
    let seam = close(body.space(), &mut part.poses, extent_m);
    if seam.share > options.most_seam {
        return Err(AnalysisError::Seam {
            take: take.name.clone(),
            seam_m: seam.distance_m,
            share: 100.0 * seam.share,
            most: 100.0 * options.most_seam,
        });
    }
    if let Some(name) = &options.name {
        part.name.clone_from(name);
    }
    let mut clip = part.to_clip(ClipKind::Cycle, n);
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

/// The take backwards: the body goes the way it came.
pub fn reversed(take: &Take) -> Take {
    Take {
        poses: take.poses.iter().rev().cloned().collect(),
        roots: take.roots.iter().rev().copied().collect(),
        ..take.clone()
    }
}

/// Closes `poses`, evenly over a cycle: the last one becomes the first.
fn close(space: &dyn PoseSpace, poses: &mut [Vec<f64>], extent_m: f64) -> Seam {
    let n = poses.len() - 1;
    let between = |a: &[f64], b: &[f64]| {
        let mut way = vec![0.0; space.tangent_len()];
        space.diff(a, b, &mut way);
        way
    };
    let gap = between(&poses[n], &poses[0]);
    let distance_m = space.distance(&poses[n], &poses[0]);
    // Slopes per cycle at either end, to second order: a motion that only bends there has no kink. A hard
    // kink is left to the spline: smoothing it away would bend the whole cycle.
    let step = |k: usize| between(&poses[k], &poses[k + 1]);
    let (a, b, y, z) = (step(0), step(1), step(n - 2), step(n - 1));
    let from_first: Vec<Vec<f64>> = poses.iter().map(|p| between(&poses[0], p)).collect();
    let kink: Vec<f64> = (0..gap.len())
        .map(|c| {
            let (after, before) = (1.5 * a[c] - 0.5 * b[c], 1.5 * z[c] - 0.5 * y[c]);
            let values = from_first.iter().map(|v| v[c]);
            let range = values.clone().fold(0.0, f64::max) - values.fold(0.0, f64::min);
            let most = 8.0 * MOST_BENT * range;
            ((after - before) * n as f64).clamp(-most, most)
        })
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
