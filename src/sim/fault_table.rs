//! The table of faults: name, scope, value and what each does.

use super::fault::Scope;

/// The faults.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "described in the table FAULTS")]
pub enum FaultKind {
    Silent,
    Disconnected,
    Late,
    CorruptServo,
    TruncatedServo,
    DuplicatedServo,
    WrongId,
    DuplicateId,
    Deaf,
    Refuses,
    Overload,
    Overheat,
    Voltage,
    Encoder,
    Shock,
    Reboot,
    TorqueLoss,
    Sag,
    Stuck,
    HeavyLoad,
    Slow,
    EncoderJump,
    EncoderNoise,
    FrozenPosition,
    WatchdogTrip,
    WatchdogDefect,
    WatchdogRunaway,
    CorruptBus,
    Truncated,
    Duplicated,
    Foreign,
    Noise,
    LostBytes,
    Echo,
    Latency,
    WaitInVain,
    BrownOut,
    Unplugged,
}

impl FaultKind {
    /// Whether it strikes once, when it begins; when it ends does not matter then.
    pub fn is_event(self) -> bool {
        matches!(
            self,
            FaultKind::Reboot
                | FaultKind::BrownOut
                | FaultKind::TorqueLoss
                | FaultKind::WatchdogTrip
        )
    }
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
        "answers late by VALUE milliseconds (default 5), also into the next request"),
    row(FaultKind::CorruptServo, "corrupt", Scope::Servo, Some((1.0, 0.0, 1.0)),
        "one bit flipped in each of its replies with probability VALUE (default 1)"),
    row(FaultKind::TruncatedServo, "truncated", Scope::Servo, Some((1.0, 0.0, 1.0)),
        "each of its replies loses its last three bytes with probability VALUE (default 1)"),
    row(FaultKind::DuplicatedServo, "duplicated", Scope::Servo, Some((1.0, 0.0, 1.0)),
        "each of its replies is sent twice with probability VALUE (default 1)"),
    row(FaultKind::WrongId, "wrong-id", Scope::Servo, Some((252.0, 0.0, 252.0)),
        "answers under the id VALUE (default 252)"),
    row(FaultKind::DuplicateId, "duplicate-id", Scope::Servo, None,
        "a second servo of its id is on the line: two answer at once and garble each other"),
    row(FaultKind::Deaf, "deaf", Scope::Servo, None,
        "answers everything, but takes no write"),
    row(FaultKind::Refuses, "refuses", Scope::Servo, Some((1.0, 1.0, 127.0)),
        "answers every read and write with error VALUE (default 1, result fail)"),
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
    row(FaultKind::TorqueLoss, "torque-loss", Scope::Servo, None,
        "at T1 its torque goes off once, without a restart or an error"),
    row(FaultKind::Sag, "sag", Scope::Servo, Some((5.5, 0.0, 30.0)),
        "its supply is lower by VALUE volts (default 5.5): weaker, and an error below its limit"),
    row(FaultKind::Stuck, "stuck", Scope::Servo, None,
        "the shaft is blocked; overload trips when it strains against it for seconds"),
    row(FaultKind::HeavyLoad, "heavy-load", Scope::Servo, Some((0.6, -2.0, 2.0)),
        "the shaft is pushed with VALUE times its stall torque (default 0.6)"),
    row(FaultKind::Slow, "slow", Scope::Servo, Some((0.1, 0.0, 1.0)),
        "worn or gummed up: at most VALUE of its full drive (default 0.1), so it drags behind"),
    row(FaultKind::EncoderJump, "encoder-jump", Scope::Servo, Some((512.0, -4096.0, 4096.0)),
        "its position reads VALUE pulses too high (default 512), and it drives there"),
    row(FaultKind::EncoderNoise, "noise", Scope::Servo, Some((40.0, 0.0, 4096.0)),
        "its position reads up to VALUE pulses (default 40) off, at random"),
    row(FaultKind::FrozenPosition, "frozen-position", Scope::Servo, None,
        "its present position, velocity and load stay at old values"),
    row(FaultKind::WatchdogTrip, "watchdog-trip", Scope::Servo, None,
        "at T1 its bus watchdog trips without cause: it holds, and takes no goals until it is cleared"),
    row(FaultKind::WatchdogDefect, "watchdog-defect", Scope::Servo, None,
        "its bus watchdog trips but does not stop the motion"),
    row(FaultKind::WatchdogRunaway, "watchdog-runaway", Scope::Servo, Some((1000.0, -4096.0, 4096.0)),
        "a trip of its bus watchdog sends it off by its homing offset, or by VALUE pulses (default 1000) without one"),
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
    row(FaultKind::LostBytes, "lost-bytes", Scope::Bus, Some((0.002, 0.0, 1.0)),
        "each byte on its way to the host is lost with probability VALUE (default 0.002)"),
    row(FaultKind::Echo, "echo", Scope::Bus, None,
        "the adapter hears itself: what the host sends comes back"),
    row(FaultKind::Latency, "latency", Scope::Bus, Some((16.0, 0.0, 1000.0)),
        "the adapter hands bytes over VALUE milliseconds later (default 16, an untouched latency timer)"),
    row(FaultKind::WaitInVain, "wait-in-vain", Scope::Bus, None,
        "servos behind a silent one in a sync or bulk read wait for it for ever, instead of passing over it"),
    row(FaultKind::BrownOut, "brown-out", Scope::Bus, None,
        "the supply fails for a moment at T1: every servo restarts once, torque off, RAM lost"),
    row(FaultKind::Unplugged, "unplugged", Scope::Bus, Some((0.0, 0.0, 99.0)),
        "the adapter is gone, with the port; it comes back at T2, under the name PATH.VALUE if VALUE is given"),
];
