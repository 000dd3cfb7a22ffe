//! Byte stuffing: inside a frame's body an FD follows each FF FF FD, so no header can appear there.
//!
//! The body reaches from the instruction byte to the last parameter. Length and checksum are
//! computed after stuffing. The combined status of fast reads is not stuffed.

/// Watches a body go by and says when an FD has to be inserted.
#[derive(Copy, Clone, Debug, Default)]
pub struct Stuffer {
    /// How much of FF FF FD the last bytes match: 0, 1 or 2 bytes.
    matched: u8,
}

impl Stuffer {
    /// At the start of a body.
    pub const fn new() -> Self {
        Stuffer { matched: 0 }
    }

    /// Takes one body byte; true when an FD must be inserted after it.
    pub const fn push(&mut self, byte: u8) -> bool {
        let complete = self.matched == 2 && byte == 0xFD;
        self.matched = match (byte, self.matched) {
            (0xFF, 0) => 1,
            (0xFF, _) => 2,
            _ => 0,
        };
        complete
    }
}

/// How many bytes `body` takes after stuffing.
pub fn stuffed_len(body: &[u8]) -> usize {
    let mut stuffer = Stuffer::new();
    body.iter()
        .map(|&byte| 1 + usize::from(stuffer.push(byte)))
        .sum()
}

/// Removes the stuffing in place and returns the length of the body.
///
/// An FF FF FD without its FD, which no conforming sender writes, is kept as it is.
pub fn unstuff(body: &mut [u8]) -> usize {
    let mut stuffer = Stuffer::new();
    let mut written = 0;
    let mut stuffed_next = false;
    for read in 0..body.len() {
        let byte = body[read];
        if stuffed_next && byte == 0xFD {
            stuffed_next = false;
            continue;
        }
        stuffed_next = stuffer.push(byte);
        body[written] = byte;
        written += 1;
    }
    written
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn stuff(body: &[u8]) -> Vec<u8> {
        let mut stuffer = Stuffer::new();
        let mut out = Vec::new();
        for &byte in body {
            out.push(byte);
            if stuffer.push(byte) {
                out.push(0xFD);
            }
        }
        out
    }

    /// Bodies in which the pattern and its near misses are common.
    fn body() -> impl Strategy<Value = Vec<u8>> {
        let byte = prop_oneof![
            4 => Just(0xFFu8),
            4 => Just(0xFDu8),
            1 => Just(0x00u8),
            1 => any::<u8>(),
        ];
        proptest::collection::vec(byte, 0..200)
    }

    #[test]
    fn three_ff_before_the_fd_still_count() {
        assert_eq!(
            stuff(&[0xFF, 0xFF, 0xFF, 0xFD, 0x00]),
            [0xFF, 0xFF, 0xFF, 0xFD, 0xFD, 0x00]
        );
    }

    #[test]
    fn an_fd_of_the_body_survives_beside_the_stuffed_one() {
        let mut stuffed = stuff(&[0xFF, 0xFF, 0xFD, 0xFD]);
        assert_eq!(stuffed, [0xFF, 0xFF, 0xFD, 0xFD, 0xFD]);
        let len = unstuff(&mut stuffed);
        assert_eq!(stuffed[..len], [0xFF, 0xFF, 0xFD, 0xFD]);
    }

    proptest! {
        #[test]
        fn unstuffing_undoes_stuffing(body in body()) {
            let mut stuffed = stuff(&body);
            prop_assert_eq!(stuffed.len(), stuffed_len(&body));
            let len = unstuff(&mut stuffed);
            prop_assert_eq!(&stuffed[..len], &body[..]);
        }

        #[test]
        fn a_stuffed_body_never_holds_a_header(body in body()) {
            let stuffed = stuff(&body);
            prop_assert!(!stuffed.windows(4).any(|w| w == [0xFF, 0xFF, 0xFD, 0x00]), "{:02X?}", stuffed);
        }

        #[test]
        fn unstuffing_anything_is_harmless(mut bytes in body()) {
            let before = bytes.len();
            prop_assert!(unstuff(&mut bytes) <= before);
        }
    }
}
