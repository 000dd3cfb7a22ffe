//! The control table of one servo: bytes, access rules, ranges, indirect slots.

use super::motor::MotorSpec;
use crate::bus::dynamixel::model::{
    Access, IndirectBlock, Model, RAM_BEGIN, Register, Sign, address,
};
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

/// A servo as a device: its model, and what the host has no need to know of it.
#[derive(Debug)]
pub struct Device {
    /// Name, number, registers and modes, as the host knows them.
    pub model: &'static Model,
    /// Firmware version given by default; it knows the fast reads where the model does.
    pub firmware: u8,
    /// What its motor can do.
    pub motor: MotorSpec,
    /// Current at standstill and full duty, ampere.
    pub stall_a: f64,
    /// Duty (1 is full) per radian of error and count of the position P gain.
    pub duty_per_rad: f64,
    /// What registers hold at first, by name; those of all servos ([`COMMON`]) not named here, and 0 for those in neither.
    pub(super) initial: &'static [(&'static str, i64)],
    /// Registers where the device takes other values than the host's table says: name, least, greatest. Beside those of all
    /// servos.
    pub(super) ranges: &'static [(&'static str, i64, i64)],
}

/// What registers of every servo hold at first.
const COMMON: &[(&str, i64)] = &[
    ("id", 1),
    ("baud_rate", 1),
    ("return_delay_time", 250),
    ("operating_mode", 3),
    ("secondary_id", 255),
    ("protocol_type", 2),
    ("moving_threshold", 10),
    ("temperature_limit", 80),
    ("max_voltage_limit", 160),
    ("min_voltage_limit", 95),
    ("pwm_limit", 885),
    ("max_position_limit", 4095),
    ("shutdown", 52),
    ("status_return_level", 2),
    ("present_input_voltage", 120),
    ("present_temperature", 32),
];

/// Registers where every device takes other values than the host's table says.
const RANGES: &[(&str, i64, i64)] = &[
    // -1, tripped, is the servo's own word.
    ("bus_watchdog", 0, 127),
    // What is out of reach depends on the mode and is told as a limit, not as a range.
    ("goal_position", i32::MIN as i64, i32::MAX as i64),
];

impl Device {
    /// What a register holds at first; 0 when nothing is said of it.
    pub(super) fn initial(&self, name: &str) -> i64 {
        if matches!(
            name,
            "goal_position" | "present_position" | "position_trajectory"
        ) {
            return i64::from(self.model.centre_pulse);
        }
        let own = self.initial.iter().chain(COMMON);
        let mut named = own.filter(|(known, _)| *known == name);
        named.next().map_or(0, |(_, value)| *value)
    }

    /// All registers of a firmware: those of the model, and the slots of the indirect blocks.
    fn cells(&self, firmware: u8, blocks: &[IndirectBlock]) -> Vec<Cell> {
        let slots = |address: u16| blocks.iter().any(|block| block.covers(address));
        let plain = self.model.registers.iter();
        let mut cells: Vec<Cell> = plain
            .filter(|register| !slots(register.address))
            .map(|register| self.cell(*register, firmware))
            .collect();
        let end = end_of(&cells, blocks);
        for block in blocks {
            for slot in 0..block.slots {
                cells.push(Cell {
                    register: Register {
                        name: "indirect_address",
                        address: block.address + 2 * slot,
                        size: 2,
                        access: Access::ReadWrite,
                        min: i64::from(self.model.layout.ram_begin),
                        max: i64::from(end - 1),
                        unit: "",
                        sign: Sign::TwosComplement,
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
                        sign: Sign::TwosComplement,
                    },
                    initial: 0,
                });
            }
        }
        cells
    }

