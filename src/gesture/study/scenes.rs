//! The sequences of the study and what is measured on each.

use super::metrics::{
    ABORT_AMPLITUDE, START_AMPLITUDE, activations, best_lag, reaching_s, rms, rms_phase_deg,
    settling_s, share_above,
};
use super::script::{Curve, Role, Script, Trace};
use crate::base::angle::wrap_pi;

/// One figure measured on a trace: metric, unit, value.
pub type Measure = (&'static str, &'static str, f64);

/// Which performer plays.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Cast {
    /// One arm in a circle.
    Loop,
    /// One arm on a line.
    Line,
    /// Two gestures that share an arm.
    TwoArms,
}

/// A sequence: who plays what, under which noises, how often, and what is measured.
pub struct Scene {
    /// Name in tables.
    pub name: &'static str,
    /// The performer.
    pub cast: Cast,
    /// What is played; the noise is set for each run.
    pub script: Script,
    /// Noise on each component of the plane, standard deviations.
    pub noises: Vec<f64>,
    /// Runs with different seeds.
    pub repeats: usize,
    /// Measures one run.
    pub measure: fn(&Trace) -> Vec<Measure>,
}

/// A change is followed this long.
const AFTER_S: f64 = 5.0;
/// After a change the steady state counts from here.
const STEADY_FROM_S: f64 = 3.0;

/// Errors of gesture `index` while nothing changes, from `from_s` on.
fn steady_errors(trace: &Trace, index: usize, from_s: f64) -> Vec<Measure> {
    let range = trace.range(from_s, f64::INFINITY);
    let (truth, estimate) = (&trace.truth[index], &trace.estimate[index]);
    let errors =
        |estimate: &[f64], truth: &[f64]| rms(range.clone().map(|k| estimate[k] - truth[k]));
    let phases = |waves: &[f64]| waves[range.clone()].to_vec();
    vec![
        (
            "steady_amplitude_error",
            "1",
            errors(&estimate.amplitude, &truth.amplitude),
        ),
        (
            "steady_frequency_error",
            "Hz",
            errors(&estimate.frequency_hz, &truth.frequency_hz),
        ),
        (
            "steady_phase_error",
            "deg",
            rms_phase_deg(&phases(&estimate.phase_rad), &phases(&truth.phase_rad)),
        ),
    ]
}

fn steady(trace: &Trace) -> Vec<Measure> {
    steady_errors(trace, 0, 0.0)
}

/// Settling of both values after a step, and the errors that are left from then on.
///
/// The steady state counts from 3 s on at the earliest and for 1 s at least: an estimator that has
/// not settled by then is judged as it is.
fn step(trace: &Trace, amplitude: f64, frequency_hz: f64) -> Vec<Measure> {
    let estimate = &trace.estimate[0];
    let settled = |values: &[f64], target| settling_s(&trace.t, values, 0.0, target);
    let of_frequency = settled(&estimate.frequency_hz, frequency_hz);
    let of_amplitude = settled(&estimate.amplitude, amplitude);
    let from_s = of_frequency.max(of_amplitude);
    let mut measures = vec![
        ("frequency_settling", "s", of_frequency),
        ("amplitude_settling", "s", of_amplitude),
    ];
    measures.extend(steady_errors(
        trace,
        0,
        from_s.clamp(STEADY_FROM_S, AFTER_S - 1.0),
    ));
    measures
}

fn frequency_step(trace: &Trace) -> Vec<Measure> {
    step(trace, 1.0, 2.0)
}

fn amplitude_step(trace: &Trace) -> Vec<Measure> {
    step(trace, 0.5, 1.0)
}

fn pure_noise(trace: &Trace) -> Vec<Measure> {
    let amplitude = &trace.estimate[0].amplitude[trace.range(0.0, f64::INFINITY)];
    let minutes = trace.t.last().copied().unwrap_or(0.0) / 60.0;
    vec![
        (
            "share_above_0.1",
            "1",
            share_above(amplitude, ABORT_AMPLITUDE),
        ),
        (
            "share_above_0.2",
            "1",
            share_above(amplitude, START_AMPLITUDE),
        ),
        (
            "activations_per_minute",
            "1/min",
            activations(amplitude) as f64 / minutes,
        ),
    ]
}

fn gap(trace: &Trace) -> Vec<Measure> {
    let range = trace.range(0.0, f64::INFINITY);
    let (truth, estimate) = (&trace.truth[0], &trace.estimate[0]);
    let largest = |errors: &dyn Fn(usize) -> f64| {
        range
            .clone()
            .map(|k| errors(k).abs())
            .fold(0.0_f64, f64::max)
    };
    let amplitude = &estimate.amplitude;
    let least = range.clone().map(|k| amplitude[k]).fold(f64::MAX, f64::min);
    vec![
        (
            "largest_amplitude_error",
            "1",
            largest(&|k| amplitude[k] - truth.amplitude[k]),
        ),
        ("least_amplitude", "1", least),
        (
            "largest_frequency_error",
            "Hz",
            largest(&|k| estimate.frequency_hz[k] - truth.frequency_hz[k]),
        ),
        (
            "largest_phase_error",
            "deg",
            largest(&|k| wrap_pi(estimate.phase_rad[k] - truth.phase_rad[k]).to_degrees()),
        ),
    ]
}

