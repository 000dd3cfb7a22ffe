//! How well two gaits blend: slide of the feet and hanging legs at a weight, with limb timelines and
//! without. For offline use: it allocates.
//!
//! The class is stepped as a puppet steps it, at a steady tempo, its feet not pinned: what is measured is
//! what pinning would have to hide.

use super::class::{ClassError, ClassOptions, Drive, Example, MotionClass};
use super::clip::Clip;
use super::metrics::{Hanging, foot_slide, hanging_share};
use super::range::JointRange;
use crate::body::{Feet, PoseSpace, RootPose};
use nalgebra::Point3;
use std::f64::consts::TAU;

/// Steps of a cycle.
pub const STEPS: usize = 200;
/// Cycles until amplitude, tempo and timelines are steady, and cycles that are measured.
const SETTLING: usize = 30;
const MEASURED: usize = 4;
/// A foot stands while at least this much of the blend has it on the ground. With two clips of one weight:
/// while either does.
const STANDS: f64 = 0.499;

/// Two clips of one legged body.
pub struct Pair<'a> {
    /// The body.
    pub space: &'a dyn PoseSpace,
    /// Its feet.
    pub feet: &'a dyn Feet,
    /// The clips; both are cycles.
    pub clips: [&'a Clip; 2],
}

/// One foot of a blend.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BlendedFoot {
    /// Its place in the world and whether it stands, step by step.
    pub samples: Vec<(Point3<f64>, bool)>,
}

/// A blend at one weight.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Blended {
    /// Share of the second clip, 0..1, as it was played.
    pub weight: f64,
    /// Whether limbs had timelines of their own.
    pub timelines: bool,
    /// Mean way of a foot over the ground in one stance, metres.
    pub slide_m: f64,
    /// Largest way of one stance, metres.
    pub largest_slide_m: f64,
    /// Share of the time in which legs hang, 0..1, see [`hanging_share`].
    pub hanging: f64,
    /// Mean over feet of how high they are lifted, metres.
    pub lift_m: f64,
    /// Per foot height over the ground along one cycle, metres: [`STEPS`] of them.
    pub heights_m: Vec<Vec<f64>>,
}

/// What is to be known of the pure clips to judge a blend.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Steps {
    /// Height of the feet when they stand, metres.
    pub ground_m: f64,
    /// How high the lower of the two clips lifts its feet, metres.
    pub lift_m: f64,
}

/// Places of the feet in one run, per foot.
struct Run {
    weight: f64,
    speed_m_s: f64,
    dt_s: f64,
    feet: Vec<BlendedFoot>,
}

