//! The pure step: no allocation, the same bits again, inside the limits whatever comes in.

mod support;

use handwave::base::{JointState, Time};
use handwave::config::Character;
use handwave::live::session;
use handwave::pose::PoseSample;
use handwave::puppet::Inputs;
use handwave::sim::fault::Chance;
use support::character::{Player, RATE_HZ, performance, shipped};
use support::counting::{Counting, allocations};
use support::limits::LimitWatch;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn whole_performances_allocate_nothing_and_repeat_bit_for_bit() {
    let shipped = shipped();
    assert!(shipped.len() >= 2, "only {} characters", shipped.len());
    for (name, character) in shipped {
        println!("{name}:");
        play_twice(&character);
    }
}

fn play_twice(character: &Character) {
    let begins_s = character.safety.ramp_s + 0.005;
    let mut first = Player::new(character, begins_s);
    let mut second = Player::new(character, begins_s);
    let mut watch = LimitWatch::new(&character.limits, 1.0 / RATE_HZ);
    let mut late = Vec::new();
    let mut goes_on = true;
    while goes_on {
        let before = allocations();
        goes_on = first.step(true);
        let made = allocations() - before;
        if made > 0 && first.cycle > 10 && late.len() < 5 {
            late.push((first.cycle, made));
        }
        second.step(true);
        let bits = |p: &Player| {
            p.positions()
                .iter()
                .map(|x| x.to_bits())
                .collect::<Vec<_>>()
        };
        assert_eq!(bits(&first), bits(&second), "cycle {}", first.cycle);
        watch
            .see(first.positions())
            .unwrap_or_else(|e| panic!("{e}"));
    }
    assert_eq!(late, [], "(cycle, allocations) after the tenth");
    assert!(first.t_s() > first.ends_s(), "ended at {} s", first.t_s());
    println!(
        "{} cycles without allocation; {}",
        first.cycle,
        watch.extremes()
    );
}

/// Samples as no tracker should send them.
struct Mischief {
    chance: Chance,
    good: Vec<PoseSample>,
    next: usize,
}

impl Mischief {
    fn odd_number(&mut self) -> f64 {
        match self.chance.below(6) {
            0 => f64::NAN,
            1 => f64::INFINITY,
            2 => -1e300,
            3 => 1e-310,
            _ => f64::from(self.chance.bits()) / 4e9 - 0.5,
        }
    }

    /// The samples of a cycle at `t_s`: mostly good ones, some late, twice, jumping or broken.
    fn samples(&mut self, t_s: f64, out: &mut Vec<PoseSample>) {
        out.clear();
        while self.chance.happens(0.45) && out.len() < 8 {
            let mut sample = self.good[self.next].clone();
            let jump = if self.chance.happens(0.02) {
                self.chance.below(500)
            } else {
                1
            };
            self.next = (self.next + jump) % self.good.len();
            sample.t = t_s - 0.004 * f64::from(self.chance.bits()) / 4_294_967_296.0;
            match self.chance.below(40) {
                0 => sample.t = self.odd_number(),
                1 => sample.t -= 5.0,
                2 => sample.t += 0.02,
                3 => out.push(sample.clone()),
                4 => {
                    let broken = [self.odd_number(), self.odd_number(), self.odd_number()];
                    let point = self.chance.below(sample.points.len());
                    sample.points[point] = Some(broken);
                }
                5 => sample.points.fill(None),
                6 => sample.points.truncate(2),
                7 => {
                    let point = self.chance.below(sample.points.len());
                    sample.points[point] = None;
                }
                8 => sample
                    .points
                    .iter_mut()
                    .flatten()
                    .for_each(|p| *p = [0.1; 3]),
                _ => {}
            }
            out.push(sample);
        }
    }
}

#[test]
fn a_hundred_thousand_cycles_of_mischief_stay_inside_the_limits() {
    for (name, character) in shipped() {
        // Made of points; a face has channels. An avatar has no limits to stay inside.
        if name != "face.toml" && character.body.avatar.is_none() {
            println!("{name}:");
            mischief(&character);
        }
    }
}

fn mischief(character: &Character) {
    const EPISODES: u64 = 20;
    const CYCLES: u64 = 5_000;
    let base: u64 = std::env::var("HANDWAVE_SEED").map_or(20_260, |s| s.parse().expect("a seed"));
    let (header, good) = performance(character);
    let joints = character.joints.len();
    let mut moved_rad = 0.0_f64;
    let (mut refused, mut taken) = (0, 0);
    for seed in base..base + EPISODES {
        let mut mischief = Mischief {
            chance: Chance::new(seed),
            next: 0,
            good: good.clone(),
        };
        let next = mischief.chance.below(good.len());
        mischief.next = next;
        let present: Vec<f64> = character
            .limits
            .iter()
            .map(|l| l.lower + (l.upper - l.lower) * mischief.chance.below(1001) as f64 / 1000.0)
            .collect();
        let mut puppet = session::puppet(character, &header, RATE_HZ).expect("a puppet");
        puppet.begin(Time::ZERO, &present);
        let mut watch = LimitWatch::new(&character.limits, 1.0 / RATE_HZ);
        watch.see(&present).expect("a start inside");
        let ends = 2_000 + mischief.chance.below(5_000) as u64;
        let states = vec![
            JointState {
                position: f64::NAN,
                ..JointState::default()
            };
            joints
        ];
        let mut samples = Vec::new();
        for cycle in 0..CYCLES {
            let t_s = cycle as f64 / RATE_HZ;
            mischief.samples(t_s, &mut samples);
            taken += samples.len() as u64;
            let inputs = Inputs {
                samples: &samples,
                states: &states,
                finish: cycle > ends,
            };
            let targets = puppet.step(Time::from_secs(t_s), &inputs);
            let told = || format!("HANDWAVE_SEED={seed}, cycle {cycle}, {:?}", targets.stage);
            assert!(
                targets.positions.iter().all(|p| p.is_finite()),
                "{}: {:?}",
                told(),
                targets.positions
            );
            watch
                .see(&targets.positions)
                .unwrap_or_else(|e| panic!("{}: {e}", told()));
            moved_rad = moved_rad.max((targets.positions[1] - present[1]).abs());
        }
        refused += puppet.rejected_samples();
    }
    assert!(moved_rad > 0.5, "nothing moved: {moved_rad} rad");
    assert!(
        refused > 1000 && refused < taken / 2,
        "{refused} of {taken} samples refused"
    );
    println!(
        "{} cycles, {refused} of {taken} samples refused",
        EPISODES * CYCLES
    );
}
