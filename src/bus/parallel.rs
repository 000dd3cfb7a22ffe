//! Several buses as one: exchanged at the same time, in threads of their own.
//!
//! In real time each bus has a worker; in a cycle the control thread hands every part but the last to its
//! worker, does the last one itself and takes the parts back. What is handed over is the part itself, bus and
//! buffers in one box, through a queue for one; nothing is copied, locked or allocated.
//!
//! In virtual time there are no threads. Each simulated bus has a [branch](crate::base::Clock::branch) of the
//! clock: one after the other begins at the same instant and moves its own branch on; then the common clock
//! moves to the latest of them. So a run is the same every time, and takes as long as the slowest bus.

mod lane;

use super::{BusError, CycleReport, ServoBus, ServoFacts, ServoHealth, TorqueReport};
use crate::base::{Clock, JointState, Time, VirtualClock};
use lane::{Done, Job, Lane};
use std::sync::Arc;

/// One of the buses.
pub struct BusPart {
    /// Its name in the configuration.
    pub name: String,
    /// The bus itself.
    pub bus: Box<dyn ServoBus>,
    /// In virtual time: the branch of the clock that it lives on.
    pub branch: Option<VirtualClock>,
}

/// Why several buses do not make one.
#[derive(Debug, thiserror::Error)]
pub enum ParallelError {
    /// A joint hangs on no bus, or on two, or is not one of the robot's.
    #[error("joint {joint} hangs on {found} of the buses, expected is one")]
    Joint {
        /// The joint.
        joint: String,
        /// On how many.
        found: usize,
    },
    /// The system gives no thread.
    #[error("cannot start a thread for bus {name}: {reason}")]
    Thread {
        /// The bus.
        name: String,
        /// What the system said.
        reason: std::io::Error,
    },
}

/// Several buses as one.
///
/// A bus that fails makes one [`exchange`](ServoBus::exchange) fail with [`BusError::OnBus`], which names it and
/// its joints. Whoever goes on calling drives the others, while those joints are reported silent; when no bus
/// is left, every exchange fails. [`reopen`](ServoBus::reopen) looks for the lost ones beside the exchanges,
/// [`prepare`](ServoBus::prepare) and [`arm`](ServoBus::arm) then concern those alone.
pub struct ParallelBus {
    joints: Vec<String>,
    lanes: Vec<Lane>,
    facts: Vec<ServoFacts>,
    health: Vec<ServoHealth>,
    notes: Vec<String>,
    /// In virtual time: the clock that the branches come from. Time that passes by itself is not asked for.
    clock: Option<Arc<dyn Clock>>,
}

impl ParallelBus {
    /// The buses of `parts` for the joints `joints`, in that order, on `clock`. `enter` is called once in each
    /// worker thread, to ask for its priority.
    ///
    /// # Errors
    /// A joint is not on exactly one bus; a thread cannot be started.
    pub fn new(
        joints: Vec<String>,
        parts: Vec<BusPart>,
        clock: Arc<dyn Clock>,
        enter: fn(),
    ) -> Result<Self, ParallelError> {
        let known = |joint: &String| joints.contains(joint);
        let mut carried = parts.iter().flat_map(|part| part.bus.joints());
        if let Some(joint) = carried.find(|joint| !known(joint)) {
            let (joint, found) = (joint.clone(), 0);
            return Err(ParallelError::Joint { joint, found });
        }
        for joint in &joints {
            let on = |part: &&BusPart| part.bus.joints().contains(joint);
            let found = parts.iter().filter(on).count();
            if found != 1 {
                let joint = joint.clone();
                return Err(ParallelError::Joint { joint, found });
            }
        }
        let branched = parts.iter().any(|part| part.branch.is_some());
        let lanes = parts
            .into_iter()
            .map(|part| Lane::new(part, &joints, enter))
            .collect::<Result<_, _>>()?;
        Ok(ParallelBus {
            facts: Vec::new(),
            health: vec![ServoHealth::default(); joints.len()],
            joints,
            lanes,
            notes: Vec::new(),
            clock: Some(clock).filter(|_| branched),
        })
    }

