//! Recording what reaches a run from outside, and running it again from that.
//!
//! [`tap`] stands between the control loop and clock, poses and stop switch, `bus::tap` before each port.
//! What they log is taken away by whoever keeps it ([`Taps::take`]); [`replay()`] runs the loop on it.

mod avatar;
pub mod pose;
pub mod replay;
pub mod tap;

pub use replay::{Recorded, Replayed, replay};
pub use tap::{TapClock, TapFeed, Taps};
