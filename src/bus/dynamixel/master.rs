//! Our own master of the line: frames out, answers in, and no longer a wait than the wire needs.
//!
//! The deadline of an answer is when its last byte can be there, computed from bytes and baud rate,
//! plus the servos' return delay, plus an allowance for adapter and system. The allowance is learnt
//! from how late answers really are, because a fixed one is either too long for a control cycle with
//! a silent servo or too short for a USB adapter.

use super::allowance::Allowance;
use super::client::{ClientError, Ping, Reply};
use super::listener::{FRAME_BYTES, Listener};
use super::model::Protocol;
use crate::base::Time;
use crate::bus::port::Port;
use handwave_dynamixel::{BROADCAST_ID, BufferTooSmall, ErrorCode, Instruction, Status, wire};
use std::time::Duration;

/// Longest combined status: 253 servos with 12 bytes each.
pub(super) const FAST_BYTES: usize = 4096;

/// What a [`Master`] allows for.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct MasterOptions {
    /// Largest return delay of the servos until the chain knows better. Default 508 us, the most
    /// that register 9 can hold.
    pub return_delay: Duration,
    /// Least allowance for adapter and system. Default 600 us.
    pub min_allowance: Duration,
    /// Allowance to begin with, and the most that silence alone leads to. Default 4 ms: a USB adapter with a
    /// latency timer of 1 ms, or a busy system.
    pub first_allowance: Duration,
    /// Most allowance, for answers that were seen to come late. Default 40 ms: twice the latency timer of a
    /// USB adapter as it comes from the shop, and some.
    pub max_allowance: Duration,
}

impl Default for MasterOptions {
    fn default() -> Self {
        MasterOptions {
            return_delay: wire::return_delay(254),
            min_allowance: Duration::from_micros(600),
            first_allowance: Duration::from_millis(4),
            max_allowance: Duration::from_millis(40),
        }
    }
}

impl MasterOptions {
    /// The default, with patience for an adapter that keeps bytes back.
    pub fn of(port: &dyn Port) -> Self {
        let mut options = Self::default();
        options.first_allowance += port.latency_timer().unwrap_or_default();
        options
    }
}

/// Left of a control cycle after the servos behind a silent one were asked again.
const SPARE_MARGIN: Duration = Duration::from_micros(300);

/// Which protocols a [`Master`] speaks.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Speaks {
    /// To all servos the same.
    Only(Protocol),
    /// To each servo the one that it answers to: an unknown one is asked in Protocol 2.0 first, then in 1.0.
    Either,
}

impl Default for Speaks {
    fn default() -> Self {
        Speaks::Only(Protocol::Two)
    }
}

/// Speaks Protocol 2.0, and where it is told to 1.0, over a [`Port`].
pub struct Master {
    pub(super) port: Box<dyn Port>,
    pub(super) return_delay: Duration,
    pub(super) allowance: Allowance,
    /// When the last byte handed to the port leaves it.
    pub(super) line_free_at: Time,
    /// When the answer that was given up last was due.
    pub(super) missed_due: Option<Time>,
    /// What comes in before the next request is no answer to it and is thrown away: false right behind a
    /// request that nobody answers.
    pub(super) may_hold_stale: bool,
    pub(super) notes: Vec<String>,
    pub(super) cycle_end: Option<Time>,
    pub(super) listener: Listener,
    pub(super) speaks: Speaks,
    /// What each servo is known to speak.
    known: Box<[Option<Protocol>; 256]>,
    /// Something damaged came in while the latest answer was waited for.
    pub(super) heard_damage: bool,
    /// Bytes of a combined status.
    pub(super) combined: Box<[u8; FAST_BYTES]>,
    out: Box<[u8; FRAME_BYTES]>,
    pub(super) sent: u64,
    pub(super) received: u64,
    /// Damage that the parser does not see.
    pub(super) damaged: u64,
}

impl Master {
    /// A master over `port`.
    pub fn new(port: Box<dyn Port>, options: MasterOptions) -> Self {
        Master {
            port,
            return_delay: options.return_delay,
            allowance: Allowance::new(
                options.min_allowance,
                options.first_allowance,
                options.max_allowance,
            ),
            line_free_at: Time::ZERO,
            missed_due: None,
            may_hold_stale: true,
            notes: Vec::new(),
            cycle_end: None,
            listener: Listener::new(),
            speaks: Speaks::default(),
            known: Box::new([None; 256]),
            heard_damage: false,
            combined: Box::new([0; FAST_BYTES]),
            out: Box::new([0; FRAME_BYTES]),
            sent: 0,
            received: 0,
            damaged: 0,
        }
    }

