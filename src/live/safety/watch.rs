//! What is watched of one servo: following error, stall, temperature, supply, effort.

use super::kind::FaultKind;
use crate::base::{JointState, Time};
use crate::bus::{ServoFacts, ServoHealth};
use crate::config::safety::Supervision;

/// Slower than this stands, for a servo that pushes, rad/s.
const STANDING_RAD_S: f64 = 0.1;
/// A servo that pushes and is nearer to its target than this has arrived: it carries a load, rad.
const ARRIVED_RAD: f64 = 0.08;
/// A servo that has not moved by more than this has not moved, rad,
const MOVED_RAD: f64 = 0.02;
/// though its target went to and fro by this.
const SWEPT_RAD: f64 = 0.15;
/// With this part of the effort of a stall it is blocked, with less it has lost its grip.
const BLOCKED: f64 = 0.5;
/// A target that has not moved for this long stands still, seconds.
const STILL_S: f64 = 0.1;
/// Times between two looks beyond this count as this much, seconds.
const LONGEST_STEP_S: f64 = 0.05;
/// This part of a derating span has to be won back before motion grows again.
const BACKLASH: f64 = 0.25;
/// Of the effort limit, where derating begins.
const STRAIN_BEGINS: f64 = 0.85;
/// At this distance below the temperature at which a servo switches itself off the run ends, degrees.
const HOT_BEFORE_LIMIT_C: f64 = 2.0;
/// A supply may be out of range, or a reading wrong, for this long, seconds.
const SUPPLY_PATIENCE_S: f64 = 0.5;

/// A quantity that is followed at once upwards, and downwards only by what exceeds the play: hysteresis
/// without a jump.
#[derive(Copy, Clone, Debug)]
struct Backlash {
    value: f64,
    play: f64,
}

impl Backlash {
    fn new(play: f64) -> Self {
        Self {
            value: f64::NEG_INFINITY,
            play,
        }
    }

    fn follow(&mut self, measured: f64) -> f64 {
        if measured.is_finite() {
            self.value = self.value.clamp(measured, measured + self.play);
        }
        self.value
    }
}

/// A servo that does not move while its target does.
#[derive(Copy, Clone, Debug, Default)]
struct Stuck {
    /// Where it has been since it moved last, and where its target has been meanwhile: lowest, highest.
    at: Option<(f64, f64, f64)>,
    /// For how long the target's way has been enough to move it, seconds.
    for_s: f64,
    /// The most effort that it has given meanwhile, as a share.
    effort: f64,
}

impl Stuck {
    fn step(&mut self, target: f64, position: f64, effort: f64, dt_s: f64) {
        match &mut self.at {
            Some((at, low, high)) if (position - *at).abs() <= MOVED_RAD => {
                *low = low.min(target);
                *high = high.max(target);
                self.effort = self.effort.max(effort);
                if *high - *low > SWEPT_RAD {
                    self.for_s += dt_s;
                }
            }
            _ => {
                *self = Self {
                    at: Some((position, target, target)),
                    ..Self::default()
                };
            }
        }
    }

    /// How far its target has gone to and fro without it, rad.
    fn missed_rad(&self) -> f64 {
        self.at.map_or(0.0, |(_, low, high)| high - low)
    }
}

/// Motion that is left while a quantity rises from `begins` to `ends`: 1 below, `least` above.
fn share_left(value: f64, begins: f64, ends: f64, least: f64) -> f64 {
    let u = ((value - begins) / (ends - begins).max(1e-9)).clamp(0.0, 1.0);
    1.0 - (1.0 - least) * u
}

/// One thing that was looked at.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Finding {
    /// What.
    pub kind: FaultKind,
    /// Whether it is so.
    pub active: bool,
    /// What was measured.
    pub value: f64,
    /// Its limit.
    pub limit: f64,
}

/// What one look at a servo gives.
#[derive(Copy, Clone, Debug)]
pub struct Look {
    /// Everything that was judged.
    pub findings: [Finding; 8],
    /// How much of its motion it can bear, 0..1.
    pub share: f64,
}

/// What is known of a servo over time.
#[derive(Clone, Debug)]
pub struct Watch {
    temperature_limit_c: Option<f64>,
    voltage_range_v: Option<(f64, f64)>,
    /// All that it can give, and what it can give for long.
    full_effort: f64,
    lagged_rad: f64,
    last_target_rad: f64,
    still_s: f64,
    over_s: f64,
    stalled_s: f64,
    stuck: Stuck,
    mean_square: f64,
    temperature: Backlash,
    strain: Backlash,
    /// Volts below the point where derating begins.
    sag: Backlash,
    supply_s: f64,
    seen_at: Option<Time>,
    health_at: Option<Time>,
}

