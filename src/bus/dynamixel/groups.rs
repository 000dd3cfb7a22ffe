//! Servos whose state is read in one go: those whose state registers lie at the same address.

use super::servo::ServoSpec;

/// Cycles in a row after which fast reads are given up.
const FAST_FAILURES: u32 = 5;

/// Servos that are read together.
#[derive(Debug)]
pub(super) struct ReadGroup {
    /// Where their state registers begin.
    pub address: u16,
    /// Whether they are read fast.
    pub fast: FastReads,
}

/// One group for each address of state registers, in the order of the servos; and the group of each servo.
pub(super) fn read_groups(specs: &[ServoSpec]) -> (Vec<ReadGroup>, Vec<usize>) {
    let mut groups: Vec<ReadGroup> = Vec::new();
    let members = specs.iter().map(|spec| {
        let address = spec.state_register();
        let known = groups.iter().position(|group| group.address == address);
        known.unwrap_or_else(|| {
            groups.push(ReadGroup {
                address,
                fast: FastReads::default(),
            });
            groups.len() - 1
        })
    });
    let members = members.collect();
    (groups, members)
}

/// One entry for each goal register and size in use, in the order of the servos.
pub(super) fn goal_registers(specs: &[ServoSpec]) -> Vec<(u16, u8)> {
    let mut registers = Vec::new();
    for register in specs.iter().map(ServoSpec::goal_register) {
        if !registers.contains(&register) {
            registers.push(register);
        }
    }
    registers
}

/// Whether fast reads are in use, and how they fared.
#[derive(Copy, Clone, Debug, Default)]
pub(super) struct FastReads {
    /// They are in use.
    pub on: bool,
    /// Cycles in a row in which a fast read brought nothing and an ordinary one did.
    failures: u32,
    /// The last fast read brought nothing, and no ordinary read has got through since.
    in_doubt: bool,
    /// A fast read has brought states, and none was in doubt since.
    pub works: bool,
}

impl FastReads {
    /// At the start: in use if all servos know them.
    pub fn new(on: bool) -> Self {
        FastReads {
            on,
            ..FastReads::default()
        }
    }

    /// Whether the first read of a cycle is a fast one. While they are in doubt, an ordinary one shows who is to blame: they
    /// or the line.
    pub fn first(&self) -> bool {
        self.on && !self.in_doubt
    }

    /// Gives fast reads up when time and again only ordinary reads get through.
    pub fn judge(&mut self, fast_was_mute: bool, asked_ordinary: bool, fresh: u16) {
        if !self.on {
            return;
        }
        let ordinary_got_through = fresh > 0 && asked_ordinary && (fast_was_mute || self.in_doubt);
        if ordinary_got_through {
            self.works = false;
            self.failures += 1;
            self.on = self.failures < FAST_FAILURES;
        } else if fresh > 0 {
            self.failures = 0;
        }
        self.in_doubt = fresh == 0 && (fast_was_mute || self.in_doubt);
    }
}
