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

/// One bus of a robot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BusLine {
    /// Its name in the configuration; `bus` where there is one.
    pub name: String,
    /// What it is.
    pub address: BusAddress,
    /// Baud rate of its simulated line.
    pub sim_baud: u32,
}

/// The buses of a robot, in the order of its configuration; at least one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Buses {
    lines: Vec<BusLine>,
    of_joint: Vec<usize>,
}

impl Buses {
    /// One bus for all.
    pub fn one(address: BusAddress, sim_baud: u32) -> Self {
        Self::several(
            vec![BusLine {
                name: "bus".into(),
                address,
                sim_baud,
            }],
            Vec::new(),
        )
    }

    /// Several; `of_joint` says which of them carries each joint, those not listed hang on the first.
    pub fn several(lines: Vec<BusLine>, of_joint: Vec<usize>) -> Self {
        Buses { lines, of_joint }
    }

    /// Each of them.
    pub fn lines(&self) -> &[BusLine] {
        &self.lines
    }

    /// Which of them carries joint `joint`.
    pub fn of_joint(&self, joint: usize) -> usize {
        self.of_joint.get(joint).copied().unwrap_or(0)
    }

    /// Whether all of them are simulated.
    pub fn is_simulated(&self) -> bool {
        self.lines
            .iter()
            .all(|line| line.address == BusAddress::Sim)
    }

    /// Puts a simulated line in place of each bus; buses that share a port share the line of the first.
    pub fn simulate(&mut self) {
        let first = |address: &BusAddress| self.lines.iter().position(|l| l.address == *address);
        let shared: Vec<usize> = self
            .lines
            .iter()
            .enumerate()
            .map(|(index, line)| match &line.address {
                BusAddress::Sim => index,
                port => first(port).unwrap_or(index),
            })
            .collect();
        for bus in &mut self.of_joint {
            *bus = shared.get(*bus).copied().unwrap_or(*bus);
        }
        for line in &mut self.lines {
            line.address = BusAddress::Sim;
        }
    }

    /// Puts `choice` in place of the bus that it names; without a name, of every bus of its kind. A simulated
    /// line stands for any kind.
    ///
    /// # Errors
    /// There is no bus of that name.
    pub fn choose(&mut self, choice: &BusChoice) -> Result<(), AddressError> {
        match &choice.name {
            None => {
                for line in &mut self.lines {
                    line.address = choice.address.clone();
                }
            }
            Some(name) => {
                let names = || self.lines.iter().map(|line| line.name.clone()).collect();
                let found = self.lines.iter().position(|line| line.name == *name);
                let index = found.ok_or_else(|| AddressError::Name {
                    found: name.clone(),
                    allowed: names(),
                })?;
                self.lines[index].address = choice.address.clone();
            }
        }
        Ok(())
    }
}

/// Whether every bus is that one.
impl PartialEq<BusAddress> for Buses {
    fn eq(&self, address: &BusAddress) -> bool {
        self.lines.iter().all(|line| line.address == *address)
    }
}

/// `[NAME=]BUS` as written on the command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BusChoice {
    /// Which bus of the configuration it is for; `None`: for all of its kind.
    pub name: Option<String>,
    /// The bus.
    pub address: BusAddress,
}

impl FromStr for BusChoice {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        // A bus may have an option with an equals sign, behind its colon.
        let named = text
            .split_once('=')
            .filter(|(name, _)| !name.is_empty() && !name.contains([':', ',', '/']));
        let (name, address) = match named {
            Some((name, address)) => (Some(name.to_owned()), address),
            None => (None, text),
        };
        Ok(BusChoice {
            name,
            address: address.parse()?,
        })
    }
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
    /// The configuration has no bus of that name.
    #[error("there is no bus called '{found}'. Buses: {}", allowed.join(", "))]
    Name {
        /// What stood before the equals sign.
        found: String,
        /// Those of the configuration.
        allowed: Vec<String>,
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
    fn a_bus_can_be_chosen_by_name_or_for_all() {
        let legs = dynamixel("/dev/ttyUSB0", 1_000_000, Default::default());
        let line = |name: &str| BusLine {
            name: name.into(),
            address: BusAddress::Sim,
            sim_baud: 1_000_000,
        };
        let mut buses = Buses::several(vec![line("legs"), line("arms")], vec![1, 0]);
        let choice = |text: &str| text.parse::<BusChoice>().expect(text);
        assert!(buses.is_simulated());
        buses
            .choose(&choice("legs=dynamixel:/dev/ttyUSB0"))
            .expect("there are legs");
        assert_eq!(buses.lines()[0].address, legs);
        assert_eq!(buses.lines()[1].address, BusAddress::Sim);
        assert_eq!((buses.of_joint(0), buses.of_joint(5)), (1, 0));
        let error = buses.choose(&choice("tail=sim")).expect_err("no tail");
        assert_eq!(
            error.to_string(),
            "there is no bus called 'tail'. Buses: legs, arms"
        );
        buses.choose(&choice("sim")).expect("for all");
        assert!(buses == BusAddress::Sim);
        // An equals sign of an option is no name.
        let option = choice("dynamixel:/tmp/p,backend=dynamixel2");
        assert_eq!(option.name, None);
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
