//! Parameters for the clips of a suggested class: amplitude from the stride, frequency as authored, turn rate.

use crate::motion::clip::{Clip, ClipKind};
use crate::motion::weights::Parameters;
use std::f64::consts::TAU;

/// Frequencies this near each other are one tempo: among those the largest clip has amplitude 1.
const SAME_TEMPO: f64 = 0.25;
/// Clips whose turn rates differ by this much, rad/s, need it as a parameter.
const TURNS: f64 = 0.1;

/// Suggested parameters of one clip.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Suggested {
    /// Amplitude, 0..1; 0 for a clip that stands still. Of a path: how far it goes.
    pub amplitude: f64,
    /// Frequency, Hz; 0 for a path or a rest pose.
    pub frequency_hz: f64,
    /// Turn rate, rad/s, where clips of the class differ in it.
    pub turn_rate: Option<f64>,
    /// What the amplitude was read from: travel per cycle, m (or the movement's size when nothing
    /// travels).
    pub stride_m: f64,
}

impl Suggested {
    /// As a point of the parameter space.
    pub fn parameters(&self) -> Parameters {
        match self.turn_rate {
            None => [self.amplitude, self.frequency_hz].into(),
            Some(turn) => [self.amplitude, self.frequency_hz, turn].into(),
        }
    }
}

/// Parameters for the clips of one class; `spreads_m` are the sizes of their movements
/// ([`crate::motion::warp::FeatureClip::spread`]).
///
/// Amplitude is the stride over the longest stride at about the same frequency; where nothing travels, the
/// movement's size takes the stride's place.
pub fn suggest_parameters(clips: &[&Clip], spreads_m: &[f64]) -> Vec<Suggested> {
    let most = spreads_m.iter().copied().fold(0.0, f64::max);
    let still = |i: usize| spreads_m[i] <= crate::motion::warp::STILL * most;
    let travel = |c: &Clip| c.root.forward_m.hypot(c.root.left_m);
    let travels = clips.iter().any(|c| travel(c) > 1e-3);
    let size = |i: usize| {
        if travels {
            // A turn on the spot travels too: as far as its feet at the movement's size.
            travel(clips[i]).max(clips[i].root.yaw_rad.abs() / TAU * spreads_m[i])
        } else {
            spreads_m[i]
        }
    };
    let rate = |c: &Clip| c.root.yaw_rad * c.frequency_hz;
    let rates = || clips.iter().map(|c| rate(c));
    let turning =
        rates().fold(f64::NEG_INFINITY, f64::max) - rates().fold(f64::INFINITY, f64::min) > TURNS;
    (0..clips.len())
        .map(|i| {
            let clip = clips[i];
            let longest = (0..clips.len())
                .filter(|j| {
                    let (a, b) = (clip.frequency_hz, clips[*j].frequency_hz);
                    (a - b).abs() <= SAME_TEMPO * a.max(b)
                })
                .map(size)
                .fold(0.0, f64::max);
            let share = if longest > 0.0 {
                size(i) / longest
            } else {
                1.0
            };
            let path = clip.kind == ClipKind::Path;
            Suggested {
                amplitude: if still(i) {
                    0.0
                } else {
                    share.clamp(0.05, 1.0)
                },
                frequency_hz: if path || still(i) {
                    0.0
                } else {
                    clip.frequency_hz
                },
                turn_rate: turning.then(|| rate(clip)),
                stride_m: size(i),
            }
        })
        .collect()
}
