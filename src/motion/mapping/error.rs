//! Why a pose map cannot be learned: the pair or the clip, what was found, what to do.

/// What is wrong with pairs, target frames or a map.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MappingError {
    /// Nothing to learn from.
    #[error(
        "{found} pair{} given; a pose map needs at least 2, well chosen 4 to 8 (`handwave map suggest` proposes them)", match .found { 0 => "s are", _ => " is" }
    )]
    TooFewPairs {
        /// Pairs given.
        found: usize,
    },
    /// Two pairs with the same source pose.
    #[error(
        "{first} and {second} have the same source pose; a pose can lead to one target only, take one of the two out"
    )]
    DuplicatePairs {
        /// Label of one.
        first: String,
        /// Label of the other.
        second: String,
    },
    /// The source does not move.
    #[error(
        "{where_}: the source pose does not change (spread {spread_m:.2e} m); the performer has to move, and points that move have to be tracked"
    )]
    ConstantSource {
        /// Recording or pairs.
        where_: String,
        /// Root mean square distance from the mean pose, metres.
        spread_m: f64,
    },
    /// A number that is none.
    #[error("{what}: number {index} is {value}; all numbers must be finite")]
    NotFinite {
        /// Pair or frame.
        what: String,
        /// Index of the number.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// Lengths that differ.
    #[error("{what}: found {found} numbers, expected {expected}")]
    Dimension {
        /// Pair or frame.
        what: String,
        /// Numbers found.
        found: usize,
        /// Numbers needed.
        expected: usize,
    },
    /// No volume without frames.
    #[error(
        "{found} target frames; the volume of admissible poses needs at least 2 that differ: give clips with `--clip` (or `target.clips`)"
    )]
    TooFewFrames {
        /// Frames given.
        found: usize,
    },
    /// A volume without extent.
    #[error(
        "the target clips do not move; the volume of admissible poses is a point. Give clips that span what the body may do"
    )]
    ConstantTarget,
    /// A target frame beyond the robot's limits.
    #[error(
        "{what}: joint {joint} at {value:.4} is outside its limits {lower:.4}..{upper:.4}; correct the clip or the pose"
    )]
    OutsideLimits {
        /// Frame or pair.
        what: String,
        /// Index of the joint.
        joint: usize,
        /// Its position.
        value: f64,
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
    /// An option out of range.
    #[error("{key}: found {found}; allowed: {allowed}")]
    Option {
        /// The key.
        key: &'static str,
        /// Its value.
        found: f64,
        /// Values allowed.
        allowed: &'static str,
    },
}

/// Fails on the first number that is not finite.
pub(super) fn finite(what: &str, numbers: &[f64]) -> Result<(), MappingError> {
    match numbers.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(MappingError::NotFinite {
            what: what.into(),
            index,
            value: numbers[index],
        }),
        None => Ok(()),
    }
}

/// Fails unless there are `expected` numbers, all finite.
pub(super) fn numbers(what: &str, numbers: &[f64], expected: usize) -> Result<(), MappingError> {
    if numbers.len() != expected {
        return Err(MappingError::Dimension {
            what: what.into(),
            found: numbers.len(),
            expected,
        });
    }
    finite(what, numbers)
}
