//! One of several buses: the part that goes to and fro between control thread and worker.

use super::{BusPart, ParallelError, later};
use crate::base::{Clock, JointState, Time, VirtualClock};
use crate::bus::{BusError, CycleReport, ServoBus, ServoFacts, ServoHealth, TorqueReport};
use rtrb::{Consumer, Producer, RingBuffer};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::thread::{self, JoinHandle, Thread};

/// What a part is to do.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub(super) enum Job {
    Prepare,
    Arm,
    Exchange,
    TorqueOff,
    Reopen,
}

/// What came of it.
pub(super) enum Done {
    Prepared(Result<(), BusError>),
    Armed(Result<(), BusError>),
    Exchanged(Result<CycleReport, BusError>),
    TorqueOff(Result<TorqueReport, BusError>),
    Reopened(Result<(), BusError>),
    Panicked(Box<dyn Any + Send>),
}

/// A bus with its buffers.
struct Part {
    bus: Box<dyn ServoBus>,
    targets: Vec<f64>,
    states: Vec<JointState>,
    job: Job,
    done: Option<Done>,
}

impl Part {
    fn run(&mut self) {
        let Part {
            bus,
            targets,
            states,
            job,
            done,
        } = self;
        let work = AssertUnwindSafe(|| match job {
            Job::Prepare => Done::Prepared(bus.prepare(states)),
            Job::Arm => Done::Armed(bus.arm()),
            Job::Exchange => Done::Exchanged(bus.exchange(targets, states)),
            Job::TorqueOff => Done::TorqueOff(bus.torque_off()),
            Job::Reopen => Done::Reopened(bus.reopen()),
        });
        *done = Some(catch_unwind(work).unwrap_or_else(Done::Panicked));
    }
}

/// The thread of a lane.
struct Worker {
    /// `None` once the lane ends.
    to: Option<Producer<(Box<Part>, Thread)>>,
    from: Consumer<Box<Part>>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    fn start(name: &str, enter: fn()) -> std::io::Result<Self> {
        let (to, mut jobs) = RingBuffer::<(Box<Part>, Thread)>::new(1);
        let (mut results, from) = RingBuffer::new(1);
        let thread = thread::Builder::new()
            .name(format!("bus {name}"))
            .spawn(move || {
                enter();
                loop {
                    match jobs.pop() {
                        Ok((mut part, owner)) => {
                            part.run();
                            // There is one part, so there is room for it.
                            let _ = results.push(part);
                            owner.unpark();
                        }
                        Err(_) if jobs.is_abandoned() => return,
                        Err(_) => thread::park(),
                    }
                }
            })?;
        Ok(Worker {
            to: Some(to),
            from,
            thread: Some(thread),
        })
    }

    fn send(&mut self, part: Box<Part>) {
        if let Some(to) = &mut self.to {
            // The part is here, so the queue for one is empty.
            let _ = to.push((part, thread::current()));
        }
        if let Some(thread) = &self.thread {
            thread.thread().unpark();
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.to = None;
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // It catches panics of its part, and has none of its own.
            let _ = thread.join();
        }
    }
}

/// One bus among several.
pub(super) struct Lane {
    pub name: String,
    /// Which joints of the whole hang on it, in its own order.
    pub joints: Vec<usize>,
    joint_names: Vec<String>,
    /// Away while its worker has it.
    part: Option<Box<Part>>,
    worker: Option<Worker>,
    branch: Option<VirtualClock>,
    /// In virtual time: the search for it has moved its branch on to here, and its outcome is known then.
    searched_until: Option<Time>,
    pub prepared: bool,
    pub armed: bool,
    pub newly_armed: bool,
    /// It was given the last job of all.
    pub takes_part: bool,
    /// Its bus failed and is left out.
    pub lost: bool,
    /// Its error, not told yet.
    pub error: Option<BusError>,
}

impl Lane {
    pub fn new(part: BusPart, all: &[String], enter: fn()) -> Result<Self, ParallelError> {
        let names = part.bus.joints().to_vec();
        let place = |name: &String| all.iter().position(|joint| joint == name);
        let joints: Vec<usize> = names.iter().filter_map(place).collect();
        let worker =
            match &part.branch {
                Some(_) => None,
                None => Some(Worker::start(&part.name, enter).map_err(|reason| {
                    ParallelError::Thread {
                        name: part.name.clone(),
                        reason,
                    }
                })?),
            };
        Ok(Lane {
            name: part.name,
            part: Some(Box::new(Part {
                bus: part.bus,
                targets: vec![0.0; joints.len()],
                states: vec![JointState::default(); joints.len()],
                job: Job::Exchange,
                done: None,
            })),
            joints,
            joint_names: names,
            worker,
            branch: part.branch,
            searched_until: None,
            prepared: false,
            armed: false,
            newly_armed: false,
            takes_part: false,
            lost: false,
            error: None,
        })
    }

    /// Whether it takes part in a cycle.
    pub fn is_driven(&self) -> bool {
        self.prepared && self.is_free()
    }

    /// Whether it is here and not lost.
    pub fn is_free(&self) -> bool {
        self.part.is_some() && !self.lost
    }

    /// Where its branch of the clock stands, in virtual time.
    pub fn time(&self) -> Option<Time> {
        let searching = self.searched_until.is_some();
        self.branch.as_ref().filter(|_| !searching).map(Clock::now)
    }

    /// Hands the part to its worker; without one does the job at once.
    pub fn start(&mut self, job: Job, begin: Time) {
        let Some(worker) = &mut self.worker else {
            return self.run_here(job, begin);
        };
        if let Some(mut part) = self.part.take() {
            part.job = job;
            worker.send(part);
        }
    }

