//! A chain of Dynamixel servos as a [`ServoBus`]: joint angles in, joint states out.
//!
//! The parts: `check` looks at everything before torque goes on, `cycle` is the control cycle,
//! `recovery` brings servos back that were silent, `health` looks at one servo in some cycles, `absence` finds
//! out about servos that are not there at the start, `reopen` finds a lost port again.

use super::client::{Client, ClientError, Outcome};
use super::follow::Follower;
use super::groups::{ReadGroup, goal_registers, read_groups};
use super::health::Watch;
use super::model::{STATE_BYTES, address};
use super::servo::{ServoSpec, SpecError, protocol_of};
use crate::base::{JointState, Time};
use crate::bus::{BusError, CycleReport, ServoBus, ServoFacts, ServoHealth, TorqueReport};
use std::time::Duration;

/// How often a request that brought no answer is repeated outside the control cycle, at least.
const TRIES: u32 = 3;
/// How long it is repeated before and while torque goes on: nothing moves yet, so a busy system or a
/// servo that is still booting is worth waiting for.
const START_PATIENCE: Duration = Duration::from_millis(250);
/// After an answer that did not come in time, the line is listened to until it was quiet this long.
///
/// Longer than the latency timer of a USB adapter as it comes from the shop: its answers are then seen to be late.
pub(super) const QUIET: Duration = Duration::from_millis(20);
/// Answers that come this late are worth a word: twice the latency timer that is wanted, and some.
const WORTH_A_WORD: Duration = Duration::from_millis(4);

/// Settings of a chain.
#[derive(Clone, Debug, PartialEq)]
pub struct ChainOptions {
    /// The bus as written on the command line, for advice in messages.
    pub bus: String,
    /// Bus watchdog of the servos in counts of 20 ms: a servo that hears nothing for that long while
    /// torque is on stops moving. 0 turns it off. Default 5 (100 ms).
    pub watchdog: u8,
    /// Profile velocity in counts of 0.229 rev/min, 0 for none. Default 0: the targets are smooth already.
    pub profile_velocity: u32,
    /// Profile acceleration in counts of 214.577 rev/min2, 0 for none. Default 0.
    pub profile_acceleration: u32,
    /// After how long without any answer the bus counts as lost. Default 500 ms.
    pub lost_after: Duration,
    /// How often a servo that stays silent is asked again. At first it is asked more often. Default 250 ms.
    pub retry_every: Duration,
    /// Bus time of a control cycle: within it the servos behind a silent one are asked a second time.
    /// Default 5 ms.
    pub cycle_budget: Duration,
    /// How fast the goal of a servo that was silent moves back to its target, rad/s. Default 1.
    pub reentry_rate_rad_s: f64,
}

impl Default for ChainOptions {
    fn default() -> Self {
        ChainOptions {
            bus: String::new(),
            watchdog: 5,
            profile_velocity: 0,
            profile_acceleration: 0,
            lost_after: Duration::from_millis(500),
            retry_every: Duration::from_millis(250),
            cycle_budget: Duration::from_millis(5),
            reentry_rate_rad_s: 1.0,
        }
    }
}

/// How the chain stands to one servo.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub(super) enum Link {
    /// Read, not driven: torque was not turned on by us.
    Resting,
    /// Read and driven.
    Driven,
    /// Read and driven, its goal on the way back to the target.
    Ramping,
    /// Neither: it did not answer. Asked again at a low rate.
    Silent,
    /// Read, not driven: it was armed and came back without torque.
    Torqueless,
}

/// One servo and what is known of it.
#[derive(Debug)]
pub(super) struct Servo {
    pub(super) spec: ServoSpec,
    pub(super) link: Link,
    pub(super) firmware: u8,
    /// Torque was turned on by us and not off again.
    pub(super) armed: bool,
    /// Last position that it was sent to, in counts; fractions matter while ramping.
    pub(super) goal_pulse: f64,
    /// In this cycle: the goal it is sent, in counts of its mode.
    pub(super) goal: Option<i32>,
    /// The host's position loop, for modes in which the servo has none.
    pub(super) follower: Follower,
    /// Which of the chain's read groups it is in.
    pub(super) group: usize,
    /// Where it was last, in counts; `None` before it was found.
    pub(super) last_pulse: Option<i32>,
    /// Counts of its bus watchdog while it is armed; 0 when it has none that helps.
    pub(super) watchdog: u8,
    /// When a silent servo is asked again.
    pub(super) retry_at: Time,
    /// The time from that to the next try; doubles up to [`ChainOptions::retry_every`].
    pub(super) retry_after: Duration,
    /// In this cycle: its state is new.
    pub(super) fresh: bool,
    /// In this cycle: it was its turn and nothing came.
    pub(super) mute: bool,
}

