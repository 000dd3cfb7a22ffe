//! For tests: a port in virtual time whose other end answers each request as a closure says.

use super::model::{Model, address};
use crate::base::{Clock, Time, VirtualClock};
use crate::bus::port::{Port, PortError};
use handwave_dynamixel::instruction::{Instruction, SyncRead};
use handwave_dynamixel::{Crc, ErrorCode, Frame, Status, fast, wire};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard};

/// Answers one request frame with the bytes that come back.
pub type Answer = Box<dyn FnMut(&[u8]) -> Vec<u8> + Send>;

/// The port: bytes take their time at 1 Mbaud.
pub struct ScriptedPort {
    clock: VirtualClock,
    answer: Answer,
    line_free_at: Time,
    arriving: VecDeque<(Time, u8)>,
}

impl ScriptedPort {
    pub fn new(clock: VirtualClock, answer: Answer) -> Self {
        ScriptedPort {
            clock,
            answer,
            line_free_at: Time::ZERO,
            arriving: VecDeque::new(),
        }
    }
}

impl Port for ScriptedPort {
    fn name(&self) -> &str {
        "scripted"
    }
    fn baud(&self) -> u32 {
        1_000_000
    }
    fn set_baud(&mut self, _: u32) -> Result<(), PortError> {
        Ok(())
    }
    fn now(&self) -> Time {
        self.clock.now()
    }
    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let byte_time = wire::duration(1, self.baud());
        let begin = self.line_free_at.max(self.clock.now());
        self.line_free_at = begin + byte_time * bytes.len() as u32;
        for byte in (self.answer)(bytes) {
            self.line_free_at = self.line_free_at + byte_time;
            self.arriving.push_back((self.line_free_at, byte));
        }
        Ok(())
    }
    fn read(&mut self, buf: &mut [u8], want: usize, deadline: Time) -> Result<usize, PortError> {
        let mut count = 0;
        while count < buf.len() {
            match self.arriving.front() {
                Some(&(at, byte)) if at <= self.clock.now() || (count < want && at <= deadline) => {
                    self.clock.advance_to(at);
                    buf[count] = byte;
                    count += 1;
                    self.arriving.pop_front();
                }
                _ => break,
            }
        }
        if count < want {
            self.clock.advance_to(deadline);
        }
        Ok(count)
    }
    fn discard_input(&mut self) -> Result<(), PortError> {
        let now = self.clock.now();
        self.arriving.retain(|&(at, _)| at > now);
        Ok(())
    }
}

/// A servo with nothing but registers: what is written as goal is at once the position.
#[derive(Clone)]
pub struct Puppet {
    pub id: u8,
    pub silent: bool,
    pub registers: Vec<u8>,
}

impl Puppet {
    fn new(id: u8) -> Self {
        let mut puppet = Puppet {
            id,
            silent: false,
            registers: vec![0; 256],
        };
        puppet.set(0, &1060u16.to_le_bytes());
        puppet.set(6, &[46]);
        puppet.set(address::OPERATING_MODE, &[3]);
        puppet.set(address::MAX_POSITION_LIMIT, &4095u32.to_le_bytes());
        puppet.set(address::STATUS_RETURN_LEVEL, &[2]);
        puppet.set(address::PRESENT_POSITION, &2048i32.to_le_bytes());
        puppet
    }

    pub fn set(&mut self, address: u16, bytes: &[u8]) {
        let at = usize::from(address);
        self.registers[at..at + bytes.len()].copy_from_slice(bytes);
    }

    pub fn get(&self, address: u16, length: u16) -> &[u8] {
        &self.registers[usize::from(address)..usize::from(address + length)]
    }

    pub fn goal(&self) -> i32 {
        let bytes = self.get(address::GOAL_POSITION, 4);
        i32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
    }

    fn written(&mut self, address: u16, data: &[u8]) {
        self.set(address, data);
        if address == address::GOAL_POSITION && self.registers[64] == 1 {
            self.set(address::PRESENT_POSITION, data);
        }
    }

    fn status(&self, params: &[u8]) -> Vec<u8> {
        let status = Status {
            id: self.id,
            alert: self.registers[70] != 0,
            error: ErrorCode::None,
            params,
        };
        let mut buf = [0; 512];
        status.encode(&mut buf).expect("room").to_vec()
    }
}

