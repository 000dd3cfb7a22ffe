//! The control table of one servo: bytes, access rules, ranges, indirect slots.

use super::motor::MotorSpec;
use crate::bus::dynamixel::model::{Access, Model, RAM_BEGIN, Register, address};
use handwave_dynamixel::ErrorCode;
use std::ops::Range;

/// Why a table refuses an access.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum TableError {
    /// The value is outside the register's range.
    Range,
    /// A register was written in part only.
    Length,
    /// The value exceeds what a limit register allows.
    Limit,
    /// Read-only, unmapped, or EEPROM while torque is on.
    Access,
}

impl From<TableError> for ErrorCode {
    fn from(error: TableError) -> Self {
        match error {
            TableError::Range => ErrorCode::DataRange,
            TableError::Length => ErrorCode::DataLength,
            TableError::Limit => ErrorCode::DataLimit,
            TableError::Access => ErrorCode::Access,
        }
    }
}

/// One register of a device and what it holds at first.
#[derive(Copy, Clone, Debug)]
struct Cell {
    register: Register,
    /// Value out of the box (EEPROM) or after each boot (RAM).
    initial: i64,
}

impl Cell {
    /// Where its bytes lie in the table.
    fn span(&self) -> Range<usize> {
        let first = usize::from(self.register.address);
        first..first + usize::from(self.register.size)
    }
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

impl IndirectBlock {
    /// Whether an indirect address register lies at `address`.
    fn covers(&self, address: u16) -> bool {
        (self.address..self.address + 2 * self.slots).contains(&address)
    }
}

/// A servo as a device: its model, and what the host has no need to know of it.
#[derive(Debug)]
pub struct Device {
    /// Name, number and registers, as the host knows them.
    pub model: &'static Model,
    /// Firmware version given by default; it knows the fast reads.
    pub firmware: u8,
    /// Values of Operating Mode (11) that the model has.
    pub modes: &'static [u8],
    /// What its motor can do.
    pub motor: MotorSpec,
    /// What registers hold at first, by name; those not named hold 0.
    pub(super) initial: &'static [(&'static str, i64)],
    /// Registers where the device takes other values than the host's table says: name, least, greatest.
    pub(super) ranges: &'static [(&'static str, i64, i64)],
    /// Indirect blocks.
    pub indirect: &'static [IndirectBlock],
}

impl Device {
    /// All registers: those of the model, and the slots of the indirect blocks.
    fn cells(&self) -> Vec<Cell> {
        let slots = |address: u16| self.indirect.iter().any(|block| block.covers(address));
        let plain = self.model.registers.iter();
        let mut cells: Vec<Cell> = plain
            .filter(|register| !slots(register.address))
            .map(|register| self.cell(*register))
            .collect();
        let end = end_of(&cells, self.indirect);
        for block in self.indirect {
            for slot in 0..block.slots {
                cells.push(Cell {
                    register: Register {
                        name: "indirect_address",
                        address: block.address + 2 * slot,
                        size: 2,
                        access: Access::ReadWrite,
                        min: i64::from(RAM_BEGIN),
                        max: i64::from(end - 1),
                        unit: "",
                    },
                    initial: i64::from(block.data + slot),
                });
                cells.push(Cell {
                    register: Register {
                        name: "indirect_data",
                        address: block.data + slot,
                        size: 1,
                        access: Access::ReadWrite,
                        min: 0,
                        max: 255,
                        unit: "",
                    },
                    initial: 0,
                });
            }
        }
        cells
    }

    fn cell(&self, mut register: Register) -> Cell {
        let own = self.ranges.iter().find(|(name, ..)| *name == register.name);
        if let Some(&(_, min, max)) = own {
            (register.min, register.max) = (min, max);
        }
        let initial = self.initial.iter().find(|(name, _)| *name == register.name);
        let initial = match register.address {
            address::MODEL_NUMBER => i64::from(self.model.number),
            address::FIRMWARE_VERSION => i64::from(self.firmware),
            _ => initial.map_or(0, |(_, value)| *value),
        };
        Cell { register, initial }
    }
}

/// Address behind the last register.
fn end_of(cells: &[Cell], indirect: &[IndirectBlock]) -> u16 {
    let plain = cells
        .iter()
        .map(|cell| cell.register.address + u16::from(cell.register.size));
    plain
        .chain(indirect.iter().map(|block| block.data + block.slots))
        .max()
        .unwrap_or(0)
}