    /// With something to tell of its port.
    pub fn with_notes(self, notes: Vec<String>) -> Self {
        Master { notes, ..self }
    }

    /// Speaking other protocols than 2.0 alone.
    pub fn speaking(self, speaks: Speaks) -> Self {
        Master { speaks, ..self }
    }

    /// Whether servo `id` is to be spoken to in Protocol 1.0; finds out where either is possible.
    pub(super) fn is_one(&mut self, id: u8) -> Result<bool, ClientError> {
        let known = match self.speaks {
            Speaks::Only(protocol) => Some(protocol),
            Speaks::Either if id == BROADCAST_ID => Some(Protocol::Two),
            Speaks::Either => self.known[usize::from(id)],
        };
        if let Some(protocol) = known {
            return Ok(protocol == Protocol::One);
        }
        match self.ping_either(id) {
            Ok((_, protocol)) => Ok(protocol == Protocol::One),
            Err(ClientError::Port(error)) => Err(error.into()),
            // Nobody there, or out of its mind: what is asked next says so.
            Err(_) => Ok(false),
        }
    }

    /// Pings in Protocol 2.0, then in 1.0, and keeps who answers to what.
    pub(super) fn ping_either(&mut self, id: u8) -> Result<(Ping, Protocol), ClientError> {
        let found = match self.ping_two(id) {
            Err(ClientError::Timeout { .. }) => (self.ping_one(id)?, Protocol::One),
            answer => (answer?, Protocol::Two),
        };
        self.known[usize::from(id)] = Some(found.1);
        Ok(found)
    }

    /// Notes who answered in Protocol 2.0.
    pub(super) fn speak_two_to(&mut self, ids: &[bool; 256]) {
        for (known, _) in self.known.iter_mut().zip(ids).filter(|(_, is)| **is) {
            *known = Some(Protocol::Two);
        }
    }

    /// Whether servo `id` is known to speak Protocol 2.0.
    pub(super) fn is_two(&self, id: u8) -> bool {
        self.known[usize::from(id)] == Some(Protocol::Two)
    }

    /// Notes who answered in Protocol 1.0.
    pub(super) fn speak_one_to(&mut self, id: u8) {
        self.known[usize::from(id)] = Some(Protocol::One);
    }

    /// Time of `bytes` on the line.
    pub(super) fn wire_time(&self, bytes: usize) -> Duration {
        wire::duration(bytes, self.port.baud())
    }