/// Buffers of the cycle, allocated once.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    pub(super) ids: Vec<u8>,
    pub(super) indices: Vec<usize>,
    pub(super) data: Vec<u8>,
    pub(super) outcomes: Vec<Outcome>,
}

/// A chain of servos on one line.
pub struct DynamixelChain {
    pub(super) client: Box<dyn Client>,
    pub(super) options: ChainOptions,
    pub(super) servos: Vec<Servo>,
    pub(super) joints: Vec<String>,
    pub(super) notes: Vec<String>,
    /// How long a request that brings no answer is repeated at present.
    patience: Duration,
    pub(super) scratch: Scratch,
    pub(super) watch: Watch,
    /// Servos that are read together.
    pub(super) groups: Vec<ReadGroup>,
    /// Goal registers in use: address and bytes.
    pub(super) goal_registers: Vec<(u16, u8)>,
    pub(super) facts: Vec<ServoFacts>,
    /// The cycle before brought no answer at all.
    pub(super) was_mute: bool,
    pub(super) last_heard: Time,
    pub(super) last_cycle: Option<Time>,
}

impl DynamixelChain {
    /// A chain of the servos in `specs`, in the order of the joints, on the line of `client`.
    pub fn new(
        client: Box<dyn Client>,
        specs: Vec<ServoSpec>,
        options: ChainOptions,
    ) -> Result<Self, SpecError> {
        for (index, spec) in specs.iter().enumerate() {
            spec.check()?;
            if let Some(first) = specs[..index].iter().find(|other| other.id == spec.id) {
                return Err(SpecError::DuplicateId {
                    id: spec.id,
                    first: first.joint.clone(),
                    second: spec.joint.clone(),
                });
            }
        }
        protocol_of(&specs)?;
        let count = specs.len();
        let now = client.now();
        let goal_registers = goal_registers(&specs);
        let (groups, members) = read_groups(&specs);
        Ok(DynamixelChain {
            watch: Watch::new(specs.iter().map(|spec| spec.model), now),
            joints: specs.iter().map(|spec| spec.joint.clone()).collect(),
            servos: specs
                .into_iter()
                .zip(members)
                .map(|(spec, group)| Servo {
                    goal_pulse: f64::from(spec.zero_pulse),
                    goal: None,
                    follower: Follower::default(),
                    group,
                    last_pulse: None,
                    watchdog: 0,
                    spec,
                    link: Link::Resting,
                    firmware: 0,
                    armed: false,
                    retry_at: now,
                    retry_after: Duration::ZERO,
                    fresh: false,
                    mute: false,
                })
                .collect(),
            client,
            options,
            notes: Vec::new(),
            patience: Duration::ZERO,
            scratch: Scratch {
                ids: Vec::with_capacity(count),
                indices: Vec::with_capacity(count),
                data: vec![0; count * STATE_BYTES],
                outcomes: vec![Outcome::NotReached; count],
            },
            groups,
            goal_registers,
            facts: Vec::new(),
            was_mute: false,
            last_heard: now,
            last_cycle: None,
        })
    }

    /// Whether the cycle uses fast sync reads for all servos. Decided by [`prepare`](ServoBus::prepare) for servos that are
    /// read together: all must have a firmware that knows them; given up after five cycles in a row in which only an
    /// ordinary read got through.
    pub fn uses_fast_reads(&self) -> bool {
        self.groups.iter().all(|group| group.fast.on)
    }

    /// The client below, for its counters.
    pub fn client(&self) -> &dyn Client {
        &*self.client
    }

