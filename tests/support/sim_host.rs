//! A host that talks to simulated servos in virtual time.
#![allow(dead_code, reason = "each test program uses a part")]

use handwave::base::{Clock, VirtualClock};
use handwave::bus::Port;
use handwave::sim::line::SharedLine;
use handwave::sim::models::XL430_W250;
use handwave::sim::{Line, LineOptions, SimPort};
use handwave_dynamixel::instruction::{Instruction, SyncRead};
use handwave_dynamixel::{BROADCAST_ID, FrameParser, Status, lists};
use std::sync::Arc;
use std::time::Duration;

/// A host at one end of a line, and a hand on the clock.
pub struct Host {
    pub clock: VirtualClock,
    pub line: SharedLine,
    pub port: SimPort,
}

/// A status, taken apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    pub id: u8,
    pub alert: bool,
    pub error: u8,
    pub data: Vec<u8>,
}

impl Host {
    pub fn on(line: Line) -> Self {
        let clock = VirtualClock::new();
        let line = SharedLine::new(line);
        let port = SimPort::new(line.clone(), Arc::new(clock.clone()), 1_000_000);
        Self { clock, line, port }
    }

    pub fn with(servos: u8, options: LineOptions) -> Self {
        let line = Line::commissioned(&XL430_W250, 1..=servos, 1_000_000, options);
        Self::on(line.expect("a known rate"))
    }

    pub fn new(servos: u8) -> Self {
        Self::with(servos, LineOptions::default())
    }

    pub fn fault(self, spec: &str) -> Self {
        let fault = spec.parse().expect("a good specification");
        self.line.lock().inject(fault).expect("a servo of the line");
        self
    }

    pub fn wait(&self, seconds: f64) {
        let span = Duration::from_secs_f64(seconds);
        self.clock.sleep_until(self.clock.now() + span);
        self.line.lock().advance(self.clock.now());
    }

    pub fn send(&mut self, bytes: &[u8]) {
        self.port.write_all(bytes).expect("a port that is there");
    }

    /// Everything that arrives within 50 ms.
    pub fn hear(&mut self) -> Vec<u8> {
        let mut buf = [0; 4096];
        let deadline = self.clock.now() + Duration::from_millis(50);
        let count = self.port.read(&mut buf, 4096, deadline);
        buf[..count.expect("a port that is there")].to_vec()
    }

    pub fn answers(&mut self) -> Vec<Answer> {
        let mut parser = FrameParser::<4096>::new();
        parser.push(&self.hear());
        let mut answers = Vec::new();
        while let Some(frame) = parser.next_frame() {
            let status = Status::parse(&frame).expect("a status");
            answers.push(Answer {
                id: status.id,
                alert: status.alert,
                error: status.error.to_byte(),
                data: status.params.to_vec(),
            });
        }
        answers
    }

    pub fn tell(&mut self, id: u8, instruction: Instruction) -> Vec<Answer> {
        let mut buf = [0; 1024];
        let bytes = instruction.encode(id, &mut buf).expect("room").to_vec();
        self.send(&bytes);
        self.answers()
    }

    pub fn one(&mut self, id: u8, instruction: Instruction) -> Answer {
        let mut answers = self.tell(id, instruction);
        assert_eq!(answers.len(), 1, "{instruction:?}: {answers:?}");
        answers.remove(0)
    }

    pub fn write(&mut self, id: u8, address: u16, data: &[u8]) -> u8 {
        self.one(id, Instruction::Write { address, data }).error
    }

    pub fn write_u32(&mut self, id: u8, address: u16, value: i32) -> u8 {
        self.write(id, address, &value.to_le_bytes())
    }

    pub fn read(&mut self, id: u8, address: u16, length: u16) -> Answer {
        self.one(id, Instruction::Read { address, length })
    }

    pub fn read_i32(&mut self, id: u8, address: u16) -> i32 {
        let data = self.read(id, address, 4).data;
        i32::from_le_bytes(data.try_into().expect("four bytes"))
    }

    pub fn sync_read(&mut self, fast: bool, ids: &[u8], address: u16, length: u16) {
        let instruction = match fast {
            true => Instruction::FastSyncRead(SyncRead {
                address,
                length,
                ids,
            }),
            false => Instruction::SyncRead(SyncRead {
                address,
                length,
                ids,
            }),
        };
        let mut buf = [0; 512];
        let bytes = instruction.encode(BROADCAST_ID, &mut buf).expect("room");
        self.port.write_all(bytes).expect("a port that is there");
    }

    pub fn sync_goals(&mut self, goals: &[(u8, i32)]) {
        let mut buf = [0; 1024];
        let items = goals.iter().map(|(id, goal)| (*id, goal.to_le_bytes()));
        let bytes = lists::encode_sync_write(&mut buf, 116, 4, items).expect("room");
        self.port.write_all(bytes).expect("a port that is there");
    }

    pub fn pulses(&self, id: u8) -> f64 {
        self.line
            .lock()
            .servo(id)
            .expect("on the line")
            .position_pulses()
    }
}
