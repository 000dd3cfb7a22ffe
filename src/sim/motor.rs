//! A geared DC motor with inertia, and the profile that leads it to a goal; fixed substeps, no chance.

/// Length of an integration substep, nanoseconds.
pub const SUBSTEP_NANOS: i64 = 250_000;
/// Length of an integration substep, seconds.
pub const SUBSTEP_S: f64 = SUBSTEP_NANOS as f64 * 1e-9;

/// What the motor of a servo model can do, at the output shaft.
#[derive(Copy, Clone, Debug)]
pub struct MotorSpec {
    /// Speed without load at full duty, rad/s.
    pub no_load_rad_s: f64,
    /// Torque at standstill and full duty, N m.
    pub stall_nm: f64,
    /// Inertia of rotor, gears and a light link, kg m^2.
    pub inertia_kg_m2: f64,
    /// Dry friction while driven, N m.
    pub friction_nm: f64,
    /// Dry friction of the unpowered gear train, N m. Holds a light link where it is.
    pub friction_off_nm: f64,
}

/// XL430-W250 at 11.1 V.
///
/// Speed (57 rev/min) and stall torque (1.4 N m) are the vendor's; inertia gives a mechanical time
/// constant of 8 ms, so that the default position gain settles without overshoot; the frictions are
/// chosen (2 pulses of standing error driven, a coasting shaft stops within some tenths of a second).
pub const XL430_MOTOR: MotorSpec = MotorSpec {
    no_load_rad_s: 57.0 * std::f64::consts::TAU / 60.0,
    stall_nm: 1.4,
    inertia_kg_m2: 0.008 * 1.4 / (57.0 * std::f64::consts::TAU / 60.0),
    friction_nm: 0.02,
    friction_off_nm: 0.1,
};

/// The motor's state.
#[derive(Clone, Debug)]
pub struct Motor {
    /// What it can do.
    pub spec: MotorSpec,
    /// Angle of the output shaft, radians.
    pub angle_rad: f64,
    /// Its speed, rad/s.
    pub speed_rad_s: f64,
    /// Torque the motor makes, N m.
    pub torque_nm: f64,
    /// Duty of the last substep, -1..1.
    pub duty: f64,
    /// Torque from outside (gravity, a hand), N m; positive pushes the angle up.
    pub external_nm: f64,
    /// Supply as a share of the one that [`MotorSpec`] holds at.
    pub supply: f64,
    /// The shaft is blocked: it keeps its angle whatever the torque.
    pub blocked: bool,
}

impl Motor {
    /// A motor at rest at `angle_rad`.
    pub fn new(spec: MotorSpec, angle_rad: f64) -> Self {
        Self {
            spec,
            angle_rad,
            speed_rad_s: 0.0,
            torque_nm: 0.0,
            duty: 0.0,
            external_nm: 0.0,
            supply: 1.0,
            blocked: false,
        }
    }

    /// One substep at `duty` (-1..1, clamped), or unpowered with `None`.
    pub fn step(&mut self, duty: Option<f64>) {
        let spec = self.spec;
        self.duty = duty.unwrap_or(0.0).clamp(-1.0, 1.0);
        // The linear speed-torque line of a DC motor.
        self.torque_nm = match duty {
            Some(_) => {
                spec.stall_nm * (self.duty * self.supply - self.speed_rad_s / spec.no_load_rad_s)
            }
            None => 0.0,
        };
        if self.blocked {
            self.speed_rad_s = 0.0;
            return;
        }
        let friction = match duty {
            Some(_) => spec.friction_nm,
            None => spec.friction_off_nm,
        };
        let drive = self.torque_nm + self.external_nm;
        if self.speed_rad_s == 0.0 && drive.abs() <= friction {
            return;
        }
        let direction = if self.speed_rad_s == 0.0 {
            drive.signum()
        } else {
            self.speed_rad_s.signum()
        };
        let next =
            self.speed_rad_s + (drive - friction * direction) / spec.inertia_kg_m2 * SUBSTEP_S;
        // Dry friction stops the shaft; it never turns it round.
        self.speed_rad_s = if next * direction < 0.0 && drive.abs() <= friction {
            0.0
        } else {
            next
        };
        self.angle_rad += self.speed_rad_s * SUBSTEP_S;
    }

    /// Torque as a share of the stall torque, -1..1 in ordinary driving.
    pub fn effort(&self) -> f64 {
        self.torque_nm / self.spec.stall_nm
    }

    /// Whether a substep at `duty` would change nothing but the torque.
    pub fn rests(&self, duty: Option<f64>) -> bool {
        let (drive, friction) = match duty {
            Some(duty) => (
                self.spec.stall_nm * duty.clamp(-1.0, 1.0) * self.supply,
                self.spec.friction_nm,
            ),
            None => (0.0, self.spec.friction_off_nm),
        };
        self.speed_rad_s == 0.0 && (self.blocked || (drive + self.external_nm).abs() <= friction)
    }
}

