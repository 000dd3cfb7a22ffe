//! What can go wrong, in words: its name, what was measured in which unit, and what to do.

use crate::bus::dynamixel::model::hardware_error;

/// What went wrong, or was done about it.
#[derive(Copy, Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FaultKind {
    /// No valid answer.
    Silent,
    /// A hardware error is latched; its cause is read from register 70.
    Alert,
    /// The servo came back without torque and is not driven.
    Torqueless,
    /// It is further from its targets than its lag explains.
    FollowingError,
    /// It gives much effort and does not move.
    Stall,
    /// Motion is made smaller because it is warm.
    Warm,
    /// It is too hot to go on.
    Hot,
    /// Motion is made smaller because its effort over seconds is high.
    Strained,
    /// Its effort over seconds is too high to go on.
    Overload,
    /// Motion is made smaller because its supply is near its lower limit.
    WeakSupply,
    /// Its supply is outside its limits.
    Voltage,
    /// The bus is lost.
    BusLost,
    /// So many cycles began late that motion was held or ended.
    Overrun,
    /// The motion gave no numbers.
    NotFinite,
    /// The stop gesture was performed.
    StopGesture,
    /// Poses were lost, and the policy says stop.
    PosesLost,
    /// An operator (or the configuration) took servos back into control.
    Rearmed,
}

impl FaultKind {
    /// All kinds, in the order in which they are told.
    pub const ALL: [FaultKind; 17] = [
        FaultKind::Silent,
        FaultKind::Alert,
        FaultKind::Torqueless,
        FaultKind::FollowingError,
        FaultKind::Stall,
        FaultKind::Warm,
        FaultKind::Hot,
        FaultKind::Strained,
        FaultKind::Overload,
        FaultKind::WeakSupply,
        FaultKind::Voltage,
        FaultKind::BusLost,
        FaultKind::Overrun,
        FaultKind::NotFinite,
        FaultKind::StopGesture,
        FaultKind::PosesLost,
        FaultKind::Rearmed,
    ];

    /// For messages and the summary.
    pub fn as_str(self) -> &'static str {
        match self {
            FaultKind::Silent => "silent",
            FaultKind::Alert => "hardware error",
            FaultKind::Torqueless => "without torque",
            FaultKind::FollowingError => "following error",
            FaultKind::Stall => "stalled",
            FaultKind::Warm => "warm, motion made smaller",
            FaultKind::Hot => "too hot",
            FaultKind::Strained => "strained, motion made smaller",
            FaultKind::Overload => "overloaded",
            FaultKind::WeakSupply => "weak supply, motion made smaller",
            FaultKind::Voltage => "supply out of range",
            FaultKind::BusLost => "bus lost",
            FaultKind::Overrun => "overruns",
            FaultKind::NotFinite => "motion gave no numbers",
            FaultKind::StopGesture => "stop gesture",
            FaultKind::PosesLost => "poses lost",
            FaultKind::Rearmed => "re-armed",
        }
    }

    /// Whether it is a fault of a servo, to which `safety.on_servo_fault` is the answer.
    pub fn takes_out(self) -> bool {
        matches!(
            self,
            FaultKind::Alert
                | FaultKind::Torqueless
                | FaultKind::FollowingError
                | FaultKind::Stall
                | FaultKind::Hot
                | FaultKind::Overload
                | FaultKind::Voltage
        )
    }

    /// What was measured, in words; empty when nothing was.
    pub fn measured(self, value: f64, limit: f64) -> String {
        let beside =
            |unit: &str, digits: usize| format!("{value:.digits$} {unit}, limit {limit:.digits$}");
        match self {
            FaultKind::Alert if value > 0.0 => {
                let bits = value as u32;
                format!("{} (register 70 = {bits:#04x})", error_names(bits))
            }
            FaultKind::FollowingError => beside("rad from its targets", 2),
            FaultKind::Stall => format!(
                "it does not move, with up to {:.0} % of its effort",
                100.0 * value
            ),
            FaultKind::Warm | FaultKind::Hot => beside("degrees C", 0),
            FaultKind::Strained | FaultKind::Overload => beside("effort (RMS)", 2),
            FaultKind::WeakSupply | FaultKind::Voltage => beside("V", 1),
            FaultKind::Overrun => format!("{:.0} % of the cycles late", 100.0 * value),
            _ => String::new(),
        }
    }

    /// What a person can do about it; empty when there is nothing to do.
    pub fn advice(self) -> &'static str {
        match self {
            FaultKind::Silent => "Check its cable and plugs",
            FaultKind::Alert => {
                "Look at it with `handwave bus read BUS ID all`, mend the cause, `handwave bus reboot BUS ID`"
            }
            FaultKind::Torqueless => {
                "It restarted: check its supply and plugs, then re-arm (key r or SIGUSR1) or start again"
            }
            FaultKind::FollowingError => {
                "Look whether the joint is blocked, loose or overloaded, and whether its zero and direction are right"
            }
            FaultKind::Stall => "Clear what blocks the joint, or lighten its load",
            FaultKind::Warm | FaultKind::Hot => {
                "Let it cool; lighten its load or lower robot.velocity_share"
            }
            FaultKind::Strained | FaultKind::Overload => {
                "Lighten its load, or lower robot.velocity_share; safety.effort_limit says what is borne"
            }
            FaultKind::WeakSupply | FaultKind::Voltage => {
                "Charge the battery or check supply and wiring"
            }
            FaultKind::BusLost => "Check power and cable of the chain; `--bus` names the port",
            FaultKind::Overrun => {
                "Lower the rate, close other programs, or see `handwave bus bench` for what the bus can do"
            }
            FaultKind::NotFinite => "A clip, a map or a pose is broken; please report it",
            FaultKind::PosesLost => "Look after the pose source",
            FaultKind::StopGesture | FaultKind::Rearmed => "",
        }
    }
}

/// The names of the bits of register 70.
pub fn error_names(bits: u32) -> String {
    let names: Vec<&str> = hardware_error::NAMES
        .iter()
        .filter(|(bit, _)| bits & u32::from(*bit) != 0)
        .map(|(_, name)| *name)
        .collect();
    if names.is_empty() {
        "an unknown error".into()
    } else {
        names.join(", ")
    }
}
