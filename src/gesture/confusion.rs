//! Who answers to whom: every gesture performed through the whole front end, and what every gesture reads.
//!
//! Planes that look well apart ([`super::responses`]) may still answer to one another once filters, speeds
//! and sizes come in, so the judgement is made by playing: the reference looped at 0.5, 1 and 1.5 times its
//! speed and at half and full size (about its mean pose; about its rest pose where it does not repeat).

use super::{
    FrontEnd, FrontEndError, FrontEndOptions, Gesture, GestureKind, GestureSet, References,
};
use crate::pose::PoseSample;
use nalgebra::{DMatrix, DVector};

/// What to do about gestures that are confused.
const APART: &str = "make them differ more, or put them more than two edges apart";
/// Speeds at which gestures are performed, in parts of the reference's.
pub const SPEEDS: [f64; 3] = [0.5, 1.0, 1.5];
/// Sizes at which gestures are performed, in parts of the reference's.
pub const SIZES: [f64; 2] = [0.5, 1.0];
/// An amplitude above this starts a transition (Rhodin 2016, section 9.5.1).
pub const STARTS: f64 = 0.2;
/// A gesture that reads less than this of itself is weak.
const WEAK: f64 = 0.6;
/// One that reads more than this of itself was not shown steadily.
const UNEVEN: f64 = 1.15;
/// A direction with less than this share of the largest one's energy is not a gesture's own.
const LEAST_DIRECTION: f64 = 0.02;
/// A gesture of which another one makes this share as well is its twin.
const TWIN: f64 = 0.85;
/// Samples per second of the performance.
const RATE_HZ: f64 = 60.0;
/// Periods that pass before a reading counts, and periods of reading.
const SETTLE_PERIODS: f64 = 2.5;
const READ_PERIODS: f64 = 1.5;
/// Time at rest and at the extreme of a gesture that does not repeat, seconds.
const HELD_S: f64 = 1.0;
/// What the estimators can follow, hertz.
const FOLLOWED_HZ: (f64, f64) = (0.2, 6.0);

/// What one gesture read while one was performed.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Reading {
    /// Index of the gesture that was performed.
    pub performed: usize,
    /// At this part of its reference's speed.
    pub speed: f64,
    /// At this part of its reference's size.
    pub size: f64,
    /// Index of the gesture that was read.
    pub read: usize,
    /// Mean amplitude (mean absolute progression where it does not repeat).
    pub mean: f64,
    /// Largest amplitude, which is what starts a motion.
    pub largest: f64,
}

/// How a gesture fares among the others.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Index of the gesture.
    pub gesture: usize,
    /// What it reads of itself at its own speed and size; 1 is right.
    pub own: f64,
    /// The least it reads of itself at full size over all speeds.
    pub least_own: f64,
    /// Other gestures with which it is confused: index, what that one reads while this one is performed, and
    /// what this one reads while that one is performed.
    pub confused: Vec<(usize, f64, f64)>,
    /// False when it can start nothing.
    pub works: bool,
    /// The judgement with advice.
    pub words: String,
}

/// All readings.
#[derive(Clone, Debug, PartialEq)]
pub struct Confusion {
    /// One per gesture performed, speed, size and gesture read, in this order.
    pub readings: Vec<Reading>,
    names: Vec<String>,
    kinds: Vec<GestureKind>,
    /// Per gesture the share of its movement that each other one makes as well.
    likeness: Vec<Vec<f64>>,
}

/// Root mean square movement per point of every gesture, metres, without global motion.
///
/// # Errors
/// The name of an anchor that the set does not have.
pub fn sizes_m(set: &GestureSet) -> Result<Vec<f64>, String> {
    let references = References::new(set)?;
    let points = set.header.points.len().max(1) as f64;
    let size = |(rows, mean): (&Vec<DVector<f64>>, &DVector<f64>)| {
        let sum: f64 = rows.iter().map(|row| (row - mean).norm_squared()).sum();
        (sum / (rows.len().max(1) as f64 * points)).sqrt()
    };
    Ok(references
        .local
        .iter()
        .zip(&references.mean)
        .map(size)
        .collect())
}

