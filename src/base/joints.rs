//! What is known of a joint at one instant.

use super::time::Time;

/// Measured state of one joint, in joint coordinates (after zero and direction of its servo).
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct JointState {
    /// Position in radians (metres for prismatic joints).
    pub position: f64,
    /// Velocity in rad/s (m/s).
    pub velocity: f64,
    /// Effort as the servo reports it, and in its unit: share of the greatest load, -1..1, or current in ampere.
    pub effort: f64,
    /// When the values were measured; `None` while nothing was ever read.
    pub measured_at: Option<Time>,
}