    /// The time, where it has to be moved on.
    fn now(&self) -> Time {
        self.clock.as_ref().map_or(Time::ZERO, |clock| clock.now())
    }

    fn move_on(&self, end: Time) {
        if let Some(clock) = &self.clock
            && clock.now() < end
        {
            clock.sleep_until(end);
        }
    }

    /// Has `job` done by all lanes that `wanted` picks, at the same time. Their results are in the lanes.
    fn all(&mut self, job: Job, wanted: impl Fn(&Lane) -> bool) {
        let begin = self.now();
        let last = self.lanes.iter().rposition(&wanted);
        for (index, lane) in self.lanes.iter_mut().enumerate() {
            // Decided now: a part that is away is not wanted by the looks of it.
            lane.takes_part = wanted(lane);
            if Some(index) != last && lane.takes_part {
                lane.start(job, begin);
            }
        }
        if let Some(lane) = last.and_then(|last| self.lanes.get_mut(last)) {
            lane.run_here(job, begin);
        }
        let mut end = begin;
        for lane in self.lanes.iter_mut().filter(|lane| lane.takes_part) {
            lane.wait();
            end = end.max(lane.time().unwrap_or(begin));
        }
        self.move_on(end);
    }

    /// The first lane's error that has not been told yet.
    fn first_error(&mut self) -> Result<(), BusError> {
        for lane in &mut self.lanes {
            if let Some(error) = lane.error.take() {
                return Err(lane.named(error));
            }
        }
        Ok(())
    }

    fn collect(&mut self) {
        self.notes.clear();
        self.facts.clear();
        self.facts.resize(self.joints.len(), ServoFacts::default());
        for lane in &self.lanes {
            let notes = lane.notes();
            self.notes.extend(
                notes
                    .iter()
                    .map(|note| format!("bus {}: {note}", lane.name)),
            );
            for (facts, &joint) in lane.facts().iter().zip(&lane.joints) {
                self.facts[joint].clone_from(facts);
            }
            lane.copy_health(&mut self.health);
        }
    }

    /// Does `work` on the bus of joint `joint`, which is number so many there.
    fn on_lane_of(
        &mut self,
        joint: usize,
        work: impl FnOnce(&mut dyn ServoBus, usize) -> Result<(), BusError>,
    ) -> Result<(), BusError> {
        let begin = self.now();
        for lane in &mut self.lanes {
            let Some(place) = lane.joints.iter().position(|&own| own == joint) else {
                continue;
            };
            let done = lane.here(begin, |bus| work(bus, place));
            let done = done.map_err(|error| lane.named(error));
            let end = lane.time().unwrap_or(begin);
            self.move_on(end);
            return done;
        }
        Ok(())
    }
}

impl ServoBus for ParallelBus {
    fn joints(&self) -> &[String] {
        &self.joints
    }

    fn prepare(&mut self, states: &mut [JointState]) -> Result<(), BusError> {
        self.all(Job::Prepare, |lane| lane.is_free() && !lane.prepared);
        for lane in &mut self.lanes {
            if lane.takes_part
                && let Some(Done::Prepared(outcome)) = lane.take_done()
            {
                lane.prepared = outcome.is_ok();
                lane.error = outcome.err();
            }
            lane.copy_states(states);
        }
        self.collect();
        self.first_error()
    }

    fn arm(&mut self) -> Result<(), BusError> {
        let wanted = |lane: &Lane| lane.is_free() && lane.prepared && !lane.armed;
        self.all(Job::Arm, wanted);
        let mut failed = false;
        for lane in &mut self.lanes {
            if lane.takes_part
                && let Some(Done::Armed(outcome)) = lane.take_done()
            {
                lane.armed = outcome.is_ok();
                lane.newly_armed = lane.armed;
                failed |= outcome.is_err();
                lane.error = outcome.err();
            }
        }
        if failed {
            // Better limp than half awake: those that came up in the same call go down again.
            self.all(Job::TorqueOff, |lane| lane.newly_armed);
            for lane in &mut self.lanes {
                lane.armed &= !lane.newly_armed;
                lane.take_done();
            }
        }
        for lane in &mut self.lanes {
            lane.newly_armed = false;
        }
        self.first_error()
    }

