//! How long one step of the puppet takes while fingers drum, and what a whole cycle on the simulated line costs.
#![allow(missing_docs, reason = "criterion's macros make undocumented items")]

use criterion::{Criterion, criterion_group, criterion_main};
use handwave::base::{Clock, JointState, Time, VirtualClock};
use handwave::bus::port::bare;
use handwave::config::files::BUILT_IN;
use handwave::config::{self, Character, Files};
use handwave::live::{session, source, wire};
use handwave::pose::{PoseHeader, PoseSample};
use handwave::puppet::{Inputs, Puppet, Stage};
use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

const RATE_HZ: f64 = 200.0;

fn character() -> (Character, PoseHeader, Vec<PoseSample>) {
    let character = config::load(Files::Embedded, BUILT_IN).expect("the built-in character");
    let reader = source::open(&character.source, &character.files).expect("the performance");
    let header = reader.header().clone();
    let samples = reader.map(|sample| sample.expect("a good sample"));
    let samples = samples.collect();
    (character, header, samples)
}

/// A puppet that drums for ever: five seconds of the performance, over and over.
struct Drumming {
    puppet: Puppet,
    samples: Vec<PoseSample>,
    states: Vec<JointState>,
    next: usize,
    shift_s: f64,
    cycle: u64,
}

impl Drumming {
    fn new() -> Self {
        let (character, header, samples) = character();
        let mut puppet = session::puppet(&character, &header, RATE_HZ).expect("a puppet");
        let joints = character.joints.len();
        puppet.begin(Time::ZERO, &vec![0.0; joints]);
        let samples: Vec<_> = samples
            .into_iter()
            .filter(|s| (14.0..19.0).contains(&s.t))
            .collect();
        let mut drumming = Self {
            puppet,
            shift_s: 2.5 - samples[0].t,
            samples,
            states: vec![JointState::default(); joints],
            next: 0,
            cycle: 0,
        };
        while drumming.cycle < 1600 {
            drumming.step(true);
        }
        assert_eq!(drumming.puppet.stage(), Stage::Playing);
        assert!(
            drumming.puppet.estimates()[0].amplitude > 0.5,
            "no drumming"
        );
        drumming
    }

    /// One cycle; with `fresh` the sample that is due, else none and time stands still.
    fn step(&mut self, fresh: bool) {
        let now_s = self.cycle as f64 / RATE_HZ;
        let mut given: &[PoseSample] = &[];
        if fresh {
            self.cycle += 1;
            let sample = &mut self.samples[self.next];
            if sample.t + self.shift_s <= now_s {
                // Stamped for this turn of the loop; turned back below.
                sample.t += self.shift_s;
                given = std::slice::from_ref(&self.samples[self.next]);
            }
        }
        let inputs = Inputs {
            samples: given,
            states: &self.states,
            finish: false,
        };
        black_box(self.puppet.step(Time::from_secs(now_s), &inputs));
        if !given.is_empty() {
            self.samples[self.next].t -= self.shift_s;
            self.next += 1;
            if self.next == self.samples.len() {
                self.next = 0;
                let last = &self.samples[self.samples.len() - 1];
                self.shift_s += last.t - self.samples[0].t + 0.01;
            }
        }
    }
}

fn step(c: &mut Criterion) {
    let mut group = c.benchmark_group("step");
    let mut drumming = Drumming::new();
    group.bench_function("drumming, a sample in most cycles", |b| {
        b.iter(|| drumming.step(true));
    });
    let mut drumming = Drumming::new();
    group.bench_function("drumming, no new sample", |b| {
        b.iter(|| drumming.step(false));
    });
    group.finish();
}

fn exchange(c: &mut Criterion) {
    let (character, _, _) = character();
    let clock = VirtualClock::new();
    let shared: Arc<dyn Clock> = Arc::new(clock.clone());
    let mut bus = wire::open(&character, &character.bus, shared, RATE_HZ, &mut bare)
        .expect("the simulated line")
        .bus;
    let mut states = vec![JointState::default(); character.joints.len()];
    bus.prepare(&mut states).expect("twelve servos");
    let goals: Vec<f64> = states.iter().map(|s| s.position).collect();
    bus.arm().expect("torque");
    let start = clock.now();
    let mut cycle = 0_u32;
    c.bench_function("exchange with 12 simulated servos, virtual time", |b| {
        b.iter(|| {
            cycle += 1;
            clock.sleep_until(start + Duration::from_millis(5) * cycle);
            black_box(bus.exchange(&goals, &mut states).expect("an answer"));
        });
    });
}

criterion_group!(benches, step, exchange);
criterion_main!(benches);
