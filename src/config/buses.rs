//! The buses of a robot: one, or several with names, and which of them carries each joint.

use super::error::{ConfigError, Pointer};
use super::file::{BusEntries, BusEntry, JointEntry};
use crate::base::suggest::hint;
use crate::bus::BusLine;

/// Checks the buses on their own: names, and that they agree on what there is once.
pub(super) fn bus_lines(buses: &BusEntries, at: &Pointer<'_>) -> Result<Vec<BusLine>, ConfigError> {
    let Some(first) = buses.0.first() else {
        return Err(at.key("bus", "there is none; add [bus] with bus = \"sim\""));
    };
    let several = buses.0.len() > 1;
    let mut lines: Vec<BusLine> = Vec::new();
    for entry in &buses.0 {
        let name = match &entry.name {
            Some(name) => {
                let text = name.get_ref();
                if text.is_empty() || text.contains([':', ',', '/', '=']) {
                    let problem = format!("{text:?}: a name has no ':', ',', '/' or '='");
                    return Err(at.at(name.span(), "bus.name", problem));
                }
                if lines.iter().any(|line| line.name == *text) {
                    let problem = format!("two buses are called {text:?}");
                    return Err(at.at(name.span(), "bus.name", problem));
                }
                text.clone()
            }
            None if several => {
                let problem = format!(
                    "of {} buses each needs a name, such as name = \"legs\", for the joints' bus = \"legs\"",
                    buses.0.len()
                );
                return Err(at.key("bus.name", problem));
            }
            None => "bus".into(),
        };
        same(first.rate_hz, entry.rate_hz, "bus.rate_hz", &name, at)?;
        let watchdogs = [first, entry].map(|entry| f64::from(entry.watchdog_ms));
        same(watchdogs[0], watchdogs[1], "bus.watchdog_ms", &name, at)?;
        if !(9_600..=4_500_000).contains(&entry.baud) {
            let problem = format!("{} of {name:?} is not in 9600..4500000", entry.baud);
            return Err(at.key("bus.baud", problem));
        }
        lines.push(BusLine {
            name,
            address: entry.bus.parse().map_err(|e| at.key("bus.bus", e))?,
            sim_baud: entry.baud,
        });
    }
    Ok(lines)
}

fn same(
    first: f64,
    other: f64,
    key: &str,
    name: &str,
    at: &Pointer<'_>,
) -> Result<(), ConfigError> {
    if first == other {
        return Ok(());
    }
    let problem = format!(
        "all buses go in one control cycle: {other} of {name:?} differs from {first} of the first"
    );
    Err(at.key(key, problem))
}

/// Which of `buses` the joint of `entry` hangs on.
pub(super) fn bus_of(
    entry: &JointEntry,
    buses: &[BusEntry],
    at: &Pointer<'_>,
) -> Result<usize, ConfigError> {
    let names = || {
        buses
            .iter()
            .filter_map(|bus| bus.name.as_ref())
            .map(|name| name.get_ref().as_str())
    };
    let joint = entry.name.get_ref();
    match &entry.bus {
        None if buses.len() == 1 => Ok(0),
        None => {
            let names: Vec<&str> = names().collect();
            let problem = format!(
                "say which bus joint {joint} hangs on: bus = one of {}",
                names.join(", ")
            );
            Err(at.at(entry.name.span(), "robot.joint.bus", problem))
        }
        Some(name) => names()
            .position(|known| known == name.get_ref())
            .ok_or_else(|| {
                let hint = hint(name.get_ref(), names());
                let names: Vec<&str> = names().collect();
                let problem = format!(
                    "there is no bus called {:?}{hint} Buses: {}",
                    name.get_ref(),
                    names.join(", ")
                );
                at.at(name.span(), "robot.joint.bus", problem)
            }),
    }
}
