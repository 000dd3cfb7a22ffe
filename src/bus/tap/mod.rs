//! Taps: everything that reaches a run from outside, logged call by call, so that it can be replayed bit for bit.
//!
//! Each thread that asks the outside world something has a [`Log`] of its own, a stream of [`Event`]s: the
//! control thread one (clock, poses, stop requests), every port one ([`TapPort`]: times, bytes both ways,
//! failures). A replay hands the same answers out again in the same order ([`Script`], [`ReplayPort`]); what
//! the program then asks or sends differently is a [`Difference`].

pub mod event;
pub mod log;
mod port;
mod replay;
pub mod trace;

pub use event::{Event, Events, PortFault};
pub use log::{Entry, Log};
pub use port::TapPort;
pub use replay::{Difference, ReplayPort, Script, Verdict};
