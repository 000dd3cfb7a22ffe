//! A table over time of what simulated servos really do, beside what they say of it: one CSV row every 5 ms.

use super::line::Line;
use crate::base::Time;
use std::io::{self, Write};
use std::time::Duration;

/// Time between two rows.
pub const TRACE_PERIOD: Duration = Duration::from_millis(5);

/// Columns per servo, behind its label and a dot.
pub const TRACE_COLUMNS: [&str; 7] = [
    "position", "goal", "torque", "watchdog", "load", "celsius", "volts",
];

/// Writes the rows of a line.
pub struct Trace {
    out: Box<dyn Write + Send>,
    due: Time,
}

impl Trace {
    /// Begins with the header: `t` (seconds), `packets` (instructions heard so far), then per servo
    /// `LABEL.position` (pulses, of the shaft), `.goal` (pulses), `.torque` (0 or 1), `.watchdog` (register
    /// 98: -1 = tripped), `.load` (motor torque as a share of stall), `.celsius`, `.volts`.
    pub fn new(line: &Line, mut out: Box<dyn Write + Send>) -> io::Result<Self> {
        write!(out, "t,packets")?;
        for label in line.labels() {
            for column in TRACE_COLUMNS {
                write!(out, ",{label}.{column}")?;
            }
        }
        writeln!(out)?;
        out.flush()?;
        Ok(Self {
            out,
            due: Time::ZERO,
        })
    }

    /// When the next row is due.
    pub fn due(&self) -> Time {
        self.due
    }

    /// Writes the rows that are due by `now`, each with the servos as they are at its time.
    pub fn follow(&mut self, line: &mut Line, now: Time) -> io::Result<()> {
        if self.due > now {
            return Ok(());
        }
        while self.due <= now {
            line.advance(self.due);
            self.row(line)?;
            self.due = self.due + TRACE_PERIOD;
        }
        self.out.flush()
    }

    fn row(&mut self, line: &Line) -> io::Result<()> {
        write!(self.out, "{:.3},{}", self.due.secs(), line.packets())?;
        for servo in line.labels().filter_map(|label| line.servo(label)) {
            write!(
                self.out,
                ",{:.2},{},{},{},{:.3},{:.1},{:.1}",
                servo.position_pulses(),
                servo.goal_pulse(),
                u8::from(servo.torque_enabled()),
                servo.watchdog(),
                servo.effort(),
                servo.temperature_c(),
                servo.voltage_v(),
            )?;
        }
        writeln!(self.out)
    }
}
