//! A cyclic class in one step: phase locked to the gesture, stride inside the joints' ranges, limbs on
//! their own timelines.

use super::{AT_REST, Drive, MotionClass, Played, RANGE_SHARE, awake};
use crate::base::angle::{wrap_pi, wrap_tau};
use crate::body::{PoseSpace, RootAdvance};
use crate::motion::smooth::Follower;
use std::f64::consts::TAU;

/// How fast the phase closes in on the gesture's, 1/s.
const LOCK_RATE: f64 = 4.0;
/// The stride is shortened to this part before phase lock is given up.
const LEAST_STRIDE: f64 = 0.4;
/// The phase may gain or lose this part of the tempo to meet the gesture's: out of phase by half a
/// turn at the onset, it locks within two periods.
const CATCH_UP: f64 = 0.4;
/// How closely the way to an exit is followed, 1/s, and how fast amplitude and frequency may change on it, 1/s.
const ROUTE_RATE: f64 = 30.0;
const ROUTE_SPEED: f64 = 8.0;
/// Share of the joints' speed and acceleration that catching up may use.
const CATCH_UP_SHARE: f64 = 0.8;

impl MotionClass {
    pub(super) fn step_cycle(
        &mut self,
        space: &dyn PoseSpace,
        mut drive: Drive,
        dt_s: f64,
        out: &mut [f64],
    ) -> Played {
        let (lowest_hz, highest_hz) = self.weights_map.frequencies();
        self.follow_extra(&drive, dt_s);
        // A gesture in the opposite sense is another gesture, not this one played backwards.
        let performed = drive.frequency_hz > 0.0 && drive.amplitude.is_finite();
        let wanted = if performed {
            awake(drive.amplitude)
        } else {
            0.0
        };
        let on_route = self.route.step(dt_s);
        let wanted = on_route.map_or(wanted, |(amplitude, _)| amplitude);
        let state = &mut self.state;
        let mut coming_hz: f64 = 0.0;
        if let Some((amplitude, frequency_hz)) = on_route {
            // The way to an exit was chosen pose by pose: it is gone closely, by the clock, but without the
            // kinks that it has between its points.
            (state.amplitude).step(amplitude, ROUTE_RATE, ROUTE_SPEED, dt_s);
            (state.frequency).step(frequency_hz, ROUTE_RATE, ROUTE_SPEED, dt_s);
            drive.phase_rad = state.phase + TAU * state.frequency.value * dt_s;
        } else {
            (state.amplitude).step(wanted.min(1.0), 9.0, 1.7, dt_s);
        }
        let amplitude = state.amplitude.value.max(0.0);
        if on_route.is_none() && performed && drive.frequency_hz.is_finite() && wanted > 0.0 {
            let goal = drive.frequency_hz.clamp(0.2 * lowest_hz, 3.0 * highest_hz);
            if amplitude < AT_REST {
                // Nothing moves yet: begin at the tempo that is shown.
                state.frequency = Follower::at(goal);
            }
            state.frequency.step(goal, 10.0, 4.0, dt_s);
            coming_hz = goal;
        }
        let frequency_hz = state.frequency.value;
        let wish = self.wish(amplitude, frequency_hz);

        // Range: shorten the stride first, then hold the highest frequency and give up the lock.
        self.weigh(wish, 1.0);
        let rate = TAU * frequency_hz;
        let allowed = self.steepness.scale_limit(
            &self.weights,
            // Where the tempo is going counts too: the stride is short before the legs are fast.
            rate.max(self.state.rate).max(TAU * coming_hz),
            &self.ranges,
            RANGE_SHARE,
        );
        let state = &mut self.state;
        let stride_goal = allowed.clamp(LEAST_STRIDE, 1.0);
        // Shorten at once, lengthen at leisure: the limit is the joints', the comfort ours.
        let follow = if stride_goal < state.stride {
            0.05
        } else {
            0.3
        };
        state.stride += (stride_goal - state.stride) * (dt_s / follow).min(1.0);
        let highest_rate = if allowed < LEAST_STRIDE {
            self.steepness
                .rate_limit(&self.weights, LEAST_STRIDE, &self.ranges, RANGE_SHARE)
        } else {
            f64::INFINITY
        };
        state.locked = rate <= highest_rate;

        let goal_rate = if state.locked {
            // Second-order lock: feed-forward of the gesture's frequency, correction of the phase.
            let lag = wrap_pi(drive.phase_rad - (state.phase + rate * dt_s));
            let bound = CATCH_UP * rate;
            let correction = if wanted > 0.0 && lag.is_finite() {
                (LOCK_RATE * lag).clamp(-bound, bound)
            } else {
                0.0
            };
            // Catching up may use more of the joints than a steady cycle, but not all of them.
            let most = self.steepness.rate_limit(
                &self.weights,
                state.stride,
                &self.ranges,
                CATCH_UP_SHARE,
            );
            rate + correction.min((most - rate).max(0.0))
        } else {
            highest_rate
        };
        let follow = 1.0 - (-dt_s / 0.06).exp();
        state.rate += (goal_rate - state.rate) * follow;
        let at_rest = amplitude < AT_REST;
        if at_rest && on_route.is_none() {
            // Standing still: nobody sees the phase, so it may be right when the first step comes.
            state.rate = goal_rate;
            state.phase = drive.phase_rad;
            if !state.phase.is_finite() {
                state.phase = 0.0;
            }
        }
        let advance = state.rate * dt_s;
        state.phase = wrap_tau(state.phase + advance);
        self.weigh(wish, self.state.stride);
        self.shift_limbs(advance, at_rest);

        let phase = self.state.phase;
        self.sample(space, phase, out);
        let velocity = self.travel(phase / TAU, self.state.rate / TAU);
        Played {
            phase_rad: phase,
            frequency_hz: self.state.rate / TAU,
            amplitude,
            stride: self.state.stride,
            locked: self.state.locked,
            root_velocity: velocity,
            uncertainty: 0.0,
        }
    }

    /// Travel per second where the clips are at `u`, going `per_second` clips a second: root motion is
    /// blended in the body's frame.
    pub(super) fn travel(&self, u: f64, per_second: f64) -> RootAdvance {
        let mut velocity = RootAdvance::default();
        for (example, weight) in self.examples.iter().zip(&self.weights) {
            if *weight != 0.0 {
                velocity.add(example.clip.rate(u), weight * per_second);
            }
        }
        velocity
    }

    /// Moves limb timelines towards the blend of the clips' offsets, at most 5 % of the advance.
    pub(super) fn shift_limbs(&mut self, advance: f64, at_rest: bool) {
        let bound = self.options.limb_advance * advance.abs();
        for limb in 0..self.state.limb_shift.len() {
            let mut moving = 0.0;
            // The mean of angles is that of their unit vectors (eq. 9.7 is circular).
            let (mut sin, mut cos) = (0.0, 0.0);
            for (offsets, weight) in self.offsets.iter().zip(&self.weights) {
                if let Some(offsets) = offsets {
                    moving += weight;
                    sin += weight * offsets[limb].sin();
                    cos += weight * offsets[limb].cos();
                }
            }
            // Opposite offsets cancel out: then the limb stays with the timeline it has.
            if moving > 1e-9 && sin.hypot(cos) > 0.05 * moving {
                let shift = &mut self.state.limb_shift[limb];
                let gap = wrap_pi(sin.atan2(cos) - *shift);
                *shift += if at_rest {
                    gap
                } else {
                    gap.clamp(-bound, bound)
                };
            }
        }
    }
}