/// The trapezoidal path from where the servo is to its goal.
#[derive(Copy, Clone, Debug, Default)]
pub struct Profile {
    /// Where the path is now, radians.
    pub angle_rad: f64,
    /// Its speed, rad/s.
    pub speed_rad_s: f64,
}

impl Profile {
    /// One substep towards `goal_rad`, no faster than `speed` and `acceleration`; `None` = at once.
    ///
    /// Without a speed limit the path jumps to the goal, as the vendor's step profile does.
    pub fn step(&mut self, goal_rad: f64, speed: Option<f64>, acceleration: Option<f64>) {
        let Some(speed) = speed else {
            self.angle_rad = goal_rad;
            self.speed_rad_s = 0.0;
            return;
        };
        let left = goal_rad - self.angle_rad;
        let wanted = match acceleration {
            // The speed from which the path can still stop at the goal, in whole substeps.
            Some(a) => {
                let half = 0.5 * SUBSTEP_S;
                let stopping = a * ((half * half + 2.0 * left.abs() / a).sqrt() - half);
                stopping.min(speed) * left.signum()
            }
            None => speed * left.signum(),
        };
        let change = acceleration.map_or(f64::INFINITY, |a| a * SUBSTEP_S);
        self.speed_rad_s += (wanted - self.speed_rad_s).clamp(-change, change);
        let travel = self.speed_rad_s * SUBSTEP_S;
        if travel.abs() >= left.abs()
            && travel * left >= 0.0
            && self.speed_rad_s.abs() <= change * 4.0
        {
            self.angle_rad = goal_rad;
            self.speed_rad_s = 0.0;
        } else {
            self.angle_rad += travel;
        }
    }

    /// One substep of the speed towards `goal_rad_s`, for velocity control; the angle is not used.
    pub fn step_speed(&mut self, goal_rad_s: f64, acceleration: Option<f64>) {
        let change = acceleration.map_or(f64::INFINITY, |a| a * SUBSTEP_S);
        self.speed_rad_s += (goal_rad_s - self.speed_rad_s).clamp(-change, change);
    }

    /// Whether the path stands at `goal_rad`.
    pub fn arrived(&self, goal_rad: f64) -> bool {
        self.angle_rad == goal_rad && self.speed_rad_s == 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_duty_approaches_the_no_load_speed_from_below() {
        let mut motor = Motor::new(XL430_MOTOR, 0.0);
        let mut fastest: f64 = 0.0;
        for _ in 0..4000 {
            motor.step(Some(1.0));
            fastest = fastest.max(motor.speed_rad_s);
        }
        let share = fastest / XL430_MOTOR.no_load_rad_s;
        assert!(
            (0.97..1.0).contains(&share),
            "reached {share:.4} of the no-load speed"
        );
    }

    #[test]
    fn an_unpowered_shaft_coasts_and_stops_for_good() {
        let mut motor = Motor::new(XL430_MOTOR, 0.0);
        motor.speed_rad_s = 4.0;
        let mut steps = 0;
        while motor.speed_rad_s != 0.0 && steps < 40_000 {
            motor.step(None);
            steps += 1;
        }
        let (time, way) = (f64::from(steps) * SUBSTEP_S, motor.angle_rad);
        assert!((0.01..0.5).contains(&time), "stopped after {time:.3} s");
        assert!((0.02..1.0).contains(&way), "coasted {way:.3} rad");
        assert!(motor.rests(None));
    }

    #[test]
    fn a_profile_keeps_its_limits_and_lands_on_the_goal() {
        for (goal, speed, acceleration) in [(2.0, 1.5, 6.0), (-0.05, 3.0, 2.0), (1.0, 0.7, 40.0)] {
            let mut path = Profile::default();
            let (mut last, mut steps) = (0.0, 0);
            while !path.arrived(goal) && steps < 40_000 {
                path.step(goal, Some(speed), Some(acceleration));
                let change = (path.speed_rad_s - last).abs() / SUBSTEP_S;
                last = path.speed_rad_s;
                assert!(path.speed_rad_s.abs() <= speed + 1e-12);
                assert!(
                    change <= acceleration * 4.01,
                    "acceleration {change:.2} of {acceleration} rad/s^2"
                );
                assert!(
                    path.angle_rad.abs() <= goal.abs() + 1e-6,
                    "overshoot to {} of {goal}",
                    path.angle_rad
                );
                steps += 1;
            }
            assert!(path.arrived(goal), "not there after {steps} substeps");
        }
    }
}
