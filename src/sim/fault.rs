//! Faults one can inject into the simulated line: how to ask for one ([`FAULTS`] says what there is).

pub use super::chance::Chance;
pub use super::fault_table::{FAULTS, FaultInfo, FaultKind, ValueRule};
use crate::base::Time;
use crate::base::suggest::nearest;
use std::fmt;
use std::str::FromStr;

/// What a fault happens to.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Scope {
    /// One servo.
    Servo,
    /// The whole line.
    Bus,
}

impl fmt::Display for Scope {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Scope::Servo => "servo",
            Scope::Bus => "bus",
        })
    }
}

/// What a fault specification names.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// The servo of this id.
    Servo(u8),
    /// The whole line.
    Bus,
}

/// One fault asked for: `TARGET:NAME[=VALUE]@T1s[..T2s]`.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct FaultSpec {
    /// What it happens to.
    pub target: Target,
    /// What happens.
    pub kind: FaultKind,
    /// How much; see the fault's description. 0 for a fault that takes no value.
    pub value: f64,
    /// When it begins, on the simulator's clock.
    pub from: Time,
    /// When it ends; `None` = never.
    pub until: Option<Time>,
}

impl FaultSpec {
    /// Whether it lasts at `now`.
    pub fn is_active(&self, now: Time) -> bool {
        self.from <= now && self.until.is_none_or(|until| now < until)
    }

    /// The same fault on a clock that reads `start` when this one's reads zero.
    pub fn shifted(&self, start: Time) -> Self {
        let shift = start.saturating_since(Time::ZERO);
        Self {
            from: self.from + shift,
            until: self.until.map(|until| until + shift),
            ..*self
        }
    }

    /// Its row in the table of faults.
    pub fn info(&self) -> Option<&'static FaultInfo> {
        FAULTS.iter().find(|info| info.kind == self.kind)
    }

    /// The servo it happens to; `None` for the whole line.
    pub fn servo(&self) -> Option<u8> {
        match self.target {
            Target::Servo(id) => Some(id),
            Target::Bus => None,
        }
    }
}

/// For people, without the target: `late = 5 8.000..9.000 s: answers late by ...`.
impl fmt::Display for FaultSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, value, description) = self.info().map_or(("", None, ""), |info| {
            (info.name, info.value, info.description)
        });
        f.write_str(name)?;
        if value.is_some() {
            write!(f, "={}", self.value)?;
        }
        write!(f, " {:.3}", self.from.secs())?;
        match self.until {
            _ if self.kind.is_event() => f.write_str(" s")?,
            Some(until) => write!(f, "..{:.3} s", until.secs())?,
            None => f.write_str(" s to the end")?,
        }
        write!(f, ": {description}")
    }
}

/// Why a fault specification is refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "fault '{spec}': {problem}. A fault is TARGET:NAME[=VALUE]@T1s[..T2s], as in 3:silent@2s..2.5s or bus:corrupt=0.01@0s"
)]
pub struct FaultError {
    /// The specification.
    pub spec: String,
    /// What is wrong with it.
    pub problem: String,
}

impl FromStr for FaultSpec {
    type Err = FaultError;

    fn from_str(spec: &str) -> Result<Self, FaultError> {
        parse(spec).map_err(|problem| FaultError {
            spec: spec.to_owned(),
            problem,
        })
    }
}

