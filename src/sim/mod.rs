//! The other end of the wire: simulated servos.
//!
//! A [`Servo`] is a control table, a motor and the instructions; a [`Line`] is the half-duplex chain
//! they hang on, with byte-exact times and injected [`fault`]s. Two things carry a line: a
//! [`SimPort`] inside the process, in virtual or real time, and a [`PtyServer`] on a
//! pseudo-terminal for any client.

mod ailments;
mod answers;
mod chain;
mod chance;
pub mod fault;
mod fault_table;
mod instructions;
pub mod line;
pub mod models;
mod modes;
pub mod motor;
pub mod port;
pub mod pty;
mod registers;
pub mod servo;
pub mod table;
pub mod thermal;
pub mod trace;
mod wire;

pub use fault::FaultSpec;
pub use line::{AfterSilence, Line, LineOptions, SharedLine};
pub use port::SimPort;
pub use pty::{PtyError, PtyServer};
pub use servo::Servo;
