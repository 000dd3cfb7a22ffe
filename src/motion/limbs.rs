//! Limb timelines of a class: which joints belong to which limb, and each clip's offset per limb.

use super::class::ClassError;
use super::clip::Clip;
use crate::base::angle::wrap_pi;
use std::f64::consts::TAU;

/// Limb of each joint, and per clip the offset of every limb's timeline against the reference.
///
/// The reference is the slowest moving clip (the longest); offsets are brought into half a turn of it.
pub(super) type Timelines = (Vec<Option<usize>>, Vec<Option<Vec<f64>>>);

/// The timelines of `clips`, with the limbs of the reference.
pub(super) fn timelines(
    class: &str,
    clips: &[&Clip],
    joints: usize,
) -> Result<Timelines, ClassError> {
    let moves = |clip: &Clip| !clip.limbs.is_empty() && clip.limbs.iter().any(|l| l.duty < 1.0);
    let reference = clips
        .iter()
        .filter(|c| moves(c))
        .min_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    let mut limb_of = vec![None; joints];
    let Some(reference) = reference else {
        return Ok((limb_of, vec![None; clips.len()]));
    };
    for (i, limb) in reference.limbs.iter().enumerate() {
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
                .limbs
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
    Ok((limb_of, offsets))
}
