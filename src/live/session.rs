//! A session: a character, its poses and its bus, run to the end in real or in virtual time.

use super::arrival::Hangup;
use super::control::{ControlOptions, Ending, Outcome, Parts};
use super::feed::{ReaderFeed, read_ahead};
use super::realtime::{self, RealTime};
use super::record::{CycleRecord, Inline, record_queue};
use super::recording::{Taps, tap};
use super::reload::{self, News, Watcher};
use super::stats::Stats;
use super::stop::StopSwitch;
use crate::base::{Clock, Time, VirtualClock};
use crate::bus::{BusError, ServoBus, TorqueReport};
use crate::config::file::{OnExit, OnLost, OnServoFault};
use crate::config::{Character, ConfigError, GestureFiles};
use crate::gesture::{FrontEnd, FrontEndError, TrackingCounts};
use crate::motion::graph::TransitionCounts;
use crate::pose::{FaultCounts, PoseError, PoseHeader, PoseReader, PoseSample};
use crate::puppet::{LostPolicy, Puppet, PuppetOptions};
use std::io::BufRead;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::time::Duration;

/// What a session left behind.
#[derive(Debug)]
pub struct Report {
    /// How it ended.
    pub ending: Ending,
    /// What the loop measured.
    pub stats: Stats,
    /// Torque read back at the end; `None` when it stays on as declared.
    pub torque: Option<Result<TorqueReport, BusError>>,
    /// Transitions of the motion graph.
    pub transitions: TransitionCounts,
    /// Pose samples dropped, by reason.
    pub dropped: FaultCounts,
    /// Datagrams of a live source that came before its header.
    pub before_header: u64,
    /// Samples that the front end refused.
    pub refused: u64,
    /// What the front end mended of the tracker's.
    pub tracking: TrackingCounts,
    /// The performer's scale; `None` when it was to be measured and the pose was never still.
    pub performer_scale: Option<f64>,
    /// Why the pose stream ended early, if it did.
    pub pose_error: Option<PoseError>,
    /// Cycles that were not recorded because the observer was slow.
    pub records_lost: u64,
    /// What the system granted the control thread (real time only).
    pub real_time: Option<RealTime>,
    /// What the bus found worth telling.
    pub notes: Vec<String>,
}

