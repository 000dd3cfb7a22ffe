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
    /// Which of the adapter's names this was opened under; 0 is the first.
    adapter: u32,
    name: String,
}

impl SimPort {
    /// A port at `baud_bps` on `line`, under the name that the adapter has now: `sim`, or `sim.1` once a
    /// fault has brought it back so. Keep a clone of the line to look at its servos.
    pub fn new(line: SharedLine, clock: Arc<dyn Clock>, baud_bps: u32) -> Self {
        let mut port = Self {
            line,
            clock,
            baud: baud_bps,
            closed: false,
            adapter: 0,
            name: String::new(),
        };
        port.find();
        port
    }

    /// The name that the adapter has now, and its number.
    fn present_name(&self) -> (u32, String) {
        let adapter = self.line.lock().adapter_name(self.clock.now());
        let name = match adapter {
            0 => "sim".to_owned(),
            number => format!("sim.{number}"),
        };
        (adapter, name)
    }

    /// Takes the name that the adapter has now.
    fn find(&mut self) {
        (self.adapter, self.name) = self.present_name();
    }

    fn check(&self, now: Time) -> Result<(), PortError> {
        let mut line = self.line.lock();
        let there = line.adapter_name(now);
        let reason = if self.closed {
            "it was let go of".to_owned()
        } else if line.is_unplugged(now) {
            "unplugged by an injected fault".to_owned()
        } else if there != self.adapter {
            format!("an injected fault has plugged it in again as sim.{there}")
        } else {
            return Ok(());
        };
        line.advance(now);
        line.clear();
        Err(PortError::Gone {
            port: self.name.clone(),
            reason,
        })
    }
}

impl Port for SimPort {
    fn name(&self) -> &str {
        &self.name
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
        vec![self.present_name().1]
    }

    /// It comes back under the name that it has then, once it is plugged in again.
    fn reopen(&mut self, _: &str) -> Result<(), PortError> {
        self.closed = false;
        self.find();
        self.check(self.clock.now())
    }

    fn close(&mut self) {
        self.closed = true;
    }
}
