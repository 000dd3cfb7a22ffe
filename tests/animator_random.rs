//! Ten minutes of random gestures on each of the shipped walkers: limits kept, nothing jumps, feet stay where they stand.

mod support;

use handwave::base::random::SplitMix;
use handwave::body::{Feet, RobotFeet, RootPose};
use handwave::config::Character;
use handwave::live::session;
use handwave::motion::Animator;
use handwave::motion::class::Drive;
use handwave::motion::layer::{ChannelMap, LayerInput};
use handwave::motion::node::ClassInput;
use nalgebra::Point3;
use support::character::{RATE_HZ, performance, shipped};
use support::counting::{Counting, allocations};
use support::limits::LimitWatch;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const DT_S: f64 = 1.0 / RATE_HZ;

/// One random gesture: comes and goes, changes its size and tempo at any time by any amount. Leaps of phase
/// do not come here: the puppet draws them over.
#[derive(Default)]
struct Whim {
    amplitude: f64,
    wanted: f64,
    frequency_hz: f64,
    wanted_hz: f64,
    sense: f64,
    phase_rad: f64,
    left_s: f64,
    cyclic: bool,
}

impl Whim {
    fn step(&mut self, random: &mut SplitMix) -> Drive {
        self.left_s -= DT_S;
        if self.left_s < 0.0 {
            self.left_s = 0.4 + 5.0 * random.unit();
            let performs = random.unit() < 0.6;
            self.wanted = if performs {
                0.15 + 1.0 * random.unit()
            } else {
                0.0
            };
            // Now and then in the opposite sense: another gesture.
            self.sense = if random.unit() < 0.3 { -1.0 } else { 1.0 };
            self.wanted_hz = 0.4 + 2.2 * random.unit();
        }
        // An estimator follows within a tenth of a second, in tempo within two (the study's figures).
        self.amplitude += (self.wanted - self.amplitude) * (DT_S / 0.1);
        self.frequency_hz += (self.wanted_hz - self.frequency_hz) * (DT_S / 0.2);
        let frequency_hz = self.sense * self.frequency_hz;
        self.phase_rad = (self.phase_rad + frequency_hz * DT_S * std::f64::consts::TAU)
            .rem_euclid(std::f64::consts::TAU);
        let noise = 0.01 * random.normal();
        Drive {
            amplitude: (self.amplitude + noise).max(0.0),
            frequency_hz: if self.cyclic { frequency_hz } else { 0.0 },
            phase_rad: self.phase_rad + noise,
            ..Drive::default()
        }
    }
}

/// A stance of one foot: where it began, and how far from there it has been.
#[derive(Copy, Clone, Default)]
struct Stance {
    began: Option<Point3<f64>>,
    slid_m: f64,
    /// The envelope held a joint back meanwhile: then the foot cannot be where it should.
    held: bool,
}

/// Watches feet: how far each slides while the animator has it on the ground.
struct SlideWatch<'a> {
    feet: &'a RobotFeet,
    stances: Vec<Stance>,
    slides_m: Vec<f64>,
    /// Of stances in which the envelope acted.
    held_m: Vec<f64>,
}

impl<'a> SlideWatch<'a> {
    fn new(feet: &'a RobotFeet) -> Self {
        Self {
            stances: vec![Stance::default(); feet.count()],
            slides_m: Vec::with_capacity(100_000),
            held_m: Vec::with_capacity(1_000),
            feet,
        }
    }

    /// `pose`: joints as sent, with the animator's body over the ground.
    fn see(
        &mut self,
        on_ground: impl Fn(usize) -> bool,
        held: bool,
        root: &RootPose,
        pose: &[f64],
    ) {
        for (foot, stance) in self.stances.iter_mut().enumerate() {
            let at = root.to_world(self.feet.position(pose, foot));
            match (on_ground(foot), stance.began) {
                (true, None) => {
                    *stance = Stance {
                        began: Some(at),
                        slid_m: 0.0,
                        held,
                    }
                }
                (true, Some(began)) => {
                    stance.held |= held;
                    let d = (at.xy() - began.xy()).norm();
                    stance.slid_m = stance.slid_m.max(d);
                }
                (false, Some(_)) => {
                    let list = if stance.held {
                        &mut self.held_m
                    } else {
                        &mut self.slides_m
                    };
                    list.push(stance.slid_m);
                    *stance = Stance::default();
                }
                (false, None) => {}
            }
        }
    }

    /// Worst slide of stances in which the envelope did not act, and of those in which it did, mm.
    fn worst_mm(&self) -> [f64; 2] {
        [&self.slides_m, &self.held_m].map(|list| 1e3 * list.iter().copied().fold(0.0, f64::max))
    }
}

/// What a hand may do, per channel of the global motion: middle and half the range (yaw in rad, metres).
const HAND: [(f64, f64); 5] = [
    (0.0, 0.7),
    (0.18, 0.14),
    (0.2, 0.1),
    (0.0, 0.15),
    (0.0, 0.15),
];

fn animator(character: &Character) -> (Animator, Vec<ClassInput>, usize) {
    let (header, _) = performance(character);
    let front = session::front_end(character, &header).expect("a front end");
    let channels = front.channel_names().len();
    let inputs = character.class_inputs(&front).expect("inputs");
    (
        character.animator(&front).expect("an animator"),
        inputs,
        channels,
    )
}

