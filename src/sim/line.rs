//! The half-duplex chain: takes the host's bytes, lets the servos act and answer, and knows when each byte arrives.

use super::chain::Chain;
use super::fault::{Chance, FaultError, FaultKind, FaultSpec, Target};
use super::servo::Servo;
use super::table::Device;
use super::wire::Pace;
use crate::base::Time;
use handwave_dynamixel::{FrameParser, baud};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// The line goes idle within a frame for longer than this: the servos drop what they have of it.
const IDLE_GAP: Duration = Duration::from_millis(10);

/// What the servos behind a silent one do in an ordinary sync or bulk read.
#[derive(Copy, Clone, Debug, Default, PartialEq, Eq)]
pub enum AfterSilence {
    /// They answer when the time of its status is over.
    #[default]
    Answer,
    /// They wait for it for ever.
    Wait,
}

/// How the chain behaves. The default is paced, without any extra delay.
#[derive(Copy, Clone, Debug)]
pub struct LineOptions {
    /// Bytes take their baud-exact time; else they take none, return delay and turnaround neither.
    pub paced: bool,
    /// Delay of a servo between instruction and status, beside its return delay.
    pub turnaround: Duration,
    /// Delay of each servo behind its predecessor in a fast read.
    pub hop: Duration,
    /// Delay of the adapter between the line and the host.
    pub latency: Duration,
    /// Resistance between the supply and the servos, ohms: what all of them draw lowers their voltage.
    pub supply_ohm: f64,
    /// What happens behind a silent servo.
    pub after_silence: AfterSilence,
    /// Where chance begins, for faults.
    pub seed: u64,
}

impl Default for LineOptions {
    fn default() -> Self {
        Self {
            paced: true,
            turnaround: Duration::ZERO,
            hop: Duration::ZERO,
            latency: Duration::ZERO,
            // A small battery, its lead and a board.
            supply_ohm: 0.1,
            after_silence: AfterSilence::default(),
            seed: 1,
        }
    }
}

/// A chain of simulated servos and the wire to the host.
#[derive(Debug)]
pub struct Line {
    chain: Chain,
    parser: FrameParser<4096>,
    /// When the host's last byte has left.
    host_free_at: Time,
}

impl Line {
    /// A line without servos.
    pub fn new(options: LineOptions) -> Self {
        Self {
            chain: Chain::new(options),
            parser: FrameParser::new(),
            host_free_at: Time::from_nanos(i64::MIN / 2),
        }
    }

    /// A line of commissioned servos: ids as given, no return delay, torque off, position 2048.
    ///
    /// `None` when `baud_bps` is no rate of the baud rate register.
    pub fn commissioned(
        device: &'static Device,
        ids: impl IntoIterator<Item = u8>,
        baud_bps: u32,
        options: LineOptions,
    ) -> Option<Self> {
        let code = baud::code(baud_bps)?;
        let mut line = Self::new(options);
        for id in ids {
            line.attach(id, Servo::commissioned(device, id, code));
        }
        Some(line)
    }

    /// Hangs a servo on the line. Faults and [`Line::servo`] know it by `label`, whatever its id is now.
    pub fn attach(&mut self, label: u8, servo: Servo) {
        self.chain.attach(label, servo);
    }

    /// Plugs the servo `label` in (it boots) or takes it off the line; false when there is none.
    pub fn set_plugged(&mut self, label: u8, plugged: bool, now: Time) -> bool {
        self.chain.advance(now);
        self.chain.set_plugged(label, plugged, now)
    }

    /// Adds a fault. One that has begun already begins now, at the time of the latest traffic.
    ///
    /// Fails when it names a servo that is not on the line.
    pub fn inject(&mut self, fault: FaultSpec) -> Result<(), FaultError> {
        self.chain.inject(fault)
    }

    /// Lets chance, for faults, begin anew at `seed`.
    pub fn set_seed(&mut self, seed: u64) {
        self.chain.options.seed = seed;
        self.chain.chance = Chance::new(seed);
    }

    /// The servo called `label`, as of the latest [`Line::advance`] or traffic.
    pub fn servo(&self, label: u8) -> Option<&Servo> {
        self.chain.slot(label).map(|slot| &slot.servo)
    }

    /// The servo called `label`, to push its shaft.
    pub fn servo_mut(&mut self, label: u8) -> Option<&mut Servo> {
        self.chain.slot_mut(label).map(|slot| &mut slot.servo)
    }

