//! CRC-16 of Protocol 2.0: polynomial 0x8005, start 0, not reflected, no final xor (CRC-16/BUYPASS).

const TABLE: [u16; 256] = table();

const fn table() -> [u16; 256] {
    let mut table = [0; 256];
    let mut i = 0;
    while i < 256 {
        let mut value = (i as u16) << 8;
        let mut bit = 0;
        while bit < 8 {
            value = if value & 0x8000 != 0 {
                (value << 1) ^ 0x8005
            } else {
                value << 1
            };
            bit += 1;
        }
        table[i] = value;
        i += 1;
    }
    table
}

/// A running checksum.
///
/// In a frame it covers every byte from the first FF to the one before the checksum itself, taken
/// after stuffing.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub struct Crc(u16);

impl Crc {
    /// The checksum of no bytes.
    pub const fn new() -> Self {
        Crc(0)
    }

    /// A sum that stands at `value` after bytes that are not known.
    pub const fn from_value(value: u16) -> Self {
        Crc(value)
    }

    /// Takes one more byte in.
    pub const fn push(&mut self, byte: u8) {
        self.0 = (self.0 << 8) ^ TABLE[((self.0 >> 8) as u8 ^ byte) as usize];
    }

    /// Takes more bytes in.
    pub fn update(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.push(byte);
        }
    }

    /// The checksum of all bytes so far; it goes over the line low byte first.
    pub const fn value(self) -> u16 {
        self.0
    }
}

/// The checksum of `bytes`.
pub fn crc16(bytes: &[u8]) -> u16 {
    let mut crc = Crc::new();
    crc.update(bytes);
    crc.value()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn check_value_of_the_catalogue() {
        let found = crc16(b"123456789");
        assert_eq!(found, 0xFEE8, "found {found:#06X}");
    }

    #[test]
    fn table_agrees_with_its_published_ends() {
        assert_eq!(TABLE[..4], [0x0000, 0x8005, 0x800F, 0x000A]);
        assert_eq!(TABLE[255], 0x0202);
    }

    proptest! {
        #[test]
        fn a_running_checksum_does_not_depend_on_the_cut(bytes: std::vec::Vec<u8>, cut: usize) {
            let cut = cut % (bytes.len() + 1);
            let mut crc = Crc::new();
            crc.update(&bytes[..cut]);
            crc.update(&bytes[cut..]);
            prop_assert_eq!(crc.value(), crc16(&bytes));
        }

        #[test]
        fn bytes_followed_by_their_checksum_give_zero(mut bytes: std::vec::Vec<u8>) {
            let [low, high] = crc16(&bytes).to_le_bytes();
            bytes.extend([high, low]);
            prop_assert_eq!(crc16(&bytes), 0);
        }
    }
}
