//! How good a motion is: feet that slide, sink or hang, joints that jerk. Pure functions of samples.
//!
//! Feet are given as places in the world and contact flags, sample by sample; [`world_feet`] makes
//! the places from poses and roots. Joints are given as rates, see [`rates`].

use crate::body::{Feet, PoseSpace, RootPose};
use nalgebra::Point3;

/// Places of `foot` in the world, one per frame of (root, pose), metres. Does not allocate.
pub fn world_feet<'a, P: AsRef<[f64]> + 'a>(
    feet: &'a dyn Feet,
    foot: usize,
    frames: impl IntoIterator<Item = (RootPose, P)> + 'a,
) -> impl Iterator<Item = Point3<f64>> + 'a {
    (frames.into_iter()).map(move |(root, pose)| root.to_world(feet.position(pose.as_ref(), foot)))
}

/// How far a foot moved over the ground while it was in contact.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct FootSlide {
    /// Number of stances.
    pub stances: usize,
    /// Longest way of one stance, metres.
    pub largest_m: f64,
    /// Mean way of a stance, metres.
    pub mean_m: f64,
}

/// Horizontal way of a foot in each stance: the sum of its steps between neighbouring samples that are
/// both in contact, so that wiggling counts as much as drifting.
///
/// `samples`: place in the world (m) and contact flag. A stance that is cut by the first or last sample
/// counts as one. A point that is not finite makes the figures infinite, not quietly small.
pub fn foot_slide(samples: impl IntoIterator<Item = (Point3<f64>, bool)>) -> FootSlide {
    let mut slide = FootSlide::default();
    let mut sum = 0.0;
    let mut stance: Option<(Point3<f64>, f64)> = None;
    let mut end = |way: f64| {
        slide.stances += 1;
        slide.largest_m = slide.largest_m.max(way);
        sum += way;
    };
    for (point, contact) in samples {
        stance = match (stance.take(), contact) {
            (None, true) => Some((point, 0.0)),
            (Some((before, way)), true) => {
                let step = (point.x - before.x).hypot(point.y - before.y);
                Some((point, way + or_infinite(step)))
            }
            (Some((_, way)), false) => {
                end(way);
                None
            }
            (None, false) => None,
        };
    }
    if let Some((_, way)) = stance {
        end(way);
    }
    slide.mean_m = sum / slide.stances.max(1) as f64;
    slide
}

fn or_infinite(v: f64) -> f64 {
    if v.is_finite() { v } else { f64::INFINITY }
}

/// How far a foot is from the ground where it should touch it, and in it where it should not.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct GroundError {
    /// Deepest below the ground, in contact or not, metres.
    pub penetration_m: f64,
    /// Highest above the ground while in contact, metres.
    pub hover_m: f64,
}

/// Penetration and hover of a foot over a ground at height `ground_m` (for joints above the sole: their
/// height when the foot stands).
pub fn ground_error(
    samples: impl IntoIterator<Item = (Point3<f64>, bool)>,
    ground_m: f64,
) -> GroundError {
    (samples.into_iter()).fold(GroundError::default(), |mut worst, (point, contact)| {
        let height = point.z - ground_m;
        worst.penetration_m = worst.penetration_m.max(or_infinite(-height));
        if contact {
            worst.hover_m = worst.hover_m.max(or_infinite(height));
        }
        worst
    })
}

/// What a hanging leg is, see [`hanging_share`].
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Hanging {
    /// Height of the foot in contact, metres.
    pub ground_m: f64,
    /// How high the foot is lifted in a proper step, metres: that of the examples, not of the motion
    /// under test, whose steps may be too low.
    pub step_height_m: f64,
    /// Below this share of the step height a foot does not clear the ground.
    pub low_share: f64,
    /// Faster than this over the ground a foot does not stand, m/s.
    pub speed_m_s: f64,
}

impl Hanging {
    /// Feet lower than a quarter of `step_height_m` and faster than a quarter of the body's speed.
    pub fn of_step(ground_m: f64, step_height_m: f64, body_speed_m_s: f64) -> Self {
        Self {
            ground_m,
            step_height_m,
            low_share: 0.25,
            speed_m_s: 0.25 * body_speed_m_s.abs(),
        }
    }
}

/// Share of the time, 0..1, in which a foot neither stands nor clears the ground: it is lower than
/// `low_share` of the step height and moves over the ground faster than `speed_m_s`.
///
/// Blending legs whose phases differ makes such feet: they skim the ground half-way through a step. A
/// proper gait has a little of it too, around lift-off and touch-down; compare with the examples'.
/// `points`: places in the world, `dt_s` apart; speeds are central differences.
pub fn hanging_share(points: &[Point3<f64>], dt_s: f64, hanging: &Hanging) -> f64 {
    let n = points.len();
    if n < 3 || !(dt_s > 0.0) {
        return 0.0;
    }
    let low = hanging.ground_m + hanging.low_share * hanging.step_height_m;
    let hangs = points.windows(3).filter(|w| {
        let speed = (w[2].x - w[0].x).hypot(w[2].y - w[0].y) / (2.0 * dt_s);
        w[1].z < low && speed > hanging.speed_m_s
    });
    hangs.count() as f64 / (n - 2) as f64
}

