//! Faults one can inject into the simulated line: what there is, and how to ask for it.

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

/// The faults.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "described in the table FAULTS")]
pub enum FaultKind {
    Silent,
    Disconnected,
    Late,
    Overload,
    Overheat,
    Voltage,
    Encoder,
    Shock,
    Reboot,
    CorruptServo,
    Stuck,
    WatchdogDefect,
    CorruptBus,
    Truncated,
    Duplicated,
    Foreign,
    Noise,
    Echo,
    Unplugged,
}

/// The value a fault takes: what it is when none is given, and what it may be.
#[derive(Copy, Clone, Debug)]
pub struct ValueRule {
    /// Taken when the specification gives none.
    pub default: f64,
    /// Smallest value allowed.
    pub min: f64,
    /// Largest value allowed.
    pub max: f64,
}

/// One row of the table of faults.
#[derive(Copy, Clone, Debug)]
pub struct FaultInfo {
    /// The fault.
    pub kind: FaultKind,
    /// Name in a specification.
    pub name: &'static str,
    /// What it happens to.
    pub scope: Scope,
    /// Its value; `None` when it takes none.
    pub value: Option<ValueRule>,
    /// What it does, with the unit and default of its value.
    pub description: &'static str,
}

const fn row(
    kind: FaultKind,
    name: &'static str,
    scope: Scope,
    value: Option<(f64, f64, f64)>,
    description: &'static str,
) -> FaultInfo {
    FaultInfo {
        kind,
        name,
        scope,
        value: match value {
            Some((default, min, max)) => Some(ValueRule { default, min, max }),
            None => None,
        },
        description,
    }
}

/// Every fault there is. A fault lasts from T1 to T2, or to the end without T2.
#[rustfmt::skip]
pub static FAULTS: &[FaultInfo] = &[
    row(FaultKind::Silent, "silent", Scope::Servo, None,
        "hears and obeys, but does not answer"),
    row(FaultKind::Disconnected, "disconnected", Scope::Servo, None,
        "data wire off: neither hears nor answers, power stays on"),
    row(FaultKind::Late, "late", Scope::Servo, Some((5.0, 0.0, 10_000.0)),
        "answers late by VALUE milliseconds (default 5)"),
    row(FaultKind::Overload, "overload", Scope::Servo, None,
        "latches hardware error bit 5: torque off until a reboot"),
    row(FaultKind::Overheat, "overheat", Scope::Servo, Some((85.0, 0.0, 127.0)),
        "reports VALUE degrees Celsius (default 85) and latches hardware error bit 2: torque off until a reboot"),
    row(FaultKind::Voltage, "voltage", Scope::Servo, Some((5.0, 0.0, 30.0)),
        "reports VALUE volts (default 5.0) and latches hardware error bit 0"),
    row(FaultKind::Encoder, "encoder", Scope::Servo, None,
        "latches hardware error bit 3"),
    row(FaultKind::Shock, "shock", Scope::Servo, None,
        "latches hardware error bit 4: torque off until a reboot"),
    row(FaultKind::Reboot, "reboot", Scope::Servo, None,
        "brown-out at T1: restarts once, torque off, RAM lost"),
    row(FaultKind::CorruptServo, "corrupt", Scope::Servo, Some((1.0, 0.0, 1.0)),
        "one bit flipped in each of its replies with probability VALUE (default 1)"),
    row(FaultKind::Stuck, "stuck", Scope::Servo, None,
        "the shaft is blocked"),
    row(FaultKind::WatchdogDefect, "watchdog-defect", Scope::Servo, None,
        "its bus watchdog trips but does not stop the motion"),
    row(FaultKind::CorruptBus, "corrupt", Scope::Bus, Some((0.05, 0.0, 1.0)),
        "one bit flipped in each packet, either way, with probability VALUE (default 0.05)"),
    row(FaultKind::Truncated, "truncated", Scope::Bus, Some((0.05, 0.0, 1.0)),
        "each reply loses its last three bytes with probability VALUE (default 0.05)"),
    row(FaultKind::Duplicated, "duplicated", Scope::Bus, Some((0.05, 0.0, 1.0)),
        "each reply is sent twice with probability VALUE (default 0.05)"),
    row(FaultKind::Foreign, "foreign", Scope::Bus, Some((0.05, 0.0, 1.0)),
        "a status of a servo nobody asked (id 252) before each reply with probability VALUE (default 0.05)"),
    row(FaultKind::Noise, "noise", Scope::Bus, Some((4.0, 1.0, 64.0)),
        "VALUE stale bytes (default 4) before each reply"),
    row(FaultKind::Echo, "echo", Scope::Bus, None,
        "the adapter hears itself: what the host sends comes back"),
    row(FaultKind::Unplugged, "unplugged", Scope::Bus, None,
        "the adapter is gone, with the port; it comes back at T2"),
];

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

/// Chance for faults: xorshift64*, the same sequence for the same seed on every machine.
#[derive(Clone, Debug)]
pub struct Chance(u64);

impl Chance {
    /// The sequence of `seed`.
    pub fn new(seed: u64) -> Self {
        // Spreads neighbouring seeds; the state must not be zero.
        Self((seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x2545_F491_4F6C_DD1D) | 1)
    }

    /// The next 32 bits.
    pub fn bits(&mut self) -> u32 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 32) as u32
    }

    /// True with this probability.
    pub fn happens(&mut self, probability: f64) -> bool {
        f64::from(self.bits()) < probability * 4_294_967_296.0
    }

    /// A number below `bound`; 0 when that is 0.
    pub fn below(&mut self, bound: usize) -> usize {
        ((u64::from(self.bits()) * bound as u64) >> 32) as usize
    }
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
