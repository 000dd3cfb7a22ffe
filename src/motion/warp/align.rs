//! All clips of a class on one timeline: reference, phase offsets, warps, limb offsets, figures.

use super::dtw::{DtwOptions, dtw};
use super::phase::{limb_offsets, phase_match};
use super::{FeatureClip, SAMPLES, Warp, WarpError, distance_sq, mean, resampled_cycle, sampled};

/// Below this part of the other clip's movement a clip counts as still (a rest pose).
pub(in crate::motion) const STILL: f64 = 0.02;

/// How two clips fit after alignment.
#[derive(Clone, Debug, PartialEq)]
pub struct PairMatch {
    /// Rotation of the second cycle, cycles; 0 for paths.
    pub offset_cycles: f64,
    /// The warp from the first to the (rotated) second clip; its `cost` is [`Self::shape`].
    pub warp: Warp,
    /// Squared distance of the warped movements, their means taken off and their sizes made equal,
    /// as a share of what random pairing gives: 0 for the same movement, near 1 for unrelated ones.
    pub shape: f64,
    /// [`Self::shape`] with every limb of the first clip rotated on its own instead of a warp: gaits
    /// differ in when a leg moves more than in how. Equal to `shape` without limbs or for paths.
    pub by_limb: f64,
    /// Distance of the mean poses over the size of the movements (root mean square).
    pub place: f64,
    /// One of the two does not move: shape says nothing.
    pub still: bool,
}

/// One clip on the class's timeline.
#[derive(Clone, Debug, PartialEq)]
pub struct Aligned {
    /// Name of the clip.
    pub name: String,
    /// The clip at `s` of the reference is played at `offset_cycles + warp.at(s)` (cycles; a path has
    /// no offset).
    pub offset_cycles: f64,
    /// The warp from the reference.
    pub warp: Warp,
    /// Normalised warp cost against the reference, see [`PairMatch::shape`].
    pub cost: f64,
    /// Per limb the offset against the slowest clip, cycles, see [`super::limb_offsets`]; `None` for one
    /// that does not move. Empty for paths.
    pub limb_offsets: Vec<Option<f64>>,
}

/// The clips of a class, aligned.
#[derive(Clone, Debug, PartialEq)]
pub struct Alignment {
    /// Index of the clip that the others are warped to: the medoid of the moving ones.
    pub reference: usize,
    /// Index of the clip that limbs are compared with: the longest.
    pub limb_reference: usize,
    /// One per clip.
    pub clips: Vec<Aligned>,
    /// Clips x clips, row-major: how each pair fits.
    pub pairs: Vec<Option<PairMatch>>,
}

impl Alignment {
    /// How clips `a` and `b` fit; `None` for a clip with itself.
    pub fn pair(&self, a: usize, b: usize) -> Option<&PairMatch> {
        self.pairs.get(a * self.clips.len() + b)?.as_ref()
    }
}

/// Aligns two clips of one kind.
pub fn match_pair(a: &FeatureClip, b: &FeatureClip) -> Result<PairMatch, WarpError> {
    a.check(a.features())?;
    b.check(a.features())?;
    if a.cyclic != b.cyclic {
        return Err(WarpError::MixedKinds {
            clip: b.name.clone(),
            first: a.name.clone(),
            cyclic: b.cyclic,
        });
    }
    let (size_a, size_b) = (a.spread(), b.spread());
    let size = (0.5 * (size_a * size_a + size_b * size_b)).sqrt();
    let gap = distance_sq(&mean(&a.frames), &mean(&b.frames)).sqrt();
    let place = if size > 1e-9 {
        gap / size
    } else if gap > 1e-9 {
        f64::INFINITY
    } else {
        0.0
    };
    if size_a.min(size_b) <= (STILL * size_a.max(size_b)).max(1e-9) {
        return Ok(PairMatch {
            offset_cycles: 0.0,
            warp: Warp::identity(),
            shape: 0.0,
            by_limb: 0.0,
            place,
            still: true,
        });
    }
    let (offset_cycles, warp) = if a.cyclic {
        cyclic_warp(a, b, size_a, size_b)?
    } else {
        let (x, y) = (normalised(a, 0.0, size_a), normalised(b, 0.0, size_b));
        (0.0, dtw(&x, &y, &[], DtwOptions::default())?)
    };
    let by_limb = if a.cyclic && !a.limbs.is_empty() {
        limb_cost(a, b, size_a, size_b)?
    } else {
        warp.cost
    };
    Ok(PairMatch {
        offset_cycles,
        shape: warp.cost,
        by_limb,
        warp,
        place,
        still: false,
    })
}

