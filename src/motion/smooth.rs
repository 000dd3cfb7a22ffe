//! Second-order smoothing with bounded speed, for parameters that drive joints.

/// A critically damped follower: reaches its goal without overshoot, with continuous speed.
#[derive(Copy, Clone, Debug, Default)]
pub struct Follower {
    /// Present value.
    pub value: f64,
    speed: f64,
}

impl Follower {
    /// A follower at rest at `value`.
    pub fn at(value: f64) -> Self {
        Self { value, speed: 0.0 }
    }

    /// A follower at `value` that moves with `speed`.
    pub fn moving(value: f64, speed: f64) -> Self {
        Self { value, speed }
    }

    /// Present speed, units/s.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// One step of `dt_s` towards `goal`. `rate` (1/s) sets how fast: 95 % of a step after about
    /// `4.7 / rate` seconds. `max_speed` bounds the speed (units/s).
    pub fn step(&mut self, goal: f64, rate: f64, max_speed: f64, dt_s: f64) -> f64 {
        // Implicit step: stable for any rate and step. Clamping the speed cannot cause overshoot:
        // the spring starts to brake at 2 v / rate before the goal, and needs only v / rate.
        let k = rate * dt_s;
        self.speed = (self.speed + rate * k * (goal - self.value)) / (1.0 + 2.0 * k + k * k);
        self.speed = self.speed.clamp(-max_speed, max_speed);
        self.value += self.speed * dt_s;
        self.value
    }
}

/// How long an eased way must take so that it keeps inside `velocity` and `acceleration` (per second, and
/// per second squared), seconds.
pub fn eased_span_s(way: f64, velocity: f64, acceleration: f64) -> f64 {
    // Peak slope 15/8 and peak curvature 10/sqrt(3) of `ease`.
    let by_speed = 1.875 * way.abs() / velocity;
    let by_acceleration = (5.774 * way.abs() / acceleration).sqrt();
    by_speed.max(by_acceleration)
}

/// Smooth step from 0 to 1 with zero speed and acceleration at both ends; peak slope 15/8.
pub fn ease(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * u * (10.0 + u * (6.0 * u - 15.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn follower_settles_without_overshoot_and_keeps_its_speed_bound() {
        let mut follower = Follower::at(0.0);
        let mut last = 0.0;
        let mut highest_speed: f64 = 0.0;
        for _ in 0..600 {
            let value = follower.step(1.0, 12.0, 2.0, 0.005);
            highest_speed = highest_speed.max((value - last) / 0.005);
            assert!(value <= 1.0 + 1e-9, "overshoot to {value}");
            last = value;
        }
        assert!((last - 1.0).abs() < 1e-6, "ended at {last}");
        assert!(highest_speed <= 2.0 + 1e-9, "speed {highest_speed}");
    }
}
