//! Servos that were silent: asked again at a low rate, taken back only after a look at their torque.

use super::chain::{DynamixelChain, Link};
use super::client::ClientError;
use super::goals::resting_goal;
use super::model::{WATCHDOG_UNIT_MS, address};
use crate::base::Time;
use crate::bus::BusError;
use handwave_dynamixel::wire;
use std::time::Duration;

/// Register 98 when the watchdog has tripped: -1.
const TRIPPED: u8 = 0xFF;
/// What one count of the watchdog is.
const WATCHDOG_COUNT: Duration = Duration::from_millis(WATCHDOG_UNIT_MS);
/// How long a retry may be put off because the cycle has no room for it.
const PATIENCE: Duration = Duration::from_millis(250);

/// Registers 98 to 135: from the bus watchdog to the present position.
const RETURN_BYTES: usize = 38;

impl DynamixelChain {
    /// Asks the silent servo that is most overdue, if one is due and the cycle that began at `begin` has room.
    pub(super) fn retry_one(&mut self, begin: Time) -> Result<(), BusError> {
        let now = self.client.now();
        let everybody_silent = self.servos.iter().all(|servo| servo.link == Link::Silent);
        let due = (0..self.servos.len())
            .filter(|&index| self.servos[index].link == Link::Silent)
            .filter(|&index| self.servos[index].retry_at <= begin)
            .min_by_key(|&index| self.servos[index].retry_at);
        let Some(index) = due else {
            return Ok(());
        };
        let request = wire::duration(wire::READ + wire::status(1), self.client.baud());
        // The first time it was likely one lost answer. Later it is likely silent still, and all of the
        // wait is spent.
        let first = self.servos[index].retry_after < self.options.retry_every / 8;
        let wait = if first {
            Duration::ZERO
        } else {
            self.client.patience()
        };
        let room = now.saturating_since(begin) + request + wait <= self.options.cycle_budget;
        let overdue = now.saturating_since(self.servos[index].retry_at) >= PATIENCE;
        if !(room || overdue || everybody_silent) {
            return Ok(());
        }
        let servo = &mut self.servos[index];
        servo.retry_at = now + servo.retry_after;
        servo.retry_after = (servo.retry_after * 2).min(self.options.retry_every);
        match self.welcome_back(index) {
            Ok(()) => {
                self.last_heard = self.client.now();
                Ok(())
            }
            Err(ClientError::Port(error)) => Err(error.into()),
            // Still silent, or not yet itself: next time.
            Err(_) => Ok(()),
        }
    }

    /// Looks whether servo `index` answers and has torque, and takes it back accordingly.
    fn welcome_back(&mut self, index: usize) -> Result<(), ClientError> {
        let servo = &mut self.servos[index];
        let id = servo.spec.id;
        let mut torque = [0];
        let spec = &servo.spec;
        self.client
            .read(id, spec.at(address::TORQUE_ENABLE), &mut torque)?;
        if !servo.armed {
            servo.link = Link::Resting;
            return Ok(());
        }
        if torque == [0] {
            // Rebooted or without power in between: what it does next is the operator's decision.
            servo.link = Link::Torqueless;
            return Ok(());
        }
        let mut registers = [0; RETURN_BYTES];
        let watchdog = spec.at(address::BUS_WATCHDOG);
        self.client.read(id, watchdog, &mut registers)?;
        if registers[0] == TRIPPED {
            self.client.write(id, watchdog, &[0])?;
        }
        // It holds where it is until the goals of the coming cycles lead it back to its target.
        let [.., p0, p1, p2, p3] = registers;
        let pulse = i32::from_le_bytes([p0, p1, p2, p3]).clamp(spec.min_pulse, spec.max_pulse);
        let (goal, bytes, size) = resting_goal(spec, pulse);
        self.client.write(id, goal, &bytes[..size])?;
        if registers[0] != servo.watchdog {
            self.client.write(id, watchdog, &[servo.watchdog])?;
        }
        servo.follower.restart();
        servo.goal_pulse = f64::from(pulse);
        servo.link = Link::Ramping;
        Ok(())
    }

    /// Whether we ourselves were away so long that watchdogs may have run out.
    pub(super) fn watchdogs_may_have_tripped(&self, now: Time) -> bool {
        let limit = WATCHDOG_COUNT * u32::from(self.options.watchdog);
        // One count early: the register counts in whole steps.
        self.options.watchdog > 0
            && self.last_cycle.is_some_and(|last| {
                now.saturating_since(last) + WATCHDOG_COUNT > limit.max(2 * WATCHDOG_COUNT)
            })
    }

    /// After a pause of our own: a tripped servo ignores goals without a word, so each is looked at.
    pub(super) fn revive_all(&mut self) -> Result<(), BusError> {
        for index in 0..self.servos.len() {
            if !matches!(self.servos[index].link, Link::Driven | Link::Ramping) {
                continue;
            }
            match self.welcome_back(index) {
                // Who does not answer shows up in the cycle that follows.
                Ok(()) | Err(ClientError::Timeout { .. }) => {}
                Err(ClientError::Port(error)) => return Err(error.into()),
                Err(error) => return Err(self.servo_error(index, error)),
            }
        }
        Ok(())
    }
}