    /// Labels of all servos, in the order in which they were attached.
    pub fn labels(&self) -> impl Iterator<Item = u8> + '_ {
        self.chain.labels()
    }

    /// Moves every servo on to `now`.
    pub fn advance(&mut self, now: Time) {
        self.chain.advance(now);
    }

    /// Takes bytes that the host hands over at `now` with its port at `baud_bps`.
    ///
    /// They leave behind those handed over before. Servos at another rate (beyond 3 %) do not hear
    /// them. Returns when the last one has left; the answers are on the wire then, see
    /// [`Line::receive`]. Bytes that meet an answer still under way are damaged, as that answer is.
    pub fn send(&mut self, now: Time, baud_bps: u32, bytes: &[u8]) -> Time {
        let pace = self.chain.pace(baud_bps);
        let start = now.max(self.host_free_at);
        if start.saturating_since(self.host_free_at) > IDLE_GAP {
            self.parser.line_idle();
        }
        let echo = self
            .chain
            .fault(Target::Bus, FaultKind::Echo, start)
            .is_some();
        for (index, &byte) in bytes.iter().enumerate() {
            let ended = start + pace.bytes(index + 1);
            let damage = self.chain.collide(ended, pace);
            if echo {
                let started = start + pace.bytes(index);
                self.chain.echo(started, byte, pace);
            }
            self.parser.push(&[byte ^ damage]);
            while let Some(frame) = self.parser.next_frame() {
                self.chain.obey(&frame, ended, baud_bps);
            }
        }
        self.host_free_at = start + pace.bytes(bytes.len());
        self.host_free_at
    }

    /// Takes bytes that have arrived at the host by `now` into `buf`; returns how many.
    pub fn receive(&mut self, now: Time, buf: &mut [u8]) -> usize {
        let mut count = 0;
        while let Some(cell) = buf.get_mut(count) {
            let Some(byte) = self.chain.wire.pop(now) else {
                break;
            };
            *cell = byte;
            count += 1;
        }
        count
    }

    /// When the byte `index` places from the next one (0) arrives at the host; `None` when none is under way.
    pub fn arrival(&self, index: usize) -> Option<Time> {
        self.chain.wire.arrival(index)
    }

    /// Forgets all bytes under way: the host's end was closed or unplugged.
    pub fn clear(&mut self) {
        self.chain.wire.clear();
        self.parser.clear();
    }

    /// Whether the adapter is unplugged at `now`.
    pub fn is_unplugged(&self, now: Time) -> bool {
        self.chain
            .fault(Target::Bus, FaultKind::Unplugged, now)
            .is_some()
    }

    /// Under which name the adapter is there (or will be, or was): 0 is its first one. Each unplugging
    /// that is over by `now` gives it the name of its value.
    pub fn adapter_name(&self, now: Time) -> u32 {
        self.chain.adapter_name(now)
    }

    /// Instructions that the servos have heard so far.
    pub fn packets(&self) -> u64 {
        self.chain.packets
    }

    /// The next time after `now` at which a fault begins or ends.
    pub fn next_fault_change(&self, now: Time) -> Option<Time> {
        self.chain.next_change(now)
    }
}

impl Chain {
    /// The pace of bytes at `baud_bps`.
    pub(super) fn pace(&self, baud_bps: u32) -> Pace {
        Pace {
            baud: self.options.paced.then_some(baud_bps),
        }
    }

    fn collide(&mut self, at: Time, pace: Pace) -> u8 {
        let chance: &mut Chance = &mut self.chance;
        match self.wire.collide(at, pace, chance) {
            true => chance.flips(),
            false => 0,
        }
    }

    fn echo(&mut self, start: Time, byte: u8, pace: Pace) {
        self.wire.send(start, &[byte], pace, &mut self.chance);
    }
}

/// A line that several hold: the port, and whoever looks at the servos.
#[derive(Clone, Debug)]
pub struct SharedLine(Arc<Mutex<Line>>);

impl SharedLine {
    /// Shares `line`.
    pub fn new(line: Line) -> Self {
        Self(Arc::new(Mutex::new(line)))
    }

    /// The line, for as long as the guard lives. A panic of another holder does not matter.
    pub fn lock(&self) -> MutexGuard<'_, Line> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
