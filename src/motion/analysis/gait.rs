//! What a person would call a gait, from touch-down phases and duty.

use super::FootContact;
use std::fmt;

/// A gait by the order in which feet touch down. After Hildebrand, The quadrupedal gaits of vertebrates
/// (1989). A help for people, nothing is decided by it.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Gait {
    /// All feet are down nearly all the time.
    Stand,
    /// Two feet in turn, always one down; four feet one after the other.
    Walk,
    /// Two feet in turn with flight between.
    Run,
    /// Both feet of two together.
    Hop,
    /// Diagonal feet together.
    Trot,
    /// Feet of one side together.
    Pace,
    /// Front feet together, rear feet together.
    Bound,
    /// All four together.
    Pronk,
    /// One diagonal pair together, the other two apart: three beats.
    Canter,
    /// Rear pair, then front pair, each one after the other.
    Gallop,
    /// None of these.
    Other,
}

impl fmt::Display for Gait {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Stand => "stand",
            Self::Walk => "walk",
            Self::Run => "run",
            Self::Hop => "hop",
            Self::Trot => "trot",
            Self::Pace => "pace",
            Self::Bound => "bound",
            Self::Pronk => "pronk",
            Self::Canter => "canter",
            Self::Gallop => "gallop",
            Self::Other => "none of the known gaits",
        })
    }
}

/// Distance of two phases on the circle, 0..0.5.
pub fn apart(a: f64, b: f64) -> f64 {
    let d = (a - b).rem_euclid(1.0);
    d.min(1.0 - d)
}

/// Feet that touch down within this share of the cycle do so together: a little over half of the quarter
/// that is between the feet of an even walk, since recordings have few frames a cycle.
const TOGETHER: f64 = 0.14;
/// Feet that touch down within this share follow each other.
const NEAR: f64 = 0.3;

/// The gait of two feet (`left`, `right`) or four (`front_left`, ...); `None` for others, or where a foot
/// never touches down.
pub fn guess(feet: &[FootContact]) -> Option<Gait> {
    let duty = feet.iter().map(|f| f.duty).sum::<f64>() / feet.len().max(1) as f64;
    if !feet.is_empty() && feet.iter().all(|f| f.duty > 0.95) {
        return Some(Gait::Stand);
    }
    let of = |name: &str| feet.iter().find(|f| f.name == name)?.phase;
    if feet.len() == 2 {
        let between = apart(of("left")?, of("right")?);
        return Some(match (between, duty) {
            (b, _) if b < TOGETHER => Gait::Hop,
            (b, _) if b < 0.35 => Gait::Other,
            (_, d) if d >= 0.5 => Gait::Walk,
            _ => Gait::Run,
        });
    }
    let [fl, fr, rl, rr] = [
        of("front_left")?,
        of("front_right")?,
        of("rear_left")?,
        of("rear_right")?,
    ];
    if feet.len() != 4 {
        return None;
    }
    let (diagonals, sides) = (
        [apart(fl, rr), apart(fr, rl)],
        [apart(fl, rl), apart(fr, rr)],
    );
    let ends = [apart(fl, fr), apart(rl, rr)];
    let all = |d: [f64; 2], limit: f64| 0.5 * (d[0] + d[1]) < limit;
    Some(if all(ends, TOGETHER) {
        if all(sides, TOGETHER) {
            Gait::Pronk
        } else {
            Gait::Bound
        }
    } else if all(diagonals, TOGETHER) {
        Gait::Trot
    } else if all(sides, TOGETHER) {
        Gait::Pace
    } else if duty < 0.4 && diagonals[0].min(diagonals[1]) < TOGETHER && ends[0].max(ends[1]) < 0.42
    {
        Gait::Canter
    } else if duty < 0.5 && all(ends, NEAR) {
        Gait::Gallop
    } else if 0.5 * (ends[0] + ends[1]) > 0.33 {
        Gait::Walk
    } else {
        Gait::Other
    })
}