/// Why a session could not begin.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// Gestures and stream do not fit.
    #[error("{0}")]
    FrontEnd(#[from] FrontEndError),
    /// The configuration does not fit the stream.
    #[error("{0}")]
    Config(#[from] ConfigError),
    /// A thread could not be started.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] std::io::Error),
}

/// The gesture front end of `character` for a stream with `header`.
pub fn front_end(character: &Character, header: &PoseHeader) -> Result<FrontEnd, SessionError> {
    let front = FrontEnd::with_features(
        &character.gestures,
        header,
        character.front_options,
        &character.neighbourhoods(),
        &character.features(),
    )?;
    Ok(character.with_channels(front)?)
}

/// Builds the puppet of `character` for a stream with `header`, at `rate_hz`.
pub fn puppet(
    character: &Character,
    header: &PoseHeader,
    rate_hz: f64,
) -> Result<Puppet, SessionError> {
    let front = front_end(character, header)?;
    let mut animator = character.animator(&front)?;
    let inputs = character.class_inputs(&front)?;
    let end_pose = character.end_pose.clone().unwrap_or_else(|| {
        let mut rest = vec![0.0; animator.coordinates()];
        animator.rest_pose(&mut rest);
        rest.truncate(character.joints.len());
        rest
    });
    let safety = &character.safety;
    let dt_s = 1.0 / rate_hz;
    Ok(Puppet::new(
        front,
        animator,
        character.envelope(dt_s),
        inputs,
        end_pose,
        PuppetOptions {
            dt_s,
            ramp_s: safety.ramp_s,
            end_ramp_s: safety.end_ramp_s,
            actuation_delay_s: safety.actuation_delay_s,
            coast_s: safety.coast_s,
            lost_s: safety.lost_s,
            on_lost: match safety.on_lost {
                OnLost::Idle => LostPolicy::Idle,
                OnLost::Hold => LostPolicy::Hold,
                OnLost::Stop => LostPolicy::Stop,
            },
        },
    ))
}

/// Options of the control loop for `character`.
pub fn control_options(
    character: &Character,
    rate_hz: f64,
    duration_s: Option<f64>,
) -> ControlOptions {
    ControlOptions {
        rate_hz,
        duration_s,
        torque_off_at_end: character.safety.on_exit == OnExit::TorqueOff,
        stop_on_servo_fault: character.safety.on_servo_fault == OnServoFault::Stop,
    }
}

/// Looks on while a session runs.
pub trait Observer {
    /// Sees every cycle, in order.
    fn cycle(&mut self, record: &CycleRecord);
    /// Called some times a second in real time; never in virtual time.
    fn tick(&mut self);
    /// Gesture files were changed while the session ran.
    fn news(&mut self, news: &News) {
        let _ = news;
    }
}

/// A session ready to run.
pub struct Session<R> {
    /// The pure step.
    pub puppet: Puppet,
    /// The servos; on the same clock as the run.
    pub bus: Box<dyn ServoBus>,
    /// The poses, from the second sample on.
    pub reader: PoseReader<R>,
    /// The first sample: a stream without one is found out before anything moves.
    pub first: PoseSample,
    /// How the reader is ended when it is live; its samples are then due on arrival.
    pub live: Option<Hangup>,
    /// Gesture files that are loaded again when they change (real time only).
    pub reload: Option<GestureFiles>,
    /// Signals and keys.
    pub stop: StopSwitch,
    /// Rate, duration, what happens at the end.
    pub options: ControlOptions,
    /// Logs of all that reaches the run from outside; the bus's ports are tapped already.
    pub taps: Option<Taps>,
    /// Called with the bus clock's time of cycle 0, right after the servos were armed.
    pub on_start: Box<dyn FnMut(Time) + Send>,
}

/// Runs in virtual time, in this thread: as fast as it computes, the same bytes every time.
///
/// The session's bus must live on `clock`.
pub fn run_virtual<R: BufRead>(
    mut session: Session<R>,
    clock: &VirtualClock,
    observer: &mut dyn Observer,
) -> Report {
    let mut feed = ReaderFeed::new(session.reader, session.first);
    let mut recorder = Inline::new(&session.puppet, |record| observer.cycle(record));
    let outcome = tap::run(
        session.taps.as_ref(),
        Parts {
            puppet: &mut session.puppet,
            bus: session.bus.as_mut(),
            feed: &mut feed,
            clock,
            stop: &session.stop,
            handover: None,
            recorder: &mut recorder,
            on_start: session.on_start.as_mut(),
        },
        &session.options,
    );
    let read = feed.finish();
    report(
        outcome,
        &session.puppet,
        session.bus.as_ref(),
        read,
        0,
        None,
    )
}

/// Records kept between the control thread and this one: ten seconds at 200 Hz.
const RECORDS: usize = 2048;

/// Runs in real time: the control loop on a thread of its own, the reader on another; the observer
/// looks on in this one and is ticked about `tick_hz` times a second.
pub fn run_real<R: BufRead + Send + 'static>(
    session: Session<R>,
    clock: Arc<dyn Clock>,
    observer: &mut dyn Observer,
    tick_hz: f64,
) -> Result<Report, SessionError> {
    let (mut handover, watcher) = match session.reload {
        Some(files) => {
            let header = session.reader.header();
            let (ours, loader) = reload::handover(header);
            let watcher = Watcher::start(files, header.clone(), loader)?;
            (Some(ours), Some(watcher))
        }
        None => (None, None),
    };
    let (mut feed, reading) = read_ahead(session.reader, session.first, session.live.is_some())?;
    let (mut recorder, mut records) = record_queue(&session.puppet, RECORDS);
    let (mut puppet, mut bus, mut on_start) = (session.puppet, session.bus, session.on_start);
    let (stop, options, taps) = (session.stop, session.options, session.taps);
    let emergency = stop.clone();
    let control = std::thread::Builder::new()
        .name("control".into())
        .spawn(move || {
            let real_time = realtime::request();
            let outcome = tap::run(
                taps.as_ref(),
                Parts {
                    puppet: &mut puppet,
                    bus: bus.as_mut(),
                    feed: &mut feed,
                    clock: clock.as_ref(),
                    stop: &stop,
                    handover: handover.as_mut(),
                    recorder: &mut recorder,
                    on_start: on_start.as_mut(),
                },
                &options,
            );
            (outcome, puppet, bus, recorder.lost(), real_time)
        })?;
    let period = Duration::from_secs_f64(1.0 / tick_hz);
    let watched = catch_unwind(AssertUnwindSafe(|| {
        while !control.is_finished() {
            std::thread::sleep(period);
            records.drain(|record| observer.cycle(record));
            while let Some(news) = watcher.as_ref().and_then(Watcher::news) {
                observer.news(&news);
            }
            observer.tick();
        }
    }));
    if let Err(panic) = watched {
        // Whoever looks on failed: torque off first, then the panic goes its way.
        emergency.press();
        emergency.press();
        let _ = control.join();
        resume_unwind(panic);
    }
    let finished = control.join();
    records.drain(|record| observer.cycle(record));
    let Ok((outcome, puppet, bus, lost, real_time)) = finished else {
        // The loop itself catches panics of the step; only its own end could get here.
        return Err(SessionError::Thread(std::io::Error::other(
            "the control thread ended abnormally; the servos' own watchdog stops them",
        )));
    };
    if let Some(live) = &session.live {
        live.close();
    }
    // A source that blocks (a file on a device that hangs) must not hold up the end; its thread dies with us.
    let read = if session.live.is_some() || reading.is_finished() {
        reading.join().unwrap_or_default()
    } else {
        Default::default()
    };
    let report = report(outcome, &puppet, bus.as_ref(), read, lost, Some(real_time));
    Ok(Report {
        before_header: session.live.map_or(0, |live| live.before_header()),
        ..report
    })
}

fn report(
    outcome: Outcome,
    puppet: &Puppet,
    bus: &dyn ServoBus,
    (dropped, pose_error): (FaultCounts, Option<PoseError>),
    records_lost: u64,
    real_time: Option<RealTime>,
) -> Report {
    Report {
        ending: outcome.ending,
        stats: outcome.stats,
        torque: outcome.torque,
        transitions: puppet.animator().counts(),
        dropped,
        before_header: 0,
        refused: puppet.rejected_samples(),
        tracking: puppet.front().tracking(),
        performer_scale: puppet.front().performer_scale(),
        pose_error,
        records_lost,
        real_time,
        notes: bus.notes().to_vec(),
    }
}
