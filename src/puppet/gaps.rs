//! When poses stop and come back: the puppet's own time, and waves that go on without a jump.

use crate::base::angle::{wrap_pi, wrap_tau};
use crate::gesture::GestureEstimate;
use crate::motion::Follower;
use std::f64::consts::TAU;

/// How fast the puppet's own time runs: 1 while poses come, 0 while a pose is held.
///
/// To hold is to let time stand still: phases, blends, layers and transitions all stop where they
/// are and go on from there, and no joint's speed jumps.
#[derive(Copy, Clone, Debug)]
pub(super) struct Tempo {
    value: f64,
    /// Time by which the gestures' phases have been held back while poses are missing, seconds.
    pub held_s: f64,
}

/// Highest change of tempo per second, down and up: what it adds to a joint's acceleration is this
/// times its speed.
const TEMPO_CHANGE: [f64; 2] = [4.0, 2.0];

impl Default for Tempo {
    fn default() -> Self {
        Self {
            value: 1.0,
            held_s: 0.0,
        }
    }
}

impl Tempo {
    /// Moves towards `goal` and returns the puppet's time that passes in `dt_s`.
    pub fn step(&mut self, goal: f64, dt_s: f64) -> f64 {
        let [down, up] = TEMPO_CHANGE.map(|change| change * dt_s);
        self.value += (goal - self.value).clamp(-down, up);
        dt_s * self.value
    }
}

/// A gesture's wave as a class is given it: what jumps after a gap in the poses is drawn over.
#[derive(Copy, Clone, Debug, Default)]
pub(super) struct Join {
    /// Phase of the gesture in the last cycle, rad.
    phase_rad: f64,
    /// What the class is given beyond the gesture's phase, rad; on its way to zero.
    offset: Follower,
    /// Frequency that the class was given last, Hz.
    frequency_hz: f64,
    /// There was a gap: frequency is followed at leisure.
    joining: bool,
    /// For how long at least, seconds.
    leisure_s: f64,
    /// Time by which the puppet's own fell behind in this step while poses came, seconds.
    behind_s: f64,
}

/// Poses that have been missing for this long have left a gap, seconds: estimators may jump after it.
pub(super) const GAP_S: f64 = 0.08;
/// A phase that is further than this from where it was going has jumped, rad.
const PHASE_JUMP: f64 = 0.4;
/// How quickly a jump of phase is made good, 1/s, and at most at this part of the tempo: less than the
/// class is able to, so that joints have something left for all else that changed meanwhile.
const PHASE_JOIN: (f64, f64) = (2.0, 0.25);
/// How quickly frequency may change after a gap, Hz/s, and for how long at least, seconds: the first
/// samples after it look like one hasty movement.
const FREQUENCY_JOIN: (f64, f64) = (1.5, 0.6);

impl Join {
    /// The wave comes from other gestures now: what jumps is drawn over as after a gap.
    pub fn expect_a_jump(&mut self) {
        self.joining = true;
        self.leisure_s = FREQUENCY_JOIN.1;
    }

    /// The puppet's own time fell behind by `seconds` in this step while the gesture went on.
    pub fn fall_behind(&mut self, seconds: f64) {
        self.behind_s = seconds;
    }

    /// Frequency and phase for a class that does or does not move now.
    pub fn step(
        &mut self,
        wave: &GestureEstimate,
        gap: bool,
        moving: bool,
        dt_s: f64,
    ) -> (f64, f64) {
        let behind_s = std::mem::take(&mut self.behind_s);
        let passed_s = dt_s + behind_s;
        let jump = wrap_pi(wave.phase_rad - self.phase_rad - TAU * wave.frequency_hz * passed_s);
        self.phase_rad = wave.phase_rad;
        if behind_s > 0.0 {
            self.offset.value = wrap_pi(self.offset.value - TAU * wave.frequency_hz * behind_s);
        }
        if !moving {
            *self = Self {
                phase_rad: wave.phase_rad,
                frequency_hz: wave.frequency_hz,
                ..Self::default()
            };
            return (wave.frequency_hz, wave.phase_rad);
        }
        if jump.abs() > PHASE_JUMP {
            self.offset.value = wrap_pi(self.offset.value - jump);
        }
        let (steepest, at_least_s) = FREQUENCY_JOIN;
        self.joining |= gap;
        self.leisure_s = if gap {
            at_least_s
        } else {
            self.leisure_s - dt_s
        };
        if !self.joining {
            self.frequency_hz = wave.frequency_hz;
        } else if wave.amplitude > 0.0 {
            // Silence has no frequency worth following.
            let (left, most) = (wave.frequency_hz - self.frequency_hz, steepest * dt_s);
            self.frequency_hz += left.clamp(-most, most);
            self.joining = left.abs() > most || self.leisure_s > 0.0;
        }
        let (quickness, share) = PHASE_JOIN;
        let fastest = share * TAU * self.frequency_hz.abs();
        let offset = self.offset.step(0.0, quickness, fastest, dt_s);
        (self.frequency_hz, wrap_tau(wave.phase_rad + offset))
    }
}
