//! The servos that a bench works with: where their registers are, and which goals may be written without moving them.
//!
//! Nothing may move and no torque may change, whatever state the robot is in:
//! - torque off: the goal is the present position, as last read;
//! - torque on, and the goal in the servo is near the present position: that goal again, so that a limb under load
//!   does not sink by its control error;
//! - torque on, and the goal is elsewhere (it is on its way or blocked): the present position, read once; it stops;
//! - drive mode bit 3 (a goal turns torque on): no goal at all.

use super::Reads;
use crate::bus::dynamixel::model::{Model, Protocol, Register, XL430_W250};
use crate::bus::dynamixel::{Client, ClientError, Ping};
use handwave_dynamixel::wire;
use std::time::Duration;

/// Drive mode bit 3: a goal turns torque on.
const TORQUE_ON_BY_GOAL: u8 = 0b1000;
/// How far load moves a position-controlled servo off its goal at most, as part of a turn.
const SAG_TURNS: f64 = 1.0 / 32.0;
/// How often a request that brought no answer is repeated.
const TRIES: u32 = 3;
/// Bytes of the longest goal.
const GOAL_BYTES: usize = 4;

/// Where the registers of a cycle are: the same for all servos of a bench.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Address of the goal position.
    pub goal: u16,
    /// Its bytes.
    pub goal_len: usize,
    /// Address of the first state register.
    pub state: u16,
    /// Bytes from there to the end of the present position.
    pub state_len: usize,
    /// Where in them the present position begins.
    pub position_at: usize,
}

impl Layout {
    /// Of a control table: from the present current or load to the present position where they lie in one piece.
    fn of(model: &Model) -> Option<Self> {
        let goal = model.register("goal_position")?;
        let position = model.register("present_position")?;
        let end = position.address + u16::from(position.size);
        let in_one_piece = |first: &&Register| {
            let mut at = first.address;
            while at < position.address {
                let Some(register) = model.register_at(at) else {
                    return false;
                };
                at += u16::from(register.size).max(1);
            }
            at == position.address
        };
        let first = ["present_current", "present_load"]
            .iter()
            .filter_map(|name| model.register(name))
            .find(in_one_piece)
            .unwrap_or(position);
        Some(Self {
            goal: goal.address,
            goal_len: usize::from(goal.size).min(GOAL_BYTES),
            state: first.address,
            state_len: usize::from(end - first.address),
            position_at: usize::from(position.address - first.address),
        })
    }
}

/// One servo of a bench.
#[derive(Clone, Debug, PartialEq)]
pub struct BenchServo {
    /// Its id.
    pub id: u8,
    /// Model name, `unknown` when the number is in no table; `None` when the servo did not answer.
    pub model: Option<&'static str>,
    /// Whether its torque is on.
    pub torque: bool,
    /// What is written as its goal; `None` when none may be written.
    pub(super) goal: Option<[u8; GOAL_BYTES]>,
    /// The goal follows the present position.
    follows: bool,
}

impl BenchServo {
    fn absent(id: u8) -> Self {
        Self {
            id,
            model: None,
            torque: false,
            goal: None,
            follows: false,
        }
    }

    /// Takes the present position just read.
    pub(super) fn follow(&mut self, position: &[u8]) {
        if let Some(goal) = self.goal.as_mut().filter(|_| self.follows) {
            for (goal, found) in goal.iter_mut().zip(position) {
                *goal = *found;
            }
        }
    }
}

/// Whom to measure.
#[derive(Clone, Debug, PartialEq)]
pub enum Found {
    /// The servo that answered so.
    Servo(Ping),
    /// The servo with this id, though it did not answer.
    Absent(u8),
}

/// Servos that are ready to be measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Bench {
    /// The servos, in the order in which they are asked.
    pub servos: Vec<BenchServo>,
    /// Where their registers are.
    pub layout: Layout,
    /// The reads that the driver would choose: fast where every servo's firmware knows them.
    pub reads: Reads,
    /// The largest return delay found.
    pub return_delay: Duration,
    /// What is worth telling.
    pub notes: Vec<String>,
}

/// Why servos cannot be measured.
#[derive(Debug, thiserror::Error)]
pub enum InspectError {
    /// Nobody answered.
    #[error(
        "no servo answers. Check power, cable and baud rate; `handwave bus scan BUS --baud all` tries every rate"
    )]
    Nobody,
    /// A servo cannot be asked.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// Two servos have their registers in different places.
    #[error(
        "servos {first} and {second} have goals and states at different addresses; \
         one read cannot ask both. Choose servos of one kind with --ids"
    )]
    Mixed {
        /// Id of one.
        first: u8,
        /// Id of the other.
        second: u8,
    },
    /// The model has no such reads.
    #[error(
        "servo {id} ({model}) speaks Protocol 1.0, which has no sync read. \
         Choose servos that speak Protocol 2.0 with --ids"
    )]
    ProtocolOne {
        /// Its id.
        id: u8,
        /// Its model.
        model: &'static str,
    },
}