    fn cell(&self, mut register: Register, firmware: u8) -> Cell {
        let ranges = self.ranges.iter().chain(RANGES);
        let mut own = ranges.filter(|(name, ..)| *name == register.name);
        if let Some(&(_, min, max)) = own.next() {
            (register.min, register.max) = (min, max);
        }
        let initial = match register.address {
            address::MODEL_NUMBER => i64::from(self.model.number),
            address::FIRMWARE_VERSION => i64::from(firmware),
            _ => self.initial(register.name),
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
///
/// The servo's own hand ([`get`](Self::get), [`set`](Self::set) and the like) goes by the addresses of the X series, wherever the
/// model has the register; what comes over the wire goes by the model's own addresses.
#[derive(Clone, Debug)]
pub struct ControlTable {
    device: &'static Device,
    blocks: Vec<IndirectBlock>,
    cells: Vec<Cell>,
    /// Index into `cells` plus one, per byte address; 0 = unmapped.
    map: Vec<u16>,
    bytes: Vec<u8>,
}

impl ControlTable {
    /// A table of the device's default firmware with every register at its initial value.
    pub fn new(device: &'static Device) -> Self {
        Self::with_firmware(device, device.firmware)
    }

    /// A table of a firmware with every register at its initial value.
    pub fn with_firmware(device: &'static Device, firmware: u8) -> Self {
        let blocks: Vec<IndirectBlock> = device.model.indirect(firmware).copied().collect();
        let cells = device.cells(firmware, &blocks);
        let end = usize::from(end_of(&cells, &blocks));
        let mut map = vec![0; end];
        for (index, cell) in cells.iter().enumerate() {
            map[cell.span()].fill(index as u16 + 1);
        }
        let mut table = Self {
            device,
            blocks,
            cells,
            map,
            bytes: vec![0; end],
        };
        table.reset(|_| true);
        table
    }

    /// The model's own address of an X series register.
    fn own(&self, x_series: u16) -> u16 {
        self.device.model.layout.at(x_series)
    }

    /// The X series address of the register at the model's own `address`. EEPROM beyond the X series' counts as its last byte, so
    /// that comparing with [`RAM_BEGIN`] tells EEPROM from RAM.
    pub fn x_series(&self, address: u16) -> u16 {
        let layout = self.device.model.layout;
        if layout.is_eeprom(address) {
            address.min(RAM_BEGIN - 1)
        } else {
            layout.x_series(address)
        }
    }

    /// The device this table belongs to.
    pub fn device(&self) -> &'static Device {
        self.device
    }

    /// Puts every register whose X series address `which` accepts back to its initial value.
    pub fn reset(&mut self, which: impl Fn(u16) -> bool) {
        for cell in &self.cells {
            if which(self.x_series(cell.register.address)) {
                let size = usize::from(cell.register.size);
                self.bytes[cell.span()].copy_from_slice(&cell.initial.to_le_bytes()[..size]);
            }
        }
    }

    /// The unsigned value of the register at X series address `addr`; 0 when there is none.
    pub fn get(&self, addr: u16) -> u32 {
        self.value_at(self.own(addr))
    }

    /// The unsigned value of the register at the model's own address; 0 when there is none.
    fn value_at(&self, address: u16) -> u32 {
        let Some(cell) = self.cell_at(address) else {
            return 0;
        };
        let mut value = [0; 4];
        value[..usize::from(cell.register.size)].copy_from_slice(&self.bytes[cell.span()]);
        u32::from_le_bytes(value)
    }

    /// The value of the register at X series address `addr` as a two's complement number of its size.
    pub fn get_signed(&self, addr: u16) -> i32 {
        let value = self.get(addr);
        match self.register_at(self.own(addr)).map_or(4, |r| r.size) {
            1 => i32::from(value as u8 as i8),
            2 => i32::from(value as u16 as i16),
            _ => value as i32,
        }
    }

    /// Sets the register at X series address `addr` without any check: the servo's own hand. No register, no effect.
    pub fn set(&mut self, addr: u16, value: i64) {
        if let Some(cell) = self.cell_at(self.own(addr)) {
            let (span, size) = (cell.span(), usize::from(cell.register.size));
            self.bytes[span].copy_from_slice(&value.to_le_bytes()[..size]);
        }
    }

    /// Takes over every writable register of `other` whose X series address `which` accepts.
    pub fn copy_from(&mut self, other: &ControlTable, which: impl Fn(u16) -> bool) {
        for cell in &self.cells {
            let address = self.x_series(cell.register.address);
            if cell.register.access == Access::ReadWrite && which(address) {
                let span = cell.span();
                if let Some(bytes) = other.bytes.get(span.clone()) {
                    self.bytes[span].copy_from_slice(bytes);
                }
            }
        }
    }

    /// The register that the byte at the model's own address belongs to.
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
        for block in &self.blocks {
            if let Some(slot) = block.slot(addr) {
                let target = self.value_at(block.address + 2 * slot) as u16;
                let is_slot = self.blocks.iter().any(|b| b.slot(target).is_some());
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
