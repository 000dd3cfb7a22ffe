//! The BUS argument: which servo bus, where, how fast.

use crate::base::suggest;
use std::fmt;
use std::str::FromStr;

/// Baud rate of a Dynamixel bus when none is given.
pub const DEFAULT_BAUD: u32 = 1_000_000;

/// A bus as named on the command line or in a configuration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusAddress {
    /// `sim`: simulated servos inside the process.
    Sim,
    /// `dynamixel:PATH[@BAUD][,backend=NAME]`: Dynamixel servos on a serial port.
    Dynamixel {
        /// Serial port, such as `/dev/ttyUSB0`.
        path: String,
        /// Bits per second.
        baud: u32,
        /// Which driver speaks.
        backend: DynamixelBackend,
    },
}

/// Which driver speaks to Dynamixel servos.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub enum DynamixelBackend {
    /// Our own.
    #[default]
    Handwave,
    /// The `dynamixel2` crate, for comparison; slower to give up on silent servos, no fast reads.
    Dynamixel2,
}

/// Why a text is not a bus.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AddressError {
    /// No such kind of bus.
    #[error(
        "unknown bus '{found}'{}. Allowed: sim, dynamixel:/dev/ttyUSB0@1000000",
        suggestion.map_or(String::new(), |name| format!(" (did you mean {name}?)"))
    )]
    Kind {
        /// What stood before the colon.
        found: String,
        /// The nearest known kind.
        suggestion: Option<&'static str>,
    },
    /// A kind of bus that is planned and not built in.
    #[error(
        "bus kind '{kind}' is not supported by this build yet. Supported: sim, dynamixel:PATH[@BAUD]"
    )]
    NotYet {
        /// The kind.
        kind: String,
    },
    /// The serial port is missing.
    #[error("bus '{found}' names no serial port. Write for example dynamixel:/dev/ttyUSB0@1000000")]
    NoPath {
        /// The whole text.
        found: String,
    },
    /// The baud rate is not a number in range.
    #[error("baud rate '{found}' is not a whole number from 9600 to 10000000, such as 1000000")]
    Baud {
        /// What stood there.
        found: String,
    },
    /// An option after the comma that does not exist.
    #[error("unknown bus option '{found}'. Allowed: backend=handwave, backend=dynamixel2")]
    Option {
        /// What stood there.
        found: String,
    },
}

const KINDS: [&str; 5] = ["sim", "dynamixel", "socketcan", "slcan", "hub"];

impl FromStr for BusAddress {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        let (kind, rest) = text.split_once(':').unwrap_or((text, ""));
        match kind {
            "sim" if rest.is_empty() => Ok(BusAddress::Sim),
            "dynamixel" => parse_dynamixel(text, rest),
            "socketcan" | "slcan" | "hub" => Err(AddressError::NotYet { kind: kind.into() }),
            _ => Err(AddressError::Kind {
                found: text.into(),
                suggestion: suggest::nearest(kind, KINDS),
            }),
        }
    }
}

fn parse_dynamixel(text: &str, rest: &str) -> Result<BusAddress, AddressError> {
    let mut parts = rest.split(',');
    let place = parts.next().unwrap_or("");
    let (path, baud) = match place.rsplit_once('@') {
        None => (place, DEFAULT_BAUD),
        Some((path, baud)) => (path, parse_baud(baud)?),
    };
    if path.is_empty() {
        return Err(AddressError::NoPath { found: text.into() });
    }
    let mut backend = DynamixelBackend::default();
    for option in parts {
        backend = match option {
            "backend=handwave" => DynamixelBackend::Handwave,
            "backend=dynamixel2" => DynamixelBackend::Dynamixel2,
            _ => {
                return Err(AddressError::Option {
                    found: option.into(),
                });
            }
        };
    }
    Ok(BusAddress::Dynamixel {
        path: path.into(),
        baud,
        backend,
    })
}

/// A baud rate as users write it.
pub fn parse_baud(text: &str) -> Result<u32, AddressError> {
    text.parse()
        .ok()
        .filter(|baud| (9_600..=10_000_000).contains(baud))
        .ok_or_else(|| AddressError::Baud { found: text.into() })
}

impl fmt::Display for BusAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            BusAddress::Sim => f.write_str("sim"),
            BusAddress::Dynamixel {
                path,
                baud,
                backend,
            } => {
                write!(f, "dynamixel:{path}@{baud}")?;
                match backend {
                    DynamixelBackend::Handwave => Ok(()),
                    DynamixelBackend::Dynamixel2 => f.write_str(",backend=dynamixel2"),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dynamixel(path: &str, baud: u32, backend: DynamixelBackend) -> BusAddress {
        BusAddress::Dynamixel {
            path: path.into(),
            baud,
            backend,
        }
    }

    #[test]
    fn what_users_write() {
        use DynamixelBackend::{Dynamixel2, Handwave};
        for (text, expected) in [
            ("sim", BusAddress::Sim),
            (
                "dynamixel:/dev/ttyUSB0",
                dynamixel("/dev/ttyUSB0", 1_000_000, Handwave),
            ),
            (
                "dynamixel:/dev/ttyUSB0@57600",
                dynamixel("/dev/ttyUSB0", 57_600, Handwave),
            ),
            (
                "dynamixel:/tmp/a@b@3000000",
                dynamixel("/tmp/a@b", 3_000_000, Handwave),
            ),
            (
                "dynamixel:/tmp/p,backend=dynamixel2",
                dynamixel("/tmp/p", 1_000_000, Dynamixel2),
            ),
        ] {
            assert_eq!(text.parse(), Ok(expected.clone()), "{text}");
            assert_eq!(
                expected.to_string().parse(),
                Ok(expected),
                "{text} written and read again"
            );
        }
    }

    #[test]
    fn errors_say_what_is_allowed() {
        for (text, part) in [
            ("dynamixle:/dev/ttyUSB0", "did you mean dynamixel?"),
            ("/dev/ttyUSB0", "Allowed: sim, dynamixel:"),
            ("dynamixel:", "names no serial port"),
            ("dynamixel:/dev/ttyUSB0@1M", "'1M' is not a whole number"),
            ("dynamixel:/dev/ttyUSB0@0", "'0' is not a whole number"),
            (
                "dynamixel:/dev/ttyUSB0,fast=1",
                "unknown bus option 'fast=1'",
            ),
            ("socketcan:can0", "not supported by this build yet"),
            ("slcan:/dev/ttyACM0", "not supported by this build yet"),
            ("hub:/dev/ttyACM0", "not supported by this build yet"),
            ("", "unknown bus ''"),
        ] {
            let message = text.parse::<BusAddress>().expect_err(text).to_string();
            assert!(message.contains(part), "'{text}' says: {message}");
        }
    }
}
