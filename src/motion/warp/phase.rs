//! Phase offsets between cycles: every rotation is tried, the best one refined between samples.

use super::{Frames, WarpError, check_pair, mean, resampled_cycle};

/// Phases at which cycles are compared.
const PHASES: usize = 128;
/// A limb that moves less than this part of the largest limb's motion has no phase.
const STILL: f64 = 1e-3;

/// How two cycles fit at the best rotation.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct PhaseMatch {
    /// `b(phase + offset)` corresponds to `a(phase)`; cycles, above -0.5 to 0.5.
    pub offset_cycles: f64,
    /// Correlation of the deviations from the mean there, -1..1 (0 when one does not move).
    pub correlation: f64,
}

/// The rotation of cycle `b` that fits cycle `a` best: `b(phase + offset)` corresponds to `a(phase)`.
///
/// In cycles, above -0.5 to 0.5; 0 when one of them does not move. Size of movement and mean pose do not
/// matter.
pub fn phase_offset(a: &Frames, b: &Frames) -> Result<f64, WarpError> {
    Ok(phase_match(a, b)?.offset_cycles)
}

/// [`phase_offset`] with the correlation that it reaches.
pub fn phase_match(a: &Frames, b: &Frames) -> Result<PhaseMatch, WarpError> {
    check_pair(a, b)?;
    let a = centred(resampled_cycle(a, PHASES, 0.0));
    let b = centred(resampled_cycle(b, PHASES, 0.0));
    let columns: Vec<usize> = (0..a[0].len()).collect();
    Ok(best_rotation(&a, &b, &columns).unwrap_or(PhaseMatch {
        offset_cycles: 0.0,
        correlation: 0.0,
    }))
}

/// Per limb (its features) the rotation that aligns the derivatives of `clip` to those of
/// `reference` (linear time warp of derivatives, Rhodin 2016, 9.5.2, after Keogh and Pazzani 2001).
///
/// Same sense as [`phase_offset`]; `None` for a limb that does not move in one of the two. In eq. 9.7
/// the sign is the other way round: the limb of a clip is played at `phase + offset`.
pub fn limb_offsets(
    reference: &Frames,
    clip: &Frames,
    limbs: &[Vec<usize>],
) -> Result<Vec<Option<f64>>, WarpError> {
    check_pair(reference, clip)?;
    let features = reference[0].len();
    for (limb, columns) in limbs.iter().enumerate() {
        if let Some(feature) = columns.iter().find(|c| **c >= features) {
            return Err(WarpError::Limb {
                limb,
                feature: *feature,
                features,
            });
        }
    }
    let a = derivatives(&resampled_cycle(reference, PHASES, 0.0));
    let b = derivatives(&resampled_cycle(clip, PHASES, 0.0));
    let most = |frames: &[Vec<f64>]| {
        limbs
            .iter()
            .map(|columns| energy(frames, columns))
            .fold(0.0, f64::max)
    };
    let (most_a, most_b) = (most(&a), most(&b));
    Ok(limbs
        .iter()
        .map(|columns| {
            let moves = energy(&a, columns) > STILL * STILL * most_a
                && energy(&b, columns) > STILL * STILL * most_b;
            moves
                .then(|| best_rotation(&a, &b, columns))
                .flatten()
                .map(|m| m.offset_cycles)
        })
        .collect())
}

fn centred(mut frames: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let mean = mean(&frames);
    for frame in &mut frames {
        for (v, m) in frame.iter_mut().zip(&mean) {
            *v -= m;
        }
    }
    frames
}

fn derivatives(frames: &Frames) -> Vec<Vec<f64>> {
    let n = frames.len();
    (0..n)
        .map(|k| {
            let (before, after) = (&frames[(k + n - 1) % n], &frames[(k + 1) % n]);
            let slope = |(x, y): (&f64, &f64)| 0.5 * n as f64 * (y - x);
            before.iter().zip(after).map(slope).collect()
        })
        .collect()
}

fn energy(frames: &Frames, columns: &[usize]) -> f64 {
    frames
        .iter()
        .map(|f| columns.iter().map(|c| f[*c] * f[*c]).sum::<f64>())
        .sum()
}

