//! The unit of length of a BVH file, which the file does not tell: named by the user or guessed from the skeleton.

use super::BvhFile;
use crate::base::suggest::hint;
use std::fmt;
use std::str::FromStr;

/// A unit of length.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct LengthUnit {
    /// Metres in one of it.
    pub metres: f64,
}

impl LengthUnit {
    /// Units by name, with their length in metres.
    pub const NAMED: [(&'static str, f64); 5] = [
        ("m", 1.0),
        ("cm", 0.01),
        ("mm", 0.001),
        ("in", 0.0254),
        ("ft", 0.3048),
    ];
}

impl Default for LengthUnit {
    fn default() -> Self {
        Self { metres: 1.0 }
    }
}

impl fmt::Display for LengthUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match Self::NAMED
            .iter()
            .find(|(_, metres)| *metres == self.metres)
        {
            Some((name, _)) => f.write_str(name),
            None => write!(f, "{} m", self.metres),
        }
    }
}

impl FromStr for LengthUnit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some((_, metres)) = Self::NAMED.iter().find(|(name, _)| *name == text) {
            return Ok(Self { metres: *metres });
        }
        let number = text.parse().ok().filter(|m| (1e-6..=1e3).contains(m));
        number.map(|metres| Self { metres }).ok_or_else(|| {
            let names = Self::NAMED.map(|(name, _)| name);
            format!(
                "no unit {text:?}{} Allowed: {}, or the length of one unit in metres, such as 0.0564",
                hint(text, names),
                names.join(", ")
            )
        })
    }
}

/// A guess at a file's unit.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct UnitGuess {
    /// The unit.
    pub unit: LengthUnit,
    /// Longest way through the skeleton, toe to fingertip, in metres of that unit.
    pub reach_m: f64,
    /// Whether a human of 1 to 3 m comes out of it.
    pub is_human: bool,
}

/// Toe to fingertip along the bones of a grown human, metres: about 1.3 times the height.
const HUMAN_REACH_M: f64 = 2.2;

/// The same of humans of 1 m and of 3 m, metres.
const HUMAN_REACHES_M: (f64, f64) = (1.3, 3.9);

impl UnitGuess {
    /// The unit (metres, centimetres, inches or millimetres) in which the skeleton of `file` comes
    /// nearest to a human's size; centimetres, the usual one, for a skeleton without size.
    pub fn of(file: &BvhFile) -> Self {
        let reach = file.longest_path();
        let guess = |metres: f64| Self {
            unit: LengthUnit { metres },
            reach_m: reach * metres,
            is_human: (HUMAN_REACHES_M.0..=HUMAN_REACHES_M.1).contains(&(reach * metres)),
        };
        if !(reach > 0.0) {
            return guess(0.01);
        }
        let off = |guess: &Self| (guess.reach_m / HUMAN_REACH_M).ln().abs();
        [1.0, 0.0254, 0.001]
            .map(guess)
            .into_iter()
            .fold(guess(0.01), |best, other| {
                if off(&other) < off(&best) {
                    other
                } else {
                    best
                }
            })
    }
}

impl fmt::Display for UnitGuess {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "unit {} (guessed: the skeleton measures {:.2} m from tip to tip",
            self.unit, self.reach_m
        )?;
        if self.is_human {
            f.write_str(")")
        } else {
            f.write_str(
                ", which is no human's size; if that is wrong, `handwave poses import --unit` tells the unit)",
            )
        }
    }
}
