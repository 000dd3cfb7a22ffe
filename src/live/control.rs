//! The control loop: fixed rate, absolute deadlines, one exchange with the bus per cycle.

use super::feed::Feed;
use super::record::Recorder;
use super::reload::Handover;
use super::stats::Stats;
use super::stop::{StopRequest, StopSwitch};
use crate::base::{Clock, JointState, Time};
use crate::bus::{BusError, CycleReport, ServoBus, TorqueReport};
use crate::pose::PoseSample;
use crate::puppet::{Inputs, Puppet, Stage};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

/// How a run is driven.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct ControlOptions {
    /// Control cycles per second.
    pub rate_hz: f64,
    /// The run is brought to its end after this long, seconds.
    pub duration_s: Option<f64>,
    /// Torque is switched off at the end of an orderly run.
    pub torque_off_at_end: bool,
    /// A servo that latches a hardware error or loses its torque ends the run: settle, lie down, torque off.
    pub stop_on_servo_fault: bool,
}

/// How a run ended.
#[derive(Debug)]
pub enum Ending {
    /// The performance or the set duration is over.
    Complete,
    /// The operator stopped it.
    Interrupted,
    /// The robot was stopped for safety, with the reason.
    SafetyStop(String),
    /// The bus failed.
    Bus(BusError),
}

/// What a run leaves behind.
#[derive(Debug)]
pub struct Outcome {
    /// How it ended.
    pub ending: Ending,
    /// What it measured.
    pub stats: Stats,
    /// Torque read back at the end; `None` when torque stays on as declared.
    pub torque: Option<Result<TorqueReport, BusError>>,
}

/// The parts a control loop works with.
pub struct Parts<'a> {
    /// The pure step.
    pub puppet: &'a mut Puppet,
    /// The servos.
    pub bus: &'a mut dyn ServoBus,
    /// The poses.
    pub feed: &'a mut dyn Feed,
    /// The time, shared with the bus.
    pub clock: &'a dyn Clock,
    /// Signals and keys.
    pub stop: &'a StopSwitch,
    /// New gestures while the run goes on.
    pub handover: Option<&'a mut Handover>,
    /// Who looks on.
    pub recorder: &'a mut dyn Recorder,
    /// Called once with the time of cycle 0 on `clock`.
    pub on_start: &'a mut dyn FnMut(Time),
}

/// Time missed beyond this is not caught up: motion goes on from where it stood. More in one goal would
/// be a jump for the servo.
const CATCH_UP_AT_MOST_S: f64 = 0.02;
/// Time in the end pose before torque goes off, so that lagging servos arrive, seconds.
const REST_AT_END_S: f64 = 0.3;
/// Most samples handed to one cycle.
const SAMPLES_PER_CYCLE: usize = 64;

/// Runs from a safe start to the declared end. Torque is switched off on every way out but an
/// orderly end with `torque_off_at_end` unset; that includes a panic of the step.
pub fn run(mut parts: Parts<'_>, options: &ControlOptions) -> Outcome {
    let mut stats = Stats::default();
    let ending = match catch_unwind(AssertUnwindSafe(|| cycles(&mut parts, options, &mut stats))) {
        Ok(Ok(ending)) => ending,
        Ok(Err(error)) => Ending::Bus(error),
        Err(_) => Ending::SafetyStop(
            "an internal error stopped the control loop (its message is above); please report it"
                .into(),
        ),
    };
    let keep_torque = matches!(ending, Ending::Complete) && !options.torque_off_at_end;
    let torque = if keep_torque {
        None
    } else {
        Some(parts.bus.torque_off())
    };
    Outcome {
        ending,
        stats,
        torque,
    }
}