impl Watch {
    /// A servo of which nothing is known yet.
    pub fn new(settings: &Supervision) -> Self {
        Self {
            temperature_limit_c: settings.temperature_limit_c,
            voltage_range_v: settings.voltage_range_v,
            full_effort: 1.0,
            lagged_rad: f64::NAN,
            last_target_rad: f64::NAN,
            still_s: 0.0,
            over_s: 0.0,
            stalled_s: 0.0,
            stuck: Stuck::default(),
            mean_square: 0.0,
            temperature: Backlash::new(BACKLASH * settings.temperature_margin_c),
            strain: Backlash::new(BACKLASH * (1.0 - STRAIN_BEGINS)),
            sag: Backlash::new(BACKLASH * settings.voltage_margin_v),
            supply_s: 0.0,
            seen_at: None,
            health_at: None,
        }
    }

    /// What the servo itself says that it bears; what the configuration says comes first.
    pub fn learn(&mut self, facts: &ServoFacts, settings: &Supervision) {
        self.temperature_limit_c = settings.temperature_limit_c.or(facts.temperature_limit_c);
        self.voltage_range_v = settings.voltage_range_v.or(facts.voltage_range_v);
        self.full_effort = facts.effort_limit.filter(|e| *e > 0.0).unwrap_or(1.0);
    }

    /// Its target has stood still for a while.
    pub fn is_still(&self) -> bool {
        self.still_s >= STILL_S
    }

    /// Begins anew: it was away, or is on its way back to its targets.
    pub fn forget(&mut self) {
        self.lagged_rad = f64::NAN;
        self.over_s = 0.0;
        self.stalled_s = 0.0;
        self.stuck = Stuck::default();
        self.seen_at = None;
    }

    /// One look at the servo in a cycle of `dt_s`: `target` was sent, `state` read, `health` is the newest.
    ///
    /// `follows`: it is driven and meant to follow its target.
    pub fn look(
        &mut self,
        settings: &Supervision,
        target: f64,
        state: &JointState,
        health: &ServoHealth,
        follows: bool,
        dt_s: f64,
    ) -> Look {
        let dt_s = dt_s.clamp(0.0, LONGEST_STEP_S);
        self.still_s = if target == self.last_target_rad {
            self.still_s + dt_s
        } else {
            0.0
        };
        self.last_target_rad = target;
        let (following, stall) = self.motion(settings, target, state, follows, dt_s);
        let (warm, hot, warm_share) = self.warmth(settings, health);
        let (strained, overload, strain_share) = self.effort(settings);
        let (weak, voltage, supply_share) = self.supply(settings, health, dt_s);
        Look {
            findings: [
                following, stall, warm, hot, strained, overload, weak, voltage,
            ],
            share: warm_share.min(strain_share).min(supply_share),
        }
    }

    /// Following error and stall, of a state that is new.
    ///
    /// The servo may be anywhere between its target and the target as it was some time ago: a first-order lag of
    /// `servo_lag_s` stands for the slowest servo that is well. Beyond that band begins the following error.
    fn motion(
        &mut self,
        settings: &Supervision,
        target: f64,
        state: &JointState,
        follows: bool,
        dt_s: f64,
    ) -> (Finding, Finding) {
        let fresh = state.measured_at.is_some() && state.measured_at != self.seen_at;
        if !follows {
            self.forget();
        }
        if self.lagged_rad.is_finite() {
            let pull = dt_s / (settings.servo_lag_s + dt_s);
            self.lagged_rad += pull * (target - self.lagged_rad);
        } else {
            self.lagged_rad = target;
        }
        let (low, high) = (target.min(self.lagged_rad), target.max(self.lagged_rad));
        let error = (low - state.position).max(state.position - high).max(0.0);
        let effort = state.effort.abs() / self.full_effort;
        if fresh && follows {
            self.seen_at = state.measured_at;
            let is_off = error > settings.following_error_rad;
            self.over_s = (self.over_s + if is_off { dt_s } else { -dt_s }).max(0.0);
            // A target that goes to and fro pulls at a blocked joint now and then only: what counts is that it
            // has not moved since.
            let stands = state.velocity.abs() < STANDING_RAD_S;
            let pushes =
                effort >= settings.stall_effort && (target - state.position).abs() > ARRIVED_RAD;
            self.stalled_s = match (stands, pushes) {
                (false, _) => 0.0,
                (true, true) => self.stalled_s + dt_s,
                (true, false) => self.stalled_s,
            };
            self.stuck.step(target, state.position, effort, dt_s);
            let share = (dt_s / settings.effort_window_s.max(dt_s)).min(1.0);
            if effort.is_finite() {
                self.mean_square += share * (effort * effort - self.mean_square);
            }
        }
        let watched = settings.stall_s > 0.0;
        let stuck = watched && self.stuck.for_s >= settings.stall_s;
        let blocked = self.stuck.effort >= BLOCKED * settings.stall_effort;
        let stalled = watched && self.stalled_s >= settings.stall_s || stuck && blocked;
        // What pushes and stands is called by its name, though it is away from its target too.
        let pushing = watched && (self.stalled_s > 0.0 || self.stuck.for_s > 0.0 && blocked);
        let off = settings.following_error_rad > 0.0 && self.over_s >= settings.following_error_s;
        let lost_grip = stuck && !off;
        let off = (off || stuck) && !pushing;
        // One that has not moved is told by how far its target went without it.
        let (value, limit) = if lost_grip {
            (self.stuck.missed_rad(), SWEPT_RAD)
        } else {
            (error, settings.following_error_rad)
        };
        (
            Finding {
                kind: FaultKind::FollowingError,
                active: off,
                value,
                limit,
            },
            Finding {
                kind: FaultKind::Stall,
                active: stalled,
                value: effort.max(self.stuck.effort),
                limit: settings.stall_effort,
            },
        )
    }

