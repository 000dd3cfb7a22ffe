//! Synthetic performers: points that move in waves, gestures defined from one clean period of them.

use crate::base::angle::wrap_pi;
use crate::base::random::SplitMix;
use crate::gesture::{CyclicMarks, DefineError, GestureSet, Plane, References, define_cyclic};
use crate::pose::{PoseHeader, PoseSample, Recording};
use nalgebra::{Matrix2, Vector2};
use std::f64::consts::TAU;

/// Rate and length of the clean recording that gestures are defined from.
const SHOWN_HZ: f64 = 60.0;
const SHOWN_S: f64 = 3.2;
/// A component whose share of the noise is below this one of the other's is blind (a line's second
/// component): noise that would reach it had to be absurdly large on the points.
const BLIND: f64 = 0.01;
/// Step of the numerical derivative in metres.
const STEP_M: f64 = 1e-4;

/// One movement: every point's displacement is `cosine` cos(phase) + `sine` sin(phase), metres.
#[derive(Clone, Debug)]
struct Movement {
    name: &'static str,
    cosine: Vec<[f64; 3]>,
    sine: Vec<[f64; 3]>,
}

/// What one gesture is doing at an instant.
#[derive(Copy, Clone, Debug, Default, PartialEq)]
pub struct Doing {
    /// Size, 1 = as shown.
    pub amplitude: f64,
    /// Phase of the performer's own movement in radians.
    pub phase_rad: f64,
    /// Size of a second harmonic, as a share of the amplitude.
    pub harmonic: f64,
    /// Held displacement along the movement's cosine, 1 = as far as the movement goes.
    pub offset: f64,
}

/// How white noise on the points reaches one gesture's plane: along each axis of the noise there,
/// what every coordinate does to it, and the sum of squares of that. Blind axes are left out.
type NoiseMap = Vec<(Vec<f64>, f64)>;

/// A body of points that performs gestures; knows what its planes should read.
#[derive(Clone, Debug)]
pub struct Performer {
    /// The gestures, each defined from one clean period.
    pub set: GestureSet,
    /// Points of the stream.
    pub header: PoseHeader,
    rest: Vec<[f64; 3]>,
    movements: Vec<Movement>,
    /// Phase on the plane minus the performer's own, per gesture.
    phase_offsets_rad: Vec<f64>,
    noise: Vec<NoiseMap>,
    references: Option<References>,
    planes: Vec<Plane>,
}

impl Performer {
    /// A figure of six points whose right hand moves in a circle of 20 cm, the elbow by half.
    ///
    /// # Errors
    /// The movement makes no gesture (does not happen with these).
    pub fn arm_loop() -> Result<Self, DefineError> {
        Self::new(&FIGURE, vec![right_arm("wave", 0.2)])
    }

    /// The same hand up and down only: the pose does not tell up from down.
    ///
    /// # Errors
    /// See [`Performer::arm_loop`].
    pub fn arm_line() -> Result<Self, DefineError> {
        Self::new(&FIGURE, vec![right_arm("wave", 0.0)])
    }

    /// Two gestures that share joints: `wave` moves the right arm, `both` moves both arms.
    ///
    /// # Errors
    /// See [`Performer::arm_loop`].
    pub fn two_arms() -> Result<Self, DefineError> {
        let wave = right_arm("wave", 0.2);
        let mut both = right_arm("both", 0.2);
        both.cosine[3] = [0.0, 0.2, 0.0];
        both.sine[3] = [0.0, 0.0, 0.2];
        Self::new(&FIGURE, vec![wave, both])
    }

    /// A hand of 21 points: `thumb` circles with the thumb alone, `hand` with all five fingers,
    /// the thumb as in `thumb`.
    ///
    /// # Errors
    /// See [`Performer::arm_loop`].
    pub fn hand() -> Result<Self, DefineError> {
        let points = hand_points();
        let circle = |fingers: std::ops::Range<usize>| {
            let mut cosine = vec![[0.0; 3]; points.len()];
            let mut sine = cosine.clone();
            for finger in fingers {
                // Knuckles stay; farther joints swing wider.
                for (joint, share) in [0.0, 0.35, 0.7, 1.0].into_iter().enumerate() {
                    let swing = 0.025 * share;
                    cosine[1 + 4 * finger + joint] = [0.0, swing, 0.0];
                    sine[1 + 4 * finger + joint] = [swing, 0.0, 0.0];
                }
            }
            (cosine, sine)
        };
        let (cosine, sine) = circle(0..1);
        let thumb = Movement {
            name: "thumb",
            cosine,
            sine,
        };
        let (cosine, sine) = circle(0..5);
        let hand = Movement {
            name: "hand",
            cosine,
            sine,
        };
        Self::new(&points, vec![thumb, hand])
    }

