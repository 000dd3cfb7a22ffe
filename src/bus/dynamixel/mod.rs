//! Dynamixel servos over Protocols 2.0 and 1.0.
//!
//! From the wire up: [`Master`] turns requests into frames on a [`Port`](super::Port) and waits no
//! longer than the wire needs; [`Client`] is that seam, in registers and bytes, with the
//! `dynamixel2` crate as a second implementation (feature `dxl-serial2`); [`model`] says
//! what the registers mean; [`DynamixelChain`] is the [`ServoBus`](super::ServoBus) in joint angles.

mod absence;
mod allowance;
#[cfg(feature = "dxl-serial2")]
pub mod backend_dynamixel2;
pub mod chain;
mod check;
pub mod client;
mod cycle;
mod facts;
mod follow;
mod goals;
mod group_read;
mod groups;
mod health;
mod listener;
pub mod master;
pub mod model;
pub mod one;
mod recovery;
mod reopen;
mod requests;
#[cfg(test)]
mod scripted;
pub mod servo;
pub mod settings;
pub mod setup;
#[cfg(test)]
mod tests;
pub mod vitals;

#[cfg(feature = "dxl-serial2")]
pub use backend_dynamixel2::Dynamixel2Client;
pub use chain::{ChainOptions, DynamixelChain};
pub use client::{Client, ClientError, Outcome, Ping, Reply, Traffic};
pub use handwave_dynamixel::instruction::{Backup, BulkReadEntry, BulkWriteEntry, FactoryReset};
pub use master::{Master, MasterOptions, Speaks};
pub use model::{Mode, Model, Protocol, Register};
pub use servo::{Direction, ServoSpec, SpecError, protocol_of};
pub use settings::{Follow, Gains, Profile, Settings};

use super::address::DynamixelBackend;
use super::port::{PortError, WrapPort};
use super::serial::SerialPort;
use crate::base::Clock;
use std::sync::Arc;

/// Opens a serial port and puts a client on it.
///
/// The client speaks what `speaks` says; the `dynamixel2` backend speaks Protocol 2.0 alone. Where the adapter holds bytes back (see [`SerialPort::latency_timer`]), waits allow for it. The port is
/// `wrap`ped as bus `bus`; the `dynamixel2` backend opens its own and is not.
/// Fails like [`SerialPort::open`], or when the backend is not built in.
pub fn open(
    path: &str,
    baud: u32,
    backend: DynamixelBackend,
    speaks: Speaks,
    clock: Arc<dyn Clock>,
    wrap: WrapPort<'_>,
) -> Result<Box<dyn Client>, PortError> {
    match backend {
        DynamixelBackend::Handwave => {
            let port = SerialPort::open(path, baud, clock)?;
            let notes = port.latency_note().into_iter().collect();
            let port = wrap(&format!("dynamixel:{path}@{baud}"), Box::new(port));
            let options = MasterOptions::of(port.as_ref());
            let master = Master::new(port, options).speaking(speaks);
            Ok(Box::new(master.with_notes(notes)))
        }
        DynamixelBackend::Dynamixel2 if speaks == Speaks::Only(Protocol::One) => {
            Err(PortError::Open {
                port: path.into(),
                reason: "the dynamixel2 backend speaks Protocol 2.0, the servos speak 1.0".into(),
                advice: "Leave backend=dynamixel2 out".into(),
            })
        }
        #[cfg(feature = "dxl-serial2")]
        DynamixelBackend::Dynamixel2 => Ok(Box::new(Dynamixel2Client::open(path, baud, clock)?)),
        #[cfg(not(feature = "dxl-serial2"))]
        DynamixelBackend::Dynamixel2 => Err(PortError::Open {
            port: path.into(),
            reason: "the dynamixel2 backend is not built in".into(),
            advice: "Build with `--features dxl-serial2`, or leave backend=dynamixel2 out".into(),
        }),
    }
}
