//! Opens the bus of a character: simulated servos in this process, or a serial port.

use super::realtime;
use crate::base::{Clock, Time};
use crate::bus::dynamixel::model::STATE_BYTES;
use crate::bus::dynamixel::{
    self, ChainOptions, Client, DynamixelChain, Master, MasterOptions, Protocol, ServoSpec, Speaks,
    SpecError, protocol_of,
};
use crate::bus::parallel::{BusPart, ParallelError};
use crate::bus::port::WrapPort;
use crate::bus::{BusAddress, BusLine, Buses, NoServos, ParallelBus, PortError, ServoBus};
use crate::config::Character;
use crate::sim::{self, FaultSpec, Line, LineOptions, Servo, SharedLine, SimPort};
use handwave_dynamixel::baud::{self, RateList};
use handwave_dynamixel::{p1, wire};
use std::sync::{Arc, MutexGuard};
use std::time::Duration;

/// Bytes of a goal position.
const GOAL_BYTES: usize = 4;
/// Bytes of a goal position, and of position, speed and load, in Protocol 1.0.
const ONE_GOAL_BYTES: usize = 2;
const ONE_STATE_BYTES: usize = 6;

/// An open bus, and the simulated lines behind it if there are any.
pub struct Wire {
    /// The servos.
    pub bus: Box<dyn ServoBus>,
    /// The simulated lines, to look at their servos and to inject faults.
    pub line: Option<SimLines>,
}

/// Simulated lines, one for each simulated bus.
#[derive(Clone, Debug)]
pub struct SimLines(Vec<SharedLine>);

impl SimLines {
    /// Each of them, in the order of the buses.
    pub fn each(&self) -> &[SharedLine] {
        &self.0
    }

    /// The first of them.
    pub fn lock(&self) -> MutexGuard<'_, Line> {
        // Made by `open` with at least one.
        self.0[0].lock()
    }
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
    /// The buses do not make one.
    #[error("{0}")]
    Parallel(#[from] ParallelError),
    /// The simulator has no such model.
    #[error("servo model {0} cannot be simulated")]
    Model(String),
    /// The second backend is not built in.
    #[error(
        "backend=dynamixel2 is not in this build; build with `--features dxl-serial2` or leave the option out"
    )]
    NoBackend,
}

/// Opens `buses` for the servos of `character`, on `clock`, for `rate_hz` cycles per second; ports are
/// `wrap`ped as they are opened. Buses on one port are one chain; simulated ones have a line each.
pub fn open(
    character: &Character,
    buses: &Buses,
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
    let mut lines = Vec::new();
    let mut parts = Vec::new();
    let chains = chains(character, buses);
    let several = chains.len() > 1;
    for chain in chains {
        let branch = clock.branch().filter(|_| several);
        let own: Arc<dyn Clock> = match &branch {
            Some(branch) => Arc::new(branch.clone()),
            None => Arc::clone(&clock),
        };
        let options = ChainOptions {
            bus: chain.written(several),
            watchdog: character.watchdog_ms.div_ceil(20).min(127) as u8,
            cycle_budget: Duration::from_secs_f64(1.0 / rate_hz),
            ..ChainOptions::default()
        };
        let protocol = protocol_of(&chain.servos)?;
        let speaks = Speaks::Only(protocol);
        let client: Box<dyn Client> = match &chain.line.address {
            BusAddress::Sim => {
                let baud = chain.line.sim_baud;
                let line = simulated_line(&chain.servos, baud)?;
                lines.push(line.clone());
                let port = wrap(&options.bus, Box::new(SimPort::new(line, own, baud)));
                let options = MasterOptions::of(port.as_ref());
                Box::new(Master::new(port, options).speaking(speaks))
            }
            BusAddress::Dynamixel {
                path,
                baud,
                backend,
            } => dynamixel::open(path, *baud, *backend, speaks, own, wrap)?,
        };
        parts.push(BusPart {
            name: chain.line.name.clone(),
            bus: Box::new(DynamixelChain::new(client, chain.servos, options)?),
            branch,
        });
    }
    let bus = match parts.pop() {
        Some(only) if parts.is_empty() => only.bus,
        last => {
            parts.extend(last);
            let joints = character.servos.iter().map(|s| s.joint.clone()).collect();
            Box::new(ParallelBus::new(joints, parts, clock, || {
                realtime::request();
            })?)
        }
    };
    Ok(Wire {
        bus,
        line: (!lines.is_empty()).then_some(SimLines(lines)),
    })
}

