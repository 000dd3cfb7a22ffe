//! What a servo is told before its torque goes on: gains, profile, current limit. Lost with its power, so written at each arming.

use super::model::{Effort, Mode, Model, address};

/// Settings of one servo, beside its mode. The default changes nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// Gains of its own position loop.
    pub gains: Gains,
    /// Limits of its own path to each goal; those of the chain when `None`.
    pub profile: Option<Profile>,
    /// The most current, ampere: of [`Mode::CurrentBasedPosition`] and [`Mode::Current`]. `None`: what its current limit
    /// register allows.
    pub current_limit_a: Option<f64>,
    /// Gains of the host's position loop, for modes in which the servo has none.
    pub follow: Follow,
}

/// Gains of the servo's position loop, in its own counts (registers 80 to 90). `None` leaves what the servo has after
/// power-up or a change of mode.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub struct Gains {
    /// Position P gain.
    pub p: Option<u16>,
    /// Position I gain.
    pub i: Option<u16>,
    /// Position D gain.
    pub d: Option<u16>,
    /// Feedforward first gain (velocity).
    pub feedforward_1: Option<u16>,
    /// Feedforward second gain (acceleration).
    pub feedforward_2: Option<u16>,
}

impl Gains {
    /// Name, X series address and value of each gain, in the order of addresses.
    pub(super) fn registers(&self) -> [(&'static str, u16, Option<u16>); 5] {
        [
            ("d", address::POSITION_D_GAIN, self.d),
            ("i", address::POSITION_I_GAIN, self.i),
            ("p", address::POSITION_P_GAIN, self.p),
            (
                "feedforward_2",
                address::FEEDFORWARD_2ND_GAIN,
                self.feedforward_2,
            ),
            (
                "feedforward_1",
                address::FEEDFORWARD_1ST_GAIN,
                self.feedforward_1,
            ),
        ]
    }
}

/// Limits of the path that a servo makes to each goal; 0 is none.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Profile {
    /// Acceleration, rad/s^2.
    pub acceleration_rad_s2: f64,
    /// Velocity, rad/s.
    pub velocity_rad_s: f64,
}

impl Profile {
    /// Acceleration and velocity in the model's counts; what is not 0 is at least one count.
    pub(super) fn counts(&self, model: &Model) -> (u32, u32) {
        let counts = |value: f64, unit: f64| match value {
            // As a number no greater than the register's, which is checked before.
            value if value > 0.0 => (value / unit).round().max(1.0) as u32,
            _ => 0,
        };
        (
            counts(self.acceleration_rad_s2, model.acceleration_unit_rad_s2),
            counts(self.velocity_rad_s, model.velocity_unit_rad_s),
        )
    }
}

/// Gains of the host's position loop in modes in which the servo has none.
///
/// [`Mode::Velocity`]: `goal velocity = target rate + p * (target - position)`, `p` in 1/s.
/// [`Mode::Current`]: `goal current = p * (target - position) + d * (target rate - velocity)`, `p` in A/rad, `d` in A s/rad.
/// Position and velocity are those of the latest answer, a cycle old.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Follow {
    /// On the error of position.
    pub p: f64,
    /// On the error of velocity.
    pub d: f64,
}

impl Default for Follow {
    fn default() -> Self {
        Follow { p: 10.0, d: 0.0 }
    }
}

/// A loop of this gain closed once a control cycle, one cycle late, still settles at 200 Hz.
const MAX_VELOCITY_GAIN: f64 = 50.0;
/// Beyond it, it is a slip of the pen.
const MAX_CURRENT_GAIN: f64 = 1000.0;

impl Settings {
    /// Checks the settings against what the model has in a mode; says what is wrong and what is allowed.
    pub fn check(&self, model: &Model, mode: Mode) -> Result<(), String> {
        for (name, x_series, value) in self.gains.registers() {
            let Some(value) = value else { continue };
            if !mode.holds_position() {
                return Err(format!(
                    "gains are those of the servo's position loop, which mode \"{}\" does not use; the host's are host_gains",
                    mode.name()
                ));
            }
            let most = model
                .register_like(x_series)
                .map_or(0, |register| register.max);
            if i64::from(value) > most {
                return Err(format!(
                    "gains.{name} = {value}; {} takes 0 to {most}",
                    model.name
                ));
            }
        }
        if let Some(profile) = self.profile {
            self.check_profile(model, profile)?;
        }
        if let Some(limit) = self.current_limit_a {
            if !mode.uses_current() {
                return Err(format!(
                    "current_a is for modes \"current\" and \"current_based_position\", not for \"{}\"",
                    mode.name()
                ));
            }
            let most = most_current_a(model);
            if !(limit > 0.0 && limit <= most) {
                return Err(format!(
                    "current_a = {limit}; {} takes more than 0 and at most {most:.3} A",
                    model.name
                ));
            }
        }
        let Follow { p, d } = self.follow;
        let most = match mode {
            Mode::Velocity => MAX_VELOCITY_GAIN,
            Mode::Current => MAX_CURRENT_GAIN,
            _ => return Ok(()),
        };
        if mode == Mode::Velocity && d != 0.0 {
            return Err(format!(
                "host_gains d = {d}; mode \"velocity\" has p alone, the servo itself damps"
            ));
        }
        if !(p > 0.0 && p <= most && (0.0..=most).contains(&d)) {
            return Err(format!(
                "host_gains p = {p}, d = {d}; p takes more than 0 and at most {most}, d 0 to {most}"
            ));
        }
        Ok(())
    }