/// Rates of all coordinates between neighbouring poses of `space`: one row fewer than `poses`, `dt_s`
/// apart, per second (rotations as rotation vectors). Allocates: for offline use.
pub fn rates<P: AsRef<[f64]>>(space: &dyn PoseSpace, poses: &[P], dt_s: f64) -> Vec<Vec<f64>> {
    (poses.windows(2))
        .map(|w| {
            let mut rate = vec![0.0; space.tangent_len()];
            space.diff(w[0].as_ref(), w[1].as_ref(), &mut rate);
            rate.iter_mut().for_each(|v| *v /= dt_s);
            rate
        })
        .collect()
}

/// How smoothly one coordinate moves.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Smoothness {
    /// Highest speed, per second.
    pub speed: f64,
    /// Highest acceleration, per second squared.
    pub acceleration: f64,
    /// Highest jerk, per second cubed.
    pub jerk: f64,
    /// Root mean square of the jerk, per second cubed.
    pub rms_jerk: f64,
    /// Distance of lowest and highest position.
    pub range: f64,
}

/// The normalised jerk of a sine, `(2 pi)^3 / (2 sqrt 2)`.
const SINE_JERK: f64 = 87.699_963;

impl Smoothness {
    /// Dimensionless jerk `T^3 rms(jerk) / range` over that of a sine of period `period_s`: 1 for the
    /// smoothest cycle, the same at any size and tempo; 0 for a coordinate that stands.
    ///
    /// After Hogan and Sternad, Sensitivity of smoothness measures to movement duration, amplitude,
    /// and arrests (2009).
    pub fn normalised_jerk(&self, period_s: f64) -> f64 {
        if self.range > 1e-9 {
            period_s.powi(3) * self.rms_jerk / self.range / SINE_JERK
        } else {
            0.0
        }
    }
}

