//! Opens the bus of a character: simulated servos in this process, or a serial port.

use crate::base::{Clock, Time};
use crate::bus::dynamixel::model::STATE_BYTES;
use crate::bus::dynamixel::{
    self, ChainOptions, Client, DynamixelChain, Master, MasterOptions, SpecError,
};
use crate::bus::port::WrapPort;
use crate::bus::{BusAddress, NoServos, PortError, ServoBus};
use crate::config::Character;
use crate::sim::{self, FaultSpec, Line, LineOptions, Servo, SharedLine, SimPort};
use handwave_dynamixel::baud::{self, RateList};
use handwave_dynamixel::wire;
use std::sync::Arc;
use std::time::Duration;

/// Bytes of a goal position.
const GOAL_BYTES: usize = 4;

/// An open bus, and the simulated line behind it if there is one.
pub struct Wire {
    /// The servos.
    pub bus: Box<dyn ServoBus>,
    /// The simulated line, to look at its servos and to inject faults.
    pub line: Option<SharedLine>,
}

/// Why a bus cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum WireError {
    /// The port cannot be opened.
    #[error("{0}")]
    Port(#[from] PortError),
    /// The joint map makes no sense.
    #[error("{0}")]
    Servo(#[from] SpecError),
    /// The simulated line has no such rate.
    #[error(
        "bus.baud = {baud}: not a rate that the servos have. Allowed: {}",
        RateList
    )]
    Baud {
        /// As configured.
        baud: u32,
    },
    /// The simulator has no such model.
    #[error("servo model {0} cannot be simulated")]
    Model(String),
    /// The second backend is not built in.
    #[error(
        "backend=dynamixel2 is not in this build; build with `--features dxl-serial2` or leave the option out"
    )]
    NoBackend,
}

/// Opens `address` for the servos of `character`, on `clock`, for `rate_hz` cycles per second; ports
/// are `wrap`ped as they are opened.
pub fn open(
    character: &Character,
    address: &BusAddress,
    clock: Arc<dyn Clock>,
    rate_hz: f64,
    wrap: WrapPort<'_>,
) -> Result<Wire, WireError> {
    if character.body.avatar.is_some() {
        let bus = NoServos::new(character.joints.clone(), character.standing());
        return Ok(Wire {
            bus: Box::new(bus),
            line: None,
        });
    }
    let options = ChainOptions {
        bus: match address {
            BusAddress::Sim => "sim".into(),
            BusAddress::Dynamixel { path, baud, .. } => format!("dynamixel:{path}@{baud}"),
        },
        watchdog: character.watchdog_ms.div_ceil(20).min(127) as u8,
        cycle_budget: Duration::from_secs_f64(1.0 / rate_hz),
        ..ChainOptions::default()
    };
    let (client, line): (Box<dyn Client>, _) = match address {
        BusAddress::Sim => {
            let line = simulated_line(character)?;
            let port = SimPort::new(line.clone(), clock, character.sim_baud);
            let port = wrap("sim", Box::new(port));
            let options = MasterOptions::of(port.as_ref());
            (Box::new(Master::new(port, options)), Some(line))
        }
        BusAddress::Dynamixel {
            path,
            baud,
            backend,
        } => (dynamixel::open(path, *baud, *backend, clock, wrap)?, None),
    };
    let chain = DynamixelChain::new(client, character.servos.clone(), options)?;
    Ok(Wire {
        bus: Box::new(chain),
        line,
    })
}

/// The servos of a character as commissioned for it: model and mode are those that it wants.
fn simulated_line(character: &Character) -> Result<SharedLine, WireError> {
    let rate = character.sim_baud;
    let code = baud::code(rate).ok_or(WireError::Baud { baud: rate })?;
    let mut line = Line::new(LineOptions::default());
    for spec in &character.servos {
        let name = spec.model.name;
        let device = sim::models::model(name).ok_or_else(|| WireError::Model(name.into()))?;
        let servo = Servo::commissioned(device, spec.id, code).with_mode(spec.mode);
        line.attach(spec.id, servo);
    }
    Ok(SharedLine::new(line))
}

/// Says so when the wire cannot carry `rate_hz` cycles per second: `None` when it can.
///
/// The least a cycle takes is a sync write of goals and a fast sync read of states, byte times alone.
pub fn too_slow(character: &Character, address: &BusAddress, rate_hz: f64) -> Option<String> {
    if character.servos.is_empty() {
        return None;
    }
    let baud = match address {
        BusAddress::Sim => character.sim_baud,
        BusAddress::Dynamixel { baud, .. } => *baud,
    };
    let servos = character.servos.len();
    let cycle = wire::duration(wire::fast_cycle(servos, GOAL_BYTES, STATE_BYTES), baud);
    let period_s = 1.0 / rate_hz;
    (cycle.as_secs_f64() > period_s).then(|| {
        format!(
            "{servos} servos at {baud} baud need {:.1} ms for a cycle, {rate_hz} Hz leave {:.1} ms: at most {:.0} Hz. Raise the baud rate or lower --rate (bus.rate_hz)",
            cycle.as_secs_f64() * 1e3,
            period_s * 1e3,
            (1.0 / cycle.as_secs_f64()).floor()
        )
    })
}

/// Injects `faults`, whose times count from `start`. Their servos were checked when they were parsed.
pub fn inject(line: &SharedLine, faults: &[FaultSpec], start: Time) {
    let mut line = line.lock();
    for fault in faults {
        // Refused only for a servo that is not on the line.
        let _ = line.inject(fault.shifted(start));
    }
}
