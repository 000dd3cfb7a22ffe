//! Our own master of the line: frames out, answers in, and no longer a wait than the wire needs.
//!
//! The deadline of an answer is when its last byte can be there, computed from bytes and baud rate,
//! plus the servos' return delay, plus an allowance for adapter and system. The allowance is learnt
//! from how late answers really are, because a fixed one is either too long for a control cycle with
//! a silent servo or too short for a USB adapter.

use super::allowance::Allowance;
use super::client::{Client, ClientError, Outcome, Ping, Reply, Traffic};
use crate::base::Time;
use crate::bus::port::Port;
use handwave_dynamixel::lists::encode_sync_write;
use handwave_dynamixel::{
    BROADCAST_ID, BufferTooSmall, ErrorCode, FrameParser, Instruction, MAX_ID, Status, wire,
};
use std::time::Duration;

/// Longest frame received one by one, and longest frame sent.
const FRAME_BYTES: usize = 2048;
/// Longest combined status: 253 servos with 12 bytes each.
pub(super) const FAST_BYTES: usize = 4096;
/// What a host has to wait per possible id after a broadcast ping, beside the answers' wire time.
const PING_SLOT: Duration = Duration::from_millis(3);

/// What a [`Master`] allows for.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct MasterOptions {
    /// Largest return delay of the servos until the chain knows better. Default 508 us, the most
    /// that register 9 can hold.
    pub return_delay: Duration,
    /// Least allowance for adapter and system. Default 600 us.
    pub min_allowance: Duration,
    /// Most allowance, and the one to begin with. Default 4 ms: a USB adapter with a latency timer
    /// of 1 ms, or a busy system.
    pub max_allowance: Duration,
}

impl Default for MasterOptions {
    fn default() -> Self {
        MasterOptions {
            return_delay: wire::return_delay(254),
            min_allowance: Duration::from_micros(600),
            max_allowance: Duration::from_millis(4),
        }
    }
}

impl MasterOptions {
    /// The default, with patience for an adapter that keeps bytes back.
    pub fn of(port: &dyn Port) -> Self {
        let mut options = Self::default();
        options.max_allowance += port.latency_timer().unwrap_or_default();
        options
    }
}

/// Left of a control cycle after the servos behind a silent one were asked again.
const SPARE_MARGIN: Duration = Duration::from_micros(300);

/// Speaks Protocol 2.0 over a [`Port`].
pub struct Master {
    pub(super) port: Box<dyn Port>,
    pub(super) return_delay: Duration,
    pub(super) allowance: Allowance,
    /// When the last byte handed to the port leaves it.
    line_free_at: Time,
    cycle_end: Option<Time>,
    pub(super) parser: FrameParser<FRAME_BYTES>,
    /// Bytes of a combined status.
    pub(super) combined: Box<[u8; FAST_BYTES]>,
    out: Box<[u8; FRAME_BYTES]>,
    sent: u64,
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
            allowance: Allowance::new(options.min_allowance, options.max_allowance),
            line_free_at: Time::ZERO,
            cycle_end: None,
            parser: FrameParser::new(),
            combined: Box::new([0; FAST_BYTES]),
            out: Box::new([0; FRAME_BYTES]),
            sent: 0,
            received: 0,
            damaged: 0,
        }
    }

    /// Time of `bytes` on the line.
    fn wire_time(&self, bytes: usize) -> Duration {
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
        self.damaged += self.parser.buffered() as u64;
        self.parser.clear();
        if self.allowance.take_gave_up() {
            let mut late = [0; 256];
            let count = self.port.read(&mut late, 1, self.port.now())?;
            if count > 0 {
                // The answer given up was late rather than lost.
                self.damaged += count as u64;
                self.allowance.lengthen();
            }
        }
        self.port.discard_input()?;
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

    /// Until when the next part of an answer due at `due` is waited for, when `behind` servos would be
    /// asked again if it does not come and answer with `answer_bytes` in all.
    pub(super) fn deadline(&self, due: Time, behind: usize, answer_bytes: usize) -> Time {
        let again = wire::sync_read(behind) + answer_bytes;
        let spare = self
            .cycle_end
            .map(|end| end - self.wire_time(again) - SPARE_MARGIN);
        let patient = due + self.allowance.get();
        spare.map_or(patient, |spare| patient.max(spare))
    }

    /// Learns from an answer that was complete just now and due at `due`.
    pub(super) fn arrived(&mut self, due: Time) {
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
            while let Some(frame) = self.parser.next_frame() {
                want = want.saturating_sub(frame.wire_len);
                // An adapter may echo our own instructions: no status, and no damage.
                if let Ok(status) = Status::parse(&frame) {
                    match accept(&status) {
                        Accepted::Done => return Ok(true),
                        Accepted::More => {}
                        Accepted::Stranger => self.damaged += 1,
                    }
                }
            }
            let mut chunk = [0; 512];
            let missing = want
                .saturating_sub(self.parser.buffered())
                .max(self.parser.missing())
                .min(chunk.len());
            let count = self.port.read(&mut chunk, missing, deadline)?;
            if count == 0 {
                return Ok(false);
            }
            self.received += count as u64;
            self.parser.push(&chunk[..count]);
        }
    }

    /// Waits for the answer of `id` to the request just sent.
    fn answer(&mut self, id: u8, data: &mut [u8]) -> Result<Reply, ClientError> {
        let bytes = wire::status(data.len());
        let asked_at = self.port.now();
        let due = self.due(1, bytes);
        let deadline = due + self.allowance.get();
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
            self.allowance.missed(true);
        }
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

