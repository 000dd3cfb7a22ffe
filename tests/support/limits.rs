//! Watches a stream of joint targets: position, velocity, acceleration and jerk inside the limits, with the extremes.

use handwave::robot::JointEnvelope;

/// The largest of a quantity as a share of its limit.
#[derive(Clone, Debug, Default)]
pub struct Extreme {
    pub share: f64,
    pub value: f64,
    pub limit: f64,
    pub joint: usize,
    pub cycle: usize,
}

/// Targets are judged one cycle at a time; before the first the robot is at rest in it.
#[derive(Clone, Debug)]
pub struct LimitWatch {
    limits: Vec<JointEnvelope>,
    dt_s: f64,
    last: Vec<f64>,
    velocity: Vec<f64>,
    last_acceleration: Vec<f64>,
    cycle: usize,
    pub speed: Extreme,
    pub acceleration: Extreme,
    /// Smallest distance to a position limit, rad.
    pub room_rad: f64,
}

/// Rounding: a billionth of a radian in a position (as in a file of nine decimals).
const ROUNDING: f64 = 2e-9;

impl LimitWatch {
    pub fn new(limits: &[JointEnvelope], dt_s: f64) -> Self {
        Self {
            limits: limits.to_vec(),
            dt_s,
            last: Vec::new(),
            velocity: vec![0.0; limits.len()],
            last_acceleration: vec![0.0; limits.len()],
            cycle: 0,
            speed: Extreme::default(),
            acceleration: Extreme::default(),
            room_rad: f64::INFINITY,
        }
    }

    /// Judges the targets of the next cycle.
    pub fn see(&mut self, targets: &[f64]) -> Result<(), String> {
        if self.last.is_empty() {
            self.last = targets.to_vec();
        }
        for (joint, limit) in self.limits.iter().enumerate() {
            let position = targets[joint];
            let velocity = (position - self.last[joint]) / self.dt_s;
            let acceleration = (velocity - self.velocity[joint]) / self.dt_s;
            let at = format!("cycle {}, joint {joint}", self.cycle);
            let (lower, upper) = (limit.lower - ROUNDING, limit.upper + ROUNDING);
            if !(lower..=upper).contains(&position) {
                return Err(format!(
                    "{at}: position {position} rad is not in {}..{}",
                    limit.lower, limit.upper
                ));
            }
            let slack = 2.0 * ROUNDING / self.dt_s;
            if velocity.abs() > limit.velocity + slack {
                return Err(format!(
                    "{at}: velocity {velocity} rad/s over {}",
                    limit.velocity
                ));
            }
            if acceleration.abs() > limit.acceleration + 2.0 * slack / self.dt_s {
                let most = limit.acceleration;
                return Err(format!(
                    "{at}: acceleration {acceleration} rad/s^2 over {most}"
                ));
            }
            let jerk = (acceleration - self.last_acceleration[joint]) / self.dt_s;
            if jerk.abs() > limit.jerk + 4.0 * slack / (self.dt_s * self.dt_s) {
                return Err(format!("{at}: jerk {jerk} rad/s^3 over {}", limit.jerk));
            }
            self.last_acceleration[joint] = acceleration;
            self.room_rad = self
                .room_rad
                .min(position - limit.lower)
                .min(limit.upper - position);
            let most = |extreme: &mut Extreme, value: f64, limit: f64| {
                if value / limit > extreme.share {
                    *extreme = Extreme {
                        share: value / limit,
                        value,
                        limit,
                        joint,
                        cycle: self.cycle,
                    };
                }
            };
            most(&mut self.speed, velocity.abs(), limit.velocity);
            most(
                &mut self.acceleration,
                acceleration.abs(),
                limit.acceleration,
            );
            self.velocity[joint] = velocity;
        }
        self.last.copy_from_slice(targets);
        self.cycle += 1;
        Ok(())
    }

    /// The largest speed of the last cycle, rad/s.
    pub fn fastest_rad_s(&self) -> f64 {
        self.velocity.iter().fold(0.0, |most, v| most.max(v.abs()))
    }

    /// The extremes, for messages.
    pub fn extremes(&self) -> String {
        let line = |name: &str, e: &Extreme, unit: &str| {
            format!(
                "{name} {:.2} of {:.2} {unit} ({:.0} %, joint {}, cycle {})",
                e.value,
                e.limit,
                100.0 * e.share,
                e.joint,
                e.cycle
            )
        };
        format!(
            "{}, {}, nearest position limit {:.4} rad away",
            line("speed", &self.speed, "rad/s"),
            line("acceleration", &self.acceleration, "rad/s^2"),
            self.room_rad
        )
    }
}