    fn new(points: &[(&str, [f64; 3])], movements: Vec<Movement>) -> Result<Self, DefineError> {
        let header = PoseHeader {
            points: points.iter().map(|(name, _)| (*name).to_owned()).collect(),
            dim: 3,
            channels: Vec::new(),
        };
        let rest: Vec<[f64; 3]> = points.iter().map(|(_, place)| *place).collect();
        let mut performer = Self {
            set: GestureSet::new(&header, rest.clone()),
            header,
            rest,
            movements,
            phase_offsets_rad: Vec::new(),
            noise: Vec::new(),
            references: None,
            planes: Vec::new(),
        };
        for index in 0..performer.movements.len() {
            let recording = performer.shown(index);
            let marks = CyclicMarks {
                start_s: 0.1,
                end_s: None,
            };
            let name = performer.movements[index].name;
            let definition = define_cyclic(&performer.set, &recording, name, "synthetic", marks)?;
            performer.set.put(definition.gesture);
        }
        // The set names no anchor of its own: that of the points always exists.
        performer.references = References::new(&performer.set).ok();
        if let Some(references) = &performer.references {
            performer.planes = (0..performer.movements.len())
                .map(|index| Plane::train(&performer.set, references, index))
                .collect();
        }
        for index in 0..performer.planes.len() {
            performer.learn(index);
        }
        Ok(performer)
    }

    /// A clean recording of movement `index` at 1 Hz and full size.
    fn shown(&self, index: usize) -> Recording {
        let mut doing = vec![Doing::default(); self.movements.len()];
        doing[index].amplitude = 1.0;
        let samples = (0..(SHOWN_S * SHOWN_HZ) as usize)
            .map(|k| {
                let t = k as f64 / SHOWN_HZ;
                doing[index].phase_rad = TAU * t;
                let mut sample = self.sample();
                self.pose(t, &doing, &mut sample);
                sample
            })
            .collect();
        Recording {
            header: self.header.clone(),
            samples,
        }
    }

    /// Where `points` lie on the plane of gesture `index`, global motion removed.
    pub fn on_plane(&self, index: usize, points: &[[f64; 3]]) -> [f64; 2] {
        let (Some(references), Some(plane)) = (&self.references, self.planes.get(index)) else {
            return [0.0; 2];
        };
        let mut local = points.to_vec();
        references.fit.remove(points, None, &mut local);
        plane.apply(local.as_flattened(), false).z
    }

    /// Measures what the plane of gesture `index` makes of phases and of noise.
    fn learn(&mut self, index: usize) {
        let read = |points: &[[f64; 3]]| self.on_plane(index, points);
        let mut sum = [0.0; 2];
        for sample in &self.shown(index).samples[..SHOWN_HZ as usize] {
            let [re, im] = read(&places(sample));
            // z exp(-i phase), summed over one turn.
            let (sin, cos) = (TAU * sample.t).sin_cos();
            sum[0] += re * cos + im * sin;
            sum[1] += im * cos - re * sin;
        }
        // What a small step of every coordinate does to the plane.
        let mut columns = Vec::new();
        let mut points = self.rest.clone();
        for index in 0..3 * self.rest.len() {
            let mut at = |step: f64| {
                points.as_flattened_mut()[index] += step;
                let [re, im] = read(&points);
                points.as_flattened_mut()[index] -= step;
                Vector2::new(re, im)
            };
            columns.push((at(STEP_M) - at(-STEP_M)) / (2.0 * STEP_M));
        }
        let gram: Matrix2<f64> = columns
            .iter()
            .map(|column| column * column.transpose())
            .sum();
        let eigen = gram.symmetric_eigen();
        let largest = eigen.eigenvalues.max();
        let axes = (0..2)
            .filter(|k| eigen.eigenvalues[*k] > BLIND * largest)
            .map(|k| {
                let axis = eigen.eigenvectors.column(k);
                let row = columns.iter().map(|column| column.dot(&axis)).collect();
                (row, eigen.eigenvalues[k])
            })
            .collect();
        self.phase_offsets_rad.push(sum[1].atan2(sum[0]));
        self.noise.push(axes);
    }