/// When the performer of the onset stops again, in seconds.
const RELEASE_S: f64 = 6.0;

fn onset_release(trace: &Trace) -> Vec<Measure> {
    let (t, amplitude) = (&trace.t, &trace.estimate[0].amplitude);
    let reach = |from, level, rising| reaching_s(t, amplitude, from, level, rising);
    vec![
        ("onset_to_0.2", "s", reach(0.0, START_AMPLITUDE, true)),
        ("onset_to_0.9", "s", reach(0.0, 0.9, true)),
        (
            "release_to_0.2",
            "s",
            reach(RELEASE_S, START_AMPLITUDE, false),
        ),
        (
            "release_to_0.1",
            "s",
            reach(RELEASE_S, ABORT_AMPLITUDE, false),
        ),
        ("activations", "1", activations(amplitude) as f64),
    ]
}

fn held_offset(trace: &Trace) -> Vec<Measure> {
    let amplitude = &trace.estimate[0].amplitude;
    let after = &amplitude[trace.range(0.0, f64::INFINITY)];
    let held = &amplitude[trace.range(6.0, f64::INFINITY)];
    vec![
        (
            "largest_amplitude",
            "1",
            after.iter().copied().fold(0.0, f64::max),
        ),
        ("held_amplitude", "1", rms(held.iter().copied())),
        ("activations", "1", activations(after) as f64),
    ]
}

fn tempo_ramp(trace: &Trace) -> Vec<Measure> {
    let range = trace.range(-2.0, f64::INFINITY);
    let (truth, estimate) = (&trace.truth[0], &trace.estimate[0]);
    let (lag, error) = best_lag(
        &estimate.frequency_hz[range.clone()],
        &truth.frequency_hz[range.clone()],
        trace
            .t
            .windows(2)
            .next()
            .map_or(1.0, |pair| pair[1] - pair[0]),
        1.5,
    );
    vec![
        ("frequency_delay", "s", lag),
        ("frequency_error_at_that_delay", "Hz", error),
        (
            "phase_error",
            "deg",
            rms_phase_deg(&estimate.phase_rad[range.clone()], &truth.phase_rad[range]),
        ),
    ]
}

/// Amplitudes of the gesture that is not performed (`silent`), and the error of the other.
fn interference(trace: &Trace, silent: usize) -> Vec<Measure> {
    let amplitude = &trace.estimate[silent].amplitude[trace.range(0.0, f64::INFINITY)];
    let mut measures = vec![
        (
            "interference_mean",
            "1",
            amplitude.iter().sum::<f64>() / amplitude.len() as f64,
        ),
        (
            "interference_largest",
            "1",
            amplitude.iter().copied().fold(0.0, f64::max),
        ),
    ];
    measures.extend(steady_errors(trace, 1 - silent, 0.0));
    measures
}

fn first_alone(trace: &Trace) -> Vec<Measure> {
    interference(trace, 1)
}

fn second_alone(trace: &Trace) -> Vec<Measure> {
    interference(trace, 0)
}

/// Errors of both gestures together, the larger of each.
fn both_at_once(trace: &Trace) -> Vec<Measure> {
    steady_errors(trace, 0, 0.0)
        .into_iter()
        .zip(steady_errors(trace, 1, 0.0))
        .map(|(a, b)| (a.0, a.1, a.2.max(b.2)))
        .collect()
}

/// Noise levels of the steps.
pub const STEP_NOISES: [f64; 4] = [0.0, 0.03, 0.1, 0.2];

/// The two steps, on a loop or a line: the heart of the comparison.
pub fn steps(cast: Cast, before_s: f64) -> [Scene; 2] {
    let scene = |name, role, measure| Scene {
        name,
        cast,
        script: Script::of(role, (-before_s, AFTER_S)),
        noises: STEP_NOISES.to_vec(),
        repeats: 10,
        measure,
    };
    let line = cast == Cast::Line;
    let tempo = Role {
        amplitude: Curve::constant(1.0),
        frequency_hz: Curve::step(1.0, 2.0),
    };
    let size = Role {
        amplitude: Curve::step(1.0, 0.5),
        frequency_hz: Curve::constant(1.0),
    };
    let names = if line {
        ["frequency-step-line", "amplitude-step-line"]
    } else {
        ["frequency-step-loop", "amplitude-step-loop"]
    };
    [
        scene(
            names[0],
            tempo,
            frequency_step as fn(&Trace) -> Vec<Measure>,
        ),
        scene(names[1], size, amplitude_step),
    ]
}

/// How long everything is steady before an event, in seconds.
pub fn before_s(quick: bool) -> f64 {
    if quick { 3.0 } else { 6.0 }
}

