//! What every floor shares: time, the clock trait, joint targets and states, small helpers.

pub mod angle;
pub mod joints;
#[cfg(feature = "record")]
pub mod mcap;
pub mod print;
pub mod random;
pub mod suggest;
pub mod time;

pub use angle::wrap_pi;
pub use joints::JointState;
pub use time::{Clock, Time, VirtualClock};