fn ping_reply(id: u8, alert: bool, params: &[u8]) -> Option<Ping> {
    match *params {
        [low, high, firmware] => Some(Ping {
            id,
            model: u16::from_le_bytes([low, high]),
            firmware,
            alert,
        }),
        _ => None,
    }
}

impl Client for Master {
    fn port_name(&self) -> &str {
        self.port.name()
    }

    fn baud(&self) -> u32 {
        self.port.baud()
    }

    fn set_baud(&mut self, baud: u32) -> Result<(), ClientError> {
        Ok(self.port.set_baud(baud)?)
    }

    fn now(&self) -> Time {
        self.port.now()
    }

    fn traffic(&self) -> Traffic {
        let parser = self.parser.damage();
        Traffic {
            sent: self.sent,
            received: self.received,
            damaged: self.damaged + u64::from(parser.stray_bytes) + u64::from(parser.bad_crc),
        }
    }

    fn set_return_delay(&mut self, delay: Duration) {
        self.return_delay = delay;
    }

    fn patience(&self) -> Duration {
        self.return_delay + self.allowance.get()
    }

    fn set_cycle_end(&mut self, end: Option<Time>) {
        self.cycle_end = end;
    }

    fn settle(&mut self, quiet: Duration) -> Result<(), ClientError> {
        let end = self.port.now() + quiet * 10;
        let mut late = [0; 256];
        loop {
            let deadline = end.min(self.port.now() + quiet);
            let count = self.port.read(&mut late, 1, deadline)?;
            self.damaged += count as u64;
            if count == 0 || self.port.now() >= end {
                return Ok(());
            }
        }
    }

    fn ping(&mut self, id: u8) -> Result<Ping, ClientError> {
        self.send(|buf| Instruction::Ping.encode(id, buf))?;
        let mut params = [0; 3];
        let reply = self.answer(id, &mut params)?;
        Ok(Ping {
            id,
            model: u16::from_le_bytes([params[0], params[1]]),
            firmware: params[2],
            alert: reply.alert,
        })
    }

    fn ping_all(&mut self, found: &mut dyn FnMut(Ping)) -> Result<(), ClientError> {
        self.send(|buf| Instruction::Ping.encode(BROADCAST_ID, buf))?;
        let ids = u32::from(MAX_ID) + 1;
        let deadline = self.line_free_at
            + (PING_SLOT + self.wire_time(wire::PING_STATUS)) * ids
            + self.allowance.max();
        self.receive(wire::PING_STATUS, deadline, |status| {
            match ping_reply(status.id, status.alert, status.params) {
                Some(ping) => {
                    found(ping);
                    Accepted::More
                }
                None => Accepted::Stranger,
            }
        })?;
        Ok(())
    }

    fn read(&mut self, id: u8, address: u16, data: &mut [u8]) -> Result<Reply, ClientError> {
        let length = u16::try_from(data.len()).unwrap_or(u16::MAX);
        self.send(|buf| Instruction::Read { address, length }.encode(id, buf))?;
        self.answer(id, data)
    }

    fn write(&mut self, id: u8, address: u16, data: &[u8]) -> Result<Reply, ClientError> {
        self.send(|buf| Instruction::Write { address, data }.encode(id, buf))?;
        if id == BROADCAST_ID {
            return Ok(Reply::default());
        }
        self.answer(id, &mut [])
    }

    fn reboot(&mut self, id: u8) -> Result<Reply, ClientError> {
        self.send(|buf| Instruction::Reboot.encode(id, buf))?;
        if id == BROADCAST_ID {
            return Ok(Reply::default());
        }
        self.answer(id, &mut [])
    }

    fn sync_write(
        &mut self,
        address: u16,
        length: u16,
        ids: &[u8],
        data: &[u8],
    ) -> Result<(), ClientError> {
        let size = usize::from(length).max(1);
        let items = ids.iter().copied().zip(data.chunks(size));
        self.send(|buf| encode_sync_write(buf, address, length, items))
    }

    fn sync_read(
        &mut self,
        address: u16,
        length: u16,
        ids: &[u8],
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError> {
        self.read_in_turn(address, length, ids, data, outcomes)
    }

    fn fast_sync_read(
        &mut self,
        address: u16,
        length: u16,
        ids: &[u8],
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError> {
        self.read_combined(address, length, ids, data, outcomes)
    }
}