    /// Tells of time that is lost on the way to the servos, in every cycle.
    fn note_time(&mut self) {
        self.notes.extend_from_slice(self.client.notes());
        let lateness = self.client.lateness();
        if self.client.notes().is_empty() && lateness > WORTH_A_WORD {
            self.notes.push(format!(
                "answers come {:.1} ms later than the wire needs, which leaves about {:.0} cycles a second. It is \
                 the adapter's latency timer as a rule: set it to 1 ms, or use a port without one",
                1e3 * lateness.as_secs_f64(),
                (1.0 / (lateness + Duration::from_millis(2)).as_secs_f64()).floor()
            ));
        }
    }

    /// Says what a failed request means for servo `index`.
    pub(super) fn servo_error(&self, index: usize, error: ClientError) -> BusError {
        let spec = &self.servos[index].spec;
        match error {
            ClientError::Port(error) => BusError::Port(error),
            ClientError::Timeout { .. } => BusError::Absent {
                id: spec.id,
                joint: spec.joint.clone(),
                port: self.client.port_name().into(),
                baud: self.client.baud(),
                bus: self.options.bus.clone(),
            },
            other => self.servo_problem(
                index,
                other.to_string(),
                format!(
                    "`handwave bus read {} {} all` shows its registers",
                    self.options.bus, spec.id
                ),
            ),
        }
    }

    pub(super) fn servo_problem(&self, index: usize, problem: String, advice: String) -> BusError {
        let spec = &self.servos[index].spec;
        BusError::Servo {
            id: spec.id,
            joint: spec.joint.clone(),
            problem,
            advice,
        }
    }

    /// Repeats a request to servo `index` until it is answered, a few times at most.
    pub(super) fn insist<T>(
        &mut self,
        index: usize,
        mut request: impl FnMut(&mut dyn Client, u8) -> Result<T, ClientError>,
    ) -> Result<T, BusError> {
        let id = self.servos[index].spec.id;
        let begin = self.client.now();
        let mut tries = 1;
        loop {
            match request(&mut *self.client, id) {
                Ok(answer) => {
                    self.last_heard = self.client.now();
                    return Ok(answer);
                }
                Err(ClientError::Timeout { .. })
                    if tries < TRIES
                        || self.client.now().saturating_since(begin) < self.patience =>
                {
                    tries += 1;
                    if !self.patience.is_zero() {
                        let settled = self.client.settle(QUIET);
                        settled.map_err(|error| self.servo_error(index, error))?;
                    }
                }
                Err(error) => return Err(self.servo_error(index, error)),
            }
        }
    }

    /// Reads from an X series address; where the servo's model has it elsewhere, from there.
    pub(super) fn read_register<const N: usize>(
        &mut self,
        index: usize,
        address: u16,
    ) -> Result<[u8; N], BusError> {
        let mut bytes = [0; N];
        let address = self.servos[index].spec.at(address);
        self.insist(index, |client, id| client.read(id, address, &mut bytes))?;
        Ok(bytes)
    }

    /// Writes to an X series address; where the servo's model has it elsewhere, to there.
    pub(super) fn write_register(
        &mut self,
        index: usize,
        address: u16,
        bytes: &[u8],
    ) -> Result<(), BusError> {
        let address = self.servos[index].spec.at(address);
        self.insist(index, |client, id| client.write(id, address, bytes))?;
        Ok(())
    }
}

impl ServoBus for DynamixelChain {
    fn joints(&self) -> &[String] {
        &self.joints
    }

    fn prepare(&mut self, states: &mut [JointState]) -> Result<(), BusError> {
        self.patience = START_PATIENCE;
        let checked = self.check_all(states);
        self.patience = Duration::ZERO;
        checked.map_err(|error| self.explain_absence(error))?;
        self.read_all_health()?;
        self.note_time();
        Ok(())
    }

    /// Makes the present position the goal of every servo, then turns torque on, reads it back and
    /// starts the servos' bus watchdogs: from here on [`exchange`](ServoBus::exchange) must be called
    /// more often than the watchdog time.
    fn arm(&mut self) -> Result<(), BusError> {
        self.patience = START_PATIENCE;
        let armed = (0..self.servos.len()).try_for_each(|index| self.arm_servo(index));
        // Watchdogs last: while servos are still being set up one by one, none should run.
        let armed = armed
            .and_then(|()| (0..self.servos.len()).try_for_each(|index| self.start_watchdog(index)));
        self.patience = Duration::ZERO;
        if armed.is_err() {
            // Better limp than half awake. The first error is the one to tell.
            let _ = self.torque_off();
        }
        // The watchdogs run from here on, see `watchdogs_may_have_tripped`.
        self.last_cycle = Some(self.client.now());
        armed
    }

