//! What a servo does on each instruction, and what it answers.

use super::servo::{Servo, is_backed_up_ram};
use super::table::TableError;
use crate::base::Time;
use crate::bus::dynamixel::model::{RAM_BEGIN, address};
use handwave_dynamixel::ErrorCode;
use handwave_dynamixel::instruction::{Backup, FactoryReset, Instruction};

/// First firmware version that refuses a factory reset of everything by broadcast.
const BROADCAST_RESET_REFUSED: u32 = 42;

/// Status return level from which reads are answered; pings are at every level.
const ANSWERS_READS: u32 = 1;
/// Status return level at which everything is answered.
const ANSWERS_ALL: u32 = 2;

impl Servo {
    /// Carries out an instruction meant for this servo alone, at `now`.
    ///
    /// The data of the answer is appended to `data`. Returns the error code
    /// to answer with, or `None` when no status is due: broadcast, or the status return level.
    /// A list instruction (sync, bulk) is carried out entry by entry by [`Servo::read_entry`] and
    /// [`Servo::write_entry`] instead.
    pub fn execute(
        &mut self,
        instruction: &Instruction,
        broadcast: bool,
        now: Time,
        data: &mut Vec<u8>,
    ) -> Option<ErrorCode> {
        // Taken before: a write may change the level it is answered at.
        let level = self.table.get(address::STATUS_RETURN_LEVEL);
        let (needed, outcome) = match *instruction {
            Instruction::Ping => {
                let [low, high] = (self.table.get(address::MODEL_NUMBER) as u16).to_le_bytes();
                let firmware = self.table.get(address::FIRMWARE_VERSION) as u8;
                data.extend_from_slice(&[low, high, firmware]);
                return Some(ErrorCode::None);
            }
            Instruction::Read { address, length } => {
                if broadcast {
                    return None;
                }
                (ANSWERS_READS, self.read(address, length, now, data))
            }
            _ if self.ailments.refuses.is_some() => (ANSWERS_ALL, self.willing()),
            Instruction::Write { address, data } => (ANSWERS_ALL, self.write(address, data)),
            Instruction::RegWrite { address, data } => (ANSWERS_ALL, self.hold(address, data)),
            Instruction::Action => (ANSWERS_ALL, self.act()),
            Instruction::FactoryReset(what) => {
                (ANSWERS_ALL, self.factory_reset(what, broadcast, now))
            }
            Instruction::Reboot => {
                self.reboot(now);
                (ANSWERS_ALL, Ok(()))
            }
            Instruction::ClearMultiTurn => (ANSWERS_ALL, self.clear_multi_turn()),
            Instruction::Backup(what) => (ANSWERS_ALL, self.back_up(what, now)),
            Instruction::SyncRead(_)
            | Instruction::FastSyncRead(_)
            | Instruction::SyncWrite(_)
            | Instruction::BulkRead(_)
            | Instruction::FastBulkRead(_)
            | Instruction::BulkWrite(_) => return None,
        };
        let answers = !broadcast && level >= needed;
        answers.then(|| outcome.err().unwrap_or(ErrorCode::None))
    }

    /// Its entry of a sync or bulk read; `None` when its status return level lets it answer pings only.
    pub fn read_entry(
        &mut self,
        address: u16,
        length: u16,
        now: Time,
        data: &mut Vec<u8>,
    ) -> Option<ErrorCode> {
        if self.table.get(address::STATUS_RETURN_LEVEL) < ANSWERS_READS {
            return None;
        }
        let outcome = self.read(address, length, now, data);
        Some(outcome.err().unwrap_or(ErrorCode::None))
    }

    /// Its entry of a sync or bulk write; never answered, so an error is seen by nobody.
    pub fn write_entry(&mut self, address: u16, data: &[u8]) {
        let _unanswered = self.write(address, data);
    }

    /// Whether its status return level lets it answer an instruction that it refuses as a whole.
    pub fn answers_all(&self) -> bool {
        self.table.get(address::STATUS_RETURN_LEVEL) >= ANSWERS_ALL
    }

    /// Whether its firmware knows the fast reads and the table backup.
    pub fn knows_fast_reads(&self) -> bool {
        self.table.get(address::FIRMWARE_VERSION)
            >= u32::from(self.table.device().model.fast_reads_since)
    }

    fn read(
        &mut self,
        address: u16,
        length: u16,
        now: Time,
        data: &mut Vec<u8>,
    ) -> Result<(), ErrorCode> {
        self.willing()?;
        self.refresh(now);
        Ok(self.table.read(address, length, data)?)
    }

    /// Refuses when a fault makes it.
    fn willing(&self) -> Result<(), ErrorCode> {
        let refuses = self.ailments.refuses.map(ErrorCode::from_byte);
        refuses.map_or(Ok(()), Err)
    }

    fn check(&self, address: u16, data: &[u8]) -> Result<(), TableError> {
        self.table.check_write(address, data, |register, value| {
            self.check_value(register.address, value)
        })
    }

    fn write(&mut self, address: u16, data: &[u8]) -> Result<(), ErrorCode> {
        self.willing()?;
        self.check(address, data)?;
        if !self.ailments.deaf {
            self.apply_write(address, data);
        }
        Ok(())
    }

    fn hold(&mut self, address: u16, data: &[u8]) -> Result<(), ErrorCode> {
        self.check(address, data)?;
        self.held_write = Some(address);
        self.held_data.clear();
        self.held_data.extend_from_slice(data);
        self.table.set(address::REGISTERED_INSTRUCTION, 1);
        Ok(())
    }

    fn act(&mut self) -> Result<(), ErrorCode> {
        let address = self.held_write.take().ok_or(ErrorCode::Instruction)?;
        self.table.set(address::REGISTERED_INSTRUCTION, 0);
        let data = std::mem::take(&mut self.held_data);
        let outcome = self.write(address, &data);
        self.held_data = data;
        outcome
    }

    fn factory_reset(
        &mut self,
        what: FactoryReset,
        broadcast: bool,
        now: Time,
    ) -> Result<(), ErrorCode> {
        let firmware = self.table.get(address::FIRMWARE_VERSION);
        if what == FactoryReset::All && broadcast && firmware >= BROADCAST_RESET_REFUSED {
            return Err(ErrorCode::ResultFail);
        }
        self.table.reset(|register| match register {
            address::FIRMWARE_VERSION => false,
            address::ID => what == FactoryReset::All,
            address::BAUD_RATE => what != FactoryReset::KeepIdAndBaud,
            _ => true,
        });
        self.reboot(now);
        Ok(())
    }

    fn clear_multi_turn(&mut self) -> Result<(), ErrorCode> {
        if self.is_moving() {
            return Err(ErrorCode::ResultFail);
        }
        self.clear_turns();
        Ok(())
    }

    fn back_up(&mut self, what: Backup, now: Time) -> Result<(), ErrorCode> {
        if !self.knows_fast_reads() {
            return Err(ErrorCode::Instruction);
        }
        if self.torque_enabled() {
            return Err(ErrorCode::ResultFail);
        }
        match what {
            Backup::Store => self.backup = Some(self.table.clone()),
            Backup::Restore => {
                let backup = self.backup.take().ok_or(ErrorCode::DataRange)?;
                self.table
                    .copy_from(&backup, |register| register < RAM_BEGIN);
                self.reboot(now);
                self.table.copy_from(&backup, is_backed_up_ram);
                self.backup = Some(backup);
            }
        }
        Ok(())
    }
}
