//! Where a model's registers lie: the beginning of its RAM, and its indirect blocks.

use super::RAM_BEGIN;

/// Where the registers lie that a driver works with.
///
/// The RAM registers of all Protocol 2.0 models with a table of the X series' kind stand in the same order; what differs is
/// where RAM begins. Addresses in [`address`](super::address) are those of the X series; [`Layout::at`] takes them to
/// this model's. Only what a model adds of its own (LEDs, external ports, the backup flag) stands elsewhere.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// First address of RAM: torque enable.
    pub ram_begin: u16,
    /// Added to addresses of the X series where the model has another kind of table: a client of Protocol 1.0 answers
    /// there with what its registers mean ([`one`](crate::bus::dynamixel::one)). 0: the table is of the X series' kind.
    pub window: u16,
}

impl Layout {
    /// X and MX series.
    pub const X: Layout = Layout {
        ram_begin: RAM_BEGIN,
        window: 0,
    };
    /// P series.
    pub const P: Layout = Layout {
        ram_begin: 512,
        window: 0,
    };
    /// Servos with Protocol 1.0. Their own addresses have one byte, so none of them is in the window.
    pub const ONE: Layout = Layout {
        ram_begin: 24,
        window: 0x1000,
    };

    /// This model's address of the register that lies at `x_series` on an X series servo.
    pub const fn at(self, x_series: u16) -> u16 {
        if self.window > 0 {
            self.window + x_series
        } else if x_series < RAM_BEGIN {
            x_series
        } else {
            x_series - RAM_BEGIN + self.ram_begin
        }
    }

    /// The X series' address of this model's `address`: the other way round. Addresses between the end of the common EEPROM
    /// and RAM (indirect addresses of the P series) have none and stay as they are.
    pub const fn x_series(self, address: u16) -> u16 {
        if self.window > 0 {
            address.saturating_sub(self.window)
        } else if address < self.ram_begin {
            address
        } else {
            address - self.ram_begin + RAM_BEGIN
        }
    }

    /// Whether `address` keeps its value without power and is locked while torque is on.
    pub const fn is_eeprom(self, address: u16) -> bool {
        address < self.ram_begin
    }
}

/// A block of indirect slots: slot `i` at `data + i` stands for the byte that `address + 2 i` names.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct IndirectBlock {
    /// First firmware that has it here.
    pub since: u8,
    /// Last firmware that has it here.
    pub until: u8,
    /// Address of the first indirect address register (2 bytes each).
    pub address: u16,
    /// Address of the first indirect data byte.
    pub data: u16,
    /// Number of slots.
    pub slots: u16,
}

impl IndirectBlock {
    /// A block that is the same in every firmware.
    pub const fn always(address: u16, data: u16, slots: u16) -> Self {
        IndirectBlock {
            since: 0,
            until: u8::MAX,
            address,
            data,
            slots,
        }
    }

    /// Whether this firmware has it.
    pub const fn is_in(&self, firmware: u8) -> bool {
        self.since <= firmware && firmware <= self.until
    }

    /// Whether an indirect address register lies at `address`.
    pub fn covers(&self, address: u16) -> bool {
        (self.address..self.address + 2 * self.slots).contains(&address)
    }

    /// The slot whose data byte lies at `address`.
    pub fn slot(&self, address: u16) -> Option<u16> {
        let slot = address.checked_sub(self.data)?;
        (slot < self.slots).then_some(slot)
    }
}
