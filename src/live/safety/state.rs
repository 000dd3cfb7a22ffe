//! The states of a servo, and of the robot as a whole.

/// How a servo stands, as supervision sees it; see the table in [the module above](super).
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ServoState {
    /// It does not answer, or the bus is lost.
    #[default]
    Offline,
    /// It answers, and torque is off.
    Present,
    /// Torque is on, its goal where it stood; nothing was asked of it yet.
    Armed,
    /// It follows targets, ramps included.
    Moving,
    /// Torque is on, and it is kept where it is.
    Holding,
    /// It latched an error or supervision took it out; only a re-arm leads on.
    Faulted,
}

/// What is seen of a servo in a cycle, as far as its state goes.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub struct Signs {
    /// It answered, or was not asked.
    pub answers: bool,
    /// Its torque is on.
    pub torque: bool,
    /// Its target stands still, or it is left out of the motion.
    pub still: bool,
    /// It latched an error, or supervision tripped.
    pub fault: bool,
    /// A re-arm was granted.
    pub rearmed: bool,
}

impl ServoState {
    /// All states, from the healthiest to the gravest.
    pub const ALL: [ServoState; 6] = [
        ServoState::Armed,
        ServoState::Holding,
        ServoState::Moving,
        ServoState::Present,
        ServoState::Offline,
        ServoState::Faulted,
    ];

    /// For messages.
    pub fn as_str(self) -> &'static str {
        match self {
            ServoState::Offline => "offline",
            ServoState::Present => "present",
            ServoState::Armed => "armed",
            ServoState::Moving => "moving",
            ServoState::Holding => "holding",
            ServoState::Faulted => "faulted",
        }
    }

    /// The state after a cycle with these signs.
    pub fn next(self, signs: Signs) -> Self {
        if signs.fault || (self == ServoState::Faulted && !signs.rearmed) {
            return ServoState::Faulted;
        }
        if !signs.answers {
            return ServoState::Offline;
        }
        if !signs.torque {
            return ServoState::Present;
        }
        match self {
            ServoState::Offline | ServoState::Present | ServoState::Faulted => ServoState::Armed,
            ServoState::Armed | ServoState::Moving | ServoState::Holding => {
                if signs.still {
                    ServoState::Holding
                } else {
                    ServoState::Moving
                }
            }
        }
    }

    /// How grave it is for the robot as a whole: its place in [`ServoState::ALL`].
    fn gravity(self) -> usize {
        Self::ALL.iter().position(|s| *s == self).unwrap_or(0)
    }

    /// The state of the robot: that of the servo that is worst off; of healthy ones `moving` leads, then `holding`.
    pub fn of_all(servos: impl Iterator<Item = Self>) -> Self {
        servos.max_by_key(|s| s.gravity()).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::ServoState::{Armed, Faulted, Holding, Moving, Offline, Present};
    use super::*;

    /// The table of the module's documentation, line by line: state, what is seen, state after it.
    #[test]
    fn every_transition_of_the_table_is_as_written_there() {
        let well = Signs {
            answers: true,
            torque: true,
            ..Signs::default()
        };
        let still = Signs {
            still: true,
            ..well
        };
        let limp = Signs {
            torque: false,
            ..well
        };
        let mute = Signs {
            answers: false,
            ..well
        };
        let fault = Signs {
            fault: true,
            ..well
        };
        let granted = Signs {
            rearmed: true,
            ..well
        };
        let rebooting = Signs {
            answers: false,
            ..granted
        };
        let rebooted = Signs {
            torque: false,
            ..granted
        };
        let relapse = Signs {
            fault: true,
            ..granted
        };
        let table = [
            (Offline, mute, Offline),
            (Offline, limp, Present),
            (Offline, well, Armed),
            (Offline, still, Armed),
            (Offline, fault, Faulted),
            (Present, mute, Offline),
            (Present, limp, Present),
            (Present, well, Armed),
            (Present, still, Armed),
            (Present, fault, Faulted),
            (Armed, mute, Offline),
            (Armed, limp, Present),
            (Armed, well, Moving),
            (Armed, still, Holding),
            (Armed, fault, Faulted),
            (Moving, mute, Offline),
            (Moving, limp, Present),
            (Moving, well, Moving),
            (Moving, still, Holding),
            (Moving, fault, Faulted),
            (Holding, mute, Offline),
            (Holding, limp, Present),
            (Holding, well, Moving),
            (Holding, still, Holding),
            (Holding, fault, Faulted),
            (Faulted, mute, Faulted),
            (Faulted, limp, Faulted),
            (Faulted, well, Faulted),
            (Faulted, still, Faulted),
            (Faulted, granted, Armed),
            (Faulted, rebooting, Offline),
            (Faulted, rebooted, Present),
            (Faulted, relapse, Faulted),
        ];
        for (from, signs, to) in table {
            assert_eq!(from.next(signs), to, "{from:?} with {signs:?}");
        }
    }

    #[test]
    fn a_fault_never_ends_by_itself_and_no_state_moves_without_torque() {
        for bits in 0..32_u8 {
            let bit = |n: u8| bits >> n & 1 == 1;
            let signs = Signs {
                answers: bit(0),
                torque: bit(1),
                still: bit(2),
                fault: bit(3),
                rearmed: bit(4),
            };
            for from in ServoState::ALL {
                let to = from.next(signs);
                if from == Faulted && !signs.rearmed {
                    assert_eq!(to, Faulted, "{signs:?}");
                }
                if matches!(to, Armed | Moving | Holding) {
                    assert!(signs.answers && signs.torque && !signs.fault, "{signs:?}");
                }
                if to == Moving {
                    let torque_before = matches!(from, Armed | Moving | Holding);
                    assert!(torque_before, "{from:?} with {signs:?} moves at once");
                }
            }
        }
    }

    #[test]
    fn the_robot_is_as_its_worst_servo_and_leads_by_motion() {
        let of = |states: &[ServoState]| ServoState::of_all(states.iter().copied());
        assert_eq!(of(&[]), Offline);
        assert_eq!(of(&[Armed, Armed]), Armed);
        assert_eq!(of(&[Armed, Holding]), Holding);
        assert_eq!(of(&[Holding, Moving, Armed]), Moving);
        assert_eq!(of(&[Moving, Present]), Present);
        assert_eq!(of(&[Moving, Present, Offline]), Offline);
        assert_eq!(of(&[Offline, Faulted, Moving]), Faulted);
    }
}
