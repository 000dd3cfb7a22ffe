//! The control table of one servo: bytes, access rules, ranges, indirect slots.

use super::models::{Row, addr};
use super::motor::MotorSpec;
use std::ops::RangeInclusive;

/// First address of the RAM area; what lies below is EEPROM, locked while torque is on.
pub const RAM_START: u16 = 64;

/// Why a table refuses an access; the values are the error numbers of the status packet.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum TableError {
    /// The value is outside the register's range.
    Range = 4,
    /// A register was written in part only.
    Length = 5,
    /// The value exceeds what a limit register allows.
    Limit = 6,
    /// Read-only, unmapped, or EEPROM while torque is on.
    Access = 7,
}

/// One register: where it lies, who may write it, what it holds at first and what it may hold.
#[derive(Clone, Debug)]
pub struct Register {
    /// Address of the first byte.
    pub addr: u16,
    /// Size in bytes: 1, 2 or 4; little endian.
    pub size: u8,
    /// Whether a host may write it.
    pub writable: bool,
    /// Value out of the box (EEPROM) or after each boot (RAM).
    pub initial: i64,
    /// Values a host may write; registers with a negative lower bound are signed.
    pub range: RangeInclusive<i64>,
}

/// A block of indirect slots: slot `i` at `data + i` stands for the byte that `address + 2 i` names.
#[derive(Copy, Clone, Debug)]
pub struct IndirectBlock {
    /// Address of the first indirect address register (2 bytes each).
    pub address: u16,
    /// Address of the first indirect data byte.
    pub data: u16,
    /// Number of slots.
    pub slots: u16,
}

/// A servo model: its numbers and its registers.
#[derive(Debug)]
pub struct Model {
    /// Name on the command line, such as `xl430-w250`.
    pub name: &'static str,
    /// Model number, register 0.
    pub number: u16,
    /// Firmware version given by default; it knows the fast reads.
    pub firmware: u8,
    /// First firmware version that knows fast sync read, fast bulk read and table backup.
    pub fast_read_firmware: u8,
    /// Values of Operating Mode (11) that the model has.
    pub modes: &'static [u8],
    /// What its motor can do.
    pub motor: MotorSpec,
    pub(super) rows: &'static [Row],
    /// Indirect blocks.
    pub indirect: &'static [IndirectBlock],
}

/// The bytes of one servo's control table.
#[derive(Clone, Debug)]
pub struct ControlTable {
    model: &'static Model,
    registers: Vec<Register>,
    /// Index into `registers` plus one, per byte address; 0 = unmapped.
    map: Vec<u16>,
    bytes: Vec<u8>,
}

impl ControlTable {
    /// A table with every register at its initial value.
    pub fn new(model: &'static Model) -> Self {
        let mut registers: Vec<Register> = model
            .rows
            .iter()
            .map(|(addr, size, writable, initial, range)| Register {
                addr: *addr,
                size: *size,
                writable: *writable,
                initial: *initial,
                range: range.clone(),
            })
            .collect();
        let end = registers
            .iter()
            .map(|r| r.addr + u16::from(r.size))
            .chain(model.indirect.iter().map(|b| b.data + b.slots))
            .max()
            .unwrap_or(0);
        for block in model.indirect {
            for slot in 0..block.slots {
                registers.push(Register {
                    addr: block.address + 2 * slot,
                    size: 2,
                    writable: true,
                    initial: i64::from(block.data + slot),
                    range: i64::from(RAM_START)..=i64::from(end - 1),
                });
                registers.push(Register {
                    addr: block.data + slot,
                    size: 1,
                    writable: true,
                    initial: 0,
                    range: 0..=255,
                });
            }
        }
        let mut map = vec![0; usize::from(end)];
        for (index, register) in registers.iter().enumerate() {
            let first = usize::from(register.addr);
            map[first..first + usize::from(register.size)].fill(index as u16 + 1);
        }
        let mut table = Self {
            model,
            registers,
            map,
            bytes: vec![0; usize::from(end)],
        };
        table.reset(|_| true);
        table
    }