/// A chain of such servos, shared between the test and the port.
#[derive(Clone)]
pub struct Stage(Arc<Mutex<Inner>>);

pub struct Inner {
    pub puppets: Vec<Puppet>,
    /// Fast reads are understood.
    pub fast: bool,
    /// This byte of the next fast answers is flipped.
    pub damage: Option<usize>,
}

impl Stage {
    pub fn new(servos: u8) -> Self {
        Stage(Arc::new(Mutex::new(Inner {
            puppets: (1..=servos).map(Puppet::new).collect(),
            fast: true,
            damage: None,
        })))
    }

    pub fn lock(&self) -> MutexGuard<'_, Inner> {
        self.0
            .lock()
            .expect("no test thread panicked with the lock")
    }

    pub fn port(&self, clock: &VirtualClock) -> ScriptedPort {
        let stage = self.clone();
        let answer = Box::new(move |bytes: &[u8]| stage.lock().answer(bytes));
        ScriptedPort::new(clock.clone(), answer)
    }
}

impl Inner {
    fn answer(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut wire = bytes.to_vec();
        let frame = Frame::parse(&mut wire).expect("the master writes whole frames");
        let instruction = Instruction::parse(&frame).expect("the master writes instructions");
        let fast = self.fast;
        match instruction {
            Instruction::SyncWrite(write) => {
                for (id, data) in write.iter() {
                    for puppet in self.alive().filter(|puppet| puppet.id == id) {
                        puppet.written(write.address, data);
                    }
                }
                Vec::new()
            }
            Instruction::SyncRead(SyncRead {
                address,
                length,
                ids,
            }) => {
                let mut out = Vec::new();
                for &id in ids {
                    let Some(puppet) = self.alive().find(|puppet| puppet.id == id) else {
                        // Each waits for its predecessor.
                        break;
                    };
                    out.extend(puppet.status(puppet.get(address, length)));
                }
                out
            }
            Instruction::FastSyncRead(_) if !fast => Vec::new(),
            Instruction::FastSyncRead(SyncRead {
                address,
                length,
                ids,
            }) => {
                let mut crc = Crc::new();
                let mut buf = [0; 64];
                let mut out = Vec::new();
                for (place, &id) in ids.iter().enumerate() {
                    let Some(puppet) = self.alive().find(|puppet| puppet.id == id) else {
                        break;
                    };
                    if place == 0 {
                        let len = ids.len() as u16 * (length + 4);
                        out.extend(fast::encode_prefix(&mut buf, len, &mut crc).expect("room"));
                    }
                    let data = puppet.get(address, length);
                    let alert = if puppet.registers[70] != 0 { 0x80 } else { 0 };
                    let block = fast::encode_block(&mut buf, alert, id, data, &mut crc);
                    out.extend(block.expect("room"));
                }
                if let Some(byte) = self.damage.and_then(|at| out.get_mut(at)) {
                    *byte ^= 0x04;
                }
                out
            }
            single => {
                let id = frame.id;
                let Some(puppet) = self.alive().find(|puppet| puppet.id == id) else {
                    return Vec::new();
                };
                match single {
                    Instruction::Ping => {
                        let params = [
                            puppet.registers[0],
                            puppet.registers[1],
                            puppet.registers[6],
                        ];
                        puppet.status(&params)
                    }
                    Instruction::Read { address, length } => {
                        puppet.status(puppet.get(address, length))
                    }
                    Instruction::Write { address, data } => {
                        puppet.written(address, data);
                        puppet.status(&[])
                    }
                    Instruction::Reboot => {
                        puppet.set(64, &[0; 136]);
                        puppet.status(&[])
                    }
                    other => panic!("the test servo does not know {other:?}"),
                }
            }
        }
    }

    fn alive(&mut self) -> impl Iterator<Item = &mut Puppet> {
        self.puppets.iter_mut().filter(|puppet| !puppet.silent)
    }
}

/// The model of all test servos.
pub fn model() -> &'static Model {
    Model::by_number(1060).expect("XL430-W250 is known")
}