    fn check_profile(&self, model: &Model, profile: Profile) -> Result<(), String> {
        for (name, value, unit, x_series) in [
            (
                "acceleration_rad_s2",
                profile.acceleration_rad_s2,
                model.acceleration_unit_rad_s2,
                address::PROFILE_ACCELERATION,
            ),
            (
                "velocity_rad_s",
                profile.velocity_rad_s,
                model.velocity_unit_rad_s,
                address::PROFILE_VELOCITY,
            ),
        ] {
            let most = model
                .register_like(x_series)
                .map_or(0.0, |register| register.max as f64 * unit);
            if !(0.0..=most).contains(&value) {
                return Err(format!(
                    "profile.{name} = {value}; {} takes 0 (no limit) to {most:.1}",
                    model.name
                ));
            }
        }
        Ok(())
    }
}

/// The most that the model's current limit register can hold, ampere; 0 when it has none.
fn most_current_a(model: &Model) -> f64 {
    if model.effort != Effort::Current {
        return 0.0;
    }
    model
        .register_like(address::CURRENT_LIMIT)
        .map_or(0.0, |register| register.max as f64 * model.effort_unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(name: &str) -> &'static Model {
        Model::by_name(name).expect("a known model")
    }

    #[test]
    fn settings_that_a_servo_cannot_have_are_refused_with_what_it_can() {
        let with = |change: &dyn Fn(&mut Settings)| {
            let mut settings = Settings::default();
            change(&mut settings);
            settings
        };
        let profile = |acceleration_rad_s2, velocity_rad_s| {
            with(&move |s| {
                s.profile = Some(Profile {
                    acceleration_rad_s2,
                    velocity_rad_s,
                });
            })
        };
        for (name, mode, settings, expected) in [
            (
                "xl430-w250",
                Mode::Position,
                with(&|s| s.gains.p = Some(16_384)),
                "gains.p = 16384; xl430-w250 takes 0 to 16383",
            ),
            (
                "xl430-w250",
                Mode::Velocity,
                with(&|s| s.gains.p = Some(1)),
                "host_gains",
            ),
            (
                "xl430-w250",
                Mode::Position,
                with(&|s| s.current_limit_a = Some(0.5)),
                "current_a is for modes",
            ),
            (
                "xl330-m288",
                Mode::CurrentBasedPosition,
                with(&|s| s.current_limit_a = Some(1.8)),
                "at most 1.750 A",
            ),
            (
                "xl330-m288",
                Mode::CurrentBasedPosition,
                with(&|s| s.current_limit_a = Some(f64::NAN)),
                "at most 1.750 A",
            ),
            (
                "xm430-w350",
                Mode::Velocity,
                with(&|s| s.follow.p = 0.0),
                "p takes more than 0",
            ),
            (
                "xm430-w350",
                Mode::Velocity,
                with(&|s| s.follow.p = 51.0),
                "at most 50",
            ),
            (
                "xm430-w350",
                Mode::Current,
                with(&|s| s.follow.d = f64::INFINITY),
                "d 0 to 1000",
            ),
            (
                "xm430-w350",
                Mode::Position,
                profile(-1.0, 0.0),
                "profile.acceleration_rad_s2 = -1",
            ),
            (
                "xm430-w350",
                Mode::Position,
                profile(0.0, f64::NAN),
                "profile.velocity_rad_s = NaN",
            ),
            (
                "ph42-020-s300",
                Mode::Position,
                profile(0.0, 4.0),
                "takes 0 (no limit) to 3.1",
            ),
        ] {
            let problem = settings.check(model(name), mode).expect_err(expected);
            assert!(problem.contains(expected), "{problem}");
        }
        assert_eq!(
            Settings::default().check(model("xl430-w250"), Mode::Position),
            Ok(())
        );
    }

    #[test]
    fn a_profile_in_si_units_becomes_counts_and_never_no_limit() {
        let profile = Profile {
            acceleration_rad_s2: 20.0,
            velocity_rad_s: 1e-6,
        };
        assert_eq!(profile.counts(model("xl430-w250")), (53, 1));
        assert_eq!(profile.counts(model("ph42-020-s300")), (11_459, 1));
        assert_eq!(Profile::default().counts(model("xl430-w250")), (0, 0));
    }
}
