//! Servos with Protocol 1.0: what their few registers mean in terms of the X series' table.
//!
//! A chain, the setup commands and the supervision work with the registers of the X series. A client that speaks
//! Protocol 1.0 answers for those addresses (above [`WINDOW`]) with what the servo's own registers mean, and so all of
//! them work unchanged; what a servo with Protocol 1.0 does not have reads as 0. Its own addresses, which have one byte, are
//! passed on as they are.
//!
//! Facts are those of the vendor's e-Manual.

mod requests;
#[cfg(test)]
mod tests;
mod view;

use super::model::{Layout, Sign, address};

/// Where the addresses of the X series begin.
pub const WINDOW: u16 = Layout::ONE.window;

/// A register that a servo with Protocol 1.0 has in its own way.
#[derive(Copy, Clone, Debug)]
pub struct Counterpart {
    /// Its address.
    pub own: u8,
    /// Its bytes.
    pub own_size: u8,
    /// The X series address of what it means.
    pub x_series: u16,
    /// The bytes there.
    pub size: u8,
    /// How it holds a sign.
    pub sign: Sign,
}

const fn same(own: u8, own_size: u8, x_series: u16, size: u8) -> Counterpart {
    Counterpart {
        own,
        own_size,
        x_series,
        size,
        sign: Sign::TwosComplement,
    }
}

const fn signed(own: u8, x_series: u16, size: u8) -> Counterpart {
    Counterpart {
        sign: Sign::Bit10,
        ..same(own, 2, x_series, size)
    }
}

/// Registers with the same meaning and, beside their size, the same counts. Baud rates are other codes, and angle limits make
/// the operating mode: `view` knows both.
///
/// Maximal torque and torque limit are what PWM limit and goal PWM are there: a share of the whole that may be used.
pub const COUNTERPARTS: [Counterpart; 23] = [
    same(0, 2, address::MODEL_NUMBER, 2),
    same(2, 1, address::FIRMWARE_VERSION, 1),
    same(3, 1, address::ID, 1),
    same(5, 1, address::RETURN_DELAY_TIME, 1),
    same(6, 2, address::MIN_POSITION_LIMIT, 4),
    same(8, 2, address::MAX_POSITION_LIMIT, 4),
    same(11, 1, address::TEMPERATURE_LIMIT, 1),
    same(12, 1, address::MIN_VOLTAGE_LIMIT, 2),
    same(13, 1, address::MAX_VOLTAGE_LIMIT, 2),
    same(14, 2, address::PWM_LIMIT, 2),
    same(16, 1, address::STATUS_RETURN_LEVEL, 1),
    same(18, 1, address::SHUTDOWN, 1),
    same(24, 1, address::TORQUE_ENABLE, 1),
    same(30, 2, address::GOAL_POSITION, 4),
    same(32, 2, address::PROFILE_VELOCITY, 4),
    same(34, 2, address::GOAL_PWM, 2),
    same(36, 2, address::PRESENT_POSITION, 4),
    signed(38, address::PRESENT_VELOCITY, 4),
    signed(40, address::PRESENT_LOAD, 2),
    same(42, 1, address::PRESENT_INPUT_VOLTAGE, 2),
    same(43, 1, address::PRESENT_TEMPERATURE, 1),
    same(44, 1, address::REGISTERED_INSTRUCTION, 1),
    same(46, 1, address::MOVING, 1),
];

/// The own address of what lies at `x_series` on an X series servo.
pub fn counterpart(x_series: u16) -> Option<u16> {
    let mut all = COUNTERPARTS.iter();
    all.find(|entry| entry.x_series == x_series)
        .map(|entry| entry.own.into())
}