/// The bytes of one servo's control table.
#[derive(Clone, Debug)]
pub struct ControlTable {
    device: &'static Device,
    cells: Vec<Cell>,
    /// Index into `cells` plus one, per byte address; 0 = unmapped.
    map: Vec<u16>,
    bytes: Vec<u8>,
}

impl ControlTable {
    /// A table with every register at its initial value.
    pub fn new(device: &'static Device) -> Self {
        let cells = device.cells();
        let end = usize::from(end_of(&cells, device.indirect));
        let mut map = vec![0; end];
        for (index, cell) in cells.iter().enumerate() {
            map[cell.span()].fill(index as u16 + 1);
        }
        let mut table = Self {
            device,
            cells,
            map,
            bytes: vec![0; end],
        };
        table.reset(|_| true);
        table
    }

    /// The device this table belongs to.
    pub fn device(&self) -> &'static Device {
        self.device
    }

    /// Puts every register whose address `which` accepts back to its initial value.
    pub fn reset(&mut self, which: impl Fn(u16) -> bool) {
        for cell in &self.cells {
            if which(cell.register.address) {
                let size = usize::from(cell.register.size);
                self.bytes[cell.span()].copy_from_slice(&cell.initial.to_le_bytes()[..size]);
            }
        }
    }

    /// The unsigned value of the register at `addr`; 0 when there is none.
    pub fn get(&self, addr: u16) -> u32 {
        let Some(cell) = self.cell_at(addr) else {
            return 0;
        };
        let mut value = [0; 4];
        value[..usize::from(cell.register.size)].copy_from_slice(&self.bytes[cell.span()]);
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
        if let Some(cell) = self.cell_at(addr) {
            let (span, size) = (cell.span(), usize::from(cell.register.size));
            self.bytes[span].copy_from_slice(&value.to_le_bytes()[..size]);
        }
    }

    /// Takes over every writable register of `other` whose address `which` accepts.
    pub fn copy_from(&mut self, other: &ControlTable, which: impl Fn(u16) -> bool) {
        for cell in &self.cells {
            if cell.register.access == Access::ReadWrite && which(cell.register.address) {
                let span = cell.span();
                if let Some(bytes) = other.bytes.get(span.clone()) {
                    self.bytes[span].copy_from_slice(bytes);
                }
            }
        }
    }

    /// The register that the byte at `addr` belongs to.
    pub fn register_at(&self, addr: u16) -> Option<&Register> {
        self.cell_at(addr).map(|cell| &cell.register)
    }

    fn cell_at(&self, addr: u16) -> Option<&Cell> {
        let index = *self.map.get(usize::from(addr))?;
        self.cells.get(usize::from(index).checked_sub(1)?)
    }

    /// Where the byte at `addr` really lives: indirect data leads to the byte its slot names.
    ///
    /// A slot that names its own or another slot is plain storage.
    pub fn resolve(&self, addr: u16) -> u16 {
        for block in self.device.indirect {
            if (block.data..block.data + block.slots).contains(&addr) {
                let target = self.get(block.address + 2 * (addr - block.data)) as u16;
                let is_slot = self
                    .device
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
        let torque_on = self.get(address::TORQUE_ENABLE) != 0;
        let mut at = 0;
        while at < data.len() {
            let target = self.resolve(addr + at as u16);
            let register = self.register_at(target).ok_or(TableError::Access)?;
            let locked = torque_on && self.device.model.is_eeprom(register);
            if register.access == Access::Read || locked {
                return Err(TableError::Access);
            }
            let size = usize::from(register.size);
            let bytes = data.get(at..at + size).ok_or(TableError::Length)?;
            let whole = (0..size)
                .all(|i| self.resolve(addr + (at + i) as u16) == register.address + i as u16);
            if !whole {
                return Err(TableError::Length);
            }
            let value = register.decode(bytes);
            if !(register.min..=register.max).contains(&value) {
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
        table.set(address::TORQUE_ENABLE, 1);
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
        table.set(address::PRESENT_POSITION, 0x0102_0304);
        let mut out = Vec::new();
        table.read(224, 5, &mut out).expect("mapped span");
        assert_eq!(out, [4, 3, 2, 1, 0]);
        let goal = 777u32.to_le_bytes();
        assert_eq!(table.check_write(634, &goal, |_, _| Ok(())), Ok(()));
        table.store(634, &goal);
        assert_eq!(table.get(address::GOAL_POSITION), 777);
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
