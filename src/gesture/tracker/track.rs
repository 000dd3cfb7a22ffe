//! One point's recent way: where it should be next, and by how much it may be off.

/// Steps remembered for what is usual.
const STEPS: usize = 16;
/// The usual surprise is exceeded by this many of the remembered steps: robust against a few bad ones,
/// and not fooled by a wave whose samples fall on its turning points.
const LARGER_ONES: usize = 3;
/// With fewer steps than this nothing is known about what is usual.
const LEAST_STEPS: usize = 6;
/// A step may be this many times as surprising as usual.
const FACTOR: f64 = 4.0;
/// A way that ended longer ago says nothing about now, seconds.
const FORGET_S: f64 = 0.3;
/// Shorter steps do not tell an acceleration: noise over their square would be huge.
const LEAST_STEP_S: f64 = 1.0 / 240.0;

/// By how much a point may surprise even one that has been still, from the size of the gestures.
#[derive(Copy, Clone, Debug)]
pub(super) struct Allowance {
    /// Always allowed, metres.
    pub still_m: f64,
    /// Movement may set in with this acceleration, m/s^2.
    pub onset_m_s2: f64,
}

/// How a place compares with what was expected.
#[derive(Copy, Clone, Debug)]
pub(super) struct Surprise {
    /// Distance from the nearer of two guesses: it stays where it was, it goes on as it went; metres.
    pub off_m: f64,
    /// What is within reason, metres; infinite while nothing is known.
    pub allowed_m: f64,
    /// Time factor that turns `off_m` into an acceleration, s^2; zero when it is not to be learnt from.
    span_s2: f64,
}

impl Surprise {
    /// Whether the place is within reason.
    pub fn fits(&self) -> bool {
        self.off_m <= self.allowed_m
    }
}

#[derive(Copy, Clone, Debug)]
struct Fix {
    t: f64,
    place: [f64; 3],
}

/// The recent way of one point, in the tracker's frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    last: Option<Fix>,
    before: Option<Fix>,
    /// Distance and acceleration of the last surprises.
    steps: [(f64, f64); STEPS],
    count: usize,
    next: usize,
}

impl Track {
    /// Compares `place` at `t` with what was expected. Changes nothing.
    pub fn judge(&self, t: f64, place: [f64; 3], allowance: Allowance) -> Surprise {
        let unknown = Surprise {
            off_m: 0.0,
            allowed_m: f64::INFINITY,
            span_s2: 0.0,
        };
        let (Some(last), Some(before)) = (self.last, self.before) else {
            return unknown;
        };
        let (step, step_before) = (t - last.t, last.t - before.t);
        let known = step > 0.0 && step_before > 0.0;
        if !known || step > FORGET_S || step_before > FORGET_S {
            return unknown;
        }
        let ratio = step / step_before;
        let (mut stays, mut goes_on) = (0.0, 0.0);
        for ((now, last), before) in place.iter().zip(&last.place).zip(&before.place) {
            let moved = now - last;
            let expected = ratio * (last - before);
            stays += moved * moved;
            goes_on += (moved - expected) * (moved - expected);
        }
        // A movement of acceleration a leaves its straight way by a times this.
        let span_s2 = 0.5 * step.max(LEAST_STEP_S) * (step + step_before).max(LEAST_STEP_S);
        let allowed_m = if self.count < LEAST_STEPS {
            f64::INFINITY
        } else {
            let (usual_m, usual_m_s2) = self.usual();
            let moving = FACTOR * usual_m.max(usual_m_s2 * span_s2);
            allowance.still_m + moving.max(allowance.onset_m_s2 * span_s2)
        };
        Surprise {
            off_m: stays.min(goes_on).sqrt(),
            allowed_m,
            span_s2,
        }
    }

    /// Usual surprise in metres and as an acceleration.
    fn usual(&self) -> (f64, f64) {
        let larger = LARGER_ONES.min(self.count / 3);
        let of = |value: fn(&(f64, f64)) -> f64| {
            let mut largest = [0.0; LARGER_ONES + 1];
            for step in &self.steps[..self.count] {
                let value = value(step);
                let at = largest.partition_point(|other| *other >= value);
                if at < largest.len() {
                    largest[at..].rotate_right(1);
                    largest[at] = value;
                }
            }
            largest[larger]
        };
        (of(|step| step.0), of(|step| step.1))
    }

    /// Goes on to `place`, which was judged to be `surprise`.
    pub fn take(&mut self, t: f64, place: [f64; 3], surprise: Surprise) {
        if surprise.span_s2 > 0.0 {
            self.steps[self.next] = (surprise.off_m, surprise.off_m / surprise.span_s2);
            self.next = (self.next + 1) % STEPS;
            self.count = (self.count + 1).min(STEPS);
        }
        self.before = self.last;
        self.last = Some(Fix { t, place });
    }

    /// Begins anew at `place`; what is usual stays when `keep_usual`.
    pub fn restart(&mut self, t: f64, place: [f64; 3], keep_usual: bool) {
        self.before = None;
        self.last = Some(Fix { t, place });
        if !keep_usual {
            self.count = 0;
            self.next = 0;
        }
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}
