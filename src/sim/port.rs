//! A simulated line as a port of this process, in virtual or real time.

use super::line::SharedLine;
use crate::base::{Clock, Time};
use crate::bus::{Port, PortError};
use std::sync::Arc;

/// The host's end of a simulated line.
///
/// On a [`VirtualClock`](crate::base::VirtualClock) waiting for bytes moves the clock to the exact
/// time of their arrival, so that a run takes no real time and repeats bit for bit; on a real clock
/// the same line lives in real time. Allocates nothing in steady state.
pub struct SimPort {
    line: SharedLine,
    clock: Arc<dyn Clock>,
    baud: u32,
    /// Let go of, and not opened again since.
    closed: bool,
}

impl SimPort {
    /// A port at `baud_bps` on `line`. Keep a clone of the line to look at its servos.
    pub fn new(line: SharedLine, clock: Arc<dyn Clock>, baud_bps: u32) -> Self {
        Self {
            line,
            clock,
            baud: baud_bps,
            closed: false,
        }
    }

    fn check(&self, now: Time) -> Result<(), PortError> {
        let mut line = self.line.lock();
        if !self.closed && !line.is_unplugged(now) {
            return Ok(());
        }
        line.advance(now);
        line.clear();
        Err(PortError::Gone {
            port: self.name().to_owned(),
            reason: "unplugged by an injected fault".to_owned(),
        })
    }
}

impl Port for SimPort {
    fn name(&self) -> &str {
        "sim"
    }

    fn baud(&self) -> u32 {
        self.baud
    }

    fn set_baud(&mut self, baud: u32) -> Result<(), PortError> {
        if baud == 0 {
            return Err(PortError::Baud {
                port: self.name().to_owned(),
                baud,
                reason: "a line needs a rate above zero".to_owned(),
            });
        }
        self.baud = baud;
        Ok(())
    }

    fn now(&self) -> Time {
        self.clock.now()
    }

    /// Returns at once, like a serial driver with an empty queue: the clock does not move, the bytes
    /// leave at line speed, and answers come after the last of them.
    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let now = self.clock.now();
        self.check(now)?;
        self.line.lock().send(now, self.baud, bytes);
        Ok(())
    }

    fn read(&mut self, buf: &mut [u8], want: usize, deadline: Time) -> Result<usize, PortError> {
        let want = want.clamp(1, buf.len().max(1));
        let now = self.clock.now();
        self.check(now)?;
        // Nothing new can come onto the line while its only host waits, except the unplugging.
        let (complete, change) = {
            let line = self.line.lock();
            (line.arrival(want - 1), line.next_fault_change(now))
        };
        let wake = complete.map_or(deadline, |at| at.min(deadline));
        if let Some(change) = change.filter(|&change| change < wake) {
            self.clock.sleep_until(change);
            self.check(change)?;
        }
        self.clock.sleep_until(wake);
        let now = self.clock.now();
        self.check(now)?;
        Ok(self.line.lock().receive(now, buf))
    }

    fn discard_input(&mut self) -> Result<(), PortError> {
        let now = self.clock.now();
        self.check(now)?;
        let mut line = self.line.lock();
        let mut waste = [0; 64];
        while line.receive(now, &mut waste) > 0 {}
        Ok(())
    }

    fn candidates(&self) -> Vec<String> {
        vec![self.name().to_owned()]
    }

    /// It comes back under its own name, once it is plugged in again.
    fn reopen(&mut self, _: &str) -> Result<(), PortError> {
        self.closed = false;
        self.check(self.clock.now())
    }

    fn close(&mut self) {
        self.closed = true;
    }
}