    fn goals(&self, out_rad: &mut [f64]) {
        for lane in &self.lanes {
            lane.copy_goals(out_rad);
        }
    }

    fn exchange(
        &mut self,
        targets_rad: &[f64],
        states: &mut [JointState],
    ) -> Result<CycleReport, BusError> {
        for lane in &mut self.lanes {
            lane.take_targets(targets_rad);
        }
        self.all(Job::Exchange, Lane::is_driven);
        let mut whole = CycleReport::default();
        let mut alive = false;
        for lane in &mut self.lanes {
            // What came of the search for a lost one is not taken here.
            if !lane.takes_part {
                lane.add_silence(&mut whole);
                continue;
            }
            match lane.take_done() {
                Some(Done::Exchanged(Ok(report))) => {
                    alive = true;
                    lane.add_report(&report, &mut whole);
                    lane.copy_states(states);
                    lane.copy_health(&mut self.health);
                }
                Some(Done::Exchanged(Err(error))) => {
                    lane.lose();
                    lane.error = Some(error);
                }
                _ => lane.add_silence(&mut whole),
            }
        }
        self.first_error()?;
        if !alive && let Some(lane) = self.lanes.first() {
            let sought = BusError::NotBack {
                bus: lane.name.clone(),
                sought: "any of the buses".into(),
                found: "all of them are lost".into(),
            };
            return Err(sought);
        }
        Ok(whole)
    }

    fn torque_off(&mut self) -> Result<TorqueReport, BusError> {
        for lane in &mut self.lanes {
            // One that is being looked for is waited for: this outranks it.
            lane.wait();
            lane.take_done();
        }
        self.all(Job::TorqueOff, |_| true);
        let mut whole = TorqueReport::default();
        let mut reached = false;
        let mut last_error = None;
        for lane in &mut self.lanes {
            lane.armed = false;
            match lane.take_done() {
                Some(Done::TorqueOff(Ok(report))) => {
                    reached = true;
                    whole.confirmed_off.extend(report.confirmed_off);
                    whole.unconfirmed.extend(report.unconfirmed);
                }
                Some(Done::TorqueOff(Err(error))) => {
                    for &joint in &lane.joints {
                        let unconfirmed = (self.joints[joint].clone(), error.to_string());
                        whole.unconfirmed.push(unconfirmed);
                    }
                    last_error = Some(lane.named(error));
                }
                _ => {}
            }
        }
        match last_error {
            Some(error) if !reached => Err(error),
            _ => Ok(whole),
        }
    }

    fn rearm(&mut self, joint: usize) -> Result<(), BusError> {
        self.on_lane_of(joint, |bus, place| bus.rearm(place))
    }

    fn reboot(&mut self, joint: usize) -> Result<(), BusError> {
        self.on_lane_of(joint, |bus, place| bus.reboot(place))
    }

    fn facts(&self) -> &[ServoFacts] {
        &self.facts
    }

    fn health(&self) -> &[ServoHealth] {
        &self.health
    }

    /// Begins to look for every lost bus and returns at once; the workers do it while the others are
    /// exchanged. Succeeds in the call in which none is lost any more.
    fn reopen(&mut self) -> Result<(), BusError> {
        let now = self.now();
        let mut missing = None;
        for lane in self.lanes.iter_mut().filter(|lane| lane.lost) {
            match lane.search(now) {
                Some(Ok(())) => {
                    lane.lost = false;
                    (lane.prepared, lane.armed) = (false, false);
                }
                Some(Err(error)) => missing = Some(lane.named(error)),
                None => {
                    let searching = BusError::NotBack {
                        bus: lane.name.clone(),
                        sought: "it".into(),
                        found: "the search goes on".into(),
                    };
                    missing = Some(lane.named(searching));
                }
            }
        }
        missing.map_or(Ok(()), Err)
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }
}

/// The later of two times, for branches.
fn later(a: Option<Time>, b: Time) -> Time {
    a.map_or(b, |a| a.max(b))
}
