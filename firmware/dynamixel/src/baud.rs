//! The baud rate register (address 8) of the X series.

use core::fmt;

/// Rates in bits per second, indexed by the register's value.
pub const RATES: [u32; 8] = [
    9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000,
];

/// The rate in bits per second that register value `code` stands for.
pub fn rate(code: u8) -> Option<u32> {
    RATES.get(usize::from(code)).copied()
}

/// The register value for `rate` bits per second.
pub fn code(rate: u32) -> Option<u8> {
    (0u8..)
        .zip(RATES)
        .find(|&(_, known)| known == rate)
        .map(|(code, _)| code)
}

/// All rates for the reader of a message: `9600, 57600, ...`.
#[derive(Copy, Clone, Debug)]
pub struct RateList;

impl fmt::Display for RateList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for rate in RATES {
            write!(f, "{separator}{rate}")?;
            separator = ", ";
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rate_has_its_register_value() {
        for (index, rate_bps) in (0u8..).zip(RATES) {
            assert_eq!(code(rate_bps), Some(index), "{rate_bps} baud");
            assert_eq!(rate(index), Some(rate_bps), "register value {index}");
        }
        assert_eq!(code(123_456), None);
        assert_eq!(rate(8), None);
    }
}
