//! Named gaits of four and six legs: when each foot touches down, and for how long it stays.

use serde::{Deserialize, Serialize};

/// Presets: touch-down phases per leg.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GaitName {
    /// Lateral-sequence walk: rear left, front left, rear right, front right, a quarter apart.
    Walk,
    /// Diagonal legs together.
    Trot,
    /// Legs of one side together.
    Pace,
    /// Front legs together, rear legs together.
    Bound,
    /// Transverse gallop: rear left, rear right, then front left, front right.
    Gallop,
    /// Rotary gallop: rear left, rear right, then front right, front left.
    RotaryGallop,
    /// All four together.
    Pronk,
    /// Six legs: three and three (front and rear of one side with the middle of the other).
    Tripod,
    /// Six legs: a wave from rear to front on each side, half a cycle apart; four feet on the ground.
    Ripple,
    /// Six legs: one after the other, left side then right; five feet on the ground.
    Wave,
    /// All feet stay on the ground; any legs.
    Stand,
}

const FOUR: [&str; 4] = ["rear_left", "front_left", "rear_right", "front_right"];
const SIX: [&str; 6] = [
    "rear_left",
    "middle_left",
    "front_left",
    "rear_right",
    "middle_right",
    "front_right",
];

impl GaitName {
    /// All presets with their names.
    pub const ALL: [(&'static str, GaitName); 11] = [
        ("walk", GaitName::Walk),
        ("trot", GaitName::Trot),
        ("pace", GaitName::Pace),
        ("bound", GaitName::Bound),
        ("gallop", GaitName::Gallop),
        ("rotary_gallop", GaitName::RotaryGallop),
        ("pronk", GaitName::Pronk),
        ("tripod", GaitName::Tripod),
        ("ripple", GaitName::Ripple),
        ("wave", GaitName::Wave),
        ("stand", GaitName::Stand),
    ];

    /// The preset called `name`.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL
            .iter()
            .find(|(n, _)| *n == name)
            .map(|(_, gait)| *gait)
    }

    /// Name of the preset.
    pub fn name(self) -> &'static str {
        Self::ALL
            .iter()
            .find(|(_, gait)| *gait == self)
            .map_or("", |(n, _)| n)
    }

    /// Presets for that many legs, besides `stand`.
    pub fn for_legs(count: usize) -> Vec<&'static str> {
        Self::ALL
            .iter()
            .filter(|(_, gait)| gait.legs() == Some(count))
            .map(|(name, _)| *name)
            .collect()
    }

    /// How many legs it is for; `None` for any number.
    pub fn legs(self) -> Option<usize> {
        self.table().map(|(legs, _)| legs.len())
    }

    fn table(self) -> Option<(&'static [&'static str], &'static [f64])> {
        const THIRD: f64 = 1.0 / 3.0;
        const SIXTH: f64 = 1.0 / 6.0;
        match self {
            GaitName::Walk => Some((&FOUR, &[0.0, 0.25, 0.5, 0.75])),
            GaitName::Trot => Some((&FOUR, &[0.0, 0.5, 0.5, 0.0])),
            GaitName::Pace => Some((&FOUR, &[0.0, 0.0, 0.5, 0.5])),
            GaitName::Bound => Some((&FOUR, &[0.0, 0.5, 0.0, 0.5])),
            GaitName::Gallop => Some((&FOUR, &[0.0, 0.5, 0.1, 0.6])),
            GaitName::RotaryGallop => Some((&FOUR, &[0.0, 0.6, 0.1, 0.5])),
            GaitName::Pronk => Some((&FOUR, &[0.0; 4])),
            GaitName::Tripod => Some((&SIX, &[0.0, 0.5, 0.0, 0.5, 0.0, 0.5])),
            GaitName::Ripple => Some((&SIX, &[0.0, THIRD, 2.0 * THIRD, 0.5, 0.5 + THIRD, SIXTH])),
            GaitName::Wave => Some((
                &SIX,
                &[0.0, SIXTH, 2.0 * SIXTH, 0.5, 4.0 * SIXTH, 5.0 * SIXTH],
            )),
            GaitName::Stand => None,
        }
    }

    /// Touch-down phase of a leg, fraction of the cycle; `None` when the preset has no such leg.
    pub fn phase(self, leg: &str) -> Option<f64> {
        match self.table() {
            None => Some(0.0),
            Some((legs, phases)) => {
                let at = legs.iter().position(|l| *l == leg)?;
                phases.get(at).copied()
            }
        }
    }

    /// Fraction of the cycle that a foot is on the ground when none is given.
    pub fn duty_factor(self) -> f64 {
        match self {
            GaitName::Stand => 1.0,
            GaitName::Walk => 0.7,
            GaitName::Trot | GaitName::Pace | GaitName::Tripod => 0.5,
            GaitName::Bound | GaitName::Pronk => 0.45,
            GaitName::Gallop | GaitName::RotaryGallop => 0.4,
            GaitName::Ripple => 2.0 / 3.0,
            GaitName::Wave => 5.0 / 6.0,
        }
    }

    /// Natural cycles per second over sqrt(g / leg length): dynamic similarity (Alexander) with the
    /// tempo of a dog's gaits; an insect's are slower, for it stands by its feet.
    pub fn tempo(self) -> f64 {
        match self {
            GaitName::Stand => 0.0,
            GaitName::Wave => 0.08,
            GaitName::Ripple => 0.12,
            GaitName::Walk | GaitName::Tripod => 0.2,
            GaitName::Trot | GaitName::Pace => 0.35,
            GaitName::Bound | GaitName::Pronk => 0.38,
            GaitName::Gallop | GaitName::RotaryGallop => 0.42,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_keeps_the_feet_down_that_its_name_promises() {
        for (gait, legs, least) in [
            (GaitName::Walk, FOUR.as_slice(), 2),
            (GaitName::Trot, &FOUR, 2),
            (GaitName::Pace, &FOUR, 2),
            (GaitName::Tripod, &SIX, 3),
            (GaitName::Ripple, &SIX, 4),
            (GaitName::Wave, &SIX, 5),
        ] {
            let down = |u: f64| {
                let on_ground = |leg: &&&str| {
                    let phase = gait.phase(leg).expect("a leg of the preset");
                    (u - phase).rem_euclid(1.0) < gait.duty_factor()
                };
                legs.iter().filter(on_ground).count()
            };
            let fewest = (0..600).map(|k| down((f64::from(k) + 0.5) / 600.0)).min();
            assert_eq!(fewest, Some(least), "{gait:?}");
        }
    }

    #[test]
    fn every_name_finds_its_preset_and_back() {
        for (name, gait) in GaitName::ALL {
            assert_eq!(GaitName::by_name(name), Some(gait));
            assert_eq!(gait.name(), name);
        }
    }
}
