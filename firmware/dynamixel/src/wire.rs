//! How many bytes the transactions take on the line, and how long that is.
//!
//! `servos` is the number of servos in a list, `write_len` and `read_len` the data bytes of each.
//! Stuffing, which adds a byte now and then, is not counted.

use core::time::Duration;

/// Bit times of a byte: start, eight data, stop.
pub const BITS_PER_BYTE: u64 = 10;
/// Bytes of a ping or any instruction without parameters.
pub const BARE_INSTRUCTION: usize = 10;
/// Bytes of a read instruction.
pub const READ: usize = 14;
/// Bytes of the status that answers a ping.
pub const PING_STATUS: usize = 14;

/// Bytes of a write instruction.
pub const fn write(write_len: usize) -> usize {
    12 + write_len
}

/// Bytes of a status with `read_len` data bytes.
pub const fn status(read_len: usize) -> usize {
    11 + read_len
}

/// Bytes of a sync write instruction.
pub const fn sync_write(servos: usize, write_len: usize) -> usize {
    14 + servos * (1 + write_len)
}

/// Bytes of a sync read or fast sync read instruction.
pub const fn sync_read(servos: usize) -> usize {
    14 + servos
}

/// Bytes of the combined status that answers a fast sync read.
pub const fn fast_status(servos: usize, read_len: usize) -> usize {
    8 + servos * (4 + read_len)
}

/// Bytes of a cycle: sync write, sync read, one status per servo.
pub const fn sync_cycle(servos: usize, write_len: usize, read_len: usize) -> usize {
    sync_write(servos, write_len) + sync_read(servos) + servos * status(read_len)
}

/// Bytes of a cycle: sync write, fast sync read, combined status.
pub const fn fast_cycle(servos: usize, write_len: usize, read_len: usize) -> usize {
    sync_write(servos, write_len) + sync_read(servos) + fast_status(servos, read_len)
}

/// Time that `bytes` take at `baud` bits per second, rounded up to a nanosecond.
///
/// A rate of 0 counts as 1.
pub const fn duration(bytes: usize, baud: u32) -> Duration {
    let baud = if baud == 0 { 1 } else { baud as u64 };
    let bit_nanos = (bytes as u64).saturating_mul(BITS_PER_BYTE * 1_000_000_000);
    Duration::from_nanos(bit_nanos.div_ceil(baud))
}

/// The return delay that register 9 stands for: 2 us a count.
pub const fn return_delay(register: u8) -> Duration {
    Duration::from_micros(2 * register as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycle_lengths_and_times_of_common_chains() {
        // Servos, bytes fast and ordinary, microseconds at 1 Mbaud: goal 4 bytes, state 10 bytes.
        for (servos, fast, ordinary) in [
            (1, 56, 55),
            (6, 156, 190),
            (8, 196, 244),
            (12, 276, 352),
            (20, 436, 568),
            (32, 676, 892),
        ] {
            assert_eq!(fast_cycle(servos, 4, 10), fast, "{servos} servos, fast");
            assert_eq!(sync_cycle(servos, 4, 10), ordinary, "{servos} servos");
            let micros = duration(fast, 1_000_000).as_micros();
            assert_eq!(micros, 10 * fast as u128, "{servos} servos at 1 Mbaud");
        }
        assert_eq!(duration(276, 57_600).as_micros(), 47_916);
        assert_eq!(duration(1, 0), Duration::from_secs(10));
    }
}