    /// The model this table belongs to.
    pub fn model(&self) -> &'static Model {
        self.model
    }

    /// Puts every register whose address `which` accepts back to its initial value.
    pub fn reset(&mut self, which: impl Fn(u16) -> bool) {
        for register in &self.registers {
            if which(register.addr) {
                let first = usize::from(register.addr);
                let size = usize::from(register.size);
                self.bytes[first..first + size]
                    .copy_from_slice(&register.initial.to_le_bytes()[..size]);
            }
        }
    }

    /// The unsigned value of the register at `addr`; 0 when there is none.
    pub fn get(&self, addr: u16) -> u32 {
        let Some(register) = self.register_at(addr) else {
            return 0;
        };
        let first = usize::from(register.addr);
        let mut value = [0; 4];
        let size = usize::from(register.size);
        value[..size].copy_from_slice(&self.bytes[first..first + size]);
        u32::from_le_bytes(value)
    }

    /// The value of the register at `addr` as a two's complement number of its size.
    pub fn get_signed(&self, addr: u16) -> i32 {
        let value = self.get(addr);
        match self.register_at(addr).map_or(4, |r| r.size) {
            1 => i32::from(value as u8 as i8),
            2 => i32::from(value as u16 as i16),
            _ => value as i32,
        }
    }

    /// Sets the register at `addr` without any check: the servo's own hand. No register, no effect.
    pub fn set(&mut self, addr: u16, value: i64) {
        if let Some(register) = self.register_at(addr) {
            let first = usize::from(register.addr);
            let size = usize::from(register.size);
            self.bytes[first..first + size].copy_from_slice(&value.to_le_bytes()[..size]);
        }
    }

    /// Takes over every writable register of `other` whose address `which` accepts.
    pub fn copy_from(&mut self, other: &ControlTable, which: impl Fn(u16) -> bool) {
        for register in &self.registers {
            if register.writable && which(register.addr) {
                let first = usize::from(register.addr);
                let span = first..first + usize::from(register.size);
                if let Some(bytes) = other.bytes.get(span.clone()) {
                    self.bytes[span].copy_from_slice(bytes);
                }
            }
        }
    }

    /// The register that the byte at `addr` belongs to.
    pub fn register_at(&self, addr: u16) -> Option<&Register> {
        let index = *self.map.get(usize::from(addr))?;
        self.registers.get(usize::from(index).checked_sub(1)?)
    }

    /// Where the byte at `addr` really lives: indirect data leads to the byte its slot names.
    ///
    /// A slot that names its own or another slot is plain storage.
    pub fn resolve(&self, addr: u16) -> u16 {
        for block in self.model.indirect {
            if (block.data..block.data + block.slots).contains(&addr) {
                let target = self.get(block.address + 2 * (addr - block.data)) as u16;
                let is_slot = self
                    .model
                    .indirect
                    .iter()
                    .any(|b| (b.data..b.data + b.slots).contains(&target));
                return if is_slot { addr } else { target };
            }
        }
        addr
    }

    /// Appends `len` bytes from `addr` to `out`; gaps between registers read as zero.
    ///
    /// Fails with [`TableError::Access`] when the span leaves the table or holds no register.
    pub fn read(&self, addr: u16, len: u16, out: &mut Vec<u8>) -> Result<(), TableError> {
        let first = usize::from(addr);
        let span = first..first + usize::from(len);
        let mapped = self.map.get(span).ok_or(TableError::Access)?;
        if mapped.iter().all(|&index| index == 0) {
            return Err(TableError::Access);
        }
        for offset in 0..len {
            let byte = usize::from(self.resolve(addr + offset));
            out.push(self.bytes.get(byte).copied().unwrap_or(0));
        }
        Ok(())
    }

    /// Checks a write of a host register by register; `value_check` sees each register's new value.
    ///
    /// Nothing is changed. EEPROM is refused while torque is on.
    pub fn check_write(
        &self,
        addr: u16,
        data: &[u8],
        mut value_check: impl FnMut(&Register, i64) -> Result<(), TableError>,
    ) -> Result<(), TableError> {
        if data.is_empty() {
            return Err(TableError::Length);
        }
        let end = usize::from(addr) + data.len();
        if end > self.bytes.len() {
            return Err(TableError::Access);
        }
        let torque_on = self.get(addr::TORQUE_ENABLE) != 0;
        let mut at = 0;
        while at < data.len() {
            let target = self.resolve(addr + at as u16);
            let register = self.register_at(target).ok_or(TableError::Access)?;
            if !register.writable || (torque_on && register.addr < RAM_START) {
                return Err(TableError::Access);
            }
            let size = usize::from(register.size);
            let bytes = data.get(at..at + size).ok_or(TableError::Length)?;
            let whole =
                (0..size).all(|i| self.resolve(addr + (at + i) as u16) == register.addr + i as u16);
            if !whole {
                return Err(TableError::Length);
            }
            let mut raw = [0; 4];
            raw[..size].copy_from_slice(bytes);
            let unsigned = u32::from_le_bytes(raw);
            let value = if *register.range.start() < 0 {
                let unused_bits = 32 - 8 * size as u32;
                i64::from(((unsigned << unused_bits) as i32) >> unused_bits)
            } else {
                i64::from(unsigned)
            };
            if !register.range.contains(&value) {
                return Err(TableError::Range);
            }
            value_check(register, value)?;
            at += size;
        }
        Ok(())
    }

    /// Stores the bytes of a write that [`Self::check_write`] accepted.
    pub fn store(&mut self, addr: u16, data: &[u8]) {
        for (offset, &byte) in data.iter().enumerate() {
            let target = usize::from(self.resolve(addr + offset as u16));
            if let Some(cell) = self.bytes.get_mut(target) {
                *cell = byte;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::models::XL430_W250;
    use super::*;

    #[test]
    fn bad_writes_are_told_apart() {
        let mut table = ControlTable::new(&XL430_W250);
        let any = |_: &Register, _| Ok(());
        assert_eq!(
            table.check_write(132, &[0; 4], any),
            Err(TableError::Access)
        );
        assert_eq!(table.check_write(71, &[0], any), Err(TableError::Access));
        assert_eq!(
            table.check_write(660, &[0; 9], any),
            Err(TableError::Access)
        );
        assert_eq!(
            table.check_write(116, &[0; 2], any),
            Err(TableError::Length)
        );
        assert_eq!(
            table.check_write(117, &[0; 4], any),
            Err(TableError::Length)
        );
        assert_eq!(table.check_write(64, &[2], any), Err(TableError::Range));
        assert_eq!(table.check_write(64, &[], any), Err(TableError::Length));
        assert_eq!(table.check_write(7, &[9], any), Ok(()));
        table.set(addr::TORQUE_ENABLE, 1);
        assert_eq!(table.check_write(7, &[9], any), Err(TableError::Access));
        let mut out = Vec::new();
        assert_eq!(table.read(660, 3, &mut out), Err(TableError::Access));
        assert_eq!(table.read(148, 4, &mut out), Err(TableError::Access));
    }

    #[test]
    fn indirect_data_leads_to_the_named_bytes() {
        let mut table = ControlTable::new(&XL430_W250);
        for slot in 0..4u16 {
            table.set(168 + 2 * slot, i64::from(132 + slot));
            table.set(578 + 2 * slot, i64::from(116 + slot));
        }
        table.set(addr::PRESENT_POSITION, 0x0102_0304);
        let mut out = Vec::new();
        table.read(224, 5, &mut out).expect("mapped span");
        assert_eq!(out, [4, 3, 2, 1, 0]);
        let goal = 777u32.to_le_bytes();
        assert_eq!(table.check_write(634, &goal, |_, _| Ok(())), Ok(()));
        table.store(634, &goal);
        assert_eq!(table.get(addr::GOAL_POSITION), 777);
        assert_eq!(
            table.check_write(634, &goal[..3], |_, _| Ok(())),
            Err(TableError::Length)
        );
        assert_eq!(
            table.check_write(224, &goal, |_, _| Ok(())),
            Err(TableError::Access),
            "slots that lead to a read-only register"
        );
    }

    #[test]
    fn negative_values_are_checked_as_signed() {
        let table = ControlTable::new(&XL430_W250);
        let pwm = |value: i16| table.check_write(100, &value.to_le_bytes(), |_, _| Ok(()));
        assert_eq!(pwm(-885), Ok(()));
        assert_eq!(pwm(-886), Err(TableError::Range));
        assert_eq!(pwm(885), Ok(()));
    }
}