/// All sequences at full length, or a short selection of each for a quick look.
pub fn scenes(quick: bool) -> Vec<Scene> {
    let before = before_s(quick);
    let mut scenes = Vec::from(steps(Cast::Loop, before));
    scenes.extend(steps(Cast::Line, before));
    let simple = |name, cast, script, noises: &[f64], measure: fn(&Trace) -> Vec<Measure>| Scene {
        name,
        cast,
        script,
        noises: noises.to_vec(),
        repeats: 5,
        measure,
    };
    let wave = || Role::steady(1.0, 1.0);
    scenes.push(simple(
        "noise-sweep",
        Cast::Loop,
        Script::of(wave(), (-before, 6.0)),
        &[0.01, 0.03, 0.05, 0.1, 0.15, 0.2, 0.3],
        steady,
    ));
    let minutes = if quick { 0.15 } else { 10.0 };
    for (name, rate_hz) in [("pure-noise-60hz", 60.0), ("pure-noise-30hz", 30.0)] {
        let mut script = Script::of(Role::silent(), (-6.0, 60.0 * minutes));
        script.rate_hz = rate_hz;
        let mut scene = simple(name, Cast::Loop, script, &[0.3], pure_noise);
        scene.repeats = 1;
        scenes.push(scene);
    }
    let mut script = Script::of(wave(), (-before, 5.0));
    script.lost = 0.1;
    script.hole_s = Some((0.0, 0.3));
    scenes.push(simple("gap", Cast::Loop, script, &[0.03], gap));
    let mut role = wave();
    role.amplitude = Curve(vec![
        (0.0, 0.0),
        (0.0, 1.0),
        (RELEASE_S, 1.0),
        (RELEASE_S, 0.0),
    ]);
    let script = Script::of(role, (-3.0, RELEASE_S + 5.0));
    scenes.push(simple(
        "onset-release",
        Cast::Loop,
        script,
        &[0.03],
        onset_release,
    ));
    let mut script = Script::of(Role::silent(), (-3.0, 9.0));
    script.offset = Curve::step(0.0, 1.0);
    scenes.push(simple(
        "held-pose",
        Cast::Loop,
        script,
        &[0.0, 0.03],
        held_offset,
    ));
    let mut script = Script::of(wave(), (-before, 4.0));
    script.offset = Curve::constant(1.0);
    scenes.push(simple(
        "wave-on-held-pose",
        Cast::Loop,
        script,
        &[0.0],
        steady,
    ));
    let mut role = wave();
    role.frequency_hz = Curve(vec![(0.0, 0.5), (8.0, 2.5)]);
    let script = Script::of(role, (-7.0, 10.0));
    scenes.push(simple(
        "tempo-ramp",
        Cast::Loop,
        script,
        &[0.03],
        tempo_ramp,
    ));
    let mut script = Script::of(wave(), (-before, 4.0));
    script.harmonic = 0.5;
    scenes.push(simple(
        "second-harmonic",
        Cast::Loop,
        script,
        &[0.0],
        steady,
    ));
    let script = Script::of(Role::steady(1.0, -1.0), (-before, 4.0));
    scenes.push(simple(
        "opposite-sense",
        Cast::Loop,
        script,
        &[0.0, 0.1],
        steady,
    ));
    for (name, first, second, measure) in [
        (
            "shared-joints-one",
            1.0,
            0.0,
            first_alone as fn(&Trace) -> Vec<Measure>,
        ),
        ("shared-joints-other", 0.0, 1.0, second_alone),
        ("shared-joints-both", 1.0, 1.0, both_at_once),
    ] {
        let mut script = Script::of(Role::steady(first, 1.0), (-before, 5.0));
        script.roles.push(Role::steady(second, 1.7));
        scenes.push(simple(name, Cast::TwoArms, script, &[0.03], measure));
    }
    if quick {
        for scene in &mut scenes {
            scene.repeats = 1;
            if !scene.name.contains("-step-") && scene.name != "pure-noise-60hz" {
                scene.script.rate_hz = 30.0;
            }
            scene.noises = match (scene.cast, scene.noises.len()) {
                (Cast::Loop, 3..) => vec![0.03, 0.1],
                (Cast::Line, _) => vec![0.03],
                _ => vec![scene.noises[0]],
            };
        }
    }
    scenes
}

/// The performance of figure 9.5: a cold start, twice as fast, half as large, slower again; white
/// noise at a power ratio of 93.8, at 30 Hz.
pub fn figure_9_5() -> Script {
    let role = Role {
        amplitude: Curve(vec![(6.0, 1.0), (6.0, 0.5)]),
        frequency_hz: Curve(vec![(3.0, 1.0), (3.0, 2.0), (9.0, 2.0), (11.0, 1.0)]),
    };
    let mut script = Script::of(role, (0.0, 13.0));
    script.rate_hz = 30.0;
    // A component of a wave of amplitude 1 has the power 1/2.
    script.noise = (0.5_f64 / SIGNAL_TO_NOISE).sqrt();
    script
}

/// Signal to noise of the thesis's synthetic arm wave, as a ratio of powers.
pub const SIGNAL_TO_NOISE: f64 = 93.8;
