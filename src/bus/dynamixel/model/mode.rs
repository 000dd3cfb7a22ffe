//! Operating modes (register 11): what a servo takes as its goal.

use super::address;

/// An operating mode.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Goal current; no position loop in the servo.
    Current,
    /// Goal velocity; no position loop in the servo.
    Velocity,
    /// Goal position within the servo's position limits, at most one turn.
    #[default]
    Position,
    /// Goal position over several turns, 256 either way. The servo has no limits then.
    ExtendedPosition,
    /// As [`Mode::ExtendedPosition`], with no more current than the goal current.
    CurrentBasedPosition,
    /// Goal PWM, that is voltage. Not for joints.
    Pwm,
}

/// All modes, by number.
pub const MODES: [Mode; 6] = [
    Mode::Current,
    Mode::Velocity,
    Mode::Position,
    Mode::ExtendedPosition,
    Mode::CurrentBasedPosition,
    Mode::Pwm,
];

impl Mode {
    /// The value of the operating mode register.
    pub const fn number(self) -> u8 {
        match self {
            Mode::Current => 0,
            Mode::Velocity => 1,
            Mode::Position => 3,
            Mode::ExtendedPosition => 4,
            Mode::CurrentBasedPosition => 5,
            Mode::Pwm => 16,
        }
    }

    /// The mode with this number.
    pub fn from_number(number: u8) -> Option<Mode> {
        MODES.into_iter().find(|mode| mode.number() == number)
    }

    /// Name as configurations have it, such as `extended_position`.
    pub const fn name(self) -> &'static str {
        match self {
            Mode::Current => "current",
            Mode::Velocity => "velocity",
            Mode::Position => "position",
            Mode::ExtendedPosition => "extended_position",
            Mode::CurrentBasedPosition => "current_based_position",
            Mode::Pwm => "pwm",
        }
    }

    /// The mode with this name.
    pub fn by_name(name: &str) -> Option<Mode> {
        MODES.into_iter().find(|mode| mode.name() == name)
    }

    /// Whether the servo's own limits (registers 48 and 52) hold its position. In every other mode the host alone does.
    pub const fn has_position_limits(self) -> bool {
        matches!(self, Mode::Position)
    }

    /// Whether the servo itself goes to a position. Otherwise the host closes the position loop.
    pub const fn holds_position(self) -> bool {
        matches!(
            self,
            Mode::Position | Mode::ExtendedPosition | Mode::CurrentBasedPosition
        )
    }

    /// Whether it takes a goal current.
    pub const fn uses_current(self) -> bool {
        matches!(self, Mode::Current | Mode::CurrentBasedPosition)
    }

    /// The register that a goal is written to in every cycle, as on X series servos, and its bytes.
    pub const fn goal(self) -> (u16, u8) {
        match self {
            Mode::Current => (address::GOAL_CURRENT, 2),
            Mode::Velocity => (address::GOAL_VELOCITY, 4),
            Mode::Pwm => (address::GOAL_PWM, 2),
            _ => (address::GOAL_POSITION, 4),
        }
    }
}