/// Per gesture the share of its movement, 0 to 1, that lies in the directions in which each other one moves.
///
/// Estimators keep twins silent rather than start both: then nothing is read of either, and only this tells
/// why.
fn likeness(set: &GestureSet) -> Result<Vec<Vec<f64>>, String> {
    let references = References::new(set)?;
    let centred: Vec<DMatrix<f64>> = (references.local.iter().zip(&references.mean))
        .map(|(rows, mean)| {
            let rows: Vec<DVector<f64>> = rows.iter().map(|row| row - mean).collect();
            DMatrix::from_columns(&rows)
        })
        .collect();
    let directions: Vec<DMatrix<f64>> = centred
        .iter()
        .map(|frames| {
            // Of the coordinates' covariance, which is small however many frames there are.
            let eigen = (frames * frames.transpose()).symmetric_eigen();
            let largest = eigen.eigenvalues.max();
            let kept: Vec<DVector<f64>> = (eigen.eigenvectors.column_iter())
                .zip(eigen.eigenvalues.iter())
                .filter(|(_, value)| **value > LEAST_DIRECTION * largest)
                .map(|(direction, _)| direction.into_owned())
                .collect();
            if kept.is_empty() {
                DMatrix::zeros(frames.nrows(), 1)
            } else {
                DMatrix::from_columns(&kept)
            }
        })
        .collect();
    let share = |frames: &DMatrix<f64>, along: &DMatrix<f64>| {
        let whole = frames.norm_squared().max(1e-300);
        (along.transpose() * frames).norm_squared() / whole
    };
    let row = |frames| {
        directions
            .iter()
            .map(|along| share(frames, along))
            .collect()
    };
    Ok(centred.iter().map(row).collect())
}

/// Performs every gesture of `set` and reads all of them.
///
/// Speeds at which a gesture would be slower or faster than the estimators follow are left out.
///
/// # Errors
/// No gesture, an anchor that is no point, options out of range.
pub fn confusion(set: &GestureSet, options: FrontEndOptions) -> Result<Confusion, FrontEndError> {
    played(set, options, None)
}

/// The same as far as gesture `index` is concerned: the others are performed only as they were shown.
///
/// # Errors
/// As [`confusion`].
pub fn confusion_of(
    set: &GestureSet,
    options: FrontEndOptions,
    index: usize,
) -> Result<Confusion, FrontEndError> {
    played(set, options, Some(index))
}

fn played(
    set: &GestureSet,
    options: FrontEndOptions,
    only: Option<usize>,
) -> Result<Confusion, FrontEndError> {
    let mut readings = Vec::new();
    let mut front = FrontEnd::new(set, &set.header, options)?;
    for (performed, gesture) in set.gestures.iter().enumerate() {
        for speed in SPEEDS {
            let frequency_hz = speed / gesture.duration_s;
            let follows = (FOLLOWED_HZ.0..=FOLLOWED_HZ.1).contains(&frequency_hz);
            if gesture.kind == GestureKind::Cyclic && !follows {
                continue;
            }
            for size in SIZES {
                let as_shown = speed == 1.0 && size == 1.0;
                if only.is_some_and(|only| only != performed) && !as_shown {
                    continue;
                }
                let read = perform(&mut front, gesture, speed, size);
                readings.extend(read.into_iter().enumerate().map(|(read, (mean, largest))| {
                    Reading {
                        performed,
                        speed,
                        size,
                        read,
                        mean,
                        largest,
                    }
                }));
            }
        }
    }
    Ok(Confusion {
        readings,
        names: set.gestures.iter().map(|g| g.name.clone()).collect(),
        kinds: set.gestures.iter().map(|g| g.kind).collect(),
        likeness: likeness(set).map_err(|anchor| FrontEndError::Anchor { anchor })?,
    })
}

