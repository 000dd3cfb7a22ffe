//! How a body travels: the mean of its root's motion in its own frame.

use crate::body::RootAdvance;
use crate::motion::take::Take;

/// Mean travel of a take.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Travel {
    /// Mean speed forwards, m/s; negative backwards.
    pub forward_m_s: f64,
    /// Mean speed to the left, m/s.
    pub left_m_s: f64,
    /// Mean turn rate, rad/s, counter-clockwise.
    pub turn_rad_s: f64,
    /// The feet stand while the ground moves under them: the motion was recorded on the spot, and
    /// its feet tell the speed above.
    pub on_the_spot: bool,
}

impl Travel {
    /// Speed over the ground in any direction, m/s.
    pub fn speed_m_s(&self) -> f64 {
        self.forward_m_s.hypot(self.left_m_s)
    }
}

/// The mean of the steps between frames, each in the frame of the one before it.
pub fn of(take: &Take) -> Travel {
    let duration = take.duration_s();
    if !(duration > 0.0) {
        return Travel::default();
    }
    let mut sum = RootAdvance::default();
    for pair in take.roots.windows(2) {
        sum.add(pair[0].advance_to(&pair[1]), 1.0);
    }
    Travel {
        forward_m_s: sum.forward_m / duration,
        left_m_s: sum.left_m / duration,
        turn_rad_s: sum.yaw_rad / duration,
        on_the_spot: false,
    }
}
