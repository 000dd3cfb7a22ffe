//! What one control cycle shows to those who look on: targets, states, gestures, graph, bus.

use crate::base::JointState;
use crate::body::RootPose;
use crate::bus::{CycleReport, ServoHealth};
use crate::gesture::GestureEstimate;
use crate::motion::class::Played;
use crate::motion::graph::Transition;
use crate::puppet::{Puppet, Stage};
use rtrb::{Consumer, Producer, RingBuffer};

/// A snapshot of one cycle. Filled in place, so that recording allocates nothing.
#[derive(Clone, Debug, Default)]
pub struct CycleRecord {
    /// Time of the cycle since the start of the run, seconds.
    pub t_s: f64,
    /// Where in its run the puppet is.
    pub stage: Stage,
    /// Targets after the envelope, rad.
    pub targets: Vec<f64>,
    /// Measured joint states.
    pub states: Vec<JointState>,
    /// Gestures as used.
    pub gestures: Vec<GestureEstimate>,
    /// What each class did.
    pub played: Vec<Played>,
    /// Blend weight of every clip of the class being played.
    pub clips: Vec<f64>,
    /// Weight of each layer.
    pub layers: Vec<f64>,
    /// Class being played.
    pub active: usize,
    /// Transition in progress with the weight of its target.
    pub transition: Option<(Transition, f64)>,
    /// Travelled way.
    pub root: RootPose,
    /// The body over the ground, of a robot that walks: forward, left, height (m), roll, pitch, yaw (rad).
    pub body: Vec<f64>,
    /// Feet that the motion has on the ground, one bit each.
    pub grounded: u64,
    /// Joints held back by the envelope.
    pub held_back: usize,
    /// Age of the last pose, seconds.
    pub pose_age_s: Option<f64>,
    /// Poses count as lost.
    pub poses_lost: bool,
    /// What the bus saw.
    pub bus: CycleReport,
    /// Lateness of the cycle's start, microseconds.
    pub late_us: u64,
    /// Time to compute the step, microseconds.
    pub step_us: u64,
    /// Overruns so far.
    pub overruns: u64,
    /// Cycles so far whose bus exchange ended after the next deadline.
    pub missed: u64,
    /// From the arrival of the newest sample of this cycle to its goals on the wire, microseconds.
    pub pose_to_wire_us: Option<u64>,
    /// How each servo is.
    pub health: Vec<ServoHealth>,
}

impl CycleRecord {
    /// A record with room for a puppet's joints, gestures, classes and layers.
    pub fn for_puppet(puppet: &Puppet) -> Self {
        let mut record = Self::default();
        record.fill(
            puppet,
            &vec![JointState::default(); puppet.targets().positions.len()],
        );
        record
    }

    /// Copies how the servos are.
    pub fn fill_health(&mut self, health: &[ServoHealth]) {
        refill(&mut self.health, health.iter().copied());
    }

    /// Copies the puppet's state of the last step.
    pub fn fill(&mut self, puppet: &Puppet, states: &[JointState]) {
        let targets = puppet.targets();
        let animator = puppet.animator();
        self.stage = targets.stage;
        self.held_back = targets.held_back;
        self.pose_age_s = targets.pose_age_s;
        self.poses_lost = targets.poses_lost;
        refill(&mut self.targets, targets.positions.iter().copied());
        refill(&mut self.states, states.iter().copied());
        refill(&mut self.gestures, puppet.estimates().iter().copied());
        refill(&mut self.played, animator.played().iter().copied());
        refill(
            &mut self.clips,
            animator.classes()[animator.active()]
                .weights()
                .iter()
                .copied(),
        );
        refill(
            &mut self.layers,
            animator.layers().iter().map(|l| l.weight()),
        );
        self.active = animator.active();
        self.transition = animator.transition();
        self.root = animator.root();
        let pins = animator.pins();
        self.grounded = pins.map_or(0, |pins| pins.grounded());
        let beyond = if pins.is_some() {
            targets.positions.len()
        } else {
            puppet.pose().len()
        };
        refill(&mut self.body, puppet.pose()[beyond..].iter().copied());
    }
}

fn refill<T>(into: &mut Vec<T>, from: impl Iterator<Item = T>) {
    into.clear();
    into.extend(from);
}

/// Takes one record per cycle. Called from the control loop: must not block or allocate.
pub trait Recorder {
    /// The record to fill for this cycle; `None` when there is no room and the cycle is not recorded.
    fn slot(&mut self) -> Option<&mut CycleRecord>;
    /// The record from [`Recorder::slot`] is complete.
    fn commit(&mut self);
}

/// Hands every record to a function at once: for virtual time, where nobody waits.
pub struct Inline<F> {
    record: CycleRecord,
    each: F,
}

impl<F: FnMut(&CycleRecord)> Inline<F> {
    /// Calls `each` with every record.
    pub fn new(puppet: &Puppet, each: F) -> Self {
        Self {
            record: CycleRecord::for_puppet(puppet),
            each,
        }
    }
}

impl<F: FnMut(&CycleRecord)> Recorder for Inline<F> {
    fn slot(&mut self) -> Option<&mut CycleRecord> {
        Some(&mut self.record)
    }
    fn commit(&mut self) {
        (self.each)(&self.record);
    }
}

/// The control thread's end of a lock-free queue of records.
pub struct QueueRecorder {
    full: Producer<Box<CycleRecord>>,
    spare: Consumer<Box<CycleRecord>>,
    filling: Option<Box<CycleRecord>>,
    lost: u64,
}

/// The observer's end: takes records and hands them back to be filled again.
pub struct RecordReader {
    full: Consumer<Box<CycleRecord>>,
    spare: Producer<Box<CycleRecord>>,
}

/// Gestures beyond those of the start for which records have room.
const MORE_GESTURES: usize = 32;

/// A queue of `depth` records for `puppet`.
pub fn record_queue(puppet: &Puppet, depth: usize) -> (QueueRecorder, RecordReader) {
    let (full_in, full_out) = RingBuffer::new(depth);
    let (mut spare_in, spare_out) = RingBuffer::new(depth);
    let blank = CycleRecord::for_puppet(puppet);
    let roomy = || {
        let mut record = Box::new(blank.clone());
        // Gestures that are defined while the run goes on must find room without an allocation.
        record.gestures.reserve(MORE_GESTURES);
        record.health.reserve(record.states.len());
        record
    };
    while spare_in.push(roomy()).is_ok() {}
    (
        QueueRecorder {
            full: full_in,
            spare: spare_out,
            filling: None,
            lost: 0,
        },
        RecordReader {
            full: full_out,
            spare: spare_in,
        },
    )
}

impl QueueRecorder {
    /// Records that found no room.
    pub fn lost(&self) -> u64 {
        self.lost
    }
}

impl Recorder for QueueRecorder {
    fn slot(&mut self) -> Option<&mut CycleRecord> {
        if self.filling.is_none() {
            self.filling = self.spare.pop().ok();
        }
        if self.filling.is_none() {
            self.lost += 1;
        }
        self.filling.as_deref_mut()
    }

    fn commit(&mut self) {
        if let Some(record) = self.filling.take() {
            // Room is certain: there are as many places as records.
            let _ = self.full.push(record);
        }
    }
}

impl RecordReader {
    /// Calls `each` with every record that waits; returns how many there were.
    pub fn drain(&mut self, mut each: impl FnMut(&CycleRecord)) -> usize {
        let mut count = 0;
        while let Ok(record) = self.full.pop() {
            each(&record);
            let _ = self.spare.push(record);
            count += 1;
        }
        count
    }
}
