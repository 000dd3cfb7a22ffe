//! Inertialisation: what a jump between poses leaves is carried on and faded out.
//!
//! Parametric motion graph, section 7 ("the jump itself"): at a jump the difference of the two poses and
//! its rate are taken, and a quintic that starts with them and ends with nothing is added to the target.

use super::smooth::eased_span_s;
use crate::body::PoseSpace;

/// A fading difference between what is shown and what is played.
#[derive(Clone, Debug)]
pub struct Inertia {
    /// Difference at the jump, tangent coordinates.
    offset: Vec<f64>,
    /// Its rate at the jump, per second.
    rate: Vec<f64>,
    faded: Vec<f64>,
    since_s: f64,
    span_s: f64,
}

impl Inertia {
    /// For a body; nothing to fade.
    pub fn new(space: &dyn PoseSpace) -> Self {
        let n = space.tangent_len();
        Self {
            offset: vec![0.0; n],
            rate: vec![0.0; n],
            faded: vec![0.0; n],
            since_s: 0.0,
            span_s: 0.0,
        }
    }

    /// Whether something is being faded.
    pub fn active(&self) -> bool {
        self.since_s < self.span_s
    }

    /// Largest difference still shown, in the space's tangent units.
    pub fn size(&self) -> f64 {
        if self.active() {
            self.faded.iter().fold(0.0, |m, v| m.max(v.abs()))
        } else {
            0.0
        }
    }

    /// Whether something is being faded, and the part of it that is left, 0..1.
    pub fn left(&self) -> f64 {
        if self.active() {
            1.0 - super::smooth::ease(self.since_s / self.span_s)
        } else {
            0.0
        }
    }

    /// Takes up a jump: `shown` are the poses of the last step and of the one before it, `dt_s` apart, as they
    /// were shown; `played` those of the motion that is played from now on, at the same two instants. Faded over
    /// at least `span_s`.
    ///
    /// `fastest`: most that each tangent coordinate may be moved by the fade, (per second, per second
    /// squared); coordinates beyond its end are free.
    #[allow(clippy::too_many_arguments, reason = "two motions at two instants")]
    pub fn take_up(
        &mut self,
        space: &dyn PoseSpace,
        shown: (&[f64], &[f64]),
        played: (&[f64], &[f64]),
        dt_s: f64,
        span_s: f64,
        fastest: &[(f64, f64)],
    ) {
        space.diff(played.1, shown.1, &mut self.rate);
        space.diff(played.0, shown.0, &mut self.offset);
        for (rate, offset) in self.rate.iter_mut().zip(&self.offset) {
            *rate = if dt_s > 0.0 {
                (offset - *rate) / dt_s
            } else {
                0.0
            };
        }
        self.since_s = 0.0;
        self.span_s = span_s;
        for ((offset, rate), (v, a)) in self.offset.iter().zip(&self.rate).zip(fastest) {
            // The rate must be braked too.
            self.span_s = self
                .span_s
                .max(eased_span_s(*offset, *v, *a))
                .max(3.0 * rate.abs() / a);
        }
        self.faded.copy_from_slice(&self.offset);
    }

    /// One step of `dt_s`: adds what is left of the difference to `pose`. Allocates nothing.
    pub fn step(&mut self, space: &dyn PoseSpace, dt_s: f64, pose: &mut [f64]) {
        if !self.active() {
            return;
        }
        self.since_s += dt_s;
        let u = (self.since_s / self.span_s).min(1.0);
        let (keep, carry) = quintic(u);
        for ((faded, offset), rate) in self.faded.iter_mut().zip(&self.offset).zip(&self.rate) {
            *faded = offset * keep + rate * self.span_s * carry;
        }
        space.add(pose, &self.faded, 1.0);
    }
}

/// The quintics from (1, slope 0) and from (0, slope 1) to nothing, with no curvature at either end.
fn quintic(u: f64) -> (f64, f64) {
    let u3 = u * u * u;
    let keep = 1.0 - u3 * (10.0 + u * (6.0 * u - 15.0));
    let carry = u + u3 * (-6.0 + u * (8.0 - 3.0 * u));
    (keep, carry)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::JointSpace;

    #[test]
    fn a_jump_between_moving_poses_is_shown_without_a_step_in_place_or_speed() {
        let space = JointSpace::fixed(&["a".into()]);
        let dt = 0.005;
        // Shown: falling at 1 rad/s from 0.4; played: rising at 0.5 rad/s from 0.
        let shown = |t: f64| [0.4 - t];
        let played = |t: f64| [0.5 * t];
        let mut inertia = Inertia::new(&space);
        inertia.take_up(
            &space,
            (&shown(0.0), &shown(-dt)),
            (&played(0.0), &played(-dt)),
            dt,
            0.3,
            &[(3.0, 40.0)],
        );
        let (mut last, mut speed) = (0.4, -1.0);
        let (mut steepest, mut fastest): (f64, f64) = (0.0, 0.0);
        let mut t = 0.0;
        while t < 1.0 {
            t += dt;
            let mut pose = played(t);
            inertia.step(&space, dt, &mut pose);
            let now = (pose[0] - last) / dt;
            steepest = steepest.max((now - speed).abs() / dt);
            fastest = fastest.max(now.abs());
            (last, speed) = (pose[0], now);
        }
        assert!(steepest < 40.0, "acceleration {steepest:.1} rad/s^2");
        assert!(fastest < 3.0, "speed {fastest:.2} rad/s");
        assert!(
            (last - played(t)[0]).abs() < 1e-12,
            "ends {} off",
            last - played(t)[0]
        );
    }

    #[test]
    fn the_quintics_start_and_end_as_promised() {
        let h = 1e-5;
        for (u, value, slope) in [(0.0, (1.0, 0.0), (0.0, 1.0)), (1.0, (0.0, 0.0), (0.0, 0.0))] {
            let (keep, carry) = quintic(u);
            let (a, b) = (quintic(u - h), quintic(u + h));
            assert!(
                (keep - value.0).abs() < 1e-12 && (carry - value.1).abs() < 1e-12,
                "at {u}"
            );
            let slopes = ((b.0 - a.0) / (2.0 * h), (b.1 - a.1) / (2.0 * h));
            assert!(
                (slopes.0 - slope.0).abs() < 1e-6 && (slopes.1 - slope.1).abs() < 1e-6,
                "at {u}: {slopes:?}"
            );
            let curve = (
                (a.0 - 2.0 * keep + b.0) / (h * h),
                (a.1 - 2.0 * carry + b.1) / (h * h),
            );
            assert!(
                curve.0.abs() < 1e-2 && curve.1.abs() < 1e-2,
                "at {u}: {curve:?}"
            );
        }
    }
}
