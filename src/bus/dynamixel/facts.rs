//! What a servo itself bears and does, read before it may move: limits, watchdog.

use super::chain::DynamixelChain;
use super::model::{Effort, Mode, Protocol, WATCHDOG_UNIT_MS, address};
use crate::bus::{BusError, ServoFacts};

/// Registers 31 to 37: temperature limit, voltage limits, PWM limit.
const LIMIT_BYTES: usize = 7;
/// Most counts of the bus watchdog; the register is signed, and -1 means tripped.
const MOST_COUNTS: u8 = 127;

impl DynamixelChain {
    /// Reads the limits of servo `index`, decides on its watchdog, and keeps what was found for [`facts`](crate::bus::ServoBus::facts).
    pub(super) fn look_at(&mut self, index: usize) -> Result<(), BusError> {
        let limits: [u8; LIMIT_BYTES] = self.read_register(index, address::TEMPERATURE_LIMIT)?;
        let [temperature, max0, max1, min0, min1, pwm0, pwm1] = limits;
        let volt = |low, high| f64::from(u16::from_le_bytes([low, high])) * 0.1;
        let spec = self.servos[index].spec.clone();
        let model = spec.model;
        let effort_limit = match model.effort {
            Effort::Load => {
                let whole = model.register_like(address::PWM_LIMIT).map_or(1, |r| r.max);
                f64::from(u16::from_le_bytes([pwm0, pwm1])) / whole.max(1) as f64
            }
            Effort::Current => {
                let counts = u16::from_le_bytes(self.read_register(index, address::CURRENT_LIMIT)?);
                let register_a = f64::from(counts) * model.effort_unit;
                let wanted_a = spec.settings.current_limit_a.unwrap_or(register_a);
                if wanted_a > register_a {
                    return Err(self.servo_problem(
                        index,
                        format!(
                            "its current limit is {counts} ({register_a:.3} A), the configuration wants {wanted_a} A"
                        ),
                        format!(
                            "Lower current_a in the configuration, or with torque off raise the limit: \
                             `handwave bus write {} {} current_limit {:.0}`",
                            self.options.bus,
                            spec.id,
                            (wanted_a / model.effort_unit).ceil()
                        ),
                    ));
                }
                // Down to whole counts, so that the register's limit holds.
                self.servos[index].follower.limit = (wanted_a / model.effort_unit + 1e-9) as i32;
                wanted_a
            }
        };
        if spec.mode == Mode::Velocity {
            let limit = u32::from_le_bytes(self.read_register(index, address::VELOCITY_LIMIT)?);
            self.servos[index].follower.limit = i32::try_from(limit).unwrap_or(i32::MAX);
        }
        let watchdog_s = self.choose_watchdog(index)?;
        self.facts.push(ServoFacts {
            id: spec.id,
            model: model.name.into(),
            bus: self.options.bus.clone(),
            temperature_limit_c: Some(f64::from(temperature)),
            voltage_range_v: Some((volt(min0, min1), volt(max0, max1))),
            effort_limit: Some(effort_limit),
            watchdog_s,
        });
        Ok(())
    }

    /// Whether servo `index` gets a bus watchdog, and after how long it can be relied upon to stop the servo.
    fn choose_watchdog(&mut self, index: usize) -> Result<Option<f64>, BusError> {
        let counts = self.options.watchdog.min(MOST_COUNTS);
        let servo = &self.servos[index];
        let (id, spec, firmware) = (servo.spec.id, servo.spec.clone(), servo.firmware);
        let unprotected = |why: String| {
            let moves_on = if spec.mode.holds_position() {
                "to its last goal"
            } else {
                "at its last goal, and does not stop"
            };
            format!(
                "servo {id} ({}, joint {}) is not protected by a bus watchdog: {why}. If this program dies it goes on \
                 {moves_on}; keep a switch for its power at hand",
                spec.model.name, spec.joint
            )
        };
        self.servos[index].watchdog = counts;
        if counts == 0 {
            return Ok(None);
        }
        if firmware < spec.model.watchdog_since {
            self.servos[index].watchdog = 0;
            self.notes.push(unprotected(match spec.model.protocol {
                Protocol::One => "servos with Protocol 1.0 have none".into(),
                Protocol::Two => format!(
                    "firmware {firmware} has none, it needs {}",
                    spec.model.watchdog_since
                ),
            }));
            return Ok(None);
        }
        if !spec.mode.has_position_limits() && spec.mode.holds_position() {
            let offset = i32::from_le_bytes(self.read_register(index, address::HOMING_OFFSET)?);
            if offset != 0 {
                // Tripped with a homing offset in modes of several turns, it makes up a goal far away.
                self.servos[index].watchdog = 0;
                self.notes.push(unprotected(format!(
                    "with its homing offset of {offset} a tripped watchdog may send it off in mode \"{}\", so it is left off. \
                     With torque off set homing_offset to 0 and use zero_pulse",
                    spec.mode.name()
                )));
                return Ok(None);
            }
        }
        if let Some(defect) = spec.model.watchdog_defect {
            // Running all the same: sometimes is better than never.
            self.notes.push(unprotected(defect.into()));
            return Ok(None);
        }
        Ok(Some(f64::from(counts) * WATCHDOG_UNIT_MS as f64 * 1e-3))
    }
}
