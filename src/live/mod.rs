//! Runs the puppet: clock, control loop, safety.

pub mod clock;

pub use clock::RealClock;
