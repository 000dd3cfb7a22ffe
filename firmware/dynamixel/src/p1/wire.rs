//! How many bytes the transactions of Protocol 1.0 take on the line; [`crate::wire::duration`] says how long that is.
//!
//! `servos` is the number of servos in a list, `write_len` and `read_len` the data bytes of each.

/// Bytes of a ping or any instruction without parameters.
pub const BARE_INSTRUCTION: usize = 6;
/// Bytes of a read instruction.
pub const READ: usize = 8;

/// Bytes of a write instruction.
pub const fn write(write_len: usize) -> usize {
    7 + write_len
}

/// Bytes of a status with `read_len` data bytes.
pub const fn status(read_len: usize) -> usize {
    6 + read_len
}

/// Bytes of a sync write instruction.
pub const fn sync_write(servos: usize, write_len: usize) -> usize {
    8 + servos * (1 + write_len)
}

/// Bytes of a bulk read instruction.
pub const fn bulk_read(servos: usize) -> usize {
    7 + 3 * servos
}

/// Bytes of a cycle: sync write, one read and one status per servo.
pub const fn read_cycle(servos: usize, write_len: usize, read_len: usize) -> usize {
    sync_write(servos, write_len) + servos * (READ + status(read_len))
}

/// Bytes of a cycle: sync write, bulk read, one status per servo.
pub const fn bulk_cycle(servos: usize, write_len: usize, read_len: usize) -> usize {
    sync_write(servos, write_len) + bulk_read(servos) + servos * status(read_len)
}
