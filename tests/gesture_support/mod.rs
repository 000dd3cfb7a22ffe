//! A figure of six points whose right arm moves in waves, sampled as trackers do.
#![allow(
    dead_code,
    reason = "each test file compiles its own copy and uses its own part"
)]

use handwave::gesture::{CyclicMarks, GestureSet, define_cyclic};
use handwave::pose::{PoseHeader, PoseSample, Recording};
use std::f64::consts::TAU;

/// Pseudo-random numbers that are the same everywhere (xorshift).
pub struct Random(pub u64);

impl Random {
    /// Evenly in 0..1.
    pub fn unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Normally distributed, deviation 1.
    pub fn normal(&mut self) -> f64 {
        let (u, v) = (self.unit().max(1e-300), self.unit());
        (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
    }
}

/// How the right hand moves.
#[derive(Copy, Clone, Debug, PartialEq)]
pub enum Path {
    /// In a circle: the pose tells the phase.
    Loop,
    /// Up and down: the pose does not tell up from down.
    Line,
}

pub fn header() -> PoseHeader {
    PoseHeader {
        points: [
            "hip",
            "chest",
            "head",
            "left_hand",
            "right_elbow",
            "right_hand",
        ]
        .map(String::from)
        .to_vec(),
        dim: 3,
        channels: Vec::new(),
    }
}

/// The figure with its right hand `size` * 20 cm from its middle place, at `phase`.
pub fn pose(path: Path, size: f64, phase: f64) -> Vec<[f64; 3]> {
    let (up, forward) = match path {
        Path::Loop => (0.2 * size * phase.cos(), 0.2 * size * phase.sin()),
        Path::Line => (0.2 * size * phase.cos(), 0.0),
    };
    vec![
        [0.0, 0.95, 0.0],
        [0.0, 1.35, 0.02],
        [0.0, 1.65, 0.05],
        [-0.35, 1.0, 0.05],
        [0.28, 1.15 + 0.5 * up, 0.1 + 0.5 * forward],
        [0.35, 1.1 + up, 0.3 + forward],
    ]
}

pub fn sample(t: f64, pose: &[[f64; 3]]) -> PoseSample {
    PoseSample {
        t,
        points: pose.iter().map(|place| Some(*place)).collect(),
        confidence: Vec::new(),
        channels: Vec::new(),
    }
}

/// Times from 0 to `until` at about `rate_hz`, each step off by up to `jitter` of itself.
pub fn times(rate_hz: f64, until: f64, jitter: f64, seed: u64) -> Vec<f64> {
    let mut random = Random(seed.wrapping_mul(2).wrapping_add(0x9e37_79b9));
    let mut t = 0.0;
    let mut times = Vec::new();
    while t < until {
        times.push(t);
        t += (1.0 + jitter * (2.0 * random.unit() - 1.0)) / rate_hz;
    }
    times
}

/// A set with one gesture `wave`: 1 Hz, size 1, shown for three periods at 60 Hz.
pub fn wave_set(path: Path) -> GestureSet {
    let samples = times(60.0, 3.2, 0.0, 1)
        .into_iter()
        .map(|t| sample(t, &pose(path, 1.0, TAU * t)))
        .collect();
    let recording = Recording {
        header: header(),
        samples,
    };
    let mut set = GestureSet::new(&recording.header, Vec::new());
    let marks = CyclicMarks {
        start_s: 0.1,
        end_s: None,
    };
    let definition = define_cyclic(&set, &recording, "wave", "test", marks).expect("periodic");
    set.put(definition.gesture);
    set
}