/// Speeds, accelerations and jerks of every coordinate, by differences of the rows of `rates`, `dt_s`
/// apart. `wraps`: the first row follows the last one.
///
/// Rows are as long as the first one, or the shortest counts; fewer than three rows have no jerk.
pub fn smoothness<R: AsRef<[f64]>>(rates: &[R], dt_s: f64, wraps: bool) -> Vec<Smoothness> {
    let n = rates.len();
    let width = rates.iter().map(|r| r.as_ref().len()).min().unwrap_or(0);
    if !(dt_s > 0.0) {
        return vec![Smoothness::default(); width];
    }
    let at = |k: usize, c: usize| rates[k % n].as_ref()[c];
    let count = |order: usize| {
        if wraps && n > 2 {
            n
        } else {
            n.saturating_sub(order)
        }
    };
    let largest = |m: f64, v: f64| m.max(or_infinite(v.abs()));
    (0..width)
        .map(|c| {
            let acceleration = |k: usize| (at(k + 1, c) - at(k, c)) / dt_s;
            let jerk = |k: usize| (at(k + 2, c) - 2.0 * at(k + 1, c) + at(k, c)) / dt_s.powi(2);
            let (mut position, mut low, mut high) = (0.0_f64, 0.0_f64, 0.0_f64);
            for k in 0..n {
                position += dt_s * at(k, c);
                low = low.min(position);
                high = high.max(position);
            }
            let squares: f64 = (0..count(2)).map(|k| jerk(k).powi(2)).sum();
            Smoothness {
                speed: (0..n).map(|k| at(k, c)).fold(0.0, largest),
                acceleration: (0..count(1)).map(acceleration).fold(0.0, largest),
                jerk: (0..count(2)).map(jerk).fold(0.0, largest),
                rms_jerk: or_infinite((squares / count(2).max(1) as f64).sqrt()),
                range: high - low,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::JointSpace;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    fn point(x: f64, y: f64, z: f64) -> Point3<f64> {
        Point3::new(x, y, z)
    }

    #[test]
    fn nothing_and_strange_numbers_give_nothing_or_infinity_but_no_panic() {
        assert_eq!(foot_slide([]), FootSlide::default());
        assert_eq!(ground_error([], 0.0), GroundError::default());
        let hanging = Hanging::of_step(0.0, 0.1, 1.0);
        assert_eq!(hanging_share(&[], 0.01, &hanging), 0.0);
        assert_eq!(
            hanging_share(&[point(0.0, 0.0, 0.0); 9], 0.0, &hanging),
            0.0
        );
        assert!(smoothness::<Vec<f64>>(&[], 0.01, true).is_empty());
        assert_eq!(
            smoothness(&[vec![1.0]], 0.0, false),
            vec![Smoothness::default()]
        );
        let lost = foot_slide([
            (point(0.0, 0.0, 0.0), true),
            (point(f64::NAN, 0.0, 0.0), true),
        ]);
        assert_eq!(lost.largest_m, f64::INFINITY, "a lost foot is no still one");
        let jump = smoothness(&[vec![0.0], vec![f64::NAN], vec![0.0]], 0.01, false);
        assert_eq!(jump[0].speed, f64::INFINITY);
    }

    #[test]
    fn two_stances_slide_as_far_as_they_were_pushed() {
        // Stands at 0, pushed 30 mm; flies; stands at 1 m, wiggles 5 mm there and back.
        let samples = [
            (0.0, true),
            (0.01, true),
            (0.03, true),
            (0.5, false),
            (1.0, true),
            (1.005, true),
            (1.0, true),
        ];
        let slide = foot_slide(samples.map(|(x, c)| (point(x, 0.2, 0.0), c)));
        assert_eq!(slide.stances, 2);
        assert!((slide.largest_m - 0.03).abs() < 1e-12, "{slide:?}");
        assert!((slide.mean_m - 0.02).abs() < 1e-12, "{slide:?}");
        let error = ground_error(
            [
                (point(0.0, 0.0, 0.012), true),
                (point(0.0, 0.0, -0.003), false),
            ],
            0.002,
        );
        assert!((error.hover_m - 0.010).abs() < 1e-12, "{error:?}");
        assert!((error.penetration_m - 0.005).abs() < 1e-12, "{error:?}");
    }

    #[test]
    fn a_sine_has_the_jerk_of_its_formula_and_normalised_jerk_one_at_any_size_and_tempo() {
        for (amplitude, period) in [(0.3, 0.5), (2.0, 3.0)] {
            let n = 400;
            let dt = period / f64::from(n);
            let poses: Vec<Vec<f64>> = (0..=n)
                .map(|k| vec![amplitude * (TAU * f64::from(k) / f64::from(n)).sin()])
                .collect();
            let space = JointSpace::fixed(&["a".to_string()]);
            let found = smoothness(&rates(&space, &poses, dt), dt, true)[0];
            let w = TAU / period;
            for (what, value, wanted) in [
                ("speed", found.speed, amplitude * w),
                ("acceleration", found.acceleration, amplitude * w * w),
                ("jerk", found.jerk, amplitude * w.powi(3)),
                ("normalised", found.normalised_jerk(period), 1.0),
            ] {
                let off = (value / wanted - 1.0).abs();
                assert!(
                    off < 2e-3,
                    "{what} of {amplitude} rad at {period} s: {value}, {wanted} expected"
                );
            }
        }
    }

    /// A foot that stands half the cycle under a body at 1 m/s and swings back 60 mm high.
    fn step(u: f64, height: f64) -> (f64, f64) {
        let u = u.rem_euclid(1.0);
        if u < 0.5 {
            (0.25 - u, 0.0)
        } else {
            let s = 2.0 * (u - 0.5);
            let eased = s * s * (3.0 - 2.0 * s);
            (-0.25 + 0.5 * eased, height * (0.5 * TAU * s).sin())
        }
    }

    #[test]
    fn averaging_a_leg_with_its_opposite_hangs_and_a_proper_step_hardly() {
        let dt = 0.005;
        let walk = |other: f64| -> Vec<Point3<f64>> {
            (0..400)
                .map(|k| {
                    let t = f64::from(k) * dt;
                    let (a, b) = (step(t, 0.06), step(t + other, 0.06));
                    point(t + 0.5 * (a.0 + b.0), 0.0, 0.5 * (a.1 + b.1))
                })
                .collect()
        };
        let hanging = Hanging {
            low_share: 0.55,
            ..Hanging::of_step(0.0, 0.06, 1.0)
        };
        let proper = hanging_share(&walk(0.0), dt, &hanging);
        let blended = hanging_share(&walk(0.5), dt, &hanging);
        assert!(proper < 0.2, "a proper step hangs {proper:.2} of the cycle");
        assert!(blended > 0.9, "opposite legs hang {blended:.2}");
    }

    proptest! {
        #[test]
        fn moving_the_world_changes_no_slide(
            steps in proptest::collection::vec((-0.05..0.05f64, any::<bool>()), 1..40), yaw in -3.0..3.0f64, x in -9.0..9.0f64,
        ) {
            let root = RootPose { x_m: x, y_m: 0.5 * x, yaw_rad: yaw };
            let samples: Vec<(Point3<f64>, bool)> = steps.iter().enumerate()
                .map(|(k, (d, c))| (point(*d, 0.01 * k as f64, *d), *c)).collect();
            let here = foot_slide(samples.iter().copied());
            let there = foot_slide(samples.iter().map(|(p, c)| (root.to_world(*p), *c)));
            prop_assert_eq!(here.stances, there.stances);
            prop_assert!((here.largest_m - there.largest_m).abs() < 1e-9);
            prop_assert!(here.mean_m <= here.largest_m + 1e-12);
        }
    }
}