/// Mean and largest reading of every gesture while `gesture` is performed.
fn perform(front: &mut FrontEnd, gesture: &Gesture, speed: f64, size: f64) -> Vec<(f64, f64)> {
    front.reset();
    let length_s = gesture.duration_s / speed;
    let (from, to) = match gesture.kind {
        GestureKind::Cyclic => {
            let settled = (SETTLE_PERIODS * length_s).max(1.0);
            (settled, settled + READ_PERIODS * length_s)
        }
        GestureKind::NonCyclic => (HELD_S, 4.0 * HELD_S + 2.0 * length_s),
    };
    let mut sums = vec![(0.0, 0.0_f64); front.estimates().len()];
    let home = home_of(gesture);
    let mut sample = PoseSample {
        points: vec![None; home.len()],
        ..PoseSample::default()
    };
    let mut count = 0.0;
    let steps = (to * RATE_HZ).ceil() as usize;
    for k in 0..steps {
        sample.t = k as f64 / RATE_HZ;
        let at_s = match gesture.kind {
            GestureKind::Cyclic => (sample.t * speed).rem_euclid(gesture.duration_s),
            GestureKind::NonCyclic => {
                // Rest, out, extreme, back, rest.
                let out = (sample.t - 2.0 * HELD_S) / length_s;
                let back = (sample.t - 3.0 * HELD_S - length_s) / length_s;
                (out.clamp(0.0, 1.0) - back.clamp(0.0, 1.0)) * gesture.duration_s
            }
        };
        place_at(gesture, &home, at_s, size, &mut sample.points);
        if front.push(&sample).is_err() || sample.t < from {
            continue;
        }
        count += 1.0;
        for (sum, estimate) in sums.iter_mut().zip(front.estimates()) {
            let amplitude = estimate.amplitude.abs();
            sum.0 += amplitude;
            sum.1 = sum.1.max(amplitude);
        }
    }
    let mean = |(sum, largest): (f64, f64)| (sum / f64::max(count, 1.0), largest);
    sums.into_iter().map(mean).collect()
}

/// The pose about which a gesture grows: its mean, or its rest.
fn home_of(gesture: &Gesture) -> Vec<[f64; 3]> {
    let frames = match gesture.kind {
        GestureKind::Cyclic => gesture.frames.as_slice(),
        GestureKind::NonCyclic => &gesture.frames[..gesture.frames.len().min(1)],
    };
    let mut home = vec![[0.0; 3]; frames.first().map_or(0, Vec::len)];
    for frame in frames {
        for (home, place) in home.iter_mut().zip(frame) {
            for (sum, value) in home.iter_mut().zip(place) {
                *sum += value / frames.len() as f64;
            }
        }
    }
    home
}

/// The pose `at_s` into the reference; past the last frame a cyclic gesture goes on to its first.
fn place_at(
    gesture: &Gesture,
    home: &[[f64; 3]],
    at_s: f64,
    size: f64,
    out: &mut [Option<[f64; 3]>],
) {
    let times = &gesture.times_s;
    let before = times.partition_point(|t| *t <= at_s).max(1) - 1;
    let (after, end_s) = match times.get(before + 1) {
        Some(t) => (before + 1, *t),
        None if gesture.kind == GestureKind::Cyclic => (0, gesture.duration_s),
        None => (before, gesture.duration_s + 1.0),
    };
    let u = ((at_s - times[before]) / (end_s - times[before]).max(1e-9)).clamp(0.0, 1.0);
    let pair = gesture.frames[before].iter().zip(&gesture.frames[after]);
    for ((out, home), (a, b)) in out.iter_mut().zip(home).zip(pair) {
        let place = |axis: usize| {
            let place = a[axis] + u * (b[axis] - a[axis]);
            home[axis] + size * (place - home[axis])
        };
        *out = Some([place(0), place(1), place(2)]);
    }
}

impl Confusion {
    /// The largest reading of `read` while `performed` is performed, over all speeds and sizes.
    pub fn largest(&self, performed: usize, read: usize) -> f64 {
        let pair = self.readings.iter();
        pair.filter(|r| r.performed == performed && r.read == read)
            .map(|r| r.largest)
            .fold(0.0, f64::max)
    }

