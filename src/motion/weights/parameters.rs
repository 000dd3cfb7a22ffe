//! A point of a class's parameter space: one to four numbers, held in place.

use std::ops::Index;

/// Most dimensions that a parameter space has.
pub const MOST_DIMENSIONS: usize = 4;

/// Names of the dimensions when nobody gives others. The first two are always these for a class
/// that a gesture drives.
pub const DIMENSION_NAMES: [&str; MOST_DIMENSIONS] =
    ["amplitude", "frequency_hz", "parameter 3", "parameter 4"];

/// Parameters of a clip or of a wish: amplitude (0..1), frequency (Hz), then up to two of the
/// user's own (turn rate, emotion).
///
/// A dimension that is not there reads 0.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Parameters {
    values: [f64; MOST_DIMENSIONS],
    dimensions: usize,
}

impl Parameters {
    /// From a slice of one to four numbers; `None` for any other length.
    pub fn from_slice(values: &[f64]) -> Option<Self> {
        if !(1..=MOST_DIMENSIONS).contains(&values.len()) {
            return None;
        }
        let mut padded = [0.0; MOST_DIMENSIONS];
        padded[..values.len()].copy_from_slice(values);
        Some(Self {
            values: padded,
            dimensions: values.len(),
        })
    }

    /// How many dimensions there are, 1..=4.
    pub fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// The numbers that are there.
    pub fn as_slice(&self) -> &[f64] {
        &self.values[..self.dimensions]
    }

    /// The same point with dimension `d` set to `value`; a dimension that is not there stays so.
    pub fn with(mut self, d: usize, value: f64) -> Self {
        if d < self.dimensions {
            self.values[d] = value;
        }
        self
    }

    /// All four numbers, zero where there is no dimension.
    pub(super) fn padded(&self) -> &[f64; MOST_DIMENSIONS] {
        &self.values
    }
}

impl Index<usize> for Parameters {
    type Output = f64;

    fn index(&self, d: usize) -> &f64 {
        self.values.get(d).unwrap_or(&0.0)
    }
}

macro_rules! from_array {
    ($($n:literal),*) => {$(
        impl From<[f64; $n]> for Parameters {
            fn from(values: [f64; $n]) -> Self {
                let mut padded = [0.0; MOST_DIMENSIONS];
                padded[..$n].copy_from_slice(&values);
                Self { values: padded, dimensions: $n }
            }
        }
    )*};
}

from_array!(1, 2, 3, 4);