fn perform(name: &str, character: &Character, seed: u64) {
    let minutes = 10.0;
    let Some(feet) = &character.body.feet else {
        return;
    };
    let (mut animator, inputs, channels) = animator(character);
    let joints = character.joints.len();
    let mut envelope = character.envelope(DT_S);
    let mut pose = vec![0.0; animator.coordinates()];
    animator.rest_pose(&mut pose);
    envelope.start(&pose[..joints]);
    let mut random = SplitMix::new(seed);
    let mut whims: Vec<Whim> = (character.gestures.gestures.iter())
        .map(|g| Whim {
            cyclic: g.kind == handwave::gesture::GestureKind::Cyclic,
            ..Whim::default()
        })
        .collect();
    let mut values = vec![0.0; channels];
    let mut goals = values.clone();
    let mut waves = vec![Drive::default(); whims.len()];
    let mut drives = vec![Drive::default(); character.classes.len()];
    let mut sent = pose[..joints].to_vec();
    let mut limits = LimitWatch::new(&character.limits, DT_S);
    let mut slides = SlideWatch::new(feet);
    let mut root = animator.root();
    let (mut held_back, mut allocated) = (0_u32, 0);
    let (mut jump_m, mut jump_rad): (f64, f64) = (0.0, 0.0);
    let cycles = (minutes * 60.0 * RATE_HZ) as usize;
    for cycle in 0..cycles {
        for (wave, whim) in waves.iter_mut().zip(&mut whims) {
            *wave = whim.step(&mut random);
        }
        if cycle % 400 == 0 {
            for (goal, (middle, half)) in goals.iter_mut().zip(HAND) {
                *goal = middle + half * (2.0 * random.unit() - 1.0);
            }
        }
        for (value, goal) in values.iter_mut().zip(&goals) {
            *value += (goal - *value) * (DT_S / 0.2);
        }
        for (drive, input) in drives.iter_mut().zip(&inputs) {
            let weigh = |source: Option<(usize, ChannelMap)>| {
                source.map_or(0.0, |(channel, map)| map.weight(values[channel]))
            };
            *drive = input.gesture.map_or(Drive::default(), |g| waves[g]);
            if input.reverse {
                (drive.frequency_hz, drive.phase_rad) = (-drive.frequency_hz, -drive.phase_rad);
            }
            if input.gesture.is_none() {
                drive.amplitude = weigh(input.channel);
            }
            drive.extra = input.extra.map(weigh);
        }
        let before = allocations();
        let input = LayerInput {
            channels: &values,
            gestures: &waves,
        };
        animator.step(&drives, &input, DT_S, &mut pose);
        let held = envelope.pass(&pose[..joints], &mut sent) > 0;
        held_back += u32::from(held);
        if cycle > 10 {
            allocated += allocations() - before;
        }
        assert!(
            pose.iter().chain(&sent).all(|v| v.is_finite()),
            "{name}: not a number in cycle {cycle}, seed {seed}"
        );
        limits
            .see(&sent)
            .unwrap_or_else(|e| panic!("{name}, seed {seed}: {e}"));
        let now = animator.root();
        jump_m = jump_m.max((now.x_m - root.x_m).hypot(now.y_m - root.y_m));
        jump_rad = jump_rad.max((now.yaw_rad - root.yaw_rad).abs());
        root = now;
        let mut shown = pose.clone();
        shown[..joints].copy_from_slice(&sent);
        let pins = animator.pins().expect("pinned feet");
        slides.see(|foot| pins.on_ground(foot), held, &root, &shown);
    }
    let counts = animator.counts();
    let [worst_mm, held_mm] = slides.worst_mm();
    let mut sorted = [slides.slides_m.clone(), vec![0.0]].concat();
    sorted.sort_by(f64::total_cmp);
    println!(
        "{name}, seed {seed}: {cycles} cycles, {counts:?}, {} stances, slide median {:.3} mm, worst {:.3} mm ({:.3} mm in {} stances with the envelope acting); \
         envelope acted in {held_back} cycles; root moves at most {:.2} mm and {:.4} rad a cycle; {}",
        sorted.len(),
        1e3 * sorted[sorted.len() / 2],
        worst_mm,
        held_mm,
        slides.held_m.len(),
        1e3 * jump_m,
        jump_rad,
        limits.extremes(),
    );
    assert_eq!(allocated, 0, "{name}: allocations in the step");
    assert!(
        worst_mm < 2.0,
        "{name}: a foot slid {worst_mm:.2} mm in one stance"
    );
    assert!(
        held_mm < 20.0 && slides.held_m.len() * 10 < slides.slides_m.len(),
        "{name}: {held_mm:.2} mm, {} stances with the envelope acting",
        slides.held_m.len()
    );
    assert!(
        f64::from(counts.completed) > 2.0 * minutes,
        "{name}: only {counts:?} in {minutes} minutes"
    );
    assert!(
        jump_m < 0.01 && jump_rad < 0.05,
        "{name}: root jumps {jump_m} m, {jump_rad} rad"
    );
    // Random gestures are no normal playing; still the envelope is a guard and not a filter.
    assert!(
        held_back < cycles as u32 / 200,
        "{name}: envelope acted in {held_back} cycles"
    );
}

#[test]
fn ten_minutes_of_random_gestures_keep_limits_and_feet() {
    for (name, character) in shipped() {
        match name.as_str() {
            "quadruped.toml" => perform(&name, &character, 7),
            "hexapod.toml" => perform(&name, &character, 7),
            _ => {}
        }
    }
}