/// Servos on one line.
struct ChainParts<'a> {
    line: &'a BusLine,
    servos: Vec<ServoSpec>,
}

impl ChainParts<'_> {
    /// The bus as a user writes it.
    fn written(&self, several: bool) -> String {
        match &self.line.address {
            BusAddress::Sim if several => format!("sim:{}", self.line.name),
            BusAddress::Sim => "sim".into(),
            BusAddress::Dynamixel { path, baud, .. } => format!("dynamixel:{path}@{baud}"),
        }
    }
}

/// The servos of each line; buses of one address share it. Servos are in model order.
fn chains<'a>(character: &Character, buses: &'a Buses) -> Vec<ChainParts<'a>> {
    let mut chains: Vec<ChainParts<'_>> = Vec::new();
    for (index, line) in buses.lines().iter().enumerate() {
        let own = |joint: &usize| buses.of_joint(*joint) == index;
        let joints = (0..character.servos.len()).filter(own);
        let servos: Vec<ServoSpec> = joints.map(|j| character.servos[j].clone()).collect();
        let shared = chains
            .iter_mut()
            .find(|chain| line.address != BusAddress::Sim && chain.line.address == line.address);
        match shared {
            Some(chain) => chain.servos.extend(servos),
            // A bus without joints has nothing to open a port for.
            None if servos.is_empty() => {}
            None => chains.push(ChainParts { line, servos }),
        }
    }
    chains
}

/// Servos as commissioned for a character: model and mode are those that it wants.
fn simulated_line(servos: &[ServoSpec], rate: u32) -> Result<SharedLine, WireError> {
    let code = baud::code(rate).ok_or(WireError::Baud { baud: rate })?;
    let mut line = Line::new(LineOptions::default());
    for spec in servos {
        let name = spec.model.name;
        let device = sim::models::model(name).ok_or_else(|| WireError::Model(name.into()))?;
        let servo = Servo::commissioned(device, spec.id, code).with_mode(spec.mode);
        line.attach(spec.id, servo);
    }
    Ok(SharedLine::new(line))
}

/// Says so when a wire cannot carry `rate_hz` cycles per second: `None` when all can.
///
/// The least a cycle takes is a sync write of goals and a fast sync read of states, byte times alone; in Protocol 1.0 a
/// read of each servo.
pub fn too_slow(character: &Character, buses: &Buses, rate_hz: f64) -> Option<String> {
    let chains = chains(character, buses);
    let several = chains.len() > 1;
    chains.iter().find_map(|chain| {
        let baud = match &chain.line.address {
            BusAddress::Sim => chain.line.sim_baud,
            BusAddress::Dynamixel { baud, .. } => *baud,
        };
        let servos = chain.servos.len();
        let one = chain.servos.iter().any(|servo| servo.model.protocol == Protocol::One);
        let bytes = if one {
            p1::wire::read_cycle(servos, ONE_GOAL_BYTES, ONE_STATE_BYTES)
        } else {
            wire::fast_cycle(servos, GOAL_BYTES, STATE_BYTES)
        };
        let cycle = wire::duration(bytes, baud);
        let period_s = 1.0 / rate_hz;
        let on = if several {
            format!(" on bus {}", chain.line.name)
        } else {
            String::new()
        };
        (cycle.as_secs_f64() > period_s).then(|| {
            format!(
                "{servos} servos{on} at {baud} baud need {:.1} ms for a cycle, {rate_hz} Hz leave {:.1} ms: at most {:.0} Hz. Raise the baud rate or lower --rate (bus.rate_hz)",
                cycle.as_secs_f64() * 1e3,
                period_s * 1e3,
                (1.0 / cycle.as_secs_f64()).floor()
            )
        })
    })
}

/// Injects `faults`, whose times count from `start`: those of a servo on the lines that have it, those of
/// the bus on all. Their servos were checked when they were parsed.
pub fn inject(lines: &SimLines, faults: &[FaultSpec], start: Time) {
    for line in lines.each() {
        let mut line = line.lock();
        for fault in faults {
            // Refused only for a servo that is not on the line.
            let _ = line.inject(fault.shifted(start));
        }
    }
}
