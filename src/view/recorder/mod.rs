//! Keeps runs: whole ones in an MCAP file, the latest past of every run in memory, written when something went wrong.
//!
//! [`Recorder`] is told every cycle and takes away what the taps logged; in real time a thread of its own does
//! the work, so that a slow disk costs recording and never control. [`read`] makes a recording of a file again.

mod channel;
mod file;
mod keep;
pub mod read;
mod ring;
mod telemetry;

pub use channel::Channel;
pub use file::{About, FORMAT};
pub use keep::{Kept, Plan, Recorder};
