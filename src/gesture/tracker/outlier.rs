//! Points that jump for a sample or two and come back: taken as not seen.
//!
//! A causal relative of the Hampel filter for irregular time stamps. Where Hampel compares a value
//! with the median of its neighbours, a moving point is compared with the nearer of where it was
//! and where its way would have led; the spread is an order statistic of how far off those guesses
//! usually are. Fast movement is predictable or makes the guesses usually bad: either way it passes.
//! What stays surprising for a third sample, or for a tenth of a second, is believed: a step or a
//! sudden movement is an outlier for two samples at most.

use super::track::{Allowance, Track};

/// Surprising samples in a row that are not believed.
const DOUBTED: u8 = 2;
/// A point that has been doubted for this long is believed, seconds.
const DOUBTED_S: f64 = 0.1;
/// Share of the gestures' reach that a point may always be off.
const STILL_SHARE: f64 = 0.25;
/// A movement as large as the gestures may set in with the acceleration of a wave of 3.5 Hz, 1/s^2.
const ONSET_1_S2: f64 = 500.0;

#[derive(Copy, Clone, Debug, Default)]
struct Doubt {
    in_a_row: u8,
    since: f64,
    place: [f64; 3],
}

/// Judges every point of every sample by its own recent way.
#[derive(Clone, Debug)]
pub(in crate::gesture) struct OutlierFilter {
    tracks: Vec<Track>,
    doubts: Vec<Doubt>,
    allowance: Allowance,
    rejected: u64,
}

impl OutlierFilter {
    /// A filter for `points` points whose gestures reach as far as `reach_m` from their middle.
    pub fn new(points: usize, reach_m: f64) -> Self {
        Self {
            tracks: vec![Track::default(); points],
            doubts: vec![Doubt::default(); points],
            allowance: Allowance {
                still_m: STILL_SHARE * reach_m,
                onset_m_s2: ONSET_1_S2 * reach_m,
            },
            rejected: 0,
        }
    }

    /// The points' ways, for whoever must know which point is which.
    pub(super) fn tracks(&mut self) -> (&mut [Track], Allowance) {
        (&mut self.tracks, self.allowance)
    }

    /// Clears `seen` of points that jumped. Places of points that are not seen are not read.
    pub fn pass(&mut self, t: f64, places: &[[f64; 3]], seen: &mut [bool]) {
        for (index, seen) in seen.iter_mut().enumerate().filter(|(_, seen)| **seen) {
            let (track, doubt) = (&mut self.tracks[index], &mut self.doubts[index]);
            let place = places[index];
            let surprise = track.judge(t, place, self.allowance);
            if surprise.fits() {
                track.take(t, place, surprise);
                doubt.in_a_row = 0;
            } else if doubt.in_a_row >= DOUBTED
                || (doubt.in_a_row > 0 && !(t - doubt.since < DOUBTED_S))
            {
                // It stays there: a step, after which all is as before. It does not: a movement of
                // another kind, of which nothing is known yet.
                let squared: f64 = (0..3).map(|a| (place[a] - doubt.place[a]).powi(2)).sum();
                track.restart(t, place, squared.sqrt() <= surprise.allowed_m);
                doubt.in_a_row = 0;
            } else {
                if doubt.in_a_row == 0 {
                    doubt.since = t;
                }
                doubt.in_a_row += 1;
                doubt.place = place;
                *seen = false;
                self.rejected += 1;
            }
        }
    }

    /// Points rejected since the last reset.
    pub fn rejected(&self) -> u64 {
        self.rejected
    }

    /// Forgets all samples.
    pub fn reset(&mut self) {
        self.tracks.iter_mut().for_each(Track::reset);
        self.doubts.fill(Doubt::default());
        self.rejected = 0;
    }
}
