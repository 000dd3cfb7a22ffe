//! Guidance: which source poses would teach a map most.
//!
//! Rhodin 2016, section 8.3: for a recorded source the largest local maxima of q are the candidates
//! for the next pair; after each pair that is accepted q is computed anew.

use super::regression::Uncertainty;

/// Candidates offered for a target pose (section 8.3: 5).
pub const CANDIDATES: usize = 5;
/// A candidate is the largest within this time to either side: trackers tremble.
pub const CANDIDATE_APART_S: f64 = 0.15;

/// A source pose that would teach much.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Index of the frame.
    pub frame: usize,
    /// Its time, seconds.
    pub t_s: f64,
    /// Its uncertainty q (eq. 8.3).
    pub q: f64,
    /// q as a share of what it was before any pair was given, 0..1: the bar from red to green.
    pub share: f64,
}

/// The `most` largest local maxima of q over `frames` (scaled features), largest first.
///
/// `times_s` rise. A local maximum is the largest of all frames within [`CANDIDATE_APART_S`]; ends of
/// the recording count.
pub fn candidates(
    uncertainty: &Uncertainty,
    times_s: &[f64],
    frames: &[Vec<f64>],
    most: usize,
) -> Vec<Candidate> {
    let mut scratch = vec![0.0; uncertainty.scratch_len()];
    let all: Vec<Candidate> = frames
        .iter()
        .zip(times_s)
        .enumerate()
        .map(|(frame, (x, t_s))| {
            let q = uncertainty.q(x, &mut scratch);
            Candidate {
                frame,
                t_s: *t_s,
                q,
                share: q / uncertainty.prior(x),
            }
        })
        .collect();
    let mut found: Vec<Candidate> = Vec::new();
    for candidate in &all {
        let near = |other: &&Candidate| (other.t_s - candidate.t_s).abs() <= CANDIDATE_APART_S;
        let before = all[..candidate.frame].iter().rev().take_while(near);
        let after = all[candidate.frame + 1..].iter().take_while(near);
        // Of equal neighbours the first counts.
        if before.into_iter().all(|other| other.q < candidate.q)
            && after.into_iter().all(|other| other.q <= candidate.q)
        {
            found.push(*candidate);
        }
    }
    found.sort_by(|a, b| b.q.total_cmp(&a.q));
    found.truncate(most);
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One number that swings: +3 at 0.5 s, -2 at 1.5 s, +1 at 2.5 s.
    fn swing() -> (Vec<f64>, Vec<Vec<f64>>) {
        let times: Vec<f64> = (0..301).map(|k| f64::from(k) * 0.01).collect();
        let frames = times
            .iter()
            .map(|t| {
                let size = 3.5 - t;
                vec![size.floor().max(1.0) * (std::f64::consts::PI * t).sin()]
            })
            .collect();
        (times, frames)
    }

    #[test]
    fn an_accepted_pair_is_not_offered_again() {
        let (times, frames) = swing();
        let blank = Uncertainty::new(1, &[], 0.05);
        let first = candidates(&blank, &times, &frames, 5);
        assert!((first[0].t_s - 0.5).abs() < 0.02, "{first:?}");
        assert_eq!(first[0].share, 1.0);
        assert!(first.windows(2).all(|pair| pair[0].q >= pair[1].q));
        let taught = vec![frames[first[0].frame].clone()];
        let told = Uncertainty::new(1, &taught, 0.05);
        let second = candidates(&told, &times, &frames, 5);
        assert!(
            (second[0].t_s - 1.5).abs() < 0.02,
            "the other side teaches more now: {second:?}"
        );
        let mut scratch = [0.0; 1];
        let q = told.q(&frames[first[0].frame], &mut scratch);
        assert!(q < 0.06, "q at a taught pose {q}, about the noise expected");
    }
}
