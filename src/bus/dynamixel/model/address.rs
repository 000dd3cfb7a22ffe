//! Addresses that the driver and the simulated servos work with; the same on every X series servo, and on others as
//! [`Layout::at`](super::Layout::at) says.
//!
//! They are looked up in the control table at compile time, so that each number stands in one place.

use super::Register;
use super::current::XM430;
use super::x430::REGISTERS;

/// The address of the register called `name` in the table of a servo that reports load. A name that is not there does not compile.
const fn of(name: &str) -> u16 {
    find(&REGISTERS, name)
}

const fn find(table: &[Register], name: &str) -> u16 {
    let mut index = 0;
    while index < table.len() {
        if same(table[index].name, name) {
            return table[index].address;
        }
        index += 1;
    }
    panic!("no register of that name");
}

const fn same(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    let mut index = 0;
    while index < a.len() && index < b.len() && a[index] == b[index] {
        index += 1;
    }
    index == a.len() && index == b.len()
}

/// Model number.
pub const MODEL_NUMBER: u16 = of("model_number");
/// Firmware version.
pub const FIRMWARE_VERSION: u16 = of("firmware_version");
/// Id.
pub const ID: u16 = of("id");
/// Baud rate.
pub const BAUD_RATE: u16 = of("baud_rate");
/// Return delay time; drive mode and operating mode follow in the next 2 bytes.
pub const RETURN_DELAY_TIME: u16 = of("return_delay_time");
/// Drive mode.
pub const DRIVE_MODE: u16 = of("drive_mode");
/// Operating mode.
pub const OPERATING_MODE: u16 = of("operating_mode");
/// Secondary (shadow) id.
pub const SECONDARY_ID: u16 = of("secondary_id");
/// Homing offset.
pub const HOMING_OFFSET: u16 = of("homing_offset");
/// Moving threshold.
pub const MOVING_THRESHOLD: u16 = of("moving_threshold");
/// Temperature limit; voltage limits, PWM limit and current limit follow.
pub const TEMPERATURE_LIMIT: u16 = of("temperature_limit");
/// Max voltage limit.
pub const MAX_VOLTAGE_LIMIT: u16 = of("max_voltage_limit");
/// Min voltage limit.
pub const MIN_VOLTAGE_LIMIT: u16 = of("min_voltage_limit");
/// PWM limit.
pub const PWM_LIMIT: u16 = of("pwm_limit");
/// Current limit; not on models that report load.
pub const CURRENT_LIMIT: u16 = find(&XM430, "current_limit");
/// Velocity limit.
pub const VELOCITY_LIMIT: u16 = of("velocity_limit");
/// Maximum and, 4 bytes on, minimum position limit.
pub const MAX_POSITION_LIMIT: u16 = of("max_position_limit");
/// Min position limit.
pub const MIN_POSITION_LIMIT: u16 = of("min_position_limit");
/// Startup configuration.
pub const STARTUP_CONFIGURATION: u16 = of("startup_configuration");
/// Shutdown.
pub const SHUTDOWN: u16 = of("shutdown");
/// Torque enable.
pub const TORQUE_ENABLE: u16 = of("torque_enable");
/// Status return level.
pub const STATUS_RETURN_LEVEL: u16 = of("status_return_level");
/// Registered instruction.
pub const REGISTERED_INSTRUCTION: u16 = of("registered_instruction");
/// Hardware error status.
pub const HARDWARE_ERROR_STATUS: u16 = of("hardware_error_status");
/// Velocity I gain, the first of the gains.
pub const VELOCITY_I_GAIN: u16 = of("velocity_i_gain");
/// Position D gain.
pub const POSITION_D_GAIN: u16 = of("position_d_gain");
/// Position I gain.
pub const POSITION_I_GAIN: u16 = of("position_i_gain");
/// Position P gain.
pub const POSITION_P_GAIN: u16 = of("position_p_gain");
/// Feedforward second gain.
pub const FEEDFORWARD_2ND_GAIN: u16 = of("feedforward_2nd_gain");
/// Feedforward first gain, the last of the gains.
pub const FEEDFORWARD_1ST_GAIN: u16 = of("feedforward_1st_gain");
/// Bus watchdog.
pub const BUS_WATCHDOG: u16 = of("bus_watchdog");
/// Goal PWM.
pub const GOAL_PWM: u16 = of("goal_pwm");
/// Goal current; not on models that report load.
pub const GOAL_CURRENT: u16 = find(&XM430, "goal_current");
/// Goal velocity.
pub const GOAL_VELOCITY: u16 = of("goal_velocity");
/// Profile acceleration and, 4 bytes on, profile velocity.
pub const PROFILE_ACCELERATION: u16 = of("profile_acceleration");
/// Profile velocity.
pub const PROFILE_VELOCITY: u16 = of("profile_velocity");
/// Goal position.
pub const GOAL_POSITION: u16 = of("goal_position");
/// Realtime tick.
pub const REALTIME_TICK: u16 = of("realtime_tick");
/// Moving.
pub const MOVING: u16 = of("moving");
/// Moving status.
pub const MOVING_STATUS: u16 = of("moving_status");
/// Present PWM.
pub const PRESENT_PWM: u16 = of("present_pwm");
/// Present load, or present current on models that report that.
pub const PRESENT_LOAD: u16 = of("present_load");
/// Present load (2 bytes), velocity (4), position (4), read in one go.
pub const PRESENT_STATE: u16 = PRESENT_LOAD;
/// Present velocity.
pub const PRESENT_VELOCITY: u16 = of("present_velocity");
/// Present position.
pub const PRESENT_POSITION: u16 = of("present_position");
/// Velocity trajectory.
pub const VELOCITY_TRAJECTORY: u16 = of("velocity_trajectory");
/// Position trajectory.
pub const POSITION_TRAJECTORY: u16 = of("position_trajectory");
/// Present input voltage.
pub const PRESENT_INPUT_VOLTAGE: u16 = of("present_input_voltage");
/// Present temperature.
pub const PRESENT_TEMPERATURE: u16 = of("present_temperature");
/// Backup ready.
pub const BACKUP_READY: u16 = of("backup_ready");