    /// An empty sample with room for all points.
    pub fn sample(&self) -> PoseSample {
        PoseSample {
            t: 0.0,
            points: vec![None; self.rest.len()],
            confidence: Vec::new(),
            channels: Vec::new(),
        }
    }

    /// Writes the pose at time `t` into `sample`: rest pose plus what every gesture is doing.
    pub fn pose(&self, t: f64, doing: &[Doing], sample: &mut PoseSample) {
        sample.t = t;
        for (index, place) in self.rest.iter().enumerate() {
            let mut place = *place;
            for (movement, doing) in self.movements.iter().zip(doing) {
                let (sin, cos) = doing.phase_rad.sin_cos();
                let (sin2, cos2) = (2.0 * doing.phase_rad).sin_cos();
                let along = doing.amplitude * (cos + doing.harmonic * cos2) + doing.offset;
                let across = doing.amplitude * (sin + doing.harmonic * sin2);
                for (axis, value) in place.iter_mut().enumerate() {
                    *value +=
                        along * movement.cosine[index][axis] + across * movement.sine[index][axis];
                }
            }
            sample.points[index] = Some(place);
        }
    }

    /// Adds white noise to all points such that both components of gesture `index`'s plane get
    /// noise of exactly `deviation` (the blind component of a line: what it gets).
    ///
    /// All coordinates get the same deviation, as from a tracker; what the plane sees of it is then
    /// set to the wanted draw by the smallest further displacement.
    pub fn add_noise(
        &self,
        index: usize,
        deviation: f64,
        random: &mut SplitMix,
        sample: &mut PoseSample,
    ) {
        let Some(map) = self.noise.get(index).filter(|_| deviation > 0.0) else {
            return;
        };
        let largest = map.iter().map(|(_, square)| *square).fold(0.0, f64::max);
        if largest <= 0.0 {
            return;
        }
        let per_coordinate = deviation / largest.sqrt();
        let mut shifts: Vec<f64> = (0..3 * self.rest.len())
            .map(|_| per_coordinate * random.normal())
            .collect();
        for (row, square) in map {
            let seen: f64 = row
                .iter()
                .zip(&shifts)
                .map(|(row, shift)| row * shift)
                .sum();
            let gain = (deviation * random.normal() - seen) / square;
            for (shift, row) in shifts.iter_mut().zip(row) {
                *shift += gain * row;
            }
        }
        for (point, shift) in sample.points.iter_mut().zip(shifts.chunks(3)) {
            if let Some(place) = point {
                for (value, shift) in place.iter_mut().zip(shift) {
                    *value += shift;
                }
            }
        }
    }

    /// The phase that gesture `index`'s plane should read when the performer's own is `phase_rad`,
    /// in [-pi, pi).
    pub fn plane_phase(&self, index: usize, phase_rad: f64) -> f64 {
        wrap_pi(phase_rad + self.phase_offsets_rad.get(index).copied().unwrap_or(0.0))
    }
}

/// The places of a sample whose points are all seen.
pub fn places(sample: &PoseSample) -> Vec<[f64; 3]> {
    sample.points.iter().flatten().copied().collect()
}

const FIGURE: [(&str, [f64; 3]); 6] = [
    ("hip", [0.0, 0.95, 0.0]),
    ("chest", [0.0, 1.35, 0.02]),
    ("head", [0.0, 1.65, 0.05]),
    ("left_hand", [-0.35, 1.0, 0.05]),
    ("right_elbow", [0.28, 1.15, 0.1]),
    ("right_hand", [0.35, 1.1, 0.3]),
];

/// The right hand 20 cm up and `depth` forward, the elbow by half.
fn right_arm(name: &'static str, depth: f64) -> Movement {
    let mut cosine = vec![[0.0; 3]; FIGURE.len()];
    let mut sine = cosine.clone();
    for (point, share) in [(4, 0.5), (5, 1.0)] {
        cosine[point] = [0.0, 0.2 * share, 0.0];
        sine[point] = [0.0, 0.0, depth * share];
    }
    Movement { name, cosine, sine }
}

