//! A gait over the ground: where feet and body are at each instant of the cycle.

use super::clip::RootAdvance;
use super::gait::{GaitDescription, GaitName};
use super::gait_stance::{Stance, Walker};
use super::smooth::ease;
use nalgebra::{Isometry2, Point2, Point3, Vector2};
use std::f64::consts::TAU;

/// Touch-down phase of a leg, as given or as its preset has it.
pub(super) fn phase_of(description: &GaitDescription, leg: &str) -> Option<f64> {
    let preset = || description.gait.and_then(|g| g.phase(leg));
    description.phase.get(leg).copied().or_else(preset)
}

/// Foot and body paths of a gait over the ground, in the travelling frame.
pub(super) struct Plan {
    pub root: RootAdvance,
    pub phases: Vec<f64>,
    neutral: Vec<Point3<f64>>,
    pub duty: f64,
    lift_m: f64,
    level: [f64; 6],
    sway_m: f64,
    sway_roll_rad: f64,
    bob_m: f64,
    /// Phase at which the body is farthest to the left, fraction of the cycle.
    sway_phase: f64,
}

impl Plan {
    pub fn new(
        description: &GaitDescription,
        walker: Walker<'_>,
        stance: &Stance<'_>,
        kept: f64,
    ) -> Self {
        let preset = description.gait.unwrap_or(GaitName::Stand);
        let still = description.gait == Some(GaitName::Stand);
        let duty = description
            .duty_factor
            .unwrap_or_else(|| preset.duty_factor());
        let sprawls = walker.legs.iter().any(|l| l.sprawls(walker.facing));
        let of_leg = |part: f64| {
            if still {
                0.0
            } else {
                part * stance.leg_length_m
            }
        };
        let default_stride = of_leg(if sprawls { 0.3 } else { 0.5 });
        let phases: Vec<f64> = walker
            .legs
            .iter()
            .map(|l| phase_of(description, &l.name).unwrap_or(0.0))
            .collect();
        Self {
            root: RootAdvance {
                forward_m: kept * description.stride_m.unwrap_or(default_stride),
                left_m: kept * description.left_m,
                yaw_rad: kept * description.turn_rad,
            },
            sway_phase: carrying_side(&phases, &stance.neutral, duty),
            phases,
            neutral: stance.neutral.clone(),
            duty,
            lift_m: kept * description.step_height_m.unwrap_or(of_leg(0.12)),
            level: stance.level(),
            sway_m: kept * description.sway_m,
            sway_roll_rad: kept * description.sway_roll_rad,
            bob_m: kept * description.bob_m,
        }
    }

    /// Where foot `leg` is at `cycle`, travelling frame, z = 0 on the ground.
    ///
    /// The travelling frame moves by exp(xi u), with xi the advance of one cycle as a twist of the
    /// plane. A foot at rest is then exp(-xi u) of where it was: an arc, exactly, when the body turns.
    pub fn foot(&self, leg: usize, cycle: f64) -> Point3<f64> {
        let (sweep, height) = foot_path(cycle - self.phases[leg], self.duty);
        let neutral = self.neutral[leg];
        let at = advance(&self.root, sweep * self.duty) * Point2::new(neutral.x, neutral.y);
        Point3::new(at.x, at.y, height * self.lift_m)
    }

    /// Place of the body at `cycle`, travelling frame.
    pub fn body(&self, cycle: f64) -> [f64; 6] {
        let mut body = self.level;
        let sway = (TAU * (cycle - self.sway_phase)).cos();
        body[1] += self.sway_m * sway;
        body[2] += self.bob_m * (2.0 * TAU * (cycle - self.sway_phase)).cos();
        body[3] -= self.sway_roll_rad * sway;
        body
    }
}

/// Pose in the plane after `part` of the advance of a cycle, moving steadily: exp of the twist.
fn advance(root: &RootAdvance, part: f64) -> Isometry2<f64> {
    let (x, y, angle) = (
        root.forward_m * part,
        root.left_m * part,
        root.yaw_rad * part,
    );
    // sin(a)/a and (1 - cos(a))/a.
    let (s, c) = if angle.abs() < 1e-6 {
        (1.0, 0.5 * angle)
    } else {
        (angle.sin() / angle, (1.0 - angle.cos()) / angle)
    };
    Isometry2::new(Vector2::new(s * x - c * y, c * x + s * y), angle)
}

/// Phase at which the left side carries most: the first harmonic of the feet on the ground, left
/// counted positive. Where that is nothing (a trot), mid-stance of the first leg.
fn carrying_side(phases: &[f64], neutral: &[Point3<f64>], duty: f64) -> f64 {
    let (mut cos, mut sin) = (0.0, 0.0);
    for (phase, foot) in phases.iter().zip(neutral) {
        let angle = TAU * (phase + 0.5 * duty);
        cos += foot.y.signum() * angle.cos();
        sin += foot.y.signum() * angle.sin();
    }
    if cos.hypot(sin) < 1e-6 {
        return phases.first().map_or(0.0, |p| p + 0.5 * duty);
    }
    sin.atan2(cos) / TAU
}

/// Foot path at `cycle` (fraction since touch-down): sweep in -0.5..0.5 of the stance way (front is
/// positive) and height in 0..1 of the step height.
///
/// Stance is steady; swing is the quintic that leaves and meets the ground at stance speed with no
/// acceleration, so a foot neither scuffs nor stamps.
fn foot_path(cycle: f64, duty: f64) -> (f64, f64) {
    let u = cycle.rem_euclid(1.0);
    if duty >= 1.0 {
        return (0.0, 0.0);
    }
    if u < duty {
        return (0.5 - u / duty, 0.0);
    }
    let w = (u - duty) / (1.0 - duty);
    // Going on at stance speed would carry the foot back by `drift` more; the ease brings it forward.
    let drift = (1.0 - duty) / duty;
    let sweep = -0.5 - drift * w + (1.0 + drift) * ease(w);
    let bump = w * (1.0 - w);
    (sweep, 64.0 * bump * bump * bump)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn foot_path_is_smooth_over_the_whole_cycle() {
        for duty in [0.35, 0.5, 0.7] {
            let h = 1e-4;
            let mut jump: f64 = 0.0;
            let mut u = 0.0;
            while u < 1.0 {
                let s = |u: f64| foot_path(u, duty).0;
                let left = (s(u) - s(u - h)) / h;
                let right = (s(u + h) - s(u)) / h;
                jump = jump.max((right - left).abs());
                u += h;
            }
            assert!(jump < 0.05, "speed jumps by {jump} cycles at duty {duty}");
        }
    }

    #[test]
    fn steps_of_the_advance_add_up() {
        let root = RootAdvance {
            forward_m: 0.3,
            left_m: -0.1,
            yaw_rad: 0.8,
        };
        let twice = advance(&root, 0.5) * advance(&root, 0.5);
        let once = advance(&root, 1.0);
        let off = (twice.translation.vector - once.translation.vector).norm();
        assert!(off < 1e-12, "{off} m");
        let straight = RootAdvance {
            yaw_rad: 1e-9,
            ..root
        };
        let at = advance(&straight, 1.0).translation.vector;
        assert!((at - Vector2::new(0.3, -0.1)).norm() < 1e-8, "{at}");
    }
}
