//! Angles on the circle.

use std::f64::consts::{PI, TAU};

/// `angle_rad` brought into [-pi, pi).
pub fn wrap_pi(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(TAU) - PI
}

/// `angle_rad` brought into [0, 2 pi).
pub fn wrap_tau(angle_rad: f64) -> f64 {
    let wrapped = angle_rad.rem_euclid(TAU);
    // rem_euclid of a tiny negative number rounds up to the modulus itself.
    if wrapped >= TAU { 0.0 } else { wrapped }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrapped_angles_stay_inside_their_half_open_range() {
        for angle in [-1e-18, 0.0, PI, -PI, TAU, 1e6, -1e6] {
            let pi = wrap_pi(angle);
            let tau = wrap_tau(angle);
            assert!((-PI..=PI).contains(&pi), "{angle} -> {pi}");
            assert!((0.0..TAU).contains(&tau), "{angle} -> {tau}");
        }
    }
}
