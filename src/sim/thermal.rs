//! What a motor's current does beside moving the shaft: heat in winding and case, overload, a lower supply.
//!
//! Two bodies of heat: the winding, warmed by I^2 R, and the case around it, warmed by the winding and the
//! electronics and cooled by the air. The thermistor sits on the motor, between the two. Overload is an
//! I^2 t sum as drives have it. Moved on in ticks of ten milliseconds on a fixed grid, so that results do
//! not depend on how often somebody looks.

use super::motor::{MotorSpec, SUBSTEP_NANOS};

/// Substeps of the motor in one tick.
pub const TICK_SUBSTEPS: i64 = 40;
/// Length of a tick, nanoseconds.
pub const TICK_NANOS: i64 = TICK_SUBSTEPS * SUBSTEP_NANOS;
const TICK_S: f64 = TICK_NANOS as f64 * 1e-9;

/// Share of the electrical power that reaches the output shaft as `stall torque x no-load speed`.
///
/// From the vendor's figures of the XL430-W250 at 11.1 V: 1.4 N m, 57 rev/min, 1.3 A. Between 0.5
/// and 0.7 for its relatives.
const GEAR_EFFICIENCY: f64 = 0.58;
/// Standby current, A: 52 mA, vendor's figure of the XL430-W250.
const STANDBY_A: f64 = 0.052;
/// Supply that a servo stands at when its table does not say, volts.
const NOMINAL_V: f64 = 11.1;

/// Heat that the winding takes up per degree, as seconds of full stall power: 4 J/K at 14.4 W, a motor of
/// some ten grams (chosen). Stalled, it warms by 3.6 K a second at first.
const WINDING_S_PER_K: f64 = 0.28;
/// The same of the whole servo: 57 J/K at 14.4 W, 57 grams (vendor's weight) of plastic and metal.
const CASE_S_PER_K: f64 = 4.0;
/// Degrees by which the winding stands above the case in the end, per watt over stall power (chosen):
/// a time constant of 24 s.
const WINDING_RISE_K: f64 = 86.0;
/// Degrees by which the case stands above the air in the end, at full stall power: 12 K/W, which makes
/// the 32 degrees that an idle servo reads in a room of 25 degrees; a time constant of 11 minutes.
const CASE_RISE_K: f64 = 172.0;
/// Where the thermistor sits between case (0) and winding (1) (chosen).
const SENSOR_SHARE: f64 = 0.3;
/// What an idle servo reads, and what it begins at, degrees Celsius.
const IDLE_C: f64 = 32.0;

/// Share of the stall current that the servo bears for ever as far as overload goes. The vendor advises a
/// fifth of the stall torque for continuous use; with a third on it, servos of this class go on (chosen).
const RATED_SHARE: f64 = 0.35;
/// Overload trips when the sum of (I/I_stall)^2 - RATED_SHARE^2 over time reaches this, seconds: after
/// 1.7 s at full stall, as servos of this class do (chosen), after 3 s at four fifths and 12 s at half of it.
const OVERLOAD_S: f64 = 1.5;

/// Temperatures and loads of one servo.
#[derive(Clone, Debug)]
pub struct Thermal {
    winding_c: f64,
    case_c: f64,
    /// Air around it, degrees Celsius.
    air_c: f64,
    /// Power at stall, W.
    stall_w: f64,
    /// Current at stall, A.
    stall_a: f64,
    nominal_v: f64,
    /// Present supply without what faults take of it, volts.
    supply_v: f64,
    overload_s: f64,
    /// Sums over the substeps of this tick.
    square: f64,
    drawn: f64,
    /// Mean supply current of the last tick, A.
    current_a: f64,
}

impl Thermal {
    /// A servo in a room, idle long enough, at its nominal supply (volts; 0 when not known).
    pub fn new(motor: &MotorSpec, nominal_v: f64) -> Self {
        let nominal_v = if nominal_v > 0.0 {
            nominal_v
        } else {
            NOMINAL_V
        };
        let stall_w = motor.stall_nm * motor.no_load_rad_s / GEAR_EFFICIENCY;
        let mut thermal = Self {
            winding_c: IDLE_C,
            case_c: IDLE_C,
            air_c: 0.0,
            stall_w,
            stall_a: stall_w / nominal_v,
            nominal_v,
            supply_v: nominal_v,
            overload_s: 0.0,
            square: 0.0,
            drawn: 0.0,
            current_a: STANDBY_A,
        };
        thermal.air_c = IDLE_C - CASE_RISE_K * thermal.standby_share();
        thermal
    }

    /// Counts `substeps` with the motor at `effort` (torque, and so current, as a share of stall) and `duty`.
    pub(super) fn count(&mut self, effort: f64, duty: f64, substeps: i64) {
        let substeps = substeps as f64;
        self.square += effort * effort * substeps;
        // A bridge draws duty times the motor's current; what a braking motor gives back is not counted.
        self.drawn += (duty * effort).max(0.0) * substeps;
    }

