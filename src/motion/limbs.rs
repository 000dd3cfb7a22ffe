//! Limb timelines of a class: which coordinates belong to which limb, and each clip's offset per limb.

use super::class::ClassError;
use super::clip::Clip;
use crate::base::angle::wrap_pi;
use std::f64::consts::TAU;

/// Limbs of a class and their timelines.
pub(super) struct Timelines {
    /// Limb names.
    pub(super) limbs: Vec<String>,
    /// Limb of each coordinate.
    pub(super) limb_of: Vec<Option<usize>>,
    /// Per clip the offset of every limb's timeline against the reference, rad; brought into half a turn of
    /// it. `None` for a clip whose limbs do not move.
    pub(super) offsets: Vec<Option<Vec<f64>>>,
}

/// The timelines of `clips`, with the limbs of the reference: the slowest moving clip (the longest).
pub(super) fn timelines(
    class: &str,
    clips: &[&Clip],
    coordinates: usize,
) -> Result<Timelines, ClassError> {
    let moves = |clip: &Clip| clip.limbs.iter().any(|l| l.duty < 1.0);
    let slowest = |clips: &mut dyn Iterator<Item = &'_ &'_ Clip>| {
        clips
            .min_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz))
            .map(|c| c.limbs.clone())
    };
    let moving = slowest(&mut clips.iter().filter(|c| moves(c)));
    let reference = moving
        .clone()
        .or_else(|| slowest(&mut clips.iter().filter(|c| !c.limbs.is_empty())));
    let mut limb_of = vec![None; coordinates];
    let Some(reference) = reference else {
        return Ok(Timelines {
            limbs: Vec::new(),
            limb_of,
            offsets: vec![None; clips.len()],
        });
    };
    for (i, limb) in reference.iter().enumerate() {
        for coordinate in &limb.coordinates {
            limb_of[*coordinate] = Some(i);
        }
    }
    let offsets = clips
        .iter()
        .map(|clip| {
            if !moves(clip) {
                return Ok(None);
            }
            reference
                .iter()
                .map(|wanted| {
                    clip.limbs
                        .iter()
                        .find(|l| l.name == wanted.name)
                        .map(|l| wrap_pi(TAU * (wanted.phase - l.phase)))
                        .ok_or_else(|| ClassError::Limbs {
                            class: class.into(),
                            clip: clip.name.clone(),
                            segment: wanted.name.clone(),
                        })
                })
                .collect::<Result<Vec<f64>, _>>()
                .map(Some)
        })
        .collect::<Result<_, _>>()?;
    Ok(Timelines {
        limbs: reference.into_iter().map(|l| l.name).collect(),
        limb_of,
        offsets,
    })
}
