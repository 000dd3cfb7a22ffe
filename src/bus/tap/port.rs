//! A port that logs what the one behind it answers.

use super::event::{Event, PortFault};
use super::log::Log;
use crate::base::Time;
use crate::bus::{Port, PortError};
use std::sync::Arc;
use std::time::Duration;

/// Passes every call on to a port and logs the answer. Allocates nothing.
///
/// A method that [`Port`] gains and whose answer matters has to be logged here and answered by
/// [`super::ReplayPort`].
pub struct TapPort {
    port: Box<dyn Port>,
    log: Arc<Log>,
}

impl TapPort {
    /// A tap on `port` that writes to `log`, which belongs to this port alone.
    pub fn new(port: Box<dyn Port>, log: Arc<Log>) -> Self {
        let latency = port.latency_timer().unwrap_or_default();
        let name = port.name().as_bytes();
        log.write(|entry| Event::Open(name, port.baud(), latency).write(entry));
        Self { port, log }
    }

    fn note(&self, event: Event<'_>) {
        self.log.write(|entry| event.write(entry));
    }

    fn noted<T>(&self, outcome: Result<T, PortError>) -> Result<T, PortError> {
        if let Err(error) = &outcome {
            self.note(Event::Fault(PortFault::of(error)));
        }
        outcome
    }
}

impl Port for TapPort {
    fn name(&self) -> &str {
        self.port.name()
    }

    fn baud(&self) -> u32 {
        self.port.baud()
    }

    fn latency_timer(&self) -> Option<Duration> {
        self.port.latency_timer()
    }

    fn set_baud(&mut self, baud: u32) -> Result<(), PortError> {
        let outcome = self.port.set_baud(baud);
        if outcome.is_ok() {
            self.note(Event::Baud(baud));
        }
        self.noted(outcome)
    }

    fn now(&self) -> Time {
        let now = self.port.now();
        self.note(Event::Now(now));
        now
    }

    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        // Before the call: what was to be sent counts, whatever becomes of it.
        self.note(Event::Write(self.port.now(), bytes));
        let outcome = self.port.write_all(bytes);
        self.noted(outcome)
    }

    fn read(&mut self, buf: &mut [u8], want: usize, deadline: Time) -> Result<usize, PortError> {
        let outcome = self.port.read(buf, want, deadline);
        if let Ok(count) = outcome {
            self.note(Event::Read(self.port.now(), &buf[..count.min(buf.len())]));
        }
        self.noted(outcome)
    }

    fn discard_input(&mut self) -> Result<(), PortError> {
        let outcome = self.port.discard_input();
        if outcome.is_ok() {
            self.note(Event::Discard);
        }
        self.noted(outcome)
    }
}