/// A flat right hand, palm down, fingers forward (towards -z): wrist, then four joints a finger.
fn hand_points() -> Vec<(&'static str, [f64; 3])> {
    const NAMES: [[&str; 4]; 5] = [
        ["thumb_cmc", "thumb_mcp", "thumb_ip", "thumb_tip"],
        ["index_mcp", "index_pip", "index_dip", "index_tip"],
        ["middle_mcp", "middle_pip", "middle_dip", "middle_tip"],
        ["ring_mcp", "ring_pip", "ring_dip", "ring_tip"],
        ["pinky_mcp", "pinky_pip", "pinky_dip", "pinky_tip"],
    ];
    // Per finger: the knuckle's place, the direction (x, z), the length beyond it.
    const FINGERS: [([f64; 2], [f64; 2], f64); 5] = [
        ([-0.030, -0.020], [-0.75, -0.66], 0.075),
        ([-0.025, -0.090], [-0.12, -0.99], 0.075),
        ([-0.002, -0.093], [0.0, -1.0], 0.083),
        ([0.019, -0.087], [0.10, -0.99], 0.076),
        ([0.038, -0.077], [0.22, -0.97], 0.060),
    ];
    let mut points = vec![("wrist", [0.0, 0.2, 0.0])];
    for (names, (knuckle, direction, length)) in NAMES.iter().zip(FINGERS) {
        for (name, share) in names.iter().zip([0.0, 0.5, 0.78, 1.0]) {
            let along = length * share;
            points.push((
                name,
                [
                    knuckle[0] + along * direction[0],
                    0.2,
                    knuckle[1] + along * direction[1],
                ],
            ));
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deviation of both components when a resting performer's points are noisy.
    fn measured(performer: &Performer, index: usize, asked: f64) -> [f64; 2] {
        let mut random = SplitMix::new(3);
        let mut sample = performer.sample();
        let resting = vec![Doing::default(); performer.set.gestures.len()];
        let (mut sum, mut square) = ([0.0; 2], [0.0; 2]);
        let n = 20_000;
        for _ in 0..n {
            performer.pose(0.0, &resting, &mut sample);
            performer.add_noise(index, asked, &mut random, &mut sample);
            let z = performer.on_plane(index, &places(&sample));
            for c in 0..2 {
                sum[c] += z[c] / f64::from(n);
                square[c] += z[c] * z[c] / f64::from(n);
            }
        }
        [0, 1].map(|c: usize| (square[c] - sum[c] * sum[c]).sqrt())
    }

    #[test]
    fn the_plane_gets_the_noise_that_was_asked_for() {
        let performers = [
            ("loop", Performer::arm_loop()),
            ("two arms", Performer::two_arms()),
            ("hand", Performer::hand()),
        ];
        for (name, performer) in performers {
            let performer = performer.expect("defined");
            for asked in [0.03, 0.3] {
                for (c, found) in measured(&performer, 0, asked).into_iter().enumerate() {
                    let error = (found / asked - 1.0).abs();
                    assert!(
                        error < 0.03,
                        "{name}, component {c}: asked {asked}, measured {found:.4}"
                    );
                }
            }
        }
        let line = Performer::arm_line().expect("defined");
        let [seen, blind] = measured(&line, 0, 0.1);
        assert!((seen / 0.1 - 1.0).abs() < 0.03, "line: measured {seen:.4}");
        assert!(blind < 0.1, "the blind component gets {blind:.4}");
    }

    #[test]
    fn a_clean_performance_reads_its_own_size_and_phase() {
        for performer in [Performer::arm_loop(), Performer::hand()] {
            let performer = performer.expect("defined");
            let mut sample = performer.sample();
            let mut doing = vec![Doing::default(); performer.set.gestures.len()];
            for k in 0..12 {
                doing[0].amplitude = 0.8;
                doing[0].phase_rad = TAU * f64::from(k) / 12.0;
                performer.pose(0.0, &doing, &mut sample);
                let [re, im] = performer.on_plane(0, &places(&sample));
                let phase = performer.plane_phase(0, doing[0].phase_rad);
                let error = wrap_pi(im.atan2(re) - phase).abs();
                assert!((re.hypot(im) - 0.8).abs() < 0.03, "size {}", re.hypot(im));
                assert!(error < 0.05, "phase off by {error:.3} rad");
            }
        }
    }
}
