//! The `dynamixel2` crate as a second [`Client`], for comparison with our own.
//!
//! Its limits: no fast reads (an ordinary sync read stands in), no bulk and no backup of tables, 34 ms of patience added to every
//! wait, so one silent servo stalls a control cycle; a servo that is silent in a sync read spoils
//! the answers of those behind it; builds with overflow checks panic on some damaged frames.

use super::client::{Client, ClientError, Outcome, Ping, Reply, Traffic};
use crate::base::{Clock, Time};
use crate::bus::port::PortError;
use dynamixel2::instructions::{FactoryResetKind, SyncWriteData};
use dynamixel2::{Bus, ReadError, Response, TransferError, WriteError};
use handwave_dynamixel::instruction::FactoryReset;
use handwave_dynamixel::{BROADCAST_ID, ErrorCode, wire};
use serial2::SerialPort;
use std::io;
use std::sync::Arc;
use std::time::Duration;

/// What the crate adds to the wire time of every answer.
const PATIENCE: Duration = Duration::from_millis(34);
/// Room for a sync write to a long chain and for a whole control table.
const BUFFER_BYTES: usize = 2048;

/// A client over the `dynamixel2` crate.
pub struct Dynamixel2Client {
    bus: Bus<Vec<u8>, Vec<u8>>,
    name: String,
    clock: Arc<dyn Clock>,
    traffic: Traffic,
}

impl Dynamixel2Client {
    /// Opens `path` at `baud` bits per second. `clock` must run in real time.
    pub fn open(path: &str, baud: u32, clock: Arc<dyn Clock>) -> Result<Self, PortError> {
        let failed = |reason: String| PortError::Open {
            port: path.into(),
            reason,
            advice: "Without backend=dynamixel2 our own driver says more about the cause".into(),
        };
        let port = SerialPort::open(path, baud).map_err(|error| failed(error.to_string()))?;
        let bus = Bus::with_buffers(port, vec![0; BUFFER_BYTES], vec![0; BUFFER_BYTES])
            .map_err(|error| failed(format!("{error:?}")))?;
        Ok(Dynamixel2Client {
            bus,
            name: path.into(),
            clock,
            traffic: Traffic::default(),
        })
    }

    /// Counts a transaction; the crate does not tell, so stuffing and damage are not in it.
    fn count(&mut self, sent: usize, received: usize) {
        self.traffic.sent += sent as u64;
        self.traffic.received += received as u64;
    }

    fn gone(&self, error: &io::Error) -> ClientError {
        ClientError::Port(PortError::Gone {
            port: self.name.clone(),
            reason: error.to_string(),
        })
    }

    fn write_error(&self, error: &WriteError) -> ClientError {
        match error {
            WriteError::BufferTooSmall(size) => ClientError::TooLong {
                bytes: size.required_size,
                limit: size.total_size,
            },
            WriteError::DiscardBuffer(error) | WriteError::Write(error) => self.gone(error),
        }
    }

    fn transfer_error(&mut self, id: u8, error: &TransferError) -> ClientError {
        match error {
            TransferError::WriteError(error) => self.write_error(error),
            TransferError::ReadError(ReadError::MotorError(error)) => ClientError::Refused {
                id,
                error: ErrorCode::from_byte(error.error_number()),
            },
            TransferError::ReadError(ReadError::Io(error))
                if error.kind() != io::ErrorKind::TimedOut =>
            {
                self.gone(error)
            }
            TransferError::ReadError(error) => {
                self.traffic.damaged += u64::from(matches!(error, ReadError::InvalidMessage(_)));
                ClientError::Timeout {
                    id,
                    waited_us: u64::try_from(PATIENCE.as_micros()).unwrap_or(u64::MAX),
                }
            }
        }
    }

    fn reply<T>(
        &mut self,
        id: u8,
        outcome: Result<Response<T>, TransferError>,
    ) -> Result<(Reply, T), ClientError> {
        match outcome {
            Ok(response) => Ok((
                Reply {
                    alert: response.alert,
                },
                response.data,
            )),
            Err(error) => Err(self.transfer_error(id, &error)),
        }
    }
}

impl Client for Dynamixel2Client {
    fn port_name(&self) -> &str {
        &self.name
    }

    fn baud(&self) -> u32 {
        self.bus.baud_rate()
    }

    fn set_baud(&mut self, baud: u32) -> Result<(), ClientError> {
        self.bus.set_baud_rate(baud).map_err(|error| {
            ClientError::Port(PortError::Baud {
                port: self.name.clone(),
                baud,
                reason: error.to_string(),
            })
        })
    }

    fn now(&self) -> Time {
        self.clock.now()
    }

    fn traffic(&self) -> Traffic {
        self.traffic
    }