    /// Ends a tick; whether overload trips in it.
    pub(super) fn tick(&mut self) -> bool {
        let square = self.square / TICK_SUBSTEPS as f64;
        let drawn = self.drawn / TICK_SUBSTEPS as f64;
        (self.square, self.drawn) = (0.0, 0.0);
        self.current_a = STANDBY_A + drawn * self.stall_a;
        let into_case = (self.winding_c - self.case_c) / WINDING_RISE_K;
        let into_air = (self.case_c - self.air_c) / CASE_RISE_K;
        self.winding_c += (square - into_case) * TICK_S / WINDING_S_PER_K;
        self.case_c += (into_case + self.standby_share() - into_air) * TICK_S / CASE_S_PER_K;
        self.overload_s =
            (self.overload_s + (square - RATED_SHARE * RATED_SHARE) * TICK_S).max(0.0);
        self.overload_s >= OVERLOAD_S
    }

    /// A restart forgets what was summed; heat stays.
    pub(super) fn restart(&mut self) {
        self.overload_s = 0.0;
    }

    /// Sets the supply by what the line as a whole takes off the nominal one, volts.
    pub(super) fn set_drop(&mut self, drop_v: f64) {
        self.supply_v = (self.nominal_v - drop_v).max(0.0);
    }

    /// What the thermistor reads, degrees Celsius.
    pub fn sensor_c(&self) -> f64 {
        self.case_c + SENSOR_SHARE * (self.winding_c - self.case_c)
    }

    /// Supply at the servo, volts.
    pub fn supply_v(&self) -> f64 {
        self.supply_v
    }

    /// Supply as a share of the one that the motor's figures hold at.
    pub fn supply_share(&self, drop_v: f64) -> f64 {
        ((self.supply_v - drop_v) / self.nominal_v).max(0.0)
    }

    /// Current drawn from the supply over the last tick, A.
    pub fn current_a(&self) -> f64 {
        self.current_a
    }

    /// Power of the electronics as a share of stall power.
    fn standby_share(&self) -> f64 {
        STANDBY_A * self.nominal_v / self.stall_w
    }
}

#[cfg(test)]
mod tests {
    use super::super::motor::XL430_MOTOR;
    use super::*;

    /// Seconds until `done`, at this effort, at most `at_most_s`.
    fn after(
        thermal: &mut Thermal,
        effort: f64,
        at_most_s: f64,
        done: impl Fn(&Thermal, bool) -> bool,
    ) -> Option<f64> {
        (1..=(at_most_s / TICK_S) as i64)
            .find(|_| {
                thermal.count(effort, effort, TICK_SUBSTEPS);
                let overload = thermal.tick();
                done(thermal, overload)
            })
            .map(|ticks| ticks as f64 * TICK_S)
    }

    #[test]
    fn the_currents_are_the_vendor_s() {
        let thermal = Thermal::new(&XL430_MOTOR, 11.1);
        // Stall current of the XL430-W250 at 11.1 V: 1.3 A.
        assert!(
            (thermal.stall_a - 1.3).abs() < 0.02,
            "{} A",
            thermal.stall_a
        );
        // Its room is a room.
        assert!((24.0..26.0).contains(&thermal.air_c), "{} C", thermal.air_c);
    }

    #[test]
    fn a_stalled_servo_overloads_in_seconds_and_overheats_in_minutes() {
        let mut thermal = Thermal::new(&XL430_MOTOR, 11.1);
        let trip_s = after(&mut thermal, 1.0, 60.0, |_, overload| overload);
        let trip_s = trip_s.expect("overload");
        assert!((1.5..2.0).contains(&trip_s), "overload after {trip_s} s");
        let mut thermal = Thermal::new(&XL430_MOTOR, 11.1);
        let hot_s = after(&mut thermal, 1.0, 600.0, |t, _| t.sensor_c() > 72.0);
        let hot_s = hot_s.expect("72 degrees");
        assert!((40.0..240.0).contains(&hot_s), "72 degrees after {hot_s} s");
    }

    #[test]
    fn a_fifth_of_the_stall_torque_is_borne_for_an_hour() {
        let mut thermal = Thermal::new(&XL430_MOTOR, 11.1);
        let trip = after(&mut thermal, 0.2, 3600.0, |t, overload| {
            overload || t.sensor_c() > 60.0
        });
        assert_eq!(trip, None, "at {:.1} degrees", thermal.sensor_c());
        let warm = thermal.sensor_c();
        assert!(warm > IDLE_C + 4.0, "holding warms it: {warm:.1}");
        // Idle again for an hour.
        after(&mut thermal, 0.0, 3600.0, |_, _| false);
        let cool = thermal.sensor_c();
        assert!((cool - IDLE_C).abs() < 0.5, "cooled to {cool:.2}");
    }
}
