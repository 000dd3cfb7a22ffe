//! Chance for faults: the same for the same seed on every machine.

/// Chance for faults: xorshift64*, the same sequence for the same seed on every machine.
#[derive(Clone, Debug)]
pub struct Chance(u64);

impl Chance {
    /// The sequence of `seed`.
    pub fn new(seed: u64) -> Self {
        // Spreads neighbouring seeds; the state must not be zero.
        Self((seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x2545_F491_4F6C_DD1D) | 1)
    }

    /// The next 32 bits.
    pub fn bits(&mut self) -> u32 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 32) as u32
    }

    /// True with this probability.
    pub fn happens(&mut self, probability: f64) -> bool {
        f64::from(self.bits()) < probability * 4_294_967_296.0
    }

    /// A number below `bound`; 0 when that is 0.
    pub fn below(&mut self, bound: usize) -> usize {
        ((u64::from(self.bits()) * bound as u64) >> 32) as usize
    }

    /// A mask with one to eight bits set.
    pub fn flips(&mut self) -> u8 {
        (self.bits() as u8) | 1
    }
}

/// Evenly in -1..1, always the same for the same two numbers: chance that does not depend on who asked before.
pub fn noise(seed: u64, instant: i64) -> f64 {
    let mixed = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ instant as u64;
    let mut chance = Chance::new(mixed.wrapping_mul(0xD6E8_FEB8_6659_FD93));
    chance.bits();
    f64::from(chance.bits()) / 2_147_483_648.0 - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_repeats_fills_its_range_and_has_no_preference() {
        let values: Vec<f64> = (0..10_000).map(|k| noise(7, k * 5_000_000)).collect();
        assert_eq!(values[17], noise(7, 17 * 5_000_000));
        let mean = values.iter().sum::<f64>() / 10_000.0;
        let (low, high) = values
            .iter()
            .fold((0.0f64, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
        assert!(mean.abs() < 0.03, "mean {mean:.4}");
        assert!(
            low < -0.99 && high > 0.99 && low >= -1.0 && high < 1.0,
            "{low}..{high}"
        );
    }
}