    fn backend(&self) -> &'static str {
        "dynamixel2"
    }

    /// Without effect: 34 ms are more than any return delay.
    fn set_return_delay(&mut self, _: Duration) {}

    fn patience(&self) -> Duration {
        PATIENCE
    }

    fn ping(&mut self, id: u8) -> Result<Ping, ClientError> {
        self.count(wire::BARE_INSTRUCTION, wire::PING_STATUS);
        let outcome = self.bus.ping(id);
        let (reply, ping) = self.reply(id, outcome)?;
        Ok(Ping {
            id,
            model: ping.model,
            firmware: ping.firmware,
            alert: reply.alert,
        })
    }

    fn ping_all(&mut self, found: &mut dyn FnMut(Ping)) -> Result<(), ClientError> {
        self.count(wire::BARE_INSTRUCTION, 0);
        let mut answers = 0;
        let outcome = self.bus.scan_cb(|response| {
            answers += 1;
            found(Ping {
                id: response.motor_id,
                model: response.data.model,
                firmware: response.data.firmware,
                alert: response.alert,
            });
        });
        self.count(0, answers * wire::PING_STATUS);
        match outcome {
            Ok(()) => Ok(()),
            Err(error) => Err(self.transfer_error(BROADCAST_ID, &error)),
        }
    }

    fn read(&mut self, id: u8, address: u16, data: &mut [u8]) -> Result<Reply, ClientError> {
        let length = u16::try_from(data.len()).unwrap_or(u16::MAX);
        self.count(wire::READ, wire::status(data.len()));
        let outcome = self.bus.read(id, address, length);
        let (reply, bytes) = self.reply(id, outcome)?;
        if bytes.len() != data.len() {
            return Err(ClientError::AnswerLength {
                id,
                expected: data.len(),
                found: bytes.len(),
            });
        }
        data.copy_from_slice(&bytes);
        Ok(reply)
    }

    fn write(&mut self, id: u8, address: u16, data: &[u8]) -> Result<Reply, ClientError> {
        if id == BROADCAST_ID {
            return Err(self.unsupported("write to all servos at once"));
        }
        self.count(wire::write(data.len()), wire::status(0));
        let outcome = self.bus.write(id, address, data);
        Ok(self.reply(id, outcome)?.0)
    }

    fn reboot(&mut self, id: u8) -> Result<Reply, ClientError> {
        self.count(wire::BARE_INSTRUCTION, wire::status(0));
        let outcome = self.bus.reboot(id);
        Ok(self.reply(id, outcome)?.0)
    }

    fn reg_write(&mut self, id: u8, address: u16, data: &[u8]) -> Result<Reply, ClientError> {
        self.count(wire::write(data.len()), wire::status(0));
        let outcome = self.bus.reg_write(id, address, data);
        Ok(self.reply(id, outcome)?.0)
    }

    fn action(&mut self, id: u8) -> Result<Reply, ClientError> {
        if id == BROADCAST_ID {
            self.count(wire::BARE_INSTRUCTION, 0);
            let sent = self.bus.broadcast_action();
            sent.map_err(|error| self.write_error(&error))?;
            return Ok(Reply::default());
        }
        self.count(wire::BARE_INSTRUCTION, wire::status(0));
        let outcome = self.bus.action(id);
        Ok(self.reply(id, outcome)?.0)
    }

    fn clear_multi_turn(&mut self, id: u8) -> Result<Reply, ClientError> {
        self.count(wire::BARE_INSTRUCTION + 5, wire::status(0));
        let outcome = self.bus.clear_revolution_counter(id);
        Ok(self.reply(id, outcome)?.0)
    }

    fn factory_reset(&mut self, id: u8, what: FactoryReset) -> Result<Reply, ClientError> {
        self.count(wire::BARE_INSTRUCTION + 1, wire::status(0));
        let kind = match what {
            FactoryReset::All => FactoryResetKind::ResetAll,
            FactoryReset::KeepId => FactoryResetKind::KeepId,
            FactoryReset::KeepIdAndBaud => FactoryResetKind::KeepIdAndBaudRate,
        };
        let outcome = self.bus.factory_reset(id, kind);
        Ok(self.reply(id, outcome)?.0)
    }

    fn sync_write(
        &mut self,
        address: u16,
        length: u16,
        ids: &[u8],
        data: &[u8],
    ) -> Result<(), ClientError> {
        let size = usize::from(length).max(1);
        let items: Vec<_> = ids
            .iter()
            .zip(data.chunks_exact(size))
            .map(|(&motor_id, data)| SyncWriteData { motor_id, data })
            .collect();
        self.count(wire::sync_write(items.len(), size), 0);
        let outcome = self.bus.sync_write(address, length, &items);
        outcome.map_err(|error| self.write_error(&error))
    }

    fn sync_read(
        &mut self,
        address: u16,
        length: u16,
        ids: &[u8],
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError> {
        outcomes.fill(Outcome::NotReached);
        let size = usize::from(length);
        let mut places = data.chunks_exact_mut(size.max(1)).zip(outcomes.iter_mut());
        let mut gone = None;
        let mut damaged = 0;
        let sent = self.bus.sync_read_cb(ids, address, length, |answer| {
            // The crate calls once per id, in order.
            let Some((place, outcome)) = places.next() else {
                return;
            };
            *outcome = match answer {
                Ok(response) if response.data.len() == place.len() => {
                    place.copy_from_slice(response.data);
                    Outcome::Fresh(Reply {
                        alert: response.alert,
                    })
                }
                Err(ReadError::MotorError(error)) => {
                    Outcome::Refused(ErrorCode::from_byte(error.error_number()))
                }
                Err(ReadError::Io(error)) if error.kind() == io::ErrorKind::TimedOut => {
                    Outcome::Silent
                }
                Err(ReadError::Io(error)) => {
                    gone = Some(error);
                    Outcome::Silent
                }
                Ok(_) | Err(_) => {
                    damaged += 1;
                    Outcome::Damaged
                }
            };
        });
        sent.map_err(|error| self.write_error(&error))?;
        if let Some(error) = gone {
            return Err(self.gone(&error));
        }
        self.traffic.damaged += damaged;
        let answers = outcomes
            .iter()
            .filter(|outcome| matches!(outcome, Outcome::Fresh(_)))
            .count();
        self.count(wire::sync_read(ids.len()), answers * wire::status(size));
        Ok(())
    }

    fn fast_sync_read(
        &mut self,
        address: u16,
        length: u16,
        ids: &[u8],
        data: &mut [u8],
        outcomes: &mut [Outcome],
    ) -> Result<(), ClientError> {
        self.sync_read(address, length, ids, data, outcomes)
    }
}