/// The rotation with the largest correlation, refined by a parabola; `None` if one does not move.
fn best_rotation(a: &Frames, b: &Frames, columns: &[usize]) -> Option<PhaseMatch> {
    let (energy_a, energy_b) = (energy(a, columns), energy(b, columns));
    // What is left of a constant after its mean is taken off is rounding, no movement.
    if !(energy_a.min(energy_b) > 1e-18 * energy_a.max(energy_b)) {
        return None;
    }
    let scale = (energy_a * energy_b).sqrt();
    let n = a.len();
    let correlation: Vec<f64> = (0..n)
        .map(|shift| {
            let sum: f64 = (0..n)
                .map(|k| {
                    let (x, y) = (&a[k], &b[(k + shift) % n]);
                    columns.iter().map(|c| x[*c] * y[*c]).sum::<f64>()
                })
                .sum();
            sum / scale
        })
        .collect();
    let best = (0..n).max_by(|i, j| correlation[*i].total_cmp(&correlation[*j]))?;
    let (l, m, r) = (
        correlation[(best + n - 1) % n],
        correlation[best],
        correlation[(best + 1) % n],
    );
    let bend = l - 2.0 * m + r;
    let fine = if bend < 0.0 {
        0.5 * (l - r) / bend
    } else {
        0.0
    };
    let turn = (best as f64 + fine) / n as f64;
    Some(PhaseMatch {
        offset_cycles: turn - (turn - 0.5).ceil(),
        correlation: m - 0.25 * (l - r) * fine,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    fn cycle(frames: usize, offset: f64, size: f64) -> Vec<Vec<f64>> {
        (0..frames)
            .map(|k| {
                let phase = TAU * (k as f64 / frames as f64 - offset);
                vec![
                    size * phase.sin() + 0.3,
                    size * ((2.0 * phase).cos() * 0.3 + phase.cos() * 0.5),
                ]
            })
            .collect()
    }

    proptest! {
        #[test]
        fn a_rotation_is_found_between_frames(
            offset in -0.49..0.49f64, size in 0.2..3.0f64, frames in 20..60usize,
        ) {
            let found = phase_offset(&cycle(33, 0.0, 1.0), &cycle(frames, offset, size)).expect("cycles");
            let gap = (found - offset + 0.5).rem_euclid(1.0) - 0.5;
            prop_assert!(gap.abs() < 0.002, "{} for {}", found, offset);
        }
    }

    #[test]
    fn every_limb_has_its_own_offset_and_a_still_one_none() {
        let join = |a: Vec<Vec<f64>>, b: Vec<Vec<f64>>| -> Vec<Vec<f64>> {
            let rows = a.into_iter().zip(b);
            rows.map(|(a, b)| [a, b, vec![1.0]].concat()).collect()
        };
        let reference = join(cycle(40, 0.0, 1.0), cycle(40, 0.25, 1.0));
        let clip = join(cycle(40, 0.1, 1.0), cycle(40, 0.85, 0.5));
        let limbs = [vec![0, 1], vec![2, 3], vec![4]];
        let found = limb_offsets(&reference, &clip, &limbs).expect("cycles");
        for (limb, truth) in [(0, 0.1), (1, -0.4)] {
            let offset = found[limb].expect("it moves");
            assert!(
                (offset - truth).abs() < 0.002,
                "limb {limb}: {offset}, {truth} is true"
            );
        }
        assert_eq!(found[2], None);
        let wrong = limb_offsets(&reference, &clip, &[vec![5]]).expect_err("five features");
        assert!(
            matches!(
                wrong,
                WarpError::Limb {
                    limb: 0,
                    feature: 5,
                    features: 5
                }
            ),
            "{wrong}"
        );
    }

    #[test]
    fn a_cycle_that_does_not_move_has_offset_zero() {
        let still = vec![vec![0.3, 0.1]; 12];
        let found = phase_match(&cycle(33, 0.0, 1.0), &still).expect("cycles");
        assert_eq!((found.offset_cycles, found.correlation), (0.0, 0.0));
    }
}
