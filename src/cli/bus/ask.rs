//! Questions on the terminal, or answers down a pipe; Ctrl-C ends any wait.

use super::say;
use crate::base::Clock;
use crate::cli::{ExitStatus, Failure};
use crate::live::RealClock;
use crate::live::StopSwitch;
use crate::live::arrival::is_readable;
use crate::live::stop::StopRequest;
use rustix::stdio::stdin;
use std::io::Write;
use std::time::Duration;

/// A wait for an answer looks up from this often.
const LOOK_UP: Duration = Duration::from_millis(20);

/// Who is asked: a person at a terminal, or lines of a pipe.
pub struct Ask {
    /// Pressed by signals.
    pub stop: StopSwitch,
    yes: bool,
    bytes: Vec<u8>,
    ended: bool,
}

/// An operator's interruption as a failure.
pub fn interrupted(message: impl std::fmt::Display) -> Failure {
    Failure {
        status: ExitStatus::Interrupted,
        message: message.to_string(),
    }
}

impl Ask {
    /// Someone to ask; with `yes` every question of yes or no is answered by yes, and no other may be asked.
    pub fn new(yes: bool) -> Result<Self, Failure> {
        let stop = StopSwitch::new();
        stop.on_signals().map_err(Failure::bus)?;
        Ok(Self {
            stop,
            yes,
            bytes: Vec::new(),
            ended: false,
        })
    }

    /// Whether nobody is to be asked.
    pub fn is_silent(&self) -> bool {
        self.yes
    }

    /// Whether the operator wants an end.
    pub fn is_stopped(&self) -> bool {
        self.stop.request() != StopRequest::None
    }

    /// Whether a whole line has been typed, without waiting for longer than `wait`.
    pub fn line_within(&mut self, wait: Duration) -> Option<String> {
        if let Some(line) = self.take_line() {
            return Some(line);
        }
        if !self.ended && is_readable(stdin(), wait).unwrap_or(false) {
            let mut chunk = [0; 256];
            match rustix::io::read(stdin(), &mut chunk) {
                Ok(count) if count > 0 => self.bytes.extend_from_slice(&chunk[..count]),
                _ => self.ended = true,
            }
        } else if self.ended {
            let clock = RealClock::new();
            clock.sleep_until(clock.now() + wait);
        }
        self.take_line()
    }

    /// Whether standard input has ended.
    pub fn is_over(&self) -> bool {
        self.ended && self.bytes.is_empty()
    }

    fn take_line(&mut self) -> Option<String> {
        let end = match self.bytes.iter().position(|b| *b == b'\n') {
            Some(end) => end + 1,
            None if self.ended && !self.bytes.is_empty() => self.bytes.len(),
            None => return None,
        };
        let line: Vec<u8> = self.bytes.drain(..end).collect();
        Some(String::from_utf8_lossy(&line).trim().to_owned())
    }

    /// Waits for a line, doing `meanwhile` every 20 ms. Fails by 130 when interrupted, by 2 when nobody is there to answer.
    pub fn line(
        &mut self,
        meanwhile: &mut dyn FnMut() -> Result<(), Failure>,
    ) -> Result<String, Failure> {
        loop {
            if self.is_stopped() {
                return Err(interrupted("interrupted"));
            }
            if let Some(line) = self.line_within(LOOK_UP) {
                return Ok(line);
            }
            if self.is_over() {
                return Err(Failure::input(
                    "standard input has ended and a question is open; answer on a terminal, or use --yes",
                ));
            }
            meanwhile()?;
        }
    }

    /// Asks `question`, to be answered by yes or no; Enter alone is `default`.
    pub fn confirm(
        &mut self,
        out: &mut dyn Write,
        question: &str,
        default: bool,
    ) -> Result<bool, Failure> {
        if self.yes {
            return Ok(true);
        }
        let hint = if default { "[Y/n]" } else { "[y/N]" };
        loop {
            prompt(out, format_args!("{question} {hint} "));
            match self.line(&mut || Ok(()))?.to_ascii_lowercase().as_str() {
                "" => return Ok(default),
                "y" | "yes" => return Ok(true),
                "n" | "no" => return Ok(false),
                other => say(out, format_args!("'{other}' is neither y nor n"))?,
            }
        }
    }
}

/// Prints without ending the line.
pub fn prompt(out: &mut dyn Write, text: impl std::fmt::Display) {
    // A reader that has gone away is no failure.
    let _ = write!(out, "{text}").and_then(|()| out.flush());
}
