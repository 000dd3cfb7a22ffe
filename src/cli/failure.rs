//! How a command ends: exit codes (a contract) and failures with a message for the reader.

use crate::live::source::SourceError;
use std::fmt;
use std::process::ExitCode;

/// Exit codes of the program.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum ExitStatus {
    /// The work was done.
    Done = 0,
    /// Bad usage, configuration or input.
    BadInput = 2,
    /// A bus or device failed.
    BusFailure = 3,
    /// The robot was stopped for safety.
    SafetyStop = 4,
    /// Interrupted by the operator; the servos are in their declared safe state.
    Interrupted = 130,
}

impl From<ExitStatus> for ExitCode {
    fn from(status: ExitStatus) -> Self {
        ExitCode::from(status as u8)
    }
}

/// Why a command failed, with the exit code it leads to.
#[derive(Debug)]
pub struct Failure {
    /// The exit code.
    pub status: ExitStatus,
    /// What happened, what was expected and what to do.
    pub message: String,
}

impl Failure {
    /// Bad usage, configuration or input (exit code 2).
    pub fn input(message: impl fmt::Display) -> Self {
        Self {
            status: ExitStatus::BadInput,
            message: message.to_string(),
        }
    }

    /// A bus or device failed (exit code 3).
    pub fn bus(message: impl fmt::Display) -> Self {
        Self {
            status: ExitStatus::BusFailure,
            message: message.to_string(),
        }
    }
}

impl From<SourceError> for Failure {
    fn from(error: SourceError) -> Self {
        match error {
            SourceError::Interrupted => Self {
                status: ExitStatus::Interrupted,
                message: error.to_string(),
            },
            other => Self::input(other),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}
