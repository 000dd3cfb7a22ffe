//! Setting servos up for a chain, one at a time: find the new one, see what differs, write it, be able to undo it.
//!
//! [`find`] looks over baud rates and ids and notices servos that talk over each other, [`mod@choose`] says which of them
//! is the new one, [`mod@plan`] compares
//! a servo with what is wanted of it, [`work`] writes and reads back, [`undo`] keeps what stood there before,
//! [`calibrate`] learns zero, direction and range of a joint from movements by hand.

pub mod calibrate;
pub mod choose;
pub mod find;
pub mod plan;
pub mod undo;
pub mod work;

pub use choose::{ChooseError, choose};
pub use find::{Found, Sweep, sweep};
pub use plan::{Change, Wanted, plan};
pub use undo::{UndoEntry, UndoFile, UndoGroup};
pub use work::{Halt, Place, commission, restore};

use super::client::ClientError;

/// Why a servo cannot be set up as wanted.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The servo could not be asked.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// No table for this model.
    #[error(
        "servo {id} has model number {number}, whose registers this build does not know. \
         Set it up by hand: `handwave bus write BUS {id} ADDRESS:LEN VALUE`"
    )]
    UnknownModel {
        /// Id at which it answers.
        id: u8,
        /// Model number.
        number: u16,
    },
    /// A register does not take the value.
    #[error("{model}: {register} takes {min} to {max}, not {value}")]
    Range {
        /// Model.
        model: &'static str,
        /// Register.
        register: &'static str,
        /// What is wanted.
        value: i64,
        /// Least.
        min: i64,
        /// Greatest.
        max: i64,
    },
    /// The model has no such baud rate.
    #[error("{model}: {baud} is none of its baud rates. Allowed: {allowed}")]
    Baud {
        /// Model.
        model: &'static str,
        /// What is wanted.
        baud: u32,
        /// What there is.
        allowed: String,
    },
    /// The shaft is too far from the middle for a homing offset.
    #[error(
        "the shaft stands at {pulse}, {degrees:.0} deg from the middle of the turn (2048); an offset of more than \
         90 deg is ignored in position mode. Take the horn off and put it back nearer to the middle, then again"
    )]
    FarFromMiddle {
        /// Where it stands without offset.
        pulse: i64,
        /// The same from the middle.
        degrees: f64,
    },
    /// A place on the line is taken by another servo.
    #[error(
        "servo id {id} at {baud} baud is taken: another servo answers there. \
         Unplug that one first, or choose another id"
    )]
    Taken {
        /// Id.
        id: u8,
        /// Baud rate.
        baud: u32,
    },
    /// A register reads otherwise than what was written.
    #[error("{register} reads {found} after {written} was written")]
    NotKept {
        /// Register.
        register: &'static str,
        /// What was written.
        written: i64,
        /// What is read.
        found: i64,
    },
    /// The undo file cannot be written or read.
    #[error("{file}: {problem}")]
    File {
        /// Path.
        file: String,
        /// What was found and what is expected.
        problem: String,
    },
    /// Stopped by the operator.
    #[error("stopped by the operator")]
    Stopped,
}
