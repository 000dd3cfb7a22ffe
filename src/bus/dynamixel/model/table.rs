//! How control tables are written down: rows, and tables that differ from another one in some rows.
//!
//! All of it is computed when the crate is built.

use super::{Access, Register, Sign};

pub(super) const U8: i64 = 255;
pub(super) const U16: i64 = 65_535;
pub(super) const U32: i64 = 4_294_967_295;
pub(super) const I16: i64 = 32_767;
pub(super) const I32: i64 = 2_147_483_647;

/// A register that is read only.
pub(super) const fn r(
    name: &'static str,
    address: u16,
    size: u8,
    min: i64,
    max: i64,
    unit: &'static str,
) -> Register {
    Register {
        name,
        address,
        size,
        access: Access::Read,
        min,
        max,
        unit,
        sign: Sign::TwosComplement,
    }
}

/// A register that can be written.
pub(super) const fn rw(
    name: &'static str,
    address: u16,
    size: u8,
    min: i64,
    max: i64,
    unit: &'static str,
) -> Register {
    Register {
        access: Access::ReadWrite,
        ..r(name, address, size, min, max, unit)
    }
}

/// Rows of [`varied`]`(base, own, without)`.
pub(super) const fn rows(base: &[Register], own: &[Register], without: &[u16]) -> usize {
    let mut count = own.len();
    let mut index = 0;
    while index < base.len() {
        if !replaced(base[index].address, own, without) {
            count += 1;
        }
        index += 1;
    }
    count
}

/// The rows of `base` with those of `own` in place of what begins at the same addresses, and without those that begin at
/// one of `without`. Both tables are in the order of their addresses, and so is the result.
pub(super) const fn varied<const N: usize>(
    base: &[Register],
    own: &[Register],
    without: &[u16],
) -> [Register; N] {
    let mut table = [base[0]; N];
    let (mut filled, mut next, mut index) = (0, 0, 0);
    while index < base.len() || next < own.len() {
        let take_own =
            next < own.len() && (index >= base.len() || own[next].address <= base[index].address);
        if take_own {
            table[filled] = own[next];
            filled += 1;
            next += 1;
        } else {
            if !replaced(base[index].address, own, without) {
                table[filled] = base[index];
                filled += 1;
            }
            index += 1;
        }
    }
    table
}

const fn replaced(address: u16, own: &[Register], without: &[u16]) -> bool {
    let mut index = 0;
    while index < own.len() {
        if own[index].address == address {
            return true;
        }
        index += 1;
    }
    let mut index = 0;
    while index < without.len() {
        if without[index] == address {
            return true;
        }
        index += 1;
    }
    false
}

/// A table that differs from `$base` in the rows `$own` and lacks those at `$without`.
macro_rules! table {
    ($(#[$doc:meta])* $name:ident = $base:expr, [$($own:expr),* $(,)?], without [$($without:expr),*]) => {
        $(#[$doc])*
        pub(super) static $name: [$crate::bus::dynamixel::model::Register;
            $crate::bus::dynamixel::model::table::rows($base, &[$($own),*], &[$($without),*])] =
            $crate::bus::dynamixel::model::table::varied($base, &[$($own),*], &[$($without),*]);
    };
}
pub(super) use table;
