//! Ways through poses: the body over its feet, single feet where they are wanted.

use super::clip::{ClipFile, ClipKind};
use super::gait::{BodyPose, GaitDescription, GaitError};
use super::gait_stance::{Stance, Walker};
use super::smooth::ease;
use nalgebra::Vector3;

/// Frames between two poses.
const STEP_FRAMES: f64 = 16.0;
/// Most frames of a path.
const MOST_FRAMES: f64 = 256.0;

/// The clip of a description with poses.
pub(super) fn path_clip(
    description: &GaitDescription,
    walker: Walker<'_>,
) -> Result<ClipFile, GaitError> {
    for leg in description.pose.iter().flat_map(|p| p.feet.keys()) {
        if !walker.legs.iter().any(|l| l.name == *leg) {
            let names: Vec<&str> = walker.legs.iter().map(|l| l.name.as_str()).collect();
            return Err(GaitError::Value {
                key: "pose.feet",
                problem: format!("leg {leg} is not one of {}", names.join(", ")),
            });
        }
    }
    let stance = Stance::new(description, walker);
    let mut file = stance.empty_file(description, ClipKind::Path);
    let times = description.pose_times()?;
    let shortest = times.windows(2).map(|w| w[1] - w[0]).fold(1.0, f64::min);
    let frames = (STEP_FRAMES / shortest).round().min(MOST_FRAMES) as usize;
    let mut positions = stance.stand()?;
    let mut from = 0;
    for k in 0..=frames {
        let u = k as f64 / frames as f64;
        while from + 2 < times.len() && u > times[from + 1] {
            from += 1;
        }
        let w = ease(((u - times[from]) / (times[from + 1] - times[from])).clamp(0.0, 1.0));
        let (a, b) = (&description.pose[from], &description.pose[from + 1]);
        let root = stance.root_pose(&body_at(a, b, w, &stance));
        for (i, leg) in walker.legs.iter().enumerate() {
            let way = |pose: &BodyPose| {
                pose.feet
                    .get(&leg.name)
                    .map_or_else(Vector3::zeros, |v| Vector3::from(*v))
            };
            let foot = stance.neutral[i] + way(a).lerp(&way(b), w);
            stance.place(i, &root, foot, &mut positions)?;
        }
        file.frames.push(positions.clone());
        file.body.push(Stance::body_row(&root));
    }
    Ok(file)
}

/// Place of the body between two poses.
fn body_at(a: &BodyPose, b: &BodyPose, w: f64, stance: &Stance<'_>) -> [f64; 6] {
    let row = |p: &BodyPose| {
        [
            p.forward_m,
            p.left_m,
            p.body_height_m.unwrap_or(stance.body_height_m),
            p.roll_rad,
            p.pitch_rad,
            p.yaw_rad,
        ]
    };
    let (a, b) = (row(a), row(b));
    std::array::from_fn(|i| a[i] + w * (b[i] - a[i]))
}
