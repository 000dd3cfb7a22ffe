//! The baud rate register (address 4) of servos with Protocol 1.0: 2,000,000 / (value + 1), and three above that.

/// Values that the MX class has beside the formula.
const EXTRA: [(u8, u32); 3] = [(250, 2_250_000), (251, 2_500_000), (252, 3_000_000)];
/// Rates that a formula's result stands for: within what a receiver forgives, and what hosts set.
const NOMINAL: [(u8, u32); 5] = [
    (16, 115_200),
    (34, 57_600),
    (51, 38_400),
    (103, 19_200),
    (207, 9_600),
];

/// The rate in bits per second that register value `code` stands for: the usual one near that of the formula.
pub fn rate(code: u8) -> u32 {
    let listed = NOMINAL.iter().chain(&EXTRA).find(|entry| entry.0 == code);
    listed.map_or(2_000_000 / (u32::from(code) + 1), |entry| entry.1)
}

/// The register value for `rate` bits per second, where there is one within 1 %.
pub fn code(rate_bps: u32) -> Option<u8> {
    let off = |code: u8| rate(code).abs_diff(rate_bps);
    (0..=252)
        .min_by_key(|&code| off(code))
        .filter(|&code| u64::from(off(code)) * 100 <= u64::from(rate_bps))
}
