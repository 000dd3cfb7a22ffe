//! The built-in character as a library user has it, and its performance played cycle by cycle.

use handwave::base::{JointState, Time};
use handwave::config::files::BUILT_IN;
use handwave::config::{self, Character, Files};
use handwave::live::{session, source};
use handwave::pose::{PoseHeader, PoseSample};
use handwave::puppet::{Inputs, Puppet, Stage};
use std::path::Path;

pub const RATE_HZ: f64 = 200.0;

pub fn built_in() -> Character {
    config::load(Files::Embedded, BUILT_IN).expect("the built-in character")
}

/// Every character that ships, by the name of its file in `configs`.
pub fn shipped() -> Vec<(String, Character)> {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let mut files: Vec<_> = std::fs::read_dir(configs)
        .expect("configs")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "toml"))
        .collect();
    files.sort();
    files
        .iter()
        .map(|path| {
            let (files, name) = Files::of(path);
            let character = config::load(files, &name).unwrap_or_else(|e| panic!("{e}"));
            (name, character)
        })
        .collect()
}

/// Header and samples of the bundled performance.
pub fn performance(character: &Character) -> (PoseHeader, Vec<PoseSample>) {
    let mut reader = source::open(&character.source, &character.files).expect("the performance");
    let samples = (&mut reader).map(|sample| sample.expect("a good sample"));
    let samples = samples.collect();
    // Channels may turn up in the samples only.
    (reader.header().clone(), samples)
}

/// A puppet and the performance it is given, as the control loop does it.
pub struct Player {
    pub puppet: Puppet,
    samples: Vec<PoseSample>,
    next: usize,
    states: Vec<JointState>,
    pub cycle: u64,
}

impl Player {
    /// At rest with every joint at zero. The samples come on the run's clock from `begins_s` on.
    pub fn new(character: &Character, begins_s: f64) -> Self {
        Self::with(character, begins_s, |_, _| {})
    }

    /// The same with every sample changed by `change`, which is also given the time since the first one.
    pub fn with(
        character: &Character,
        begins_s: f64,
        change: impl Fn(f64, &mut PoseSample),
    ) -> Self {
        let (header, mut samples) = performance(character);
        let start = samples[0].t;
        for sample in &mut samples {
            change(sample.t - start, sample);
        }
        let first = samples[0].t;
        for sample in &mut samples {
            sample.t += begins_s - first;
        }
        let mut puppet = session::puppet(character, &header, RATE_HZ).expect("a puppet");
        let joints = character.joints.len();
        let start = match &character.body.avatar {
            Some(_) => character.standing(),
            None => vec![0.0; joints],
        };
        puppet.begin(Time::ZERO, &start);
        Self {
            puppet,
            samples,
            next: 0,
            states: vec![JointState::default(); joints],
            cycle: 0,
        }
    }

    pub fn t_s(&self) -> f64 {
        self.cycle as f64 / RATE_HZ
    }

    /// When the last sample is due.
    pub fn ends_s(&self) -> f64 {
        self.samples.last().map_or(0.0, |s| s.t)
    }

    /// One cycle with the samples due by now; samples that are not `heard` are lost. True while it goes on.
    pub fn step(&mut self, heard: bool) -> bool {
        self.step_after(heard, |_, _| {})
    }

    /// The same; `before` is given the puppet and the samples first, as the control loop's parts are.
    pub fn step_after(
        &mut self,
        heard: bool,
        before: impl FnOnce(&mut Puppet, &[PoseSample]),
    ) -> bool {
        let t_s = self.t_s();
        let from = self.next;
        while self.samples.get(self.next).is_some_and(|s| s.t <= t_s) {
            self.next += 1;
        }
        let samples = if heard {
            &self.samples[from..self.next]
        } else {
            &[]
        };
        before(&mut self.puppet, samples);
        let inputs = Inputs {
            samples,
            states: &self.states,
            finish: self.next == self.samples.len(),
        };
        self.puppet.step(Time::from_secs(t_s), &inputs);
        self.cycle += 1;
        self.puppet.stage() != Stage::Done
    }

    /// The samples of the last two cycles, into `out`.
    pub fn due(&self, out: &mut Vec<PoseSample>) {
        out.clear();
        let since_s = self.t_s() - 2.5 / RATE_HZ;
        let given = self.samples[..self.next].iter();
        out.extend(given.filter(|s| s.t > since_s).cloned());
    }

    pub fn positions(&self) -> &[f64] {
        &self.puppet.targets().positions
    }
}
