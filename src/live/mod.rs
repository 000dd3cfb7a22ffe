//! Runs the puppet: real clock, control loop, stop signals, recovery. The only place that knows
//! clock, threads and signals.
//!
//! [`control`] is the loop: one cycle reads samples, steps the puppet, exchanges with the bus.
//! [`session`] runs it, on a thread in real time or inline in virtual time.

pub mod arrival;
pub mod bus_bench;
pub mod clock;
pub mod control;
pub mod drive;
pub mod feed;
pub mod footing;
pub mod keys;
pub mod playback;
pub mod realtime;
pub mod record;
pub mod recording;
pub mod reload;
pub mod session;
pub mod source;
pub mod stats;
pub mod stop;
pub mod teach;
pub mod wire;

pub use clock::RealClock;
pub use record::CycleRecord;
pub use stop::StopSwitch;
