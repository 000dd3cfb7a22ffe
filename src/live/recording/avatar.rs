//! An avatar has no bytes on a wire: its targets are logged by their checksum, cycle by cycle.

use crate::base::JointState;
use crate::bus::tap::{Event, Log, Script};
use crate::bus::{BusError, CycleReport, ServoBus, TorqueReport};
use std::sync::Arc;

/// FNV-1a over the bits of `targets`.
fn checksum(targets: &[f64]) -> u64 {
    let bytes = targets.iter().flat_map(|v| v.to_bits().to_le_bytes());
    bytes.fold(0xCBF2_9CE4_8422_2325, |sum, byte| {
        (sum ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3)
    })
}

/// What is done with the checksum of each cycle.
enum Check {
    Log(Arc<Log>),
    Compare(Script),
}

/// Passes everything on and looks at the targets.
pub(super) struct TapBus {
    bus: Box<dyn ServoBus>,
    check: Check,
}

impl TapBus {
    /// Logs the targets that `bus` is given.
    pub fn new(bus: Box<dyn ServoBus>, log: Arc<Log>) -> Self {
        Self {
            bus,
            check: Check::Log(log),
        }
    }

    /// Compares them with those of `script`.
    pub fn replaying(bus: Box<dyn ServoBus>, script: Script) -> Self {
        Self {
            bus,
            check: Check::Compare(script),
        }
    }
}

impl ServoBus for TapBus {
    fn joints(&self) -> &[String] {
        self.bus.joints()
    }
    fn prepare(&mut self, states: &mut [JointState]) -> Result<(), BusError> {
        self.bus.prepare(states)
    }
    fn arm(&mut self) -> Result<(), BusError> {
        self.bus.arm()
    }
    fn goals(&self, out_rad: &mut [f64]) {
        self.bus.goals(out_rad);
    }
    fn exchange(
        &mut self,
        targets_rad: &[f64],
        states: &mut [JointState],
    ) -> Result<CycleReport, BusError> {
        let sum = checksum(targets_rad);
        match &mut self.check {
            Check::Log(log) => log.write(|entry| Event::Targets(sum).write(entry)),
            Check::Compare(script) => {
                let recorded = script.expect(
                    || "targets of a cycle".into(),
                    |event| match event {
                        Event::Targets(recorded) => Some(*recorded),
                        _ => None,
                    },
                );
                if let Some(recorded) = recorded.filter(|recorded| *recorded != sum) {
                    script.differ(
                        format!("targets with checksum {recorded:016x}"),
                        format!("targets with checksum {sum:016x}"),
                    );
                }
            }
        }
        self.bus.exchange(targets_rad, states)
    }
    fn torque_off(&mut self) -> Result<TorqueReport, BusError> {
        self.bus.torque_off()
    }
    fn rearm(&mut self, joint: usize) -> Result<(), BusError> {
        self.bus.rearm(joint)
    }
    fn reboot(&mut self, joint: usize) -> Result<(), BusError> {
        self.bus.reboot(joint)
    }
    fn notes(&self) -> &[String] {
        self.bus.notes()
    }
}