    /// What a gesture reads of itself at full size, as (speed, reading).
    fn own(&self, gesture: usize) -> impl Iterator<Item = (f64, f64)> {
        let cyclic = self.kinds[gesture] == GestureKind::Cyclic;
        let own = self.readings.iter();
        own.filter(move |r| r.performed == gesture && r.read == gesture && r.size == 1.0)
            .map(move |r| (r.speed, if cyclic { r.mean } else { r.largest }))
    }

    /// A judgement on every gesture, with advice.
    pub fn verdicts(&self) -> Vec<Verdict> {
        (0..self.names.len()).map(|g| self.verdict(g)).collect()
    }

    fn verdict(&self, gesture: usize) -> Verdict {
        let others = (0..self.names.len()).filter(|other| *other != gesture);
        let pairs: Vec<(usize, f64, f64)> = others
            .clone()
            .map(|other| {
                let there = self.largest(gesture, other);
                (other, there, self.largest(other, gesture))
            })
            .collect();
        let own = (self.own(gesture))
            .find(|(speed, _)| *speed == 1.0)
            .map_or(0.0, |(_, own)| own);
        let (at_speed, least_own) =
            (self.own(gesture)).fold(
                (1.0, own),
                |least, now| if now.1 < least.1 { now } else { least },
            );
        // Twins share what one alone would read: against a weak gesture a small answer is no small one.
        let starts = STARTS.min(0.5 * own).max(0.02);
        let confused: Vec<(usize, f64, f64)> = pairs
            .into_iter()
            .filter(|(_, there, back)| there.max(*back) > starts)
            .collect();
        let name = &self.names[gesture];
        let mut words = Vec::new();
        let twin = (others.clone())
            .filter(|other| self.likeness[gesture][*other] > TWIN)
            .max_by(|a, b| {
                let like = |other: &usize| self.likeness[gesture][*other];
                like(a).total_cmp(&like(b))
            });
        let cause = match twin {
            Some(twin) => format!(
                "`{}` makes {:.0} % of its movement as well; {APART}",
                self.names[twin],
                100.0 * self.likeness[gesture][twin]
            ),
            None if confused.is_empty() => "show it larger and steadier".into(),
            None => "it shares its movement with others".into(),
        };
        if own < STARTS {
            words.push(format!(
                "`{name}` cannot work: performed as it was shown it reads {own:.2}, and {STARTS} starts a motion: {cause}"
            ));
        } else if own < WEAK {
            words.push(format!(
                "`{name}` is weak: performed as it was shown it reads {own:.2} instead of 1: {cause}"
            ));
        } else if own > UNEVEN {
            words.push(format!(
                "`{name}` reads {own:.2} of itself instead of 1: the example is uneven; show it again, steadily"
            ));
        } else if least_own < WEAK {
            words.push(format!(
                "`{name}` fades at {at_speed} of its speed, where it reads {least_own:.2}; perform it nearer to the speed at which it was shown"
            ));
        }
        for (other, there, back) in &confused {
            let other = &self.names[*other];
            words.push(if there.min(*back) > starts {
                format!("`{name}` and `{other}` answer to each other ({there:.2} and {back:.2}): {APART}")
            } else if there > back {
                format!("`{other}` answers {there:.2} while `{name}` is performed: {APART}")
            } else {
                format!("`{name}` answers {back:.2} while `{other}` is performed: {APART}")
            });
        }
        if words.is_empty() {
            let most = others
                .map(|other| self.largest(gesture, other))
                .fold(0.0, f64::max);
            words.push(if self.names.len() == 1 {
                format!("`{name}` is good: it reads {own:.2} of itself")
            } else {
                format!(
                    "`{name}` is good: it reads {own:.2} of itself, the others at most {most:.2}"
                )
            });
        }
        Verdict {
            gesture,
            own,
            least_own,
            confused,
            works: own >= STARTS,
            words: words.join("; "),
        }
    }
}