fn cycles(
    parts: &mut Parts<'_>,
    options: &ControlOptions,
    stats: &mut Stats,
) -> Result<Ending, BusError> {
    let joints = parts.bus.joints().len();
    let mut states = vec![JointState::default(); joints];
    parts.bus.prepare(&mut states)?;
    if parts.stop.request() != StopRequest::None {
        return Ok(Ending::Interrupted);
    }
    parts.bus.arm()?;
    // Not what was read before: a limp joint may have moved until its torque came on.
    let mut armed_at: Vec<f64> = states.iter().map(|s| s.position).collect();
    parts.bus.goals(&mut armed_at);
    parts.puppet.begin(Time::ZERO, &armed_at);

    let dt_s = 1.0 / options.rate_hz;
    let mut samples: Vec<PoseSample> = Vec::with_capacity(SAMPLES_PER_CYCLE);
    let mut start = parts.clock.now();
    (parts.on_start)(start);
    let mut input_begun = false;
    let mut rest_cycles = (REST_AT_END_S * options.rate_hz) as u64;
    let mut reason: Option<String> = None;
    let mut cycle: i64 = 0;
    loop {
        let deadline = start + Duration::from_secs_f64(cycle as f64 * dt_s);
        parts.clock.sleep_until(deadline);
        let late_s = parts.clock.now().secs_since(deadline).max(0.0);
        stats.lateness.add((late_s * 1e6) as u64);
        let mut behind = (late_s / dt_s) as i64;
        stats.overruns += behind as u64;
        if behind as f64 * dt_s > CATCH_UP_AT_MOST_S {
            start = start + Duration::from_secs_f64(behind as f64 * dt_s);
            behind = 0;
        }
        // Missed cycles are computed, so that motion has no gap in time; only the last one is sent.
        let mut newest_sample_s = None;
        for k in cycle..=cycle + behind {
            let last = k == cycle + behind;
            let t_s = k as f64 * dt_s;
            parts.feed.take(t_s, &mut samples);
            stats.samples += samples.len() as u64;
            if let Some(handover) = &mut parts.handover {
                handover.cycle(parts.puppet, &samples);
            }
            newest_sample_s = samples.last().map(|s| s.t).or(newest_sample_s);
            let request = parts.stop.request();
            if request == StopRequest::AtOnce {
                return Ok(Ending::Interrupted);
            }
            let finish = reason.is_some()
                || request == StopRequest::Orderly
                || parts.feed.ended()
                || options.duration_s.is_some_and(|d| t_s >= d);
            let inputs = Inputs {
                samples: &samples,
                states: &states,
                finish,
            };
            let before = Instant::now();
            let targets = parts.puppet.step(Time::from_secs(t_s), &inputs);
            let step_us = before.elapsed().as_micros() as u64;
            stats.step.add(step_us);
            stats.cycles += 1;
            stats.held_back += u64::from(targets.held_back > 0);
            stats.poses_lost += u64::from(targets.poses_lost);
            if reason.is_none() && !finish && targets.stage == Stage::Settling {
                // Nobody asked for the end, so the puppet gave up by itself.
                reason = Some(
                    "no poses came for longer than safety.lost_s, and safety.on_lost is \"stop\""
                        .into(),
                );
            }
            parts.feed.give_back(&mut samples);
            let report = if last {
                send(parts, &mut states, newest_sample_s, start, stats)?
            } else {
                CycleReport::default()
            };
            if last {
                stats.bus(t_s, &report);
                let fallen = report.alert_mask | report.torqueless_mask;
                if options.stop_on_servo_fault && fallen != 0 && reason.is_none() {
                    reason = Some(fallen_servos(parts.bus.joints(), &report));
                }
                let next = deadline + Duration::from_secs_f64((behind + 1) as f64 * dt_s);
                stats.missed += u64::from(parts.clock.now() > next);
            }
            if let Some(record) = parts.recorder.slot() {
                record.fill(parts.puppet, &states);
                record.t_s = t_s;
                record.bus = report;
                record.late_us = (late_s * 1e6) as u64;
                record.step_us = step_us;
                record.overruns = stats.overruns;
                record.missed = stats.missed;
                record.pose_to_wire_us = stats.latest_pose_to_wire_us.filter(|_| last);
                record.fill_health(parts.bus.health());
                parts.recorder.commit();
            }
            let stage = parts.puppet.stage();
            if stage == Stage::Playing && !input_begun {
                parts.feed.begin(t_s + dt_s);
                input_begun = true;
            }
            if stage == Stage::Done {
                rest_cycles = rest_cycles.saturating_sub(1);
            }
        }
        if rest_cycles == 0 {
            break;
        }
        cycle += behind + 1;
    }
    Ok(if let Some(reason) = reason {
        Ending::SafetyStop(reason)
    } else if parts.stop.request() == StopRequest::None {
        Ending::Complete
    } else {
        Ending::Interrupted
    })
}

/// Names the joints whose servos latched an error or came back without torque.
fn fallen_servos(joints: &[String], report: &CycleReport) -> String {
    let named = |mask: u64| -> Vec<&str> {
        let hit = |i: usize| i < 64 && mask >> i & 1 == 1;
        (0..joints.len())
            .filter(|i| hit(*i))
            .map(|i| joints[i].as_str())
            .collect()
    };
    let mut parts = Vec::new();
    for (mask, what) in [
        (report.alert_mask, "hardware error latched"),
        (report.torqueless_mask, "came back without torque"),
    ] {
        if mask != 0 {
            parts.push(format!("{what}: {}", named(mask).join(", ")));
        }
    }
    format!(
        "{}. Look at it with `handwave bus read BUS ID all`, mend the cause, `handwave bus reboot BUS ID` \
         (safety.on_servo_fault = \"continue\" plays on without it)",
        parts.join("; ")
    )
}

/// One exchange with the bus; counts the way from the newest sample to the wire.
fn send(
    parts: &mut Parts<'_>,
    states: &mut [JointState],
    newest_sample_s: Option<f64>,
    start: Time,
    stats: &mut Stats,
) -> Result<CycleReport, BusError> {
    let began = parts.clock.now();
    let report = parts
        .bus
        .exchange(&parts.puppet.targets().positions, states)?;
    stats.latest_pose_to_wire_us = newest_sample_s.map(|arrived_s| {
        let sent = began + Duration::from_micros(u64::from(report.goal_sent_us));
        ((sent.secs_since(start) - arrived_s).max(0.0) * 1e6) as u64
    });
    if let Some(waited_us) = stats.latest_pose_to_wire_us {
        stats.pose_to_wire.add(waited_us);
    }
    Ok(report)
}