    /// Does the job in this thread.
    pub fn run_here(&mut self, job: Job, begin: Time) {
        if let Some(branch) = &self.branch {
            branch.advance_to(begin);
        }
        if let Some(part) = &mut self.part {
            part.job = job;
            part.run();
        }
    }

    /// Waits until the part is here.
    pub fn wait(&mut self) {
        while self.part.is_none() && !self.take_back() {
            thread::park();
        }
        self.searched_until = None;
    }

    /// Takes the part back if its worker is done; true also when it never will be.
    fn take_back(&mut self) -> bool {
        let Some(worker) = &mut self.worker else {
            return true;
        };
        match worker.from.pop() {
            Ok(part) => {
                self.part = Some(part);
                true
            }
            Err(_) => worker.from.is_abandoned(),
        }
    }

    /// What came of the last job. A panic in it goes on here.
    pub fn take_done(&mut self) -> Option<Done> {
        match self.part.as_mut()?.done.take() {
            Some(Done::Panicked(panic)) => resume_unwind(panic),
            done => done,
        }
    }

    /// Begins to look for a lost bus, or says what has come of it; `None` while it is looked for.
    pub fn search(&mut self, now: Time) -> Option<Result<(), BusError>> {
        let searching = match self.searched_until {
            Some(until) if now < until => return None,
            Some(_) => true,
            None if self.part.is_none() => {
                if !self.take_back() {
                    return None;
                }
                true
            }
            None => false,
        };
        self.searched_until = None;
        if searching {
            return match self.take_done() {
                Some(Done::Reopened(outcome)) => Some(outcome),
                _ => None,
            };
        }
        self.start(Job::Reopen, now);
        if let Some(branch) = &self.branch {
            self.searched_until = Some(later(self.searched_until, branch.now()));
        }
        None
    }

    /// Does `work` on the bus, if it is here.
    pub fn here(
        &mut self,
        begin: Time,
        work: impl FnOnce(&mut dyn ServoBus) -> Result<(), BusError>,
    ) -> Result<(), BusError> {
        if self.lost {
            return Err(self.gone());
        }
        if let Some(branch) = &self.branch {
            branch.advance_to(begin);
        }
        match &mut self.part {
            Some(part) => work(&mut *part.bus),
            None => Err(self.gone()),
        }
    }

    fn gone(&self) -> BusError {
        BusError::NotBack {
            bus: self.name.clone(),
            sought: "it".into(),
            found: "it is lost".into(),
        }
    }

    pub fn lose(&mut self) {
        self.lost = true;
        (self.prepared, self.armed) = (false, false);
    }

    /// Says on which bus an error is.
    pub fn named(&self, error: BusError) -> BusError {
        BusError::OnBus {
            name: self.name.clone(),
            joints: self.joint_names.clone(),
            source: Box::new(error),
        }
    }

    pub fn take_targets(&mut self, targets_rad: &[f64]) {
        let Some(part) = &mut self.part else { return };
        for (target, &joint) in part.targets.iter_mut().zip(&self.joints) {
            *target = targets_rad.get(joint).copied().unwrap_or(f64::NAN);
        }
    }

    pub fn copy_states(&self, states: &mut [JointState]) {
        let Some(part) = &self.part else { return };
        for (state, &joint) in part.states.iter().zip(&self.joints) {
            if let Some(place) = states.get_mut(joint) {
                *place = *state;
            }
        }
    }

    pub fn copy_health(&self, whole: &mut [ServoHealth]) {
        let Some(part) = &self.part else { return };
        for (health, &joint) in part.bus.health().iter().zip(&self.joints) {
            whole[joint] = *health;
        }
    }

    pub fn copy_goals(&self, out_rad: &mut [f64]) {
        let Some(part) = &self.part else { return };
        let mut goals = part.targets.clone();
        part.bus.goals(&mut goals);
        for (goal, &joint) in goals.iter().zip(&self.joints) {
            if let Some(place) = out_rad.get_mut(joint) {
                *place = *goal;
            }
        }
    }

    pub fn facts(&self) -> &[ServoFacts] {
        self.part.as_ref().map_or(&[], |part| part.bus.facts())
    }

    pub fn notes(&self) -> &[String] {
        self.part.as_ref().map_or(&[], |part| part.bus.notes())
    }

    /// The bits of `mask` at the places of the whole.
    fn spread(&self, mask: u64) -> u64 {
        let places = self.joints.iter().take(64).enumerate();
        places
            .filter(|(own, joint)| mask >> own & 1 == 1 && **joint < 64)
            .fold(0, |whole, (_, joint)| whole | 1 << joint)
    }

    pub fn add_report(&self, own: &CycleReport, whole: &mut CycleReport) {
        whole.fresh = whole.fresh.saturating_add(own.fresh);
        whole.silent = whole.silent.saturating_add(own.silent);
        whole.silent_mask |= self.spread(own.silent_mask);
        whole.alert_mask |= self.spread(own.alert_mask);
        whole.torqueless_mask |= self.spread(own.torqueless_mask);
        whole.ramping_mask |= self.spread(own.ramping_mask);
        whole.damaged = whole.damaged.saturating_add(own.damaged);
        whole.bytes = whole.bytes.saturating_add(own.bytes);
        whole.cycle_us = whole.cycle_us.max(own.cycle_us);
        whole.goal_sent_us = whole.goal_sent_us.max(own.goal_sent_us);
    }

    /// All its joints are silent: it is lost.
    pub fn add_silence(&self, whole: &mut CycleReport) {
        let count = u16::try_from(self.joints.len()).unwrap_or(u16::MAX);
        whole.silent = whole.silent.saturating_add(count);
        whole.silent_mask |= self.spread(u64::MAX);
    }
}