    /// Sends the frame that `encode` writes, after whatever is on the line, having thrown away stale input.
    pub(super) fn send<F>(&mut self, encode: F) -> Result<(), ClientError>
    where
        F: for<'b> FnOnce(&'b mut [u8]) -> Result<&'b [u8], BufferTooSmall>,
    {
        let frame = encode(&mut self.out[..]).map_err(|BufferTooSmall { capacity }| {
            ClientError::TooLong {
                bytes: capacity + 1,
                limit: capacity,
            }
        })?;
        self.damaged += self.listener.clear() as u64;
        if self.allowance.take_gave_up() {
            let mut late = [0; 256];
            let count = self.port.read(&mut late, 1, self.port.now())?;
            if count > 0 {
                // The answer given up was late rather than lost.
                self.damaged += count as u64;
                self.allowance.lengthen();
            }
        }
        if std::mem::replace(&mut self.may_hold_stale, true) {
            self.port.discard_input()?;
        }
        let begin = self.port.now().max(self.line_free_at);
        self.line_free_at = begin + wire::duration(frame.len(), self.port.baud());
        self.sent += frame.len() as u64;
        self.port.write_all(frame)?;
        Ok(())
    }

    /// When `bytes` of answers to the request just sent must be there if nobody is late.
    pub(super) fn due(&self, delays: u32, bytes: usize) -> Time {
        self.line_free_at + self.return_delay * delays + self.wire_time(bytes)
    }

    /// Until when the next part of an answer due at `due` is waited for, when asking the servos behind it
    /// again would take `again` bytes, there and back.
    pub(super) fn deadline(&self, due: Time, again: usize) -> Time {
        let spare = self
            .cycle_end
            .map(|end| end - self.wire_time(again) - SPARE_MARGIN);
        let patient = due + self.allowance.get();
        spare.map_or(patient, |spare| patient.max(spare))
    }

    /// Gives an answer up that was due at `due`; `nothing` of it came.
    pub(super) fn missed(&mut self, due: Time, nothing: bool) {
        self.missed_due = Some(due);
        self.allowance.missed(nothing);
    }

    /// Learns from an answer that was complete just now and due at `due`.
    pub(super) fn arrived(&mut self, due: Time) {
        self.missed_due = None;
        let lateness = self.port.now().saturating_since(due);
        self.allowance.arrived(lateness);
    }

    /// Takes statuses in until `accept` says that it has what it wants (true) or `deadline` passes (false).
    ///
    /// `want` is how many bytes are expected, so that waiting costs few calls.
    pub(super) fn receive(
        &mut self,
        mut want: usize,
        deadline: Time,
        mut accept: impl FnMut(&Status<'_>) -> Accepted,
    ) -> Result<bool, ClientError> {
        loop {
            while let Some((accepted, len)) = self
                .listener
                // An adapter may echo our own instructions: no status, and no damage.
                .next(|status| status.map_or(Accepted::More, |status| accept(&status)))
            {
                want = want.saturating_sub(len);
                match accepted {
                    Accepted::Done => return Ok(true),
                    Accepted::More => {}
                    Accepted::Stranger => self.damaged += 1,
                }
            }
            let mut chunk = [0; 512];
            let missing = want
                .saturating_sub(self.listener.buffered())
                .max(self.listener.missing())
                .min(chunk.len());
            let count = self.port.read(&mut chunk, missing, deadline)?;
            if count == 0 {
                return Ok(false);
            }
            self.received += count as u64;
            self.listener.push(&chunk[..count]);
        }
    }

    /// Sends an instruction that is answered without data; to the broadcast id nobody answers.
    pub(super) fn command(
        &mut self,
        id: u8,
        instruction: &Instruction<'_>,
    ) -> Result<Reply, ClientError> {
        self.send(|buf| instruction.encode(id, buf))?;
        if id == BROADCAST_ID {
            return Ok(Reply::default());
        }
        self.answer(id, &mut [])
    }

    /// Waits for the answer of `id` to the request just sent.
    pub(super) fn answer(&mut self, id: u8, data: &mut [u8]) -> Result<Reply, ClientError> {
        self.answer_by(id, data, None)
    }

    /// Waits for the answer of `id`, until `latest` at most.
    pub(super) fn answer_by(
        &mut self,
        id: u8,
        data: &mut [u8],
        latest: Option<Time>,
    ) -> Result<Reply, ClientError> {
        self.answer_within(id, data, wire::status(data.len()), latest)
    }

    /// Waits for the answer of `id`, which takes `bytes` on the line, until `latest` at most.
    pub(super) fn answer_within(
        &mut self,
        id: u8,
        data: &mut [u8],
        bytes: usize,
        latest: Option<Time>,
    ) -> Result<Reply, ClientError> {
        let waste = self.listener.waste();
        let asked_at = self.port.now();
        let due = self.due(1, bytes);
        let patient = due + self.allowance.get();
        let deadline = latest.map_or(patient, |latest| patient.min(latest));
        let mut result = None;
        let expected = data.len();
        let answered = self.receive(bytes, deadline, |status| {
            if status.id != id {
                return Accepted::Stranger;
            }
            result = Some(if status.error != ErrorCode::None {
                Err(ClientError::Refused {
                    id,
                    error: status.error,
                })
            } else if status.params.len() != expected {
                Err(ClientError::AnswerLength {
                    id,
                    expected,
                    found: status.params.len(),
                })
            } else {
                data.copy_from_slice(status.params);
                Ok(Reply {
                    alert: status.alert,
                })
            });
            Accepted::Done
        })?;
        if answered {
            self.arrived(due);
        } else {
            self.missed(due, true);
        }
        self.heard_damage = self.listener.waste() > waste;
        result.unwrap_or_else(|| {
            let waited = self.port.now().saturating_since(asked_at);
            Err(ClientError::Timeout {
                id,
                waited_us: u64::try_from(waited.as_micros()).unwrap_or(u64::MAX),
            })
        })
    }
}

/// What the receiver of a status thinks of it.
pub(super) enum Accepted {
    /// Nothing more is wanted.
    Done,
    /// It was wanted, others too.
    More,
    /// Nobody asked for it.
    Stranger,
}