impl Bench {
    /// Looks at the servos `found`: registers are read, none is written.
    pub fn inspect(client: &mut dyn Client, found: &[Found]) -> Result<Self, InspectError> {
        let mut bench = Self {
            servos: Vec::with_capacity(found.len()),
            layout: Layout::of(&XL430_W250).ok_or(InspectError::Nobody)?,
            reads: Reads::Fast,
            return_delay: Duration::ZERO,
            notes: Vec::new(),
        };
        let mut first: Option<u8> = None;
        for found in found {
            let ping = match found {
                Found::Servo(ping) => ping,
                Found::Absent(id) => {
                    bench.servos.push(BenchServo::absent(*id));
                    continue;
                }
            };
            let layout = bench.look(client, ping)?;
            match first {
                None => {
                    first = Some(ping.id);
                    bench.layout = layout;
                }
                Some(first) if layout != bench.layout => {
                    let second = ping.id;
                    return Err(InspectError::Mixed { first, second });
                }
                Some(_) => {}
            }
        }
        if first.is_none() {
            return Err(InspectError::Nobody);
        }
        if !bench.return_delay.is_zero() {
            bench.notes.push(format!(
                "servos wait up to {} us before each answer (return_delay_time), which costs bus time in every cycle. \
                 With torque off set it to 0: `handwave bus write BUS IDS return_delay_time 0`",
                bench.return_delay.as_micros()
            ));
        }
        Ok(bench)
    }

    /// Looks at one servo and takes it in; returns where its registers are.
    fn look(&mut self, client: &mut dyn Client, ping: &Ping) -> Result<Layout, InspectError> {
        let id = ping.id;
        let known = Model::by_number(ping.model);
        let model = known.unwrap_or(&XL430_W250);
        if model.protocol == Protocol::One {
            let model = model.name;
            return Err(InspectError::ProtocolOne { id, model });
        }
        if known.is_none() {
            self.notes.push(format!(
                "servo {id} has model number {}, which is in no table; its registers are taken for those of the X series",
                ping.model
            ));
        }
        let Some(layout) = Layout::of(model) else {
            return Err(InspectError::Nobody);
        };
        if known.is_none_or(|model| ping.firmware < model.fast_reads_since) {
            if self.reads == Reads::Fast {
                self.notes.push(format!(
                    "servo {id} has firmware {}: ordinary sync reads are used",
                    ping.firmware
                ));
            }
            self.reads = Reads::Ordinary;
        }
        let delay = byte(client, id, model, "return_delay_time")?;
        self.return_delay = self
            .return_delay
            .max(wire::return_delay(delay.unwrap_or(0)));
        let torque = byte(client, id, model, "torque_enable")?.unwrap_or(0) != 0;
        let drive_mode = byte(client, id, model, "drive_mode")?.unwrap_or(0);
        let mut servo = BenchServo {
            id,
            model: Some(known.map_or("unknown", |model| model.name)),
            torque,
            goal: None,
            follows: !torque,
        };
        if drive_mode & TORQUE_ON_BY_GOAL == 0 {
            let mut present = [0; GOAL_BYTES];
            let mut goal = [0; GOAL_BYTES];
            let at = layout.state + layout.position_at as u16;
            insist(client, id, at, &mut present[..layout.goal_len])?;
            insist(client, id, layout.goal, &mut goal[..layout.goal_len])?;
            let near = SAG_TURNS * model.pulses_per_turn;
            let held = torque && f64::from(apart(goal, present)) <= near;
            servo.goal = Some(if held { goal } else { present });
        } else {
            self.notes.push(format!(
                "servo {id} turns torque on when it gets a goal (drive_mode bit 3): it is read and gets none"
            ));
        }
        self.servos.push(servo);
        Ok(layout)
    }
}

/// How many counts lie between two positions.
fn apart(a: [u8; GOAL_BYTES], b: [u8; GOAL_BYTES]) -> u32 {
    i32::from_le_bytes(a).abs_diff(i32::from_le_bytes(b))
}

/// A register of one byte; `None` when the model has none of this name.
fn byte(
    client: &mut dyn Client,
    id: u8,
    model: &Model,
    name: &str,
) -> Result<Option<u8>, ClientError> {
    let Some(register) = model.register(name) else {
        return Ok(None);
    };
    let mut value = [0];
    insist(client, id, register.address, &mut value)?;
    Ok(Some(value[0]))
}

/// Reads, a few times if no answer comes.
fn insist(
    client: &mut dyn Client,
    id: u8,
    address: u16,
    data: &mut [u8],
) -> Result<(), ClientError> {
    let mut tries = 1;
    loop {
        match client.read(id, address, data) {
            Ok(_) => return Ok(()),
            Err(ClientError::Timeout { .. }) if tries < TRIES => tries += 1,
            Err(error) => return Err(error),
        }
    }
}