    fn goals(&self, out_rad: &mut [f64]) {
        for (servo, out) in self.servos.iter().zip(out_rad) {
            *out = servo.spec.position_rad(servo.goal_pulse.round() as i32);
        }
    }

    fn exchange(
        &mut self,
        targets_rad: &[f64],
        states: &mut [JointState],
    ) -> Result<CycleReport, BusError> {
        self.cycle(targets_rad, states)
    }

    fn torque_off(&mut self) -> Result<TorqueReport, BusError> {
        let mut reasons: Vec<Option<String>> =
            vec![Some("not asked".to_owned()); self.servos.len()];
        for _ in 0..TRIES {
            if reasons.iter().all(Option::is_none) {
                break;
            }
            // Servos whose registers lie elsewhere are other groups.
            for group in 0..self.groups.len() {
                let mut layout = None;
                self.scratch.ids.clear();
                for (servo, reason) in self.servos.iter().zip(&reasons) {
                    if reason.is_some() && servo.group == group {
                        self.scratch.ids.push(servo.spec.id);
                        layout = Some(servo.spec.model.layout);
                    }
                }
                let Some(layout) = layout else { continue };
                // One byte of zero each: torque off, then the watchdog, which has nothing left to guard.
                let zeros = vec![0; self.scratch.ids.len()];
                for register in [address::TORQUE_ENABLE, address::BUS_WATCHDOG] {
                    let register = layout.at(register);
                    let sent = self
                        .client
                        .sync_write(register, 1, &self.scratch.ids, &zeros);
                    // Sync writes are not answered: nothing else than a lost port can be learnt here.
                    if let Err(ClientError::Port(error)) = sent {
                        return Err(error.into());
                    }
                }
            }
            for (servo, reason) in self.servos.iter_mut().zip(&mut reasons) {
                if reason.is_none() {
                    continue;
                }
                let mut torque = [1];
                let register = servo.spec.at(address::TORQUE_ENABLE);
                let answer = self.client.read(servo.spec.id, register, &mut torque);
                *reason = match answer {
                    Ok(_) if torque == [0] => None,
                    Ok(_) => Some("its torque stays on".into()),
                    Err(ClientError::Port(error)) => return Err(error.into()),
                    Err(ClientError::Timeout { .. }) => Some("it does not answer".into()),
                    Err(error) => Some(error.to_string()),
                };
            }
        }
        let mut report = TorqueReport::default();
        for (servo, reason) in self.servos.iter_mut().zip(reasons) {
            servo.armed = false;
            if servo.link != Link::Silent {
                servo.link = Link::Resting;
            }
            match reason {
                None => report.confirmed_off.push(servo.spec.joint.clone()),
                Some(reason) => report.unconfirmed.push((servo.spec.joint.clone(), reason)),
            }
        }
        Ok(report)
    }

    fn rearm(&mut self, joint: usize) -> Result<(), BusError> {
        if joint >= self.servos.len() {
            return Ok(());
        }
        self.arm_servo(joint)?;
        self.start_watchdog(joint)?;
        self.servos[joint].link = Link::Ramping;
        Ok(())
    }

    fn reboot(&mut self, joint: usize) -> Result<(), BusError> {
        let Some(servo) = self.servos.get(joint) else {
            return Ok(());
        };
        let id = servo.spec.id;
        match self.client.reboot(id) {
            // It may be too deep in trouble to answer and reboot all the same.
            Ok(_) | Err(ClientError::Timeout { .. }) => {}
            Err(error) => return Err(self.servo_error(joint, error)),
        }
        let now = self.client.now();
        let servo = &mut self.servos[joint];
        servo.link = Link::Silent;
        servo.retry_after = self.options.retry_every;
        servo.retry_at = now + servo.retry_after;
        Ok(())
    }

    fn facts(&self) -> &[ServoFacts] {
        &self.facts
    }

    fn health(&self) -> &[ServoHealth] {
        &self.watch.values
    }

    fn reopen(&mut self) -> Result<(), BusError> {
        self.find_port_again()
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }
}
