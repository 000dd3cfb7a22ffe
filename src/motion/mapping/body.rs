//! A map file fitted to a body: joint order, and target motion from clips.

use super::error::MappingError;
use super::file::{MapFile, MapFileError, VolumeSource};
use super::root::RootMap;
use super::volume::LatentVolume;
use crate::base::suggest::hint;
use crate::motion::clip::{Clip, ClipKind};

/// Frames taken of every clip.
const FRAMES_OF_A_CLIP: usize = 128;

/// All frames of `clips`, evenly over each, one pose per row.
pub fn target_frames(clips: &[Clip]) -> Vec<Vec<f64>> {
    let mut frames = Vec::new();
    for clip in clips {
        for k in 0..FRAMES_OF_A_CLIP {
            let mut frame = vec![0.0; clip.coordinates()];
            clip.pose(place(clip, k), &mut frame);
            frames.push(frame);
        }
    }
    frames
}

/// Where frame `k` of a clip is, as fraction of the cycle or progression.
fn place(clip: &Clip, k: usize) -> f64 {
    let steps = match clip.kind {
        ClipKind::Cycle => FRAMES_OF_A_CLIP,
        ClipKind::Path => FRAMES_OF_A_CLIP - 1,
    };
    k as f64 / steps as f64
}

/// Learns the volume and the root map from unlabelled `clips`, keeping at most `components` axes.
///
/// A cycle is taken at the frequency it was made for. A path leads from one pose to another within a
/// second and does not travel.
///
/// # Errors
/// No clips, clips that do not move.
pub fn learn_volume(
    clips: &[Clip],
    components: usize,
) -> Result<(LatentVolume, RootMap), MappingError> {
    let volume = LatentVolume::learn(&target_frames(clips), components)?;
    let (mut speeds, mut velocities) = (Vec::new(), Vec::new());
    let joints = volume.joints();
    let (mut ahead, mut behind) = (vec![0.0; joints], vec![0.0; joints]);
    let step = 0.5 / FRAMES_OF_A_CLIP as f64;
    for clip in clips {
        let (hz, travels) = match clip.kind {
            ClipKind::Cycle => (clip.frequency_hz, 1.0),
            ClipKind::Path => (1.0, 0.0),
        };
        for k in 0..FRAMES_OF_A_CLIP {
            clip.pose(place(clip, k) + step, &mut ahead);
            clip.pose(place(clip, k) - step, &mut behind);
            for (ahead, behind) in ahead.iter_mut().zip(&behind) {
                *ahead = (*ahead - behind) * hz / (2.0 * step);
            }
            let speed = volume.axes.chunks_exact(joints);
            let speed = speed.map(|axis| axis.iter().zip(&ahead).map(|(a, v)| a * v).sum());
            speeds.push(speed.collect());
            velocities.push([
                travels * clip.root.forward_m * hz,
                travels * clip.root.left_m * hz,
            ]);
        }
    }
    let root = RootMap::learn(&speeds, &velocities, strongest(&speeds))?;
    Ok((volume, root.scaled_to(&speeds, &velocities)))
}

/// Root of the summed squared speed of the axis that moves most: the ridge of the root map.
///
/// With the small ridge of the thesis eq. 8.1 explains a steady walk best by its overtones: weak axes,
/// which hardly rest, with large weights. A map learned from few pairs does not move them, and the body
/// would stand. A ridge as large as the strongest axis spreads the weights over axes as they move; what
/// it takes from the speed [`RootMap::scaled_to`] gives back.
fn strongest(speeds: &[Vec<f64>]) -> f64 {
    let axes = speeds.first().map_or(0, Vec::len);
    (0..axes)
        .map(|axis| speeds.iter().map(|s| s[axis] * s[axis]).sum::<f64>())
        .fold(0.0, f64::max)
        .sqrt()
}

impl MapFile {
    /// The same map with poses in the order of `body`'s joints.
    ///
    /// # Errors
    /// Joints that the body lacks, joints of the body that the map lacks.
    pub fn for_body(mut self, body: &[String]) -> Result<Self, MapFileError> {
        let wrong = |found: String, allowed: &str| MapFileError::Value {
            key: "target.joints".into(),
            found,
            allowed: allowed.into(),
        };
        if let Some(stranger) = self.joints.iter().find(|j| !body.contains(j)) {
            let hint = hint(stranger, body.iter().map(String::as_str));
            let found = format!("joint {stranger:?}, which the robot does not have{hint}");
            return Err(wrong(found, &body.join(", ")));
        }
        let column: Vec<usize> = body
            .iter()
            .map(|joint| {
                let found = self.joints.iter().position(|j| j == joint);
                found.ok_or_else(|| {
                    let found = format!("no joint {joint:?}, which the robot has");
                    wrong(found, "all joints of the robot; learn the map for it")
                })
            })
            .collect::<Result<_, _>>()?;
        let sort = |row: &[f64]| -> Vec<f64> { column.iter().map(|c| row[*c]).collect() };
        if let VolumeSource::Volume(volume, _) = &mut self.volume {
            volume.mean = sort(&volume.mean);
            let axes = volume.axes.chunks_exact(column.len()).flat_map(sort);
            volume.axes = axes.collect();
        }
        for pair in &mut self.pairs {
            pair.pose = sort(&pair.pose);
        }
        self.joints = body.to_vec();
        Ok(self)
    }
}