fn parse(spec: &str) -> Result<FaultSpec, String> {
    let (what, when) = spec
        .split_once('@')
        .ok_or("no time; expected @T1s at the end")?;
    let (target, fault) = what
        .split_once(':')
        .ok_or("no target; expected an id or 'bus', then a colon")?;
    let (target, scope) = match (target, target.parse::<u8>()) {
        ("bus", _) => (Target::Bus, Scope::Bus),
        (_, Ok(id @ 0..=252)) => (Target::Servo(id), Scope::Servo),
        _ => {
            return Err(format!(
                "unknown target '{target}'; expected an id 0..252 or 'bus'"
            ));
        }
    };
    let (name, value) = match fault.split_once('=') {
        Some((name, value)) => (name, Some(value)),
        None => (fault, None),
    };
    let info = find(name, scope)?;
    let value = match (info.value, value) {
        (None, None) => 0.0,
        (None, Some(_)) => return Err(format!("'{name}' takes no value")),
        (Some(rule), None) => rule.default,
        (Some(rule), Some(text)) => text
            .parse()
            .ok()
            .filter(|number| (rule.min..=rule.max).contains(number))
            .ok_or_else(|| {
                let ValueRule { min, max, .. } = rule;
                format!("'{name}' takes a number from {min} to {max}, not '{text}'")
            })?,
    };
    let (from, until) = match when.split_once("..") {
        Some((from, until)) => (seconds(from)?, Some(seconds(until)?)),
        None => (seconds(when)?, None),
    };
    if until.is_some_and(|until| until <= from) {
        return Err("it ends before it begins".to_owned());
    }
    Ok(FaultSpec {
        target,
        kind: info.kind,
        value,
        from,
        until,
    })
}

fn find(name: &str, scope: Scope) -> Result<&'static FaultInfo, String> {
    let of_scope = || FAULTS.iter().filter(|info| info.scope == scope);
    if let Some(info) = of_scope().find(|info| info.name == name) {
        return Ok(info);
    }
    if let Some(other) = FAULTS.iter().find(|info| info.name == name) {
        return Err(format!(
            "'{name}' happens to a {}, not a {scope}",
            other.scope
        ));
    }
    Err(match nearest(name, of_scope().map(|info| info.name)) {
        Some(near) => format!("unknown {scope} fault '{name}'; did you mean '{near}'?"),
        None => {
            let known: Vec<_> = of_scope().map(|info| info.name).collect();
            format!(
                "unknown {scope} fault '{name}'; there are {}",
                known.join(", ")
            )
        }
    })
}

fn seconds(text: &str) -> Result<Time, String> {
    text.strip_suffix('s')
        .and_then(|number| number.parse::<f64>().ok())
        .filter(|number| (0.0..1e9).contains(number))
        .map(Time::from_secs)
        .ok_or_else(|| format!("'{text}' is no time; expected seconds such as 2.5s"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refused_specification_teaches() {
        for (spec, expected) in [
            ("3:silent", "no time"),
            ("silent@1s", "no target"),
            ("300:silent@1s", "unknown target '300'"),
            ("bas:corrupt@1s", "unknown target 'bas'"),
            ("3:silnt@1s", "did you mean 'silent'?"),
            ("3:zzz@1s", "there are silent, "),
            ("bus:stuck@1s", "'stuck' happens to a servo, not a bus"),
            ("3:stuck=2@1s", "'stuck' takes no value"),
            ("bus:corrupt=2@1s", "from 0 to 1, not '2'"),
            ("bus:corrupt=NaN@1s", "from 0 to 1, not 'NaN'"),
            ("3:silent@1", "'1' is no time"),
            ("3:silent@-1s", "'-1s' is no time"),
            ("3:silent@2s..1s", "ends before it begins"),
        ] {
            let message = spec
                .parse::<FaultSpec>()
                .expect_err("a bad specification")
                .to_string();
            assert!(message.contains(expected), "{spec}: {message}");
        }
    }

    #[test]
    fn every_fault_parses_with_its_default_value() {
        for info in FAULTS {
            let target = match info.scope {
                Scope::Servo => "3",
                Scope::Bus => "bus",
            };
            let spec: FaultSpec = format!("{target}:{}@1.5s..2s", info.name)
                .parse()
                .expect("a listed fault");
            assert_eq!(spec.kind, info.kind);
            assert_eq!(spec.value, info.value.map_or(0.0, |rule| rule.default));
            assert!(!spec.is_active(Time::from_secs(1.49)));
            assert!(spec.is_active(Time::from_secs(1.5)));
            assert!(!spec.is_active(Time::from_secs(2.0)));
        }
    }
}
