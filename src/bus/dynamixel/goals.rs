//! Goals of a cycle: targets to counts in each servo's mode, and out in one sync write per register.

use super::chain::{DynamixelChain, Link, Servo};
use super::cycle::port_error;
use super::servo::ServoSpec;
use crate::base::{JointState, Time};
use crate::bus::BusError;
use std::f64::consts::TAU;

/// A goal at which a servo stays where it is: its address, its bytes, how many of them count.
///
/// In modes with a position that is `pulse`, in others no velocity and no current.
pub(super) fn resting_goal(spec: &ServoSpec, pulse: i32) -> (u16, [u8; 4], usize) {
    let (address, bytes) = spec.goal_register();
    let goal = if spec.mode.holds_position() { pulse } else { 0 };
    (address, goal.to_le_bytes(), usize::from(bytes))
}

impl Servo {
    /// Moves its goal on to `target_rad`, at a bounded rate while ramping. Not a number: the last goal stands.
    fn move_goal(&mut self, target_rad: f64, reentry_rate_rad_s: f64, step_s: f64) {
        let wanted = self
            .spec
            .goal_pulse(target_rad)
            .map_or(self.goal_pulse, f64::from);
        self.goal_pulse = if self.link == Link::Ramping {
            let rate = reentry_rate_rad_s * self.spec.model.pulses_per_turn / TAU;
            let reach = rate.max(0.0) * step_s;
            let left = wanted - self.goal_pulse;
            if left.abs() <= reach {
                self.link = Link::Driven;
                wanted
            } else {
                self.goal_pulse + reach.copysign(left)
            }
        } else {
            wanted
        };
    }

    /// The goal of this cycle in counts of its mode; `None` when it is not driven.
    fn goal(
        &mut self,
        target_rad: f64,
        state: &JointState,
        reentry_rate_rad_s: f64,
        step_s: f64,
        now: Time,
    ) -> Option<i32> {
        match self.link {
            Link::Driven | Link::Ramping => {}
            // It may hear though it does not answer, and would go on with the velocity it was told last.
            Link::Silent if self.armed && !self.spec.mode.holds_position() => {
                self.follower.restart();
                return Some(0);
            }
            Link::Silent | Link::Resting | Link::Torqueless => return None,
        }
        self.move_goal(target_rad, reentry_rate_rad_s, step_s);
        let spec = &self.spec;
        if spec.mode.holds_position() {
            let pulse = self.goal_pulse.round() as i32;
            return Some(pulse.clamp(spec.min_pulse, spec.max_pulse));
        }
        let target_rad = spec.radians_at(self.goal_pulse);
        Some(self.follower.goal(spec, target_rad, state, step_s, now))
    }
}

impl DynamixelChain {
    /// Sends the goals of all servos that are driven, one sync write for each goal register in use.
    pub(super) fn send_goals(
        &mut self,
        targets_rad: &[f64],
        states: &[JointState],
        step_s: f64,
    ) -> Result<(), BusError> {
        let now = self.client.now();
        let rate = self.options.reentry_rate_rad_s;
        let targets = targets_rad.iter().zip(states);
        for (servo, (&target_rad, state)) in self.servos.iter_mut().zip(targets) {
            servo.goal = servo.goal(target_rad, state, rate, step_s, now);
        }
        for &(address, bytes) in &self.goal_registers {
            let scratch = &mut self.scratch;
            scratch.ids.clear();
            let mut filled = 0;
            for servo in &self.servos {
                let Some(goal) = servo.goal else { continue };
                if servo.spec.goal_register() != (address, bytes) {
                    continue;
                }
                let size = usize::from(bytes);
                scratch.ids.push(servo.spec.id);
                scratch.data[filled..filled + size].copy_from_slice(&goal.to_le_bytes()[..size]);
                filled += size;
            }
            if scratch.ids.is_empty() {
                continue;
            }
            self.client
                .sync_write(address, bytes.into(), &scratch.ids, &scratch.data[..filled])
                .map_err(port_error)?;
        }
        Ok(())
    }
}
