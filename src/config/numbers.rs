//! The ranges of the numbers of a configuration that stand alone.

use super::error::{ConfigError, Pointer};
use super::file::CharacterFile;

/// Checks that every number lies in its range; the error names the key and what is allowed.
pub(super) fn check_numbers(file: &CharacterFile, at: &Pointer<'_>) -> Result<(), ConfigError> {
    let s = &file.safety;
    let g = &file.graph;
    let (robot, avatar) = (file.robot.as_ref(), file.avatar.as_ref());
    // Those of further buses are checked with their names.
    let bus = file.bus.as_ref().and_then(|buses| buses.0.first());
    let checks = [
        ("input.window", file.input.window, 0.1, 2.0),
        (
            "robot.acceleration_rad_s2",
            robot.map(|r| r.acceleration_rad_s2),
            1.0,
            1e5,
        ),
        (
            "robot.velocity_share",
            robot.map(|r| r.velocity_share),
            0.01,
            1.0,
        ),
        ("bus.rate_hz", bus.map(|b| b.rate_hz), 10.0, 2000.0),
        ("bus.baud", bus.map(|b| f64::from(b.baud)), 9600.0, 4.5e6),
        ("avatar.rate_hz", avatar.map(|a| a.rate_hz), 10.0, 2000.0),
        ("avatar.unit_m", avatar.and_then(|a| a.unit_m), 1e-6, 1e3),
        (
            "bus.watchdog_ms",
            bus.map(|b| f64::from(b.watchdog_ms)),
            0.0,
            2540.0,
        ),
        ("safety.ramp_s", Some(s.ramp_s), 0.1, 60.0),
        ("safety.end_ramp_s", Some(s.end_ramp_s), 0.1, 60.0),
        (
            "safety.actuation_delay_s",
            Some(s.actuation_delay_s),
            0.0,
            0.5,
        ),
        ("safety.coast_s", Some(s.coast_s), 0.0, 10.0),
        ("safety.lost_s", Some(s.lost_s), s.coast_s + 0.05, 60.0),
        ("graph.rise", g.rise, 0.01, 1.0),
        ("graph.release", g.release, 0.01, 1.0),
        ("graph.abort", g.abort, 0.0, g.rise.unwrap_or(0.2)),
        ("graph.blend_s", g.blend_s, 0.1, 10.0),
        ("graph.idle_s", g.idle_s, 0.0, 60.0),
        ("view.refresh_hz", Some(file.view.refresh_hz), 1.0, 120.0),
    ];
    for (key, value, low, high) in checks {
        if let Some(v) = value
            && !(v >= low && v <= high)
        {
            return Err(at.key(key, format!("{v} is not in {low}..{high}")));
        }
    }
    Ok(())
}