impl Pair<'_> {
    /// Plays the clips blended at `weight` of the second one; `limb_advance` as in [`ClassOptions`], 0
    /// without timelines.
    fn run(&self, weight: f64, limb_advance: f64) -> Result<Run, ClassError> {
        let example = |clip: &Clip, frequency_hz: f64| Example {
            clip: clip.clone(),
            parameters: [1.0, frequency_hz].into(),
        };
        let unlimited = JointRange {
            velocity: 1e9,
            acceleration: 1e9,
        };
        let mut class = MotionClass::new(
            "blend",
            vec![example(self.clips[0], 1.0), example(self.clips[1], 2.0)],
            vec![unlimited; self.space.len()],
            ClassOptions {
                limb_advance,
                ..ClassOptions::default()
            },
        )?;
        let limbs: Vec<Option<usize>> = (0..self.feet.count())
            .map(|f| class.limbs().iter().position(|l| l == self.feet.name(f)))
            .collect();
        // The tempo chooses the blend: between the two it is in proportion.
        let frequency_hz = 1.0 + weight;
        let dt_s = 1.0 / (frequency_hz * STEPS as f64);
        let mut pose = vec![0.0; self.space.len()];
        let mut root = RootPose::default();
        let mut feet = vec![BlendedFoot::default(); self.feet.count()];
        let mut way_m = 0.0;
        for k in 0..(SETTLING + MEASURED) * STEPS {
            let drive = Drive {
                amplitude: if k == 0 { 0.0 } else { 1.0 },
                frequency_hz,
                phase_rad: TAU * ((k + 1) % STEPS) as f64 / STEPS as f64,
                ..Drive::default()
            };
            let played = class.step(self.space, drive, dt_s, &mut pose);
            root.travel(played.root_velocity.scaled(dt_s));
            if k < SETTLING * STEPS {
                continue;
            }
            let velocity = played.root_velocity;
            way_m += velocity.forward_m.hypot(velocity.left_m) * dt_s;
            for (f, foot) in feet.iter_mut().enumerate() {
                let on = limbs[f].is_none_or(|limb| class.contact(limb) >= STANDS);
                let at = root.to_world(self.feet.position(&pose, f));
                foot.samples.push((at, on));
            }
        }
        Ok(Run {
            weight: class.weights()[1],
            speed_m_s: way_m / (MEASURED as f64 * STEPS as f64 * dt_s),
            dt_s,
            feet,
        })
    }

    /// The steps of the pure clips.
    ///
    /// # Errors
    /// Clips that make no class.
    pub fn steps(&self) -> Result<Steps, ClassError> {
        let (mut ground_m, mut lift_m) = (f64::INFINITY, f64::INFINITY);
        for weight in [0.0, 1.0] {
            let run = self.run(weight, 0.0)?;
            let lowest = (run.feet.iter())
                .map(|f| range(f).0)
                .fold(f64::INFINITY, f64::min);
            ground_m = ground_m.min(lowest);
            lift_m = lift_m.min(mean_lift(&run.feet));
        }
        Ok(Steps { ground_m, lift_m })
    }

    /// The clips blended at `weight` (0..1) of the second one, with limb timelines or without.
    ///
    /// # Errors
    /// Clips that make no class: of other limbs, or not cycles.
    pub fn blend(
        &self,
        weight: f64,
        timelines: bool,
        steps: &Steps,
    ) -> Result<Blended, ClassError> {
        let advance = if timelines {
            ClassOptions::default().limb_advance
        } else {
            0.0
        };
        let run = self.run(weight.clamp(0.0, 1.0), advance)?;
        let hanging = Hanging::of_step(steps.ground_m, steps.lift_m, run.speed_m_s);
        let count = run.feet.len().max(1) as f64;
        let mut blended = Blended {
            weight: run.weight,
            timelines,
            lift_m: mean_lift(&run.feet),
            ..Blended::default()
        };
        let (mut way_m, mut stances) = (0.0, 0);
        for foot in &run.feet {
            let slide = foot_slide(whole_stances(&foot.samples));
            way_m += slide.mean_m * slide.stances as f64;
            stances += slide.stances;
            blended.largest_slide_m = blended.largest_slide_m.max(slide.largest_m);
            let points: Vec<Point3<f64>> = foot.samples.iter().map(|s| s.0).collect();
            blended.hanging += hanging_share(&points, run.dt_s, &hanging) / count;
            let heights = points.iter().take(STEPS).map(|p| p.z - steps.ground_m);
            blended.heights_m.push(heights.collect());
        }
        blended.slide_m = way_m / f64::from(u32::try_from(stances.max(1)).unwrap_or(u32::MAX));
        Ok(blended)
    }
}

/// Without the stances that the beginning and the end cut, where there are others.
fn whole_stances(samples: &[(Point3<f64>, bool)]) -> impl Iterator<Item = (Point3<f64>, bool)> {
    let from = samples.iter().position(|s| !s.1).unwrap_or(0);
    let to = (samples.iter().rposition(|s| !s.1)).map_or(samples.len(), |last| last + 1);
    samples[from..to].iter().copied()
}

fn range(foot: &BlendedFoot) -> (f64, f64) {
    (foot.samples.iter()).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), s| {
        (low.min(s.0.z), high.max(s.0.z))
    })
}

fn mean_lift(feet: &[BlendedFoot]) -> f64 {
    let sum: f64 = feet.iter().map(range).map(|(low, high)| high - low).sum();
    sum / feet.len().max(1) as f64
}