    fn warmth(&mut self, settings: &Supervision, health: &ServoHealth) -> (Finding, Finding, f64) {
        let (Some(limit), Some(measured)) = (self.temperature_limit_c, health.temperature_c) else {
            return (none(FaultKind::Warm), none(FaultKind::Hot), 1.0);
        };
        let begins = limit - settings.temperature_margin_c;
        let ends = (limit - HOT_BEFORE_LIMIT_C).max(begins + 0.5);
        let value = self.temperature.follow(measured);
        let finding = |kind, active, limit| Finding {
            kind,
            active,
            value: measured,
            limit,
        };
        (
            finding(FaultKind::Warm, value > begins, begins),
            finding(FaultKind::Hot, value >= ends, ends),
            share_left(value, begins, ends, settings.derate_least),
        )
    }

    fn effort(&mut self, settings: &Supervision) -> (Finding, Finding, f64) {
        let limit = settings.effort_limit;
        if limit <= 0.0 {
            return (none(FaultKind::Strained), none(FaultKind::Overload), 1.0);
        }
        let rms = self.mean_square.sqrt();
        let value = self.strain.follow(rms / limit);
        let finding = |kind, active, limit| Finding {
            kind,
            active,
            value: rms,
            limit,
        };
        (
            finding(
                FaultKind::Strained,
                value > STRAIN_BEGINS,
                STRAIN_BEGINS * limit,
            ),
            finding(FaultKind::Overload, value >= 1.0, limit),
            share_left(value, STRAIN_BEGINS, 1.0, settings.derate_least),
        )
    }

    fn supply(
        &mut self,
        settings: &Supervision,
        health: &ServoHealth,
        dt_s: f64,
    ) -> (Finding, Finding, f64) {
        let (Some((low, high)), Some(measured)) = (self.voltage_range_v, health.voltage_v) else {
            return (none(FaultKind::WeakSupply), none(FaultKind::Voltage), 1.0);
        };
        let begins = low + settings.voltage_margin_v;
        let sag = self.sag.follow(begins - measured);
        let outside = measured < low || measured > high;
        // One reading is none: a supply that is out of range is read so again.
        let again = health.measured_at != self.health_at && self.health_at.is_some();
        self.health_at = health.measured_at;
        self.supply_s = match (outside, again || self.supply_s > 0.0) {
            (false, _) => 0.0,
            (true, true) => self.supply_s + dt_s,
            (true, false) => 0.0,
        };
        let limit = if measured > high { high } else { low };
        let finding = |kind, active, limit| Finding {
            kind,
            active,
            value: measured,
            limit,
        };
        (
            finding(FaultKind::WeakSupply, sag > 0.0, begins),
            finding(
                FaultKind::Voltage,
                self.supply_s >= SUPPLY_PATIENCE_S,
                limit,
            ),
            share_left(sag, 0.0, settings.voltage_margin_v, settings.derate_least),
        )
    }
}

fn none(kind: FaultKind) -> Finding {
    Finding {
        kind,
        active: false,
        value: 0.0,
        limit: 0.0,
    }
}