/// Offset and warp of two cycles.
///
/// A warp starts and ends with paired frames, and the best rotation alone need not pair any: a
/// first warp tells what belongs to the middle of the cycle, the next one starts there. It also tells
/// how long `b` dwells where `a` does, which its mean and size depend on.
fn cyclic_warp(
    a: &FeatureClip,
    b: &FeatureClip,
    size_a: f64,
    size_b: f64,
) -> Result<(f64, Warp), WarpError> {
    let mut seam = phase_match(&a.frames, &b.frames)?.offset_cycles;
    let options = DtwOptions::default();
    let mut warp = dtw(
        &normalised(a, 0.0, size_a),
        &normalised(b, seam, size_b),
        &[],
        options,
    )?;
    for pass in 1..=2 {
        let start = 0.5 * f64::from(pass % 2);
        let paired = FeatureClip {
            frames: (0..SAMPLES)
                .map(|k| {
                    let mut frame = Vec::new();
                    let t = seam + warp.at(k as f64 / SAMPLES as f64);
                    sampled(&b.frames, true, t, &mut frame);
                    frame
                })
                .collect(),
            limbs: Vec::new(),
            ..b.clone()
        };
        seam += warp.at(0.5);
        let dwelling = mean(&paired.frames);
        let y = scaled(b, seam, &dwelling, paired.spread().max(0.5 * size_b));
        warp = dtw(&normalised(a, start, size_a), &y, &[], options)?;
    }
    // Two halves of a turn were gone round: the last warp starts where the reference does.
    Ok((seam - (seam - 0.5).ceil(), warp))
}

/// Cost with every limb rotated on its own, the other features by the offset of the whole.
fn limb_cost(a: &FeatureClip, b: &FeatureClip, size_a: f64, size_b: f64) -> Result<f64, WarpError> {
    let offsets = limb_offsets(&a.frames, &b.frames, &a.limbs)?;
    let whole = phase_match(&a.frames, &b.frames)?.offset_cycles;
    let fixed = normalised(a, 0.0, size_a);
    let mut turned = normalised(b, whole, size_b);
    for (limb, offset) in a.limbs.iter().zip(offsets) {
        let own = normalised(b, offset.unwrap_or(whole), size_b);
        for (to, from) in turned.iter_mut().zip(&own) {
            for c in limb {
                to[*c] = from[*c];
            }
        }
    }
    let pairs = fixed.len();
    let met: f64 = (0..pairs).map(|k| distance_sq(&fixed[k], &turned[k])).sum();
    let random: f64 = fixed
        .iter()
        .map(|x| turned.iter().map(|y| distance_sq(x, y)).sum::<f64>())
        .sum();
    Ok(met / (random / pairs as f64))
}

/// Deviations from the mean with root mean square 1; a cycle begins at `offset` and is closed.
fn normalised(clip: &FeatureClip, offset: f64, size: f64) -> Vec<Vec<f64>> {
    scaled(clip, offset, &mean(&clip.frames), size)
}

/// Deviations from `centre` over `size`; a cycle begins at `offset` and is closed.
fn scaled(clip: &FeatureClip, offset: f64, centre: &[f64], size: f64) -> Vec<Vec<f64>> {
    let mut frames = if clip.cyclic {
        resampled_cycle(&clip.frames, SAMPLES, offset)
    } else {
        (0..SAMPLES)
            .map(|k| {
                let mut frame = Vec::new();
                let u = k as f64 / (SAMPLES - 1) as f64;
                sampled(&clip.frames, false, u, &mut frame);
                frame
            })
            .collect()
    };
    for frame in &mut frames {
        for (v, m) in frame.iter_mut().zip(centre) {
            *v = (*v - m) / size;
        }
    }
    if clip.cyclic {
        frames.push(frames[0].clone());
    }
    frames
}

/// Aligns the clips of a class: each is warped to the medoid, limbs are compared with the longest.
///
/// A still clip (rest pose) keeps the identity. Clips need the same features and are all cycles or
/// all paths; whether they belong together is for [`crate::motion::suggest`].
pub fn align(clips: &[FeatureClip]) -> Result<Alignment, WarpError> {
    let first = clips.first().ok_or(WarpError::Empty)?;
    first.check(first.features())?;
    let n = clips.len();
    let mut pairs = vec![None; n * n];
    for a in 0..n {
        for b in 0..n {
            if a != b {
                pairs[a * n + b] = Some(match_pair(&clips[a], &clips[b])?);
            }
        }
    }
    let largest = clips.iter().map(FeatureClip::spread).fold(0.0, f64::max);
    let moves = |i: &usize| clips[*i].spread() > STILL * largest;
    let cost = |a: usize| -> f64 {
        let row = pairs[a * n..(a + 1) * n].iter().flatten();
        row.filter(|p| !p.still).map(|p| p.shape).sum()
    };
    let reference = (0..n)
        .filter(moves)
        .min_by(|a, b| cost(*a).total_cmp(&cost(*b)))
        .unwrap_or(0);
    let limb_reference = (0..n)
        .filter(moves)
        .rev()
        .max_by(|a, b| clips[*a].duration_s.total_cmp(&clips[*b].duration_s))
        .unwrap_or(0);
    let mut aligned = Vec::with_capacity(n);
    for (i, clip) in clips.iter().enumerate() {
        let pair = pairs[reference * n + i].clone();
        let limb_offsets = if clip.cyclic {
            limb_offsets(
                &clips[limb_reference].frames,
                &clip.frames,
                &clips[limb_reference].limbs,
            )?
        } else {
            Vec::new()
        };
        let (offset_cycles, warp) =
            pair.map_or((0.0, Warp::identity()), |p| (p.offset_cycles, p.warp));
        aligned.push(Aligned {
            name: clip.name.clone(),
            offset_cycles,
            cost: warp.cost,
            warp,
            limb_offsets,
        });
    }
    Ok(Alignment {
        reference,
        limb_reference,
        clips: aligned,
        pairs,
    })
}
